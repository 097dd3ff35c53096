"""Quaternion sliding mode: s = we + lam sgn(q0) qv, thrust = F^T R e3, for a free body such as a
quadrotor.

    sx = e' + c e,    F = m (r'' - c e' - Kx tanh(rhox sx)) + h,
    thrust = F^T R e3,    Rd e3 = F / |F|,
    s = we + lam sgn(q0) qv,    torque = J (-lam sgn(q0) qv' - K tanh(rho s) - w x wd) + w x J w,

with e the error of the position, (q0, qv) the quaternion from Rd to the attitude R, we = w - wd,
and sgn(0) = 1. Rd and wd are those of `geometric`. q and -q are the same attitude, and sgn(q0)
takes the shorter way, so that nothing unwinds. With K above the bound of the disturbance per
inertia, s ends where tanh(rho s) holds it: under a constant torque t at s = atanh(t / (J K)) / rho,
at the angle 2 asin(s / lam); under a constant force f at e = atanh(f / (m Kx)) / (rhox c). The sign
is where the law is not continuous.
Gains: c [1/s], Kx [m/s^2], rhox [s/m], of the position; lam [rad/s], K [rad/s^2], rho [s/rad], of
the attitude. Defaults of the source for a Crazyflie, in which the yaw has K = 500 and rho = 0.5.
Source: A. Yazdanshenas & R. Faieghi, "Quaternion-based sliding mode control for six degrees of
freedom flight control of quadrotors", arXiv 2403.10934.
"""

import numpy as np

from smc_mujoco.control.attitude import SLIDING, STEERING, shorter, slide, steer, wrench
from smc_mujoco.control.joint_law import tanh
from smc_mujoco.control.law import FREE_BODY, law_function
from smc_mujoco.control.units import Gain, Unit, shared


@law_function(
    joint=True,
    family="smooth sliding mode",
    requires_model=True,
    plants=(FREE_BODY,),
    gains=shared(
        {
            **SLIDING,
            "K": Gain(400.0, Unit(time=-2), positive=True, turns=True),
            "rho": Gain(0.25, Unit(time=1), positive=True, turns=True),
        }
    ),
    accuracy=0,
    label="Quaternion sliding",
    memory=STEERING,
)
def quaternion_sliding(y, gains, memory):
    s = np.zeros(6)
    s[:3], v, stiffness, damping = slide(y, gains.c, gains.Kx, gains.rhox)
    F, error, turning, moving = steer(y, v, stiffness, damping, memory)
    angle, change = shorter(error, turning)
    for i in range(3):
        s[3 + i] = turning[i] + 0.5 * gains.lam * angle[i]
    return wrench(y, F, -0.5 * gains.lam * change - gains.K * tanh(gains.rho * s[3:]), moving), s
