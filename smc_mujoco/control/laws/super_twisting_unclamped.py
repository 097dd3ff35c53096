"""Super-twisting as published, its integral without a bound: u = -k1 [s]^(1/2) + w, w' = -k2
sgn(s), s = de + c e.

`super_twisting` with w_max = inf, under its own name, so that a comparison can contain both. w
winds up while the actuator saturates.
Gains: k1, of the square root [N (s/m)^1/2]; k2, of the integral [N/s]; c, slope of the surface
[1/s].
Source: A. Levant, "Sliding order and sliding accuracy in sliding mode control", Int. J. Control
58(6):1247, 1993.
"""

import math

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE_PER_ROOT, FORCE_RATE, SLOPE, Gain


@law_function(
    family="super-twisting",
    continuous=True,
    finite_time="s",
    accuracy=2,
    gains={
        "k1": Gain(3.0, FORCE_PER_ROOT, nonnegative=True),
        "k2": Gain(4.4, FORCE_RATE, nonnegative=True),
        "c": SLOPE,
    },
    label="Super-twisting, unclamped",
)
def super_twisting_unclamped(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    v = v_eq - gains.k1 * math.copysign(math.sqrt(abs(s)), s) + memory[0]
    memory[0] -= y.dt * gains.k2 * sgn(s)
    return command(y, v), s
