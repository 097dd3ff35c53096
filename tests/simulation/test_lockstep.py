"""The compiled callback and the oracle give the same numbers, to the last bit, whatever
else runs.

The oracle uses numpy's own generator and calls the laws as the Python functions they are:
agreement holds the callback's clock, noise, delay, estimators, signals, saturation and logging
against a second telling of them.
"""

import dataclasses
import hashlib
import importlib
import itertools
import math
import os
import threading
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import reference
from helpers.commands import python
from helpers.pages import ROOT
from helpers.runs import ARRAYS, JOINTED, assert_loops_agree, assert_same, at_defaults

import smc_mujoco as smc

PLANTS = pytest.mark.parametrize("plant", JOINTED)
STUDIED = [*smc.paper.GAINS["duffing"], "none"]
runner = importlib.import_module("smc_mujoco.simulation.run")  # smc.run is the function


def shortened(s, duration):
    """The scenario with its run, and every time in it, shrunk to about a duration."""
    duration = round(math.ceil(duration / s.control_period - 1e-9) * s.control_period, 9)
    shrink = duration / s.duration
    signals = []
    for d in s.disturbance:
        times = {k: v * shrink for k, v in d.parameters().items() if k in ("time", "width")}
        if "width" in times:  # a blow lasts a physics step or longer
            times["width"] = max(times["width"], s.resolved.physics_step)
        signals.append(dataclasses.replace(d, **times))
    jump = s.jump and smc.Jump(time=s.jump.time * shrink, factors=s.jump.factors)
    fault = s.fault and dataclasses.replace(s.fault, at=s.fault.at * shrink)
    changes = {"disturbance": tuple(signals), "jump": jump, "fault": fault}
    return dataclasses.replace(s, duration=duration, **changes)


def test_callback_equals_plain_loop_under_every_law():
    """To rounding, as compiled powers and compiled models may differ from Python's by one."""
    ways = itertools.cycle(itertools.product(("none", "nominal"), ("measured", "levant")))
    scenarios = []
    for i, law in enumerate(smc.laws()):
        plants = []
        for name in smc.plants():
            if law in smc.laws(name):
                plants.append(name)
        model, velocity = next(ways)
        scenarios.append(noisy(plants[i % len(plants)], law, model, velocity))
    assert_loops_agree(scenarios, 1e-9)


def noisy(plant, law, model, velocity):
    """A short run of a law under noise."""
    common = {"duration": 0.03, "noise": smc.Noise(0.01, 0.05)}
    return smc.Scenario(
        plant=plant,
        law=at_defaults(law),
        model=model,
        velocity=velocity,
        **common,
    )


@pytest.mark.quick
@pytest.mark.parametrize("surface", smc.laws(kind="surface"))
def test_callback_equals_plain_loop_on_every_surface(surface):
    scenario = smc.Scenario(
        plant="inverted_pendulum",
        law=smc.law("boundary_layer"),
        surface=surface,
        model="nominal",
        duration=0.2,
    )
    assert_loops_agree([scenario], 1e-12)


@pytest.mark.parametrize("velocity", smc.laws(kind="estimator"))
def test_callback_equals_plain_loop_with_every_estimator(velocity):
    scenario = smc.Scenario(
        plant="duffing",
        law=smc.law("classical"),
        velocity=velocity,
        noise=smc.Noise(0.01),
        duration=0.3,
        seed=4,
    )
    assert_loops_agree([scenario], 1e-9)


def within(plant):
    """Least and largest positions of a plant's channels."""
    if plant.ranges:
        return np.array([ends for _, *ends in plant.ranges]).T
    return (-math.inf, math.inf)


def scattered(number):
    """A random valid scenario."""
    rng = np.random.default_rng(number)
    plant = smc.plant(str(rng.choice(JOINTED)))
    period, step = [(1e-3, 1e-3), (2e-3, 1e-3), (5e-3, 1e-3), (20e-3, 1e-3), (4e-3, 5e-4)][
        rng.integers(5)
    ]
    key = str(rng.choice([*plant.parameters, "mass"]))
    signals = [
        smc.Constant(rng.normal()),
        smc.Sine(rng.normal(), omega=rng.uniform(1, 50), phase=rng.uniform(0, 6)),
        smc.Step(rng.normal(), time=rng.uniform(0, 0.2)),
        smc.signals.Pulse(rng.normal(), time=rng.uniform(0, 0.2), width=rng.uniform(0.001, 0.1)),
        smc.signals.OrnsteinUhlenbeck(
            rng.uniform(0.1, 1), tau=rng.uniform(0.01, 1), dt=rng.uniform(1e-4, 1e-2)
        ),
    ]
    law = smc.law(str(rng.choice(STUDIED)))
    reference = smc.Sine(0.05, omega=20.0, about="goal") if plant.ranges else None
    return smc.Scenario(
        plant=plant,
        law=law,
        duration=0.2,
        control_period=period,
        physics_step=step,
        u_max=float(rng.choice([0.3, 6.0, math.inf])),
        x0=tuple(np.clip(rng.uniform(-1.5, 1.5, plant.n), *within(plant))),
        v0=tuple(rng.uniform(-1.5, 1.5, plant.n)),
        reference=reference or signals[rng.integers(4)],
        disturbance=tuple(signals[i] for i in rng.choice(5, size=rng.integers(4), replace=False)),
        noise=smc.Noise(*rng.choice([0.0, 0.01], 2)),
        input_delay=int(rng.integers(0, 40)) * step,
        velocity=str(rng.choice(["measured", "filtered_difference"])),
        mismatch={key: rng.uniform(0.6, 1.6)},
        jump=smc.Jump(time=rng.uniform(0, 0.2), factors={key: rng.uniform(0.6, 1.6)}),
        seed=int(rng.integers(2**53)),
        integrator=str(rng.choice(["RK4", "Euler", "implicitfast", "implicit"])),
    )


@pytest.mark.parametrize(
    "numbers", [range(12), pytest.param(range(12, 36), marks=pytest.mark.slow)], ids=str
)
def test_callback_equals_plain_loop_in_scattered_scenarios(numbers):
    scenarios = [scattered(number) for number in numbers]
    assert_loops_agree(scenarios)


@PLANTS
def test_every_parameter_of_a_plant_may_differ_and_jump_within_one_batch(plant):
    keys = list(smc.plant(plant).parameters)
    common = {
        "plant": plant,
        "law": smc.law("super_twisting"),
        "duration": 0.03,
        "disturbance": smc.Sine(0.2, omega=5.0),
    }
    scenarios = []
    for time, off in (
        (0.0, 0.1),
        (0.013, -0.1),
    ):
        factors = {}
        for i, key in enumerate(keys):
            factors[key] = 1.0 + off * (1 + i % 3) / 3
        # a share, 0 to 1, to which this is added
        if "delta" in keys:
            factors |= {"delta": 0.3}
        scenarios.append(
            smc.Scenario(
                mismatch=factors, jump=smc.Jump(time, dict(reversed(factors.items()))), **common
            )
        )
    assert_loops_agree(scenarios)


def test_a_jump_at_the_last_step_is_in_the_last_sample():
    """The jump makes the lever of the gust longer."""
    gust = smc.signals.Gust(2.0, 0.0, 0.02)
    jump = smc.Jump(0.00999, {"l": 1.5})
    longer = smc.Scenario(
        plant="inverted_pendulum",
        law="none",
        duration=0.01,
        disturbance=gust,
        jump=jump,
    )
    assert longer.jump_step == longer.samples * longer.steps
    trace = smc.run(longer)
    assert_same(trace, reference.run(longer))
    assert trace.d[-1, 0] > 1.4 * trace.d[-2, 0]


@pytest.mark.parametrize(
    ("period", "steps"),
    [
        (0.0225, 23),
        (0.0305, 31),
        (0.05, 19),
    ],
)
def test_a_disturbance_that_begins_at_a_sample_is_in_that_sample(period, steps):
    step = smc.Step(1.0, time=2 * period)
    scenario = smc.Scenario(
        plant="duffing",
        law="none",
        control_period=period,
        physics_step=period / steps,
        duration=0.5,
        disturbance=step,
    )
    assert smc.run(scenario).d[:4, 0].tolist() == [0.0, 0.0, 1.0, 1.0]


@smc.law_function(gains={"a": 20.0, "b": 5.0}, requires_model=True)
def both(y, gains, memory):
    """Reads the model of the driven channel and of the one that it moves."""
    acceleration = -gains.a * y.e - gains.b * y.de
    return (acceleration - y.f) / y.g + 0.01 * (gains.a * y.q + gains.b * y.dq - y.fq) / y.gq, y.e


def test_a_voltage_and_a_feedforward_are_the_same_in_both_loops():
    """A law that computes with the model per volt, on the joint that the motor drives and the one
    that it moves.
    """
    motor = smc.DCMotor(
        8.4,
        1e-3,
        0.042,
        1.0,
        4e-6,
        voltage=10.0,
        command="voltage",
    )
    scenario = smc.Scenario(
        plant=smc.plant("furuta", b=1e-4, bq=1e-5),
        law=both(),
        x0=(0.0, 0.05),
        actuator=motor,
        feedforward=smc.Sine(0.5, 20.0),
        sensor=smc.Encoder(2048),
        control_period=2e-3,
        input_delay=1e-3,
        duration=0.3,
    )
    trace = smc.run(scenario)
    in_python = reference.run(scenario)
    for name in ARRAYS:
        np.testing.assert_allclose(
            getattr(trace, name), getattr(in_python, name), rtol=1e-9, atol=1e-9, err_msg=name
        )
    plain = smc.run(dataclasses.replace(scenario, feedforward=None))
    np.testing.assert_allclose(trace.u[0, 0], plain.u[0, 0])
    assert np.abs(trace.u[1:50] - plain.u[1:50]).max() > 0.01


def test_a_feedforward_is_added_before_the_bound_and_read_at_the_sample():
    scenario = smc.Scenario(
        plant="duffing",
        law="none",
        feedforward=smc.Sine(8.0, 30.0),
        duration=0.2,
        control_period=5e-3,
    )
    trace = smc.run(scenario)
    expected = np.clip(8.0 * np.sin(30.0 * trace.t), -6.0, 6.0)
    np.testing.assert_allclose(trace.u[:, 0], expected, atol=1e-12)
    assert_same(trace, reference.run(scenario))


def test_applied_is_the_command_of_the_delay_ago():
    delays = (0.0, 0.001, 0.004, 0.007, 0.01, 0.19)
    common = {
        "plant": "duffing",
        "law": smc.law("observer_free"),
        "duration": 0.2,
        "control_period": 0.005,
        "physics_step": 0.001,
    }
    scenarios = []
    for delay in delays:
        scenarios.append(smc.Scenario(**common, noise=smc.Noise(0.1, 0.1), input_delay=delay))
    for trace in smc.run(scenarios):
        # a command acts from the next sample on
        samples = math.ceil(round(trace.scenario.input_delay / 0.001) / 5)
        np.testing.assert_array_equal(trace.applied[:samples], 0.0)
        np.testing.assert_array_equal(trace.applied[samples:], trace.u[: len(trace.u) - samples])
        assert np.unique(trace.u).size > 1


def batch():
    """Two plants, each with half of the laws, mixed gains, signals, noise, seeds, delays, jumps and
    periods.
    """
    scenarios = []
    for i, law in enumerate(STUDIED):
        common = smc.paper.scenario(
            ("duffing", "pendulum_network")[i % 2], law, "jump_mild", seed=i
        )
        noisy = {
            "noise": smc.Noise(0.01, 0.05),
            "disturbance": smc.signals.OrnsteinUhlenbeck(0.2 + 0.1 * i, tau=0.1),
        }
        scenarios.append(shortened(common, 0.1))
        scenarios.append(shortened(dataclasses.replace(common, **noisy, input_delay=i * 1e-3), 0.1))
        scenarios.append(
            shortened(dataclasses.replace(common, **noisy, velocity="filtered_difference"), 0.1)
        )
        scenarios.append(
            dataclasses.replace(scenarios[-1], jump=None, control_period=5e-3, u_max=0.1 * (i + 1))
        )
    return scenarios


def digest(traces):
    """A fingerprint of every bit of some traces."""
    total = hashlib.sha256()
    for trace in traces:
        for name in ARRAYS:
            total.update(np.ascontiguousarray(getattr(trace, name)).tobytes())
    return total.hexdigest()


@pytest.fixture(scope="module")
def together():
    return smc.run(batch(), threads=1)


@pytest.mark.parametrize("threads", [2, 4])
def test_threads_change_no_bit(together, threads):
    assert digest(smc.run(batch(), threads=threads)) == digest(together)


def test_company_changes_no_bit(together):
    for scenario, trace in zip(batch(), together, strict=True):
        assert_same(smc.run(scenario), trace)


@pytest.mark.parametrize(
    ("batch_bytes", "slice_steps"),
    [
        (1, 10**9),
        (300_000, 777),
        (10**9, 1),
    ],
)
def test_batches_and_slices_change_no_bit(together, monkeypatch, batch_bytes, slice_steps):
    monkeypatch.setattr(runner, "BATCH_BYTES", batch_bytes)
    monkeypatch.setattr(runner, "SLICE_STEPS", slice_steps)
    assert digest(smc.run(batch(), threads=2)) == digest(together)


def test_another_process_gives_the_same_bits_and_a_python_law_may_simulate_a_model_of_its_own(
    together,
):
    """A predictive law steps MuJoCo inside the callback: the worst case is an abort of the
    process.
    """
    here = Path(__file__).parent
    code = (
        "import smc_mujoco as smc, test_lockstep as t; print(t.digest(smc.run(t.batch()))); "
        "t.predict()"
    )
    assert python(
        "-c", code, path=f"{here.parent}{os.pathsep}{here}{os.pathsep}{ROOT}"
    ).stdout.strip() == digest(together)


def test_runs_from_several_python_threads_give_the_same_bits(together):
    digests = {}

    def work(i):
        digests[i] = digest(smc.run(batch(), threads=1 + i % 2))

    workers = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert digests == dict.fromkeys(range(4), digest(together))


@smc.law_function(gains={"at": 0.05, "how": 0.0}, memory=1)
def doomed(y, gains, memory):
    """Fails at a time: 0 returns NaN, 1 raises, 2 writes beyond its memory, 3 throws the plant out
    of the world.
    """
    if y.t >= gains.at:
        if gains.how == 0.0:
            return math.nan, y.e
        if gains.how == 1.0:
            raise ValueError
        if gains.how == 2.0:
            memory[3] = 1.0
        if gains.how == 3.0:
            return 9e9, y.e
    return -1e-3 * (y.e + y.de), y.e


@pytest.mark.parametrize(("plant", "how"), list(zip(JOINTED, itertools.cycle(range(4)))))
def test_a_failure_is_timed_and_what_came_before_is_kept(plant, how):
    unbounded = dataclasses.replace(smc.plant(plant), limits=())
    scenario = smc.Scenario(
        plant=unbounded,
        law=doomed(how=how),
        u_max=math.inf,
        duration=0.1,
        control_period=2e-3,
    )
    trace = smc.run(scenario)
    assert_same(trace, reference.run(scenario))
    assert trace.diverged_at is not None
    assert trace.failure is not None
    assert 0.05 <= trace.diverged_at <= 0.07
    assert f"t = {trace.diverged_at:g} s" in trace.failure
    for name in ("x", "v", "u", "applied", "s", "d"):
        finite = np.isfinite(getattr(trace, name)).all(axis=1)
        np.testing.assert_array_equal(finite, trace.t < trace.diverged_at)


def test_a_command_too_large_for_mujoco_is_not_dropped_in_silence():
    """Beyond 1e10 MuJoCo sets every control to 0 and only counts a warning: the trace must not say
    that it acted.
    """

    @smc.law_function()
    def huge(y, gains, memory):
        return 1e11, y.e

    free = smc.Scenario(
        plant="duffing",
        law="none",
        duration=0.02,
        u_max=math.inf,
    )
    trace = smc.run(dataclasses.replace(free, law=huge()))
    assert trace.failure or not np.array_equal(trace.x, smc.run(free).x)


def test_plants_of_one_name_and_two_mechanisms_are_not_mixed():
    duffing = smc.plant("duffing")

    def tilted(n):
        spec = duffing.build(n)
        spec.option.gravity = (-9.81, 0.0, 0.0)
        return spec

    flat = smc.Scenario(plant=duffing, law="none", duration=0.05)
    steep = dataclasses.replace(flat, plant=dataclasses.replace(duffing, build=tilted))
    for trace, scenario in zip(smc.run([flat, steep]), (flat, steep), strict=True):
        assert_same(trace, reference.run(scenario))


def test_a_plant_that_lets_mujoco_reset_itself_still_says_that_it_diverged():
    """An autoreset wipes userdata, and with it the row: without a word, the rest of the trace would
    be raw memory.
    """
    duffing = smc.plant("duffing")

    def resetting(n):
        spec = duffing.build(n)
        spec.option.disableflags &= ~mujoco.mjtDisableBit.mjDSBL_AUTORESET.value
        return spec

    plant = dataclasses.replace(duffing, name="resetting", build=resetting)
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law="none",
            duration=0.01,
            disturbance=smc.Constant(1e12),
        )
    )
    assert trace.diverged_at == 1e-3
    assert "the plant diverged" in str(trace.failure)


class Policy:
    """A law that no compiler takes; it may run its own simulation."""

    def __init__(self, think=lambda: None):
        self.think = think

    def __call__(self, y, gains, memory):
        self.think()
        return -3.0 * y.e - y.de, y.e


def uncompiled(think=lambda: None, duration=0.05):
    """A scenario under a Policy."""
    return smc.Scenario(plant="duffing", law=smc.law_function()(Policy(think))(), duration=duration)


def predict():
    """A run whose law steps another model gives what it gives without."""
    model = smc.plant("duffing").load()
    data = mujoco.MjData(model)
    warnings.simplefilter("ignore", smc.errors.PlainLoopWarning)
    thinking = smc.run(uncompiled(lambda: mujoco.mj_step(model, data)))
    assert data.ctrl[0] == 0.0
    np.testing.assert_array_equal(thinking.x, smc.run(uncompiled()).x)


@pytest.mark.filterwarnings("ignore::smc_mujoco.simulation.run.PlainLoopWarning")
def test_a_python_law_may_run_scenarios_of_its_own():
    inner = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.005)
    alone = smc.run(inner)
    inside = []
    trace = smc.run(uncompiled(lambda: inside.append(smc.run(inner)), duration=0.005))
    assert trace.failure is None
    np.testing.assert_array_equal(trace.x, smc.run(uncompiled(duration=0.005)).x)
    for of_inside in inside:
        assert_same(of_inside, alone)
