"""Counter-based normal numbers: no generator state, the same numbers in any order and on any
thread.

Philox4x64-10 (Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011),
bit for bit numpy.random.Philox(key=(seed, channel), counter=(k - 1, stream, 0, 0)).random_raw(4),
and the Box-Muller transform (Box & Muller 1958, Ann. Math. Stat. 29:610) of its words.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import math

import numpy as np
from numba import njit, types
from numba.extending import intrinsic

from smc_mujoco.common.jit import not_inlined

MEASUREMENT, PROCESS = (
    0,
    1,
)  # streams of sensor noise and of the first process noise; the second has 2, and so on
DROPOUT = 1 << 32  # stream that decides which readings are lost
JITTER, MISSED = (
    1 << 33,
    1 << 34,
)  # streams that decide which samples are late, and which are missed
NO_CHANNEL = 0  # of numbers for a whole run; as a literal it would be compiled for apart
PAUSE = 1 << 36  # stream that decides when the controller has its first pause
REFILL = 1 << 35  # stream that decides when the generators of stepper motors look at their queues

_M0 = np.uint64(0xD2E7470EE14C6C93)
_M1 = np.uint64(0xCA5A826395121157)
_W0 = np.uint64(0x9E3779B97F4A7C15)
_W1 = np.uint64(0xBB67AE8584CAA73B)
_SHIFT = np.uint64(11)
_ONE = np.uint64(1)


@intrinsic
def _multiplied(typingctx, a, b):
    """Return the high and the low 64 bits of the product of two uint64, by one multiplication."""
    from llvmlite import ir

    pair = types.UniTuple(types.uint64, 2)

    def codegen(context, builder, signature, args):
        wide = ir.IntType(128)
        product = builder.mul(builder.zext(args[0], wide), builder.zext(args[1], wide))
        high = builder.lshr(product, ir.Constant(wide, 64))
        halves = [builder.trunc(half, ir.IntType(64)) for half in (high, product)]
        return context.make_tuple(builder, pair, halves)

    return pair(types.uint64, types.uint64), codegen


@njit(error_model="numpy")
def block(seed, channel, stream, k):
    """Return the four uint64 words of block k of a stream. All arguments are whole numbers >= 0."""
    c0 = np.uint64(k)
    c1 = np.uint64(stream)
    c2 = np.uint64(0)
    c3 = np.uint64(0)
    key0 = np.uint64(seed)
    key1 = np.uint64(channel)
    for _ in range(10):
        high0, low0 = _multiplied(_M0, c0)
        high1, low1 = _multiplied(_M1, c2)
        c0, c1, c2, c3 = high1 ^ c1 ^ key0, low1, high0 ^ c3 ^ key1, low0
        key0, key1 = key0 + _W0, key1 + _W1
    return c0, c1, c2, c3


@not_inlined
def polar(seed, channel, stream, k):
    """Return the radius and the angle, in [0, 2 pi), of two normal numbers from block k."""
    a, b, _, _ = block(seed, channel, stream, k)
    radius = math.sqrt(-2.0 * math.log(((a >> _SHIFT) + _ONE) * 2.0**-53))  # argument in (0, 1]
    return radius, 2.0 * math.pi * ((b >> _SHIFT) * 2.0**-53)


@not_inlined
def cartesian(radius, angle):
    """Return the two normal numbers of a radius and an angle."""
    return radius * math.cos(angle), radius * math.sin(angle)


@njit(error_model="numpy")
def normals(seed, channel, stream, k):
    """Return two independent standard normal numbers from block k."""
    radius, angle = polar(seed, channel, stream, k)
    return cartesian(radius, angle)


@njit(error_model="numpy")
def uniform(seed, channel, stream, k):
    """Return a number uniform in [0, 1) from block k."""
    return (block(seed, channel, stream, k)[0] >> _SHIFT) * 2.0**-53


def random_words(seed: int, channel: int, stream: int, k: int) -> tuple[int, int]:
    """Return two whole numbers of 53 random bits, from numpy's generator."""
    counter = (k - 1 + (stream << 64)) % 2**256
    generator = np.random.Philox(key=seed + (channel << 64), counter=counter)
    first, second = generator.random_raw(2)
    return int(first) >> 11, int(second) >> 11
