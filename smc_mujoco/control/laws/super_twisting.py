"""Super-twisting: u = -k1 [s]^(1/2) + w, w' = -k2 sgn(s), |w| <= w_max, s = de + c e.

s = s' = 0 is reached in finite time (2-sliding) for s' = u + d with |d'| <= L if k1 = 1.5 sqrt(L)
and k2 = 1.1 L. Any k2 > L with k1 > sqrt(k2 + L) suffices too (no warning asks for it, because the
study's first gains miss it). Sampled with the explicit Euler method the residual of s is O(dt^2).

With w_max = inf, the default, the law is as published: while the actuator saturates, w winds up,
and may swing the plant from bound to bound. With w_max at the actuator's bound, w stops there. s =
0 requires w = -d, so a constant d beyond w_max leaves |s| = ((|d| - w_max) / k1)^2.
Gains: k1, of the square root [N (s/m)^1/2]; k2, of the integral [N/s]; c, slope of the surface
[1/s]; w_max, bound on w [N].
Sources: A. Levant, "Sliding order and sliding accuracy in sliding mode control", Int. J. Control
58(6):1247, 1993 (law and accuracy); A. Levant, "Robust exact differentiation via sliding mode
technique", Automatica 34(3):379, 1998 (these gains); R. Seeber & M. Horn, "Stability proof for a
well-established super-twisting parameter setting", Automatica 84:241, 2017 (the condition); the
clamp is a common anti-windup, its residual derived here.
"""

import math

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_ROOT, FORCE_RATE, SLOPE, Gain


@law_function(
    family="super-twisting",
    continuous=True,
    finite_time="s",
    accuracy=2,
    admits={"d'": lambda g: min(g.k2, g.k1**2 - g.k2)},
    gains={
        "k1": Gain(3.0, FORCE_PER_ROOT, nonnegative=True),
        "k2": Gain(4.4, FORCE_RATE, nonnegative=True),
        "c": SLOPE,
        "w_max": Gain(math.inf, FORCE, nonnegative=True, held=True),
    },
    label="Super-twisting",
    short="ST",
    colour="#009E73",
)
def super_twisting(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    v = v_eq - gains.k1 * math.copysign(math.sqrt(abs(s)), s) + memory[0]
    memory[0] = min(max(memory[0] - y.dt * gains.k2 * sgn(s), -gains.w_max), gains.w_max)
    return command(y, v), s
