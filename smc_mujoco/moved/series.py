"""smc_mujoco.simulation.time_series, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
