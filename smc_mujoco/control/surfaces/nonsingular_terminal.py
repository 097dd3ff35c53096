"""Non-singular terminal: s = e + [de]^p / B, 1 < p < 2; on s = 0 the error ends at |e(0)|^(1-1/p) / (B^(1/p) (1-1/p)).

The terminal surface turned inside out: eq = -(B/p) [de]^(2-p) is finite everywhere. s' = (p/B) |de|^(p-1) (e'' - eq):
the law works the less on s the slower e is, and not at all at rest, which is no place to stay.
Source: Y. Feng, X. Yu & Z. Man, "Non-singular terminal sliding mode control of rigid manipulators", Automatica
38(12):2159, 2002.
"""

from smc_mujoco.control.law import power
from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import Gain, Unit


@surface_function(
    gains={
        "B": Gain(3.0, lambda g: Unit(position=g.p - 1, time=-g.p), positive=True),
        "p": Gain(1.6, positive=True, held=True),
    },
    memory=1,
    conditions={"1 < p < 2": lambda g: 1.0 < g.p < 2.0},
)
def nonsingular_terminal(y, gains, memory):
    return y.e + power(y.de, gains.p) / gains.B, -gains.B / gains.p * power(y.de, 2.0 - gains.p)
