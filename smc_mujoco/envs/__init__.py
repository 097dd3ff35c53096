"""Plants as environments of agents.

    environment = smc.envs.gym.PlantEnv("duffing", "track", {"control_period": 0.01})
    observation, info = environment.reset(seed=0)

`smc.envs.gym`, `vector` and `suite` are short for smc_mujoco.envs.gymnasium_env, vector_env and
dm_control_env, by which names `import` finds them. The plant is a name, or your own machine from
`smc.plant_from`. The task is "regulate", "track", "swing_up" or "synchronise". The same by
gymnasium's own call, for the plants with a name:

    gymnasium.make("smc_mujoco:smc/Duffing-v0", task="track")
"""

from importlib.util import find_spec

from smc_mujoco.common import lazy

_LAZY = lazy.lazy_module(__name__)
__getattr__ = _LAZY.getattr
__dir__ = _LAZY.dir
# so that a star import does without the packages that are missing
__all__ = ["agent"]
if find_spec("gymnasium"):
    __all__ += ["gym", "vector"]
if find_spec("dm_control"):
    __all__ += ["suite"]
