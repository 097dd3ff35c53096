"""Observer-free law at relative degree 3: u = -lam tanh(s), s = e'' + k2 de + k1 e.

The paper's general form, for a plant with an actuator lag. |u| <= lam. On J x'' + D x' + K x = F,
tau F' = u - F, the origin is locally stable if and only if a3 p^3 + a2 p^2 + a1 p + a0 has positive
coefficients and a2 a1 > a3 a0, where a3 = tau J, a2 = J + tau D + lam, a1 = D + tau K + lam k2, a0
= K + lam k1 (linearisation tanh(s) ~ s, Routh-Hurwitz). The law needs an acceleration, from a
second-order differentiator, so it is observer-free in name only. If the estimator gives none, e''
counts as 0.
Gains: lam, bound of u [N]; k1 [1/s^2] and k2 [1/s], of the surface.
Source: J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition", section 3,
alpha for r = 3.
"""

import math

from smc_mujoco.control.law import command, law_function
from smc_mujoco.control.units import FORCE, RATE, RATE2, Gain


@law_function(
    family="observer-free",
    continuous=True,
    accuracy=0,
    label="Observer-free, third order",
    gains={
        "lam": Gain(6.0, FORCE, positive=True),
        "k1": Gain(6.25, RATE2, positive=True),
        "k2": Gain(5.0, RATE, positive=True),
    },
    memory=1,
    relative_degree=3,
)
def observer_free_third(y, gains, memory):
    s = y.a - y.ddr + gains.k2 * y.de + gains.k1 * y.e
    return command(y, -gains.lam * math.tanh(s)), s
