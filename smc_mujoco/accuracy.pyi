from smc_mujoco.analysis.step_halving import step_halving as step_halving
from smc_mujoco.evidence.accuracy.orders import orders as orders
