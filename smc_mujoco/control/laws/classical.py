"""Classical first-order sliding mode: u = -k sgn(s), s = de + c e.

s = 0 is reached in finite time if g k exceeds the matched force, which need not be known. The sign
is explicit, taken at the current sample, so the law chatters in a band of O(dt).
Gains: k, switching gain [N]; c, slope of the surface [1/s].
Source: V. Utkin, Sliding Modes in Control and Optimization, Springer 1992, chapters 1 and 2.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, SLOPE, Gain


@law_function(
    family="first-order",
    finite_time="s",
    accuracy=1,
    admits={"d": lambda g: g.k},
    gains={
        "k": Gain(4.0, FORCE, nonnegative=True),
        "c": SLOPE,
    },
    short="CL",
    colour="#E69F00",
)
def classical(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    return command(y, v_eq - gains.k * sgn(s)), s
