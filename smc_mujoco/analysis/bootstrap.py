"""Medians and shares of runs, with their uncertainty over seeds.

    median_interval([1.2, 1.3, math.inf])              # Interval(median=1.3, low=1.2, high=inf, n=3)

Seeds are the sample. Conditions and plants are fixed blocks, and a seed gives all of them, under every law, the same
start and noise; so seeds are drawn again as wholes (A. C. Davison, D. V. Hinkley, Bootstrap Methods and Their
Application, 1997, 3.8). inf is "never" or a failed run: worst, and as bad as any other.

Intervals are percentile bootstraps (B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap, 1993, ch. 13): their
ends are values of the sample, so that inf is no difficulty. BCa needs the jackknife, which fails for the median
(ch. 11). The percentiles are those of T. C. Hesterberg (The American Statistician 69(4), 2015), farther out where seeds
are few. The binomial interval of order statistics, the alternative, knows no blocks; of a single block the bootstrap's
ends are order statistics too, and cover as the binomial distribution says: 93 % or more with 6 to 40 seeds, and
1 - 2^(1 - n) with fewer, which is all that the range of a sample can cover.

A block may have fewer runs than there are seeds: seeds that change nothing in it are one run. It is fixed all the same,
and a resample that draws none of its runs takes each of them once.

An interval is about starts and noise, and little else. Gains that were tuned from three seeds come in turn, run s
with those of tuning seed s modulo 3, and so 16 runs have three samples of tuning, not 16. If gains differ much from one
tuning seed to the next, the runs of one tuning are alike, the interval is too narrow, and the sign test of `ranking`
too sure. For laws tuned from one seed the intervals hold for these gains alone.

The median of several blocks is the median of their medians. A law with the lower median in every block then has the
lower one over all of them; the median of all runs together does not promise that.
"""

import functools
import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smc_mujoco.common.errors import ScenarioError, number, whole

RESAMPLES = 1999  # chosen; one more is a whole number of usual percentiles


class Interval(NamedTuple):
    """A median, or a share, with its interval.

    Attributes:
      median: of the values; of `share_interval` the share.
      low: NaN if unknown, for the median of a single seed.
      high: likewise; inf where it may be "never".
      n: seeds.
    """

    median: float
    low: float
    high: float
    n: int


def median_interval(values: ArrayLike, level: float = 0.95, resamples: int = RESAMPLES, seed: int = 0) -> Interval:
    """Return the median of runs, with its bootstrap interval.

    The median of an even number of runs is the mean of the middle two; the interval reaches from the resampled lower
    of the two to the resampled higher.

    Args:
      values: (n,), a value a seed; or (blocks, n), whose columns are drawn together, for the median of the
        blocks' medians; inf for never.
      level: of the interval.

    Raises:
      ScenarioError: no values, or NaN: whether it stands for a failure or for nothing is for the caller to say.
    """
    rows = np.atleast_2d(np.asarray(values, float))
    if rows.ndim != 2 or not rows.size:
        raise ScenarioError(f"values have the shape {rows.shape}: give (n,) or (blocks, n), with at least one value")
    if np.isnan(rows).any():
        raise ScenarioError("a value is nan: give inf for a run that failed, and leave out one that has no value")
    return median_of(np.sort(rows) if len(rows) == 1 else rows, level, resamples, seed)


def median_of(values: np.ndarray, level: float = 0.95, resamples: int = RESAMPLES, seed: int = 0) -> Interval:
    """As `median_interval`, of (blocks, n) in which NaN is a cell without a run; no column is without any."""
    n, centre = values.shape[1], float(middle(middle(values)))
    if n < 2:
        return Interval(centre, math.nan, math.nan, n)
    at = outermost(n, level, resamples)
    lower, upper = (np.sort(middle(ends)) for ends in drawn_medians(values, draws(n, resamples, seed)))
    return Interval(centre, float(lower[at - 1]), float(upper[resamples - at]), n)


def middle(values: np.ndarray) -> np.ndarray:
    """Return the median over the last axis, leaving out NaN; NaN where all values are."""
    ordered, n = np.sort(values, axis=-1), (~np.isnan(values)).sum(axis=-1, keepdims=True)
    low, high = (np.take_along_axis(ordered, np.maximum(at, 0), axis=-1) for at in ((n - 1) // 2, n // 2))
    return ((low + high) / 2)[..., 0]


def drawn_medians(values: np.ndarray, drawn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper of the middle two values of each block, in each resample of its seeds.

    Args:
      values: (blocks, n), NaN where no run is; no block is without any.
      drawn: (n, resamples), how often each seed is drawn.

    Returns:
      Two arrays (resamples, blocks).
    """
    lower, upper = np.empty((2, drawn.shape[1], len(values)))
    for k, block in enumerate(values):
        order = np.argsort(block)[: (~np.isnan(block)).sum()]
        counted, ordered = 2 * np.cumsum(counts(drawn, order), axis=0, dtype=drawn.dtype), block[order]
        total = counted[-1] // 2
        lower[:, k] = ordered[(counted < total).sum(axis=0)]
        upper[:, k] = ordered[(counted <= total).sum(axis=0)]
    return lower, upper


def counts(drawn: np.ndarray, runs: np.ndarray) -> np.ndarray:
    """Return how often each run of a block counts in each resample: as drawn, or once if none of them was drawn."""
    counted = drawn[runs]
    counted[:, ~counted.any(axis=0)] = 1
    return counted


def share_interval(share: float, n: int, level: float = 0.95) -> Interval:
    """Return a share of the runs of n seeds, with E. B. Wilson's interval (JASA 22, 1927): not empty at 0 and 1.

    A seed's own share lies in [0, 1] and so varies by p (1 - p) at most: with n the seeds, however many runs each has
    and however alike they are, the interval is wide enough.
    """
    number("share", share, least=0.0, most=1.0)
    whole("n", n, 1, 10**9)
    z = NormalDist().inv_cdf((1 + confidence(level)) / 2)
    middle, half = share + z * z / (2 * n), z * math.sqrt(share * (1 - share) / n + (z / (2 * n)) ** 2)
    low, high = ((middle + side * half) / (1 + z * z / n) for side in (-1, 1))
    return Interval(share, max(min(low, share), 0.0), min(max(high, share), 1.0), n)  # rounding leaves 1 out, and 0


@functools.lru_cache(maxsize=8)
def draws(n: int, resamples: int, seed: int) -> np.ndarray:
    """Return how often each of n seeds is drawn in each resample, (n, resamples)."""
    whole("resamples", resamples, 99, 10**6)
    whole("seed", seed, 0, 2**63)
    drawn = np.random.default_rng(seed).multinomial(n, np.full(n, 1 / n), size=resamples)
    drawn = np.ascontiguousarray(drawn.T, np.int32)
    drawn.setflags(write=False)
    return drawn


@functools.lru_cache(maxsize=32)
def outermost(n: int, level: float, resamples: int) -> int:
    """Return at which resample, counted from either end, an interval of n >= 2 seeds ends.

    Hesterberg's expanded percentile, Phi(-sqrt(n / (n - 1)) t), t being Student's with n - 1 degrees of freedom.
    """
    from scipy.special import ndtr, stdtrit

    tail = ndtr(-math.sqrt(n / (n - 1)) * stdtrit(n - 1, (1 + confidence(level)) / 2))
    return max(1, math.floor(tail * (resamples + 1)))


def confidence(level: float) -> float:
    """Return a level of confidence, or refuse it."""
    return number("level", level, least=0.5, most=0.999)
