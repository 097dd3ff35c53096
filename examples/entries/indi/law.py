import math

import smc_mujoco as smc
from smc_mujoco.control.units import ASSUMED_B, RATE, Gain

GAINS = {"wc": Gain(5.0, RATE), "w": Gain(50.0, RATE), "b": ASSUMED_B}


@smc.law_function(gains=GAINS, memory=4)
def indi(y, gains, memory):
    """Add to the filtered command what the filtered acceleration lacks."""
    share = 1.0 - math.exp(-gains.w * y.dt)
    if memory[0] != 0.0:
        memory[2] += share * ((y.de - memory[1]) / y.dt - memory[2])
    acceleration = -gains.wc * (gains.wc * y.e + 2.0 * y.de)
    u = memory[3] + (acceleration - memory[2]) / gains.b
    memory[0] = 1.0
    memory[1] = y.de
    memory[3] += share * (min(max(u, -y.limit), y.limit) - memory[3])
    return u, acceleration
