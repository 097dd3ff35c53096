"""smc_mujoco.envs.vector_env, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
