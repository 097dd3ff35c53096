"""Linear: s = de + c e; on s = 0 the error decays as exp(-c t).

Gains: c, slope of the surface [1/s].
Source: V. Utkin, Sliding Modes in Control and Optimization, Springer 1992, chapter 1.
"""

from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import RATE, Gain


@surface_function(gains={"c": Gain(3.0, RATE, positive=True)})
def linear(y, gains, memory):
    return y.de + gains.c * y.e, -gains.c * y.de
