"""One call that compares laws: gains by one rule, their sources, verdicts that say where, resumed
from its folder.
"""

import dataclasses
import functools
import math
import re
import warnings

import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.cli import main
from smc_mujoco.cli.commands import options
from smc_mujoco.common.text import number
from smc_mujoco.control import gain_sets
from smc_mujoco.control.units import FORCE, RATE, Gain
from smc_mujoco.studies import compare, executors, fair_gains, worst_case
from smc_mujoco.studies.leaderboard import METRICS

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
    return smc.compare(laws, PLANTS, ["friction", "encoder"], 8, out=folder, **SHORT)


def kinds(found, plant="duffing"):
    return {law: made.source.kind for law, made in found.gains[plant].items()}


@pytest.mark.slow
def test_every_law_has_given_shipped_or_tuned_gains_and_its_table_says_which(found):
    assert kinds(found) == {"my_law": "tuned here", "classical": "shipped", "pid": "yours"}
    assert (
        found.gains["duffing"]["my_law"].gains != found.gains["inverted_pendulum"]["my_law"].gains
    )
    text = repr(found)
    for said in (r"my_law +tuned here +\d", r"classical +shipped +12", r"pid +yours +1 +kp=20"):
        assert re.search(said, text)
    assert max(map(len, text.splitlines())) <= 80


def test_a_comparison_s_table_of_gains_and_its_columns_for_programs_are_whole(found):
    *boards, gains = found.tables
    assert list(gains.headings) == ["plant", "law", "gains", "sets", "best set"]
    assert [tuple(row[:3]) for row in gains.rows] == [
        (plant, law, kind)
        for plant in ("duffing", "inverted_pendulum")
        for law, kind in (("my_law", "tuned here"), ("classical", "shipped"), ("pid", "yours"))
    ]
    assert all("=" in str(row[4]) for row in gains.rows)
    heads = " ".join(str(cell).replace("\n", " ") for cell in boards[-1].headings)
    assert all(unit in heads for unit in ("(%)", "(s)", "(rad)", "(rad s^2)", "(N m/s)"))
    names = "plant condition law gains metric unit median low high failed runs best winner worst_found time time_ratio"
    assert list(found.to_pandas().columns) == names.split()


def test_runs_use_every_set_of_gains_in_turn(found):
    one = next(
        candidate for candidate in found.candidates["duffing"] if candidate.law.name == "my_law"
    )
    assert len(one.sets) > 1
    rows = found.table.select(plant="duffing", law="my_law", condition="encoder")
    used = [rows.scenario(i).law.gains for i in range(len(rows))]
    assert used == [one.sets[seed % len(one.sets)].gains for seed in range(8)]
    shipped = found.table.select(plant="duffing", law="classical", condition="encoder")
    known = gain_sets.tuned("duffing", "classical").sets
    assert [shipped.scenario(i).law.gains["k"] for i in range(8)] == [
        known[seed]["k"] for seed in range(8)
    ]


@pytest.mark.slow
def test_a_verdict_names_its_metric_plant_and_condition(found):
    assert len(found.verdicts) == len(METRICS) * 4 + 2  # and J on unseen runs on each plant
    for board, verdict in zip(found.leaderboard, found.verdicts, strict=True):
        if "condition" in board.group:
            condition = f" under {board.group['condition']}"
        else:
            condition = ""
        assert verdict.startswith(f"{board.label} on {board.group['plant']}{condition}: ")
        assert board.result in " ".join(repr(found).split())


def test_its_numbers_are_those_of_the_leaderboard_in_every_form(found):
    frame = found.to_pandas()
    assert len(frame) == len(found.verdicts) * 3
    frame = frame[(frame["metric"] == "itae") & (frame["law"] == "pid")]
    (row,) = frame.query("plant == 'duffing' and condition == 'encoder'").itertuples()
    entry = next(
        entry
        for board in found.leaderboard
        if board.metric == "itae" and board.about == "duffing, encoder"
        for entry in board.entries
        if entry.law == "pid"
    )
    assert (row.median, row.low, row.high, row.gains) == (*entry.interval[:3], "yours")
    assert found.to_latex().count(r"\begin{tabular}") == 6  # J on each plant, too
    assert found._repr_html_().count("<table") == 7
    assert len(found.plot().axes) == 6


def test_a_plant_that_a_script_defines_keeps_the_gains_of_its_searches(tmp_path):
    """No catalogue has it, so its name says nothing to what reads the file of a tuning."""
    plant = dataclasses.replace(smc.plant("van_der_pol"), name="mine")
    trial = fair_gains.Trial([plant], (), 1.0, None, tmp_path, 1, False)
    made, read = (trial.gains_on(plant, [smc.law("classical").template], 2, 32) for _ in range(2))
    assert made[0].remark == ""
    assert len(made[0].sets) == 2
    assert [law.gains for law in made[0].sets] == [law.gains for law in read[0].sets]


def test_traces_are_those_of_the_first_seed(found):
    assert len(found.traces) == 12
    assert {trace.scenario.seed for trace in found.traces} == {0}
    assert smc.score(found.traces[0])["itae"] == found.table.column("itae")[0]


def test_the_same_call_goes_on_from_its_folder(found, folder, monkeypatch):
    monkeypatch.setattr(search, "tune", None)  # would raise
    monkeypatch.setattr(executors, "compute_here", lambda batches, *rest: [*batches].index(0))
    laws = [my_law, "classical", smc.law("pid", kp=20.0)]
    with pytest.raises(ValueError, match="0 is not in list"):  # no run is missing, so no batch
        smc.compare(laws, PLANTS, ["friction", "encoder"], 8, out=folder, **SHORT)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:no set of gains")
def test_a_gain_without_a_unit_is_searched_about_its_default_and_that_is_said(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = smc.compare([plain_law, "classical"], "duffing", "nominal", 2, out=tmp_path, **SHORT)
    assert kinds(made)["plain_law"] == "tuned here"
    assert (
        "plain_law: lam and k1 have no unit, so their search is about the defaults and not by the rule"
        in repr(made.remarks)
    )
    with pytest.warns(
        smc.errors.ScenarioWarning,
        match="plain_law's lam and k1 have no unit, and so a search about",
    ):
        tuned = smc.tune(
            "duffing", plain_law, budget=4, objective=Objective(duration=0.5), searches=1
        )
    assert tuned.bounds["lam"] == pytest.approx((4.0 * 10**-1.5, 4.0 * 10**1.5))


def test_what_is_tuned_is_said_before_it_starts_and_only_once(tmp_path, capsys, monkeypatch):
    """Two laws need two searches on each of two plants, of 30 s or 20 s, and one law has shipped
    gains.
    """
    each = {"duffing": 30.0, "inverted_pendulum": 20.0}
    monkeypatch.setattr(
        search, "expected_seconds", lambda plant, new, *_: len(new) * each[plant.name]
    )
    options = {
        "duration": 0.1,
        "searches": 2,
        "budget": 1,
        "tune": True,
        "out": tmp_path,
        "progress": True,
    }
    laws = [my_law, plain_law, "classical"]
    for said in (
        ["my_law and plain_law on duffing and inverted_pendulum: 2 searches each, about 3 minutes"],
        [],
    ):
        smc.compare(laws, PLANTS, "nominal", 1, **options)
        told = re.findall(
            r"^tuning (.*?)\. For less", capsys.readouterr().err, re.MULTILINE | re.DOTALL
        )
        assert [" ".join(text.split()) for text in told] == said


def test_many_laws_on_a_model_of_ones_own_are_announced_at_once_with_the_cure(
    tmp_path, capsys, monkeypatch
):
    """One evaluation stands for all laws, and the words fit a terminal."""
    monkeypatch.setenv("COLUMNS", "80")
    asked = []
    monkeypatch.setattr(search, "_seconds", lambda task: asked.append(task.law.name) or 0.1)
    monkeypatch.setattr(fair_gains.Trial, "tuned", lambda *_: pytest.fail("announced"))
    own = dataclasses.replace(smc.plant("duffing", delta=0.5), name="mine")
    with pytest.raises(pytest.fail.Exception, match="announced"):
        smc.which(own, laws=[*gain_sets.COMPARED, my_law], out=tmp_path, progress=True)
    lines = capsys.readouterr().err.splitlines()
    assert len(asked) == 2
    assert max(map(len, lines)) <= 80
    assert len(lines) <= 5
    assert {"--quick", "--law"} <= set(re.findall(r"--\w+", " ".join(lines)))


def test_without_tuning_laws_have_their_defaults_and_no_winner_is_named_over_them(tmp_path):
    made = smc.compare(
        [my_law, smc.law("classical")], "duffing", "nominal", 8, False, out=tmp_path, **SHORT
    )
    assert kinds(made) == {"my_law": "default", "classical": "shipped"}
    assert made.remarks == ["my_law: default gains (on duffing)"]
    winners = [board.winner for board in made.leaderboard]
    assert winners
    assert "classical" not in winners


def test_a_plant_on_which_laws_cannot_be_tuned_says_so(tmp_path):
    with pytest.raises(smc.ScenarioError, match=r"tuning is not possible here: .* defaults=True"):
        smc.compare(None, ["duffing", "overhead_crane"], "nominal", 1, out=tmp_path, **SHORT)
    assert not list(tmp_path.iterdir())
    made = smc.compare(
        None,
        "overhead_crane",
        "nominal",
        1,
        out=tmp_path,
        defaults=True,
        **SHORT | {"duration": 0.1},
    )
    assert set(kinds(made, "overhead_crane").values()) == {"default"}
    assert all("tuning is not possible here: " in remark for remark in made.remarks)


def test_laws_that_nobody_named_come_with_gains_on_a_plant_where_any_do():
    usual = {name: compare._usual(smc.plant(name)) for name in ("duffing", "pendulum_network")}
    assert usual["duffing"] == [*gain_sets.COMPARED]
    for name, laws in usual.items():
        assert (
            set(gain_sets.LAWS)
            <= {law for law in laws if gain_sets.in_set(smc.plant(name), law, "tuned")}
            == {*laws}
        )
    bare = dataclasses.replace(
        smc.plant("duffing", delta=0.5), name="mine", unmodelled="nobody wrote it"
    )
    assert {*gain_sets.COMPARED} - {*compare._usual(bare)} == {"lqi", "mpc", "loop_shaping"}


def test_what_cannot_run_is_refused_before_any_gains_are_searched(tmp_path, monkeypatch):
    monkeypatch.setattr(fair_gains.Trial, "tuned", None)
    for arguments, said in (
        (([my_law], "duffing", "noisy"), "did you mean 'noise'"),
        (([my_law, my_law(lam=2.0)], "duffing"), "two laws have the name 'my_law'"),
        (([my_law], "duffing", "nominal", 1, True, False, "ray"), "executor is 'ray'"),
    ):
        with pytest.raises(smc.ScenarioError, match=said):
            smc.compare(*arguments, out=tmp_path, progress=False)


@pytest.mark.slow
def test_one_command_tunes_runs_tables_and_draws(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(
        "import smc_mujoco as smc\n\n@smc.law_function(gains={'k': 20.0, 'd': 5.0})\n"
        "def mine(y, gains, memory):\n    return -gains.k * y.e - gains.d * y.de, y.e\n"
    )
    words = [
        "compare",
        "inverted_pendulum,duffing",
        "--law",
        "classical,mine.py",
        "--condition",
        "friction,encoder",
    ]
    words += [
        "--condition",
        "worn: friction=Coulomb(0.05), sensor=Encoder(counts=4096)",
        "--no-tune",
    ]
    words += [
        "--seeds",
        "2",
        "--duration",
        "0.1",
        "--out",
        "results",
        "--latex",
        "table.tex",
        "--figure",
        "fig",
    ]
    with pytest.raises(SystemExit) as end:
        main.main(words)
    assert end.value.code in (0, None)
    printed = capsys.readouterr().out
    table = smc.Table.read("results")
    assert set(table.column("condition")) == {"friction", "encoder", "worn"}
    assert "mine: default gains (on inverted_pendulum and duffing)" in " ".join(printed.split())
    assert max(map(len, printed.splitlines())) <= 80
    assert (tmp_path / "fig.svg").exists()
    assert (tmp_path / "table.tex").read_text().count(r"\toprule") == 8


def test_the_worst_found_is_told_beside_the_median_and_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(worst_case, "default_budget", lambda scenario, within: 8)
    within = smc.Uncertainty(disturbance=0.5)
    laws = [smc.law("classical", k=5.0), smc.law("pid", kp=20.0)]
    made = smc.compare(laws, "duffing", "nominal", 1, worst=within, out=tmp_path, **SHORT)
    for found in made.worst["duffing"].values():
        assert smc.score(smc.run(found.scenario))["rms_error"] == found.value >= found.median
    text = repr(made)
    assert "duffing: rms error in m, worst of 16 runs within |d| <= 0.5 N" in text
    assert all(number(each.value) in text for each in made.worst["duffing"].values())
    assert "worst found (m)" in made.to_latex()
    column = {row[0].text: row[-1] for row in made.leaderboard.tables[1].rows}
    assert column == {
        law: (one.shown(one.value), f"median {one.shown(one.median)}", False, "", "")
        for law, one in made.worst["duffing"].items()
    }
    monkeypatch.setattr(worst_case, "worst_case", None)
    again = smc.compare(laws, "duffing", "nominal", 1, worst=within, out=tmp_path, **SHORT)
    assert again.worst["duffing"]["pid"].scenario == made.worst["duffing"]["pid"].scenario
    attacked = []
    monkeypatch.setattr(
        worst_case,
        "cached_worst_case",
        lambda path, scenario, *_: attacked.append(scenario.duration),
    )
    smc.compare(laws, "duffing", "nominal", 1, worst=True, quick=True, out=tmp_path / "other")
    assert attacked == [8.0, 8.0]  # s, where no duration is given, whatever that of the other runs


def test_shells_complete_the_last_name():
    assert options.PLANTS("duffing,inverted_pendulum_") == ["duffing,inverted_pendulum_network"]
    assert options.CONDITIONS("enc") == ["encoder"]
    assert options.CONDITIONS("friction,noise+enc") == ["friction,noise+encoder"]
    assert options.LAWS("pid,super_twisting_u") == ["pid,super_twisting_unclamped"]
    assert "furuta" in options.SCENES("fur")


def test_conditions_are_names_with_commas_or_one_text(refused):
    texts = ["noise,sine", "worn: friction=Coulomb(0.05), x0=0.3", "encoder"]
    assert [one.name for one in options.conditions(texts)] == ["noise", "sine", "worn", "encoder"]
    refused(lambda: options.conditions(["noise,worn: friction=Coulomb(0.05)"]))


@pytest.mark.parametrize("worst", [5, "x", None])
def test_a_worst_case_that_is_no_class_is_refused_before_any_run(worst, tmp_path):
    with pytest.raises(
        smc.ScenarioError, match=r"^worst is .*: give True or a class, such as smc.Uncertainty"
    ):
        smc.compare(["classical"], "duffing", worst=worst, out=tmp_path / "new")
    assert not (tmp_path / "new").exists()
