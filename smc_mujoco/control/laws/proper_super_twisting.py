"""Proper implicit super-twisting: u = -k1 [z]^(1/2) + 2 w+ - w, w+ = w - dt k2 sgn(z) at z = s + h
(u - w+), h = b dt.

The equations have a closed solution. If |s| <= h dt k2, then z = 0 and w+ = w - s/h. Otherwise
[z]^(1/2) = r sgn(s) and sgn(z) = sgn(s), with r = sqrt(h^2 k1^2/4 + |s| - h dt k2) - h k1/2.
Theorem for s' = u + d, b = 1, with |d'| <= L, k2 > L and k1 > sqrt(k2 + L): |s| <= L dt^2 after a
finite time, without chattering. No sampled law can guarantee less. Like every deadbeat law it
assumes s' = b u + d: it chatters if g is far above b. Under saturation w winds up as in the
explicit law. With the model b = g.
Gains: k1, of the square root [N (s/m)^1/2]; k2, of the integral [N/s]; c, slope of the surface
[1/s]; b, assumed input gain [1/kg], which tuning leaves at 1.
Source: R. Seeber & B. Andritsch, "Proper implicit discretization of the super-twisting controller -
without and with actuator saturation", Automatica 173:112027, 2025, eq. 11 to 13 and theorem 3.4
(numbers of the preprint arXiv:2406.16094v1).
"""

import math

from smc_mujoco.control.law import command, law_function, per_command, sgn, sliding
from smc_mujoco.control.units import AHEAD_B, REACHED, SUPER_TWISTING


@law_function(
    family="super-twisting",
    continuous=True,
    finite_time="s",
    accuracy=2,
    label="Proper super-twisting",
    gains={
        **SUPER_TWISTING,
        "b": AHEAD_B,
    },
    memory=1,
    conditions=REACHED,
)
def proper_super_twisting(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    h = y.dt * per_command(y, gains.b)
    w = memory[0]
    root = 0.0
    if abs(s) <= h * y.dt * gains.k2:
        memory[0] = w - s / h
    else:
        half = 0.5 * h * gains.k1
        root = math.sqrt(half * half + abs(s) - h * y.dt * gains.k2) - half
        memory[0] = w - y.dt * gains.k2 * sgn(s)
    return command(y, v_eq - gains.k1 * root * sgn(s) + 2.0 * memory[0] - w), s
