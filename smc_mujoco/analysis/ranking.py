"""Laws compared on the runs that they share: which is better in which block, and their places over all blocks.

    found = compare({"classical": a, "adaptive": b})   # a, b: (blocks, seeds), lower is better
    found.best                                         # of each block the laws that none is better than
    ranks(found)                                       # the laws' places over all blocks

As in `statistics`, seeds are the sample, blocks are fixed, and inf is worst, two of them tied. One law is better than
another in a block if three things hold.

- Its median is lower by more than the least relevant difference, see `differences`. Smaller ones are ties.
- It is ahead in more seeds, and the sign test over them rejects that both are ahead equally often (W. J. Conover,
  Practical Nonparametric Statistics, 1999, 3.4). The test is exact for any number of seeds and free of units. Its
  p-values are two-sided and corrected by S. Holm's method (Scandinavian Journal of Statistics 6(2), 1979) for all pairs
  of laws in all blocks: the probability that any law is wrongly called better, in any block, is at most 1 - level.
- There are at least 16 seeds. With fewer, hardly anything survives the correction.

A seed is a sample of two laws if it changes one of the two. Seeds in which both do what they did together in an earlier
one are that one run over again: they count once in the test and among the 16, whatever other laws do in them.

A law that no other is better than is among the best of its block; where it alone is, it is the winner there. "Better"
follows the medians, so every block has a best law, and a winner has the lowest median.

A law's rank in a block is that of its median; medians that differ by less than the least relevant difference are tied.
Its place is by its mean rank over the blocks. Hence a law that wins in every block has the first place.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from smc_mujoco.analysis.bootstrap import RESAMPLES, checked, counts, drawn_medians, draws, middle, outermost
from smc_mujoco.analysis.differences import exceeds, least_difference, worse
from smc_mujoco.common.errors import ScenarioError, shown

SEEDS = 16  # the fewest, of distinct runs, with which one law is called better than another


@dataclasses.dataclass(frozen=True, kw_only=True)
class Rank:
    """A law's place among laws, 1 the best; ties share the mean of their places.

    Attributes:
      law: its name.
      mean: its mean rank over the blocks.
      place: by mean rank.
      median: of that place over draws of the seeds.
      low: of its interval; NaN for a single seed.
      high: likewise.
      p: the least corrected p-value with which another law is ahead of it in a block; 1 if none is.
      best: whether it is among the best of every block.
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
      laws: by name.
      cells: (laws, blocks, seeds), their scores; NaN where no run is.
      shares: whether scores are 0.0 or 1.0, and means are compared in place of medians.
      floors: (blocks,), the least difference of medians that is relevant whatever they are.
      level: of confidence.
      p: (blocks, laws, laws), of the sign test, corrected, that a law is ahead of another; 1 where it is not.
      runs: (blocks, laws, laws), in how many seeds two laws did not do what both did in an earlier one.
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

    @property
    def best(self) -> list[tuple[str, ...]]:
        """The laws of each block that no other is better than."""
        return [tuple(np.array(self.laws)[~row].tolist()) for row in np.any(self.better, axis=1)]

    @property
    def pairs(self) -> int:
        """The number of comparisons that the p-values are corrected for."""
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
      scores: law -> (blocks, n) or (n,), lower is better, inf for never; NaN, in all laws, where no run is.
      floors: one for all blocks, or one for each, see `Comparison`.
      outcomes: law -> a number a cell, equal where the law did the same from two seeds. Default: all runs differ.

    Raises:
      ScenarioError: no laws, or not of the same cells.
    """
    laws, cells = _cells(scores)
    k, blocks, _ = cells.shape
    pairs = np.array([*itertools.combinations(range(k), 2)], int).reshape(-1, 2)
    p, p_of = np.ones((blocks, k, k)), np.ones((blocks, len(pairs)))
    ran = np.tile(~np.isnan(cells[0]), (len(pairs), 1, 1))
    if outcomes is not None:
        did = [np.atleast_2d(outcomes[law]) for law in laws]
        ran &= np.array([_distinct(did[a], did[b], ran[0]) for a, b in pairs], bool).reshape(ran.shape)
    tested = [_sign_test(np.where(own, worse(cells[a], cells[b]), 0)) for (a, b), own in zip(pairs, ran, strict=True)]
    runs = np.zeros((blocks, k, k), int)
    for (a, b), own in zip(pairs, ran, strict=True):
        runs[:, a, b] = runs[:, b, a] = own.sum(axis=1)
    for j, (value, _) in enumerate(tested):
        p_of[:, j] = value
    for (a, b), (_, ahead), value in zip(pairs, tested, holm(p_of).T, strict=True):
        p[:, a, b], p[:, b, a] = np.where(ahead < 0, value, 1.0), np.where(ahead > 0, value, 1.0)
    widths = np.broadcast_to(np.asarray(floors, float), blocks)
    return Comparison(laws=laws, cells=cells, shares=shares, floors=widths, level=checked(level), p=p, runs=runs)


def _cells(scores: Mapping[str, ArrayLike]) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the laws by name and their scores (laws, blocks, seeds), if all laws have the same cells."""
    laws = tuple(sorted(scores))
    given = [np.atleast_2d(np.asarray(scores[law], float)) for law in laws]
    if not given or not given[0].size or len({g.shape for g in given}) > 1:
        raise ScenarioError(f"scores of {shown(laws)} are not of the same cells: give each law (blocks, seeds)")
    cells = np.stack(given)
    missing = np.isnan(cells)
    if (missing != missing[0]).any() or missing[0].all(axis=0).any() or missing[0].all(axis=1).any():
        raise ScenarioError(f"scores of {shown(laws)} lack different cells, or a seed: give nan to all laws alike")
    return laws, cells


def _distinct(one: np.ndarray, other: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Where, of cells that are there, two laws' outcomes are not both those of an earlier seed; (blocks, seeds)."""
    found = np.zeros(there.shape, bool)
    for k, own in enumerate(there):
        seeds = np.flatnonzero(own)
        both = np.stack([one[k, seeds], other[k, seeds]])
        found[k, seeds[np.unique(both, axis=1, return_index=True)[1]]] = True
    return found


def _sign_test(signs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the two-sided p-value of each block of signs (blocks, n), and the sign that prevails."""
    from scipy.special import bdtr

    up, down = (signs > 0).sum(axis=1), (signs < 0).sum(axis=1)
    p = 2 * bdtr(np.minimum(up, down).astype(float), up + down, 0.5)
    return np.minimum(p, 1.0), np.sign(up - down)


def holm(p: np.ndarray) -> np.ndarray:
    """Correct p-values, in any shape, for their number."""
    order = np.argsort(p, axis=None)
    found = np.empty(p.size)
    found[order] = np.minimum(np.maximum.accumulate(p.flat[order] * np.arange(p.size, 0, -1)), 1.0)
    return found.reshape(p.shape)


def ranks(found: Comparison, resamples: int = RESAMPLES, seed: int = 0) -> list[Rank]:
    """Return the laws' ranks, lowest mean rank first."""
    n, k = found.cells.shape[2], len(found.laws)
    mean = block_ranks(found.centres[None], found.floors).mean(axis=2)
    place = _places(mean)[0]
    middles, low, high = place, np.full(k, math.nan), np.full(k, math.nan)
    if n > 1:
        drawn = block_ranks(_drawn_centres(found, draws(n, resamples, seed)), found.floors)
        places, at = np.sort(_places(drawn.mean(axis=2)), axis=0), outermost(n, found.level, resamples)
        middles, low, high = np.median(places, axis=0), places[at - 1], places[resamples - at]
    p, best = found.p.min(axis=(0, 1)), ~np.any(found.better, axis=(0, 1))
    rows = [
        Rank(
            law=law,
            mean=float(mean[0, i]),
            place=float(place[i]),
            median=float(middles[i]),
            low=float(low[i]),
            high=float(high[i]),
            p=float(p[i]),
            best=bool(best[i]),
        )
        for i, law in enumerate(found.laws)
    ]
    return sorted(rows, key=lambda rank: rank.mean)


def _drawn_centres(found: Comparison, drawn: np.ndarray) -> np.ndarray:
    """Return the centres of resamples, (resamples, laws, blocks)."""
    if not found.shares:
        return np.stack([sum(drawn_medians(own, drawn)) / 2 for own in found.cells], axis=1)
    means = []
    for block in found.cells.swapaxes(0, 1):
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
