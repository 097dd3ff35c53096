"""Adaptive gain: u = -K sgn(s), K' = gamma |s|, K(0) = k0, s = de + c e.

K grows until it exceeds the matched disturbance, so a bound k* on the disturbance need not be
known. The proof uses V = s^2/2 + (K - k*)^2 / (2 gamma). K never falls, so noise and sampling make
it grow without limit; `adaptive_leak` prevents this. K is integrated by the explicit Euler method.
Sampled, |s| <= (K + |d|) dt, which is O(dt) while K hardly grows.
Gains: gamma, adaptation rate [N/m]; c, slope of the surface [1/s]; k0, initial K [N].
Source: Slotine & Li, Applied Nonlinear Control, Prentice Hall 1991, chapter 8; Plestan, Shtessel,
Bregeault & Poznyak, "New methodologies for adaptive sliding mode control", Int. J. Control
83(9):1907, 2010.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_POSITION, SLOPE, Gain


@law_function(
    family="adaptive",
    finite_time="s",
    accuracy=1,
    gains={
        "gamma": Gain(50.0, FORCE_PER_POSITION, nonnegative=True),
        "c": SLOPE,
        "k0": Gain(0.0, FORCE, nonnegative=True, held=True),
    },
    short="AD",
    colour="#D55E00",
)
def adaptive(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    K = gains.k0 + memory[0]
    memory[0] += y.dt * gains.gamma * abs(s)
    return command(y, v_eq - K * sgn(s)), s
