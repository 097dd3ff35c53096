"""Saturated sliding mode: u = -k sat(s / phi), s = de + c e, sat(a) = min(max(a, -1), 1).

Inside the layer it is linear; under a matched disturbance |d| <= D < k the ultimate bound is |s| <= phi D / k for
s' = u + d. Source: J.-J. Slotine, "Sliding controller design for non-linear systems", Int. J. Control 40(2):421, 1984.
"""

from smc_mujoco.law import law_function


@law_function(gains={"k": 6.0, "c": 3.0, "phi": 0.5}, positive=("phi",), nonnegative=("k", "c"))
def boundary_layer(y, gains, memory):
    s = y.de + gains.c * y.e
    return -gains.k * min(max(s / gains.phi, -1.0), 1.0), s
