"""ADRC of the attitude: torque = J (v - w x wd) + w x J w, v = -(wc^2 z1 + 2 wc z2 + z3) / |q0|,
for a free body.

    y = 2 sgn(q0) qv,    A = 1 / (lag p + 1),
    z1' = z2 + 3 wo (y - z1),    z2' = z3 + |q0| A v + 3 wo^2 (y - z1),    z3' = wo^3 (y - z1).

Active disturbance rejection for each axis, with y the error of the attitude, |q0| at least 0.2, and
A the lag that the law takes the rotors to have. Force, wanted attitude and wd are those of
`geometric`. z1 and z2 change sign with y, on the other side of 180 degrees. z3 estimates all that v
does not explain, so that no constant torque leaves an error. No rate is measured but at the first
sample. y'' is |q0| w' near the wanted attitude, or for turns about one axis. With the lag right the
poles there are -wo, -1 / lag and those of lag p^3 + p^2 + 2 wc p + wc^2, stable for wc lag < 2. The
defaults, chosen before a run, have a phase margin of 33 degrees, of 10 where the lag is 0.136 s. A
Crazyflie that tumbles upside down, at 12 rad/s, loses 12 m with them. s is e' + (kx / kv) e and z2
+ wc z1 / 2: the law slides nowhere.
Gains: kx [1/s^2] and kv [1/s], of the position; wc [1/s], bandwidth of the loop; wo [1/s], of the
observer; lag [s], of the rotors.
Source: Z. Gao, "Scaling and bandwidth-parameterization based controller tuning", American Control
Conference 2003; observer as in `extended_state`. Gains for a Crazyflie are not published.
"""

import math
from typing import NamedTuple

import numpy as np

from smc_mujoco.control.attitude import FEEDBACK, LAG, STEERING, shorter, steer, wrench
from smc_mujoco.control.joint_law import inner
from smc_mujoco.control.law import FREE_BODY, law_function
from smc_mujoco.control.laws.extended_state import corrections, observe
from smc_mujoco.control.units import RATE, Gain, shared

LEAST = 0.2  # chosen: of |q0|


class AxisReading(NamedTuple):
    """What the observer of one axis reads."""

    e: float
    de: float
    dt: float


@law_function(
    joint=True,
    family="disturbance-observer",
    continuous=True,
    requires_model=True,
    plants=(FREE_BODY,),
    gains=shared(
        {
            **FEEDBACK,
            "wc": Gain(4.0, RATE, positive=True, turns=True),
            "wo": Gain(40.0, RATE, positive=True, turns=True),
            "lag": LAG,
        }
    ),
    accuracy=0,
    label="ADRC attitude",
    short="AA",
    memory=STEERING
    + 5,  # and, in the last rows, the observers of three axes: start, z1, z2, z3, acceleration
)
def adrc_attitude(y, gains, memory):
    s = np.zeros(6)
    v = np.zeros(3)
    ones = np.ones(3)
    s[:3] = y.de[:3] + gains.kx / gains.kv * y.e[:3]
    F, error, turning, moving = steer(
        y, -gains.kv * s[:3], gains.kx * ones, gains.kv * ones, memory
    )
    angle, change = shorter(error, turning)
    # from one side of 180 degrees to the other, where |y| = 2
    turns = inner(angle, memory[3:, 3]) < -2.0
    l1, l2, l3 = corrections(gains.wo, y.dt)
    follow = 1.0 if gains.lag == 0.0 else -math.expm1(-y.dt / gains.lag)
    part = max(abs(error[0]), LEAST)
    for i in range(3):
        states = memory[3 + i, 2:]
        if turns:
            states[1], states[2] = -states[1], -states[2]
        z3 = observe(AxisReading(angle[i], change[i], y.dt), l1, l2, l3, states)
        s[3 + i] = states[2] + 0.5 * gains.wc * states[1]
        v[i] = (-2.0 * gains.wc * s[3 + i] - z3) / part
        most = y.limit[3 + i] / y.M[3 + i, 3 + i]
        states[4] += follow * (part * min(max(v[i], -most), most) - states[4])
    return wrench(y, F, v, moving), s
