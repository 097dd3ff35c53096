"""Global: s = de + c e - (de(0) + c e(0)) exp(-q t); s(0) = 0: no reaching phase.

The offset that makes s(0) = 0 decays and leaves the linear surface. On s = 0, with s0 = de(0) + c
e(0), e = e(0) exp(-c t) + s0 (exp(-q t) - exp(-c t)) / (c - q).
Gains: c, slope of the surface [1/s]; q, decay rate of the offset [1/s].
Source: Y.-S. Lu & J.-S. Chen, "Design of a global sliding-mode controller for a motor drive with
bounded control", Int. J. Control 62(5):1001, 1995.
"""

import math

from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import RATE, Gain


@surface_function(
    gains={
        "c": Gain(2.5, RATE, positive=True),
        "q": Gain(1.5, RATE, positive=True),
    },
    memory=3,
)
def global_(y, gains, memory):
    linear = y.de + gains.c * y.e
    if memory[0] == 0.0:  # the first sample
        memory[0] = 1.0
        memory[1] = linear
        memory[2] = y.t
    offset = memory[1] * math.exp(-gains.q * (y.t - memory[2]))
    return linear - offset, -gains.c * y.de - gains.q * offset
