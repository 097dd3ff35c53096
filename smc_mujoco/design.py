"""Gains from theory: linearise a plant, and choose gains for a bound on chattering."""

from smc_mujoco.analysis.gains_for import gains_for
from smc_mujoco.analysis.harmonics import describing_function
from smc_mujoco.analysis.state_space import state_space
from smc_mujoco.control.design import lqr

__all__ = ["describing_function", "gains_for", "lqr", "state_space"]
