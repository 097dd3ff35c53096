"""No control: u = 0.

The baseline that shows what the plant does by itself, with or without a model; s is 0, there is no surface.
"""

from smc_mujoco.control.law import law_function


@law_function(label="No control", colour="#6E7781")
def none(y, gains, memory):
    return 0.0, 0.0
