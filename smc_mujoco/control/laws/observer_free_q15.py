"""Observer-free law in fixed point: u = -lam tanh(s), s = de + k1 e, in 16-bit words with 32-bit sums, all saturating.

For processors without floating point. A word of 16 bits holds a number in units of its range / 2^15 (Q15) and saturates
at +-(2^15 - 1); converters and products round to the nearest. e comes in Q15 of e_range, de of de_range, s is Q15 of 8
and u goes out in Q15 of u_range; the gains are words too, k1 e_range / 8 and de_range / 8 in units of 2^-11, lam /
u_range of 2^-15. tanh is a table of 257 words over |s| < 8 with linear interpolation. Where the words hold the gains
exactly, |u + lam tanh(s)| <= lam (1.6e-4 + ds) + u_range / 2^16, ds = (k1 e_range + de_range + 16) / 2^16: 1.6e-4 is
the table, ds rounds e, de and s. What exceeds its range is held there. Stability is that of observer_free, up to a rest
within the steps of e and de. With the nominal model, f and g are added in double precision. The trace's s is the
word's.
Source: J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition", eq. 4 (the law); Q notation:
ARM, Application Note 33, Fixed Point Arithmetic on the ARM, 1996.
"""

import math

import numpy as np
from numba import njit

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import FORCE, POSITION, RATE, SPEED, Gain

FULL, MOST = 32768, 32767
TABLE = np.array([round(MOST * math.tanh(8.0 * i / 256)) for i in range(257)], np.int64)  # each fits 16 bits


@njit
def word(a, unit):
    """a in units of unit / 2^15, to the nearest, ties away from 0, saturated."""
    n = math.floor(abs(a) / unit * FULL + 0.5) if abs(a) < unit else MOST
    return int(math.copysign(min(n, MOST), a))


@njit
def product(a, b, bits):
    """a b / 2^bits to the nearest, ties away from 0: a 32-bit product and a rounding shift of its magnitude."""
    n = (abs(a * b) + (1 << (bits - 1))) >> bits
    return n if (a < 0) == (b < 0) else -n


@njit
def saturated(n):
    """n held to 16 bits, symmetrically."""
    return min(max(n, -MOST), MOST)


@law_function(
    gains={
        "lam": Gain(6.0, FORCE, positive=True),
        "k1": Gain(2.5, RATE),
        "e_range": Gain(4.0, POSITION, positive=True, held=True),
        "de_range": Gain(8.0, SPEED, positive=True, held=True),
        "u_range": Gain(8.0, FORCE, positive=True, held=True),
    },
    conditions={
        "|k1| e_range < 128 and de_range < 128": lambda g: abs(g.k1) * g.e_range < 128.0 and g.de_range < 128.0,
        "lam < u_range": lambda g: g.lam < g.u_range,
    },
)
def observer_free_q15(y, gains, memory):
    e, de = word(y.e, gains.e_range), word(y.de, gains.de_range)
    on_e, on_de = word(gains.k1 * gains.e_range / 8.0, 16.0), word(gains.de_range / 8.0, 16.0)
    s = saturated(product(on_e, e, 11) + product(on_de, de, 11))
    slid, eq = sliding(y, gains.k1)
    if y.surfaced != 0.0:
        s = word(slid, 8.0)
    i, part = abs(s) >> 7, abs(s) & 127
    T = TABLE[i] + product(TABLE[i + 1] - TABLE[i], part, 7)
    u = product(word(gains.lam, gains.u_range), T if s >= 0 else -T, 15)
    return command(y, eq - u * gains.u_range / FULL), s * 8.0 / FULL
