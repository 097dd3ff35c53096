"""Parts that a user would write."""

import math

from smc_mujoco.hardware import actuator_function, friction_function


@friction_function(numbers={"stiffness": 500.0, "level": 0.3}, memory=1)
def dahl(y, p, memory):
    """Elastic friction: z' = v (1 - stiffness z / level sgn v)."""
    z = memory[0]
    memory[0] = z + y.h * y.v * (1.0 - p.stiffness * z / p.level * math.copysign(1.0, y.v))
    return -p.stiffness * z


@actuator_function(numbers={"zone": 0.1, "after": math.pi}, memory=1)
def worn(y, p, memory):
    """A motor with a dead zone and a lag, which writes beyond its memory after a time."""
    place = int(y.t > p.after) * 5
    memory[place] += 0.1 * (y.u - min(max(y.u, -p.zone), p.zone) - memory[0])
    return memory[0]
