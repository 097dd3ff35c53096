"""The plants of real rigs:

Furuta pendulum, double pendulum with its two ways to drive it, servo axis.

The equations are written again here, as mass matrix and forces; nothing of the plants' own
`nominal` is used for them.
"""

import functools
import math
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.plants.double_pendulum import MODEL_1_0

GRAV = 9.81
STATES = 1000
# plant -> parameters that have friction and rotors of every kind
ROUGH = {
    "furuta": {
        "b": 3e-4,
        "bq": 1e-5,
        "cf": 2e-3,
        "cfq": 1e-5,
        "k": 4e-3,
        "tx": 0.1,
        "ty": -0.2,
    },
    "double_pendulum": MODEL_1_0,
    "pendubot": MODEL_1_0,
    "acrobot": MODEL_1_0,
    "servo_axis": {},
}
PLANTS = pytest.mark.parametrize("name", ROUGH)
# Channels of a plant -> its joints in the order of the equation below.
ORDER = {"acrobot": [1, 0]}


def furuta(p, q, v, u):
    """(x'', q'') by Lagrange's equations of the arm and of the pendulum as a thin rod."""
    Jp = p.Jc + p.m * p.l**2
    s = math.sin(q[1])
    c = math.cos(q[1])
    mass = np.array(
        [[p.J + p.m * p.L**2 + Jp * s * s, p.m * p.L * p.l * c], [p.m * p.L * p.l * c, Jp]]
    )
    gyration = np.array(
        [2 * Jp * s * c * v[0] * v[1] - p.m * p.L * p.l * s * v[1] ** 2, -Jp * s * c * v[0] ** 2]
    )
    friction = np.array([p.b, p.bq]) * v + np.array([p.cf, p.cfq]) * np.sign(v)
    arm = np.array([math.sin(q[0]), -math.cos(q[0]), 0.0])
    ahead = np.array([math.cos(q[0]), math.sin(q[0]), 0.0])
    jacobian = np.array(
        [p.L * ahead - p.l * s * arm, p.l * (c * ahead - s * np.array([0.0, 0.0, 1.0]))]
    )
    down = GRAV * np.array([p.tx, p.ty, -math.sqrt(1.0 - p.tx**2 - p.ty**2)])
    return np.linalg.solve(
        mass, [u[0] - p.k * q[0], 0.0] - gyration - friction + p.m * jacobian @ down
    )


def double_pendulum(p, q, v, u):
    """(q1'', q2''): each link's mass at its centre, by Jacobians, its inertia and the rotors'."""
    mass = np.zeros((2, 2))
    force = np.array(u, float)
    first = q[0]
    two = q[0] + q[1]
    turns = (np.array([1.0, 0.0]), np.array([1.0, 1.0]))  # of each link, by the joints
    for m, I, r, arm, turn in (
        (p.m1, p.I1, p.r1, (), turns[0]),
        (p.m2, p.I2, p.r2, (p.l1,), turns[1]),
    ):
        parts = [(length, first, turns[0]) for length in arm] + [
            (r, first if turn is turns[0] else two, turn)
        ]
        jacobian = sum(length * np.outer([math.cos(a), math.sin(a)], by) for length, a, by in parts)
        drift = np.sum(
            [
                length * (by @ v) ** 2 * np.array([-math.sin(a), math.cos(a)])
                for length, a, by in parts
            ],
            0,
        )
        mass += m * jacobian.T @ jacobian + (I - m * r**2) * np.outer(turn, turn)
        force -= m * jacobian.T @ (drift + np.array([0.0, p.grav]))
    mass += p.Ir * (p.gear**2 * np.outer([1, 0], [1, 0]) + np.outer([1, -p.gear], [1, -p.gear]))
    return np.linalg.solve(
        mass, force - np.array([p.b1, p.b2]) * v - np.array([p.cf1, p.cf2]) * np.sign(v)
    )


def servo_axis(p, q, v, u):
    return (u - p.b * v - p.cf * np.sign(v) - p.offset) / p.M


def acceleration(name, p, x, v, u):
    """x'' of the channels, (n,), from their x and v, (n,) each, and the commands of the driven
    ones.
    """
    order = ORDER.get(name, [0, 1])[: len(x)]
    equation = {"furuta": furuta, "servo_axis": servo_axis}.get(name, double_pendulum)
    force = np.zeros(len(x))
    force[: len(u)] = u
    return equation(p, np.take(x, order), np.take(v, order), np.take(force, order))[order]


def states(name, plant, rng):
    """Random states and commands, each joint fast enough that dry friction cannot stop it within a
    step.
    """
    for _ in range(STATES):
        v = rng.uniform(1, 5, plant.n) * rng.choice([-1, 1], plant.n)
        scale = 0.01 if name == "furuta" else 1.0
        yield (
            rng.uniform(-3, 3, plant.n),
            v,
            scale * rng.uniform(-1, 1, plant.driven) * plant.limits[0],
        )


@pytest.mark.quick
@PLANTS
def test_nominal_is_the_equation_without_dry_friction(name):
    rng = np.random.default_rng(6)
    plant = smc.plant(name, **ROUGH[name])
    p = SimpleNamespace(**{**plant.parameters, **dict.fromkeys(plant.dry, 0.0)})
    for x, v, u in list(states(name, plant, rng))[:50]:
        expected = acceleration(name, p, x, v, u)
        for i in range(plant.n):
            inputs = (u,) if name == "double_pendulum" else ()
            f, g = plant.nominal(x, v, i, p, *inputs)
            assert f + g * u[i % plant.driven] == pytest.approx(expected[i], rel=1e-10, abs=1e-10)


def runge_kutta(p, x, torque, period=2e-3, seconds=2.0):
    """q of an independent RK4 at 2 ms of the double pendulum, (K+1, 2), under torques (K, 2)."""
    y = np.array([*x, 0.0, 0.0])
    states = [x]

    def slope(y, u):
        return np.concatenate([y[2:], double_pendulum(p, y[:2], y[2:], u)])

    for u in torque[: round(seconds / period)]:
        k1 = slope(y, u)
        k2 = slope(y + period / 2 * k1, u)
        k3 = slope(y + period / 2 * k2, u)
        k4 = slope(y + period * k3, u)
        y = y + period / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        states.append(y[:2])
    return np.array(states)


@functools.cache
def played(times, torque):
    """A law that gives the torque of a table, held between its times, whatever it measures."""

    @smc.law_function(
        plants=("pendubot", "acrobot"),
        memory=1,
    )
    def table(y, gains, memory):
        k = min(int(y.t / times + 0.5), len(torque) - 1)
        return torque[k], 0.0

    return table()


@pytest.mark.parametrize(
    ("name", "driven"),
    [
        ("pendubot", False),
        ("acrobot", True),
    ],
)
def test_model_1_1_equals_an_independent_rk4(name, driven):
    profile = np.sin(np.arange(500) * 2e-3 * 7.0) * 2.0 * driven
    trace = smc.run(
        smc.Scenario(
            plant=name,
            law=played(2e-3, tuple(profile)),
            x0=(0.8, -0.3),
            control_period=2e-3,
            physics_step=2e-3,
            duration=1.0,
        )
    )
    if name == "pendubot":
        column = 0
        order = [0, 1]
    else:
        column = 1
        order = [1, 0]
    torque = np.zeros((500, 2))
    torque[:, column] = profile
    expected = runge_kutta(
        SimpleNamespace(**smc.plant(name).parameters), np.take((0.8, -0.3), order), torque
    )
    assert np.abs(trace.x[:, order] - expected).max() < 1e-6
    assert np.abs(trace.u[:-1, 0] - profile).max() == 0.0


def test_the_published_mass_matrix_has_rotors_as_here():
    """M of the published design: gear^2 Ir + Ir at the shoulder, gear^2 Ir at the elbow, -gear Ir
    between them.
    """
    plant = smc.plant("double_pendulum", **MODEL_1_0)
    p = SimpleNamespace(**plant.parameters)
    model = plant.load()
    data = mujoco.MjData(model)
    full = np.zeros((2, 2))
    data.qpos[1] = 0.7
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, full)
    a = p.m2 * p.l1 * p.r2 * math.cos(0.7)
    rotor = p.gear**2 * p.Ir
    first = p.I1 + p.I2 + p.m2 * p.l1**2 + 2 * a + rotor + p.Ir
    np.testing.assert_allclose(
        full, [[first, p.I2 + a - p.gear * p.Ir], [p.I2 + a - p.gear * p.Ir, p.I2 + rotor]]
    )


def test_dry_friction_holds_the_axis_and_lets_go_at_its_level():
    cf, offset = (smc.plant("servo_axis").parameters[name] for name in ("cf", "offset"))
    pushes = []
    for sign in (-1, 1):
        for part in (0.95, 1.05):
            pushes.append(sign * cf * part + offset)
    runs = []
    for push in pushes:
        runs.append(
            smc.Scenario(
                plant="servo_axis",
                law="none",
                x0=0.0,
                disturbance=smc.Constant(push),
                duration=0.5,
            )
        )
    moved = [abs(trace.x[-1, 0]) for trace in smc.run(runs)]
    assert max(moved[0], moved[2]) < 1e-6
    assert min(moved[1], moved[3]) > 1e-4
