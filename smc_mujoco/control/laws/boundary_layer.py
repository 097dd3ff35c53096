"""Saturated sliding mode: u = -k sat(s / phi), s = de + c e, sat(a) = min(max(a, -1), 1).

The law is linear inside the layer |s| <= phi. Under a matched disturbance |d| <= D < k the ultimate
bound is |s| <= phi D / k for s' = u + d. Sampled, the layer must be wider than one step, phi > g k
dt / 2; otherwise the law chatters like `classical`.
Gains: k, bound of u [N]; c, slope of the surface [1/s]; phi, half-width of the layer [m/s].
Source: J.-J. Slotine, "Sliding controller design for non-linear systems", Int. J. Control
40(2):421, 1984.
"""

import numpy as np

from smc_mujoco.control.component import LinearPart
from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import FORCE, SLOPE, SPEED, Gain

LINEAR_PART = LinearPart(
    linear=lambda g: (g.k / g.phi, g.c),
    force=lambda g, x: g.k * np.clip(g.c * x / g.phi, -1.0, 1.0),
)


@law_function(
    family="first-order",
    continuous=True,
    accuracy=0,
    admits={"d": lambda g: g.k},
    gains={
        "k": Gain(6.0, FORCE, nonnegative=True),
        "c": SLOPE,
        "phi": Gain(0.5, SPEED, positive=True),
    },
    colour="#CC79A7",
    linear_part=LINEAR_PART,
)
def boundary_layer(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    return command(y, v_eq - gains.k * min(max(s / gains.phi, -1.0), 1.0)), s
