"""What the calls of studies refuse, and what their arguments and defaults become, recorded; nothing is run."""

import pytest
from helpers.arguments import told

import smc_mujoco as smc
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.studies import adviser, fair_gains, scene
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
        names, given = [law.name for law in laws], [budget, trial.starts, trial.threads, trial.progress]
        calls.append(f"gains {plant.name} {names} {trial.folder.name} {told(given)} {told(options)}")
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
ASKED = [
    lambda: smc.which("duffing", laws=LAWS),
    lambda: smc.which("duffing", quick=True, laws=LAWS[:2], progress=True, threads=3),
    lambda: smc.which(
        "duffing", ["nominal", "noise"], "no-velocity, calm", LAWS[:2], seeds=5, duration=2.0, noise_key=7, out="mine",
        starts=smc.starts(spread=0.1),
    ),
    lambda: smc.compare(LAWS),
    lambda: smc.compare(LAWS, quick=True, seeds=2, progress=False),
    lambda: smc.compare(
        ["classical", smc.law("pid", kp=20.0)], "cart_pole", "noise", 3, tune=False, gains="study", budget=30,
        out="mine", traces="all", noise_key=5, threads=2, duration=2.0, executor="dask://host:1",
    ),
    lambda: smc.compare(["classical"], "duffing", "noise", 3, gains="tracking", quick=True, budget=12),
]  # fmt: skip


def test_what_is_asked_reaches_gains_and_runs_with_these_defaults(stopped, snapshot):
    for ask in ASKED:
        stopped.append("")
        with pytest.raises(Reached):
            ask()
    assert "\n".join(stopped) == snapshot


def test_robust_has_an_adversary_with_these_defaults(stopped, monkeypatch, snapshot):
    """The contest is given; what is asked of it is told."""
    monkeypatch.setattr(fair_gains, "study", lambda runs, folder, **options: stopped.append(f"study {folder}"))
    monkeypatch.setattr(adviser, "default_budget", lambda scenario, within: 1000)
    monkeypatch.setattr(
        fair_gains, "cached_worst_case", lambda *given, **options: stopped.append(told([*given, options]))
    )

    def contest(table, worst, candidates, plant, needs, relevant):
        stopped.append(told(["contest", plant, sorted(worst), needs, relevant]))
        reached()

    monkeypatch.setattr(adviser, "_contest", contest)
    with pytest.raises(Reached):
        smc.which("duffing", ["nominal", "noise"], "calm,robust", LAWS, seeds=2, relevant=0.1)
    assert "\n".join(stopped) == snapshot


@smc.law_function(gains={"k": 4.0})
def LAW(y, gains, memory):
    return -gains.k * y.e, y.e


OTHER = smc.Scenario(plant="van_der_pol", law="classical")
PERIOD = Condition("slow", lambda plant, duration: {"control_period": 0.01})
SCENES = [
    {"title": ""}, {"title": 3}, {"conditions": {}}, {"conditions": [RUN]}, {"conditions": {"nominal": {}}},
    {"conditions": {"nominal": {"a": 3}}}, {"conditions": {"": {"a": RUN}}}, {"conditions": {"nominal": {"": RUN}}},
    {"conditions": {"nominal": {"a": RUN, "b": OTHER}}}, {"conditions": {"nominal": {"a": RUN, "A": RUN}}},
    {"conditions": {"x": {"a": RUN}, "X": {"a": RUN}}}, {"film": "noise"}, {"figure": "figures"},
    {"answers": ("itaee",)}, {"answer": "a"}, {"camera": (1.0,)},
]  # fmt: skip
REFUSED = {
    smc.leaderboard: [{"metrics": "itae"}, {"metrics": []}, {"metrics": ["itaee"]}],
    smc.study: [
        {"out": 3}, {"scenarios": [3]}, {"scenarios": []}, {"scenarios": "duffing"}, {"traces": "best"},
        {"executor": "ray"}, {"executor": "dask://host"}, {"executor": "dask://:80"}, {"executor": "dask://host:65536"},
        {"executor": 3}, {"noise_key": "secret"}, {"noise_key": -1}, {"noise_key": 2**53},
    ],
    smc.compare: [
        {"seeds": 0}, {"relevant": -0.1}, {"duration": 0.0}, {"budget": 0}, {"metrics": ["itaee"]}, {"gains": "best"},
        {"out": 3}, {"laws": "clasical"}, {"plants": "dufing"}, {"conditions": "nois"}, {"executor": "ray"},
    ],
    smc.which: [
        {"needs": "fats"}, {"seeds": 0}, {"seeds": 10_001}, {"duration": -1.0}, {"relevant": -0.1},
        {"needs": "accurate, robst"}, {"needs": "two-gains", "laws": "pid"}, {"laws": [LAW, LAW(k=2.0)]},
    ],
    smc.accuracy: [
        {"periods": [1e-3]}, {"periods": [1e-3, 1e-3]}, {"periods": [1e-3, 0.0]}, {"seeds": 0}, {"seeds": 10_001},
        {"conditions": PERIOD}, {"gains": "best"}, {"conditions": "nois"},
    ],
    smc.worst_case: [
        {"scenario": "duffing"}, {"scenario": []}, {"scenario": [RUN, OTHER]}, {"within": 2.0}, {"metric": "rms"},
        {"budget": 0}, {"budget": 1_000_001}, {"seed": -1}, {"seed": 2**53}, {"metric": "spread_bound"},
    ],
    smc.Scene: SCENES,
    smc.Table.read: [{"path": "none.parquet"}],
    scene.find: [{"name": "scenes/none.py"}, {"name": "vdp_nois"}],
}  # fmt: skip
GIVEN = {
    smc.leaderboard: {"table": None}, smc.study: {"scenarios": [RUN], "out": "study"}, smc.which: {"plant": "duffing"},
    smc.compare: {"laws": "classical", "plants": "duffing", "conditions": "nominal"},
    smc.accuracy: {"laws": "classical", "plants": "duffing"}, smc.worst_case: {"scenario": RUN},
    smc.Scene: {"title": "Two", "conditions": {"nominal": {"a": RUN}}},
}  # fmt: skip


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
        (smc.which, {"seeds": 1}), (smc.which, {"seeds": 10_000}), (smc.which, {"relevant": 0.0}),
        (smc.compare, {"seeds": 1, "budget": 1, "relevant": 0.5}), (smc.compare, {"seeds": 1_000_000}),
    ],
)  # fmt: skip
def test_bounds_themselves_are_accepted(call, given, stopped):
    with pytest.raises(Reached):
        call(**GIVEN[call] | given)
