"""Classical first-order sliding mode: u = -k sgn(s), s = de + c e.

Reaches s = 0 in finite time when g k exceeds every matched force, known or not; sampled, it chatters in a band of
O(dt). Explicit. Source: V. Utkin, Sliding Modes in Control and Optimization, Springer 1992, chapters 1 and 2.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding


@law_function(gains={"k": 4.0, "c": 2.5}, nonnegative=("k", "c"))
def classical(y, gains, memory):
    s, eq = sliding(y, gains.c)
    return command(y, eq - gains.k * sgn(s)), s
