"""The velocity sensor itself."""

from smc_mujoco.control.estimator import estimator_function


@estimator_function()
def measured(y, gains, memory):
    return y.v
