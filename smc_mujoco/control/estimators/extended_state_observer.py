"""Extended-state observer: z1' = z2 + 3 w (x - z1), z2' = z3 + 3 w^2 (x - z1), z3' = w^3 (x - z1);
(z2, z3).

All poles are at -w. z3 is the total disturbance of x'' = z3; because u is not known to the
observer, this is the acceleration. Parabolas are tracked exactly once the start has decayed. If
|x'''| <= J, then |x'' - z3| <= 3 J / w and |x' - z2| <= 3 J / w^2 in the end, for small w h. White
noise passes to z2 with the gain sqrt((1-b)^3 (13 + 50 b + 49 b^2) / (2 (1+b)^5)) / h and to z3 with
sqrt(6 (1-b)^5 / (1+b)^5) / h^2, b = exp(-w h). The observer is discretised exactly, with all poles
at b, and uses the current sample at once, so any w h is stable. It starts from the first reading,
at rest.
Gains: w, bandwidth [1/s].
Sources: J. Han, "From PID to active disturbance rejection control", IEEE Trans. Ind. Electron.
56(3):900, 2009; Z. Gao, "Scaling and bandwidth-parameterization based controller tuning", American
Control Conference 2003 (the poles); R. Miklosovic, A. Radke & Z. Gao, "Discrete implementation and
generalization of the extended state observer", American Control Conference 2006; N. Morrison,
Introduction to Sequential Smoothing and Prediction, McGraw-Hill 1969 (noise).
"""

import math

from smc_mujoco.control.estimator import estimator_function
from smc_mujoco.control.units import RATE, Gain


@estimator_function(gains={"w": Gain(100.0, RATE, positive=True)}, memory=4)
def extended_state_observer(y, gains, memory):
    h = y.dt
    b = math.exp(-gains.w * y.dt)
    if memory[0] == 0.0:
        memory[0] = 1.0
        memory[1] = y.x
    z3 = memory[3]
    z2 = memory[2] + h * z3
    z1 = memory[1] + h * memory[2] + h * h / 2.0 * z3
    miss = y.x - z1
    memory[1] = z1 + (1.0 - b**3) * miss
    memory[2] = z2 + 1.5 * (1.0 - b) ** 2 * (1.0 + b) / h * miss
    memory[3] = z3 + (1.0 - b) ** 3 / (h * h) * miss
    return memory[2], memory[3]
