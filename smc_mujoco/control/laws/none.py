"""No control: u = 0.

The baseline that shows the motion of the plant by itself, with or without a model. There is no
surface: s is 0.
"""

from smc_mujoco.control.law import law_function


@law_function(
    family="baseline",
    continuous=True,
    accuracy=0,
    label="No control",
    colour="#6E7781",
)
def none(y, gains, memory):
    return 0.0, 0.0
