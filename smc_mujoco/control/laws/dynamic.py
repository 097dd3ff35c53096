"""Dynamic sliding mode: u' = -k sgn(sigma), sigma = s' + q s, s = de + c e.

u' switches, and u is its integral: continuous, with |u'| = k. sigma = 0 is reached if k exceeds
|d'| + q |s'| for s' = u + d (local in s'). Then s decays as exp(-q t) even under a varying
disturbance, and u does not chatter. s' is the backward difference of s, one sample late, so sigma
and s are O(dt), and noise in s is amplified by 1 / dt. u is held while the next value would leave
the actuator's bound, so it does not wind up.
Gains: k, rate of u [N/s]; q, decay rate of s [1/s]; c, slope of the surface [1/s].
Source: H. Sira-Ramirez, "On the dynamical sliding mode control of nonlinear systems", Int. J.
Control 57(5):1039, 1993; A. Koshkouei, K. Burnham & A. Zinober, "Dynamic sliding mode control
design", IEE Proc. Control Theory Appl. 152(4):392, 2005.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE_RATE, RATE, SLOPE, Gain


@law_function(
    family="first-order",
    continuous=True,
    accuracy=1,
    gains={
        "k": Gain(30.0, FORCE_RATE, nonnegative=True),
        "q": Gain(5.0, RATE, nonnegative=True),
        "c": SLOPE,
    },
    memory=3,
    short="DY",
)
def dynamic(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    rate = (s - memory[1]) / y.dt if memory[2] != 0.0 else 0.0
    memory[1] = s
    memory[2] = 1.0
    u = command(y, v_eq + memory[0])
    w = memory[0] - y.dt * gains.k * sgn(rate + gains.q * s)
    next_u = command(y, v_eq + w)
    if abs(next_u) <= y.limit or abs(next_u) < abs(u):
        memory[0] = w
    return u, s
