"""Super-twisting on computed torque: u = M (r'' - c de - k1 [s]^(1/2) + w) + h, w' = -k2 sgn(s), s
= de + c e.

With the perfect model each joint obeys s' = -k1 [s]^(1/2) + w + d_a, d_a = M^-1 d. s = s' = 0 is
reached in finite time for |d_a'| <= L if k1 = 1.5 sqrt(L) and k2 = 1.1 L. Then w = -d_a. Sampled
explicitly, s stays within O(dt^2). Without a disturbance, s is 0 for the first time before 2
|s(0)|^(1/2) / k1, because k1 [s]^(1/2) alone would take that long, and w helps. The bound |w| <=
w_max stops the wind-up of w while the actuator saturates. The default is infinite, as published.
Gains: k1, of the square root [rad^1/2/s^3/2]; k2, of the integral [rad/s^3]; c, slope of the
surface [1/s]; w_max, bound on w [rad/s^2].
Source: A. Levant, "Robust exact differentiation via sliding mode technique", Automatica 34(3):379,
1998 (the algorithm and these gains), on the computed torque of J.-J. E. Slotine & W. Li, Applied
Nonlinear Control, Prentice Hall 1991, section 6.3.
"""

import math

import numpy as np

from smc_mujoco.control.joint_law import torque
from smc_mujoco.control.law import law_function
from smc_mujoco.control.units import ACCELERATION, RATE, Gain, Unit


@law_function(
    joint=True,
    family="super-twisting",
    continuous=True,
    finite_time="s",
    accuracy=2,
    requires_model=True,
    gains={
        "k1": Gain(4.7, Unit(position=0.5, time=-1.5), positive=True),
        "k2": Gain(11.0, Unit(position=1, time=-3), nonnegative=True),
        "c": Gain(5.0, RATE, positive=True),
        "w_max": Gain(math.inf, ACCELERATION, nonnegative=True, held=True),
    },
    label="Super-twisting computed torque",
    memory=1,
)
def super_twisting_computed_torque(y, gains, memory):
    s = y.de + gains.c * y.e
    u = torque(y, -gains.c * y.de - gains.k1 * np.sqrt(np.abs(s)) * np.sign(s) + memory[:, 0])
    w = memory[:, 0] - y.dt * gains.k2 * np.sign(s)
    memory[:, 0] = np.minimum(np.maximum(w, -gains.w_max), gains.w_max)
    return u, s
