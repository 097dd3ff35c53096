"""High-gain observer: z1' = z2 + 2 w (x - z1), z2' = w^2 (x - z1); velocity z2.

Both poles are at -w. Ramps are tracked exactly once the start has decayed, parabolas with a delay
of 2 / w. White noise of x passes with the gain sqrt(2 (1-b)^3 / (1+b)^3) / h, b = exp(-w h), which
is w^1.5 sqrt(h) / 2 for small w h. A unit step of x causes a peak of w / e in z2 (e is Euler's
number). The observer is discretised exactly, with both poles at b, and uses the current sample at
once, so any w h is stable. It starts from the first reading, at rest, without a peak.
Gains: w, bandwidth [1/s].
Sources: H. K. Khalil & L. Praly, "High-gain observers in nonlinear feedback control", Int. J.
Robust Nonlinear Control 24(6):993, 2014 (observer); N. Morrison, Introduction to Sequential
Smoothing and Prediction, McGraw-Hill 1969 (the fading-memory filter that its sampled form is, and
its noise gain).
"""

import math

from smc_mujoco.control.estimator import estimator_function
from smc_mujoco.control.units import RATE, Gain


@estimator_function(gains={"w": Gain(100.0, RATE, positive=True)}, memory=3)
def high_gain(y, gains, memory):
    h = y.dt
    b = math.exp(-gains.w * y.dt)
    if memory[0] == 0.0:
        memory[0] = 1.0
        memory[1] = y.x
    z1 = memory[1] + h * memory[2]
    z2 = memory[2]
    miss = y.x - z1
    memory[1] = z1 + (1.0 - b * b) * miss
    memory[2] = z2 + (1.0 - b) ** 2 / h * miss
    return memory[2]
