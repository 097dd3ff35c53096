"""Functions that do not compile: the callback calls them in Python, and gives the oracle's
trace.
"""

import dataclasses
import json
import math

import numpy as np
import pytest
from helpers import arms, reference
from helpers.python_laws import acting
from helpers.runs import assert_same, plainly

import smc_mujoco as smc
from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.control.joint_law import coriolis
from smc_mujoco.mechanisms.hardware.sliding import Sliding
from smc_mujoco.simulation.run import poses

NOISE = smc.Noise(position=0.01, velocity=0.05)


def in_python(value):
    """A number that numba cannot follow."""
    return json.loads(json.dumps(value))


class Remembers:
    """A policy with state of its own."""

    def __init__(self):
        self.past = 0.0

    def __call__(self, observation):
        self.past = 0.9 * self.past + observation[0]
        return [-0.7 * observation[0] - 0.5 * observation[1] - 0.01 * self.past]


@smc.law_function(gains={"k": 2.0}, memory=1)
def integrates(y, gains, memory):
    """A law with memory and gains."""
    memory[0] += y.dt * y.e
    return -in_python(gains.k) * (y.de + y.e) - memory[0], y.e + y.de


@smc.law_function(gains={"late": 0.02})
def raises(y, gains, memory):
    """A law that raises."""
    if y.t > gains.late and y.v < 1e9:
        raise ValueError(in_python("too late"))
    return -y.e - y.de, y.e


@smc.law_function()
def returns_nan(y, gains, memory):
    """A law that loses its number."""
    return (in_python(-y.e) if y.t < 0.02 else math.nan), y.e


@smc.law_function(joint=True, gains={"lam": 6.0, "k1": 3.0}, memory=2)
def of_joints(y, gains, memory):
    """A law of many joints, with the nominal model."""
    s = y.de + gains.k1 * y.e
    memory[:, 0] += y.dt * s
    forces = in_python(1.0) * coriolis(y, y.v) + y.g
    return forces - gains.lam * np.tanh(s / 0.1) - memory[:, 0], s


@smc.design.surface_function(gains={"c": 2.0})
def sliding(y, gains, memory):
    """A surface."""
    return in_python(y.de) + gains.c * y.e, -gains.c * y.e


@smc.estimator_function(memory=1)
def difference(y, gains, memory):
    """An estimator."""
    v = (in_python(y.x) - memory[0]) / y.dt
    memory[0] = y.x
    return v


@dataclasses.dataclass(frozen=True)
class Kicks(smc.Signal):
    """A disturbance that sees the loop."""

    size: float
    sees = True
    memory = 1

    @staticmethod
    def value(t, p, memory, e, de, s):
        memory[0] = in_python(p.size) * (1.0 if e > 0.0 else -1.0)
        return memory[0], 0.0, 0.0


@dataclasses.dataclass(frozen=True)
class Wanders(smc.Signal):
    """A disturbance of random numbers."""

    size: float
    random = True
    memory = 1

    @staticmethod
    def value(t, p, memory, seed, channel, stream):
        memory[0] += p.size * math.sin(in_python(seed + 3.0 * channel + stream + 100.0 * t))
        return memory[0], 0.0, 0.0


@dataclasses.dataclass(frozen=True)
class Grows(Sliding):
    """A friction by a formula."""

    level: float

    @staticmethod
    def value(v, motor, load, p):
        level = in_python(p.level)
        return level * math.tanh(v / 0.01), -level, level


def network(**fields):
    """Three pendulums, unless fields say otherwise."""
    plant = smc.plant("pendulum_network", n=3)
    return smc.Scenario(
        **{
            "plant": plant,
            "duration": 0.05,
            "seed": 3,
            "noise": NOISE,
        }
        | fields
    )


def own_equation():
    """A plant whose nominal model is Python."""

    def nominal(x, v, i, p):
        return in_python(-p.delta * v[i]) - p.alpha * x[i], 1.0 / p.mass

    return dataclasses.replace(smc.plant("duffing"), name="own equation", nominal=nominal)


RUNS = {
    "a policy with state": network(law=acting(Remembers())),
    "a law with memory": network(law=integrates(), input_delay=3e-3),
    "gains of each channel": network(law=integrates(k=(1.0, 2.0, 3.0))),
    "a law that raises": network(law=raises()),
    "a law that raises in one channel": network(law=raises(late=(9.0, 0.03, 9.0))),
    "a law that returns NaN": network(law=returns_nan()),
    "a law of many joints": smc.Scenario(
        plant="double_pendulum",
        law=of_joints(),
        model="nominal",
        duration=0.05,
        u_max=60.0,
    ),
    "a surface": network(law="boundary_layer", surface=sliding()),
    "an estimator": network(law="classical", velocity=difference()),
    "a disturbance that sees the loop": smc.Scenario(
        plant="duffing",
        law=smc.law("classical"),
        disturbance=Kicks(0.1),
        duration=0.05,
    ),
    "a disturbance of random numbers": network(law="classical", disturbance=Wanders(0.1)),
    "a nominal model": smc.Scenario(
        plant=own_equation(),
        law=smc.law("observer_free"),
        model="nominal",
        duration=0.05,
    ),
    "a friction by a formula": network(law="pid", friction=Grows(0.3)),
    "late samples": network(law=integrates(), clock=smc.Clock(jitter=5e-4, missed=0.2)),
    "a stepper motor": smc.Scenario(
        plant="inverted_pendulum",
        law=integrates(),
        actuator=smc.hardware.Stepper(torque=20.0),
        duration=0.05,
        control_period=5e-3,
    ),
    "an arm of a file": smc.Scenario(
        plant=arms.arm(),
        law=of_joints(),
        model="nominal",
        duration=0.03,
        u_max=60.0,
    ),
}


@pytest.mark.quick
@pytest.mark.parametrize("name", RUNS)
def test_what_does_not_compile_gives_the_trace_of_the_oracle(name):
    """To the bit, and told in the same words."""
    scenario = RUNS[name]
    assert_same(plainly(scenario), reference.run(scenario))


class Uncompiled:
    """A law that no compiler takes, as any callable object."""

    def __init__(self, law):
        self.function = rebuild(law.function, lambda function: function)

    def __call__(self, y, gains, memory):
        return self.function(y, gains, memory)


def test_a_drone_flies_under_a_law_in_python():
    """As under its compiled twin: the oracle has no free bodies."""
    law = smc.law("geometric")
    scenario = smc.Scenario(
        plant="quadrotor",
        law=law,
        duration=0.05,
        reference=smc.Sine(0.2, 3.0),
        noise=NOISE,
    )
    twin = smc.run(scenario)
    trace = plainly(
        dataclasses.replace(scenario, law=dataclasses.replace(law, function=Uncompiled(law)))
    )
    assert trace.failure is None
    np.testing.assert_allclose(trace.x, twin.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(trace.u, twin.u, rtol=0, atol=1e-7)


def test_what_only_python_tells_of_a_compiled_law_that_raised_is_told():
    """It had changed its memory before: only a run in Python from the start raises again."""

    @smc.law_function(memory=1)
    def counts(y, gains, memory):
        memory[0] += 1.0
        if memory[0] == 5.0:
            raise ValueError("the fifth")
        return -y.e, y.e

    scenario = network(law=counts())
    assert_same(smc.run(scenario), reference.run(scenario))


@pytest.mark.parametrize("name", ["a policy with state", "a law with memory"])
def test_a_film_has_the_poses_of_a_run_in_python(name):
    """It is simulated again, with a fresh copy of what the law keeps."""
    trace = plainly(RUNS[name])
    np.testing.assert_array_equal(poses(trace, trace.t), trace.x)


def test_a_run_under_python_does_not_depend_on_those_beside_it():
    """A law with state of its own, which its author shares between runs: they run one by one."""
    seen = []

    @smc.law_function()
    def shared(y, gains, memory):
        seen.append(y.t)
        return 0.0, 0.0

    scenarios = []
    for seed in range(2):
        scenarios.append(network(law=shared(), plant="duffing", seed=seed))
    plainly(scenarios)
    assert seen == sorted(seen[: len(seen) // 2]) * 2


def test_a_number_beyond_the_memory_is_told_as_such():
    @smc.law_function(gains={}, memory=1)
    def beyond(y, gains, memory):
        memory[3] = 1.0
        return 0.0, y.e

    with pytest.warns(UserWarning, match="failed by itself"):
        trace = smc.run(smc.Scenario(plant="duffing", law=beyond, duration=0.1))
    assert "memory has as many numbers as memory= of its function says" in str(trace.failure)
