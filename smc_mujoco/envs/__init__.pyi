import smc_mujoco.envs.dm_control_env
import smc_mujoco.envs.gymnasium_env
import smc_mujoco.envs.vector_env
from smc_mujoco.envs.law_agent import agent as agent

gym = smc_mujoco.envs.gymnasium_env
suite = smc_mujoco.envs.dm_control_env
vector = smc_mujoco.envs.vector_env
