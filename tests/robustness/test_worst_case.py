"""The adversary: it stays within the class, replays, depends on nothing else, and finds what is
known to be worst.
"""

import dataclasses
import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers import reference
from helpers.machines import AXIS

import smc_mujoco as smc
from smc_mujoco.analysis.engine import scored_runs
from smc_mujoco.analysis.engine.scored_runs import ScoredRuns
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.robustness import worst_case_search as attack
from smc_mujoco.robustness.uncertainty import Members, default_class, outside
from smc_mujoco.robustness.worst_case_search import WorstCaseSearch, recorded_force
from smc_mujoco.simulation import scenario_json
from smc_mujoco.simulation.signals import Relay

CLASSICAL = smc.law("classical", k=1.826, c=2.874)


def scenario(**fields):
    return smc.Scenario(**{"plant": "duffing", "law": CLASSICAL, "duration": 2.0} | fields)


CLASSES = {
    "force": smc.Uncertainty(disturbance=2.0),
    "slope": smc.Uncertainty(disturbance=2.0, slope=8.0),
    "constants": smc.Uncertainty(
        mass=(0.7, 1.3),
        delay=(0.0, 0.01),
        friction=(0.0, 0.1),
        x0=0.2,
    ),
    "errors": smc.Uncertainty(position_noise=0.01, velocity_noise=0.05, hold=0.04),
    "all": smc.Uncertainty(
        disturbance=1.0,
        jitter=5e-4,
        mass=(0.7, 1.3),
        parameters={"alpha": (0.8, 1.2)},
    ),
}


@pytest.mark.parametrize("name", CLASSES)
def test_the_worst_scenario_replays_in_the_class_whatever_the_threads(name):
    base = scenario(duration=1.0)
    within = CLASSES[name]
    worst = smc.worst_case(base, within=within, budget=8)
    again = smc.worst_case(
        base,
        within=within,
        budget=8,
        threads=1,
    )
    assert again.value == worst.value
    assert again.median == worst.median
    assert again.scenario == worst.scenario
    trace = smc.run(scenario_json.restore(scenario_json.describe(worst.scenario)))
    assert smc.score(trace)["rms_error"] == worst.value >= worst.median
    assert worst.tried == 16
    assert np.abs(trace.d).max() <= within.disturbance
    if within.slope:
        assert np.abs(np.diff(trace.d[:, 0])).max() <= within.slope * base.control_period * (
            1 + 1e-9
        )
    worst_scenario = worst.scenario
    assert 0.0 <= worst_scenario.input_delay <= within.delay[1]
    for error, bound in zip(
        worst_scenario.noise.errors, (within.position_noise, within.velocity_noise), strict=True
    ):
        assert np.abs(error.values if error else 0.0).max() <= bound
        assert error is None or np.allclose(np.diff(error.times), within.hold)
    for changed, factor in worst_scenario.mismatch.items():
        low, high = {"mass": within.mass, **within.parameters}[changed]
        assert low <= factor <= high
    assert np.abs(np.array(worst_scenario.resolved.x0) - 1.5).max() <= 1.5 * within.x0 * (1 + 1e-12)


@pytest.mark.quick
def test_the_ends_of_a_class_are_within_it():
    """A delay and a jitter are counted in steps, and friction may be both scaled and added."""
    base = scenario(friction=smc.Coulomb(0.1), physics_step=1e-3)
    within = smc.Uncertainty(
        delay=(3e-4, 2.6e-3),
        jitter=2e-4,
        friction=(0.0, 0.2),
        friction_scale=(0.5, 1.5),
        mass=(0.12, 1.14),
    )
    members = Members([base], within)
    low, high = (members.with_constants(np.full(len(members.ends), share)) for share in (0.0, 1.0))
    assert low.input_delay == 1e-3
    assert high.input_delay == 2e-3
    assert low.clock.jitter == 0.0
    assert high.clock.jitter == 1.25e-4
    assert [end.friction[0].level for end in (low, high)] == pytest.approx([0.05, 0.35])
    assert low.mismatch["mass"] == 0.12
    assert high.mismatch["mass"] == 1.14
    for few in (
        {"delay": (3e-4, 1.6e-3)},
        {"delay": (0.0, 4e-4)},
        {"jitter": 1e-4},
    ):
        with pytest.raises(smc.ScenarioError, match="give a range with several of these"):
            Members([base], smc.Uncertainty(**few))


@pytest.mark.parametrize(
    ("name", "kind", "values", "kept"),
    [
        ("force", smc.signals.Held, [1, 1, 2, 2, 2, 3, 3, 3, 4], [0, 2, 5, 8]),
        ("slope", smc.signals.TimeSeries, [1, 1, 2, 2, 2, 3, 3, 3, 4], [0, 1, 2, 4, 5, 7, 8]),
        ("force", smc.signals.TimeSeries, [1, 2, 3, 4, 5, 5, 5, 5, 5], [0, 4, 8]),
        ("force", smc.signals.TimeSeries, [0, 1, 2, 3, 2, 1, 1, 1, 1], [0, 3, 5, 8]),
    ],
)
def test_a_force_is_kept_at_its_jumps_if_few_of_its_values_change_and_else_at_its_corners(
    name, kind, values, kept
):
    signal = Members([scenario()], CLASSES[name]).signal(np.array(values, float))
    assert signal == kind([1e-3 * k for k in kept], [values[k] for k in kept])


def test_errors_of_measurement_reach_the_law_alike_in_both_loops():
    error = smc.signals.Held([0.0, 0.05], [0.02, -0.02])
    steps = smc.signals.TimeSeries([0.0, 0.2], [0.1, -0.1])
    measured = scenario(
        duration=0.1, noise=smc.Noise(position=1e-3, position_error=error, velocity_error=steps)
    )
    fast = smc.run(measured)
    slow = reference.run(measured)
    plain = smc.run(dataclasses.replace(measured, noise=smc.Noise(position=1e-3)))
    for name in ("x", "v", "u", "s"):
        np.testing.assert_array_equal(getattr(fast, name), getattr(slow, name))
    assert fast.s[0, 0] - plain.s[0, 0] == pytest.approx(2.874 * 0.02 + 0.1)


@pytest.mark.parametrize(
    ("name", "disturbance"),
    [
        ("force", (Relay(2.0, rate=1.0),)),
        ("errors", ()),
    ],
)
def test_the_loop_s_frequency_is_read_of_a_run_under_a_relay_of_the_rate_or_without_a_force(
    name, disturbance
):
    searcher = WorstCaseSearch(
        Members([scenario(duration=0.1)], CLASSES[name]),
        CATALOGUE["rms_error"],
        9,
        ScoredRuns({}, worth_compiling=False),
        lambda _: None,
    )
    searcher.search(np.random.default_rng(0), [])
    assert searcher.swing
    assert searcher.swing.scenario.disturbance == disturbance


def test_a_relay_replays_from_its_record_to_the_last_bit():
    relay = Relay(2.0, s=0.3, rate=1.0, error=-0.2)
    base = scenario(plant=smc.plant("pendulum_network", n=2), law=smc.law("super_twisting"))
    run = smc.run(dataclasses.replace(base, disturbance=relay))
    force = 2.0 * recorded_force(run, relay, np.zeros(0))
    np.testing.assert_array_equal(run.d, np.column_stack([force, force]))
    replay = smc.run(dataclasses.replace(base, disturbance=smc.signals.Held(run.t, force)))
    for name in ("x", "v", "u", "s", "d"):
        np.testing.assert_array_equal(getattr(replay, name), getattr(run, name))


def test_a_relay_that_starts_late_goes_on_from_another_force():
    relay = Relay(2.0, rate=1.0, start=0.5)
    run = smc.run(
        scenario(
            duration=1.0, disturbance=(smc.signals.Held([0.0, 0.5, 1.0], [1.0, 0.0, 0.0]), relay)
        )
    )
    np.testing.assert_array_equal(run.d[:, 0], 2.0 * recorded_force(run, relay, np.full(1001, 0.5)))
    assert set(run.d[:500, 0]) == {1.0}
    assert set(run.d[500:, 0]) == {-2.0}


def test_it_finds_the_worst_of_a_linear_loop():
    """For M x'' = -k x - c v + d, |d| <= D, at rest at first, the largest x(T) is D times the
    integral of |h|.
    """
    k = 20.0
    c = 1.0
    T = 4.0

    @smc.law_function(gains={"k": k, "c": c})
    def linear(y, gains, memory):
        return -gains.k * y.x - gains.c * y.v, 0.0

    t = np.linspace(0.0, T, 40001)
    w = np.sqrt(k - c * c / 4)
    a = c / 2
    gain = np.trapezoid(np.abs(np.exp(-a * t) * np.sin(w * t) / w), t)
    still = {"alpha": 0.0, "beta": 0.0, "delta": 0.0}
    base = smc.Scenario(
        plant=smc.plant("duffing", M=1.0, **still),
        law=linear,
        duration=T,
        x0=0.0,
        u_max=1e3,
    )
    worst = smc.worst_case(
        base,
        "peak",
        smc.Uncertainty(disturbance=0.5),
        budget=48,
    )
    assert worst.value <= 0.5 * gain * 1.001
    assert worst.value >= 0.5 * gain * 0.95  # the 5 % that a second searcher may find more


def test_the_adversary_chooses_the_set_of_parameters_and_the_scale_of_friction():
    friction = smc.Coulomb(0.2), smc.Viscous(0.5)
    sets = []
    for factor in (1.0, 3.0, 0.4):
        sets.append(scenario(mismatch={"M": factor}, friction=friction))
    worst = smc.worst_case(sets, within=smc.Uncertainty(friction_scale=(0.0, 2.0)), budget=6)
    members = []
    for parameter_set, scale in itertools.product(sets, (0.0, 2.0)):
        members.append(
            dataclasses.replace(
                parameter_set, friction=(smc.Coulomb(0.2 * scale), smc.Viscous(0.5 * scale))
            )
        )
    assert worst.value == max(smc.score(trace)["rms_error"] for trace in smc.run(members))
    assert worst.scenario in members
    assert "any of 3 parameter sets, friction scale 0 to 2" in str(worst)


def test_the_class_where_none_is_given_is_what_the_machine_leaves_open():
    assert default_class(scenario()) == smc.Uncertainty(disturbance=1.0)
    arm = smc.plant("panda")
    own = default_class(smc.Scenario(plant=arm, law="none", friction=arm.friction))
    assert own == smc.Uncertainty(parameters=arm.uncertain, friction_scale=(0.5, 1.5))
    assert own.disturbance == 0.0
    assert own.parameters["payload"] == (0.0, 2.0)
    text = """<mujoco model="rubs"><worldbody><body><joint name="slide" type="slide" axis="1 0 0"
    frictionloss=".2"/><geom size=".1" mass="1" contype="0" conaffinity="0"/></body></worldbody>
    <actuator><motor joint="slide" ctrlrange="-6 6"/></actuator></mujoco>"""
    own = smc.Scenario(plant=smc.plant_from(text, ["slide"]), law="none", x0=0.1)
    rubbing = default_class(own)
    assert rubbing == smc.Uncertainty(disturbance=1.0, friction_scale=(0.5, 1.5))
    members = Members([own], rubbing)
    (lost,) = members.with_constants(np.array([0.0])).mismatch.items()
    assert lost == ("slide.frictionloss", 0.5)
    # its u is a voltage: the force is that of the motor at rest under 10 V
    assert default_class(AXIS.scenario("none")).disturbance == pytest.approx(
        10.0 * AXIS.values["force_per_volt"] / 6
    )


@pytest.mark.parametrize("metric", ["tv_rate", "max_u", "energy", "rms_error", "peak"])
def test_who_never_arrives_is_worst_in_metrics_of_u_alone(metric):
    base = scenario(plant="van_der_pol", law=smc.law("twisting"))
    worst = smc.worst_case(base, metric, CLASSES["force"], budget=4)
    assert (worst.words == "not arrived") is CATALOGUE[metric].command


def test_a_failed_run_is_the_worst():
    @smc.law_function
    def fragile(y, gains, memory):
        return (-10.0 * y.x - 5.0 * y.v) / (0.0 if y.v > 3.0 else 1.0), 0.0

    with pytest.warns(
        smc.errors.ScenarioWarning, match="fragile failed by itself: .*division by zero"
    ):
        worst = smc.worst_case(
            scenario(law=fragile, u_max=50.0), within=smc.Uncertainty(disturbance=20.0), budget=32
        )
    assert worst.value == np.inf
    assert smc.run(worst.scenario).failure


@pytest.mark.filterwarnings("ignore:input_delay is")
def test_bad_values_get_a_sentence(refused):
    measured = scenario(noise=smc.Noise(position_error=smc.Step(0.1)))
    unknown = smc.Uncertainty(parameters={"zz": (1, 2)})
    for word, make in {
        "nothing": smc.Uncertainty,
        "0.3": lambda: smc.Uncertainty(parameters=0.3),
        "errors": lambda: smc.worst_case(measured, within=CLASSES["errors"]),
        "'zz'": lambda: smc.worst_case(scenario(), within=unknown),
        "duration": lambda: smc.worst_case([scenario(), scenario(duration=3.0)]),
        "friction_scale": lambda: smc.worst_case(
            scenario(), within=smc.Uncertainty(friction_scale=(0, 2))
        ),
    }.items():
        refused(make, word)
    with pytest.raises(smc.ScenarioError, match=r"\b0\.5\b"):  # s that are left of the run
        smc.worst_case(scenario(input_delay=1.5), within=smc.Uncertainty(delay=(0.0, 1.0)))


# changes of the run, the class, what lies outside of the theorem's conditions and what does not
@pytest.mark.parametrize(
    ("change", "bounds", "expected"),
    [
        ({}, {"disturbance": 1.8}, ""),
        ({}, {"disturbance": 2.0}, "the disturbance exceeds the bound of"),
        ({}, {"disturbance": 6.0}, "the disturbance exceeds what the drives hold; the"),
        (
            {"law": smc.law("super_twisting", k2=8.0)},
            {"disturbance": 2.0, "slope": 8.0},
            "the disturbance's rate exc",
        ),
        (
            {"disturbance": (smc.Constant(0.5), smc.Sine(-1.0, 2.0))},
            {"disturbance": 0.5},
            "the disturbance exc",
        ),
        ({"input_delay": 0.002}, {"x0": 0.1}, "the law's theorem has no delay"),
        ({"clock": smc.Clock(missed=0.1)}, {"x0": 0.1}, "the law's theorem has no delay"),
    ],
)
def test_a_class_beyond_the_theorem_of_the_law_is_said_to_be_outside(change, bounds, expected):
    """The limits are k = 1.9 of the theorem and 6 N of the drives."""
    case = dataclasses.replace(scenario(law=smc.law("classical", k=1.9)), **change)
    warning = outside(case, smc.Uncertainty(**bounds))
    assert warning.startswith(expected)
    assert bool(warning) == bool(expected)


def searching(tried: list[tuple[Any, float, int]], **members: Any) -> WorstCaseSearch:
    """A search that has tried members of these values and origins; nothing is run."""
    members_stub: Any = SimpleNamespace(**members)
    metric: Any = None
    search = WorstCaseSearch(
        members_stub, metric, 10**6, ScoredRuns({}, worth_compiling=False), lambda done: None
    )
    search.tried = [
        attack.TriedMember(member, (value, 0.0), origin) for member, value, origin in tried
    ]
    return search


def test_an_evolution_begins_with_the_worst_member_and_climbs():
    start = []
    means = []

    def moved(member, z, knots):
        start.append(member)
        return z

    search = searching([("mild", 1.0, 0), ("worst", 2.0, 1)], size=lambda knots: 3, moved=moved)
    for generation in search._evolution(np.random.default_rng(0)):
        points: list[Any] = [case.member for case in generation]
        means.append(float(np.mean([point.sum() for point in points])))
        search.tried += [
            attack.TriedMember(point, (float(point.sum()), 0.0), 1) for point in points
        ]
    assert set(start) == {"worst"}
    assert means[-1] > means[0] + 0.1


@pytest.mark.slow
@pytest.mark.parametrize("bounds", [{"disturbance": 2.0}, {"position_noise": 1e-3, "hold": 0.01}])
def test_with_many_runs_the_fast_engine_searches_and_the_worst_is_mujoco_s(monkeypatch, bounds):
    case = scenario(duration=1.0)
    within = smc.Uncertainty(**bounds, mass=(0.7, 1.3))
    expected = smc.worst_case(case, within=within, budget=40)
    monkeypatch.setattr(scored_runs, "MIN_WORK", 0)
    result = smc.worst_case(case, within=within, budget=40)
    assert result.value == smc.score(smc.run(result.scenario))["rms_error"]
    assert result.value == pytest.approx(expected.value, rel=1e-3)
    assert result.median == pytest.approx(expected.median, rel=1e-3)
    for text in (result, result.tables[0].notes):
        assert "MuJoCo repeated 20 runs of another engine: 0 failed" in str(text)
    assert not expected.checked
