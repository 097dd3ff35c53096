"""Conditioned super-twisting: u = sat_U(-k1 [s]^(1/2) + w), w' = -k2 sgn(w - u).

This is super-twisting without wind-up. U is the actuator's bound on u. While u is not saturated, w
- u = k1 [s]^(1/2) and the law is plain super-twisting. While u is saturated, w tends to the bound
and stays there. Theorem for |d'| <= L and |d| < U: the same conditions suffice as without
saturation, k2 > L and k1 > sqrt(k2 + L). If u was saturated while s was reached and d = 0, s
overshoots 0 by at most U^2 / (2 k2) and at most (U / k1)^2 (derived here: w then rises from -U at
the rate k2). w is integrated by the explicit Euler method, so that |s| = O(dt^2), as of plain
super-twisting. With the nominal model, u in w - u is the acceleration that the saturated u gives.
Gains: k1, of the square root [N (s/m)^1/2]; k2, of the integral [N/s]; c, slope of the surface
[1/s].
Source: R. Seeber & M. Reichhartinger, "Conditioned super-twisting algorithm for systems with
saturated control action", Automatica 116:108921, 2020.
"""

from smc_mujoco.control.law import clipped, command, excess, law_function, power, sgn, sliding
from smc_mujoco.control.units import REACHED, SUPER_TWISTING


@law_function(
    family="super-twisting",
    continuous=True,
    finite_time="s",
    accuracy=2,
    gains=SUPER_TWISTING,
    memory=1,
    conditions=REACHED,
    label="Conditioned super-twisting",
    short="CS",
)
def conditioned_super_twisting(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    free = memory[0] - gains.k1 * power(s, 0.5)
    u = command(y, v_eq + free)
    memory[0] -= y.dt * gains.k2 * sgn(memory[0] - free - excess(y, u))
    return clipped(y, u), s
