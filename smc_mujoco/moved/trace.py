"""smc_mujoco.simulation.trace, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
