"""Proper implicit super-twisting: u = -k1 [z]^(1/2) + 2 w+ - w, w+ = w - dt k2 sgn(z) at z = s + dt
(u - w+).

The equations have a closed solution. If |s| <= dt^2 k2, then z = 0 and w+ = w - s/dt. Otherwise
[z]^(1/2) = r sgn(s) and sgn(z) = sgn(s), with r = sqrt(dt^2 k1^2/4 + |s| - dt^2 k2) - dt k1/2.
Theorem for s' = u + d with |d'| <= L, k2 > L and k1 > sqrt(k2 + L): |s| <= L dt^2 after a finite
time, without chattering. No sampled law can guarantee less. Like every deadbeat law it assumes s' =
u + d: without the model it chatters if g is far from 1. Under saturation w winds up as in the
explicit law.
Gains: k1, of the square root [N (s/m)^1/2]; k2, of the integral [N/s]; c, slope of the surface
[1/s].
Source: R. Seeber & B. Andritsch, "Proper implicit discretization of the super-twisting controller -
without and with actuator saturation", Automatica 173:112027, 2025, eq. 11 to 13 and theorem 3.4
(numbers of the preprint arXiv:2406.16094v1).
"""

import math

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import REACHED, SUPER_TWISTING


@law_function(
    family="super-twisting",
    continuous=True,
    finite_time="s",
    accuracy=2,
    label="Proper super-twisting",
    gains=SUPER_TWISTING,
    memory=1,
    conditions=REACHED,
)
def proper_super_twisting(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    w = memory[0]
    root = 0.0
    if abs(s) <= y.dt * y.dt * gains.k2:
        memory[0] = w - s / y.dt
    else:
        half = 0.5 * y.dt * gains.k1
        root = math.sqrt(half * half + abs(s) - y.dt * y.dt * gains.k2) - half
        memory[0] = w - y.dt * gains.k2 * sgn(s)
    return command(y, v_eq - gains.k1 * root * sgn(s) + 2.0 * memory[0] - w), s
