"""Levant's robust exact differentiator of order n = 1, 2, 3 (with n = 1 the super-twisting one):

    z_i' = -m_i L^((i+1)/(n+1)) [z_0 - x]^((n-i)/(n+1)) + z_(i+1), i = 0 .. n, z_(n+1) = 0;  gives (z_1, z_2)

Exact after finite time where |d^(n+1) x / dt^(n+1)| <= L; sampled, the error of z_i is O(L h^(n+1-i)), and under noise
|eta| <= eps O(L^(i/(n+1)) eps^((n+1-i)/(n+1))): the best order possible. m of n = 1: 1.5, 1.1; 2: 2, 2.12, 1.1;
3: 3, 4.16, 3.06, 1.1, those of the recursive form with 1.1, 1.5, 2, 3. Explicit Euler steps, with the Taylor terms
h^j z_(i+j) / j! without which n >= 2 loses its orders. What is given is the z of the sample's time, from the samples
before. The default L follows a rule that looks at no run: the largest jerk of an actuator with the lag tau that turns
from -U to U, 2 g U / tau, with U = 6, g = 8 of the study's lightest plants and tau = 20 ms, the lag of its realistic
conditions. Less loses what is rougher, more costs noise. At a control period of 20 ms its O(L h^2) is several units:
take less there. Where the acceleration is used, L should be little above the plant's own largest jerk.
Starts from the first reading, at rest; with n = 1 the acceleration given is 0.
Sources: A. Levant, "Robust exact differentiation via sliding mode technique", Automatica 34(3):379, 1998 (n = 1);
A. Levant, "Higher-order sliding modes, differentiation and output-feedback control", Int. J. Control 76(9):924, 2003;
M. Livne & A. Levant, "Proper discretization of homogeneous differentiators", Automatica 50(8):2007, 2014.
"""

import math

from numba import njit

from smc_mujoco.control.estimator import estimator_function
from smc_mujoco.control.units import Gain, Unit


@njit
def correction(a, p, m, L, share):
    """-m L^share [a]^p; for p = 0 the sign of a."""
    if a == 0.0:
        return 0.0
    return -math.copysign(m * L**share * abs(a) ** p, a)


@estimator_function(
    gains={
        "L": Gain(4800.0, lambda g: Unit(position=1, time=-g.order - 1), positive=True),
        "order": Gain(2.0, positive=True, held=True),
    },
    memory=5,
    conditions={"an order of 1, 2 or 3, else the nearest": lambda g: g.order in (1.0, 2.0, 3.0)},
)
def levant(y, gains, memory):
    n, h, L = min(max(int(gains.order), 1), 3), y.dt, gains.L
    if memory[0] == 0.0:
        memory[0], memory[1] = 1.0, y.x
    z0, z1, z2, z3 = memory[1], memory[2], memory[3], memory[4]
    a = z0 - y.x
    if n == 1:
        memory[1] = z0 + h * (correction(a, 1 / 2, 1.5, L, 1 / 2) + z1)
        memory[2] = z1 + h * correction(a, 0.0, 1.1, L, 1.0)
    elif n == 2:
        memory[1] = z0 + h * (correction(a, 2 / 3, 2.0, L, 1 / 3) + z1 + h / 2 * z2)
        memory[2] = z1 + h * (correction(a, 1 / 3, 2.12, L, 2 / 3) + z2)
        memory[3] = z2 + h * correction(a, 0.0, 1.1, L, 1.0)
    else:
        memory[1] = z0 + h * (correction(a, 3 / 4, 3.0, L, 1 / 4) + z1 + h / 2 * (z2 + h / 3 * z3))
        memory[2] = z1 + h * (correction(a, 1 / 2, 4.16, L, 1 / 2) + z2 + h / 2 * z3)
        memory[3] = z2 + h * (correction(a, 1 / 4, 3.06, L, 3 / 4) + z3)
        memory[4] = z3 + h * correction(a, 0.0, 1.1, L, 1.0)
    return z1, z2
