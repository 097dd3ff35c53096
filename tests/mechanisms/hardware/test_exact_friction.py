"""Dry friction on joints that move alone: at 1 ms the motion of integrations that share no code, by
events and in tiny steps.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
import pytest
from helpers import reference
from scipy.integrate import solve_ivp

import smc_mujoco as smc
from smc_mujoco.mechanisms.hardware.friction import dry_step
from smc_mujoco.mechanisms.hardware.sliding import Sliding

PERIOD = 1e-3
EXACT = {"rtol": 1e-11, "atol": 1e-13, "method": "DOP853"}


def by_events(scenario, u, level, d=lambda t: 0.0):
    """Positions, times held and mean frictions at the samples, (3, K + 1), of x'' = f + g (u + d +
    friction).

    The joint slides until its speed is 0. Then it stays until the other forces are more than
    `level`.
    """
    plant = scenario.plant
    values = plant.values({})
    x = scenario.resolved.x0[0]
    v = 0.0
    rows = [(scenario.resolved.x0[0], 0.0, 0.0)]

    def others(x, v, t, held):
        f, g = plant.nominal([x], [v], 0, values)
        return f / g + held + d(t), g

    for k, held in enumerate(u[:-1]):
        t = k * PERIOD
        end = (k + 1) * PERIOD
        rest = 0.0
        pushed = 0.0
        while end - t > 1e-15:
            load = others(x, v, t, held)[0]
            if v == 0.0 and abs(load) <= level:
                times = np.linspace(t, end, 101)  # it breaks away at the first of them, if it does
                loads = np.array([others(x, 0.0, time, held)[0] for time in times])
                count = int(np.argmax(np.abs(loads) > level)) or 100
                rest = rest + times[count] - t
                pushed = pushed - np.trapezoid(loads[: count + 1], times[: count + 1])
                t = times[count]
                continue
            way = np.sign(v or load)

            def slope(time, y, held=held, way=way):
                load, g = others(*y[:2], time, held)
                return [y[1], g * (load - level * way)]

            def stopped(_, y, way=way):
                return y[1] * way

            stopped.__dict__.update(
                terminal=True,
                direction=-1.0,
            )
            path = solve_ivp(slope, (t, end), [x, v], events=stopped, **EXACT)
            pushed -= level * way * (path.t[-1] - t)
            t = path.t[-1]
            x = path.y[0, -1]
            v = 0.0 if path.status == 1 else path.y[1, -1]
        rows.append((x, rest, pushed / PERIOD))
    return np.array(rows).T


class Formula(NamedTuple):
    """A friction by a formula, and the motor it is behind."""

    friction: Sliding
    motor: smc.DCMotor | None = None


@dataclasses.dataclass(frozen=True)
class Stribeck(Sliding):
    """Friction that falls with speed, from `stiction` to `coulomb`, and is stronger backwards."""

    coulomb: float = 0.1
    stiction: float = 0.2
    speed: float = 0.05
    backwards: float = 1.0
    viscous: float = 0.0

    @staticmethod
    def value(v, motor, load, p):
        f = p.coulomb + (p.stiction - p.coulomb) * math.exp(-((v / p.speed) ** 2))
        if v < 0.0:
            f = -f * p.backwards
        return f + p.viscous * v, -p.backwards * p.stiction, p.stiction


FORMULAS = {
    "Coulomb": Formula(Stribeck(0.2, 0.2)),
    "Coulomb and viscous": Formula(Stribeck(0.1, 0.1, viscous=0.3)),
    "Stribeck": Formula(Stribeck()),
    "stronger backwards": Formula(Stribeck(backwards=2.0)),
    "behind a motor": Formula(Stribeck(), smc.DCMotor(inductance=0.0)),
}
for model in ("m1", "m3", "m5", "m6"):
    servo_of_model = smc.hardware.servo("mx64", model)
    FORMULAS[f"servo {model}"] = Formula(servo_of_model.friction, servo_of_model.motor)


CASES = [
    ("inverted_pendulum", "classical", 1e-3, 0.1, None),
    ("inverted_pendulum", "adaptive", 0.02, 0.4, smc.Sine(amplitude=0.6, omega=40.0)),
    ("inverted_pendulum", "adaptive", 0.02, 0.1, None),
    ("inverted_pendulum", "super_twisting", 0.002, 0.1, None),
    ("duffing", "classical", 1e-3, 2.0, None),
    ("duffing", "super_twisting", 1e-3, 0.2, None),
    ("van_der_pol", "observer_free", 0.02, 1.5, smc.Sine(amplitude=2.0, omega=30.0)),
]


@pytest.mark.parametrize(("plant", "law", "x0", "level", "d"), CASES)
def test_motion_and_rest_are_those_of_an_integration_by_events(plant, law, x0, level, d):
    scenario = smc.Scenario(
        plant=plant,
        law=smc.law(law),
        x0=x0,
        duration=0.2,
        friction=smc.Coulomb(level),
        disturbance=d,
        u_max=3.0,
    )
    assert scenario.resolved.integrator == "RK4"
    assert scenario.resolved.physics_step == PERIOD
    trace = smc.run(scenario)

    def force(t):
        if d is None:
            return 0.0
        return d.amplitude * np.sin(d.omega * t)

    x, held, friction = by_events(scenario, trace.u[:, 0], level, force)
    assert np.abs(trace.x[:, 0] - x).max() < 2e-4 * np.ptp(trace.x)
    # it breaks away at a step's end
    assert np.abs(trace.arrays()["held"][:, 0] - held).max() < PERIOD
    assert smc.score(trace)["stick_time"] == pytest.approx(held.sum(), rel=0.02)
    assert np.abs(trace.reaction[:, 0] - friction).max() < 0.03 * level
    mujocos = smc.run(dataclasses.replace(scenario, integrator="implicitfast"))
    assert mujocos.held is None


@pytest.mark.parametrize("seed", range(10))
def test_a_step_of_constant_forces_has_the_mean_and_first_moment_of_its_friction(seed):
    random = np.random.default_rng(seed)
    h = 1e-3
    parts = 20_000
    level = random.uniform(0.0, 1.0)
    mobility = random.uniform(0.5, 10.0)
    smooth = random.uniform(-1.5, 1.5)
    v0 = v = random.choice([0.0, 1.0]) * random.uniform(-1.0, 1.0) * h * mobility
    forces = np.empty(parts)
    for j in range(parts):  # friction stops the joint within a part if it can
        stops = -smooth - v / (mobility * h / parts)
        forces[j] = min(max(stops, -level), level)
        v += (smooth + forces[j]) * mobility * h / parts
    moment = np.mean(forces * (1.0 - (np.arange(parts) + 0.5) / parts))
    levels = -np.copysign(level, v0), -np.copysign(level, smooth)
    mean, rise, held = dry_step(v0, smooth, *levels, -level, level, mobility, h)
    assert mean == pytest.approx(forces.mean(), abs=3e-4)
    assert rise == pytest.approx(6.0 * (forces.mean() / 2.0 - moment), abs=1e-3)
    assert held == pytest.approx(h * np.mean(np.abs(smooth + forces) < 1e-9), abs=h * 2e-4)


EXTRAS = [
    {
        "actuator": smc.Lag(2e-3),
        "disturbance": smc.Sine(0.3, 5.0),
    },
    {
        "actuator": smc.hardware.RateLimit(100.0),
        "jump": smc.Jump(0.03, {"mass": 2.0}),
    },
    {
        "friction": (smc.Coulomb(0.4), smc.Viscous(0.1)),
        "physics_step": 2.5e-4,
        "disturbance": smc.Sine(1.0, 100.0),
    },
]


@pytest.mark.quick
@pytest.mark.parametrize("extra", EXTRAS)
@pytest.mark.parametrize("plant", ["inverted_pendulum", "pendulum_network"])
def test_the_reference_loop_does_the_same_to_the_bit(plant, extra):
    fields = {
        "plant": plant,
        "law": smc.law("super_twisting"),
        "x0": 0.02,
        "duration": 0.06,
        "friction": smc.Coulomb(0.3),
    }
    scenario = smc.Scenario(**fields | extra)
    assert scenario.exact_friction
    compiled = smc.run(scenario).arrays()
    plain = reference.run(scenario).arrays()
    assert np.ptp(compiled["held"]) > 0.0
    for name, values in compiled.items():
        np.testing.assert_array_equal(values, plain[name], err_msg=name)


def test_uncoupled_pendulums_of_a_network_stick_each_by_itself():
    x0 = 0.02, -0.1
    fields = {
        "law": smc.law("super_twisting"),
        "friction": smc.Coulomb(0.2),
        "duration": 0.3,
    }
    network = smc.run(
        smc.Scenario(
            plant=smc.plant("inverted_pendulum_network", n=2, kc=0.0),
            x0=x0,
            **fields,
        )
    )
    for i, start in enumerate(x0):
        alone = smc.run(
            smc.Scenario(
                plant="inverted_pendulum",
                x0=start,
                **fields,
            )
        )
        assert network.x[:, i] == pytest.approx(alone.x[:, 0], abs=1e-12)
        assert network.arrays()["held"][:, i] == pytest.approx(
            alone.arrays()["held"][:, 0], abs=1e-12
        )


ROBOT = """<mujoco><option integrator="RK4"/><worldbody><body>
<joint name="hip" axis="0 1 0" damping="0.02"/>
  <geom size="0.05" pos="0 0 0.5" mass="0.5" contype="0" conaffinity="0"/></body></worldbody>
  <actuator><motor joint="hip" ctrlrange="-6 6"/></actuator></mujoco>"""


def test_your_own_robot_of_one_joint_has_it_too():
    plant = smc.plant_from(ROBOT, ["hip"])
    fields = {
        "plant": plant,
        "law": smc.law("super_twisting"),
        "x0": 0.02,
        "duration": 0.2,
        "u_max": 0.3,
    }
    fields |= {"friction": smc.Coulomb(0.4)}
    scenario = smc.Scenario(disturbance=smc.Sine(0.2, 60.0), **fields)
    assert scenario.exact_friction
    trace = smc.run(scenario)
    plain = reference.run(scenario)
    assert trace.d[:, 0] == pytest.approx(0.2 * np.sin(60.0 * trace.t), abs=1e-12)
    assert trace.arrays()["held"].sum() > 0.01
    assert trace.x == pytest.approx(plain.x, abs=1e-12)
    assert trace.held == pytest.approx(plain.held, abs=1e-12)
    assert not smc.run(smc.Scenario(**fields)).d.any()


@pytest.mark.parametrize(
    "fields",
    [
        {"integrator": "implicitfast"},
        {"actuator": smc.DCMotor()},
        {"actuator": smc.Backlash(0.01)},
        {"contact": "stops"},
        {"friction": smc.hardware.LuGre(0.1, 0.2, 0.05)},
        {"friction": (smc.Coulomb(0.1), smc.hardware.LuGre(0.1, 0.2, 0.05))},
        {"friction": smc.Viscous(0.1)},
        {"plant": "pendulum_network", "mechanism": "springs"},
        {"disturbance": smc.signals.Push("cart", 1.0, 0.0, 0.0)},
        {"plant": "cart_pole"},
    ],
    ids=str,
)
def test_all_else_keeps_mujocos_friction(fields):
    scenario = smc.Scenario(
        **{
            "plant": "duffing",
            "law": "none",
            "friction": smc.Coulomb(0.1),
        }
        | fields
    )
    assert not scenario.exact_friction


def test_a_trace_keeps_how_long_its_joint_was_held(tmp_path):
    trace = smc.run(
        smc.Scenario(
            plant="duffing",
            law="none",
            duration=0.3,
            friction=smc.Coulomb(5.0),
        )
    )
    assert trace.arrays()["held"][1:] == pytest.approx(PERIOD)
    assert not np.any(trace.x - trace.x[0])  # it does not creep
    assert (smc.load(trace.save(tmp_path / "held.npz")).held == trace.held).all()
