"""Wilcoxon's signed-rank test of many paired samples at once, and the interval that belongs to it.

The test (F. Wilcoxon, Biometrics Bulletin 1(6), 1945) is exact if differences are symmetric about their centre, as
those of two equal laws are, whatever the distribution: heavy tails, skew and infinite values of the laws change
nothing. The estimate is the median of the means of all pairs of differences (J. L. Hodges, E. L. Lehmann, Annals of
Mathematical Statistics 34(2), 1963). The interval has the centres that the test does not reject.

It was chosen by simulation among three tests of 24 pairs. The sign test has too little power. Student's t has the power
of the signed ranks, but it is wrong in 16 % of samples in place of 2.5 % where the differences have a long tail to the
left (the signed ranks in 4 %), and it cannot take an infinite value.
"""

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

MAX_EXACT = 60  # samples; with more the normal approximation of the rank sum is used


class Centre(NamedTuple):
    """The centre of paired differences, with its interval."""

    value: float
    low: float
    high: float


def p_values(differences: ArrayLike) -> np.ndarray:
    """Return the one-sided p-values with which differences (..., n), NaN for none, lie above 0; 1 without any.

    A difference of 0 counts as negative. Ties share their ranks, and the distribution is that of the shared ranks.
    """
    from scipy.stats import rankdata

    rows = np.atleast_2d(np.asarray(differences, float))
    shape, rows = rows.shape[:-1], rows.reshape(-1, rows.shape[-1])
    there = ~np.isnan(rows)
    sizes = np.where(there, np.minimum(np.abs(rows), np.finfo(float).max), math.inf)
    twice = np.where(there, np.rint(2 * rankdata(sizes, axis=1)), 0).astype(int)  # whole numbers, also where ranks tie
    above = np.where(rows > 0, twice, 0).sum(axis=1)
    distinct, which = np.unique(np.sort(twice, axis=1), axis=0, return_inverse=True)
    p = np.empty(len(rows))
    for i, ranks in enumerate(distinct):
        same = which.ravel() == i
        p[same] = _tail(tuple(ranks[ranks > 0].tolist()), above[same])
    return p.reshape(shape)


def interval(differences: ArrayLike, error: float) -> Centre:
    """Return the centre of differences (n,), NaN for none, and an interval that misses it on a side by chance `error`.

    An end is infinite where the sample is too small for `error`.
    """
    known = np.asarray(differences, float)
    known = known[~np.isnan(known)]
    n = known.size
    if not n:
        return Centre(math.nan, math.nan, math.nan)
    i, j = np.triu_indices(n)
    with np.errstate(invalid="ignore"):
        means = (known[i] + known[j]) / 2  # NaN of two opposite infinite values
    value = float(np.median(np.where(np.isnan(means), 0.0, means)))
    tails = _tail(tuple(range(2, 2 * n + 1, 2)), 2 * np.arange(means.size + 1))
    if not (enough := np.flatnonzero(tails <= error)).size:
        return Centre(value, -math.inf, math.inf)
    low = np.sort(np.where(np.isnan(means), -math.inf, means))[means.size - enough[0]]
    high = np.sort(np.where(np.isnan(means), math.inf, means))[enough[0] - 1]
    return Centre(value, float(low), float(high))


def min_p(n: int) -> float:
    """Return the smallest one-sided p-value that n differences can have."""
    return 2.0**-n


def _tail(twice: tuple[int, ...], sums: np.ndarray) -> np.ndarray:
    """Return the probability that signs by chance give a rank sum as large as these, of doubled ranks."""
    if len(twice) <= MAX_EXACT:
        return _distribution(twice)[sums]
    from scipy.special import ndtr

    mean, deviation = sum(twice) / 2, math.sqrt(sum(rank * rank for rank in twice)) / 2
    return ndtr((mean - sums + 1) / deviation)


@functools.lru_cache(maxsize=1024)
def _distribution(twice: tuple[int, ...]) -> np.ndarray:
    """Return the probability of a sum of doubled ranks of at least 0, 1, ..., if each sign is drawn by chance."""
    share = np.zeros(sum(twice) + 1)
    share[0] = 1.0
    for rank in twice:
        share[rank:] += share[: share.size - rank].copy()
        share /= 2
    return np.cumsum(share[::-1])[::-1]
