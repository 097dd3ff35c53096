"""smc_mujoco.control.c.load, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
