"""Comparison of laws on the runs that they share: which law is better in which block, and places over all blocks.

Blocks and samples are as in `bootstrap`. For two laws, runs that are linked by a shared set of gains of either law are
one sample, whose difference is the median of theirs. A run that repeats the results of both laws is not counted.

The test. The difference of two laws in a sample is the logarithm of the ratio of their values. For shares, and where
3 % of a value is less than what matters (see `paired_runs.floor`), it is the difference of the values. A law is better
than another if Wilcoxon's signed-rank test rejects that its values are lower by the least relevant difference or less:
the interval of the ratio lies beyond that difference. Besides, its median must not be the higher one, and it must not
fail more often.

The test (F. Wilcoxon, Biometrics Bulletin 1(6), 1945) is exact if differences are symmetric about their centre, as
those of two equal laws are, whatever the distribution. The estimate is the median of the means of all pairs of
differences (J. L. Hodges, E. L. Lehmann, Annals of Mathematical Statistics 34(2), 1963). The interval has the centres
that the test does not reject. Simulation of 24 pairs chose this test among three: the sign test has too little
power, and Student's t is wrong in 16 % of samples in place of 2.5 % where the differences have a long tail to the left
(the signed ranks in 4 %), and cannot take an infinite value.

The correction. There are two families, over all blocks of a metric in a table, however the table is grouped into
boards. Both are corrected by S. Holm's method (Scandinavian Journal of Statistics 6(2), 1979), with two-sided p-values.

- Winners. The winner of a block is better than every other law. Its p-value is the largest of those against the others,
  and needs no correction for their number (S. Gutmann, Z. Maymin, Annals of Statistics 15(1), 1987): the error is
  largest where two laws are equal and the others far behind. So the family is the blocks. The probability of any wrong
  winner is at most 5 %.
- Pairs. The family is all pairs of laws in all blocks. The probability that any law is wrongly called better than
  another is at most 5 %, in addition to that of a wrong winner.

A block without a test has one value of each law, which is no sample. There a law is better if its value is lower by
more than the least relevant difference. The block belongs to neither family. A law with a run that failed, or has no
value, wins nothing. In every order the laws with fewer such runs come first.

A law is among the best if no other is better. One exception: where another law's median is relevantly lower, and two
laws have too few samples for any verdict, the law is undecided, and not among the best.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smc_mujoco.analysis.bootstrap import LEVEL, middle
from smc_mujoco.common.errors import number

MAX_EXACT = 60  # samples; with more the normal approximation of the rank sum is used
RELEVANT = 0.03  # default share of the larger value that is relevant; chosen
ROUNDING = 1e-9  # in SI units: smaller differences are a tie, because they depend on how runs are integrated


class Rank(NamedTuple):
    """A law's place among laws, 1 the best; ties share the mean of their places."""

    law: str  # its name
    mean: float  # mean rank over the blocks, which orders laws and decides nothing
    place: float  # by the number of runs without a value, then by mean rank
    best: bool  # whether the law is among the best of every block


class Effect(NamedTuple):
    """How a law's values compare with a rival's, in one block."""

    value: float  # ratio of the law's values to the rival's, or their difference if not `relative`
    low: float  # of its interval, at the level that the correction leaves for one comparison
    high: float
    relative: bool
    ahead: int  # number of samples in which the law is better by more than the least relevant difference
    samples: int
    sets: bool  # whether the samples are sets of gains; otherwise they are seeds


class Limits(NamedTuple):
    """The largest one-sided p-values with which a law is better than another, and with which it wins a block."""

    pair: float
    winner: float


class Comparison:
    """Every law compared with every other in every block.

    Scores are law -> (blocks, n) or (n,), lower is better, inf for never, NaN where no law has a run. If they are
    `shares`, 0.0 or 1.0, means are compared instead of medians. Floors are lower bounds on the least relevant
    difference, and `untested` says whether a value is no sample, such as a worst case: one for all blocks, or one for
    each. Outcomes and sets are law -> a number per cell, equal if two seeds gave the same result, or had the same
    gains; default: all results differ, and all gains are the same. Limits are given where the blocks belong to a larger
    family.
    """

    def __init__(
        self,
        scores: Mapping[str, ArrayLike],
        floors: ArrayLike = 0.0,
        shares: bool = False,
        outcomes: Mapping[str, ArrayLike] | None = None,
        sets: Mapping[str, ArrayLike] | None = None,
        relevant: float = RELEVANT,
        limits: Limits | None = None,
        untested: ArrayLike = False,
    ):
        def stacked(by_law: Mapping[str, ArrayLike], kind: type) -> np.ndarray:
            return np.array([np.atleast_2d(by_law[law]) for law in self.laws]).astype(kind)

        self.laws, self.shares, self.relevant = tuple(sorted(scores)), shares, checked_share(relevant)
        self.cells = cells = stacked(scores, float)  # (laws, blocks, seeds)
        blocks = range(cells.shape[1])
        self.floors = np.broadcast_to(np.asarray(floors, float), len(blocks))
        self.untested = np.broadcast_to(np.asarray(untested, bool), len(blocks))
        gains = np.zeros(cells.shape, np.int64) if sets is None else stacked(sets, np.int64)
        results = None if outcomes is None else stacked(outcomes, np.int64)
        ran = ~np.isnan(cells[0])
        # (laws, blocks), number of sets of gains of a law's runs
        self.sets = np.array([[np.unique(of_law[k, ran[k]]).size for k in blocks] for of_law in gains])
        # (blocks, laws, laws), whether differences are logarithms of ratios: if the relevant shares exceed the floor
        large = middle(cells).T * (self.relevant or RELEVANT) >= np.maximum(self.floors, ROUNDING)[:, None]
        large &= ~np.any(cells < 0, axis=2).T
        self.relative = large[:, :, None] & large[:, None, :] & (not shares)
        # (blocks, laws, laws, seeds), second law's value minus the first's by sample, then NaN
        of_block = [None] * len(blocks) if results is None else results.swapaxes(0, 1)
        self.differences = np.stack(
            [_differences(cells[:, k], self.relative[k], of_block[k], gains[:, k]) for k in blocks]
        )
        # (blocks, laws, laws), the least relevant difference of a law that is better than another
        absolute = least_difference(self.centres.T[:, None, :], self.floors[:, None, None], self.relevant)
        absolute = self.relevant if shares else absolute
        self.shifts = np.where(self.relative, -math.log1p(-self.relevant), absolute)
        # (blocks, laws, laws), one-sided p-value, not corrected, that a law is better; 1 of itself; 0 or 1 if untested
        beyond = self.differences - self.shifts[..., None]
        self.p = np.where(self.untested[:, None, None], 1.0 - np.any(beyond > 0.0, axis=3), p_values(beyond))
        self.p[:, *np.diag_indices(len(self.laws))] = 1.0
        self.limits = limits or corrected_limits([self])  # of the p-values, after the correction

    @functools.cached_property
    def centres(self) -> np.ndarray:
        """The medians, or means, over the seeds, (laws, blocks)."""
        return np.nanmean(self.cells, axis=2) if self.shares else middle(self.cells)

    @functools.cached_property
    def without_value(self) -> np.ndarray:
        """The number of runs that failed or have no value, (laws, blocks); 0 for shares."""
        return np.isinf(self.cells).sum(axis=2)

    @property
    def seeds(self) -> np.ndarray:
        """The number of seeds of each block, (blocks,)."""
        return (~np.isnan(self.cells[0])).sum(axis=1)

    @functools.cached_property
    def samples(self) -> np.ndarray:
        """The number of samples of two laws, (blocks, laws, laws)."""
        return (~np.isnan(self.differences)).sum(axis=3)

    @functools.cached_property
    def _eligible(self) -> np.ndarray:
        """Whether a law has no higher median than another, and no more runs without a value, (blocks, laws, laws)."""
        centre, lacking = self.centres.T, self.without_value.T
        lower = centre[:, :, None] <= centre[:, None, :]
        return lower & (lacking[:, :, None] <= lacking[:, None, :])

    @functools.cached_property
    def _relevantly_lower(self) -> np.ndarray:
        """Whether the median of a law is lower than another's by what is relevant, (blocks, laws, laws)."""
        lowered = self.centres - least_difference(self.centres, self.floors, self.relevant)
        return lowered.T[:, None, :] > self.centres.T[:, :, None]

    @functools.cached_property
    def winners(self) -> list[str | None]:
        """The law of each block that is better than every other, if there is one."""
        winners = []
        for p, eligible, lacking in zip(self.p, self._eligible, self.without_value.T, strict=True):
            wins = np.all((p <= self.limits.winner) & eligible | np.eye(len(p), dtype=bool), axis=1) & (lacking == 0)
            winners.append(self.laws[int(wins.argmax())] if wins.any() and len(p) > 1 else None)
        return winners

    @functools.cached_property
    def better(self) -> np.ndarray:
        """Whether a law is better than another, (blocks, laws, laws)."""
        better = (self.p <= self.limits.pair) & self._eligible
        for block, winner in zip(better, self.winners, strict=True):
            if winner is not None:
                at = self.laws.index(winner)
                block[at], block[:, at] = True, False
                block[at, at] = False
        return better

    @functools.cached_property
    def beaten(self) -> np.ndarray:
        """Whether another law is better, or a run of the law failed or has no value, (laws, blocks)."""
        lacking = self.without_value > 0
        return np.any(self.better, axis=1).T | lacking

    @functools.cached_property
    def tied(self) -> np.ndarray:
        """Whether neither law is better, fails less often or has a relevantly lower median in a block, (laws, laws)."""
        lacking = self.without_value.T
        fails_less = lacking[:, :, None] < lacking[:, None, :]
        differs = np.any(self._relevantly_lower | self.better | fails_less, axis=0)
        return ~np.logical_or(differs, differs.T)

    @functools.cached_property
    def undecided(self) -> np.ndarray:
        """Whether only a lack of samples keeps a law from being beaten, (laws, blocks); False in `untested` blocks."""
        few = np.vectorize(min_p)(self.samples) > self.limits.pair
        few[self.untested] = False
        return np.any(self._relevantly_lower & self._eligible & few, axis=1).T & ~self.beaten

    @property
    def best(self) -> list[tuple[str, ...]]:
        """The laws of each block that are not beaten, with enough samples to tell."""
        return [tuple(np.array(self.laws)[row].tolist()) for row in ~(self.beaten | self.undecided).T]

    def effect(self, block: int, law: str, rival: str, winner: bool = True) -> Effect:
        """Return how a law compares with a rival in a block, at the level of a winner's comparison or of any pair's."""
        a, b = self.laws.index(law), self.laws.index(rival)
        differences, relative = self.differences[block, a, b], bool(self.relative[block, a, b])
        shift = interval(-differences, self.limits.winner if winner else self.limits.pair)
        with np.errstate(over="ignore"):
            ends = np.exp(shift) if relative else np.array(shift)
        return Effect(
            *ends.tolist(),
            relative=relative,
            ahead=int((differences > self.shifts[block, a, b]).sum()),
            samples=int(self.samples[block, a, b]),
            sets=bool(self.sets[[a, b], block].max() > 1),
        )


def _differences(cells: np.ndarray, relative: np.ndarray, results: np.ndarray | None, sets: np.ndarray) -> np.ndarray:
    """Return `Comparison.differences` of one block, (laws, laws, seeds); cells, sets and results are (laws, seeds)."""
    k, ran = len(cells), ~np.isnan(cells[:1])
    differences = np.full((k, *cells.shape), math.nan)
    for a in range(k - 1):
        pairs = _pairwise(cells[a], cells[a + 1 :], relative[a, a + 1 :])
        for b, row in enumerate(pairs, a + 1):
            if results is not None:
                row[~first_of_kind(results[[a, b]][:, None], ran)[0]] = math.nan
            row[:] = _by_sample(row, sets[a], sets[b])
        differences[a, a + 1 :], differences[a + 1 :, a] = pairs, -pairs
    return differences


def _pairwise(law: np.ndarray, rivals: np.ndarray, relative: np.ndarray) -> np.ndarray:
    """Return by how much rivals' values (rivals, seeds) are higher than a law's (seeds,); 0 if both are inf."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios = np.log(np.abs(rivals)) - np.log(np.abs(law))
        differences = np.where(relative[:, None], ratios, rivals - law)
    equal = (rivals == law) | (np.isinf(rivals) & np.isinf(law))
    return np.where(equal, 0.0, differences)


def _by_sample(differences: np.ndarray, sets: np.ndarray, rival_sets: np.ndarray) -> np.ndarray:
    """Return the median difference of each sample, then NaN: runs linked by a set of gains are one sample."""
    runs = np.flatnonzero(~np.isnan(differences))
    labels = linked(sets[runs], rival_sets[runs])
    if labels is None:
        return differences
    centres = np.full(differences.shape, math.nan)
    for sample in range(max(labels) + 1):
        ordered = np.sort(differences[runs[np.array(labels) == sample]])
        low, high = ordered[(ordered.size - 1) // 2], ordered[ordered.size // 2]
        centres[sample] = 0.0 if low == -high else (low + high) / 2  # also of two opposite infinite values
    return centres


def linked(*sets: np.ndarray) -> tuple[int, ...] | None:
    """Return a number for each run, the same for runs that share a set of gains, directly or through others.

    Each of `sets` has the number of the set of each run, -1 where there is no run. A law with one set links
    nothing. None if no two runs are linked.
    """
    return _linked(*(numbers.astype(np.int64).tobytes() for numbers in sets))


@functools.lru_cache(4096)  # laws use the same sets in all blocks and metrics: boards take a fifth of the time
def _linked(*sets: bytes) -> tuple[int, ...] | None:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = nodes = len(sets[0]) // 8  # a node for each run, then one for each set of gains; no matrix of pairs of runs
    runs, their_sets = [], []
    for numbers in (np.frombuffer(one, np.int64) for one in sets):
        there = np.flatnonzero(numbers >= 0)
        distinct, which = np.unique(numbers[there], return_inverse=True)
        if distinct.size > 1:
            runs.append(there)
            their_sets.append(nodes + which.ravel())
            nodes += distinct.size
    if not runs:
        return None
    edges = np.concatenate(runs), np.concatenate(their_sets)
    graph = coo_array((np.ones(edges[0].size), edges), shape=(nodes, nodes))
    samples, labels = connected_components(graph, directed=False)
    return None if samples == count else tuple(labels[:count].tolist())


def first_of_kind(outcomes: np.ndarray, exists: np.ndarray) -> np.ndarray:
    """Return which cells (blocks, seeds) exist and do not repeat the outcomes (laws, blocks, seeds) of earlier ones."""
    first = np.zeros(exists.shape, bool)
    for block, of_block in enumerate(exists):
        seeds = np.flatnonzero(of_block)
        first[block, seeds[np.unique(outcomes[:, block, seeds], axis=1, return_index=True)[1]]] = True
    return first


def corrected_limits(comparisons: Sequence[Comparison]) -> Limits:
    """Return the limits of p-values for comparisons that form one family."""
    pairs, winners = [], []
    for one in comparisons:
        if len(one.laws) > 1:
            p, diagonal = one.p[~one.untested], np.eye(len(one.laws), dtype=bool)
            pairs.append(np.minimum(p, p.transpose(0, 2, 1))[:, *np.triu_indices(len(one.laws), 1)].ravel())
            winners.append(np.where(diagonal, 0.0, p).max(axis=2).min(axis=1))
    error = 1.0 - LEVEL
    return Limits(*(_holm(np.concatenate([*each, []]), error / 2) for each in (pairs, winners)))


def _holm(p: np.ndarray, error: float) -> float:
    """Return the p-value up to which Holm's method rejects."""
    allowed = error / np.arange(p.size, 0, -1)
    kept = np.flatnonzero(np.sort(p) > allowed)
    return float(allowed[kept[0]]) if kept.size else error


def ranks(comparison: Comparison) -> list[Rank]:
    """Return the laws' ranks: fewest runs without a value first, then by mean rank; irrelevant differences are ties."""
    by_block = ranked(comparison.centres, comparison.floors, comparison.without_value, comparison.relevant)
    mean = by_block.mean(axis=1)
    lacking = comparison.without_value.sum(axis=1)
    order = [tuple(row) for row in zip(lacking.tolist(), mean.round(9).tolist(), strict=True)]
    places = [sum(other < one for other in order) + (1 + order.count(one)) / 2 for one in order]
    best = [not any(row) for row in (comparison.beaten | comparison.undecided).tolist()]
    rows = [Rank(*row) for row in zip(comparison.laws, mean.tolist(), places, best, strict=True)]
    return sorted(rows, key=lambda rank: (rank.place, rank.law))


def ranked(centres: np.ndarray, floors: np.ndarray, lacking: ArrayLike = 0, relevant: float = RELEVANT) -> np.ndarray:
    """Return the ranks of laws in each block (laws, blocks): by numbers of runs without a value, then by medians."""
    lowered = centres - least_difference(centres, floors, relevant)
    lacking = np.broadcast_to(lacking, centres.shape)
    behind = lacking[:, None] > lacking[None]
    behind |= (lacking[:, None] == lacking[None]) & (lowered[:, None] > centres[None])
    return (len(centres) + 1 + behind.sum(axis=1) - behind.sum(axis=0)) / 2


# relevant differences


def least_difference(value: ArrayLike, resolution: ArrayLike = 0.0, relevant: float = RELEVANT) -> np.ndarray:
    """Return the least relevant difference between a value >= 0 and a smaller one.

    It is the larger of a share of the value and the resolution, see `paired_runs.floor`. Any difference from inf is
    relevant.
    """
    share = relevant * np.where(np.isinf(value), 0.0, np.abs(value))
    return np.maximum(share, np.maximum(resolution, ROUNDING))


def exceeds(a: ArrayLike, b: ArrayLike, resolution: ArrayLike = 0.0, relevant: float = RELEVANT) -> np.ndarray:
    """Return whether a is larger than b by more than the least relevant difference; a, b >= 0."""
    return np.asarray(a) - least_difference(a, resolution, relevant) > np.asarray(b)


def checked_share(relevant: float) -> float:
    """Return the share of a value that is relevant. Raise ScenarioError if it is out of range."""
    return number("relevant", relevant, low=0.0, high=0.5)


def without_rounding(values: np.ndarray) -> np.ndarray:
    """Round values so that rounding errors vanish: 0 below 1e-9, else 20 binary digits."""
    share, exponent = np.frexp(np.where(np.abs(values) < ROUNDING, 0.0, values))
    with np.errstate(over="ignore"):
        return np.ldexp(np.round(share * 2**20), exponent - 20)


# the signed-rank test


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


def interval(differences: ArrayLike, error: float) -> tuple[float, float, float]:
    """Return the centre of differences (n,), NaN for none, and the ends of its interval.

    The true centre lies beyond each end with probability `error`. Ends are infinite if the sample is too small.
    """
    known = np.asarray(differences, float)
    known = known[~np.isnan(known)]
    n = known.size
    if not n:
        return math.nan, math.nan, math.nan
    i, j = np.triu_indices(n)
    with np.errstate(invalid="ignore"):
        means = (known[i] + known[j]) / 2  # NaN of two opposite infinite values
    value = float(np.median(np.where(np.isnan(means), 0.0, means)))
    tails = _tail(tuple(range(2, 2 * n + 1, 2)), 2 * np.arange(means.size + 1))
    if not (enough := np.flatnonzero(tails <= error)).size:
        return value, -math.inf, math.inf
    low = np.sort(np.where(np.isnan(means), -math.inf, means))[means.size - enough[0]]
    high = np.sort(np.where(np.isnan(means), math.inf, means))[enough[0] - 1]
    return value, float(low), float(high)


def min_p(n: int) -> float:
    """Return the smallest one-sided p-value that n differences can have."""
    return 2.0**-n


def _tail(twice: tuple[int, ...], sums: np.ndarray) -> np.ndarray:
    """Return the probability that random signs give a sum of doubled ranks as large as these."""
    if len(twice) <= MAX_EXACT:
        return _distribution(twice)[sums]
    from scipy.special import ndtr

    mean, deviation = sum(twice) / 2, math.sqrt(sum(rank * rank for rank in twice)) / 2
    return ndtr((mean - sums + 1) / deviation)


@functools.lru_cache(maxsize=1024)
def _distribution(twice: tuple[int, ...]) -> np.ndarray:
    """Return the probability of a sum of doubled ranks of at least 0, 1, ..., if signs are random."""
    share = np.zeros(sum(twice) + 1)
    share[0] = 1.0
    for rank in twice:
        share[rank:] += share[: share.size - rank].copy()
        share /= 2
    return np.cumsum(share[::-1])[::-1]
