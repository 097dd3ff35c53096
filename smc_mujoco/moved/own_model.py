"""smc_mujoco.mechanisms.custom.plant_from, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
