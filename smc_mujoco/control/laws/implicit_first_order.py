"""First-order sliding mode, implicit: u = -k sat(s / (b k dt)), s = de + c e, sat(a) = min(max(a,
-1), 1).

This is the backward Euler method for s' = b u with the sign at the end of the period: u solves s+ =
s + dt b u and u = -k sgn(s+). For |s| > b k dt it equals `classical`. Within b k dt it gives s+ =
0, where `classical` would chatter. With b = g and under |d| <= g D < g k the residual is |s| <= dt
g D, and u is -d / g of the sample before, with the total variation of d. It is a boundary layer of
width b k dt, the smallest that does not chatter. For a true g of 2 b or more it chatters as
`classical` does. With the model b = g.
Gains: k, switching gain [N]; c, slope of the surface [1/s]; b, assumed input gain [1/kg], which
tuning leaves at 1.
Source: V. Acary, B. Brogliato & Y. Orlov, "Chattering-free digital sliding-mode control with state
observer and disturbance rejection", IEEE Trans. Autom. Control 57(5):1087, 2012.
"""

from smc_mujoco.control.law import command, law_function, per_command, sliding
from smc_mujoco.control.units import AHEAD_B, FORCE, SLOPE, Gain


@law_function(
    family="first-order",
    finite_time="s",
    accuracy=1,
    admits={"d": lambda g: g.k},
    label="Implicit first-order",
    gains={
        "k": Gain(4.0, FORCE, nonnegative=True),
        "c": SLOPE,
        "b": AHEAD_B,
    },
)
def implicit_first_order(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    deadbeat = s / (y.dt * per_command(y, gains.b))
    return command(y, v_eq - min(max(deadbeat, -gains.k), gains.k)), s
