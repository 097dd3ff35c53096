"""smc_mujoco.mechanisms.hardware.drives, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
