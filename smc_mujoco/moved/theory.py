"""smc_mujoco.analysis.linear_theory, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
