"""PD with a second-order disturbance observer: u = -(wc^2 e + 2 wc de + z) / b, z estimates d.

    z' = r + 2 l (de' - b u - z);  r' = l^2 (de' - b u - z)

d = e'' - b u is the total disturbance, and r estimates its rate. So z = Q d with Q = (2 l p + l^2)
/ (p + l)^2, p = d/dt, where `pd_observer` has Q = l / (p + l). With b = g,

    e = p^2 / ((p + wc)^2 (p + l)^2) d

so all poles are at -wc and -l, a d of constant rate leaves no error, and |d''| <= J leaves |d - z|
<= J / l^2 ultimately. On e'' = g u it is stable for g / b > wc l / (wc^2 + 3 wc l + l^2), 0.18 if l
= 2 wc, where `pd_observer` has 0.10; a delay times wc must then stay below 0.20 (0.31). Two
integrals in the loop make it accurate under loads that change, and can make it hunt under dry
friction.

The observer takes d's mean over the last period from the difference of two rates, and u after
saturation, so z does not wind up. It is sampled with both poles at P = exp(-l dt), and z is that of
the next period. So under a d of constant rate only the error of holding u is left, d' dt^2 / (6
wc). The observer's own loop is then stable for g / b < 1 + (1 + P)^2 / ((1 - P) (3 + P)). With the
model b = g, and f and r'' are known and fed forward. The trace's s is wc^2 e + 2 wc de.
Gains: wc, bandwidth of the loop [1/s]; l, bandwidth of the observer [1/s]; b, assumed input gain
[1/kg].
Sources: T. Umeno & Y. Hori, "Robust speed control of DC servomotors using modern two
degrees-of-freedom controller design", IEEE Trans. Ind. Electron. 38(5):363, 1991 (Q of higher
order); K.-S. Kim, K.-H. Rew & S. Kim, "Disturbance observer for estimating higher order
disturbances in time series expansion", IEEE Trans. Autom. Control 55(8):1905, 2010. Bounds and
margins are worked out here.
"""

import math

from numba import njit

from smc_mujoco.control.law import assumed, clipped, law_function
from smc_mujoco.control.units import ASSUMED_B, RATE, Gain


@njit
def estimated(y, l, memory):
    """Return z for the next period. The memory is: started, the last rate, the known acceleration
    of the last period, z, and r dt.
    """
    if memory[0] != 0.0:
        pole = math.exp(-l * y.dt)
        miss = (y.de - memory[1]) / y.dt - memory[2] - memory[3]
        memory[4] += (1.0 - pole) * (1.0 - pole) * miss
        memory[3] += memory[4] + (1.0 - pole * pole) * miss
    return memory[3]


@njit
def remember(y, acceleration, memory):
    """Keep for the next sample this one's rate, and the acceleration that the law knows of."""
    memory[0] = 1.0
    memory[1] = y.de
    memory[2] = acceleration


@law_function(
    family="disturbance-observer",
    continuous=True,
    accuracy=0,
    label="PD with second-order observer",
    short="HO",
    gains={
        "wc": Gain(5.0, RATE, positive=True),
        "l": Gain(20.0, RATE, positive=True),
        "b": ASSUMED_B,
    },
    memory=5,
    relative_degree=2,
)
def hodob(y, gains, memory):
    b, f = assumed(y, gains.b)
    z = estimated(y, gains.l, memory)
    s = gains.wc * gains.wc * y.e + 2.0 * gains.wc * y.de
    u = -(s + z + f) / b
    remember(y, b * clipped(y, u) + f, memory)
    return u, s
