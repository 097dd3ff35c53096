"""Comparison of laws on the runs that they share: which law is better in which block, and places
over all blocks.

Blocks and samples are as in `bootstrap`. A unit is one run, with the gains that one search found,
in one instance of the conditions; or all runs that share sets of gains of either law, directly or
through others: its lead is the median of theirs. A run that repeats the results of both laws is not
counted.

The lead. With y a law's value in a run, y' that of the same run at half the physics step, and rho
how the value changes over the last fifth of the run,

    high = max(y, y') max(1, rho)^5         low = min(y, y') min(1, rho)^5
    d_i  = log( max(low of the rival, q) / max(high of the law, q) )        one for each unit i

q is the smallest value that matters in the problem, see `paired_runs.floor`. If the trend goes on,
the value changes by the factor rho^5 in as much time again: only a law that rises and a rival that
falls are charged. rho is the median of a law's runs in a block, and 1 if it differs from 1 by no
more than what is relevant. Where only some of the runs were repeated at half the step, the median
of their relative changes widens the others. For shares, d is the difference.

The test. A law is better than a rival if the number of pairs i <= j with d_i + d_j > -2 log(1 - r)
is too large for the exact law of the signed ranks; r is the share that is relevant. That is F.
Wilcoxon's test (Biometrics Bulletin 1(6), 1945) in the form of J. W. Tukey: it rejects that the law
is not lower by the share r. It is monotone: d never falls because a value of the law's own falls,
or one of its rival's rises; so a winner that becomes better in its block stays its winner. There
are two exceptions. Where only some runs were repeated, a value that falls alone is farther from
that at half the step, and widens the others. And Holm's limit, below, depends on all p-values of
the family. The test does not depend on the metric's unit. Besides, the law must not fail more
often. The estimate is the median of the means of all pairs (J. L. Hodges, E. L. Lehmann, Annals of
Mathematical Statistics 34(2), 1963), and an interval has the centres that the test does not reject.

The correction. There are two families, over all blocks of a metric in a table, however the table is
grouped into boards. Both are corrected by S. Holm's method (Scandinavian Journal of Statistics
6(2), 1979), with two-sided p-values.

- Winners. The winner of a block is better than every other law. Its p-value is the largest of those
  against the others, and needs no correction for their number (S. Gutmann, Z. Maymin, Annals of
  Statistics 15(1), 1987): the error is largest where two laws are equal and the others far behind.
  So the family is the blocks. The probability of any wrong winner is at most 5 %.
- Pairs. The family is all pairs of laws in all blocks. The probability that any law is wrongly
  called better than another is at most 5 %, in addition to that of a wrong winner.

No winner. Two laws are level only if there are 12 units or more and the interval of their ratio, at
the pairs' level, lies within 10 %. Otherwise one cannot tell, and `least_visible_lead` says which
lead would have been seen.

A block without a test has one value of each law, which is no sample. There a law is better if d
exceeds -log(1 - r). The block belongs to neither family. A law with a run that failed, or has no
value, wins nothing. In every order the laws with fewer such runs come first.

A law is among the best if no other is better. One exception: where another law's median is
relevantly lower, and two laws have too few units for any verdict, the law is undecided, and not
among the best.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smc_mujoco.analysis.apart import apart
from smc_mujoco.analysis.bootstrap import LEVEL, middle
from smc_mujoco.common.constraints import Number, constrained

MAX_EXACT = 60  # samples; with more the normal approximation of the rank sum is used
RELEVANT = 0.03  # r, default share of the larger value that is relevant; chosen
Relevant = Annotated[float, Number(low=0.0, high=0.5)]
# the last part is a fifth of a run: a trend that lasts as long again goes on for 5 of them
TREND_POWER = 5
LEVEL_SHARE = 0.1  # laws are level if the interval of their ratio lies within this share; chosen
MIN_LEVEL_UNITS = 12  # with fewer units no laws are called level; chosen
MAX_WIDENING = 1e3  # of a logarithm: more than the range of floating-point numbers, but finite
# of log rho: a value that has vanished within the last fifth of a run has fallen enough
MAX_RISE = 60.0
POWER = 0.8  # with which the least visible lead is seen
# median of the absolute difference of two draws from a normal law, over its standard deviation
NORMAL_SPREAD = 0.954


class Rank(NamedTuple):
    """A law's place among laws, 1 the best; ties share the mean of their places."""

    law: str  # its name
    mean: float  # mean rank over the blocks, which orders laws and decides nothing
    place: float  # by the number of runs without a value, then by mean rank
    best: bool  # whether the law is among the best of every block


class Effect(NamedTuple):
    """How a law's values compare with a rival's, in one block."""

    value: float  # ratio of the law's values to the rival's
    low: float  # of its interval, at the level that the correction leaves for one comparison
    high: float
    ahead: int  # number of units in which the law is better by more than what is relevant
    samples: int  # number of units
    sets: bool  # whether the units are sets of gains; otherwise they are seeds
    visible: float  # the least lead that would have been seen, as a share; 1 if none would


class Limits(NamedTuple):
    """The largest one-sided p-values with which a law is better than another, and with which it
    wins a block.
    """

    pair: float
    winner: float
    first: float = 0.0  # of Holm's first step for winners


class Comparison:
    """Every law compared with every other in every block.

    Scores are law -> (blocks, n) or (n,), lower is better, inf for never, NaN where no law has a
    run. If they are `shares`, 0.0 or 1.0, means are compared instead of medians. One for all
    blocks, or one for each: floors are their q, `untested` says whether a value is no sample, such
    as a worst case, and `first_order` whether the integrator is of first order. Outcomes and sets
    are law -> a number per cell, equal if two seeds gave the same result, or had the same gains;
    default: all results differ, and all gains are the same. Limits are given where the blocks
    belong to a larger family. `halves` and `trends` are law -> y' and rho of each run, NaN where
    they are not known; default: nowhere.
    """

    @constrained
    def __init__(
        self,
        scores: Mapping[str, ArrayLike],
        floors: ArrayLike = 0.0,
        shares: bool = False,
        outcomes: Mapping[str, ArrayLike] | None = None,
        sets: Mapping[str, ArrayLike] | None = None,
        relevant: Relevant = RELEVANT,
        limits: Limits | None = None,
        untested: ArrayLike = False,
        halves: Mapping[str, ArrayLike] | None = None,
        trends: Mapping[str, ArrayLike] | None = None,
        first_order: ArrayLike = False,
    ):
        def stacked(by_law: Mapping[str, ArrayLike], kind: type) -> np.ndarray:
            return np.array([np.atleast_2d(by_law[law]) for law in self.laws]).astype(kind)

        self.laws = tuple(sorted(scores))
        self.shares = shares
        self.relevant = relevant
        self.cells = cells = stacked(scores, float)  # (laws, blocks, seeds)
        unknown = np.full(cells.shape, math.nan)
        # as cells, at half the physics step
        if halves is None:
            self.halves = unknown
        else:
            self.halves = stacked(halves, float)
        if trends is None:
            rises = unknown
        else:
            rises = stacked(trends, float)
        blocks = range(cells.shape[1])
        self.floors = np.broadcast_to(np.asarray(floors, float), len(blocks))
        self.untested = np.broadcast_to(np.asarray(untested, bool), len(blocks))
        self.first_order = np.broadcast_to(np.asarray(first_order, bool), len(blocks))
        if sets is None:
            gains = np.zeros(cells.shape, np.int64)
        else:
            gains = stacked(sets, np.int64)
        if outcomes is None:
            results = None
        else:
            results = stacked(outcomes, np.int64)
        ran = ~np.isnan(cells[0])
        # (laws, blocks), number of sets of gains of a law's runs
        self.sets = np.array(
            [[np.unique(of_law[k, ran[k]]).size for k in blocks] for of_law in gains]
        )
        low, high = bounds(cells, self.halves, rises, self.floors, shares, self.relevant)
        # what d must exceed
        if shares:
            self.beyond = self.relevant
        else:
            self.beyond = -math.log1p(-self.relevant)
        # (blocks, laws, laws, seeds), d of the first law over the second by unit, then NaN
        if results is None:
            of_block = [None] * len(blocks)
        else:
            of_block = results.swapaxes(0, 1)
        self.leads = np.stack(
            [_leads(low[:, k], high[:, k], ran[k], of_block[k], gains[:, k]) for k in blocks]
        )
        # (blocks, laws, laws), one-sided p-value, not corrected, that a law is better; 1 of itself;
        # 0 or 1 if untested
        exceeding = self.leads - self.beyond
        self.p = np.where(
            self.untested[:, None, None], 1.0 - np.any(exceeding > 0.0, axis=3), p_values(exceeding)
        )
        self.p[:, *np.diag_indices(len(self.laws))] = 1.0
        self.limits = limits or corrected_limits([self])  # of the p-values, after the correction
        if shares:
            self._plain = cells
        else:
            self._plain = _logarithms(cells, self.floors)
        self._gains = gains
        self._results = results

    @functools.cached_property
    def centres(self) -> np.ndarray:
        """The medians, or means, over the seeds, (laws, blocks)."""
        if self.shares:
            return np.nanmean(self.cells, axis=2)
        return middle(self.cells)

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
        """The number of units of two laws, (blocks, laws, laws)."""
        return (~np.isnan(self.leads)).sum(axis=3)

    @functools.cached_property
    def _eligible(self) -> np.ndarray:
        """Whether a law has no more runs without a value than another, (blocks, laws, laws)."""
        lacking = self.without_value.T
        return np.asarray(lacking[:, :, None] <= lacking[:, None, :])

    @functools.cached_property
    def _relevantly_lower(self) -> np.ndarray:
        """Whether the median of a law is lower than another's by what is relevant, (blocks, laws,
        laws).
        """
        centre = self.centres.T
        floors = self.floors[:, None, None]
        if self.shares:
            return centre[:, None, :] - centre[:, :, None] > self.relevant
        return exceeds(centre[:, None, :], centre[:, :, None], floors, self.relevant)

    @functools.cached_property
    def winners(self) -> list[str | None]:
        """The law of each block that is better than every other, if there is one."""
        winners = []
        for p, eligible, lacking in zip(self.p, self._eligible, self.without_value.T, strict=True):
            wins = np.all(
                (p <= self.limits.winner) & eligible | np.eye(len(p), dtype=bool), axis=1
            ) & (lacking == 0)
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
    def worse(self) -> np.ndarray:
        """Whether another law is better, (laws, blocks)."""
        return np.asarray(np.any(self.better, axis=1).T)

    @functools.cached_property
    def beaten(self) -> np.ndarray:
        """Whether another law is better, or a run of the law failed or has no value, (laws,
        blocks).
        """
        return self.worse | (self.without_value > 0)

    @functools.cached_property
    def level(self) -> np.ndarray:
        """Whether two laws are level: the interval of their ratio lies within 10 %, (blocks, laws,
        laws).
        """
        if self.shares:
            margin = LEVEL_SHARE
        else:
            margin = -math.log1p(-LEVEL_SHARE)
        within = p_values(self.leads + margin) <= self.limits.pair
        level = (
            within
            & within.swapaxes(1, 2)
            & (self.samples >= MIN_LEVEL_UNITS)
            & ~self.untested[:, None, None]
        )
        level[:, *np.diag_indices(len(self.laws))] = True
        return level

    @functools.cached_property
    def tied(self) -> np.ndarray:
        """Whether two laws are level in every block, (laws, laws)."""
        return np.asarray(self.level.all(axis=0))

    @functools.cached_property
    def undecided(self) -> np.ndarray:
        """Whether only a lack of samples keeps a law from being beaten, (laws, blocks); False in
        `untested` blocks.
        """
        few = np.vectorize(min_p)(self.samples) > self.limits.pair
        few[self.untested] = False
        return np.any(self._relevantly_lower & self._eligible & few, axis=1).T & ~self.beaten

    @property
    def best(self) -> list[tuple[str, ...]]:
        """The laws of each block that are not beaten, with enough samples to tell."""
        return [
            tuple(np.array(self.laws)[row].tolist()) for row in ~(self.beaten | self.undecided).T
        ]

    def effect(self, block: int, law: str, rival: str, winner: bool = True) -> Effect:
        """Return how a law compares with a rival in a block, at the level of a winner's comparison
        or of any pair's.
        """
        a = self.laws.index(law)
        b = self.laws.index(rival)
        if winner:
            error = self.limits.winner
        else:
            error = self.limits.pair
        leads = self.leads[block, a, b]
        lags = self.leads[block, b, a]
        with np.errstate(over="ignore"):
            ends = np.exp([interval(lags, error)[1], -interval(leads, error)[1]])
            plain = _difference(self._plain[b, block], self._plain[a, block])
            value = np.exp(-interval(self._by_unit(plain, block, a, b), error)[0])
        return Effect(
            value=float(np.clip(value, *ends)),
            low=float(ends[0]),
            high=float(ends[1]),
            ahead=int((leads > self.beyond).sum()),
            samples=int(self.samples[block, a, b]),
            sets=bool(self.sets[[a, b], block].max() > 1),
            visible=self.visible(block, law, rival),
        )

    def visible(self, block: int, law: str, rival: str) -> float:
        """Return the least lead of a law over a rival that is seen with a probability of 80 %, as a
        share.

        It makes up for what half the step and trends charge, too.
        """
        a = self.laws.index(law)
        b = self.laws.index(rival)
        lead = least_visible_lead(self.leads[block, a, b], self.limits.first, self.relevant)
        plain = self._by_unit(
            _difference(self._plain[b, block], self._plain[a, block]), block, a, b
        )
        charged = _difference(plain, self.leads[block, a, b])
        known = charged[np.isfinite(charged)]
        if known.size:
            return 1.0 - (1.0 - lead) * math.exp(-max(float(np.median(known)), 0.0))
        return lead

    def step_change(self, block: int, law: str) -> tuple[float, float] | None:
        """Return the medians of a law's runs that were repeated at half the physics step, before
        and after; else None.

        They are returned where they are `apart`, as for any other number.
        """
        a = self.laws.index(law)
        whole = self.cells[a, block]
        half = self.halves[a, block]
        if self.shares or not (again := ~np.isnan(half)).any():
            return None
        before, after = (float(middle(values[again])) for values in (whole, half))
        differ = apart((before, after), float(self.floors[block]), bool(self.first_order[block]))
        return (before, after) if differ else None

    def _by_unit(self, by_run: np.ndarray, block: int, a: int, b: int) -> np.ndarray:
        """Return values by run, (seeds,), as values by unit of two laws."""
        if self._results is None:
            results = None
        else:
            results = self._results[[a, b], block]
        there = ~np.isnan(self.cells[0, block])
        return _centres(
            by_run, *_units(there, results, self._gains[a, block], self._gains[b, block])
        )


def bounds(
    cells: np.ndarray,
    halves: np.ndarray,
    trends: np.ndarray,
    floors: np.ndarray,
    shares: bool,
    relevant: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return low and high of every run, (laws, blocks, seeds): logarithms, or the shares
    themselves.
    """
    repeated = ~np.isnan(halves)
    if shares:
        return np.where(repeated, np.fmin(cells, halves), cells), np.where(
            repeated, np.fmax(cells, halves), cells
        )
    no_floor = np.zeros(len(floors))
    whole = _logarithms(cells, no_floor)
    half = _logarithms(halves, no_floor)
    change = np.abs(_difference(_logarithms(halves, floors), _logarithms(cells, floors)))
    widening = np.zeros(cells.shape[:2])
    known = repeated.any(axis=2)
    # of a law in a block
    widening[known] = np.minimum(np.nanmedian(change[known], axis=1), MAX_WIDENING)
    low = np.where(repeated, np.fmin(whole, half), whole - widening[..., None])
    high = np.where(repeated, np.fmax(whole, half), whole + widening[..., None])
    rising = _rises(trends, relevant)[..., None]
    q = np.log(np.maximum(floors, np.finfo(float).tiny))[None, :, None]
    low, high = (
        low + TREND_POWER * np.minimum(rising, 0.0),
        high + TREND_POWER * np.maximum(rising, 0.0),
    )
    return np.maximum(low, q), np.maximum(high, q)


def _rises(trends: np.ndarray, relevant: float) -> np.ndarray:
    """Return log rho of each law in each block, (laws, blocks); 0 where it is not relevant, or not
    known.
    """
    rho = np.ones(trends.shape[:2])
    known = ~np.isnan(trends).all(axis=2)
    rho[known] = np.nanmedian(trends[known], axis=1)
    with np.errstate(divide="ignore"):
        rise = np.log(rho)
    return np.where(np.abs(rise) > (relevant or RELEVANT), np.clip(rise, -MAX_RISE, MAX_RISE), 0.0)


def _logarithms(values: np.ndarray, floors: np.ndarray) -> np.ndarray:
    """Return the logarithms of values (laws, blocks, seeds), at least those of the blocks'
    floors.
    """
    return np.log(
        np.maximum(np.abs(values), np.maximum(floors, np.finfo(float).tiny)[None, :, None])
    )


def _difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a - b; 0 where both are the same infinity."""
    with np.errstate(invalid="ignore"):
        return np.where((a == b) & np.isinf(a), 0.0, a - b)


def _leads(
    low: np.ndarray, high: np.ndarray, ran: np.ndarray, results: np.ndarray | None, sets: np.ndarray
) -> np.ndarray:
    """Return `Comparison.leads` of one block, (laws, laws, units); low, high, results and sets are
    (laws, seeds).
    """
    k = len(low)
    leads = np.full((k, *low.shape), math.nan)
    for a in range(k):
        for b in range(a + 1, k):
            units = _units(ran, None if results is None else results[[a, b]], sets[a], sets[b])
            leads[a, b] = _centres(_difference(low[b], high[a]), *units)
            leads[b, a] = _centres(_difference(low[a], high[b]), *units)
    return leads


def _units(
    ran: np.ndarray, results: np.ndarray | None, sets: np.ndarray, rival_sets: np.ndarray
) -> tuple[np.ndarray, tuple[int, ...] | None]:
    """Return the runs of two laws that count, without those that repeat earlier ones, and the
    number of their unit.
    """
    runs = np.flatnonzero(ran if results is None else first_of_kind(results[:, None], ran[None])[0])
    return runs, linked(sets[runs], rival_sets[runs])


def _centres(by_run: np.ndarray, runs: np.ndarray, labels: tuple[int, ...] | None) -> np.ndarray:
    """Return the median of each unit, then NaN; without labels each run is a unit, in its place."""
    centres = np.full(by_run.shape, math.nan)
    if labels is None:
        centres[runs] = by_run[runs]
        return centres
    for unit in range(max(labels) + 1):
        ordered = np.sort(by_run[runs[np.array(labels) == unit]])
        low = ordered[(ordered.size - 1) // 2]
        high = ordered[ordered.size // 2]
        # also of two opposite infinite values
        if low == -high:
            centres[unit] = 0.0
        else:
            centres[unit] = (low + high) / 2
    return centres


def least_visible_lead(leads: ArrayLike, error: float, relevant: float = RELEVANT) -> float:
    """Return the least lead that the test sees with a probability of 80 %, as a share; 1 if it can
    see none.

    With n units whose d (n,) have the standard deviation s, and t(p) exceeded with probability p by
    Student's law,

        L = 1 - (1 - r) exp( -(t(error) + t(0.2)) s sqrt(pi / 3n) )

    The factor is that of the signed ranks' efficiency under a normal law. s is the median of |d_i -
    d_j| over 0.954.

    Args:
      leads: d of the units, NaN for none.
      error: one-sided level of the first step of Holm's method.
      relevant: r.
    """
    from scipy.special import stdtrit

    known = np.asarray(leads, float)
    known = known[~np.isnan(known)]
    n = known.size
    if n < 2 or min_p(n) > error:
        return 1.0
    i, j = np.triu_indices(n, 1)
    spread = float(np.median(np.abs(_difference(known[i], known[j])))) / NORMAL_SPREAD
    quantiles = stdtrit(n - 1, 1.0 - error) + stdtrit(n - 1, POWER)
    return float(
        1.0 - (1.0 - relevant) * math.exp(-quantiles * spread * math.sqrt(math.pi / (3 * n)))
    )


def linked(*sets: np.ndarray) -> tuple[int, ...] | None:
    """Return a number for each run, the same for runs that share a set of gains, directly or
    through others.

    Each of `sets` has the number of the set of each run, -1 where there is no run. A law with one
    set links nothing. None if no two runs are linked.
    """
    return _linked(*(numbers.astype(np.int64).tobytes() for numbers in sets))


@functools.lru_cache(
    4096
)  # laws use the same sets in all blocks and metrics: boards take a fifth of the time
def _linked(*sets: bytes) -> tuple[int, ...] | None:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # a node for each run, then one for each set of gains; no matrix of pairs of runs
    count = nodes = len(sets[0]) // 8
    runs = []
    their_sets = []
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
    if samples == count:
        return None
    return tuple(labels[:count].tolist())


def first_of_kind(outcomes: np.ndarray, exists: np.ndarray) -> np.ndarray:
    """Return which cells (blocks, seeds) exist and do not repeat the outcomes (laws, blocks, seeds)
    of earlier ones.
    """
    first = np.zeros(exists.shape, bool)
    for block, of_block in enumerate(exists):
        seeds = np.flatnonzero(of_block)
        first[block, seeds[np.unique(outcomes[:, block, seeds], axis=1, return_index=True)[1]]] = (
            True
        )
    return first


def corrected_limits(comparisons: Sequence[Comparison]) -> Limits:
    """Return the limits of p-values for comparisons that form one family."""
    pairs = []
    winners = []
    for one in comparisons:
        if len(one.laws) > 1:
            p = one.p[~one.untested]
            diagonal = np.eye(len(one.laws), dtype=bool)
            pairs.append(
                np.minimum(p, p.transpose(0, 2, 1))[:, *np.triu_indices(len(one.laws), 1)].ravel()
            )
            winners.append(np.where(diagonal, 0.0, p).max(axis=2).min(axis=1))
    error = (1.0 - LEVEL) / 2  # two-sided
    of_pair, of_winner = (np.concatenate([*each, []]) for each in (pairs, winners))
    return Limits(_holm(of_pair, error), _holm(of_winner, error), error / max(of_winner.size, 1))


def _holm(p: np.ndarray, error: float) -> float:
    """Return the p-value up to which Holm's method rejects."""
    allowed = error / np.arange(p.size, 0, -1)
    kept = np.flatnonzero(np.sort(p) > allowed)
    return float(allowed[kept[0]]) if kept.size else error


def ranks(comparison: Comparison) -> list[Rank]:
    """Return the laws' ranks: fewest runs without a value first, then by mean rank; irrelevant
    differences are ties.
    """
    by_block = ranked(
        comparison.centres, comparison.floors, comparison.without_value, comparison.relevant
    )
    mean = by_block.mean(axis=1)
    lacking = comparison.without_value.sum(axis=1)
    order = [tuple(row) for row in zip(lacking.tolist(), mean.round(9).tolist(), strict=True)]
    places = [sum(other < one for other in order) + (1 + order.count(one)) / 2 for one in order]
    best = [not any(row) for row in (comparison.beaten | comparison.undecided).tolist()]
    rows = [Rank(*row) for row in zip(comparison.laws, mean.tolist(), places, best, strict=True)]
    return sorted(rows, key=lambda rank: (rank.place, rank.law))


def ranked(
    centres: np.ndarray, floors: np.ndarray, lacking: ArrayLike = 0, relevant: float = RELEVANT
) -> np.ndarray:
    """Return the ranks of laws in each block (laws, blocks): by numbers of runs without a value,
    then by medians.
    """
    lacking = np.broadcast_to(lacking, centres.shape)
    behind = lacking[:, None] > lacking[None]
    behind |= (lacking[:, None] == lacking[None]) & exceeds(
        centres[:, None], centres[None], floors, relevant
    )
    return (len(centres) + 1 + behind.sum(axis=1) - behind.sum(axis=0)) / 2


# relevant differences


def exceeds(
    a: ArrayLike, b: ArrayLike, floor: ArrayLike = 0.0, relevant: float = RELEVANT
) -> np.ndarray:
    """Return whether a is larger than b by more than what is relevant, with both at least the floor
    q; a, b >= 0.
    """
    larger = np.asarray(np.maximum(a, floor))
    smaller = np.asarray(np.maximum(b, floor))
    return np.asarray((larger > smaller) & ((1.0 - relevant) * larger > smaller))


# the signed-rank test


def p_values(differences: ArrayLike) -> np.ndarray:
    """Return the one-sided p-values with which differences (..., n), NaN for none, lie above 0; 1
    without any.

    The statistic is the number of pairs i <= j whose sum is above 0: without ties and zeros, the
    sum of the positive ranks. Ties and zeros lower it, so that the test keeps its level.
    """
    rows = np.atleast_2d(np.asarray(differences, float))
    shape, rows = rows.shape[:-1], rows.reshape(-1, rows.shape[-1])
    sizes = (~np.isnan(rows)).sum(axis=1)
    p = np.ones(len(rows))
    for n in np.unique(sizes[sizes > 0]).tolist():
        same = sizes == n
        p[same] = _tail(n, np.array([_positive_pairs(row[~np.isnan(row)]) for row in rows[same]]))
    return p.reshape(shape)


def _positive_pairs(values: np.ndarray) -> int:
    """Return the number of pairs i <= j of values (n,) whose sum is above 0; opposite infinities
    have none.
    """
    ordered = np.sort(values)
    # of each value, by all values, itself too
    above = values.size - np.searchsorted(ordered, -values, side="right")
    alone = int((values > 0).sum())
    return (int(above.sum()) - alone) // 2 + alone


def interval(differences: ArrayLike, error: float) -> tuple[float, float, float]:
    """Return the centre of differences (n,), NaN for none, and the ends of its interval.

    The true centre lies beyond each end with probability `error`. Ends are infinite if the sample
    is too small.
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
    tails = _tail(n, np.arange(means.size + 1))
    if not (enough := np.flatnonzero(tails <= error)).size:
        return value, -math.inf, math.inf
    low = np.sort(np.where(np.isnan(means), -math.inf, means))[means.size - enough[0]]
    high = np.sort(np.where(np.isnan(means), math.inf, means))[enough[0] - 1]
    return value, float(low), float(high)


def min_p(n: int) -> float:
    """Return the smallest one-sided p-value that n differences can have."""
    return 2.0**-n


def _tail(n: int, sums: np.ndarray) -> np.ndarray:
    """Return the probability that random signs of the ranks 1 to n give a sum at least as large as
    these.
    """
    if n <= MAX_EXACT:
        return _distribution(n)[sums]
    from scipy.special import ndtr

    mean = n * (n + 1) / 4
    deviation = math.sqrt(n * (n + 1) * (2 * n + 1) / 6) / 2
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
