"""Extended-state observer with sliding mode: u = (-c de - k sgn(s) - z3) / b, s = de + c e, z3 the estimate of d.

    z1' = z2 + 3 w (e - z1);  z2' = z3 + b u + 3 w^2 (e - z1);  z3' = w^3 (e - z1)

d = e'' - b u is everything but b u: friction, coupling, gravity, an input gain g other than b, the reference. Where
|d'| <= J, |d - z3| <= 3 J / w in the end (continuous time, b = g), and k above that, not above |d|, keeps s = 0: so k,
and with it the chattering k h, may be small. Model-free b is a gain, and the loop of z3 by itself stays stable for
0 < g / b < 9 at small w h, 6.6 at w h = 0.8, 3.9 at 2; with the model b = g, and f and r'' are told to the observer and
fed forward, so that d is what the model misses. The u in it is the one after saturation, so z3 does not wind up.
Observer discretised exactly in its poles, all at exp(-w h), for u held over the period. It needs e of relative degree
2, and so takes no surface. Default b: chosen between the 1 / kg and 8 / (kg m^2) of the plants.
Sources: J. Han, "From PID to active disturbance rejection control", IEEE Trans. Ind. Electron. 56(3):900, 2009
(observer); Z. Gao, "Scaling and bandwidth-parameterization based controller tuning", American Control Conference 2003
(poles); R. Miklosovic, A. Radke & Z. Gao, "Discrete implementation and generalization of the extended state observer",
American Control Conference 2006. The bound is worked out here.
"""

import math

from smc_mujoco.control.law import law_function, sgn
from smc_mujoco.control.units import ACCELERATION, INPUT_GAIN, RATE, Gain


@law_function(
    gains={
        "k": Gain(2.0, ACCELERATION, nonnegative=True, over="b"),
        "c": Gain(2.5, RATE, nonnegative=True),
        "w": Gain(40.0, RATE, positive=True),
        "b": Gain(3.0, INPUT_GAIN, positive=True),
    },
    memory=5,
    relative_degree=2,
)
def extended_state(y, gains, memory):
    h, p = y.dt, math.exp(-gains.w * y.dt)
    b, known = (y.g, y.f - y.ddr) if y.model != 0.0 else (gains.b, 0.0)
    if memory[0] == 0.0:
        memory[0], memory[1], memory[2] = 1.0, y.e - y.dt * y.de, y.de  # so that the first prediction is what is read
    # memory: started, z1, z2, z3, and the acceleration b u + f - r'' of the period that ends now
    push = memory[3] + memory[4]
    z1, z2 = memory[1] + h * memory[2] + h * h / 2.0 * push, memory[2] + h * push
    miss = y.e - z1
    memory[1] = z1 + (1.0 - p**3) * miss
    memory[2] = z2 + 1.5 * (1.0 - p) ** 2 * (1.0 + p) / h * miss
    memory[3] += (1.0 - p) ** 3 / (h * h) * miss
    s = y.de + gains.c * y.e
    u = (-gains.k * sgn(s) - gains.c * y.de - memory[3] - known) / b
    memory[4] = b * min(max(u, -y.limit), y.limit) + known
    return u, s
