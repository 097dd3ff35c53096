"""One call that compares laws: gains by one rule, the same files in every call, resumed from its
folder.
"""

import dataclasses
import functools
import math
import os
import re
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.browser import browser

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.analysis.tuning.result import load_tuned
from smc_mujoco.answers.explain import meaning
from smc_mujoco.cli import main
from smc_mujoco.cli.commands import options
from smc_mujoco.common import html
from smc_mujoco.common.tabular import Cell
from smc_mujoco.control import gain_sets
from smc_mujoco.control.units import FORCE, RATE, Gain
from smc_mujoco.robustness import worst_case
from smc_mujoco.studies import batches, compare, fair_gains
from smc_mujoco.studies.leaderboard import METRICS, Holdout

SHORT = {"duration": 0.5, "budget": 16, "progress": False}
PLANTS = ["duffing", "inverted_pendulum"]


@smc.law_function(
    gains={"lam": Gain(6.0, FORCE, positive=True), "k1": Gain(3.0, RATE, positive=True)}
)
def my_law(y, gains, memory):
    s = y.de + gains.k1 * y.e
    return -gains.lam * math.tanh(s), s


@smc.law_function(gains={"lam": 4.0, "k1": 3.0})
def plain_law(y, gains, memory):
    s = y.de + gains.k1 * y.e
    return -gains.lam * math.tanh(s), s


@smc.law_function(gains={"lam": 4.0, "k1": 3.0})
def terminal(y, gains, memory):
    return -gains.lam * np.sign(y.de + gains.k1 * y.e), y.e


@pytest.fixture(scope="module", autouse=True)
def searched_shortly():
    """Search gains by runs of 0.5 s."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fair_gains, "Objective", functools.partial(Objective, duration=0.5))
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("compared")


@pytest.fixture(scope="module")
def found(folder):
    laws = [my_law, "classical", smc.law("pid", kp=20.0)]
    return smc.compare(
        laws,
        PLANTS,
        ["friction", "encoder"],
        8,
        out=folder,
        **SHORT,
    )


def kinds(found, plant="duffing"):
    return {law: law_gains.source.kind for law, law_gains in found.gains[plant].items()}


def test_every_law_has_given_shipped_or_tuned_gains_and_its_table_says_which(found):
    kind_by_law = {"my_law": "tuned here", "classical": "shipped", "pid": "given"}
    for plant in PLANTS:
        assert kinds(found, plant) == kind_by_law
    mine = [found.gains[plant]["my_law"].gains for plant in PLANTS]
    assert mine[0] != mine[1]
    gains = found.tables[-1]
    rows = [(plant, law, kind) for plant in PLANTS for law, kind in kind_by_law.items()]
    assert [row[:3] for row in gains.rows] == rows
    assert "kp=20" in gains.rows[2][6]
    searches = found.gains["duffing"]["my_law"].source.search
    assert gains.rows[0][4:6] == (f"{searches.evaluations}", searches.apart)  # as `tune` says it
    assert gains.rows[2][4:6] == ("", "")  # of given gains
    starts = found.table.select(plant="duffing", law="pid", condition="friction")
    x0 = [starts.scenario(i).resolved.x0[0] for i in range(len(starts))]
    assert found.tables[-2].rows[0][2] == f"{min(x0):.3g}–{max(x0):.3g} m"


def test_a_table_of_runs_has_the_periods_and_bounds_of_all_conditions(tmp_path):
    slow = smc.condition("slow", control_period=0.02, u_max=3.0)
    laws = [smc.law("pid", kp=20.0)]
    settings = {"out": tmp_path, "duration": 0.1, "progress": False}
    compared = smc.compare(laws, "duffing", [slow, "nominal"], 1, **settings)
    assert compared.tables[-2].rows[0][1:4:2] == ("3.00 N or 6.00 N", "20 or 1")


def test_a_law_of_which_a_search_was_stuck_is_named(found):
    candidate = found.candidates["duffing"][0]
    for spread, said in ((0.9, False), (6.6, True)):
        search = dataclasses.replace(candidate.law.source.search, spread=spread)
        law = candidate.law.sourced("tuned here", search)
        renamed = dataclasses.replace(found, candidates={"duffing": [candidate._replace(law=law)]})
        words = "the final J values of its searches differ by up to 7.6 times, so where it trails, a search"
        assert (words in str(renamed.remarks)) is said


def test_a_gain_at_the_end_of_its_box_is_named_as_tune_names_it(found, folder):
    (file,) = (folder / "gains").glob("duffing-my_law*.json")
    tuned = load_tuned(file)
    assert fair_gains.candidate_of(my_law(), tuned).remark == ""
    lam = tuned.gains["lam"]
    at_its_end = dataclasses.replace(tuned, searched={**tuned.searched, "lam": (lam, 100.0 * lam)})
    (words,) = [
        note for note in at_its_end.tables[0].notes if "end of where it was searched" in note
    ]
    assert fair_gains.candidate_of(my_law(), at_its_end).remark == words


def test_runs_use_every_set_of_gains_in_turn(found):
    (mine, _, _) = found.candidates["duffing"]
    rows = found.table.select(plant="duffing", law="my_law", condition="encoder")
    used = [rows.scenario(i).law.gains for i in range(8)]
    assert len(mine.sets) == 12
    assert used == [mine.sets[i % len(mine.sets)].gains for i in range(8)]
    shipped = found.table.select(plant="duffing", law="classical", condition="encoder")
    sets = gain_sets.tuned("duffing", "classical").sets
    for i in range(8):
        assert shipped.scenario(i).law.gains["k"] == sets[i]["k"]


def test_its_numbers_are_those_of_the_leaderboard_in_every_form(found):
    boards = []
    for board in found.leaderboard:
        if board.about == "duffing, encoder":
            boards.append(board)
    assert [board.metric for board in boards] == [*METRICS]
    assert len(found.leaderboard) == len(METRICS) * 4 + 2  # and J on unseen runs on each plant
    summed = ", unseen runs under nominal, noise, delay_10ms, sine, constant, light and heavy: "
    assert found.tables[0].title.startswith(f"{found.leaderboard[0].about}{summed}")
    frame = found.to_pandas()
    assert len(frame) == len(found.verdicts) * 3
    frame = frame[(frame["metric"] == "itae") & (frame["law"] == "pid")]
    (row,) = frame.query("plant == 'duffing' and condition == 'encoder'").itertuples()
    (entry,) = [entry for entry in boards[3].entries if entry.law == "pid"]
    assert row.unit == "m s^2"
    assert (row.median, row.low, row.high, row.gains) == (*entry.interval[:3], "given")
    last = found.leaderboard.tables[-1]
    rows = last.to_latex().partition("\nPID & ")[2].splitlines()
    assert rows[1].startswith(r"\footnotesize given & ")
    assert meaning("shipped") in last.under[-1]
    assert "`" not in last.under[-1]
    assert found.to_latex().count(meaning("ITAE")) == 1
    assert found.to_latex().count(r"\begin{tabular}") == 6  # J on each plant, too
    assert found.full._repr_html_().count("<table") == 9  # times, runs and gains
    assert len(found.plot().axes) == 10  # of all five metrics, on both plants
    assert found.traces[0].scenario == found.table.scenario(0)
    assert len(found.traces) == 12


def test_latex_has_runs_conditions_gains_how_far_searches_differ_and_remarks_as_comments(found):
    head = [*filter(None, found.to_latex().partition("\\begin")[0].splitlines())]
    assert all(line.startswith("%") for line in head)
    words = " ".join(" ".join(line.removeprefix("%") for line in head).split())
    assert "1 0.5 friction: friction=(Coulomb(level=0.1), Viscous(b=0.05)) encoder: " in words
    assert "encoder: sensor=Encoder(counts=4096)" in words
    for plant in PLANTS:
        law = found.gains[plant]["my_law"]
        search = law.source.search
        tried = f"12 {search.evaluations} {search.apart}"
        assert f"{tried} lam=" in words
    assert found.remarks
    for remark in found.remarks:
        assert remark in words


def test_a_plot_that_has_no_room_for_all_metrics_keeps_those_in_which_a_law_wins(
    found, monkeypatch
):
    wins = [("tv_rate", "duffing", "encoder", "pid")]
    monkeypatch.setattr(type(found.leaderboard), "winners", wins)
    with pytest.warns(
        smc.errors.ScenarioWarning, match="plot leaves out settles, ultimate_bound and itae: "
    ):
        page = found.plot(size="ieee-column")
    names = [ax.get_xlabel().partition("\n")[0] for ax in page.axes[:2]]
    assert names == ["settling time", "variation of u"]
    assert page.get_size_inches()[1] < 9.25  # of a column


def test_its_page_has_every_median_and_verdict_and_needs_no_other_file(found, tmp_path):
    file = found.to_html(tmp_path / "page.html")
    text = file.read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    (title,) = re.findall("<h1>(.*?)</h1>", text)
    assert title == "my_law, Classical and PID on Duffing oscillator and Inverted pendulum"
    assert {address[:5] for address in re.findall(r' (?:src|srcset|href)="([^"]*)"', text)} == {
        "data:"
    }
    for table in found.tables:
        for cell in (cell for row in table.rows for cell in row if isinstance(cell, Cell)):
            assert f"{html.text(cell.text)}" in text
        for note in table.notes:  # verdicts
            assert html.text(note) in text


def test_the_figure_of_its_page_is_that_of_plot_with_j_first(found, monkeypatch):
    metrics_drawn = []

    def plot(self, path, *metrics, **options):
        metrics_drawn.append(metrics)
        path.write_text("<svg/>")

    monkeypatch.setattr(type(found), "plot", plot)
    assert len(found.pictures) == 1
    assert metrics_drawn == [(), ()]  # of a phone's width, and of a page's


@pytest.mark.slow
def test_its_page_fits_a_phone_and_turns_dark(found, tmp_path):
    file = found.to_html(tmp_path / "page.html")
    with browser() as chromium:
        phone = chromium.new_page(viewport={"width": 390, "height": 800}, color_scheme="dark")
        failures = []
        phone.on("console", lambda message: failures.append(message.text))
        phone.on("pageerror", lambda error: failures.append(str(error)))
        phone.goto(file.as_uri())
        assert failures == []
        assert phone.evaluate("document.documentElement.scrollWidth") == 390
        widths = "all => all.map(one => [one.naturalWidth, one.getBoundingClientRect().width])"
        ((natural, shown_width),) = phone.eval_on_selector_all("img", widths)
        assert natural < 390
        assert 0 < shown_width <= 358
        notes = "all => all.map(one => one.getBoundingClientRect().right)"
        assert max(phone.eval_on_selector_all("td[colspan] div", notes)) <= 390
        assert phone.evaluate("getComputedStyle(document.body).color") == "rgb(255, 255, 255)"


def test_a_law_that_fails_in_every_run_arrives_in_none_of_j(found):
    arrived = {"pid": np.ones(1, bool), "gone": np.ones(1, bool)}
    compare._leave_out_failed({"duffing": Holdout({}, arrived, {}, {}, 1.0, ())}, found.table)
    assert arrived == {"pid": True, "gone": False}


def test_the_same_call_goes_on_from_its_folder(found, folder, monkeypatch):
    monkeypatch.setattr(search, "tune", None)  # would raise
    monkeypatch.setattr(batches, "compute", lambda batches, *rest: [*batches].index(0))
    laws = [my_law, "classical", smc.law("pid", kp=20.0)]
    with pytest.raises(ValueError, match="0 is not in list"):  # no run is missing, so no batch
        smc.compare(
            laws,
            PLANTS,
            ["friction", "encoder"],
            8,
            out=folder,
            **SHORT,
        )


def contents(folder: Path) -> dict[str, bytes]:
    files = []
    for path in folder.rglob("*"):
        if path.is_file():
            files.append(path)
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_two_calls_write_the_same_bytes_whenever_wherever_and_with_any_threads(
    tmp_path, monkeypatch
):
    written = []
    now = time.time
    for name, threads, days in (
        ("here", 1, 0),
        ("there", 2, 400),
    ):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        monkeypatch.setattr(time, "time", lambda days=days: now() + 86400 * days)
        short = {"duration": 0.3, "seeds": 2, "threads": threads}
        laws = [my_law, "classical"]
        compared = smc.compare(
            laws,
            "duffing",
            ["noise", "coulomb"],
            out="compared",
            searches=2,
            budget=1,
            progress=False,
            **short,
        )
        compared.to_latex("tables.tex")
        smc.which(
            "duffing",
            "noise",
            laws=["pid", "classical"],
            out="which",
            **short,
        )
        written.append(contents(tmp_path / name))
    first, second = written
    assert {"compared/results.parquet", "which/results.parquet", "tables.tex"} <= set(first)
    assert first.keys() == second.keys()
    report = "compared/report.html"  # with times of this machine
    pages = [
        re.sub(rf"<section>[^\n]*{compare.TIMES}.*", "", files.pop(report).decode())
        for files in written
    ]
    assert pages[0] == pages[1]
    for name, content in first.items():
        assert content == second[name], name


def test_another_seed_draws_other_starts_and_noise_for_the_same_gains(tmp_path):
    tables = []
    for seed in (0, 1):
        settings = {"out": tmp_path, "seed": seed, **SHORT}
        compared = smc.compare(
            ["classical", "pid"],
            "duffing",
            "noise",
            3,
            **settings,
        )
        tables.append(compared.table)
        (holdout, *_) = compared.leaderboard
        tables.append(holdout.entries[0].interval.median)
    seeds = []
    for table in tables[::2]:
        seeds.append(table.column("seed")[:3].tolist())
    assert seeds == [[0, 1, 2], [1_000_000, 1_000_001, 1_000_002]]
    first, second = ([table.scenario(i) for i in range(3)] for table in tables[::2])
    for scenario, redrawn in zip(first, second, strict=True):
        assert scenario.law == redrawn.law
        assert scenario.resolved.x0 != redrawn.resolved.x0
    assert tables[1] != tables[3]  # J on other instances


@pytest.mark.parametrize("most", [3, 4])
def test_more_blocks_than_have_a_table_each_are_one_table_a_plant(most, tmp_path, monkeypatch):
    monkeypatch.setattr(compare, "MAX_BLOCKS", most)
    conditions = ["nominal", "noise", "sine", "constant"]
    compared = smc.compare(
        ["classical", "pid"],
        "duffing",
        conditions,
        1,
        out=tmp_path,
        **SHORT,
    )
    blocks = []
    for board in compared.leaderboard:
        if board.metric == "itae":
            blocks.append(len(board.blocks))
    assert blocks == ([4] if most == 3 else [1] * 4)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:no set of gains")
def test_a_gain_without_a_unit_is_searched_about_its_default_and_that_is_said(tmp_path):
    said = "gains lam and k1 of plain_law have no unit"
    with pytest.warns(smc.errors.ScenarioWarning, match=said):
        compared = smc.compare(
            [plain_law, "classical"],
            "duffing",
            "nominal",
            2,
            out=tmp_path,
            **SHORT,
        )
    assert kinds(compared)["plain_law"] == "tuned here"
    (remark,) = compared.remarks
    assert remark.startswith("plain_law on duffing: no unit is given for lam and k1, so ")


def test_without_tuning_laws_have_their_defaults_and_no_winner_is_named_over_them(tmp_path):
    laws = [my_law, smc.law("classical")]
    compared = smc.compare(
        laws,
        "duffing",
        "nominal",
        8,
        False,
        out=tmp_path,
        **SHORT,
    )
    assert kinds(compared) == {"my_law": "default", "classical": "shipped"}
    assert compared.remarks == ["my_law on duffing: default gains."]
    assert "classical" not in [board.winner for board in compared.leaderboard]


def test_laws_that_nobody_named_come_with_gains_on_a_plant_where_any_do():
    for name in ("duffing", "pendulum_network"):
        plant = smc.plant(name)
        laws = compare._usual(plant)
        assert set(gain_sets.LAWS) <= set(laws)
        for law in laws:
            assert gain_sets.in_set(plant, law, "tuned")


REFUSED = [
    (([my_law], "duffing", "noisy"), {}, "did you mean 'noise'"),
    (([my_law, my_law(lam=2.0)], "duffing"), {}, "two laws have the name 'my_law'"),
    (([terminal], "duffing"), {}, "'terminal' has the name of a law of the library: rename"),
    ((["pid", "pid"], "duffing"), {}, "'pid' is there twice: give it once"),
    (([my_law], ["duffing", "duffing"]), {}, "'duffing' is there twice"),
    (([my_law], "duffing", ["noise", "noise"]), {}, "'noise' is there twice"),
    (([my_law], "duffing"), {"worst": 5}, "give True or a class, such as smc.Uncertainty"),
]


@pytest.mark.parametrize(("arguments", "named", "said"), REFUSED)
def test_what_cannot_run_is_refused_before_any_gains_are_searched(
    arguments, named, said, tmp_path, monkeypatch
):
    monkeypatch.setattr(fair_gains.Trial, "search_gains", None)
    with pytest.raises(smc.ScenarioError, match=said):
        smc.compare(
            *arguments,
            out=tmp_path / "new",
            progress=False,
            **named,
        )
    assert not os.path.exists(tmp_path / "new")


def test_one_command_runs_tables_and_draws(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(
        "import smc_mujoco as smc\n\n@smc.law_function(gains={'k': 20.0, 'd': 5.0})\n"
        "def mine(y, gains, memory):\n    return -gains.k * y.e - gains.d * y.de, y.e\n"
    )
    words = ["compare", "inverted_pendulum,duffing", "--law", "classical,mine.py"]
    words += ["--condition", "friction", "--condition", "worn: friction=Coulomb(0.05)", "--no-tune"]
    words += ["--seeds", "2", "--duration", "0.1", "--out", "results", "--seed", "2"]
    words += ["--latex", "table.tex", "--figure", "fig"]
    with pytest.raises(SystemExit) as end:
        main.main(words)
    assert end.value.code in (0, None)
    printed = capsys.readouterr().out
    assert "the defaults of mine, not searched" in " ".join(printed.split())
    page = Path("results/report.html").read_text()
    assert "results/report.html" in printed
    assert "results/report.html" not in page
    assert "16 runs, 0 stopped early" in page
    assert "mine on inverted_pendulum and duffing: default gains" in page
    table = smc.Table.read("results")
    assert set(table.column("condition")) == {"friction", "worn"}
    assert set(table.column("seed")) == {2_000_000, 2_000_001}
    assert max(map(len, printed.splitlines())) <= 80
    assert Path("fig.svg").exists()
    assert Path("table.tex").read_text().count(r"\toprule") == 6


def test_the_worst_found_is_told_beside_the_median_and_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(worst_case, "default_budget", lambda scenario, within: 8)
    within = smc.Uncertainty(disturbance=0.5)
    laws = [smc.law("classical", k=5.0), smc.law("pid", kp=20.0)]
    settings = {"worst": within, "out": tmp_path, **SHORT}
    compared = smc.compare(
        laws,
        "duffing",
        "nominal",
        1,
        **settings,
    )
    for case in compared.worst["duffing"].values():
        assert smc.score(smc.run(case.scenario))["rms_error"] == case.value >= case.median
    (table,) = [table for table in compared.tables if "worst of 16 runs" in table.title]
    assert table.to_latex() in compared.to_latex()
    assert "\nPID & " in table.to_latex()
    assert table.label == table.title.replace("duffing:", "Duffing oscillator:") != table.title
    monkeypatch.setattr(worst_case, "worst_case", None)
    again = smc.compare(
        laws,
        "duffing",
        "nominal",
        1,
        **settings,
    )
    assert again.worst["duffing"]["pid"].scenario == compared.worst["duffing"]["pid"].scenario


@pytest.mark.quick
def test_shells_complete_the_last_name():
    assert options.PLANTS("duffing,inverted_pendulum_") == ["duffing,inverted_pendulum_network"]
    assert options.CONDITIONS("friction,noise+enc") == ["friction,noise+encoder"]
    assert "furuta" in options.SCENES("fur")


def test_conditions_are_names_with_commas_or_one_text(refused):
    texts = ["noise,sine", "worn: friction=Coulomb(0.05), x0=0.3", "encoder"]
    names = []
    for condition in options.conditions(texts):
        names.append(condition.name)
    assert names == ["noise", "sine", "worn", "encoder"]
    refused(lambda: options.conditions(["noise,worn: friction=Coulomb(0.05)"]), "comma")


def test_a_plot_shows_J_first_and_leaves_out_settled_runs_where_all_settle(tmp_path):
    compared = smc.compare(["pid", "adrc"], "duffing", "nominal", 6, out=tmp_path, progress=False)
    page = compared.plot()
    names = [ax.get_xlabel().partition("\n")[0] for ax in page.axes]
    assert names[0] == "J"
    assert "settled runs" not in names
    (board,) = [board for board in compared.leaderboard if board.metric == "objective"]
    medians = {entry.law: entry.interval.median for entry in board.entries}
    drawn = np.concatenate([np.ravel(line.get_xdata()) for line in page.axes[0].lines])
    assert set(medians.values()) <= set(drawn.tolist())


@pytest.mark.parametrize(("plants", "conditions", "count"), [(1, 1, 9), (2, 2, 9), (4, 5, 10)])
def test_a_quick_comparison_makes_as_many_searches_as_rank_its_laws(
    monkeypatch, plants, conditions, count
):
    class Searching(Exception):
        pass

    def candidates(trial, chosen, seeds):
        raise Searching(trial.search.searches)

    monkeypatch.setattr(fair_gains.Trial, "candidates", candidates)
    named = ["nominal", "noise", "coulomb", "delay_10ms", "encoder"][:conditions]
    with pytest.raises(Searching, match=f"^{count}$"):
        smc.compare(["pid", "adrc"], smc.plants()[:plants], named, quick=True)
