"""Disturbance observer with sliding mode: u = (eq - k sgn(s) - d^) / b, s = de + c e, d^ the estimate of e'' - b u = d.

    d^ = z + l de;  z' = -l (z + l de) - l b u:  so d^' = l (d - d^), a first-order lag of 1 / l

Where |d'| <= J, |d - d^| <= J / l in the end (b = g), and k above that, not above |d|, keeps s = 0: so k, and with it
the chattering k h, may be small. d is everything but b u. Model-free b is a gain, and the loop of d^ by itself is
stable for 0 < g / b < 2 / (1 - exp(-l h)); with the model b = g, and f and r'' are told to the observer and fed
forward, so that d is what the model misses. The u in it is the one after saturation, so d^ does not wind up.
Discretised exactly for u and d held over the period. Default b: chosen between the 1 / kg and 8 / (kg m^2) of the
plants.
Sources: W.-H. Chen, D. Ballance, P. Gawthrop & J. O'Reilly, "A nonlinear disturbance observer for robotic
manipulators", IEEE Trans. Ind. Electron. 47(4):932, 2000 (observer, with its gain constant); S. Li, J. Yang, W.-H. Chen
& X. Chen, Disturbance Observer-Based Control, CRC Press 2014, theorem 9.1 (k need only exceed the estimate's error).
"""

import math

from smc_mujoco.control.law import law_function, sgn, sliding
from smc_mujoco.control.units import ACCELERATION, INPUT_GAIN, RATE, Gain


@law_function(
    gains={
        "k": Gain(2.0, ACCELERATION, nonnegative=True, over="b"),
        "c": Gain(2.5, RATE, nonnegative=True),
        "l": Gain(20.0, RATE, positive=True),
        "b": Gain(3.0, INPUT_GAIN, positive=True),
    },
    memory=4,
)
def disturbance_observer(y, gains, memory):
    b, known = (y.g, y.f - y.ddr) if y.model != 0.0 else (gains.b, 0.0)
    if memory[0] != 0.0:  # memory: started, d^, de before, the acceleration b u + f - r'' of the period that ends now
        acceleration = (y.de - memory[2]) / y.dt
        memory[1] += (1.0 - math.exp(-gains.l * y.dt)) * (acceleration - memory[3] - memory[1])
    s, eq = sliding(y, gains.c)
    u = (eq - gains.k * sgn(s) - memory[1] - known) / b
    memory[0], memory[2], memory[3] = 1.0, y.de, b * min(max(u, -y.limit), y.limit) + known
    return u, s
