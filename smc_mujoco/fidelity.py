"""How far a mechanism departs from its equation, and a run from itself at half the step."""

from smc_mujoco.analysis.step_halving import step_halving
from smc_mujoco.mechanisms.fidelity import deviation

__all__ = ["deviation", "step_halving"]
