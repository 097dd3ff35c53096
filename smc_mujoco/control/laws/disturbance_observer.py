"""Disturbance observer with sliding mode: u = (v_eq - k sgn(s) - d^) / b, s = de + c e, d^
estimates e'' - b u = d.

    d^ = z + l de;  z' = -l (z + l de) - l b u:  so d^' = l (d - d^), a first-order lag of 1 / l

d is all of e'' except b u. If |d'| <= J and b = g, then |d - d^| <= J / l in the end. k has to
exceed only this error, not |d|, to keep s = 0, so k can be small, and the chattering k dt with it.
Without the model b is a gain, and the loop of d^ alone is stable for 0 < g / b < 2 / (1 - exp(-l
dt)). With the model b = g, and f and r'' are known to the observer and fed forward, so d is the
error of the model. The observer uses u after saturation, so d^ does not wind up. It is discretised
exactly for u and d constant over the period.
Gains: k, switching gain [m/s^2]; c, slope of the surface [1/s]; l, bandwidth of the observer [1/s];
b, assumed input gain [1/kg], by default between the 1 / kg and 8 / (kg m^2) of the plants.
Sources: W.-H. Chen, D. Ballance, P. Gawthrop & J. O'Reilly, "A nonlinear disturbance observer for
robotic manipulators", IEEE Trans. Ind. Electron. 47(4):932, 2000 (observer, with its gain
constant); S. Li, J. Yang, W.-H. Chen & X. Chen, Disturbance Observer-Based Control, CRC Press 2014,
theorem 9.1 (k need only exceed the estimate's error).
"""

import math

from smc_mujoco.control.law import assumed, clipped, law_function, sgn, sliding
from smc_mujoco.control.units import ACCELERATION, ASSUMED_B, RATE, SLOPE, Gain

GAINS = {
    "k": Gain(2.0, ACCELERATION, nonnegative=True, over="b"),
    "c": SLOPE,
    "l": Gain(20.0, RATE, positive=True),
    "b": ASSUMED_B,
}


@law_function(
    family="disturbance-observer",
    finite_time="s",
    accuracy=1,
    gains=GAINS,
    memory=4,
)
def disturbance_observer(y, gains, memory):
    b, f = assumed(y, gains.b)
    if (
        memory[0] != 0.0
    ):  # memory: started, d^, last de, the acceleration b u + f - r'' of the last period
        acceleration = (y.de - memory[2]) / y.dt
        memory[1] += (1.0 - math.exp(-gains.l * y.dt)) * (acceleration - memory[3] - memory[1])
    s, v_eq = sliding(y, gains.c)
    u = (v_eq - gains.k * sgn(s) - memory[1] - f) / b
    memory[0] = 1.0
    memory[2] = y.de
    memory[3] = b * clipped(y, u) + f
    return u, s
