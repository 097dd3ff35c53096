"""Gains from theory, surfaces of your own, and what to expect of a law: a linearised plant,
chattering, a region of attraction, J for an optimiser of your own.
"""

from smc_mujoco.analysis.chattering import chattering
from smc_mujoco.analysis.regulator import lqr
from smc_mujoco.analysis.state_space import state_space
from smc_mujoco.analysis.tuning.objective_function import objective
from smc_mujoco.control.surface import surface_function
from smc_mujoco.identification.excitation import excitation
from smc_mujoco.robustness.region_of_attraction import basin

__all__ = [
    "basin",
    "chattering",
    "excitation",
    "lqr",
    "objective",
    "state_space",
    "surface_function",
]
