"""What damping exerts on the joints of a run: of `Viscous` friction, and of the joints of a user's
own file. The damping of a library plant is a term of its equation, not a friction.

A trace has it in its `reaction`, so that the same motion has the same reaction whether its friction
is written as Viscous and Coulomb, as damping and frictionloss, or as one formula.
"""

import functools

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.mechanisms.layout import channel_names, loaded
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.scenario import Scenario


def forces(scenario: Scenario, x: Array) -> Array:
    """Return the mean force of damping on each channel in the control period that ends at t_k,
    (K + 1, n), N or N m; 0 at t = 0.

    It is that of the mean speed, which positions give exactly.
    """
    damping = np.zeros(x.shape)
    starts = 0, scenario.jump_sample
    for machine, first in zip(scenario.machines, starts, strict=False):
        damping[1 + first :] = 0.0  # a jump may take damping away
        coefficients = _coefficients(machine)
        if coefficients.any():
            v = np.diff(x[first:], axis=0) / scenario.control_period
            constant, linear, square = coefficients
            damping[1 + first :] = -(constant + linear * np.abs(v) + square * v * v) * v
    return damping


def _coefficients(scenario: Scenario) -> Array:
    """Return the damping of each channel, (3, n), as `of_file`."""
    coefficients = of_file(scenario.plant).copy()
    for part in scenario.friction:
        added = part.added_to_model
        if part.side == "link" and (added.damping or added.per_speed):
            named = part.joint_names(scenario.plant)  # some may be no channels
            on = np.isin(channel_names(scenario.plant), named)
            coefficients[0, on] += added.damping
            coefficients[1, on] += added.per_speed
    return coefficients


@functools.lru_cache(maxsize=32)
def of_file(plant: Plant) -> Array:
    """Return the damping of each joint of a user's file, (3, n): the factors of v, |v| v and v^2 v.
    0 for other plants, and for the channels of a free body.
    """
    coefficients = np.zeros((3, plant.n))
    if not plant.has_user_joints:
        return coefficients
    model = loaded(plant)
    for i, name in enumerate(channel_names(plant)):
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        if joint >= 0:  # a measured base has none
            dof = model.jnt_dofadr[joint]
            coefficients[:, i] = (model.dof_damping[dof], *model.dof_dampingpoly[dof])
    return coefficients
