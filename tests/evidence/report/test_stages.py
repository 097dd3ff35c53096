"""How a report is put together: its plan, its progress, what it keeps, and small pieces of its
stages.
"""

import contextlib
import dataclasses
import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.sketch import made

import smc_mujoco as smc
from smc_mujoco.common import extras
from smc_mujoco.control import gain_sets
from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable
from smc_mujoco.evidence.report import about, films, oscillation, paper, plan, rigs, stages, words
from smc_mujoco.evidence.report import report as make
from smc_mujoco.evidence.report.plan import FULL, QUICK, Bars, Plan, Work
from smc_mujoco.evidence.report.stages import Field


def test_the_plans_of_the_full_and_the_quick_report_are_as_recorded(snapshot):
    full, quick = (dataclasses.asdict(plan) for plan in (FULL, QUICK))
    lines = [f"{name}: {value}" for name, value in full.items()]
    lines += [f"quick {name}: {value}" for name, value in quick.items() if value != full[name]]
    assert "\n".join(lines) == snapshot


def work(tmp_path, plan=QUICK, shown=False):
    return Work(plan=plan, folder=tmp_path, threads=3, bars=Bars(shown))


def test_a_stage_shows_its_share_of_items_and_its_time(tmp_path, monkeypatch, capsys):
    reached = []
    monkeypatch.setattr(
        "smc_mujoco.common.progress.Bar.reached",
        lambda self, done, whole: reached.append((done, whole)),
    )
    monkeypatch.setattr(plan, "time", SimpleNamespace(monotonic=iter([10.0, 13.4]).__next__))
    bars = Bars(False)
    its = dataclasses.replace(work(tmp_path), bars=bars)

    def compute(item, report):
        report(1, 4)
        report(0, 0)
        return item.upper()

    assert its.each("maps", "plants", ["a", "b"], compute) == ["A", "B"]
    assert reached == [(0.25, 2), (0.0, 2), (1, 2), (1.25, 2), (1.0, 2), (2, 2)]
    assert bars.spent == {"maps": pytest.approx(3.4)}
    assert capsys.readouterr().out == ""
    monkeypatch.setattr(plan, "time", SimpleNamespace(monotonic=iter([10.0, 13.4]).__next__))
    shown = Bars(True)
    with shown.stage("maps", "2 plants", bar=False):
        pass
    assert capsys.readouterr().out == "maps        2 plants              3 s\n"


def noted(monkeypatch, path, gives=None):
    """Replace a function by one that notes its arguments."""
    calls = []

    def stub(*given, **options):
        calls.append((given, options))
        if callable(gives):
            return gives(*given, **options)
        return gives

    monkeypatch.setattr(f"smc_mujoco.{path}", stub)
    return calls


def test_a_report_is_of_its_plan_and_its_changes(tmp_path, monkeypatch):
    found = noted(monkeypatch, "evidence.report.stages.find")
    noted(monkeypatch, "evidence.report.page.page", "the page")
    assert (
        make(tmp_path, quick=True, seeds=2, threads=3, laws=["lqr", "classical"], relevant=0.1)
        == tmp_path / "report.html"
    )
    ((plan, folder, threads, bars, records),) = [given for given, _ in found]
    changes = {"seeds": 2, "relevant": 0.1, "laws": (*QUICK.laws, "lqr")}
    assert plan == dataclasses.replace(QUICK, **changes)
    assert (folder, threads, bars.shown, records) == (tmp_path, 3, False, None)
    assert (tmp_path / "report.html").read_text() == "the page"
    make(str(tmp_path), progress=True, records="there")
    (plan, folder, threads, bars, records), _ = found[-1]
    assert (plan, folder, threads, bars.shown, records) == (
        FULL,
        tmp_path,
        None,
        True,
        Path("there"),
    )
    make(tmp_path, plan=QUICK, quick=False)
    assert found[-1][0][0] is QUICK


def names(folder):
    """The files of a folder, without the hashes of what they depend on."""
    return sorted(re.sub("(-[0-9a-f]{12})+", "", file.name) for file in folder.iterdir())


class Listed(list):
    """What a stage makes for one item, kept as JSON."""

    def save(self, path):
        path.write_text(json.dumps(self))


def test_a_report_needs_its_packages(tmp_path, monkeypatch):
    asked = noted(monkeypatch, "common.extras.missing", "install it")
    for one in (make, paper.report):
        with pytest.raises(extras.MissingPackageError, match="install it"):
            one("gaber" if one is paper.report else tmp_path)
    assert [given for given, _ in asked] == [("report", "a report", "jinja2")] * 2


def test_records_of_a_folder_are_read_in_the_order_of_their_names(tmp_path, monkeypatch):
    files = [tmp_path / name for name in ("b.npz", "c.txt", "a.csv")]
    monkeypatch.setattr(Path, "iterdir", lambda _: iter(files))
    monkeypatch.setattr(rigs.records, "load", lambda path: dict.fromkeys("txur", path.name))
    assert [(path.name, twin.name, record["t"]) for path, twin, record in rigs.read(tmp_path)] == [
        ("a.csv", "emps", "a.csv"),
        ("b.npz", "emps", "b.npz"),
    ]


STAGES = {  # stage -> the function that does its work for one item, and what that gives here
    "worst_cases": ("evidence.report.stages.cached_worst_case", lambda folder, *_: folder.name),
    "all_margins": ("evidence.report.stages.margin_search.margins", lambda *_, **__: []),
    "margins_by_set": ("evidence.report.stages.margin_search.margins", lambda *_, **__: []),
    "all_basins": ("evidence.report.stages.regions.basin", lambda *_, **__: Listed()),
    "judged_claims": ("evidence.report.stages.audit", lambda *_, **__: SimpleNamespace(claims=[])),
}
GIVEN = {"margins_by_set": [()], "judged_claims": ["the table"]}  # what the stages before have made
SMALL = dataclasses.replace(
    QUICK,
    plants=("duffing", "van_der_pol"),
    attacked=("duffing",),
    basins=("duffing",),
    laws=("pid", "lqr"),
    basin_laws=("pid",),
    compared=("delay",),
    claims=("3", "18"),
)


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_hands_on_its_plan_and_keeps_a_file_for_each_item(
    stage, tmp_path, monkeypatch, capsys, snapshot
):
    path, gives = STAGES[stage]
    calls = noted(monkeypatch, path, gives)
    if stage == "all_basins":
        monkeypatch.setattr("smc_mujoco.analysis.region_of_attraction.Basin.save", Listed.save)
        monkeypatch.setattr("smc_mujoco.analysis.region_of_attraction.load", lambda path: path)
    getattr(stages, stage)(work(tmp_path, SMALL, shown=True), *GIVEN.get(stage, ()))
    lines = [re.sub(r" *\d+ s$", "", line) for line in capsys.readouterr().out.splitlines()]
    for given, options in calls:
        plain = []
        for one in given:
            plain.append(
                one.name if isinstance(one, Path) else one.__name__ if callable(one) else one
            )
        plain = [
            f"{one.law.name} on {one.plant.name}" if isinstance(one, smc.Scenario) else one
            for one in plain
        ]
        lines.append(
            f"{plain} { ({name: one for name, one in options.items() if name != 'report'}) }"
        )
    lines += names(tmp_path)
    assert "\n".join(lines) == snapshot


def test_findings_are_what_the_stages_give_in_their_order(tmp_path, monkeypatch, snapshot):
    done = []
    bars = Bars(False)
    names = (
        "rigs.repeated grid judged_claims worst_cases all_margins margins_by_set all_basins all_scenes rigs.machines "
        "flight.flight oscillation.oscillations accuracies leaderboard families.leads films.medians scores.scores "
        "fields fronts about.about"
    )

    def stub(name):
        return lambda *given, **named: (
            done.append(f"{name}({', '.join(map(shown, (*given, *named.values())))})")
            or f"of {name}"
        )

    def shown(value):
        if value is bars.spent:
            return "spent"
        if isinstance(value, (Work, Plan)):
            return type(value).__name__
        return f"{value}"

    for name in names.split():
        monkeypatch.setattr(f"smc_mujoco.evidence.report.stages.{name}", stub(name))
    monkeypatch.setattr(stages.video, "missing", lambda: "no film: no renderer")
    findings = stages.find(SMALL, tmp_path, 3, bars, Path("there"))
    assert (
        "\n".join(
            [*done, *(f"{name}: {value}" for name, value in vars(findings).items()), *bars.spent]
        )
        == snapshot
    )


def test_the_grid_is_kept_and_its_noise_is_drawn_for_a_user_s_law(tmp_path, monkeypatch):
    users = []
    calls = noted(monkeypatch, "evidence.report.stages.study", "the table")
    monkeypatch.setattr(stages, "has_user_code", lambda scenario: scenario.law.name in users)
    plan = dataclasses.replace(SMALL, plants=("duffing",))
    for users[:], key in (([], 0), (["lqr"], "drawn")):
        assert stages.grid(work(tmp_path, plan)) == "the table"
        (runs, folder), options = calls.pop()
        assert [(one.law.name, one.condition, one.seed, one.duration) for one in runs] == [
            (law, condition, seed, 3.0)
            for condition in plan.conditions
            for law in ("pid", "lqr")
            for seed in range(24)
        ]
        assert (folder, options) == (
            tmp_path / "study",
            {"threads": 3, "progress": False, "noise_key": key, "half_steps": True},
        )


def test_what_the_grid_was_is_told(monkeypatch):
    columns = {
        "failure": [None, "far", None, "far", "far"],
        "seed": np.array([0, 1, 1, 2, 0]),
        "versions": ['{"a": "1"}'],
    }
    table = type("Table", (), {"column": lambda _, name: columns[name], "__len__": lambda _: 5})()
    monkeypatch.setattr(about.paired_runs, "sources", lambda table: ["tuned"])
    monkeypatch.setattr(about, "in_words", lambda sources: f"in words {sources}")
    its = about.about(SMALL, table, {"grid": 1.5}, "no renderer")
    assert (its.plan, its.runs, its.failed, its.seeds, its.sources) == (
        SMALL,
        5,
        3,
        3,
        "in words ['tuned']",
    )
    assert list(its.versions) == ["a", "pyarrow", "scipy"]
    assert (its.spent, its.no_film) == ({"grid": 1.5}, "no renderer")


def test_accuracy_is_of_each_condition_with_the_plan_s_periods(tmp_path, monkeypatch):
    calls = noted(monkeypatch, "evidence.report.stages.accuracy", lambda *_, **__: AccuracyTable())
    assert stages.accuracies(work(tmp_path, SMALL)) == []
    expected = []
    for one in ("constant", "coulomb"):
        expected.append((SMALL.laws, "duffing", SMALL.periods, one, 1, "tuned"))
    assert [given for given, _ in calls] == expected
    assert all(options["threads"] == 3 for _, options in calls)
    assert names(tmp_path) == [f"accuracy-duffing-{one}.json" for one in stages.ACCURACY_CONDITIONS]
    stages.accuracies(work(tmp_path, SMALL))
    assert len(calls) == 2  # read from their files
    stages.accuracies(work(tmp_path, dataclasses.replace(SMALL, accuracy_starts=2)))
    assert len(calls) == 4


def test_v_rises_where_its_rate_is_positive_off_the_surface():
    x = np.array([0.0, 1.0])
    v = np.array([-1.0, 0.0, 2.0])
    rate = np.array([[1.0, -1.0], [0.0, 2.0], [3.0, 1e-9]])
    s = np.array([[1.0, 1.0], [1.0, -1.0], [1e-6, 1.0]])
    field = Field(plant="duffing", x=x, v=v, vdot=rate, s=s)
    assert field.rises.tolist() == [[True, False], [False, True], [False, True]]
    assert field.share == 0.5
    assert stages.fields(dataclasses.replace(SMALL, laws=("pid",))) == ()
    (own, _) = stages.fields(dataclasses.replace(SMALL, laws=("observer_free",)))
    assert (own.plant, own.vdot.shape, own.x.shape, own.v.shape) == (
        "duffing",
        (121, 121),
        (121,),
        (121,),
    )


def test_a_film_has_every_frame(tmp_path, monkeypatch):
    written = []
    reached = []
    count = 30

    @contextlib.contextmanager
    def encoder(path, shape, fps):
        written.append((path.name, shape, fps))
        yield lambda picture: written.append(int(picture[0, 0, 0]))
        path.write_bytes(b"webm")

    trace = made(smc.Scenario(plant="duffing", law="pid", duration=1.0))
    pictures = [np.full((4, 4, 3), 4 * k, np.uint8) for k in range(count)]
    monkeypatch.setattr(films, "encoder", encoder)
    monkeypatch.setattr(films.video, "Frames", lambda traces, title, size, fps: pictures)
    film = films.film([trace], "title", lambda done, whole: reached.append((done, whole)))
    assert written == [("film.webm", (540, 960), 20), *range(0, 4 * count, 4)]
    assert reached == [(k + 1, count) for k in range(count)]
    assert film == b"webm"


def test_limit_cycles_are_of_laws_behind_a_lag_and_a_law_without_prediction_is_left_out(
    tmp_path, monkeypatch
):
    cycle = type(
        "Cycle",
        (),
        {"amplitude": 0.2, "frequency": 9.0, "third_harmonic": 0.04, "uncertainty": 0.1},
    )

    def predicted(scenario):
        if scenario.law.name == "lqr":
            raise smc.ScenarioError("no prediction")
        return cycle

    halved = [type("Change", (), {"marked": marked}) for marked in (True, False, False)]
    runs = noted(
        monkeypatch,
        "evidence.report.oscillation.run",
        lambda cases, threads: [made(one) for one in cases],
    )
    changes = noted(monkeypatch, "evidence.report.oscillation.step_halving", halved)
    monkeypatch.setattr(oscillation, "chattering", predicted)
    monkeypatch.setattr(oscillation, "channel_cycle", lambda trace: (0.25, 8.0))
    plan = dataclasses.replace(SMALL, plants=("duffing",), laws=("pid", "lqr", "classical"))
    reached = []
    found = oscillation._on(
        "duffing", plan.laws, 3, lambda done, whole: reached.append((done, whole))
    )
    assert reached == [(0, 3), (1, 3), (2, 3)]
    (cases, threads), _ = runs[0]
    assert threads == 3
    assert [(one.law.name, one.actuator, one.duration, one.condition) for one in cases] == [
        (law, (smc.Lag(0.01),), 8.0, "nominal") for law in plan.laws
    ]
    assert changes[0][0][1:] == (0, 3)
    one, two = found
    assert (one.law, one.marked, two.law, two.marked) == ("pid", True, "classical", False)
    assert dataclasses.astuple(one)[2:8] == (0.2, 9.0, 0.25, 8.0, 0.04, 0.1)
    assert one.error == pytest.approx(-20.0)


def test_a_report_says_what_a_condition_sets_and_where_gains_are_from(snapshot):
    its = about.About(plan=SMALL, runs=1, failed=0, seeds=1, sources="", versions={}, spent={})
    assert its.left_out == [one for one in FULL.conditions if one not in SMALL.conditions]
    assert "\n".join(f"{name}: {text}" for name, text in its.conditions.items()) == snapshot
    assert about._source("duffing", "classical", "study") == "chosen by hand before any comparison"
    its = gain_sets.tuned("duffing", "classical", "tuned")
    said = f"shipped ({its.search}); least objective {its.objective:.4g} s²"
    assert about._source("duffing", "classical", "tuned").partition("; at a bound: ")[0] == said


def test_gains_of_an_audit_are_listed_once_with_their_plants():
    def used(law, plant):
        return type("Used", (), {"scenario": smc.Scenario(plant=plant, law=law)})

    pid = smc.law("pid", kp=3.0)
    classical = smc.law("classical", k=2.0, c=1.5)
    first = {
        "slow": {
            "a": used(pid, "duffing"),
            "b": used(classical, "duffing"),
            "c": used(classical, "van_der_pol"),
        }
    }
    done = type(
        "Done",
        (),
        {"used": {"1": first, "2": {"slow": {"d": used(classical, "duffing")}, "other": {}}}},
    )
    found = paper.gains(done, "slow")
    assert list(found) == [
        ("classical", "k = 2.00, c = 1.50"),
        next(key for key in found if key[0] == "pid"),
    ]
    assert found["classical", "k = 2.00, c = 1.50"] == ["Duffing", "Van der Pol"]
    assert paper.gains(done, "other") == {}


def test_records_of_a_folder_are_repeated_in_few_points(tmp_path, monkeypatch):
    twin = type(
        "Twin",
        (),
        {
            "name": "twin",
            "published": ("a",),
            "fit": lambda _, r: {"x": 90.0},
        },
    )()
    t = np.arange(2401.0)
    twin.set = lambda name: type("Set", (), {"fits": lambda _, many: [{"x": 50.0}]})()
    twin.predictions = lambda many: [({"x": 2.0 * t}, {"x": t}, t)]
    monkeypatch.setattr(rigs, "read", lambda folder: [(folder / "a.csv", twin, {})])
    (shown,) = rigs.repeated(work(tmp_path), tmp_path)
    assert shown.fits == {"the twin’s": {"x": 90.0}, "a": {"x": 50.0}}
    assert (shown.name, len(shown.t), shown.t[1], shown.why) == ("a.csv", 801, 3.0, "")
    np.testing.assert_array_equal(shown.twin["x"], 2.0 * shown.measured["x"])
    assert rigs.repeated(work(tmp_path), None) == ()


@pytest.mark.parametrize(
    ("unit", "typeset"),
    [
        ("rad s^2", "rad·s²"),
        ("(rad)^2", "rad²"),
        ("N m/s", "N·m/s"),
        ("% of runs", "% of runs"),
        ("1", "1"),
    ],
)
def test_units_are_typeset_with_dots_and_powers(unit, typeset):
    assert words.typeset(unit) == typeset


def test_words_are_those_of_the_suite_and_unknown_names_are_words():
    assert words.either(["rad", "1", "m", "", "rad"]) == "rad or m"
    assert (words.unit("itae"), words.unit("itae", "duffing"), words.unit("mine")) == (
        "rad·s² or m·s²",
        "m·s²",
        "",
    )
    assert (words.metric("my_metric"), words.kind("my_kind"), words.condition("input_delay")) == (
        "my metric",
        "my kind",
        "input delay",
    )
    assert (words.number(np.inf), words.number(np.nan), words.number(1234.6)) == (
        "never",
        "none",
        "1235",
    )
    assert words.interval(1.0, 0.9, 1.1) == "0.900 – 1.10"
    assert words.interval(2.0, 1.9999, 2.0001) == words.interval(1.0, np.nan, 1.1) == ""
    assert words.pretty("`steps` of eps != alphadot in van_der_pol under observer_free") == (
        "steps of ε ≠ α′ in Van der Pol under observer-free"
    )
