"""smc_mujoco.analysis.tuning.search, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
