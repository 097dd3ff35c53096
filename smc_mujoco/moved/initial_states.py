"""smc_mujoco.simulation.initial_states, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
