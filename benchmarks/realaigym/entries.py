"""This package's entries on the boards: an optimised trajectory under a Riccati law, and its
control experiments.

    s = b' P (z - z*) / R,    u = u* - k tanh(s / phi)

z = (q1, q2, q1', q2') is the state, z*(t) and u*(t) a trajectory from hanging to upright, b(t) the
input vector of the motion linearised along it, and P(t) the solution of its Riccati equation -P' =
A'P + P A - P b b'P / R + Q, whose end is that of the upright equilibrium. After the trajectory all
of them keep their last values, and the law balances.

The entry's feedback is 1.5 s near the trajectory and bends where |s| nears phi; u = u* - s is the
linear-quadratic regulator. `FEEDBACKS` has three others, as control experiments. docs/boards.md
tells what they say about the entry.

`trajectories/` has z*, u*, z*'' and b'P/R of each robot, and how they were computed. The entry's
velocities are those of a Savitzky-Golay filter of 5 positions; the published entries use measured
ones, so every feedback has a row with each. Sources: R. E. Kalman, Contributions to the theory of
optimal control, Boletin de la Sociedad Matematica Mexicana 5:102, 1960 (the regulator); V. I.
Utkin, Sliding Modes in Control and Optimization, Springer 1992, chapter 9 (s = 0 as a surface of
least quadratic cost)."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from smc_mujoco.common.errors import find
from smc_mujoco.common.files import read_json
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import Estimator, estimator
from smc_mujoco.control.law import Law, law_function
from smc_mujoco.control.source import SHIPPED
from smc_mujoco.control.units import FORCE, Gain
from smc_mujoco.simulation.scenario import Scenario

TRAJECTORY_FOLDER = Path(__file__).parent / "trajectories"
PERIOD, DURATION = 2e-3, 10.0  # s, of the boards
FILTER_READINGS = 5  # readings of the velocity's filter
LINEAR_PHI = 6e6  # N m, a phi for which tanh(s / phi) is s / phi to 1e-10
FEEDBACKS: Mapping[str, Mapping[str, float]] = {  # feedback along the trajectory -> k and phi, N m
    "Riccati": {"k": 9.0, "phi": 6.0},  # the entry
    "linear": {"k": 1.5 * LINEAR_PHI, "phi": LINEAR_PHI},  # the entry's slope at s = 0
    "clipped": {"k": LINEAR_PHI, "phi": LINEAR_PHI},  # u = u* - s: the Riccati gain itself
    "sliding": {
        "k": 9.0,
        "phi": 0.06,
    },  # a hundredth of the entry's layer: the law switches on s = 0
}


def entry(robot: str, feedback: str = "Riccati", **fields: Any) -> Scenario:
    """Return the run of this package's entry on the boards of "acrobot" or "pendubot".

    Args:
      robot: "pendubot" or "acrobot".
      feedback: that of the entry, "Riccati", or of a control experiment: "linear", "clipped" or
        "sliding".
      fields: of the Scenario, in place of the board's.

    Raises:
      ScenarioError: another robot or feedback.
    """
    law = find(
        "robot of the boards", robot, {"acrobot": acrobot_swing_up, "pendubot": pendubot_swing_up}
    )
    gained_law = law(**find("feedback of the entry", feedback, FEEDBACKS)).sourced(SHIPPED)
    filtered = estimator("savitzky_golay", window=FILTER_READINGS, degree=2)
    return dataclasses.replace(on_board(robot, gained_law, filtered), **fields)


def on_board(
    robot: str, law: Law | Template | str, velocity: Estimator | str = "measured"
) -> Scenario:
    """Return the run of a law by the rules of the boards: from rest, hanging, 10 s at 2 ms.

    Args:
      robot: "pendubot" or "acrobot".
      law: a law, or the name of one.
      velocity: estimator of the velocities, or the name of one.
    """
    return Scenario(
        plant=robot,
        law=law,
        velocity=velocity,
        x0=0.0,
        v0=0.0,
        duration=DURATION,
        control_period=PERIOD,
        physics_step=PERIOD,
        integrator="RK4",
    )


@njit
def hermite(a, b, da, db, h, part):
    """Return the cubic between a and b, h apart, with slopes da and db, at a fraction `part` of the
    way.
    """
    rest = 1.0 - part
    return rest * rest * (a * (1.0 + 2.0 * part) + h * part * da) + part * part * (
        b * (1.0 + 2.0 * rest) - h * rest * db
    )


@njit
def nearest(angle):
    """Return an angle less whole turns, in -pi .. pi."""
    return math.atan2(math.sin(angle), math.cos(angle))


def _along(robot: str) -> Template:
    """Return the law along the trajectory of a robot; (x, v) are the driven joint's, (q, dq) the
    free one's.
    """
    table = read_json(TRAJECTORY_FOLDER / f"{robot}.json")
    STEP = float(table["step"])
    LAST = len(table["u"]) - 1
    names = ("x", "v", "a", "q", "dq", "ddq", "u", "s_x", "s_v", "s_q", "s_dq")
    X, V, A, Q, DQ, DDQ, U, SX, SV, SQ, SDQ = [np.array(table[name]) for name in names]

    def law(y, gains, memory):
        place = y.t / STEP
        i = min(int(place), LAST - 1)
        j = i + 1
        part = min(place - i, 1.0)
        middle = min((y.t + 0.5 * y.dt) / STEP - i, 1.0)
        x = nearest(y.x - hermite(X[i], X[j], V[i], V[j], STEP, part))
        v = y.v - hermite(V[i], V[j], A[i], A[j], STEP, part)
        q = nearest(y.q - hermite(Q[i], Q[j], DQ[i], DQ[j], STEP, part))
        dq = y.dq - hermite(DQ[i], DQ[j], DDQ[i], DDQ[j], STEP, part)
        s = (SX[i] + part * (SX[j] - SX[i])) * x + (SV[i] + part * (SV[j] - SV[i])) * v
        s += (SQ[i] + part * (SQ[j] - SQ[i])) * q + (SDQ[i] + part * (SDQ[j] - SDQ[i])) * dq
        return U[i] + middle * (U[j] - U[i]) - gains.k * math.tanh(s / gains.phi), s

    law.__name__ = law.__qualname__ = (
        f"{robot}_swing_up"  # by which files and other processes find it
    )
    law.__doc__ = (
        f"Swing-up and balance of the {robot} along an optimised trajectory: u = u* "
        "- k tanh(s / phi)."
    )
    return law_function(
        gains={
            name: Gain(value, FORCE, positive=True) for name, value in FEEDBACKS["Riccati"].items()
        },
        conditions={"k > phi / 2": lambda g: g.k > g.phi / 2.0},
        memory=1,
        plants=(robot,),
        continuous=True,
        label="Trajectory under a Riccati law",
        short="TR",
        colour="#D55E00",
    )(law)


acrobot_swing_up = _along("acrobot")
pendubot_swing_up = _along("pendubot")
