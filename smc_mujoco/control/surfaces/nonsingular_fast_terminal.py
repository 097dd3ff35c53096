"""Non-singular fast terminal: s = e + a [e]^q + b [de]^p, 1 < p < 2, q > p.

On s = 0, de = -[(e + a [e]^q) / b]^(1/p): the error vanishes in finite time, and falls faster from
far away than on `nonsingular_terminal`. v_eq = -[de]^(2-p) (1 + a q |e|^(q-1)) / (b p) is finite
everywhere.
Gains: a [m^(1-q)] and b [m^(1-p) s^p], of the surface; p and q, exponents.
Source: L. Yang & J. Yang, "Nonsingular fast terminal sliding-mode control for nonlinear dynamical
systems", Int. J. Robust Nonlinear Control 21(16):1865, 2011.
"""

from smc_mujoco.control.law import power
from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import Gain, Unit


@surface_function(
    gains={
        "a": Gain(0.5, lambda g: Unit(position=1 - g.q), positive=True),
        "q": Gain(2.0, positive=True, held=True),
        "b": Gain(0.4, lambda g: Unit(position=1 - g.p, time=g.p), positive=True),
        "p": Gain(1.6, positive=True, held=True),
    },
    memory=1,
    conditions={"1 < p < 2": lambda g: 1.0 < g.p < 2.0, "q > p": lambda g: g.q > g.p},
)
def nonsingular_fast_terminal(y, gains, memory):
    s = y.e + gains.a * power(y.e, gains.q) + gains.b * power(y.de, gains.p)
    slope = 1.0 + gains.a * gains.q * abs(y.e) ** (gains.q - 1.0)
    return s, -power(y.de, 2.0 - gains.p) * slope / (gains.b * gains.p)
