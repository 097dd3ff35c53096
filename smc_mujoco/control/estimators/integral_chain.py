"""Integral-chain differentiator: x1' = x2, x2' = x3, x3' = -w^3 (x1 - x) - 3 w^2 x2 - 3 w x3; gives
(x2, x3).

The reading enters only the last of three integrators, so noise is smoothed before it reaches the
velocity x2. An observer corrects every state by the reading instead. The price is a delay: x2 is x'
filtered by w^3 / (p + w)^3, 3 / w late. For small w h, white noise passes to x2 with the gain
sqrt(h w^3) / 4 and to x3 with sqrt(3 h w^5) / 4. All poles are at -w; in the source epsilon is 1 /
w and the coefficients are 1, 3, 3. The discretisation is exact for readings joined by straight
lines: the matrix exponential of a triple pole is exp(-w h) (1 + N h + N^2 h^2 / 2) with N = A + w.
It starts from the first reading, at rest.
Gains: w, bandwidth [1/s].
Source: J. Liu & X. Wang, Advanced Sliding Mode Control for Mechanical Systems, Springer 2012,
section 8.5, eq. 8.37.
"""

import math

from smc_mujoco.control.estimator import estimator_function
from smc_mujoco.control.units import RATE, Gain


@estimator_function(gains={"w": Gain(200.0, RATE, positive=True)}, memory=5)
def integral_chain(y, gains, memory):
    w = gains.w
    h = y.dt
    if memory[0] == 0.0:
        memory[0] = 1.0
        memory[1] = y.x
        memory[4] = y.x
    slope = (y.x - memory[4]) / h
    # deviation from the steady state on a ramp, (x - 3 slope / w, slope, 0)
    p = memory[1] - memory[4] + 3.0 * slope / w
    v = memory[2] - slope
    a = memory[3]
    n1, n2, n3 = w * p + v, w * v + a, -(w**3) * p - 3.0 * w * w * v - 2.0 * w * a  # N (p, v, a)
    m1 = w * n1 + n2
    m2 = w * n2 + n3
    m3 = -(w**3) * n1 - 3.0 * w * w * n2 - 2.0 * w * n3
    decay = math.exp(-w * h)
    memory[1] = y.x - 3.0 * slope / w + decay * (p + h * n1 + h * h / 2.0 * m1)
    memory[2] = slope + decay * (v + h * n2 + h * h / 2.0 * m2)
    memory[3] = decay * (a + h * n3 + h * h / 2.0 * m3)
    memory[4] = y.x
    return memory[2], memory[3]
