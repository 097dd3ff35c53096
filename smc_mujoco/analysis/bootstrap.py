"""Medians and shares of runs, with their uncertainty over seeds.

    median_interval([1.2, 1.3, math.inf])              # Interval(median=1.3, low=1.2, high=inf, n=3)

Seeds are the sample. Conditions and plants are fixed blocks. A seed determines the initial state and the noise in all
blocks, for every law, so the bootstrap draws whole seeds (A. C. Davison, D. V. Hinkley, Bootstrap Methods and Their
Application, 1997, 3.8). inf stands for "never" or a failed run. It is the worst value, and two of them are equal.

Intervals are percentile bootstraps (B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap, 1993, ch. 13). Their
ends are values of the sample, so inf is no problem. BCa needs the jackknife, which fails for the median (ch. 11). The
percentiles are those of T. C. Hesterberg (The American Statistician 69(4), 2015), which are wider for few seeds. The
alternative, the binomial interval of order statistics, cannot treat blocks. For a single block the ends of the
bootstrap are order statistics too, and their coverage follows from the binomial distribution: 93 % or more with 6 to 40
seeds, and 1 - 2^(1 - n) with fewer, the coverage of the sample's range.

A block may have fewer runs than there are seeds, because seeds that change nothing in it count as one run. A resample
that draws none of the block's runs takes each of them once.

A law's gains are part of the sample. Runs that share one of several sets of gains are drawn together, as one sample:
the interval of 24 runs with three sets of gains has three samples. If all runs have the same gains, the seeds are the
sample, and the interval expresses initial states and noise for these gains.

The median of several blocks is the median of their medians. Then a law with the lower median in every block also has
the lower median overall, which the median of all runs together does not guarantee.
"""

import functools
import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smc_mujoco.common.errors import ScenarioError, number, whole

RESAMPLES = 1999  # chosen, so that one more is a multiple of 1000 and percentiles are whole numbers of resamples
MIN_INTERVAL_SAMPLES = 6  # with fewer no interval of a median covers 95 %: it is their range


class Interval(NamedTuple):
    """A median, or a share, with its interval.

    Attributes:
      median: of the values; for `share_interval` the share.
      low: lower end; NaN for the median of a single seed.
      high: upper end; NaN for the median of a single seed, inf if it may be "never".
      n: number of samples: seeds, or sets of gains.
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
      values: (n,), a value per seed; or (blocks, n), whose columns are drawn together, for the median of the
        blocks' medians. inf for never.
      level: level of confidence.
      resamples, seed: number of resamples, and seed of their draws.

    Raises:
      ScenarioError: no values, or NaN, which may mean a failure or a missing value.
    """
    rows = np.atleast_2d(np.asarray(values, float))
    if rows.ndim != 2 or not rows.size:
        raise ScenarioError(f"values have the shape {rows.shape}: give (n,) or (blocks, n), with at least one value")
    if np.isnan(rows).any():
        raise ScenarioError("a value is nan: give inf for a run that failed, and leave out one that has no value")
    return median_of(np.sort(rows) if len(rows) == 1 else rows, level, resamples, seed)


def median_of(
    values: np.ndarray,
    level: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
    samples: Sequence[int] | None = None,
) -> Interval:
    """Return what `median_interval` returns, for values (blocks, n) that are NaN where there is no run.

    Args:
      values: every column has a run.
      samples: the sample of each column, numbered from 0, see `ranking.linked`; None if each is one.
    """
    n = values.shape[1] if samples is None else max(samples) + 1
    centre = float(middle(middle(values)))
    if n < 2:
        return Interval(centre, math.nan, math.nan, n)
    drawn, at = draws(n, resamples, seed), outermost(n, level, resamples)
    drawn = drawn if samples is None else drawn[list(samples)]
    lower, upper = (np.sort(middle(ends)) for ends in drawn_medians(values, drawn))
    return Interval(centre, float(lower[at - 1]), float(upper[resamples - at]), n)


def middle(values: np.ndarray) -> np.ndarray:
    """Return the median over the last axis, without NaN; NaN if all values are NaN."""
    ordered, n = np.sort(values, axis=-1), (~np.isnan(values)).sum(axis=-1, keepdims=True)
    low, high = (np.take_along_axis(ordered, np.maximum(at, 0), axis=-1) for at in ((n - 1) // 2, n // 2))
    return ((low + high) / 2)[..., 0]


def drawn_medians(values: np.ndarray, drawn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and the upper of the two middle values of each block, in each resample of its seeds.

    Args:
      values: (blocks, n), NaN where there is no run. Every block has a run.
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
    """Return a share of the runs of n seeds, with E. B. Wilson's interval (JASA 22, 1927): not empty for 0 and 1.

    The share within a seed lies in [0, 1], so its variance is at most p (1 - p). With n the number of seeds the
    interval is as wide as that of n independent runs, however many runs a seed has and however alike they are. Its
    coverage is 95 % as a mean over all shares, and for some near 0 and 1 only 83 %, with 6 seeds as with 40.
    """
    number("share", share, low=0.0, high=1.0)
    whole("n", n, 1, 10**9)
    z = NormalDist().inv_cdf((1 + confidence(level)) / 2)
    middle, half = share + z * z / (2 * n), z * math.sqrt(share * (1 - share) / n + (z / (2 * n)) ** 2)
    low, high = ((middle + side * half) / (1 + z * z / n) for side in (-1, 1))
    return Interval(share, max(min(low, share), 0.0), min(max(high, share), 1.0), n)  # after rounding it has the share


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
    """Return the index of the resample, counted from either end, at which an interval of n >= 2 seeds ends.

    Hesterberg's expanded percentile, Phi(-sqrt(n / (n - 1)) t), t being Student's with n - 1 degrees of freedom.
    """
    from scipy.special import ndtr, stdtrit

    tail = ndtr(-math.sqrt(n / (n - 1)) * stdtrit(n - 1, (1 + confidence(level)) / 2))
    return max(1, math.floor(tail * (resamples + 1)))


def confidence(level: float) -> float:
    """Return a level of confidence. Raise ScenarioError if it is out of range."""
    return number("level", level, low=0.5, high=0.999)
