"""Time-delay control with sliding mode: u = u_ + m (r'' - c de - k sat(s / width) - a_), s = de + c
e.

u_ is the applied command of the last sample, and a_ = (v - v_) / dt the acceleration that it
caused, so u_ - m a_ estimates all that the law does not know: gravity, coupling, friction,
disturbance. No model is needed, only an inertia m of each joint. The acceleration obeys

    a = v_d + eps,    v_d = r'' - c de - k sat(s / width),
    eps = (1 - M^-1 m) eps_ + what changes within a sample,

with m a diagonal matrix. The law is stable if the eigenvalues of 1 - M^-1 m lie in the unit circle.
0 < m < 2 M in the sense of quadratic forms suffices for that; a smaller m estimates more slowly.
Under constant forces no error remains. Under others eps = O(dt) and |s| <= width eps / k remain.
Measured velocities must be clean, because their noise enters u multiplied by m / dt.
Gains: m, inertia [kg m^2]; k, switching gain [rad/s^2]; c, slope of the surface [1/s]; width, of
the boundary layer [rad/s].
Sources: K. Youcef-Toumi & O. Ito, "A time delay controller for systems with unknown dynamics", J.
Dyn. Syst. Meas. Control 112(1):133, 1990; with a sliding mode as in J. Baek, M. Jin & S. Han, "A
new adaptive sliding-mode control scheme for application to robot manipulators", IEEE Trans. Ind.
Electron. 63(6):3628, 2016, with fixed gains here.
"""

import numpy as np

from smc_mujoco.control.joint_law import saturate
from smc_mujoco.control.law import law_function
from smc_mujoco.control.units import ACCELERATION, INERTIA, RATE, SPEED, Gain


@law_function(
    joint=True,
    family="first-order",
    continuous=True,
    accuracy=1,
    gains={
        "m": Gain(0.02, INERTIA, positive=True),
        "k": Gain(10.0, ACCELERATION, positive=True),
        "c": Gain(5.0, RATE, positive=True),
        "width": Gain(0.1, SPEED, positive=True),
    },
    label="Time-delay sliding",
    memory=3,  # last command, last velocity, and 1 once there was a sample
)
def time_delay_sliding(y, gains, memory):
    s = y.de + gains.c * y.e
    desired = y.ddr - gains.c * y.de - gains.k * saturate(s / gains.width)
    u = memory[:, 0] + gains.m * (desired - memory[:, 2] * (y.v - memory[:, 1]) / y.dt)
    memory[:, 0] = np.minimum(np.maximum(u, -y.limit), y.limit)
    memory[:, 1] = y.v
    memory[:, 2] = 1.0
    return u, s
