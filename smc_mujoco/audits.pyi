from smc_mujoco.evidence.certificates.maker import certify as certify
from smc_mujoco.evidence.report import report as report
