"""Fuzzy gain: u = -K sgn(s), K by nine rules on |s| / width and its rate; s = de + c e.

The rules say: near the surface switch little, far from it or moving away switch hard.

    |s| / width        falling       steady      rising, by `rate` per s
    small              k_min         k_min       middle
    medium             k_min         middle      k_max
    large              middle        k_max       k_max

Memberships are triangles at 0, 1/2, 1 and at -1, 0, 1 that add up to 1, conclusions are numbers, so K is the table
interpolated, and k_min <= K <= k_max. Hence what is proved of classical: for |d| <= D < k_min, s' = u + d reaches s = 0
by |s0| / (k_min - D), but chatters with k_min, not k_max: |s| <= dt (K + D), K that of the band itself. The rate is the
difference of |s| over a sample.
Source: after R. Palm, "Robust control by fuzzy sliding mode", Automatica 30(9):1429, 1994; this table is ours.
"""

from numba import njit

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import ACCELERATION, FORCE, RATE, SPEED, Gain


@njit
def rule(row, column):
    """Conclusion of a rule, 0 for k_min to 1 for k_max: row 0 small to 2 large, column 0 falling to 2 rising."""
    return min(max(0.5 * (row + column - 1), 0.0), 1.0)


@njit
def inferred(size, rate):
    """The table at a size in 0 .. 1 and a rate in -1 .. 1: mean of the four rules that fire, by their memberships."""
    across, down = 2.0 * min(size, 1.0), 1.0 + min(max(rate, -1.0), 1.0)
    i, j = min(int(across), 1), min(int(down), 1)
    p, q = across - i, down - j
    near = (1.0 - q) * rule(i, j) + q * rule(i, j + 1)
    far = (1.0 - q) * rule(i + 1, j) + q * rule(i + 1, j + 1)
    return (1.0 - p) * near + p * far


@law_function(
    gains={
        "k_min": Gain(3.0, FORCE, nonnegative=True),
        "k_max": Gain(6.0, FORCE, nonnegative=True),
        "width": Gain(0.5, SPEED, positive=True),
        "rate": Gain(10.0, ACCELERATION, positive=True),
        "c": Gain(2.5, RATE, nonnegative=True),
    },
    conditions={"k_min <= k_max": lambda g: g.k_min <= g.k_max},
    memory=2,
)
def fuzzy_gain(y, gains, memory):
    s, eq = sliding(y, gains.c)
    rate = (abs(s) - memory[0]) / y.dt if memory[1] != 0.0 else 0.0
    memory[0], memory[1] = abs(s), 1.0
    K = gains.k_min + (gains.k_max - gains.k_min) * inferred(abs(s) / gains.width, rate / gains.rate)
    return command(y, eq - K * sgn(s)), s
