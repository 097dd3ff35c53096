"""Linear quadratic regulator with an integral: u = -k1 e - k2 de - ki w, w' = e - (sat(u) - u) /
(ki tt).

It minimises the integral of q0 w^2 + q1 e^2 + q2 de^2 + u^2 on e'' = a1 e + a2 de + b u. The closed
loop s^3 + alpha s^2 + beta s + gamma has

    gamma = b sqrt(q0)
    alpha^2 = 2 beta + a2^2 + 2 a1 + b^2 q2
    beta^2 = 2 gamma alpha + a1^2 + b^2 q1

(spectral factorisation, worked out here), with ki = gamma / b, k1 = (beta + a1) / b and k2 = (alpha
+ a2) / b. A constant disturbance leaves no error, and q0 = 0 gives the gains of `lqr`.
Back-calculation prevents wind-up: while u is beyond the bound, w tends with the time constant tt to
the value that brings u back to it; with q0 = 0, w = 0. As a PID controller it overshoots after
saturation. With the nominal model f and g are cancelled and the law regulates e'' = v, so a1, a2, b
are 0, 0, 1. The trace's s is k1 e + k2 de.
Gains: q0 [N^2/(m^2 s^2)], q1 [N^2/m^2] and q2 [N^2 s^2/m^2], weights of the integral, the error and
the rate; tt, of the anti-windup [s]; a1 [1/s^2], a2 [1/s] and b [1/kg], by default those of the
plant at its origin.
Source: P. C. Young & J. C. Willems, "An approach to the linear multivariable servomechanism
problem", Int. J. Control 15(5):961, 1972.
"""

import math

from numba import njit

from smc_mujoco.control.law import command, excess, law_function, linear_plant
from smc_mujoco.control.units import LINEAR_PLANT, TIME, WEIGHTS, Gain, Unit

# of a fixed point that gains about a digit in a round, and fewer where the plant is hardly damped
MOST_ROUNDS = 1000


@njit
def monic(gamma, m1, m2):
    """Return alpha and beta of the stable s^3 + alpha s^2 + beta s + gamma with alpha^2 = 2 beta +
    m2, beta^2 = 2 gamma alpha + m1.
    """
    beta = math.sqrt(m1)
    for _ in range(MOST_ROUNDS):
        last = beta
        beta = math.sqrt(2.0 * gamma * math.sqrt(max(2.0 * beta + m2, 0.0)) + m1)
        if abs(beta - last) <= 1e-16 * beta:
            break
    return math.sqrt(max(2.0 * beta + m2, 0.0)), beta


@njit
def feedback(a1, a2, b, q0, q1, q2):
    """Return k1, k2 and ki."""
    alpha, beta = monic(b * math.sqrt(q0), a1 * a1 + b * b * q1, a2 * a2 + 2.0 * a1 + b * b * q2)
    return (beta + a1) / b, (alpha + a2) / b, math.sqrt(q0)


@law_function(
    family="baseline",
    continuous=True,
    accuracy=0,
    label="LQR with integral",
    short="LI",
    gains={
        "q0": Gain(50.0, Unit(force=2, position=-2, time=-2), nonnegative=True),
        **WEIGHTS,
        "tt": Gain(0.5, TIME, positive=True),
        **LINEAR_PLANT,
    },
    memory=5,
    relative_degree=2,
)
def lqi(y, gains, memory):
    # memory: started, w times ki, k1, k2, ki
    if memory[0] == 0.0:
        a1, a2, b = linear_plant(y, gains.a1, gains.a2, gains.b)
        memory[0] = 1.0
        memory[2], memory[3], memory[4] = feedback(a1, a2, b, gains.q0, gains.q1, gains.q2)
    s = memory[2] * y.e + memory[3] * y.de
    u = command(y, -s - memory[1])
    if memory[4] != 0.0:  # else nothing would take w back
        memory[1] += y.dt * (memory[4] * y.e - excess(y, u) / gains.tt)
    return u, s
