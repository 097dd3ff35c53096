"""Observer-free law in fixed point: u = -lam tanh(s), s = de + k1 e, in 16-bit words with 32-bit
sums, all saturating.

For processors without floating point. A 16-bit word holds a number in units of range / 2^15 (Q15)
and saturates at +-(2^15 - 1). Conversions and products round to nearest. The ranges are e_range for
e, de_range for de, 8 for s and u_range for u. The gains are words too: k1 e_range / 8 and de_range
/ 8 in units of 2^-11, lam / u_range in units of 2^-15. tanh is a table of 257 words over |s| < 8
with linear interpolation. If the words hold the gains exactly, |u + lam tanh(s)| <= lam (1.6e-4 +
ds) + u_range / 2^16, where 1.6e-4 is the error of the table and ds = (k1 e_range + de_range + 16) /
2^16 the rounding of e, de and s. Values beyond their range saturate. Stability is that of
`observer_free`, up to an equilibrium within the steps of e and de. With the nominal model, f and g
are added in double precision. The trace's s is the word's.
Gains: lam, bound of u [N]; k1, slope of the surface [1/s]; e_range [m], de_range [m/s] and u_range
[N], ranges of the words.
Source: J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition", eq. 4 (the
law); Q notation: ARM, Application Note 33, Fixed Point Arithmetic on the ARM, 1996.
"""

import math

import numpy as np
from numba import njit

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import FORCE, OBSERVER_FREE, POSITION, SPEED, Gain

UNITS = 32768
MAX_WORD = 32767
# each fits 16 bits
TABLE = np.array([round(MAX_WORD * math.tanh(8.0 * i / 256)) for i in range(257)], np.int64)
TABLE.flags.writeable = False


@njit
def word(a, unit):
    """Return a in units of unit / 2^15, rounded to nearest (ties away from 0) and saturated."""
    n = math.floor(abs(a) / unit * UNITS + 0.5) if abs(a) < unit else MAX_WORD
    return int(math.copysign(min(n, MAX_WORD), a))


@njit
def product(a, b, bits):
    """Return a b / 2^bits, rounded to nearest (ties away from 0): a 32-bit product, its magnitude
    shifted.
    """
    n = (abs(a * b) + (1 << (bits - 1))) >> bits
    return n if (a < 0) == (b < 0) else -n


@njit
def saturated(n):
    """Return n, saturated to a word."""
    return min(max(n, -MAX_WORD), MAX_WORD)


@law_function(
    family="observer-free",
    continuous=True,
    accuracy=0,
    label="Observer-free, Q15",
    gains={
        **OBSERVER_FREE,
        "e_range": Gain(4.0, POSITION, positive=True, held=True),
        "de_range": Gain(8.0, SPEED, positive=True, held=True),
        "u_range": Gain(8.0, FORCE, positive=True, held=True),
    },
    conditions={
        "|k1| e_range < 128 and de_range < 128": lambda g: (
            abs(g.k1) * g.e_range < 128.0 and g.de_range < 128.0
        ),
        "lam < u_range": lambda g: g.lam < g.u_range,
    },
)
def observer_free_q15(y, gains, memory):
    e = word(y.e, gains.e_range)
    de = word(y.de, gains.de_range)
    k_e = word(gains.k1 * gains.e_range / 8.0, 16.0)
    k_de = word(gains.de_range / 8.0, 16.0)
    s = saturated(product(k_e, e, 11) + product(k_de, de, 11))
    surface_s, v_eq = sliding(y, gains.k1)
    if y.has_surface != 0.0:
        s = word(surface_s, 8.0)
    i = abs(s) >> 7
    part = abs(s) & 127
    T = TABLE[i] + product(TABLE[i + 1] - TABLE[i], part, 7)
    u = product(word(gains.lam, gains.u_range), T if s >= 0 else -T, 15)
    return command(y, v_eq - u * gains.u_range / UNITS), s * 8.0 / UNITS
