"""Filtered backward difference of the position: v+ = a v + (1 - a) (x - x_) / dt, a = tau / (tau + dt).

The backward-Euler form of tau v' + v = x': a first-order lag of time constant tau [s]; tau = 0 is the bare difference.
The first estimate is 0, for want of a past position.
"""

from smc_mujoco.control.estimator import estimator_function


@estimator_function(gains={"tau": 5e-3}, memory=3, nonnegative=("tau",))
def filtered_difference(y, gains, memory):
    started, x_, v = memory
    if started:
        a = gains.tau / (gains.tau + y.dt)
        v = a * v + (1.0 - a) * (y.x - x_) / y.dt
    memory[0], memory[1], memory[2] = 1.0, y.x, v
    return v
