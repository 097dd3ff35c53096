"""Non-singular terminal: s = e + [de]^p / B, 1 < p < 2; on s = 0 the error ends at |e(0)|^(1-1/p) /
(B^(1/p) (1-1/p)).

This is the terminal surface solved for e, so that v_eq = -(B/p) [de]^(2-p) is finite everywhere. s'
= (p/B) |de|^(p-1) (e'' - v_eq): the smaller the velocity, the less the law acts on s. At rest it
has no effect on s, but the state cannot stay there.
Gains: B, of the surface [m^(p-1)/s^p]; p, exponent.
Source: Y. Feng, X. Yu & Z. Man, "Non-singular terminal sliding mode control of rigid manipulators",
Automatica 38(12):2159, 2002.
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
