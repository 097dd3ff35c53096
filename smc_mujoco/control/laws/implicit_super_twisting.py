"""Implicit super-twisting: u = -k1 [z]^(1/2) + w+, w+ = w - dt k2 sgn(z) at z = s + h u, h = b dt,
the s one period ahead of s' = b u.

The equations have a closed solution. Let a = s + h w. If |a| <= h dt k2, then z = 0 and u = w+ =
-s/h. Otherwise u = -k1 r sgn(a) + w+ and w+ = w - dt k2 sgn(a), with r = sqrt(|z|) = sqrt(h^2
k1^2/4 + |a| - h dt k2) - h k1/2. Sampling causes no chattering. But a constant d leaves s = dt d
whatever the gains, because w tends to -d / b and u to the deadbeat value -s/h;
`proper_super_twisting` removes this error. If the true g is above 2 b, the deadbeat part
overshoots, and the law chatters like the explicit one. Condition, if g = b = 1: k2 > L and k1 >
sqrt(k2 + L) for |d'| <= L. Under saturation w winds up as in the explicit law. With the model b =
g.
Gains: k1, of the square root [N (s/m)^1/2]; k2, of the integral [N/s]; c, slope of the surface
[1/s]; b, assumed input gain [1/kg], which tuning leaves at 1.
Source: B. Brogliato, A. Polyakov & D. Efimov, "The implicit discretization of the supertwisting
sliding-mode control algorithm", IEEE Trans. Autom. Control 65(8):3707, 2020, eq. 7 to 11.
"""

import math

from smc_mujoco.control.law import command, law_function, per_command, sgn, sliding
from smc_mujoco.control.units import AHEAD_B, REACHED, SUPER_TWISTING


@law_function(
    family="super-twisting",
    continuous=True,
    finite_time="s",
    accuracy=1,
    label="Implicit super-twisting",
    gains={
        **SUPER_TWISTING,
        "b": AHEAD_B,
    },
    memory=1,
    conditions=REACHED,
)
def implicit_super_twisting(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    h = y.dt * per_command(y, gains.b)
    ahead = s + h * memory[0]
    step = y.dt * gains.k2
    if abs(ahead) <= h * step:
        memory[0] -= ahead / h
        return command(y, v_eq + memory[0]), s
    half = 0.5 * h * gains.k1
    root = math.sqrt(half * half + abs(ahead) - h * step) - half
    memory[0] -= step * sgn(ahead)
    return command(y, v_eq - gains.k1 * root * sgn(ahead) + memory[0]), s
