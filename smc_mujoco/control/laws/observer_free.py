"""Observer-free law of J. Gaber: u = -lam tanh(s), s = de + k1 e.

A smooth boundary layer with a fixed width of 1 in the unit of s. |u| <= lam. On J x'' + D x' + K x
= u the origin is locally stable for lam > -D and lam k1 > -K (linearisation tanh(s) ~ s,
Routh-Hurwitz).
Gains: lam, bound of u [N]; k1, slope of the surface [1/s].
Source: J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition", eq. 4. The
paper writes its sliding variable as s - u/g. The law uses neither g nor that variable, so the trace
holds the s above (the paper's alpha).
"""

import math

import numpy as np

from smc_mujoco.control.component import LinearPart
from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import OBSERVER_FREE

LINEAR_PART = LinearPart(
    linear=lambda g: (g.lam, g.k1), force=lambda g, x: g.lam * np.tanh(g.k1 * x)
)


@law_function(
    family="observer-free",
    continuous=True,
    accuracy=0,
    admits={"d": lambda g: g.lam},
    gains=OBSERVER_FREE,
    label="Observer-free",
    short="OF",
    colour="#0072B2",
    linear_part=LINEAR_PART,
)
def observer_free(y, gains, memory):
    s, v_eq = sliding(y, gains.k1)
    return command(y, v_eq - gains.lam * math.tanh(s)), s
