"""Classical first-order sliding mode: u = -k sgn(s), s = de + c e.

Reaches s = 0 in finite time when g k exceeds every matched force, known or not; sampled, it chatters in a band of
O(dt). Source: V. Utkin, Sliding Modes in Control and Optimization, Springer 1992, chapters 1 and 2.
"""

import math

from smc_mujoco.law import law_function


@law_function(gains={"k": 4.0, "c": 3.0}, nonnegative=("k", "c"))
def classical(y, gains, memory):
    s = y.de + gains.c * y.e
    return (-gains.k * math.copysign(1.0, s) if s != 0.0 else 0.0), s
