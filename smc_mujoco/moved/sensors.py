"""smc_mujoco.mechanisms.hardware.encoder, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
