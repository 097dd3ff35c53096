"""Medians and shares of runs, with their uncertainty over seeds.

Seeds are the sample. Conditions and plants are fixed blocks. A seed determines the initial state
and the noise in all blocks, for every law, so the bootstrap draws whole seeds (A. C. Davison, D. V.
Hinkley, Bootstrap Methods and Their Application, 1997, 3.8). inf stands for "never" or a failed
run. It is the worst value, and two of them are equal.

Intervals are percentile bootstraps (B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap,
1993, ch. 13). Their ends are values of the sample, so inf is no problem. BCa needs the jackknife,
which fails for the median (ch. 11). The percentiles are those of T. C. Hesterberg (The American
Statistician 69(4), 2015), which are wider for few seeds. For a single block the ends are order
statistics, whose coverage follows from the binomial distribution: 93 % or more with 6 to 40 seeds,
and 1 - 2^(1 - n) with fewer, the coverage of the sample's range.

Runs that share one of several sets of gains are drawn together, as one sample: the interval of 24
runs with three sets of gains has three samples. If all runs have the same gains, the seeds are the
sample.

The median of several blocks is the median of their medians. Then a law with the lower median in
every block also has the lower median overall, which the median of all runs together does not
guarantee.
"""

import functools
import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Array

LEVEL = 0.95  # of confidence, of every interval and verdict; chosen
# chosen, so that one more is a multiple of 1000 and percentiles are whole numbers of resamples
RESAMPLES = 1999
# with fewer, no interval of a median covers 95 %; their range is given instead
MIN_INTERVAL_SAMPLES = 6


class Interval(NamedTuple):
    """A median, or a share, with its interval."""

    median: float  # of the values; for `share_interval` the share
    low: float  # NaN for the median of a single sample
    high: float  # NaN for the median of a single sample, inf if it may be "never"
    n: int  # number of samples: seeds, or sets of gains


def median_of(values: Array, samples: Sequence[int] | None = None) -> Interval:
    """Return the median of the blocks' medians, of values (blocks, n) that are NaN where there is
    no run.

    An even number of values has two middle ones: the lower end resamples the lower, and the upper
    end the higher. Every column has a run. `samples` has the sample of each column, see
    `ranking.linked`; None: each is its own.
    """
    from scipy.special import ndtr, stdtrit

    if samples is None:
        n = values.shape[1]
    else:
        n = max(samples) + 1
    centre = float(middle(middle(values)))
    if n < 2:
        return Interval(centre, math.nan, math.nan, n)
    if samples is None:
        drawn = draws(n)
    else:
        drawn = draws(n)[list(samples)]
    lower, upper = np.empty((2, RESAMPLES, len(values)))
    for k, block in enumerate(values):
        defined = ~np.isnan(block)
        order = np.argsort(block)[: defined.sum()]
        counts = drawn[order]
        ordered = block[order]
        # a resample that draws no run of the block takes each of them once
        counts[:, ~counts.any(axis=0)] = 1
        summed = np.cumsum(counts, axis=0, dtype=drawn.dtype)
        counted = 2 * summed
        total = counted[-1] // 2
        below = (counted < total).sum(axis=0)
        lower[:, k] = ordered[below]
        up_to = (counted <= total).sum(axis=0)
        upper[:, k] = ordered[up_to]
    # T. C. Hesterberg's expanded percentile, with Student's t of n - 1 degrees of freedom
    quantile = stdtrit(n - 1, (1 + LEVEL) / 2)
    ratio = n / (n - 1)
    tail = ndtr(-math.sqrt(ratio) * quantile)
    # index of the resample at which the interval ends, from either end
    end = max(1, math.floor(tail * (RESAMPLES + 1)))
    lower = np.sort(middle(lower))
    upper = np.sort(middle(upper))
    low = float(lower[end - 1])
    high = float(upper[RESAMPLES - end])
    return Interval(centre, low, high, n)


def middle(values: Array) -> Array:
    """Return the median over the last axis, without NaN; NaN if all values are NaN."""
    ordered = np.sort(values, axis=-1)
    defined = ~np.isnan(values)
    n = defined.sum(axis=-1, keepdims=True)
    lower_place = np.maximum((n - 1) // 2, 0)
    low = np.take_along_axis(ordered, lower_place, axis=-1)
    upper_place = np.maximum(n // 2, 0)
    high = np.take_along_axis(ordered, upper_place, axis=-1)
    return ((low + high) / 2)[..., 0]


def share_interval(share: float, n: int) -> Interval:
    """Return a share of the runs of n seeds, with E. B. Wilson's interval (JASA 22, 1927): not
    empty for 0 and 1.

    The share within a seed lies in [0, 1], so its variance is at most p (1 - p). With n the number
    of seeds the interval is as wide as that of n independent runs, however many runs a seed has and
    however alike they are. Its coverage is 95 % as a mean over all shares, and for some near 0 and
    1 only 83 %, with 6 seeds as with 40.
    """
    z = NormalDist().inv_cdf((1 + LEVEL) / 2)
    centre = share + z * z / (2 * n)
    variance = share * (1 - share) / n
    correction = (z / (2 * n)) ** 2
    half = z * math.sqrt(variance + correction)
    scale = 1 + z * z / n
    low = (centre - half) / scale
    high = (centre + half) / scale
    # rounding aside, it has it
    least = max(min(low, share), 0.0)
    most = min(max(high, share), 1.0)
    return Interval(share, least, most, n)


@functools.lru_cache(maxsize=8)
def draws(n: int) -> Array:
    """Return how often each of n samples is drawn in each resample, (n, RESAMPLES)."""
    equal = np.full(n, 1 / n)
    drawn = np.random.default_rng(0).multinomial(n, equal, size=RESAMPLES)
    return np.ascontiguousarray(drawn.T, np.int32)
