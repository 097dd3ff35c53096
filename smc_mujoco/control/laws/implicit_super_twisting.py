"""Implicit super-twisting: u = -k1 [z]^(1/2) + w+, w+ = w - dt k2 sgn(z) at z = s + dt u, the s one
period ahead.

The equations have a closed solution. Let b = s + dt w. If |b| <= dt^2 k2, then z = 0 and u = w+ =
-s/dt. Otherwise u = -k1 r sgn(b) + w+ and w+ = w - dt k2 sgn(b), with r = sqrt(|z|) = sqrt(dt^2
k1^2/4 + |b| - dt^2 k2) - dt k1/2. Sampling causes no chattering. But a constant d leaves s = dt d
whatever the gains, because w tends to -d and u to the deadbeat value -s/dt; `proper_super_twisting`
removes this error. The law assumes s' = u + d: if g is above 2 and unknown to the law, the deadbeat
part overshoots, and the law chatters like the explicit one. Condition: k2 > L and k1 > sqrt(k2 + L)
for |d'| <= L. Under saturation w winds up as in the explicit law.
Gains: k1, of the square root [N (s/m)^1/2]; k2, of the integral [N/s]; c, slope of the surface
[1/s].
Source: B. Brogliato, A. Polyakov & D. Efimov, "The implicit discretization of the supertwisting
sliding-mode control algorithm", IEEE Trans. Autom. Control 65(8):3707, 2020, eq. 7 to 11.
"""

import math

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import REACHED, SUPER_TWISTING


@law_function(
    family="super-twisting",
    continuous=True,
    finite_time="s",
    accuracy=1,
    label="Implicit super-twisting",
    gains=SUPER_TWISTING,
    memory=1,
    conditions=REACHED,
)
def implicit_super_twisting(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    b = s + y.dt * memory[0]
    step = y.dt * gains.k2
    if abs(b) <= y.dt * step:
        memory[0] -= b / y.dt
        return command(y, v_eq + memory[0]), s
    half = 0.5 * y.dt * gains.k1
    root = math.sqrt(half * half + abs(b) - y.dt * step) - half
    memory[0] -= step * sgn(b)
    return command(y, v_eq - gains.k1 * root * sgn(b) + memory[0]), s
