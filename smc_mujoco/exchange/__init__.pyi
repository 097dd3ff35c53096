from smc_mujoco.exchange.c.export_c import law_to_c as law_to_c
from smc_mujoco.exchange.c.law_from_c import law_from_c as law_from_c
from smc_mujoco.exchange.fmu.export_fmu import law_to_fmu as law_to_fmu
from smc_mujoco.exchange.fmu.law_from_fmu import law_from_fmu as law_from_fmu
from smc_mujoco.exchange.linear_law import law_from_control as law_from_control
from smc_mujoco.exchange.loop.package import law_to_package as law_to_package
