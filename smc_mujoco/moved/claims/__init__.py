"""smc_mujoco.studies.paper.claims.audit, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
