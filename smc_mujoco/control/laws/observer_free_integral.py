"""Observer-free law with integral action: u = -lam tanh(s + ki z), z' = e, s = de + k1 e.

Ours. A constant load d, |d| < lam, leaves the plain law an error, e = atanh(d / lam) / k1 for K = 0; here the only rest
is e = de = 0, with ki z = atanh(d / lam). Bounded by lam as the plain law.

Stability: at that rest J x'' + D x' + K x = u + d, linearised, has J p^3 + (D + m) p^2 + (K + m k1) p + m ki = 0 with
the slope m = lam (1 - (d / lam)^2) of tanh, so it is locally stable (Routh-Hurwitz) just where

    m > -D,    ki > 0,    (D + m) (K + m k1) > J m ki,

which for ki -> 0 is the plain law's condition.
Wind-up: z stands still where the law is at its bound, |s + ki z| > 2, or the actuator at its own, unless e brings it
back; tanh 2 = 0.96 of lam can thus be made up for. z is integrated by the explicit Euler rule.
Source: the law of J. Gaber (observer_free) with conditional integration, K. J. Astrom & T. Hagglund, PID Controllers,
ISA 1995, section 3.5.
"""

import math

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import FORCE, RATE, RATE2, Gain


@law_function(
    gains={"lam": Gain(6.0, FORCE, positive=True), "k1": Gain(2.5, RATE), "ki": Gain(2.0, RATE2, positive=True)},
    memory=1,
)
def observer_free_integral(y, gains, memory):
    s, eq = sliding(y, gains.k1)
    whole = s + gains.ki * memory[0]
    u = command(y, eq - y.model * gains.ki * y.e - gains.lam * math.tanh(whole))
    if (abs(whole) <= 2.0 and abs(u) <= y.limit) or y.e * whole < 0.0:
        memory[0] += y.dt * y.e
    return u, whole
