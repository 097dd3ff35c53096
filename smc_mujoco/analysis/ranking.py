"""Comparison of laws on the runs that they share: which law is better in which block, and places over all blocks.

    comparison = compare({"classical": a, "adaptive": b})  # a, b: (blocks, seeds), lower is better
    comparison.best                                    # the laws of each block that no other is better than
    ranks(comparison)                                  # the laws' places over all blocks

As in `bootstrap`, seeds are the sample, blocks are fixed, and inf is the worst value, equal to itself. One law is
better than another in a block if three conditions hold.

- Its median is lower by more than the least relevant difference, see `differences`. Smaller differences are ties.
- It is ahead in more seeds, and the sign test over them rejects that both are ahead equally often (W. J. Conover,
  Practical Nonparametric Statistics, 1999, 3.4). The test is exact for any number of seeds and free of units. Its
  p-values are two-sided and corrected by S. Holm's method (Scandinavian Journal of Statistics 6(2), 1979) for all pairs
  of laws in all blocks: the probability that any law is wrongly called better, in any block, is at most 1 - level.
- There are at least 16 seeds. With fewer, hardly anything survives the correction.

A seed is a sample of two laws if it changes the result of one of them. If both have the same results as in an earlier
seed, the pair of runs is repeated: such seeds count once in the test and among the 16, whatever other laws do in them.

A law that no other is better than is among the best of its block; if it is the only one, it is the winner. "Better"
follows the medians, so every block has a best law, and a winner has the lowest median.

A law's rank in a block is that of its median; medians that differ by less than the least relevant difference are tied.
Its place follows from its mean rank over the blocks. So a law that wins in every block has the first place. Friedman's
test says whether the order would hold in other conditions.
"""

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smc_mujoco.analysis.bootstrap import RESAMPLES, confidence, counts, drawn_medians, draws, middle, outermost
from smc_mujoco.analysis.differences import exceeds, least_difference, worse
from smc_mujoco.common.errors import ScenarioError, shown

SEEDS = 16  # the fewest, of distinct runs, with which one law is called better than another


class Rank(NamedTuple):
    """A law's place among laws, 1 the best; ties share the mean of their places.

    Attributes:
      law: name of the law.
      mean: mean rank over the blocks.
      place: place by mean rank.
      median: median of the place over resamples of the seeds.
      low, high: interval of the place; NaN for a single seed.
      p: least corrected p-value with which another law is ahead of it in a block; 1 if none is.
      best: whether the law is among the best of every block.
    """

    law: str
    mean: float
    place: float
    median: float
    low: float
    high: float
    p: float
    best: bool


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Laws compared in blocks.

    Attributes:
      laws: names, in alphabetical order.
      cells: (laws, blocks, seeds), the scores; NaN where there is no run.
      shares: whether scores are 0.0 or 1.0, and means are compared instead of medians.
      floors: (blocks,), lower bound on the least relevant difference of medians.
      level: level of confidence.
      p: (blocks, laws, laws), corrected p-value of the sign test that a law is ahead of another; 1 where it is not.
      runs: (blocks, laws, laws), number of seeds that are samples of two laws.
    """

    laws: tuple[str, ...]
    cells: np.ndarray
    shares: bool
    floors: np.ndarray
    level: float
    p: np.ndarray
    runs: np.ndarray

    @functools.cached_property
    def centres(self) -> np.ndarray:
        """The medians, or means, over the seeds, (laws, blocks)."""
        return np.nanmean(self.cells, axis=2) if self.shares else middle(self.cells)

    @property
    def seeds(self) -> np.ndarray:
        """The number of seeds of each block, (blocks,)."""
        return (~np.isnan(self.cells[0])).sum(axis=1)

    @functools.cached_property
    def better(self) -> np.ndarray:
        """Whether a law is better than another, (blocks, laws, laws)."""
        own, rival = self.centres.T[:, :, None], self.centres.T[:, None, :]
        lower = exceeds(rival, own, resolution=self.floors[:, None, None])
        return lower & (self.p <= 1 - self.level) & (self.runs >= SEEDS)

    @functools.cached_property
    def tied(self) -> np.ndarray:
        """Whether two laws tie, (laws, laws).

        They do if neither is better in any block; in blocks with fewer than 16 seeds, if their medians do not differ
        relevantly.
        """
        own, rival = self.centres.T[:, :, None], self.centres.T[:, None, :]
        lower = exceeds(rival, own, resolution=self.floors[:, None, None])
        differs = np.any(np.where(self.runs < SEEDS, lower, self.better), axis=0)
        return ~np.logical_or(differs, differs.T)

    @property
    def best(self) -> list[tuple[str, ...]]:
        """The laws of each block that no other is better than."""
        return [tuple(np.array(self.laws)[~row].tolist()) for row in np.any(self.better, axis=1)]

    @property
    def pairs(self) -> int:
        """The number of comparisons for which the p-values are corrected."""
        return len(self.p) * math.comb(len(self.laws), 2)


def compare(
    scores: Mapping[str, ArrayLike],
    floors: ArrayLike = 0.0,
    shares: bool = False,
    level: float = 0.95,
    outcomes: Mapping[str, ArrayLike] | None = None,
) -> Comparison:
    """Compare every law with every other in every block.

    Args:
      scores: law -> (blocks, n) or (n,), lower is better, inf for never. NaN where no law has a run.
      floors: one for all blocks, or one for each, see `Comparison`.
      shares, level: see `Comparison`.
      outcomes: law -> a number per cell, equal if the law had the same result from two seeds. Default: all runs differ.

    Raises:
      ScenarioError: no laws, or laws with different cells.
    """
    laws, cells = _cells(scores)
    k, blocks, _ = cells.shape
    a, b = np.triu_indices(k, 1)
    ran = np.tile(~np.isnan(cells[0]), (len(a), 1, 1))  # (pairs, blocks, seeds)
    if outcomes is not None:
        did = np.array([np.atleast_2d(outcomes[law]) for law in laws])
        ran = np.array([first_of_kind(did[[i, j]], there) for i, j, there in zip(a, b, ran, strict=True)], bool)
        ran = ran.reshape(len(a), *cells.shape[1:])
    value, ahead = _sign_test(np.where(ran, worse(cells[a], cells[b]), 0))
    value = holm(value)
    p, runs = np.ones((blocks, k, k)), np.zeros((blocks, k, k), int)
    p[:, a, b], p[:, b, a] = np.where(ahead < 0, value, 1.0).T, np.where(ahead > 0, value, 1.0).T
    runs[:, a, b] = runs[:, b, a] = ran.sum(axis=2).T
    widths = np.broadcast_to(np.asarray(floors, float), blocks)
    return Comparison(laws=laws, cells=cells, shares=shares, floors=widths, level=confidence(level), p=p, runs=runs)


def _cells(scores: Mapping[str, ArrayLike]) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the laws by name and their scores, (laws, blocks, seeds). Raise ScenarioError if their cells differ."""
    laws = tuple(sorted(scores))
    each = [np.atleast_2d(np.asarray(scores[law], float)) for law in laws]
    if not each or not each[0].size or len({one.shape for one in each}) > 1:
        raise ScenarioError(f"scores of {shown(laws)} are not of the same cells: give each law (blocks, seeds)")
    cells = np.stack(each)
    missing = np.isnan(cells)
    if (missing != missing[0]).any() or missing[0].all(axis=0).any() or missing[0].all(axis=1).any():
        raise ScenarioError(f"scores of {shown(laws)} lack different cells, or a seed: give nan to all laws")
    return laws, cells


def first_of_kind(outcomes: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return which cells (blocks, seeds) exist and do not repeat the outcomes of an earlier cell of their block.

    Args:
      outcomes: (laws, blocks, seeds), a number for the result of each law.
      there: (blocks, seeds), which cells exist.
    """
    first = np.zeros(there.shape, bool)
    for block, own in enumerate(there):
        seeds = np.flatnonzero(own)
        first[block, seeds[np.unique(outcomes[:, block, seeds], axis=1, return_index=True)[1]]] = True
    return first


def _sign_test(signs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the two-sided p-values of signs along their last axis, and the signs that prevail."""
    from scipy.special import bdtr

    up, down = (signs > 0).sum(axis=-1), (signs < 0).sum(axis=-1)
    p = 2 * bdtr(np.minimum(up, down).astype(float), up + down, 0.5)
    return np.minimum(p, 1.0), np.sign(up - down)


def holm(p: np.ndarray) -> np.ndarray:
    """Return p-values, of any shape, corrected for their number by Holm's method."""
    order = np.argsort(p, axis=None)
    corrected = np.empty(p.size)
    corrected[order] = np.minimum(np.maximum.accumulate(p.flat[order] * np.arange(p.size, 0, -1)), 1.0)
    return corrected.reshape(p.shape)


def ranks(comparison: Comparison, resamples: int = RESAMPLES, seed: int = 0) -> list[Rank]:
    """Return the laws' ranks, lowest mean rank first."""
    n, k = comparison.cells.shape[2], len(comparison.laws)
    mean = block_ranks(comparison.centres[None], comparison.floors).mean(axis=2)
    place = _places(mean)[0]
    middles, low, high = place, np.full(k, math.nan), np.full(k, math.nan)
    if n > 1:
        drawn = block_ranks(_drawn_centres(comparison, draws(n, resamples, seed)), comparison.floors)
        places, at = np.sort(_places(drawn.mean(axis=2)), axis=0), outermost(n, comparison.level, resamples)
        middles, low, high = np.median(places, axis=0), places[at - 1], places[resamples - at]
    numbers = np.column_stack([mean[0], place, middles, low, high, comparison.p.min(axis=(0, 1))]).tolist()
    best = (~np.any(comparison.better, axis=(0, 1))).tolist()
    rows = [Rank(law, *row, best=one) for law, row, one in zip(comparison.laws, numbers, best, strict=True)]
    return sorted(rows, key=lambda rank: rank.mean)


def _drawn_centres(comparison: Comparison, drawn: np.ndarray) -> np.ndarray:
    """Return the centres of resamples, (resamples, laws, blocks)."""
    if not comparison.shares:
        return np.stack([sum(drawn_medians(own, drawn)) / 2 for own in comparison.cells], axis=1)
    means = []
    for block in comparison.cells.swapaxes(0, 1):
        runs = np.flatnonzero(~np.isnan(block[0]))
        count = counts(drawn, runs)
        means.append(block[:, runs] @ count / count.sum(axis=0))
    return np.stack(means).transpose(2, 1, 0)


def block_ranks(centres: np.ndarray, floors: np.ndarray) -> np.ndarray:
    """Return the laws' ranks in each block, (..., laws, blocks) as the centres."""
    lowered, twice = centres - least_difference(centres, resolution=floors), np.zeros(centres.shape, np.int16)
    for rival in range(centres.shape[-2]):
        own = slice(rival, rival + 1)
        twice += (lowered > centres[..., own, :]).view(np.int8)
        twice -= (lowered[..., own, :] > centres).view(np.int8)
    return (centres.shape[-2] + 1 + twice) / 2


def _places(mean: np.ndarray) -> np.ndarray:
    """Return the places by mean rank, (draws, laws); ties share theirs."""
    return (mean.shape[1] + 1 + worse(mean[:, :, None], mean[:, None, :]).sum(axis=2)) / 2


@dataclasses.dataclass(frozen=True, kw_only=True)
class Friedman:
    """M. Friedman's test that laws rank alike, with P. Nemenyi's critical difference (J. Demsar, JMLR 7(1), 2006).

    Here the sample is the blocks, not the seeds: would the order hold in other conditions? Demsar considers the chi^2
    distribution accurate from about ten blocks on.

    Attributes:
      blocks: number of blocks.
      mean_ranks: law -> mean rank over the blocks, where ranks follow from medians over the seeds.
      p: probability that laws which rank alike differ by this much.
      critical_difference: difference of mean ranks; laws that differ by less cannot be distinguished.
    """

    blocks: int
    mean_ranks: dict[str, float]
    p: float
    critical_difference: float


def friedman(comparison: Comparison) -> Friedman | None:
    """Run Friedman's test over the blocks, corrected for ties; None for one law or one block."""
    from scipy.special import chdtrc

    k, blocks = comparison.centres.shape
    if k < 2 or blocks < 2:
        return None
    place = block_ranks(comparison.centres, comparison.floors)
    spread = float(((place - (k + 1) / 2) ** 2).sum())
    between = float(((place.sum(axis=1) - blocks * (k + 1) / 2) ** 2).sum())
    return Friedman(
        blocks=blocks,
        mean_ranks=dict(zip(comparison.laws, place.mean(axis=1).tolist(), strict=True)),
        p=float(chdtrc(k - 1, (k - 1) * between / spread)) if spread else 1.0,
        critical_difference=_studentised(k, comparison.level) * math.sqrt(k * (k + 1) / (12 * blocks)),
    )


@functools.cache
def _studentised(k: int, level: float) -> float:
    """Return the quantile of the studentised range of k normal means; Demsar's q is 1 / sqrt(2) of it."""
    from scipy.stats import studentized_range

    return float(studentized_range.ppf(level, k, math.inf))
