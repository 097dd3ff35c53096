"""Extended-state observer with sliding mode: u = (-c de - k sgn(s) - z3) / b, s = de + c e, z3 the
estimate of d.

    z1' = z2 + 3 w (e - z1);  z2' = z3 + b u + 3 w^2 (e - z1);  z3' = w^3 (e - z1)

d = e'' - b u is the total disturbance: friction, coupling, gravity, the reference, and an input
gain g other than b. If |d'| <= J and b = g, then |d - z3| <= 3 J / w in the end (continuous time).
k has to exceed only this error, not |d|, to keep s = 0, so k can be small, and the chattering k dt
with it. Unlike `adrc`, it feeds back the position by the sign of s alone. Without the model b is a
gain, and the loop of z3 alone is stable for 0 < g / b < 9 at small w dt, 6.6 at w dt = 0.8, 3.9 at
2. With the model b = g, and f and r'' are known to the observer and fed forward, so d is the error
of the model. The observer uses u after saturation, so z3 does not wind up. It is discretised
exactly for u constant over the period, with all poles at exp(-w dt). It needs e of relative degree
2, so the law takes no surface.
Gains: k, switching gain [m/s^2]; c, slope of the surface [1/s]; w, bandwidth of the observer [1/s];
b, assumed input gain [1/kg], by default between the 1 / kg and 8 / (kg m^2) of the plants.
Sources: J. Han, "From PID to active disturbance rejection control", IEEE Trans. Ind. Electron.
56(3):900, 2009 (observer); Z. Gao, "Scaling and bandwidth-parameterization based controller
tuning", American Control Conference 2003 (poles); R. Miklosovic, A. Radke & Z. Gao, "Discrete
implementation and generalization of the extended state observer", American Control Conference 2006.
The bound is worked out here.
"""

import math

from numba import njit

from smc_mujoco.control.law import assumed, clipped, law_function, sgn
from smc_mujoco.control.units import ACCELERATION, ASSUMED_B, RATE, SLOPE, Gain


@njit
def corrections(w, h):
    """Return by how much of a miss z1, z2 and z3 are corrected, for an observer of bandwidth w
    sampled every h.
    """
    p = math.exp(-w * h)
    q = 1.0 - p
    return 1.0 - p * p * p, 1.5 * q * q * (1.0 + p) / h, q * q * q / (h * h)


@njit
def observe(y, l1, l2, l3, memory):
    """Bring the observer in memory to this sample's reading, with its `corrections`. Return z3, the
    estimate of d.

    The memory holds whether it has started, z1, z2, z3, and the known acceleration of the last
    period, which the law writes.
    """
    h = y.dt
    if memory[0] == 0.0:
        # the first prediction is the reading
        memory[0] = 1.0
        memory[1] = y.e - h * y.de
        memory[2] = y.de
    push = memory[3] + memory[4]
    z1 = memory[1] + h * memory[2] + h * h / 2.0 * push
    z2 = memory[2] + h * push
    miss = y.e - z1
    memory[1] = z1 + l1 * miss
    memory[2] = z2 + l2 * miss
    memory[3] += l3 * miss
    return memory[3]


@law_function(
    family="disturbance-observer",
    finite_time="s",
    accuracy=1,
    label="Extended-state",
    gains={
        "k": Gain(2.0, ACCELERATION, nonnegative=True, over="b"),
        "c": SLOPE,
        "w": Gain(40.0, RATE, positive=True),
        "b": ASSUMED_B,
    },
    memory=5,
    relative_degree=2,
)
def extended_state(y, gains, memory):
    b, f = assumed(y, gains.b)
    l1, l2, l3 = corrections(gains.w, y.dt)
    d = observe(y, l1, l2, l3, memory)
    s = y.de + gains.c * y.e
    u = (-gains.k * sgn(s) - gains.c * y.de - d - f) / b
    memory[4] = b * clipped(y, u) + f
    return u, s
