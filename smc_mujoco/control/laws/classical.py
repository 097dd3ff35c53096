"""Classical first-order sliding mode: u = -k sgn(s), s = de + c e.

Reaches s = 0 in finite time when g k exceeds every matched force, known or not; sampled, it chatters in a band of
O(dt). Explicit. Source: V. Utkin, Sliding Modes in Control and Optimization, Springer 1992, chapters 1 and 2.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, RATE, Gain


@law_function(
    gains={"k": Gain(4.0, FORCE, nonnegative=True), "c": Gain(2.5, RATE, nonnegative=True)},
    short="CL",
    colour="#E69F00",
)
def classical(y, gains, memory):
    s, eq = sliding(y, gains.c)
    return command(y, eq - gains.k * sgn(s)), s
