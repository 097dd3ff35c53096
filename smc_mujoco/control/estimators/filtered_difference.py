"""Filtered backward difference of the position: v+ = a v + (1 - a) (x - x_) / dt, a = tau / (tau +
dt).

This is tau v' + v = x' discretised by the backward Euler method: a first-order lag. tau = 0 gives
the plain difference. The first estimate is 0, because there is no earlier position.
Gains: tau, time constant of the lag [s].
"""

from smc_mujoco.control.estimator import estimator_function
from smc_mujoco.control.units import TIME, Gain


@estimator_function(gains={"tau": Gain(5e-3, TIME, nonnegative=True)}, memory=3)
def filtered_difference(y, gains, memory):
    started, x_, v = memory
    if started:
        a = gains.tau / (gains.tau + y.dt)
        v = a * v + (1.0 - a) * (y.x - x_) / y.dt
    memory[0] = 1.0
    memory[1] = y.x
    memory[2] = v
    return v
