from smc_mujoco.metrics.tip import joint_scores as joint_scores
from smc_mujoco.metrics.tip import tip_scores as tip_scores
