"""Levant's robust exact differentiator of order n = 1, 2, 3 (with n = 1 the super-twisting one):

    z_i' = -m_i L^((i+1)/(n+1)) [z_0 - x]^((n-i)/(n+1)) + z_(i+1), i = 0 .. n, z_(n+1) = 0
    gives (z_1, z_2)

The estimates are exact after a finite time if |d^(n+1) x / dt^(n+1)| <= L. Sampled, the error of
z_i is O(L h^(n+1-i)). Under noise |eta| <= eps it is O(L^(i/(n+1)) eps^((n+1-i)/(n+1))), the best
possible order. The coefficients m are 1.5, 1.1 for n = 1; 2, 2.12, 1.1 for n = 2; 3, 4.16, 3.06,
1.1 for n = 3: those of the recursive form with 1.1, 1.5, 2, 3. Integrated by explicit Euler steps
with the Taylor terms h^j z_(i+j) / j!, without which n >= 2 loses its accuracy. The output is z
before the update by the current sample. With n = 1 the acceleration is 0. It starts from the first
reading, at rest.

The default L is computed, not tuned: the largest jerk of an actuator with the lag tau that reverses
from -U to U, 2 g U / tau, for U = 6, g = 8 of the study's lightest plants and tau = 20 ms, the lag
of its realistic conditions. A smaller L fails on rougher signals, a larger one amplifies noise. At
a control period of 20 ms the error O(L h^2) is several units, so choose a smaller L there. If the
acceleration is used, L should be little above the plant's own largest jerk.

On your own machine the default may be far too small: a light arm with strong motors has jerks of
1e5 rad/s^3. Then the estimate leaves the velocity for good, and the loop may diverge without any
noise. Run it with the measured velocity first. With h the control period, choose L above the
largest jerk, abs(np.diff(trace.v, 2, axis=0)).max() / h**2; or order = 1 and L above the largest
acceleration, abs(np.diff(trace.v, axis=0)).max() / h.
Gains: L, bound on the derivative of order n + 1 [m/s^(n+1)]; order, n.
Sources: A. Levant, "Robust exact differentiation via sliding mode technique", Automatica 34(3):379,
1998 (n = 1); A. Levant, "Higher-order sliding modes, differentiation and output-feedback control",
Int. J. Control 76(9):924, 2003; M. Livne & A. Levant, "Proper discretization of homogeneous
differentiators", Automatica 50(8):2007, 2014.
"""

import math

from numba import njit

from smc_mujoco.control.estimator import estimator_function
from smc_mujoco.control.units import Gain, Unit


@njit
def correction(a, p, m, L, share):
    """Return -m L^share [a]^p, where [a]^0 is the sign of a."""
    if a == 0.0:
        return 0.0
    return -math.copysign(m * L**share * abs(a) ** p, a)


@estimator_function(
    gains={
        "L": Gain(4800.0, lambda g: Unit(position=1, time=-g.order - 1), positive=True),
        "order": Gain(2.0, positive=True, held=True),
    },
    memory=5,
    conditions={
        "order is 1, 2 or 3, else rounded down and limited": lambda g: g.order in (1.0, 2.0, 3.0)
    },
)
def levant(y, gains, memory):
    n = min(max(int(gains.order), 1), 3)
    h = y.dt
    L = gains.L
    if memory[0] == 0.0:
        memory[0] = 1.0
        memory[1] = y.x
    z0 = memory[1]
    z1 = memory[2]
    z2 = memory[3]
    z3 = memory[4]
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
