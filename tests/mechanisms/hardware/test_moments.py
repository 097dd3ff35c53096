"""Tests for what all parts share: the moments at which they act, and parts that a user writes."""

import math
import pickle

import numpy as np
import pytest
from helpers.own_parts import dahl
from helpers.runs import at_defaults

import smc_mujoco as smc
from smc_mujoco.common import fingerprint
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.hardware import actuator_function, friction_function
from smc_mujoco.simulation import callback
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import ScenarioBatch

H = 2.5e-4


@friction_function(numbers={"cold": 0.1, "heat": 5.0}, memory=1)
def grease(y, p, memory):
    """Viscous friction, whose own heat thins the grease."""
    b = p.cold / (1.0 + memory[0])
    memory[0] += y.h * p.heat * b * y.v * y.v
    return -b * y.v


@friction_function(numbers={"scale": 1e-9}, memory=1)
def seen(y, p, memory):
    """A force that tells the command."""
    return p.scale * y.u


@friction_function(memory=2)
def careless(y, p, memory):
    """Writes beyond its memory from 5 ms on."""
    memory[int(y.t > 0.005) * 5] = 1.0
    return 0.0


@friction_function(numbers={"most": 0.005})
def endless(y, p, memory):
    """Is no number from 5 ms on."""
    return math.inf if y.t > p.most else 0.0


@actuator_function(numbers={"gain": 1.0, "zone": 0.0, "after": math.pi})
def motor(y, p, memory):
    """A motor with a dead zone, which divides by 0 after a time."""
    if y.t > p.after:
        return y.u / p.zone
    return p.gain * (y.u - min(max(y.u, -p.zone), p.zone))


FRICTIONS = {
    "viscous": smc.Viscous(0.05),
    "coulomb": smc.Coulomb(0.1),
    "lugre": smc.hardware.LuGre(0.05, 0.1, 0.05),
    "sigmoid": smc.hardware.Sigmoid(p1=0.3, p2=20.0),
    "servo": smc.hardware.ServoFriction(
        kc=0.05,
        kcs=0.05,
        vs=0.1,
        kv=0.01,
    ),
    "dahl": dahl(level=0.1),
    "grease": grease(),
    "two": (dahl(level=0.1), smc.Viscous(0.05)),
}
NOTHING = {
    "viscous": {"friction": smc.Viscous(0.0)},
    "coulomb": {"friction": smc.Coulomb(0.0)},
    "sigmoid": {"friction": smc.hardware.Sigmoid(p1=0.0, p2=20.0)},
    "servo": {"friction": smc.hardware.ServoFriction()},
    "grease": {"friction": grease(cold=0.0)},
    "seen": {"friction": seen(scale=0.0)},
    "lag": {"actuator": smc.Lag(0.0)},
    "rate": {"actuator": smc.hardware.RateLimit(math.inf)},
    "motor": {"actuator": motor()},
}


def scenario(plant="inverted_pendulum", law="pid", **fields):
    return smc.Scenario(plant=plant, law=at_defaults(law), **{"duration": 0.05} | fields)


def same(a, b):
    return np.array_equal(a.x, b.x) and np.array_equal(a.v, b.v) and np.array_equal(a.u, b.u)


@pytest.mark.quick
@pytest.mark.parametrize("name", FRICTIONS)
def test_a_friction_never_drives(name):
    trace = smc.run(
        scenario(
            law="none",
            x0=2.0,
            v0=0.5,
            duration=1.0,
            friction=FRICTIONS[name],
        )
    )
    p = trace.scenario.plant.values({})
    energy = 0.5 * trace.v[:, 0] ** 2 + 9.81 / p.l * np.cos(trace.x[:, 0])
    assert trace.failure is None
    assert np.diff(energy).max() < 1e-5  # what elastic bristles give back
    assert energy[-1] < energy[0] - 1e-3


@pytest.mark.parametrize("plant", ["inverted_pendulum", "double_pendulum"])
@pytest.mark.parametrize("name", NOTHING)
def test_a_part_of_level_zero_changes_no_bit(name, plant):
    stepping = {"integrator": "implicitfast", "physics_step": H, "noise": smc.Noise(1e-3, 1e-2)}
    with_part = smc.run(scenario(plant, **stepping, **NOTHING[name]))
    assert same(with_part, smc.run(scenario(plant, **stepping)))


@pytest.mark.parametrize("delay", [0, 3])
def test_parts_act_after_the_command_arrives(delay):
    late = scenario(
        "cart_pole",
        "hierarchical",
        friction=seen(),
        control_period=H,
        physics_step=H,
        input_delay=delay * H,
    )
    trace = smc.run(late)
    commanded = np.zeros_like(trace.u)
    commanded[delay + 1 :] = 1e-9 * trace.u[: len(commanded) - delay - 1]
    assert np.abs(commanded).max() > 0.0
    assert np.array_equal(trace.reaction[1:, 0], commanded[1:, 0])


def test_the_force_of_a_friction_is_that_of_its_function():
    levels = np.array([0.5, 0.3])
    trace = smc.run(
        scenario(
            "cart_pole",
            "hierarchical",
            friction=dahl(level=tuple(levels)),
            control_period=H,
            physics_step=H,
        )
    )
    z = np.zeros(2)
    for k in range(len(trace.t) - 1):
        assert np.array_equal(-500.0 * z, trace.reaction[k + 1])
        v = trace.v[k]
        z = z + H * v * (1.0 - 500.0 * z / levels * np.copysign(1.0, v))
    assert np.abs(z).max() > 0.0


@pytest.mark.parametrize(
    "parts",
    [{"friction": FRICTIONS[name]} for name in ("sigmoid", "servo", "dahl", "grease", "coulomb")]
    + [
        {"actuator": motor(zone=0.2), "friction": dahl()},
        {"sensor": smc.Encoder(counts=500, dropout=0.3)},
    ],
    ids=str,
)
@pytest.mark.parametrize("plant", ["inverted_pendulum", "double_pendulum"])
def test_a_part_called_in_python_gives_the_same_bits(parts, plant):
    with_parts = scenario(plant, duration=0.02, **parts)
    with callback.installed():
        batch = ScenarioBatch([prepare(with_parts)], threads=1, python=True)
        in_python = batch.run(lambda steps: None)[0]
    assert same(smc.run(with_parts), in_python)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"friction": careless()}, "friction careless raised IndexError"),
        ({"friction": endless()}, "friction endless returned inf"),
        ({"actuator": motor(after=0.005)}, "actuator motor raised ZeroDivisionError"),
    ],
)
def test_a_part_that_fails_is_named(parts, words):
    failure = str(smc.run(scenario(**parts)).failure)
    assert failure.startswith(words)
    assert "in channel 0, at t = 0.00" in failure


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"friction": dahl(), "integrator": "RK4"}, "state of dahl"),
        ({"actuator": (smc.Lag(0.01), motor())}, "motor takes the command itself"),
        ({"actuator": (motor(), smc.Lag(0.01))}, "give one drive"),
        ({"friction": dahl(level=(0.1, 0.2, 0.3))}, "acts on 1 joint"),
        ({"actuator": motor(zone=(0.1, 0.2))}, "acts on 1 joint"),
    ],
)
def test_a_part_that_cannot_act_is_refused(parts, words):
    with pytest.raises(ScenarioError, match=words):
        scenario("cart_pole", "hierarchical", **parts)


@pytest.mark.parametrize(
    "given", [{"numbers": {"memory": 1.0}}, {"numbers": {"a b": 1.0}}, {"memory": -1}]
)
def test_a_function_s_numbers_are_checked(given):
    with pytest.raises(ScenarioError, match="crooked"):

        @friction_function(**given)
        def crooked(y, p, memory):
            return 0.0


def test_a_part_of_a_user_is_kept_with_its_code(tmp_path):
    part = dahl(level=(0.5, 0.01))
    assert pickle.loads(pickle.dumps(part)) == part
    trace = smc.run(scenario("cart_pole", "hierarchical", friction=part))
    trace.save(tmp_path / "trace.npz")
    assert smc.load(tmp_path / "trace.npz").scenario == trace.scenario

    def made(factor):
        @friction_function(numbers={"b": 1.0})
        def damper(y, p, memory):
            return -factor * p.b * y.v

        return fingerprint.of(damper)

    assert made(1.0) == made(1.0) != made(2.0)


def test_an_own_motor_takes_the_place_of_a_command():
    plain = scenario(disturbance=smc.Sine(0.2, 5.0))
    with_motor = scenario(disturbance=smc.Sine(0.2, 5.0), actuator=motor())
    halved = scenario(disturbance=smc.Sine(0.2, 5.0), actuator=motor(gain=0.5))
    assert same(smc.run(plain), smc.run(with_motor))
    trace = smc.run(halved)
    assert trace.force[1:] == pytest.approx(0.5 * trace.applied[:-1], abs=1e-12)
