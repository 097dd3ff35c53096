import math

import smc_mujoco as smc


@smc.law_function(gains={"k": 5.0, "c": 3.0, "width": 0.3})
def soft_relay(y, gains, memory):
    """A relay whose sign is smooth: u = -k tanh(s / width)."""
    s = y.de + gains.c * y.e
    return -gains.k * math.tanh(s / gains.width), s
