"""Observer-free law with integral action: u = -lam tanh(s + ki z), z' = e, s = de + k1 e.

An extension of this package. Under a constant load d, |d| < lam, the plain law has the steady error
e = atanh(d / lam) / k1 for K = 0. Here the only equilibrium is e = de = 0, with ki z = atanh(d /
lam). |u| <= lam as for the plain law.

Stability: linearised at that equilibrium, J x'' + D x' + K x = u + d gives J p^3 + (D + m) p^2 + (K
+ m k1) p + m ki = 0 with the slope m = lam (1 - (d / lam)^2) of tanh. It is locally stable
(Routh-Hurwitz) if and only if

    m > -D,    ki > 0,    (D + m) (K + m k1) > J m ki,

which for ki -> 0 is the plain law's condition. Anti-windup: z stops while |s + ki z| > 2 or the
actuator saturates, unless e drives it back. So loads up to lam tanh 2 = 0.96 lam are compensated. z
is integrated by the explicit Euler method.
Gains: lam, bound of u [N]; k1, slope of the surface [1/s]; ki, integral gain [1/s^2].
Source: the law of J. Gaber (observer_free) with conditional integration, K. J. Astrom & T.
Hagglund, PID Controllers, ISA 1995, section 3.5.
"""

import math

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import OBSERVER_FREE, RATE2, Gain


@law_function(
    family="observer-free",
    continuous=True,
    accuracy=0,
    label="Observer-free, integral",
    gains={
        **OBSERVER_FREE,
        "ki": Gain(2.0, RATE2, positive=True),
    },
    memory=1,
)
def observer_free_integral(y, gains, memory):
    s, v_eq = sliding(y, gains.k1)
    sigma = s + gains.ki * memory[0]
    u = command(y, v_eq - y.model * gains.ki * y.e - gains.lam * math.tanh(sigma))
    if (abs(sigma) <= 2.0 and abs(u) <= y.limit) or y.e * sigma < 0.0:
        memory[0] += y.dt * y.e
    return u, sigma
