"""smc_mujoco.analysis.region_of_attraction, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
