"""Fuzzy gain: u = -K sgn(s), K by nine rules on |s| / width and its rate; s = de + c e.

The rules say: near the surface switch with a small gain, far from it or moving away with a large
one.

    |s| / width        falling       steady      rising, by `rate` per s
    small              k_min         k_min       middle
    medium             k_min         middle      k_max
    large              middle        k_max       k_max

Memberships are triangles that add up to 1, centred at 0, 1/2, 1 for |s| / width and at -1, 0, 1 for
its rate. Conclusions are numbers. So K is interpolated in the table, and k_min <= K <= k_max. The
theorem of `classical` holds with k_min: for |d| <= D < k_min, s' = u + d reaches s = 0 by |s0| /
(k_min - D). In the band the law chatters with the small gain K there, |s| <= dt (K + D). The rate
is the difference of |s| over one sample.
Gains: k_min and k_max, smallest and largest K [N]; width, of a large |s| [m/s]; rate, of a rising
|s| [m/s^2]; c, slope of the surface [1/s].
Source: after R. Palm, "Robust control by fuzzy sliding mode", Automatica 30(9):1429, 1994; this
table is ours.
"""

from numba import njit

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import ACCELERATION, FORCE, SLOPE, SPEED, Gain


@njit
def rule(row, column):
    """Return a rule's conclusion, 0 for k_min to 1 for k_max. row: small to large; column: falling
    to rising.
    """
    return min(max(0.5 * (row + column - 1), 0.0), 1.0)


@njit
def inferred(size, rate):
    """Return the mean of the four active rules, weighted by membership, at a size in 0 .. 1 and a
    rate in -1 .. 1.
    """
    across = 2.0 * min(size, 1.0)
    down = 1.0 + min(max(rate, -1.0), 1.0)
    i = min(int(across), 1)
    j = min(int(down), 1)
    p = across - i
    q = down - j
    near = (1.0 - q) * rule(i, j) + q * rule(i, j + 1)
    far = (1.0 - q) * rule(i + 1, j) + q * rule(i + 1, j + 1)
    return (1.0 - p) * near + p * far


@law_function(
    family="first-order",
    finite_time="s",
    accuracy=1,
    gains={
        "k_min": Gain(3.0, FORCE, nonnegative=True),
        "k_max": Gain(6.0, FORCE, nonnegative=True),
        "width": Gain(0.5, SPEED, positive=True),
        "rate": Gain(10.0, ACCELERATION, positive=True),
        "c": SLOPE,
    },
    conditions={"k_min <= k_max": lambda g: g.k_min <= g.k_max},
    memory=2,
)
def fuzzy_gain(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    rate = (abs(s) - memory[0]) / y.dt if memory[1] != 0.0 else 0.0
    memory[0] = abs(s)
    memory[1] = 1.0
    K = gains.k_min + (gains.k_max - gains.k_min) * inferred(
        abs(s) / gains.width, rate / gains.rate
    )
    return command(y, v_eq - K * sgn(s)), s
