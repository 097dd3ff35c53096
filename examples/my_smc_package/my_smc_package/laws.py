"""Laws: functions of one channel's measurement.

Their docstrings are the pages of `smc-mujoco list NAME`.
"""

import math

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import FORCE, RATE, SPEED, Gain


@law_function(
    family="first-order",
    continuous=True,
    gains={
        "k": Gain(6.0, FORCE, positive=True),
        "c": Gain(3.0, RATE, positive=True),
        "phi": Gain(0.02, SPEED, positive=True),
    },
)
def arctan_switching(y, gains, memory):
    """Arctangent switching: u = -k (2 / pi) atan(s / phi), s = de + c e.

    A relay without its jump: |u| < k, and the slope at s = 0 is 2 k / (pi phi). Under a constant
    force d < k the plant rests where k (2 / pi) atan(s / phi) balances d and the plant's own force.
    Gains: k, bound of u [N]; c, slope of the surface [1/s]; phi, width of the transition [m/s].
    Source: a template; write your own source here, such as: A. Levant, Int. J. Control 58(6):1247,
    1993.
    """
    s, v_eq = sliding(y, gains.c)
    return command(y, v_eq - gains.k * 2.0 / math.pi * math.atan(s / gains.phi)), s
