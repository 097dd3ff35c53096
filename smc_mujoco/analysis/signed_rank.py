"""The signed-rank test of differences, its interval, and the least lead that it sees.

The test is F. Wilcoxon's (Biometrics Bulletin 1(6), 1945) in the form of J. W. Tukey: the number of
pairs i <= j with a positive sum, whose law is exact if signs are random. The estimate is the median
of the means of all pairs (J. L. Hodges, E. L. Lehmann, Annals of Mathematical Statistics 34(2),
1963), and an interval has the centres that the test does not reject.
"""

import functools
import hashlib
import math

import numpy as np
from numpy.typing import ArrayLike

MAX_EXACT = 60  # samples; with more the normal approximation of the rank sum is used
MAX_LOG = 1e6  # of a logarithm: more than the range of floating-point numbers, but finite
POWER = 0.8  # with which the least visible lead is seen
LEAD_RESAMPLES = 400  # for the least visible lead; chosen
# of resamples that must see it, so that on average POWER of new samples do; chosen by samples of 51
# shapes and confirmed on shapes drawn later, see docs/winners.md
OWN_SHARE = 0.95
MEDIAN_DISTANCE = 0.954  # of two units of a normal sample, in its standard deviations
MAX_UNITS = 1000  # of a sample that would see a lead; chosen
MAX_SUMS = 10_000_000  # of pairs, in memory at once


def p_values(differences: ArrayLike) -> np.ndarray:
    """Return the one-sided p-values with which differences (..., n), NaN for none, lie above 0; 1
    without any.

    The statistic is the number of pairs i <= j whose sum is above 0: without ties and zeros, the
    sum of the positive ranks. Ties and zeros lower it, so that the test keeps its level.
    """
    samples = np.asarray(differences, float)
    p = np.ones(samples.shape[:-1])
    for index in np.ndindex(p.shape):
        numbers = samples[index][~np.isnan(samples[index])]
        if numbers.size:
            with np.errstate(invalid="ignore"):  # the sum of opposite infinities is not above 0
                above = numbers[:, None] + numbers > 0.0  # each pair i < j twice
            rank_sum = int(above.sum() + above.trace()) // 2
            p[index] = _tail(numbers.size, rank_sum)
    return p


def interval(differences: ArrayLike, error: float) -> tuple[float, float, float]:
    """Return the centre of differences (n,), NaN for none, and the ends of its interval.

    The true centre lies beyond each end with probability `error`. Ends are infinite if the sample
    is too small.
    """
    numbers = _finite(differences)
    if not numbers.size:
        return math.nan, math.nan, math.nan
    i, j = np.triu_indices(numbers.size)
    low, high = _ends(numbers[None], error)
    sums = numbers[i] + numbers[j]
    centre = float(np.median(sums)) / 2
    return centre, float(low[0]), float(high[0])


def _finite(differences: ArrayLike) -> np.ndarray:
    """Return the differences that are known, with finite numbers in place of infinite ones."""
    numbers = np.asarray(differences, float)
    return np.clip(numbers[~np.isnan(numbers)], -MAX_LOG, MAX_LOG)


def _ends(samples: np.ndarray, error: float) -> np.ndarray:
    """Return the ends of the intervals of samples (m, n), as (2, m); infinite if n is too small."""
    i, j = np.triu_indices(samples.shape[1])
    rank_sums = np.arange(i.size + 1)
    tails = _tail(samples.shape[1], rank_sums)
    enough = np.flatnonzero(tails <= error)
    if not enough.size:
        ends = np.array([[-math.inf], [math.inf]])
        return ends.repeat(len(samples), axis=1)
    ranks = i.size - enough[0], enough[0] - 1
    pairs = samples[:, i] + samples[:, j]
    sums = np.partition(pairs, ranks, axis=1)
    return sums[:, ranks].T / 2


def min_p(n: ArrayLike) -> np.ndarray:
    """Return the smallest one-sided p-value that n differences can have."""
    return 0.5 ** np.asarray(n, float)


def _tail(n: int, sums: int | np.ndarray) -> np.ndarray:
    """Return the probability that random signs of the ranks 1 to n give a sum at least as large as
    these.
    """
    if n <= MAX_EXACT:
        return _distribution(n)[sums]
    from scipy.special import ndtr

    mean = n * (n + 1) / 4
    variance = n * (n + 1) * (2 * n + 1) / 6
    deviation = math.sqrt(variance) / 2
    return ndtr((mean - sums + 0.5) / deviation)


@functools.cache
def _distribution(n: int) -> np.ndarray:
    """Return the probability of a sum of the ranks 1 to n of at least 0, 1, ..., if signs are
    random.
    """
    share = np.zeros(n * (n + 1) // 2 + 1)
    share[0] = 1.0
    for rank in range(1, n + 1):
        share[rank:] += share[: share.size - rank].copy()
        share /= 2
    return np.cumsum(share[::-1])[::-1]


def units_needed(leads: ArrayLike, error: float, relevant: float) -> float:
    """Return the number of units with which the test would see these leads with a probability of
    80 %, if more units are like them; inf if their centre is no more than what is relevant, or if
    more than MAX_UNITS are needed.

    It is that of a normal sample: pi / 3 times as many units as a t-test takes are enough for the
    signed ranks. The standard deviation is the median distance of two units over 0.954.

    Args:
      leads: d of the units, NaN for none, at least two.
      error: one-sided level of the test.
      relevant: r.
    """
    from scipy.special import stdtrit

    numbers = _finite(leads)
    i, j = np.triu_indices(numbers.size, 1)
    gaps = numbers[i] - numbers[j]
    spread = np.median(np.abs(gaps))
    deviation = float(spread) / MEDIAN_DISTANCE
    centre = interval(numbers, error)[0] + math.log1p(-relevant)
    if not centre > 0.0:
        return math.inf
    for n in range(max(2, math.ceil(-math.log2(error))), MAX_UNITS + 1):
        of_error = stdtrit(n - 1, 1.0 - error)
        deviations = float(of_error + stdtrit(n - 1, POWER))
        if n >= math.pi / 3.0 * (deviations * deviation / centre) ** 2:
            return n
    return math.inf


def least_visible_lead(leads: ArrayLike, error: float, relevant: float) -> float:
    """Return the least lead that the test sees with a probability of 80 %, as a share; 1 if it can
    see none.

    Let c be the n units' d about their centre, times sqrt(n / (n - 1)), and low and high the ends
    of the signed-rank interval of n draws from c, at `error`. The test sees a lead l of these draws
    if low + l > -log(1 - r). With Q the quantiles over 400 resamples,

        L = 1 - (1 - r) exp( -max(0, Q95[-low], Q50[high]) )

    Quantiles of 80 % of both see too little where the law has a long tail: with twelve units the
    tail is seldom in the sample. The seed of the resamples follows from the units, so that L is
    always the same.

    Args:
      leads: d of the units, NaN for none.
      error: one-sided level of the test.
      relevant: r.
    """
    numbers = _finite(leads)
    n = numbers.size
    if n < 2 or min_p(n) > error:
        return 1.0
    centre = interval(numbers, error)[0]
    scale = math.sqrt(n / (n - 1))
    centred = scale * (numbers - centre)
    digest = hashlib.sha256(numbers.tobytes()).digest()
    seed = int.from_bytes(digest[:8])
    drawn = np.random.default_rng(seed).integers(n, size=(LEAD_RESAMPLES, n))
    needed = []
    for indices in np.array_split(drawn, 1 + drawn.size * n // MAX_SUMS):
        low, high = _ends(centred[indices], error)
        needed.append([-low, high])
    own, mirrored = np.concatenate(needed, axis=1)
    own_size = np.quantile(own, OWN_SHARE)
    least = max(0.0, own_size, np.median(mirrored))
    return 1.0 - (1.0 - relevant) * math.exp(-least)
