"""Deviation of a plant's alternative mechanism, such as real springs, from the plant's equation."""

import mujoco
import numpy as np

from smc_mujoco.common.constraints import Positive, constrained
from smc_mujoco.common.errors import find
from smc_mujoco.common.mjcb import compiled
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant, write

GRID_SIZE = 41  # positions and velocities of one channel
RANDOM_STATES = 500  # random states of a network
SEED = 0


@constrained
def deviation(plant: Plant | str, mechanism: str, reach: Positive | None = None) -> float:
    """Return the largest |x'' - f| over the largest |f|, for states with |x| and |v| up to `reach`,
    without a command.

    x'' is the mechanism's, f the plant's equation with the same parameters. The states of one
    channel lie on a grid, those of a network are random.

    Args:
      plant: the plant with its parameters, or its name.
      mechanism: one of plant.mechanisms.
      reach: m or rad for x, m/s or rad/s for v. Default: the largest |x| in plant.x0.
    """
    plant = as_plant(plant)
    variant = find(f"mechanism of {plant.name}", mechanism, plant.mechanisms)
    if reach is None:
        reach = max(map(abs, plant.x0))
    spec = plant.spec()
    variant.edit(spec)
    model = compiled(spec)
    values = plant.values({})
    write(model, variant.fields(model, values))
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    error = size = 0.0
    for x, v in _states(plant.n, reach):
        f = np.array([plant.nominal(x, v, i, values)[0] for i in range(plant.n)])
        data.qpos[:] = x
        data.qvel[:] = v
        mujoco.mj_forward(model, data)
        error = max(error, np.abs(data.qacc - f).max())
        size = max(size, np.abs(f).max())
    return error / size


def _states(n: int, reach: float) -> np.ndarray:
    """Return states (m, 2, n) of n channels."""
    if n > 1:
        return np.random.default_rng(SEED).uniform(-reach, reach, (RANDOM_STATES, 2, n))
    line = np.linspace(-reach, reach, GRID_SIZE)
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2, 1)
