"""First-order sliding mode, implicit: u = -k sat(s / (k dt)), s = de + c e, sat(a) = min(max(a, -1), 1).

The backward Euler rule for s' = u, u in -k sgn(s): u solves s + dt u = s+, u = -k sgn(s+). It is classical while
|s| > k dt, and within s+ = 0 where classical would chatter: under |d| <= D < k the residual is |s| <= dt D, and u
follows -d of the sample before, its total variation that of d. It is a boundary layer of k dt, the least that does not
chatter. It needs to know g: model-free g = 1 is taken, and where the true g is 2 or more it chatters as classical does.
Source: V. Acary, B. Brogliato & Y. Orlov, "Chattering-free digital sliding-mode control with state observer and
disturbance rejection", IEEE Trans. Autom. Control 57(5):1087, 2012.
"""

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import FORCE, RATE, Gain


@law_function(gains={"k": Gain(4.0, FORCE, nonnegative=True), "c": Gain(2.5, RATE, nonnegative=True)})
def implicit_first_order(y, gains, memory):
    s, eq = sliding(y, gains.c)
    return command(y, eq - min(max(s / y.dt, -gains.k), gains.k)), s
