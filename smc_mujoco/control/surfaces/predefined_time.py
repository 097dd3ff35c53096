"""Predefined time: s = de + exp(|e|^p) [e]^(1-p) / (p T), 0 < p < 1/2; on s = 0 the error ends
before T from anywhere.

It ends at T (1 - exp(-|e(0)|^p)): the bound T is itself a gain. v_eq is singular at e = 0 away from
the surface. On the surface it is of order |e|^(1-2p), so that `bound` acts on large errors alone
there.
Gains: T, bound on the time of convergence [s]; p, exponent; bound, on |v_eq| [m/s^2].
Source: J. Sanchez-Torres, E. Sanchez & A. Loukianov, "Predefined-time stability of dynamical
systems with sliding modes", Proc. American Control Conf., 5842, 2015.
"""

import math

from smc_mujoco.control.law import power
from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import ACCELERATION, TIME, Gain


@surface_function(
    gains={
        "T": Gain(5.0, TIME, positive=True),
        "p": Gain(0.4, positive=True, held=True),
        "bound": Gain(20.0, ACCELERATION, positive=True),
    },
    memory=1,
    conditions={"0 < p < 1/2": lambda g: 0.0 < g.p < 0.5},
)
def predefined_time(y, gains, memory):
    p = gains.p
    size = abs(y.e)
    if size == 0.0:
        return y.de, 0.0
    grown = math.exp(min(size**p, 300.0)) / (p * gains.T)
    v_eq = -grown * (p + (1.0 - p) * size**-p) * y.de
    return y.de + grown * power(y.e, 1.0 - p), min(max(v_eq, -gains.bound), gains.bound)
