"""What the calls of studies refuse, and what their arguments and defaults become; nothing is run."""

import pytest
from helpers.arguments import told

import smc_mujoco as smc
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.studies import adviser, fair_gains, scene, worst_case
from smc_mujoco.studies.fair_gains import Candidate

pytestmark = pytest.mark.quick

RUN = smc.Scenario(plant="duffing", law="classical", duration=0.5)


class Reached(Exception):
    """The arguments with which a part was called."""


def reached(*given: object, **options: object) -> None:
    raise Reached(given, options)


@pytest.fixture
def stopped(monkeypatch):
    """What gains, combinations of runs and a study were given; none is searched or run."""

    def gains(trial, plant, laws, budget, **options):
        names = [law.name for law in laws]
        given = [budget, trial.starts, trial.threads, trial.progress]
        calls.append(
            f"gains {plant.name} {names} {trial.folder.name} {told(given)} {told(options)}"
        )
        return [Candidate(coerce.law(law), (coerce.law(law),), "a remark") for law in laws]

    def combinations(plants, laws, conditions, seeds, *given):
        made = [str(one.on(plants[0], 2.0)) if "(" in one.name else one.name for one in conditions]
        calls.append(f"runs {told(plants)} {made} {seeds} {told(given)}")
        return []

    def runs(scenarios, folder, *given, **options):
        calls.append(f"study {folder.name} {told(given)} {told(options)}")
        raise Reached

    calls: list[str] = []
    monkeypatch.setattr(fair_gains.Trial, "gains_on", gains)
    monkeypatch.setattr(fair_gains, "all_combinations", combinations)
    monkeypatch.setattr(fair_gains, "study", runs)
    return calls


LAWS = ["classical", "pid", "adaptive"]
CHANGES = {  # call -> argument, its value, and what a part is then given
    smc.which: [
        ("laws", LAWS[:2], "['classical', 'pid']"), ("conditions", "noise", "['noise']"), ("seeds", 5, "range(0, 5)"),
        ("duration", 2.0, "[2.0, None]"), ("noise_key", 7, "noise_key: 7"), ("out", "mine", "study mine"),
        ("starts", smc.starts(spread=0.1), "spread=0.1"), ("threads", 3, "threads: 3"),
        ("progress", True, "progress: True"), ("needs", "no-velocity, calm", "filtered_difference"),
        ("quick", True, "searches: 3"),
    ],
    smc.compare: [
        ("plants", "servo_axis", "servo_axis"), ("conditions", "noise", "['noise']"), ("seeds", 3, "range(0, 3)"),
        ("tune", False, "tune: False"), ("gains", "study", "gains: 'study'"), ("budget", 30, "[30, "),
        ("out", "mine", "study mine"), ("traces", "all", "traces: 'all'"), ("noise_key", 5, "noise_key: 5"),
        ("threads", 2, "threads: 2"), ("duration", 2.0, "[2.0, None]"), ("progress", False, "progress: False"),
        ("executor", "dask://host:1", "executor: 'dask://host:1'"), ("quick", True, "searches: 6"),
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("call", "name", "value", "given"),
    [(call, *change) for call, changes in CHANGES.items() for change in changes],
)
def test_every_argument_reaches_the_search_for_gains_or_the_runs(call, name, value, given, stopped):
    asked = []
    for arguments in ({}, {name: value}):
        stopped.clear()
        with pytest.raises(Reached):
            call(**{"laws": LAWS} | ({"plant": "duffing"} if call is smc.which else {}) | arguments)
        asked.append("\n".join(stopped))
    assert given not in asked[0]
    assert given in asked[1]


def test_by_default_laws_are_tuned_by_twelve_searches_and_run_on_all_from_a_key_that_is_drawn(
    stopped,
):
    found = []
    for ask in (lambda: smc.which("duffing", laws=LAWS), lambda: smc.compare(LAWS)):
        stopped.clear()
        with pytest.raises(Reached):
            ask()
        found.append([*stopped])
    which, compared = found
    for calls in found:
        assert all(
            "searches: 12" in call and "[64, None, None" in call
            for call in calls
            if call.startswith("gains")
        )
        assert all(
            "noise_key: 'drawn'" in call and "half_steps: True" in call for call in calls[-1:]
        )
    assert "['nominal', 'noise', 'sine'] range(0, 24) [5.0, None]" in which[1]
    assert len([call for call in compared if call.startswith("gains")]) == 5  # plants


def test_robust_has_an_adversary_for_each_law_in_each_condition_with_the_bound_on_the_disturbance(
    stopped, monkeypatch
):
    """The contest is given; what is asked of it is told."""
    asked = []
    monkeypatch.setattr(fair_gains, "study", lambda runs, folder, **options: None)
    monkeypatch.setattr(adviser, "default_budget", lambda scenario, within: 1000)
    monkeypatch.setattr(
        worst_case, "cached_worst_case", lambda *given, **options: asked.append((given, options))
    )

    def contest(table, worst, candidates, plant, needs, relevant):
        asked.append((sorted(worst), needs, relevant))
        reached()

    monkeypatch.setattr(adviser, "_contest", contest)
    with pytest.raises(Reached):
        smc.which("duffing", ["nominal", "noise"], "calm,robust", LAWS, seeds=2, relevant=0.1)
    *attacks, contest_given = asked
    assert contest_given == (sorted(LAWS), ("calm", "robust"), 0.1)
    paths, runs, classes = zip(*(given[:3] for given, _ in attacks), strict=True)
    assert [path.name for path in paths] == [
        f"{k}-duffing-{law}.json" for law in LAWS for k in (0, 1)
    ]
    assert [(one.law.name, one.condition) for one in runs] == [
        (law, name) for law in LAWS for name in ("nominal", "noise")
    ]
    assert {one.disturbance for one in classes} == {1.0}


@smc.law_function(gains={"k": 4.0})
def LAW(y, gains, memory):
    return -gains.k * y.e, y.e


OTHER = smc.Scenario(plant="van_der_pol", law="classical")
PERIOD = Condition("slow", lambda plant, duration: {"control_period": 0.01})
SCENES = [
    {"title": ""},
    {"title": 3},
    {"conditions": {}},
    {"conditions": [RUN]},
    {"conditions": {"nominal": {}}},
    {"conditions": {"nominal": {"a": 3}}},
    {"conditions": {"": {"a": RUN}}},
    {"conditions": {"nominal": {"": RUN}}},
    {"conditions": {"nominal": {"a": RUN, "b": OTHER}}},
    {"conditions": {"nominal": {"a": RUN, "A": RUN}}},
    {"conditions": {"x": {"a": RUN}, "X": {"a": RUN}}},
    {"film": "noise"},
    {"figure": "figures"},
    {"answers": ("itaee",)},
    {"answer": "a"},
    {"camera": (1.0,)},
]
REFUSED = {
    smc.leaderboard: [{"metrics": "itae"}, {"metrics": []}, {"metrics": ["itaee"]}],
    smc.study: [
        {"scenarios": [3]},
        {"scenarios": []},
        {"scenarios": "duffing"},
        {"executor": "ray"},
        {"executor": "dask://host"},
        {"executor": "dask://:80"},
        {"executor": "dask://host:65536"},
        {"executor": 3},
        {"noise_key": "secret"},
        {"noise_key": -1},
        {"noise_key": 2**53},
    ],
    smc.compare: [
        {"metrics": ["itaee"]},
        {"laws": "clasical"},
        {"plants": "dufing"},
        {"conditions": "nois"},
        {"executor": "ray"},
    ],
    smc.which: [
        {"needs": "fats"},
        {"needs": "accurate, robst"},
        {"needs": "two-gains", "laws": "pid"},
        {"laws": [LAW, LAW(k=2.0)]},
    ],
    smc.audits.accuracy: [
        {"periods": [1e-3]},
        {"periods": [1e-3, 1e-3]},
        {"periods": [1e-3, 0.0]},
        {"seeds": 0},
        {"seeds": 10_001},
        {"conditions": PERIOD},
        {"conditions": "nois"},
    ],
    smc.worst_case: [
        {"scenario": "duffing"},
        {"scenario": []},
        {"scenario": [RUN, OTHER]},
        {"within": 2.0},
        {"metric": "rms"},
        {"metric": "spread_bound"},
    ],
    smc.Scene: SCENES,
    smc.Table.read: [{"path": "none.parquet"}],
    scene.find: [{"name": "scenes/none.py"}, {"name": "vdp_nois"}],
}
GIVEN = {
    smc.leaderboard: {"table": None},
    smc.study: {"scenarios": [RUN], "out": "study"},
    smc.which: {"plant": "duffing"},
    smc.compare: {"laws": "classical", "plants": "duffing", "conditions": "nominal"},
    smc.audits.accuracy: {"laws": "classical", "plants": "duffing"},
    smc.worst_case: {"scenario": RUN},
    smc.Scene: {"title": "Two", "conditions": {"nominal": {"a": RUN}}},
}


@pytest.mark.usefixtures("stopped")
@pytest.mark.parametrize("call", REFUSED, ids=lambda call: call.__name__)
def test_what_cannot_be_is_refused(call, monkeypatch, tmp_path, refused):
    monkeypatch.chdir(tmp_path)
    for change in REFUSED[call]:
        arguments = GIVEN.get(call, {}) | change
        refused(lambda arguments=arguments: call(**arguments))
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("call", "given"),
    [
        (smc.which, {"seeds": 1}),
        (smc.which, {"seeds": 10_000}),
        (smc.which, {"relevant": 0.0}),
        (smc.compare, {"seeds": 1, "budget": 1, "relevant": 0.5}),
        (smc.compare, {"seeds": 1_000_000}),
    ],
)
def test_bounds_themselves_are_accepted(call, given, stopped):
    with pytest.raises(Reached):
        call(**GIVEN[call] | given)
