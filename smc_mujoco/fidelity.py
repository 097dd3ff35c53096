"""How far a mechanism departs from its equation."""

from smc_mujoco.mechanisms.fidelity import deviation

__all__ = ["deviation"]
