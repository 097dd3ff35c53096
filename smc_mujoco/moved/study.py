"""smc_mujoco.studies.study, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
