"""Random scenarios, sane or absurd: each is refused in one sentence, or runs to a trace without an unmarked NaN."""

# pyright: reportOperatorIssue=false, reportOptionalOperand=false
import math
import os

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

import smc_mujoco as smc

pytestmark = [  # gains, starts and motors are meant to be wild
    pytest.mark.filterwarnings("ignore::smc_mujoco.GainWarning"),
    pytest.mark.filterwarnings("ignore::smc_mujoco.ScenarioWarning"),
]

MOST = 400  # physics steps times channels of a run that is played
EXAMPLES = int(os.environ.get("FUZZ", "0"))  # FUZZ=5000 pytest tests/test_fuzz.py: as many, new ones each time
alone, together, files = (
    settings(
        derandomize=not EXAMPLES,
        max_examples=EXAMPLES or few,
        deadline=None,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow, HealthCheck.data_too_large],
    )
    for few in (200, 40, 40)
)

ABSURD = st.sampled_from(
    [
        *(math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e-320, 1e-300, 1e-16, 1e16, 1e200, -1e200, 1e308, -1e308),
        *(True, None, "", "0", "1", b"1", (), [], {}, [1.0], (1.0, 2.0), [math.nan], 1j, 10**400, -1, 0, 2**53),
        *(np.float32(0.1), np.int64(3), np.array(0.5), np.array([0.5]), np.zeros((2, 2)), np.bool_(True)),
        *(smc.Constant(1.0), smc.Noise(0.1), smc.law("none"), smc.plant("duffing"), smc.Jump(0.0, {}), "duffing"),
    ]
)
WIDE = st.one_of(
    st.floats(-10.0, 10.0),
    st.floats(-10.0, 10.0),
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from([0.0, 1e-300, 1e-9, 1e9, 1e99, 1e154, 1e155, 1e300, -1e300, 1.7e308]),
)
POSITIVE = st.one_of(WIDE.map(abs), st.floats(1e-3, 1.0), st.floats(1e-3, 1.0))
SMALL = st.floats(0.0, 1.0)
TIMES = st.floats(0.0, 0.03)


def mostly(sane, absurd=ABSURD):
    """A sane value but for one time in forty."""
    return st.integers(0, 39).flatmap(lambda i: absurd if i == 39 else sane)


@st.composite
def plants(draw):
    """Every plant; networks of 2 to 4; some parameters wild."""
    name = draw(st.sampled_from(smc.plants()))
    least, most = smc.plant(name).sizes
    changes = {} if most == 1 else {"n": draw(st.integers(least, min(most, 4)))}
    for key in draw(st.sets(st.sampled_from(sorted(smc.plant(name).parameters)), max_size=2)):
        changes[key] = draw(POSITIVE if key in smc.plant(name).positive else WIDE)
    return smc.plant(name, **changes)


@st.composite
def components(draw, find, names):
    """Every law or estimator; some gains wild."""
    name = draw(st.sampled_from(names))
    keys = sorted(find(name).gains)
    wild = draw(st.sets(st.sampled_from(keys), max_size=3)) if keys else ()
    return find(name, **{key: draw(POSITIVE if key in ("lam", "phi") else WIDE) for key in wild})


SMOOTH = st.one_of(
    st.builds(smc.Constant, WIDE),
    st.builds(smc.Sine, WIDE, WIDE, WIDE),
    st.builds(smc.Step, WIDE, TIMES),
    st.builds(smc.Pulse, WIDE, TIMES, POSITIVE),
    st.builds(smc.Impulse, WIDE, TIMES, st.one_of(st.floats(1e-3, 0.01), POSITIVE)),
    st.lists(st.tuples(st.one_of(TIMES, WIDE), WIDE), min_size=2, max_size=9, unique_by=lambda point: point[0]).map(
        lambda points: smc.TimeSeries(*zip(*sorted(points), strict=True))
    ),
)
DISTURBANCE = st.one_of(
    SMOOTH,
    st.builds(smc.Gust, WIDE, TIMES, st.one_of(TIMES, POSITIVE)),
    st.builds(smc.BandLimited, POSITIVE, st.just(0.0), POSITIVE),
    st.builds(smc.BandLimited, POSITIVE, SMALL, st.one_of(st.floats(1.0, 100.0), POSITIVE)),
    st.builds(smc.OrnsteinUhlenbeck, POSITIVE, POSITIVE, st.one_of(st.floats(1e-5, 1.0), POSITIVE)),
)
NAMES = ("mass", "M", "m", "l", "b", "k", "mu", "alpha", "kc", "grav", "nonsense")


@st.composite
def factors(draw, plant):
    """Factors on parameters that the plant has, now and then on one that it lacks."""
    known = [*plant.parameters, "mass"] if isinstance(plant, smc.Plant) else [*NAMES]
    keys = draw(st.sets(mostly(st.sampled_from(known), st.sampled_from(NAMES)), max_size=2))
    return {key: draw(mostly(st.one_of(st.floats(0.1, 10.0), POSITIVE, WIDE))) for key in keys}


@st.composite
def scenarios(draw):
    """The keyword arguments of a Scenario, most of them sane."""
    step = draw(st.sampled_from([1e-3, 5e-4, 2e-3, 1e-4, 1 / 3000, 0.01]))
    steps, plant = draw(st.integers(1, 4)), draw(mostly(plants()))
    n = plant.n if isinstance(plant, smc.Plant) else 1
    fields = {
        "duration": mostly(st.floats(1e-3, 0.03)),
        "control_period": mostly(st.just(steps * step)),
        "physics_step": mostly(st.sampled_from([None, step])),
        "u_max": mostly(
            st.one_of(st.floats(0.1, 100.0), st.just(math.inf), st.sampled_from([1e-300, 1e10, 2e10, 1e308]))
        ),
        "x0": mostly(st.one_of(st.none(), st.floats(-3.0, 3.0), st.lists(WIDE, min_size=n, max_size=n))),
        "v0": mostly(st.one_of(st.none(), st.floats(-3.0, 3.0), st.lists(WIDE, min_size=n, max_size=n))),
        "reference": mostly(SMOOTH),
        "disturbance": mostly(st.one_of(st.none(), DISTURBANCE, st.lists(DISTURBANCE, max_size=3))),
        "noise": mostly(
            st.one_of(st.none(), st.builds(smc.Noise, SMALL, SMALL), st.builds(smc.Noise, POSITIVE, POSITIVE))
        ),
        "input_delay": mostly(st.integers(0, 6).map(lambda k: k * step)),
        "velocity": mostly(components(smc.estimator, smc.estimators())),
        "mismatch": mostly(factors(plant)),
        "jump": mostly(st.one_of(st.none(), st.builds(smc.Jump, TIMES, factors(plant)))),
        "seed": mostly(st.integers(0, 2**53 - 1)),
        "integrator": mostly(st.sampled_from(["RK4", "Euler", "implicitfast", "implicit"])),
        "law": mostly(components(smc.law, smc.laws())),
    }
    chosen = draw(st.sets(st.sampled_from(sorted(fields)), max_size=len(fields))) | {"law", "duration"}
    return {"plant": plant} | {name: draw(fields[name]) for name in sorted(chosen)}


def sentence(text: str) -> None:
    assert text
    assert "\n" not in text
    assert len(text) < 1000


def sound(trace: smc.Trace, scenario: smc.Scenario) -> None:
    """The trace has the right shape and says where it ends; before it is finite, after it is NaN."""
    samples, n = scenario.samples + 1, scenario.plant.n
    assert trace.scenario is scenario
    assert (trace.diverged_at is None) == (trace.failure is None)
    end = samples
    if trace.diverged_at is not None:
        sentence(trace.failure)
        step = round(trace.diverged_at / scenario.physics_step)
        assert trace.diverged_at == pytest.approx(step * scenario.physics_step, abs=1e-12)
        assert 0 <= step <= scenario.samples * scenario.steps
        assert f"at t = {trace.diverged_at:.6g} s" in trace.failure
        end = -(-step // scenario.steps)
    np.testing.assert_allclose(trace.t, np.arange(samples) * scenario.control_period, rtol=1e-14)
    for name in ("x", "v", "u", "applied", "s", "d", "r"):
        array = getattr(trace, name)
        assert array.shape == (samples, n), name
        assert array.dtype == np.float64
        assert not array.flags.writeable
        assert np.isfinite(array[:end]).all(), name
        assert np.isnan(array[end:]).all(), name
    assert np.all(np.abs(trace.u[:end]) <= scenario.u_max)
    assert np.all(np.abs(trace.applied[:end]) <= scenario.u_max)
    if end:
        assert tuple(trace.x[0]) == scenario.x0
        assert tuple(trace.v[0]) == scenario.v0


def playable(scenario: smc.Scenario) -> bool:
    """Whether the run takes a blink."""
    knots = [scenario.duration / d.dt for d in scenario.disturbance if isinstance(d, smc.OrnsteinUhlenbeck)]
    return scenario.samples * scenario.steps * scenario.plant.n <= MOST and max(knots, default=0.0) < 1e5


@st.composite
def attempts(draw):
    """A Scenario, or None where it was refused; any other error shows."""
    try:
        return smc.Scenario(**draw(scenarios()))
    except smc.ScenarioError as error:
        sentence(str(error))
        return None


@alone
@given(attempts())
def test_any_scenario_is_refused_or_runs_to_a_sound_trace(scenario):
    assume(scenario is not None and playable(scenario))
    sound(smc.run(scenario), scenario)


@together
@given(st.lists(attempts(), min_size=2, max_size=6))
def test_any_scenarios_run_together_as_they_run_alone(many):
    many = [scenario for scenario in many if scenario is not None and playable(scenario)]
    for trace, scenario in zip(smc.run(many, threads=2), many, strict=True):
        sound(trace, scenario)
        single = smc.run(scenario, threads=1)
        assert (trace.diverged_at, trace.failure) == (single.diverged_at, single.failure)
        for name in ("x", "v", "u", "applied", "s", "d", "r"):
            assert getattr(trace, name).tobytes() == getattr(single, name).tobytes()


@files
@given(attempts())
def test_any_trace_comes_back_from_its_file(tmp_path_factory, scenario):
    assume(scenario is not None and playable(scenario))
    trace = smc.run(scenario)
    again = smc.load(trace.save(tmp_path_factory.getbasetemp() / "fuzz.npz"))
    assert again.scenario == scenario
    assert (again.diverged_at, again.failure) == (trace.diverged_at, trace.failure)
    for name in ("t", "x", "v", "u", "applied", "s", "d", "r"):
        assert getattr(again, name).tobytes() == getattr(trace, name).tobytes()
