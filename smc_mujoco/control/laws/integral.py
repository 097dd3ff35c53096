"""Integral sliding mode: u = v0 - M sgn(s), s = s0 - s0(0) + q int s0 dt, s0 = de + c e, v0 = -c de - q s0.

v0 is the wanted acceleration of the nominal loop s0' = -q s0, e'' = -(c + q) de - c q e; s is what s0 has done beyond
it. s(0) = 0: there is no reaching phase, and the loop is the nominal one from the start, for M above every force
that v0 leaves out. It is a law with a model: without one it takes f = 0, g = 1, and M must cover g too,
g M > |f + (g - 1) v0 + d|. Where u saturates s leaves 0, and what follows is a reaching phase after all. s is
integrated by the explicit Euler rule, which costs |s| = O(dt), as sampling does. The nominal loop on another surface is
s0' = -q s0 too.
Source: V. Utkin & J. Shi, "Integral sliding mode in systems operating under uncertainty conditions", Proc. 35th IEEE
Conf. Decision and Control 4591, 1996.
"""

from smc_mujoco.control.law import command, law_function, sgn
from smc_mujoco.control.units import FORCE, RATE, Gain


@law_function(
    gains={
        "M": Gain(4.0, FORCE, nonnegative=True),
        "c": Gain(2.5, RATE, nonnegative=True),
        "q": Gain(1.5, RATE, nonnegative=True),
    },
    memory=3,
    short="IN",
)
def integral(y, gains, memory):
    s0, eq = y.de + gains.c * y.e, -gains.c * y.de  # the loop that is imposed, not what the law knows of the plant
    if y.surfaced != 0.0:
        s0, eq = y.s, y.eq
    if memory[2] == 0.0:
        memory[0], memory[2] = s0, 1.0
    s = s0 - memory[0] + gains.q * memory[1]
    memory[1] += y.dt * s0
    return command(y, eq - gains.q * s0 - gains.M * sgn(s)), s
