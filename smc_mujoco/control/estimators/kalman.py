"""Steady Kalman filter of x''' = white noise of density q, x read under noise of standard deviation
sigma:

    predict z = (1, h, h^2/2; 0, 1, h; 0, 0, 1) z
    z += (alpha, beta / h, 2 gamma / h^2) (x - z_1);  gives (z_2, z_3)

This is the linear estimator of least variance for that model. Its gains have a closed form. The
innovation's spectrum times |z-1|^6 is, up to a factor, P(z) P(1/z) = m^3 + lam (1 - m/4 + m^2/120)
with m = 2 - z - 1/z and lam = q h^5 / sigma^2. The roots of P are the three roots inside the unit
circle, and P(z) = (z-1)^3 + alpha (z-1)^2 + beta z (z-1) + gamma z (z+1). For small h they lie on a
circle of radius (q / (sigma^2 h))^(1/6) rad/s, 100 for the defaults at 1 ms. Parabolas are tracked
exactly once the start has decayed. The filter starts from the first reading, at rest.
Gains: sigma, noise of the reading [m]; q, density of the jerk [(m/s^3)^2 s]. Only q / sigma^2
matters.
Sources: R. E. Kalman, "A new approach to linear filtering and prediction problems", J. Basic Eng.
82(1):35, 1960; P. Kalata, "The tracking index: a generalized parameter for alpha-beta and
alpha-beta-gamma target trackers", IEEE Trans. Aerosp. Electron. Syst. 20(2):174, 1984 (steady gains
by one index); the factorisation is worked out here.
"""

import math

from numba import njit

from smc_mujoco.control.estimator import estimator_function
from smc_mujoco.control.units import POSITION, Gain, Unit


@njit
def square_root(a, b):
    """Return the real and the imaginary part of the square root of a + i b."""
    if a == 0.0 and b == 0.0:
        return 0.0, b
    t = math.sqrt((abs(a) + math.hypot(a, b)) * 0.5)
    if a >= 0.0:
        return t, b / (2.0 * t)
    return abs(b) / (2.0 * t), math.copysign(t, b)


@estimator_function(
    gains={
        "sigma": Gain(1e-3, POSITION, positive=True),
        "q": Gain(1e3, Unit(position=2, time=-5), positive=True),
    },
    memory=7,
)
def kalman(y, gains, memory):
    h = y.dt
    if memory[0] == 0.0:
        memory[0] = 1.0
        memory[1] = y.x
        lam = gains.q * h**5 / gains.sigma**2
        # m = -c, the negative root, by Newton's method from an upper bound, where the cubic is
        # convex
        c = lam / 120.0 + (lam / 4.0) ** 0.5 + lam ** (1.0 / 3.0)
        for _ in range(20):
            c -= (c**3 - lam * (1.0 + c / 4.0 + c * c / 120.0)) / (
                3.0 * c * c - lam * (0.25 + c / 60.0)
            )
        p = 1.0 + c / 2.0 - (c + c * c / 4.0) ** 0.5
        # the other roots: m^2 - (c - lam / 120) m + lam / c
        half = (c - lam / 120.0) / 2.0
        root, root_i = square_root(half * half - lam / c, 0.0)  # _i: an imaginary part
        at_zero = -p
        at_one = 1.0 - p
        at_minus = -1.0 - p
        total = 0.0
        product = 1.0
        product_i = 0.0
        for i in range(2):
            sign = 1.0 - 2.0 * i
            m = half + sign * root
            m_i = sign * root_i
            spread, spread_i = square_root(
                (m * m - m_i * m_i) / 4.0 - m, (m * m_i + m_i * m) / 4.0 - m_i
            )
            z = 1.0 - m / 2.0 - spread
            z_i = -m_i / 2.0 - spread_i
            if math.hypot(z, z_i) > 1.0:
                z = 1.0 - m / 2.0 + spread
                z_i = -m_i / 2.0 + spread_i
            total += z
            product, product_i = product * z - product_i * z_i, product * z_i + product_i * z
        at_zero = at_zero * product
        at_one = at_one * (1.0 - total + product)
        at_minus = at_minus * (1.0 + total + product)
        memory[4] = 1.0 + at_zero
        memory[6] = at_one / 2.0
        memory[5] = (at_minus + 8.0 - 4.0 * memory[4]) / 2.0
    a = memory[3]
    v = memory[2] + h * a
    x = memory[1] + h * memory[2] + h * h / 2.0 * a
    miss = y.x - x
    memory[1], memory[2] = x + memory[4] * miss, v + memory[5] / h * miss
    memory[3] = a + 2.0 * memory[6] / (h * h) * miss
    return memory[2], memory[3]
