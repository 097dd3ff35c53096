"""smc_mujoco.control.c, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
