"""Laws ranked on the runs that they share, and which of them may be the best.

    ranks({"classical": a, "adaptive": b})             # a, b: (blocks, seeds), lower is better

As in `statistics`, seeds are the sample and inf is worst, two of them tied. Ranks compare runs of one cell, the same
block and seed, and are free of units. That a law is better than another means here: in more cells, as the sign test
has it. Mean ranks order the laws, but do not decide between them, for a third law can turn the order of two
(A. Benavoli, G. Corani, F. Mangili, JMLR 17(5), 2016); the test of `ranks` does.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Mapping

import numpy as np

from smc_mujoco.errors import ScenarioError, shown
from smc_mujoco.statistics import RESAMPLES, checked, draws, median, outermost

# In SI units, and relative: runs that differ by less are tied, for how they are integrated decides about it.
ROUNDING, ALIKE = 1e-9, 1e-6
EXACT = 10  # seeds up to which all flips of signs are tried


@dataclasses.dataclass(frozen=True, kw_only=True)
class Rank:
    """A law's place among laws, 1 the best; ties share the mean of their places.

    Attributes:
      law: its name.
      mean: its mean rank over blocks and seeds.
      median: of its place by mean rank, over draws of the seeds.
      low: of the interval of that place; NaN for a single seed.
      high: likewise.
      p: of the test that no law is better than this one.
      best: whether it may be the best: the test does not reject that.
    """

    law: str
    mean: float
    median: float
    low: float
    high: float
    p: float
    best: bool


@dataclasses.dataclass(frozen=True, kw_only=True)
class Friedman:
    """M. Friedman's test that laws rank alike, with P. Nemenyi's critical difference (J. Demsar, JMLR 7(1), 2006).

    Here the blocks are the sample, not the seeds: would the order hold in other conditions? Demsar trusts the chi^2
    distribution from about ten blocks on.

    Attributes:
      blocks: how many.
      mean_ranks: law -> mean rank over the blocks, in each by its median over the seeds.
      p: that laws which rank alike differ by so much.
      critical_difference: of mean ranks; laws that differ by less are not told apart.
    """

    blocks: int
    mean_ranks: dict[str, float]
    p: float
    critical_difference: float


def ranks(
    scores: Mapping[str, np.ndarray], level: float = 0.95, resamples: int = RESAMPLES, seed: int = 0
) -> list[Rank]:
    """The laws' places, lowest mean rank first.

    A law is not among the best if a test rejects that no law is better. The test flips the signs of whole seeds
    (R. A. Fisher, The Design of Experiments, 1935, 21). Its statistic is, of the law that it loses to most (P. H.
    Westfall, S. S. Young, Resampling-Based Multiple Testing, 1993), in how much more of a seed's cells it loses than
    wins, summed over the seeds, over the root of the sum of squares. Each law is tested at (1 - level) / 2. Of m >= 2
    laws that are equally good, then, one is left as the winner with a probability of m / (2 (m - 1)) (1 - level) at
    most, by Markov's inequality for how many are rejected; "equally good" is that in a seed they could change places.
    At 95 % it takes six seeds to reject a law, and seven to reject one that in turn beats another in all of them.

    Args:
      scores: law -> (blocks, n) or (n,), lower is better, inf for never; NaN, in all laws, where no run is.

    Raises:
      ScenarioError: no laws, or not of the same cells.
    """
    laws, cells = _cells(scores)
    lost = duels(cells)
    n, k = lost.shape[:2]
    mean = _mean_ranks(lost.mean(axis=0))
    middle, low, high = _places(mean[None])[0], np.full(k, np.nan), np.full(k, np.nan)
    if n > 1:
        drawn = _product(draws(n, resamples, seed), lost.reshape(n, k * k) / n).reshape(-1, k, k)
        places = np.sort(_places(_mean_ranks(drawn)), axis=0)
        at = outermost(n, level, resamples)
        middle, low, high = np.median(places, axis=0), places[at - 1], places[resamples - at]
    columns = (mean, middle, low, high, beaten(lost, seed))
    found = [
        Rank(law=law, mean=m, median=middle, low=low, high=high, p=p, best=p > (1 - checked(level)) / 2)
        for law, m, middle, low, high, p in zip(laws, *(c.tolist() for c in columns), strict=True)
    ]
    return sorted(found, key=lambda rank: rank.mean)


def _cells(scores: Mapping[str, np.ndarray]) -> tuple[list[str], np.ndarray]:
    """The laws by name, and their scores (laws, blocks, seeds), if all have the same cells."""
    laws = sorted(scores)
    given = [np.atleast_2d(np.asarray(scores[law], float)) for law in laws]
    if not given or not given[0].size or len({g.shape for g in given}) > 1:
        raise ScenarioError(f"scores of {shown(laws)} are not of the same cells: give each law (blocks, seeds)")
    cells = np.stack(given)
    missing = np.isnan(cells)
    if (missing != missing[0]).any() or missing[0].all(axis=0).any():
        raise ScenarioError(f"scores of {shown(laws)} lack different cells, or a seed: give nan to all laws alike")
    return laws, cells


def worse(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """1.0 where a is more than b, -1.0 where less, 0.0 where they are tied; NaN where both are."""
    tie = np.maximum(ROUNDING, ALIKE * np.minimum(np.abs(a), np.abs(b)))
    return np.where(np.isnan(a), np.nan, (a > b + tie).astype(float) - (b > a + tie))


def duels(cells: np.ndarray) -> np.ndarray:
    """In how much more of a seed's cells one law is worse than another than better, (seeds, laws, laws), -1 to 1.

    Args:
      cells: (laws, blocks, seeds); NaN in all laws where no run is.
    """
    k, _, n = cells.shape
    found = np.zeros((n, k, k))
    for a, b in itertools.combinations(range(k), 2):
        found[:, a, b] = np.nanmean(worse(cells[a], cells[b]), axis=0)
        found[:, b, a] = -found[:, a, b]
    return found


@functools.lru_cache(maxsize=8)
def flips(n: int, seed: int) -> np.ndarray:
    """Signs of n seeds, (flips, n): all that there are, or many; the first as it was, for that is one of them too."""
    if n <= EXACT:
        return np.array(list(itertools.product((1.0, -1.0), repeat=n)))
    found = np.random.default_rng(seed).choice((1.0, -1.0), size=(RESAMPLES + 1, n))
    found[0] = 1.0
    return found


def beaten(lost: np.ndarray, seed: int = 0) -> np.ndarray:
    """From `duels`, each law's p-value of the test of `ranks`; with up to ten seeds it is exact."""
    n, k = lost.shape[:2]
    size = np.sqrt((lost**2).sum(axis=0))  # which no flip changes; without it a law that is always last hides others
    scaled = (lost / np.where(size, size, 1.0)).reshape(n, k * k)
    most = _product(flips(n, seed), scaled).reshape(-1, k, k).max(axis=2)
    return (most >= most[0] - ROUNDING).mean(axis=0)


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a @ b, without the threads of BLAS: they take longer here, where others are at work, and may round otherwise."""
    return np.einsum("ij,jk->ik", a, b)


def _mean_ranks(lost: np.ndarray) -> np.ndarray:
    """(..., laws) from duels (..., laws, laws): every law is half a place, up or down."""
    return (lost.shape[-1] + 1 + lost.sum(axis=-1)) / 2


def _places(mean: np.ndarray) -> np.ndarray:
    """Places by mean rank, (draws, laws); ties share theirs."""
    further = mean[:, :, None] - mean[:, None, :]
    return _mean_ranks(np.sign(np.where(np.abs(further) < ROUNDING, 0.0, further)))


def friedman(scores: Mapping[str, np.ndarray], level: float = 0.95) -> Friedman | None:
    """Friedman's test over the blocks of scores as `ranks` takes them, corrected for ties; None of one law or block."""
    from scipy.special import chdtrc

    laws, cells = _cells(scores)
    medians = np.array([[median(block) for block in law if not np.isnan(block).all()] for law in cells])
    k, blocks = medians.shape
    if k < 2 or blocks < 2:
        return None
    place = _mean_ranks(duels(medians[:, None]))
    spread = float(((place - (k + 1) / 2) ** 2).sum())
    between = float(((place.sum(axis=0) - blocks * (k + 1) / 2) ** 2).sum())
    return Friedman(
        blocks=blocks,
        mean_ranks=dict(zip(laws, place.mean(axis=0).tolist(), strict=True)),
        p=float(chdtrc(k - 1, (k - 1) * between / spread)) if spread else 1.0,
        critical_difference=_studentised(k, checked(level)) * math.sqrt(k * (k + 1) / (12 * blocks)),
    )


@functools.cache
def _studentised(k: int, level: float) -> float:
    """The quantile of the studentised range of k normal means, of which Demsar's q is 1 / sqrt(2)."""
    from scipy.stats import studentized_range

    return float(studentized_range.ppf(level, k, math.inf))
