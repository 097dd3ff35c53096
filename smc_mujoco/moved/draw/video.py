"""smc_mujoco.draw.film.film, under its old name."""

from smc_mujoco.moved import forward

forward(__name__)
