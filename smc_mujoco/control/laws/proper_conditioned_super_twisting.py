"""Proper conditioned super-twisting: u = sat_U(u0), u0 of the proper implicit law.

This is `proper_super_twisting` for a saturated input, without wind-up. U is the actuator's bound.
Then w+ = (u + w) / 2 if |u - w| <= 2 dt k2, and w+ = w + dt k2 sgn(u - w) otherwise. While u is not
saturated this is `proper_super_twisting`. While it is, w tends to u and stays there. Theorem for s'
= u + d with |d'| <= L and |d| < U: k2 > L and k1 > sqrt(k2 + L) suffice for |s| <= L dt^2 after a
finite time, without chattering. No sampled law can guarantee less. The theorem is for b = 1: the
law assumes s' = b u + d, and chatters if g is far above b. With the nominal model b = g, and u in u
- w is the acceleration that the saturated u gives.
Gains: k1, of the square root [N (s/m)^1/2]; k2, of the integral [N/s]; c, slope of the surface
[1/s]; b, assumed input gain [1/kg], which tuning leaves at 1.
Source: R. Seeber & B. Andritsch, "Proper implicit discretization of the super-twisting controller -
without and with actuator saturation", Automatica 173:112027, 2025, eq. 17 and 18 (numbers of the
preprint arXiv:2406.16094v1).
"""

import math

from smc_mujoco.control.law import clipped, command, excess, law_function, per_command, sgn, sliding
from smc_mujoco.control.units import AHEAD_B, REACHED, SUPER_TWISTING


@law_function(
    family="super-twisting",
    continuous=True,
    finite_time="s",
    accuracy=2,
    label="Proper conditioned super-twisting",
    gains={
        **SUPER_TWISTING,
        "b": AHEAD_B,
    },
    memory=1,
    conditions=REACHED,
)
def proper_conditioned_super_twisting(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    h = y.dt * per_command(y, gains.b)
    w = memory[0]
    step = y.dt * gains.k2
    if abs(s) <= h * step:
        free = w - 2.0 * s / h
    else:
        half = 0.5 * h * gains.k1
        root = math.sqrt(half * half + abs(s) - h * step) - half
        free = w - (gains.k1 * root + 2.0 * step) * sgn(s)
    u = command(y, v_eq + free)
    ahead = free + excess(y, u) - w
    memory[0] = w + (0.5 * ahead if abs(ahead) <= 2.0 * step else step * sgn(ahead))
    return clipped(y, u), s
