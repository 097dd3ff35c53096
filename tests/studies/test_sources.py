"""Whose gains: a study keeps their sources, boards and pictures show them, and no winner is named
over defaults.
"""

import pytest

import smc_mujoco as smc
from smc_mujoco.answers.explain import meaning
from smc_mujoco.answers.facts import Barred
from smc_mujoco.cli import main
from smc_mujoco.control import gain_sets
from smc_mujoco.simulation import run_key

FAST, SLOW = (
    smc.law("observer_free", lam=6.0, k1=k1).named(name)
    for k1, name in ((4.0, "fast"), (2.0, "slow"))
)


def at_default(law):
    """The same run, with gains that count as the law's defaults."""
    return law.sourced("default")


def ranked(laws, out, **options):
    """The board of ITAE of laws on the Duffing oscillator."""
    table = smc.study(smc.grid("duffing", laws, "nominal", 16, duration=2.5), out)
    return smc.leaderboard(table, ["itae"], **options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("study")


@pytest.mark.slow
def test_a_winner_is_named_over_rivals_at_their_defaults_only_where_it_is_asked_for(folder):
    (fair,) = ranked([FAST, SLOW], folder)
    assert fair.winner == "fast"
    boards = ranked([FAST, at_default(SLOW)], folder)
    (unfair,) = boards
    assert unfair.winner is None
    assert unfair.blocks[0].winner is None
    fact = unfair.blocks[0].verdict
    assert isinstance(fact, Barred)
    assert fact.laws == ("slow",)
    assert "textbf" not in boards.to_latex()
    (board,) = ranked([FAST, at_default(SLOW)], folder, defaults=True)
    assert board.winner == "fast"


def test_a_law_at_its_own_defaults_may_win_over_others(folder):
    (board,) = ranked([at_default(FAST), SLOW], folder)
    assert board.winner == "fast"


def test_boards_print_the_sources(folder):
    boards = ranked([FAST, at_default(SLOW)], folder)
    names = {row[0].text: row[0].below for row in boards.tables[0].rows}
    assert names == {"fast": "given", "slow": "default"}
    _, _, row = boards.to_latex().partition("\nslow & ")
    assert row.splitlines()[1].startswith(r"\footnotesize default & ")
    assert meaning("default") in boards.tables[0].under[-1]


def test_equal_gains_are_one_run_and_the_table_has_the_source_of_this_study(folder):
    first = ranked([FAST, SLOW], folder)
    parts = sorted((folder / "parts").iterdir())
    again = ranked([FAST, at_default(SLOW)], folder)
    assert sorted((folder / "parts").iterdir()) == parts  # nothing ran again
    assert [entry.interval for entry in first[0].entries] == [
        entry.interval for entry in again[0].entries
    ]
    table = smc.Table.read(folder)
    assert dict(zip(table.column("law"), table.column("source"), strict=True)) == {
        "fast": "given",
        "slow": "default",
    }
    assert table.scenario(16).law.source.kind == "default"
    tuned, default = (smc.Scenario(plant="duffing", law=law) for law in (SLOW, at_default(SLOW)))
    assert run_key.run_key(tuned) == run_key.run_key(default)


@pytest.mark.quick
def test_a_table_keeps_the_search_behind_the_gains(tmp_path):
    law = gain_sets.law_with_gains("duffing", "classical", seed=0)
    smc.study(smc.grid("duffing", "classical", duration=0.1), tmp_path)
    assert smc.Table.read(tmp_path).scenario(0).law.source == law.source


@pytest.mark.slow
def test_compare_names_a_winner_over_defaults_with_an_option(tmp_path, capsys):
    laws = "fast: observer_free(lam=6, k1=2), adaptive"
    options = ["--condition", "nominal", "--seeds", "16", "--duration", "2", "--gains", "default"]
    for extra in (
        [],
        ["--allow-defaults"],
    ):
        with pytest.raises(SystemExit):
            main.main(
                ["compare", "duffing", "--law", laws, *options, "--out", str(tmp_path), *extra]
            )
        printed = " ".join(capsys.readouterr().out.split())
        assert ("no law may win over the default gains of adaptive" in printed) == (not extra)
        assert "defaults of adaptive" in printed


def test_figures_and_films_say_whose_gains_are_drawn():
    from smc_mujoco.draw.figure import DrawnRuns

    laws = [FAST, at_default(SLOW)]
    mixed = smc.run([smc.Scenario(plant="duffing", law=law, duration=0.1) for law in laws])
    alike = [mixed[0], mixed[0]]
    drawn = []
    for label in smc.figure(mixed).legends[0].get_texts():
        drawn.append(label.get_text())
    assert {"fast, gains: given", "slow, gains: default"} <= set(drawn)
    assert [note.get_text() for note in smc.figure(alike).artists] == ["gains: given"]
    assert DrawnRuns.of(mixed, ["fast", "slow"]).gains == "gains: given for fast, default for slow"


@pytest.mark.parametrize(("size", "beside"), [(None, True), ("ieee-column", False)])
def test_labels_of_a_user_stay_and_the_sources_of_gains_are_beside_the_title_or_in_the_label(
    size, beside
):
    laws = [FAST, at_default(SLOW)]
    mixed = smc.run([smc.Scenario(plant="duffing", law=law, duration=0.1) for law in laws])
    labels = ["a", "b_c"]
    page = smc.figure(mixed, labels=labels, size=size)
    drawn = [label.get_text() for label in page.legends[0].get_texts()]
    assert drawn[:2] == labels
    said = "gains: given for a, default for b_c"
    assert [note.get_text() for note in page.artists if note.get_text() == said] == [said] * beside
    assert (said in str(page.get_label())) == (not beside)
    untitled = smc.figure(mixed, labels=labels, size=size, title="")
    assert "gains: given for a, default for b_c" in str(untitled.get_label())
    twins = smc.figure(mixed, labels=["a", "a"])
    assert [note.get_text() for note in twins.artists] == ["gains: given for a 1, default for a 2"]


def test_an_empty_title_of_medians_draws_none_and_the_key_has_the_source_of_gains(tmp_path):
    smc.study(smc.grid("duffing", "classical", duration=0.1), tmp_path)
    table = smc.Table.read(tmp_path)
    pages = {title: smc.plot(table, metrics=["itae"], title=title) for title in (None, "", "T")}
    for title, page in pages.items():
        (legend,) = page.legends
        head = legend.get_title().get_text()
        assert head == {None: "Medians: Duffing oscillator"}.get(title, title)
        key = [text.get_text() for text in legend.get_texts()]
        assert ("gains: shipped" in key) == (title == "")
        plant = "Duffing oscillator" if title == "T" else ""  # else the caption tells it
        assert page.axes[0].get_title(loc="left") == plant
    assert pages[""].get_figheight() < pages[None].get_figheight()
