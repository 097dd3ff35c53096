import smc_mujoco as smc


@smc.law_function(gains={"k1": 10.0, "k2": 5.0})
def lqr(y, gains, memory):
    """Return u = -K (e, de), with K of python-control for each plant, see gains.py."""
    u = -gains.k1 * y.e - gains.k2 * y.de
    return u, u
