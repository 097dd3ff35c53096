"""Geometric tracking: torque = J (-kR e_R - kW e_W) + ..., thrust = F^T R e3, for a free body such
as a quadrotor.

    F = m (r'' - kx e - kv e') + h,    thrust = F^T R e3,    Rd e3 = F / |F|,
    torque = J (-kR e_R - kW e_W - w x wd) + w x J w,
    e_R = vee(Rd' R - R' Rd) / 2,    e_W = w - wd,

with e the error of the position, R the attitude, Rd the one that turns the thrust to F with the
first axis of the reference's attitude, w the angular velocity, and wd that of Rd, which follows
from F', in the axes of the body. Of the reference's attitude only the heading counts. s is e' + (kx
/ kv) e and e_W + (kR / kW) e_R: the law slides nowhere. Exponentially stable if the attitude starts
within 90 degrees of Rd, attractive from almost all others: for exact J, no saturation and no lag of
the thrust, and |F| above 0.
Gains: kx [1/s^2], kv [1/s], of the position; kR [1/s^2], kW [1/s], of the attitude. Those of the
paper per mass and inertia: 16, 5.6, 107, 31. Defaults: kx and kv of the firmware, kR and kW of the
Crazyflie in arXiv 2508.06568.
Source: T. Lee, M. Leok & N. H. McClamroch, "Geometric tracking control of a quadrotor UAV on
SE(3)", CDC 2010, doi 10.1109/CDC.2010.5717652. Its condition there is on kR, kW and the largest
acceleration.
"""

import numpy as np

from smc_mujoco.control.attitude import STEERING, steer, wrench
from smc_mujoco.control.law import FREE_BODY, law_function
from smc_mujoco.control.units import RATE, Gain, Unit, shared


@law_function(
    joint=True,
    family="feedback",
    continuous=True,
    requires_model=True,
    plants=(FREE_BODY,),
    gains=shared(
        {
            "kx": Gain(7.0, Unit(time=-2), positive=True),
            "kv": Gain(4.0, RATE, positive=True),
            "kR": Gain(421.7, Unit(time=-2), positive=True, turns=True),
            "kW": Gain(69.27, RATE, positive=True, turns=True),
        }
    ),
    accuracy=0,
    label="Geometric",
    memory=STEERING,
)
def geometric(y, gains, memory):
    s = np.zeros(6)
    v = np.zeros(3)
    ones = np.ones(3)
    s[:3] = y.de[:3] + gains.kx / gains.kv * y.e[:3]
    F, error, turning, moving = steer(
        y, -gains.kv * s[:3], gains.kx * ones, gains.kv * ones, memory
    )
    for i in range(3):
        e = 2.0 * error[0] * error[i + 1]
        v[i] = -gains.kR * e - gains.kW * turning[i]
        s[3 + i] = turning[i] + gains.kR / gains.kW * e
    return wrench(y, F, v, moving), s
