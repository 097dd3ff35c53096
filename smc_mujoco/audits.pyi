from smc_mujoco.evidence.accuracy.accuracy import accuracy as accuracy
from smc_mujoco.evidence.audit.audit import audit as audit
from smc_mujoco.evidence.audit.audit import claims as claims
from smc_mujoco.evidence.certificates.maker import certify as certify
from smc_mujoco.evidence.report import report as report
