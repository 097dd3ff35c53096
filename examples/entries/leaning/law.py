import numpy as np

import smc_mujoco as smc


@smc.law_function(
    joint=True, requires_model=True, gains={"kx": 4.0, "kv": 4.0, "kR": 120.0, "kW": 24.0}
)
def leaning(y, gains, memory):
    """Lean a quadrotor, whose heading is near that of its reference, so that its thrust pushes it
    home.
    """
    u = np.zeros(6)
    u[:3] = (
        y.M[0, 0] * (y.ddr[:3] - gains.kx[:3] * y.e[:3] - gains.kv[:3] * y.de[:3]) + y.h[:3]
    )  # the force, N
    lift = max(u[2], 0.2 * y.h[2])
    turn = y.e[3:] - np.array(
        [-u[1] / lift, u[0] / lift, 0.0]
    )  # from the lean that points the thrust there, rad
    for i in range(3):
        u[3 + i] = -y.M[3 + i, 3 + i] * (gains.kR[i] * turn[i] + gains.kW[i] * y.v[3 + i])
    return u, y.e
