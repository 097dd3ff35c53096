"""smc_mujoco.mechanisms.plant, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
