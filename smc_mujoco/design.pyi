from smc_mujoco.analysis.regulator import lqr as lqr
from smc_mujoco.analysis.state_space import state_space as state_space
from smc_mujoco.analysis.tuning.objective_function import objective as objective
from smc_mujoco.chattering.prediction import chattering as chattering
from smc_mujoco.control.surface import surface_function as surface_function
from smc_mujoco.identification.excitation import excitation as excitation
from smc_mujoco.robustness.region_of_attraction import basin as basin
