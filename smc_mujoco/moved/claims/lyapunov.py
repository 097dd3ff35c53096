from smc_mujoco.moved import forward

forward(__name__, "smc_mujoco.studies.papers.gaber.claims.lyapunov")
