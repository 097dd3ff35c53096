"""Integral sliding mode: u = v0 - M sgn(s), s = s0 - s0(0) + q int s0 dt, s0 = de + c e, v0 = -c de
- q s0.

v0 is the acceleration of the nominal loop s0' = -q s0, that is e'' = -(c + q) de - c q e. s is the
deviation of s0 from this loop. Because s(0) = 0 there is no reaching phase: the error follows the
nominal loop from the start if M exceeds every force that v0 leaves out. The law assumes a model.
Without one it takes f = 0 and g = 1, so M must cover the true g too: g M > |f + (g - 1) v0 + d|. If
u saturates, s leaves 0, and a reaching phase follows. s is integrated by the explicit Euler method,
which costs |s| = O(dt), as sampling does. With a surface of the scenario as s0 the nominal loop is
s0' = -q s0 too.
Gains: M, switching gain [N]; c, slope of s0 [1/s]; q, decay rate of s0 [1/s].
Source: V. Utkin & J. Shi, "Integral sliding mode in systems operating under uncertainty
conditions", Proc. 35th IEEE Conf. Decision and Control 4591, 1996.
"""

from smc_mujoco.control.law import command, law_function, sgn
from smc_mujoco.control.units import FORCE, RATE, SLOPE, Gain


@law_function(
    family="first-order",
    finite_time="s",
    accuracy=1,
    gains={
        "M": Gain(4.0, FORCE, nonnegative=True),
        "c": SLOPE,
        "q": Gain(1.5, RATE, nonnegative=True),
    },
    memory=3,
    short="IN",
)
def integral(y, gains, memory):
    s0, v_eq = y.de + gains.c * y.e, -gains.c * y.de  # of the nominal loop: with or without a model
    if y.has_surface != 0.0:
        s0 = y.s
        v_eq = y.v_eq
    if memory[2] == 0.0:
        memory[0] = s0
        memory[2] = 1.0
    s = s0 - memory[0] + gains.q * memory[1]
    memory[1] += y.dt * s0
    return command(y, v_eq - gains.q * s0 - gains.M * sgn(s)), s
