"""Gains from theory, and what to expect of a law: a linearised plant, chattering, a region of
attraction.
"""

from smc_mujoco.analysis.chattering import chattering
from smc_mujoco.analysis.harmonics import describing_function
from smc_mujoco.analysis.region_of_attraction import basin
from smc_mujoco.analysis.regulator import lqr
from smc_mujoco.analysis.state_space import state_space

__all__ = ["basin", "chattering", "describing_function", "lqr", "state_space"]
