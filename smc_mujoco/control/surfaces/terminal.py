"""Terminal: s = de + b [e]^p, 1/2 < p < 1; on s = 0 the error ends at |e(0)|^(1-p) / (b (1-p)).

v_eq = -b p |e|^(p-1) de is singular at e = 0 away from the surface. On the surface it is b^2 p
[e]^(2p-1), finite for p > 1/2, so that `bound` acts on large errors alone there.
Gains: b, of the surface [m^(1-p)/s]; p, exponent; bound, on |v_eq| [m/s^2].
Sources: S. Venkataraman & S. Gulati, "Control of nonlinear systems using terminal sliding modes",
J. Dyn. Syst. Meas. Control 115(3):554, 1993 (surface); Y. Feng, X. Yu & F. Han, "On nonsingular
terminal sliding-mode control of nonlinear systems", Automatica 49(6):1715, 2013 (bound).
"""

from smc_mujoco.control.law import power
from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import ACCELERATION, Gain, Unit


@surface_function(
    gains={
        "b": Gain(2.0, lambda g: Unit(position=1 - g.p, time=-1), positive=True),
        "p": Gain(0.6, positive=True, held=True),
        "bound": Gain(20.0, ACCELERATION, positive=True),
    },
    memory=1,
    conditions={"1/2 < p < 1": lambda g: 0.5 < g.p < 1.0},
)
def terminal(y, gains, memory):
    s = y.de + gains.b * power(y.e, gains.p)
    if y.e == 0.0:
        return s, 0.0
    v_eq = -gains.b * gains.p * abs(y.e) ** (gains.p - 1.0) * y.de
    return s, min(max(v_eq, -gains.bound), gains.bound)
