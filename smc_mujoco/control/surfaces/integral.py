"""Integral: s = de - de(0) - I, I' = -k1 e - k2 de; s(0) = 0: no reaching phase.

On s = 0 the error follows e'' + k2 e' + k1 e = 0 from the first sample on, under any matched
disturbance. The integral of k2 de is exact, k2 (e - e(0)); that of k1 e is computed by the explicit
Euler method.
Gains: k1 [1/s^2] and k2 [1/s], of the nominal loop.
Source: V. Utkin & J. Shi, "Integral sliding mode in systems operating under uncertainty
conditions", Proc. 35th IEEE CDC, 4591, 1996, with s0 = de and the nominal control that gives e'' =
-k1 e - k2 de.
"""

from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import RATE, RATE2, Gain


@surface_function(
    gains={
        "k1": Gain(2.25, RATE2, positive=True),
        "k2": Gain(3.0, RATE, positive=True),
    },
    memory=3,
)
def integral(y, gains, memory):
    if memory[0] == 0.0:  # the first sample
        memory[0] = 1.0
        memory[1] = y.de + gains.k2 * y.e
    s = y.de + gains.k2 * y.e - memory[1] + gains.k1 * memory[2]
    memory[2] += y.dt * y.e
    return s, -gains.k1 * y.e - gains.k2 * y.de
