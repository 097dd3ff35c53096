"""What gymnasium calls by the ids of `registration`. A MUJOCO_GL with which MuJoCo cannot be
imported is replaced before that.
"""

from typing import Any

from smc_mujoco.common import gl


def environment(plant: Any, *args: Any, **kwargs: Any) -> Any:
    """Return the environment of a plant: a FlightEnv of a free body, else a PlantEnv, with their
    arguments.
    """
    gl.mend_gl()
    from smc_mujoco.envs.flight_env import FlightEnv, PlantEnv
    from smc_mujoco.mechanisms.named import as_plant

    kind = FlightEnv if as_plant(plant).pose else PlantEnv
    return kind(plant, *args, **kwargs)


def environments(*args: Any, **kwargs: Any) -> Any:
    """Return a BatchEnv."""
    gl.mend_gl()
    from smc_mujoco.envs.vector_env import BatchEnv

    return BatchEnv(*args, **kwargs)
