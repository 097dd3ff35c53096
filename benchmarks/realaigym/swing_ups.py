"""This package's entries on the boards of 2025: a sliding mode pumps energy, and a linear law
catches.

    pump:   s = v + c (e - ref),   ref = A sat((E0 + m - E) / w) tanh(r / v_s),   v' = -c v - K
    sat(s / phi) catch:  u = -k'z where z'P z < level

The driven joint, with e its angle from upright and v its speed, follows a reference that swings as
the free part does, by more where energy is missing. E0 is upright's. Of the pendubot E is the
energy of the lower link alone about its joint, and r its speed times the cosine of its angle; of
the acrobot that of the machine, and the shoulder's speed. u gives the wanted v' on the nominal
model (collocated linearisation). z is the distance from upright, and P and k' solve its Riccati
equation for Q = diag(10, 10, 1, 1), R = 1.

Gains were found by random search on the resets of seeds 100 to 115. `global_experiments` has the
entry and its control experiments. Source: M. W. Spong, The swing up control problem for the
acrobot, IEEE Control Systems Magazine 15(1):49, 1995 (the linearisation, and a reference that
pumps), with a sliding surface in place of his linear law."""

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from realaigym.entries import entry, nearest, on_board
from realaigym.scoring import shoulder_first
from smc_mujoco.control.component import Template
from smc_mujoco.control.law import law_function
from smc_mujoco.control.source import SHIPPED
from smc_mujoco.mechanisms.plants.double_pendulum import MODEL_1_1, accelerations
from smc_mujoco.simulation.scenario import Scenario

GLOBAL_NAME = "sliding swing-up"
GAINS: Mapping[str, Mapping[str, float]] = {  # rad, 1/s, rad/s^2, rad/s, J, J, rad/s, N m rad
    "acrobot": {
        "A": 1.426,
        "c": 21.05,
        "K": 300.0,
        "phi": 0.4459,
        "m": -0.2029,
        "w": 0.7947,
        "v_s": 0.2134,
        "level": 213.1,
    },
    "pendubot": {
        "A": 2.138,
        "c": 32.11,
        "K": 300.0,
        "phi": 0.5452,
        "m": 0.6214,
        "w": 2.0,
        "v_s": 0.6516,
        "level": 44.01,
    },
}
NEVER_BENDS = 1e4  # factor on K and phi by which sat(s / phi) is s / phi
MODEL = tuple(
    MODEL_1_1[name]
    for name in ("m1", "m2", "l1", "r1", "r2", "I1", "I2", "Ir", "gear", "b1", "b2", "grav")
)
M1, M2, L1, R1, R2, I1, I2, *_, GRAVITY = MODEL
LOWER, UPPER = GRAVITY * M2 * R2, GRAVITY * (M1 * R1 + M2 * L1)  # N m, gravity's torques at most
COUPLING, INERTIA = M2 * L1 * R2, I1 + I2 + M2 * L1**2  # kg m^2


def upright_law(robot: str) -> tuple[np.ndarray, np.ndarray]:
    """Return k and P of the linear law that holds the machine upright, of z = (q1 - pi, q2, q1',
    q2').
    """
    from scipy.linalg import solve_continuous_are

    driven = shoulder_first(robot).index(0)
    step = 1e-6
    A = np.zeros((4, 4))
    b = np.zeros((4, 1))
    A[:2, 2:] = np.eye(2)
    for joint in range(2):
        d = step * np.eye(2)[joint]
        ahead, behind = (
            accelerations(math.pi + sign * d[0], sign * d[1], 0.0, 0.0, *MODEL)
            for sign in (1.0, -1.0)
        )
        A[2:, joint] = np.subtract(ahead[:2], behind[:2]) / (2.0 * step)
    b[2:, 0] = accelerations(math.pi, 0.0, 0.0, 0.0, *MODEL)[2 + driven : 4 + driven]
    solved = solve_continuous_are(A, b, np.diag([10.0, 10.0, 1.0, 1.0]), [[1.0]])
    return np.array((b.T @ solved).ravel()), np.array(solved)


def _swing_up(robot: str) -> Template:
    """Return the law of a robot; (x, v) are the driven joint's, (q, dq) the free one's."""
    k, solved = upright_law(robot)
    shoulder = robot == "pendubot"

    def law(y, gains, memory):
        if shoulder:
            q1 = y.x
            q2 = y.q
            v1 = y.v
            v2 = y.dq
        else:
            q1 = y.q
            q2 = y.x
            v1 = y.dq
            v2 = y.v
        z = (nearest(q1 - math.pi), nearest(q2), v1, v2)
        cost = u = 0.0
        for i in range(4):
            u -= k[i] * z[i]
            for j in range(4):
                cost += z[i] * solved[i, j] * z[j]
        if cost < gains.level:
            return u, -u
        if shoulder:
            swing = (v1 + v2) * math.cos(q1 + q2)
            missing = LOWER * (1.0 + math.cos(q1 + q2)) - 0.5 * I2 * (v1 + v2) ** 2
        else:
            swing = v1
            cosine = COUPLING * math.cos(q2)
            missing = UPPER * (1.0 + math.cos(q1)) + LOWER * (1.0 + math.cos(q1 + q2))
            missing -= (
                (0.5 * INERTIA + cosine) * v1 * v1 + (I2 + cosine) * v1 * v2 + 0.5 * I2 * v2 * v2
            )
        reference = (
            gains.A
            * min(max((missing + gains.m) / gains.w, -1.0), 1.0)
            * math.tanh(swing / gains.v_s)
        )
        e = z[0] if shoulder else z[1]
        s = y.v + gains.c * (e - reference)
        desired = -gains.c * y.v - gains.K * min(max(s / gains.phi, -1.0), 1.0)
        return (desired - y.f) / y.g, s

    law.__name__ = law.__qualname__ = (
        f"{robot}_sliding_swing_up"  # by which files and other processes find it
    )
    law.__doc__ = (
        f"Swing-up of the {robot} from anywhere: a sliding mode pumps energy, a linear law catches."
    )
    return law_function(
        gains=dict(GAINS[robot]),
        positive=("A", "c", "K", "phi", "w", "v_s"),
        plants=(robot,),
        requires_model=True,
    )(law)


acrobot_sliding_swing_up = _swing_up("acrobot")
pendubot_sliding_swing_up = _swing_up("pendubot")


def global_entry(robot: str, **gains: float) -> Scenario:
    """Return what this package enters on the board of 2025 of a robot: its law, measured
    velocities, nominal model.
    """
    shoulder_first(robot)
    if robot == "acrobot":
        law = acrobot_sliding_swing_up
    else:
        law = pendubot_sliding_swing_up
    return dataclasses.replace(on_board(robot, law(**gains).sourced(SHIPPED)), model="nominal")


def global_experiments(robot: str) -> dict[str, Scenario]:
    """Return name of row -> run of the entry on the board of 2025, and of its experiments."""
    own_entry = global_entry(robot)
    gains = GAINS[robot]
    straight = {name: NEVER_BENDS * gains[name] for name in ("K", "phi")}
    return {
        GLOBAL_NAME: own_entry,
        "the same, linear": global_entry(robot, **straight),
        "the same, no pump": global_entry(robot, A=1e-9),
        "the same, no catch": global_entry(robot, level=0.0),
        "linear law alone": global_entry(robot, level=1e99),
        "trajectory + Riccati*": entry(robot, velocity="measured"),
        "u = 0": on_board(robot, "none"),
    }
