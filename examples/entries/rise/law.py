import math

import smc_mujoco as smc
from smc_mujoco.control.units import FORCE_PER_SPEED, FORCE_RATE, RATE, Gain

GAINS = {
    "k": Gain(5.0, FORCE_PER_SPEED),
    "beta": Gain(5.0, FORCE_RATE),
    "a1": Gain(5.0, RATE),
    "a2": Gain(5.0, RATE),
}


@smc.law_function(gains=GAINS, memory=1)
def rise(y, gains, memory):
    """u = -k e2 - integral of k a2 e2 + beta sgn(e2), e2 = de + a1 e."""
    e2 = y.de + gains.a1 * y.e
    u = -gains.k * e2 + memory[0]
    if abs(u) < y.limit or u * e2 > 0.0:
        sign = math.copysign(1.0, e2)
        memory[0] -= y.dt * (gains.k * gains.a2 * e2 + gains.beta * sign)
    return u, e2
