"""Adaptive gain: u = -K sgn(s), K' = gamma |s|, K(0) = k0, s = de + c e.

With V = s^2/2 + (K - k*)^2 / (2 gamma) the bound k* on the matched force need not be known; but K only grows, so noise
and sampling wind it up without end (adaptive_leak mends that). K is integrated by the explicit Euler rule.
Source: Slotine & Li, Applied Nonlinear Control, Prentice Hall 1991, chapter 8; Plestan, Shtessel, Bregeault & Poznyak,
"New methodologies for adaptive sliding mode control", Int. J. Control 83(9):1907, 2010.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_POSITION, RATE, Gain


@law_function(
    gains={
        "gamma": Gain(50.0, FORCE_PER_POSITION, nonnegative=True),
        "c": Gain(2.5, RATE, nonnegative=True),
        "k0": Gain(0.0, FORCE, nonnegative=True, held=True),
    },
    short="AD",
    colour="#D55E00",
)
def adaptive(y, gains, memory):
    s, eq = sliding(y, gains.c)
    K = gains.k0 + memory[0]
    memory[0] += y.dt * gains.gamma * abs(s)
    return command(y, eq - K * sgn(s)), s
