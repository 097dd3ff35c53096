"""smc_mujoco.testing.plugin, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
