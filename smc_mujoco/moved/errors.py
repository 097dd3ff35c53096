"""smc_mujoco.common.errors, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
