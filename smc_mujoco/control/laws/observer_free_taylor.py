"""Observer-free law by Taylor series: u = -lam P(s), s = de + k1 e, P = the series of tanh(s / 8),
doubled three times.

The series tanh a = a - a^3/3 + 2 a^5/15 - 17 a^7/315 + 62 a^9/2835 - ... converges for |a| < pi/2
and is cut after `terms` terms. |s| is limited to 8, so |a| = |s| / 8 <= 1. The argument is then
doubled three times, tanh 2a = 2 tanh a / (1 + tanh^2 a). So the law needs no exponential, only
three divisions. With 1 to 5 terms |P - tanh| is at most 3.3e-3, 9.1e-5, 5.5e-6, 6e-7, 2.3e-7
(measured; the last is the effect of limiting |s| to 8). Without this reduction the series would
diverge from s = pi/2 on. Stability is that of `observer_free`.
Gains: lam, bound of u [N]; k1, slope of the surface [1/s]; terms, of the series, 1 to 5.
Source: J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition", eq. 4 (the
law); M. Abramowitz & I. Stegun, Handbook of Mathematical Functions, 1964, 4.5.64 (series) and 4.5
(double argument).
"""

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import OBSERVER_FREE, Gain

SERIES = (1.0, -1.0 / 3.0, 2.0 / 15.0, -17.0 / 315.0, 62.0 / 2835.0)
MAX_S = 8.0  # 1 - tanh(8) = 2.3e-7


@law_function(
    family="observer-free",
    continuous=True,
    accuracy=0,
    label="Observer-free, Taylor",
    gains={
        **OBSERVER_FREE,
        "terms": Gain(3.0, positive=True, held=True),
    },
    conditions={"terms is 1, 2, 3, 4 or 5": lambda g: g.terms in (1.0, 2.0, 3.0, 4.0, 5.0)},
)
def observer_free_taylor(y, gains, memory):
    s, v_eq = sliding(y, gains.k1)
    a = min(max(s, -MAX_S), MAX_S) / 8.0
    P = 0.0
    for i in range(min(max(int(gains.terms), 1), 5) - 1, -1, -1):
        P = P * a * a + SERIES[i]
    P *= a
    for _ in range(3):
        P = 2.0 * P / (1.0 + P * P)
    return command(y, v_eq - gains.lam * P), s
