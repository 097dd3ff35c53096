"""Super-twisting of the attitude: s' = -k1 [s]^(1/2) + z + d, z' = -k2 sgn(s), for a free body such
as a quadrotor.

    s = we + lam sgn(q0) qv,    torque = J (-lam sgn(q0) qv' - k1 [s]^(1/2) + z - w x wd) + w x J w

with the position's loop, the wanted attitude and its rate wd of `quaternion_sliding`. The change of
wd is part of the disturbance per inertia d. For |d'| <= L on an axis, k1 = 1.5 sqrt(L) and k2 = 1.1
L bring s to 0 in finite time and z to -d, so that no constant torque leaves an error; sampled, s
stays within O(dt^2). |z| <= z_max stops its wind-up. The theorem has rotors without a lag. 3e-4 N m
at 2 Hz on a Crazyflie ask for L = 227, k1 = 22.6 and k2 = 250. With these a lag of 62.5 ms leaves a
limit cycle, of s near 1.0 rad/s by harmonic balance: rotors saturate, and it loses height. So the
default k2 is 50, chosen after that run: 0.04 rad/s, for |d'| < 30 by k1^2 > 4 L (k2 + L) / (k2 -
L).
Gains: c [1/s], slope of the position's surface; Kx [m/s^2], its switching gain; rhox [s/m], its
slope in tanh; lam [rad/s], slope of the attitude's surface; k1 [rad^1/2/s^3/2], of the square root;
k2 [rad/s^3], of the integral; z_max [rad/s^2], bound on z.
Source: A. Levant, "Robust exact differentiation via sliding mode technique", Automatica 34(3):379,
1998 (the algorithm and these gains), on the surface of `quaternion_sliding`. Gains for a Crazyflie
are not published.
"""

import math

import numpy as np

from smc_mujoco.control.attitude import SLIDING, STEERING, shorter, slide, steer, wrench
from smc_mujoco.control.law import FREE_BODY, law_function, power
from smc_mujoco.control.units import Gain, Unit, shared


@law_function(
    joint=True,
    family="super-twisting",
    requires_model=True,
    plants=(FREE_BODY,),
    gains=shared(
        {
            **SLIDING,
            "k1": Gain(22.6, Unit(time=-1.5), positive=True, turns=True),
            "k2": Gain(50.0, Unit(time=-3), nonnegative=True, turns=True),
            "z_max": Gain(math.inf, Unit(time=-2), nonnegative=True, held=True, turns=True),
        }
    ),
    accuracy=0,
    label="Super-twisting attitude",
    memory=STEERING + 1,  # and z
)
def super_twisting_attitude(y, gains, memory):
    s = np.zeros(6)
    s[:3], v, stiffness, damping = slide(y, gains.c, gains.Kx, gains.rhox)
    F, error, turning, moving = steer(y, v, stiffness, damping, memory)
    angle, change = shorter(error, turning)
    v = -0.5 * gains.lam * change
    for i in range(3):
        s[3 + i] = turning[i] + 0.5 * gains.lam * angle[i]
        v[i] += memory[3 + i, 2] - gains.k1 * power(s[3 + i], 0.5)
        z = memory[3 + i, 2] - y.dt * gains.k2 * np.sign(s[3 + i])
        memory[3 + i, 2] = min(max(z, -gains.z_max), gains.z_max)
    return wrench(y, F, v, moving), s
