from smc_mujoco.evidence.report import report as report
