"""First-order sliding mode, implicit: u = -k sat(s / (k dt)), s = de + c e, sat(a) = min(max(a,
-1), 1).

This is the backward Euler method for s' = u with the sign at the end of the period: u solves s+ = s
+ dt u and u = -k sgn(s+). For |s| > k dt it equals `classical`. Within k dt it gives s+ = 0, where
`classical` would chatter. Under |d| <= D < k the residual is |s| <= dt D, and u is -d of the sample
before, with the total variation of d. It is a boundary layer of width k dt, the smallest that does
not chatter. The law needs to know g: without the model it assumes g = 1, and for a true g of 2 or
more it chatters as `classical` does.
Gains: k, switching gain [N]; c, slope of the surface [1/s].
Source: V. Acary, B. Brogliato & Y. Orlov, "Chattering-free digital sliding-mode control with state
observer and disturbance rejection", IEEE Trans. Autom. Control 57(5):1087, 2012.
"""

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import FORCE, SLOPE, Gain


@law_function(
    family="first-order",
    finite_time="s",
    accuracy=1,
    admits={"d": lambda g: g.k},
    label="Implicit first-order",
    gains={"k": Gain(4.0, FORCE, nonnegative=True), "c": SLOPE},
)
def implicit_first_order(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    return command(y, v_eq - min(max(s / y.dt, -gains.k), gains.k)), s
