"""Fast terminal: s = de + a e + b [e]^p, 1/2 < p < 1.

On s = 0 a large error decays exponentially, a small one as on a terminal surface. It vanishes at
the time ln(1 + a |e(0)|^(1-p) / b) / (a (1-p)). As on `terminal`, v_eq is singular at e = 0 away
from the surface, and `bound` limits its singular part.
Gains: a [1/s] and b [m^(1-p)/s], of the surface; p, exponent; bound, on the singular part of v_eq
[m/s^2].
Source: X. Yu & Z. Man, "Fast terminal sliding-mode control design for nonlinear dynamical systems",
IEEE Trans. Circuits Syst. I 49(2):261, 2002.
"""

from smc_mujoco.control.law import power
from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.surfaces import terminal
from smc_mujoco.control.units import RATE, Gain, Unit


@surface_function(
    gains={
        "a": Gain(1.0, RATE, positive=True),
        "b": Gain(1.0, lambda g: Unit(position=1 - g.p, time=-1), positive=True),
        "p": terminal.terminal.gains["p"],
        "bound": terminal.terminal.gains["bound"],
    },
    memory=1,
    conditions=terminal.terminal.conditions,
)
def fast_terminal(y, gains, memory):
    s = y.de + gains.a * y.e + gains.b * power(y.e, gains.p)
    if y.e == 0.0:
        return s, -gains.a * y.de
    singular = gains.b * gains.p * abs(y.e) ** (gains.p - 1.0) * y.de
    return s, -gains.a * y.de - min(max(singular, -gains.bound), gains.bound)
