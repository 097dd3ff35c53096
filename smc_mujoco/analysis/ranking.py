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

Below the floor. A law is below q in a block if its high values are at most q in more than half of
its units. Two laws below q are not ranked: neither is better, and they have no least visible lead.
If only one is, and is better, its lead is at least the median of the rival's low values over q.

No winner. Two laws are level only if there are 12 units or more and the interval of their ratio, at
the pairs' level, lies within 10 %. Otherwise one cannot tell, and `least_visible_lead` says which
lead would have been seen.

A law with a run that failed, has no value, or has not arrived (`metrics.catalogue.arrived`) wins
nothing. In every order the laws with fewer runs without a value come first.

A law is among the best if no other is better and all its runs have a value and have arrived.
"""

import copy
import functools
import hashlib
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smc_mujoco.analysis.bootstrap import LEVEL, middle
from smc_mujoco.analysis.differ import differ
from smc_mujoco.common.constraints import Number, constrained

MAX_EXACT = 60  # samples; with more the normal approximation of the rank sum is used
RELEVANT = 0.03  # r, default share of the larger value that is relevant; chosen
Relevant = Annotated[float, Number(low=0.0, high=0.5)]
# the last part is a fifth of a run: a trend that lasts as long again goes on for 5 of them
TREND_POWER = 5
LEVEL_SHARE = 0.1  # laws are level if the interval of their ratio lies within this share; chosen
MIN_LEVEL_UNITS = 12  # with fewer units no laws are called level; chosen
MAX_LOG = 1e6  # of a logarithm: more than the range of floating-point numbers, but finite
# of log rho: a value that has vanished within the last fifth of a run has fallen enough
MAX_RISE = 60.0
POWER = 0.8  # with which the least visible lead is seen
LEAD_RESAMPLES = 400  # for the least visible lead; chosen
# of resamples that must see it, so that on average POWER of new samples do; chosen by samples of 51
# shapes and confirmed on shapes drawn later, see docs/winners.md
OWN_SHARE = 0.95
MAX_SUMS = 10_000_000  # of pairs, in memory at once


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
    below: bool = False  # whether the law is below the floor and the rival is not


class Limits(NamedTuple):
    """The largest one-sided p-values with which a law is better than another, and with which it
    wins a block.
    """

    pair: float
    winner: float
    first: float = 0.0  # of Holm's first step for winners


class Comparison:
    """Every law compared with every other in every block.

    Args:
      scores: law -> (blocks, n) or (n,), lower is better, inf for never, NaN where no law has a
        run. The other mappings have the same shapes.
      floors: q of all blocks, or of each.
      shares: whether the scores are 0.0 or 1.0, whose means are compared instead of medians.
      outcomes: a number per run, equal if two seeds gave the same result. Default: none did.
      sets: a number per run, equal if two seeds had the same gains. Default: all had.
      relevant: r.
      halves, trends: y' and rho of each run, NaN where they are not known. Default: nowhere.
      arrived: whether each run has arrived. Default: all have.
      first_order: whether the integrator of all blocks, or of each, is of first order.
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
        halves: Mapping[str, ArrayLike] | None = None,
        trends: Mapping[str, ArrayLike] | None = None,
        arrived: Mapping[str, ArrayLike] | None = None,
        first_order: ArrayLike = False,
    ):
        self.laws = tuple(sorted(scores))
        self.shares = shares
        self.relevant = relevant
        self.cells = self._cube(scores, math.nan)  # (laws, blocks, seeds)
        count, blocks, seeds = self.cells.shape
        self.halves = self._cube(halves, math.nan)  # y'
        rises = self._cube(trends, math.nan)
        gains = self._cube(sets, 0)
        results = self._cube(outcomes, np.arange(seeds))
        self.floors = np.broadcast_to(np.asarray(floors, float), blocks)
        self.first_order = np.broadcast_to(np.asarray(first_order, bool), blocks)
        self.low, self.high = bounds(self.cells, self.halves, rises, self.floors, shares, relevant)
        plain = self.cells
        self.beyond = relevant  # what d must exceed
        if not shares:
            plain = _logarithms(self.cells, self.floors)
            self.beyond = -math.log1p(-relevant)
        ran = ~np.isnan(self.cells[0])
        # runs that failed, have no value or have not arrived
        self.away = np.isinf(self.cells) | (self._cube(arrived, 1) == 0)
        self.below = np.zeros((count, blocks), bool)
        self.sets = np.ones((count, blocks), int)  # number of sets of gains of a law's runs
        # d of the first law over the second by unit, then NaN; and without halves and trends
        self.leads = np.full((blocks, count, count, seeds), math.nan)
        self.plain = self.leads.copy()
        charged = self.leads, self.low, self.high
        as_run = self.plain, plain, plain
        for k in range(blocks):
            for a in range(count):
                self.sets[a, k] = np.unique(gains[a, k, ran[k]]).size
                # the law alone, then beside each other
                for b in range(a + 1):
                    pair = sorted({a, b})
                    first = first_of_kind(results[pair, k][:, None], ran[[k]])[0]
                    units = linked(*gains[pair, k][:, first])
                    if b == a and self.floors[k] > 0.0 and not shares:
                        # of an even number, the median is above q if only half are at most q
                        centre = middle(_by_unit(self.high[a, k, first], units, seeds))
                        self.below[a, k] = centre <= math.log(self.floors[k])
                    for i, j in itertools.permutations(pair, 2):
                        for leads, low, high in charged, as_run:
                            by_run = _difference(low[j, k], high[i, k])[first]
                            leads[k, i, j] = _by_unit(by_run, units, seeds)
        # (blocks, laws, laws), one-sided p-value, not corrected, that a law is better; 1 of itself
        self.p = p_values(self.leads - self.beyond)
        self.p[self.unranked] = 1.0
        self.limits = corrected_limits([self])  # of the p-values, after the correction

    def _cube(self, by_law: Mapping[str, ArrayLike] | None, unknown: ArrayLike) -> np.ndarray:
        if by_law:
            return np.array([np.atleast_2d(by_law[law]) for law in self.laws], float)
        return np.broadcast_to(unknown, self.cells.shape)

    def limited(self, limits: Limits) -> "Comparison":
        """Return the same comparison as part of a larger family, which has these limits."""
        other = copy.copy(self)
        other.limits = limits
        return other

    @property
    def centres(self) -> np.ndarray:
        """The medians, or means, over the seeds, (laws, blocks)."""
        if self.shares:
            return np.nanmean(self.cells, axis=2)
        return middle(self.cells)

    @property
    def unranked(self) -> np.ndarray:
        """Whether two laws are both below the floor, (blocks, laws, laws)."""
        return self.below.T[:, :, None] & self.below.T[:, None, :]

    @property
    def without_value(self) -> np.ndarray:
        """The number of runs that failed or have no value, (laws, blocks); 0 for shares."""
        return np.isinf(self.cells).sum(axis=2)

    @property
    def seeds(self) -> np.ndarray:
        """The number of seeds of each block, (blocks,)."""
        return (~np.isnan(self.cells[0])).sum(axis=1)

    @property
    def samples(self) -> np.ndarray:
        """The number of units of two laws, (blocks, laws, laws)."""
        return (~np.isnan(self.leads)).sum(axis=3)

    @property
    def _eligible(self) -> np.ndarray:
        """Whether a law has no more runs `away` than another, (blocks, laws, laws)."""
        lacking = self.away.sum(axis=2).T
        return lacking[:, :, None] <= lacking[:, None, :]

    @property
    def winners(self) -> list[str | None]:
        """The law of each block that is better than every other, if there is one."""
        itself = np.eye(len(self.laws), dtype=bool)
        beats = (self.p <= self.limits.winner) & self._eligible
        wins = np.all(beats | itself, axis=2) & ~self.away.any(axis=2).T
        wins &= len(self.laws) > 1
        names = np.array([*self.laws, None])
        return names[np.where(wins.any(axis=1), wins.argmax(axis=1), -1)].tolist()

    @property
    def better(self) -> np.ndarray:
        """Whether a law is better than another, (blocks, laws, laws)."""
        better = (self.p <= self.limits.pair) & self._eligible
        for block, winner in zip(better, self.winners, strict=True):
            if winner is not None:
                at = self.laws.index(winner)
                block[at] = True
                block[:, at] = False
        return better

    @property
    def worse(self) -> np.ndarray:
        """Whether another law is better, (laws, blocks)."""
        return np.asarray(self.better.any(axis=1)).T

    @property
    def beaten(self) -> np.ndarray:
        """Whether another law is better, or a run of the law failed, has no value or has not
        arrived, (laws, blocks).
        """
        return self.worse | self.away.any(axis=2)

    @property
    def level(self) -> np.ndarray:
        """Whether two laws are level: the interval of their ratio lies within 10 %, or the same
        runs settle, (blocks, laws, laws).
        """
        if self.shares:
            within = ~np.any(self.leads**2 > 0.0, axis=3)
        else:
            within = p_values(self.leads - math.log1p(-LEVEL_SHARE)) <= self.limits.pair
        level = within & within.swapaxes(1, 2) & (self.samples >= MIN_LEVEL_UNITS)
        level &= ~(self.below.T[:, :, None] | self.below.T[:, None, :])
        return level | np.eye(len(self.laws), dtype=bool)

    def effect(self, block: int, law: str, rival: str) -> Effect:
        """Return how a law compares with a rival in a block, at a winner's level."""
        a = self.laws.index(law)
        b = self.laws.index(rival)
        error = self.limits.winner
        leads = self.leads[block, a, b]
        with np.errstate(over="ignore"):
            low = np.exp(interval(self.leads[block, b, a], error)[1])
            high = np.exp(-interval(leads, error)[1])
            value = np.exp(-interval(self.plain[block, a, b], error)[0])
        below = bool(self.below[a, block] and not self.below[b, block])
        if below:
            low = 0.0
            high = 1.0
            if self.better[block, a, b]:
                high = math.exp(math.log(self.floors[block]) - np.nanmedian(self.low[b, block]))
            value = high
        return Effect(
            value=float(np.clip(value, low, high)),
            low=float(low),
            high=float(high),
            ahead=int((leads > self.beyond).sum()),
            samples=int(self.samples[block, a, b]),
            sets=bool(self.sets[[a, b], block].max() > 1),
            below=below,
        )

    def visible(self, block: int, law: str, rival: str) -> float:
        """Return the least lead of a law over a rival that is seen with a probability of 80 %, as a
        share; NaN if one of them is below the floor.

        It makes up for what half the step and trends charge, too.
        """
        at = block, self.laws.index(law), self.laws.index(rival)
        if self.below[list(at[1:]), block].any():
            return math.nan
        error = self.limits.winner if self.winners[block] else self.limits.first
        lead = least_visible_lead(self.leads[at], error, self.relevant)
        charged = np.nan_to_num(middle(_difference(self.plain[at], self.leads[at])))
        return 1.0 - (1.0 - lead) * math.exp(-max(float(charged), 0.0))

    def step_change(self, block: int, law: str) -> tuple[float, float] | None:
        """Return the medians of a law's runs that were repeated at half the physics step, before
        and after; None unless they `differ`.
        """
        a = self.laws.index(law)
        half = self.halves[a, block]
        again = ~np.isnan(half)
        if self.shares or not again.any():
            return None
        pair = float(middle(self.cells[a, block, again])), float(middle(half))
        changed = differ(pair, float(self.floors[block]), bool(self.first_order[block]))
        return pair if changed else None


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
    if shares:
        return np.fmin(cells, halves), np.fmax(cells, halves)
    whole = _logarithms(cells)
    half = _logarithms(halves)
    change = np.abs(_difference(_logarithms(halves, floors), _logarithms(cells, floors)))
    # of a law in a block, for its runs that were not repeated
    widening = np.minimum(np.nan_to_num(middle(change)), MAX_LOG)[..., None]
    with np.errstate(divide="ignore"):
        rise = np.log(middle(trends))[..., None]
    matters = np.abs(rise) > (relevant or RELEVANT)
    rise = TREND_POWER * np.where(matters, np.clip(rise, -MAX_RISE, MAX_RISE), 0.0)
    q = _logarithms(floors[:, None])
    once = np.isnan(half)
    low = np.fmin(whole, np.where(once, whole - widening, half)) + np.minimum(rise, 0.0)
    high = np.fmax(whole, np.where(once, whole + widening, half)) + np.maximum(rise, 0.0)
    return np.maximum(low, q), np.maximum(high, q)


def _logarithms(values: np.ndarray, floors: ArrayLike = 0.0) -> np.ndarray:
    """Return the logarithms of values (laws, blocks, seeds), at least those of the floors."""
    least = np.maximum(np.reshape(floors, (-1, 1)), np.finfo(float).tiny)
    return np.log(np.maximum(np.abs(values), least))


def _difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a - b; 0 where both are the same infinity."""
    with np.errstate(invalid="ignore"):
        return np.where((a == b) & np.isinf(a), 0.0, a - b)


def _by_unit(by_run: np.ndarray, units: tuple[int, ...] | None, size: int) -> np.ndarray:
    """Return the median of each unit, then NaN, (size,); without units each run is one."""
    centres = np.full(size, math.nan)
    if units is None:
        centres[: by_run.size] = by_run
        return centres
    for unit in range(max(units) + 1):
        of_unit = by_run[np.array(units) == unit]
        # between two opposite infinite values lies 0
        centres[unit] = np.nan_to_num(middle(of_unit), nan=0.0, posinf=np.inf, neginf=-np.inf)
    return centres


def least_visible_lead(leads: ArrayLike, error: float, relevant: float = RELEVANT) -> float:
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
      error: one-sided level of the first step of Holm's method.
      relevant: r.
    """
    known = _finite(leads)
    n = known.size
    if n < 2 or min_p(n) > error:
        return 1.0
    centred = math.sqrt(n / (n - 1)) * (known - interval(known, error)[0])
    seed = int.from_bytes(hashlib.sha256(known.tobytes()).digest()[:8])
    drawn = np.random.default_rng(seed).integers(n, size=(LEAD_RESAMPLES, n))
    needed = []
    for indices in np.array_split(drawn, 1 + drawn.size * n // MAX_SUMS):
        low, high = _ends(centred[indices], error)
        needed.append([-low, high])
    own, mirrored = np.concatenate(needed, axis=1)
    least = max(0.0, np.quantile(own, OWN_SHARE), np.median(mirrored))
    return 1.0 - (1.0 - relevant) * math.exp(-least)


def linked(*sets: np.ndarray) -> tuple[int, ...] | None:
    """Return a number for each run, the same for runs that share a set of gains, directly or
    through others.

    Each of `sets` has the number of the set of each run, -1 where there is no run. A law with one
    set links nothing. None if no two runs are linked.
    """
    return _linked(*(tuple(numbers.tolist()) for numbers in sets))


@functools.lru_cache(4096)  # laws use the same sets in all blocks and metrics
def _linked(*sets: tuple[int, ...]) -> tuple[int, ...] | None:
    of_one_set = []
    for numbers in map(np.array, sets):
        distinct = np.unique(numbers[numbers >= 0])
        if distinct.size > 1:
            of_one_set += [numbers == number for number in distinct]
    labels = np.arange(len(sets[0]))
    before = None
    while before is None or np.any(labels != before):
        before = labels.copy()
        for runs in of_one_set:
            labels[runs] = labels[runs].min()
    units, numbers = np.unique(labels, return_inverse=True)
    if units.size == labels.size:
        return None
    return tuple(numbers.tolist())


def first_of_kind(outcomes: np.ndarray, exists: np.ndarray) -> np.ndarray:
    """Return which cells (blocks, seeds) exist and do not repeat the outcomes (laws, blocks, seeds)
    of earlier ones.
    """
    first = np.zeros(exists.shape, bool)
    for k, block in enumerate(exists):
        seeds = np.flatnonzero(block)
        _, kept = np.unique(outcomes[:, k, seeds], axis=1, return_index=True)
        first[k, seeds[kept]] = True
    return first


def corrected_limits(comparisons: Sequence[Comparison]) -> Limits:
    """Return the limits of p-values for comparisons that form one family."""
    pairs = [np.zeros(0)]
    winners = [np.zeros(0)]
    for one in comparisons:
        count = len(one.laws)
        if count > 1:
            both = np.minimum(one.p, one.p.swapaxes(1, 2))
            pairs.append(both[:, *np.triu_indices(count, 1)].ravel())
            winners.append(np.where(np.eye(count), 0.0, one.p).max(axis=2).min(axis=1))
    error = (1.0 - LEVEL) / 2  # two-sided
    of_winner = np.concatenate(winners)
    first = error / max(of_winner.size, 1)
    return Limits(_holm(np.concatenate(pairs), error), _holm(of_winner, error), first)


def _holm(p: np.ndarray, error: float) -> float:
    """Return the p-value up to which Holm's method rejects."""
    allowed = error / np.arange(p.size, 0, -1)
    kept = np.flatnonzero(np.sort(p) > allowed)
    return float(allowed[kept[0]]) if kept.size else error


def ranks(comparison: Comparison) -> list[Rank]:
    """Return the laws' ranks: fewest runs without a value first, then by mean rank; irrelevant
    differences are ties.

    In each block a law's rank is by its number of runs without a value, then by its median.
    """
    lacking = comparison.without_value
    centres = comparison.centres
    behind = lacking[:, None] > lacking
    larger = exceeds(centres[:, None], centres, comparison.floors, comparison.relevant)
    larger &= ~comparison.unranked.transpose(1, 2, 0)
    behind |= (lacking[:, None] == lacking) & larger
    by_block = (len(centres) + 1 + behind.sum(axis=1) - behind.sum(axis=0)) / 2
    means = by_block.mean(axis=1).tolist()
    doubted = np.any(comparison.beaten, axis=1).tolist()
    order = list(zip(lacking.sum(axis=1).tolist(), np.round(means, 9), strict=True))
    found = []
    for law, mean, own, doubt in zip(comparison.laws, means, order, doubted, strict=True):
        place = sum(other < own for other in order) + (1 + order.count(own)) / 2
        found.append(Rank(law, mean, place, not doubt))
    return sorted(found, key=lambda rank: (rank.place, rank.law))


# relevant differences


def exceeds(
    a: ArrayLike, b: ArrayLike, floor: ArrayLike = 0.0, relevant: float = RELEVANT
) -> np.ndarray:
    """Return whether a is larger than b by more than what is relevant, with both at least the floor
    q; a, b >= 0.
    """
    larger = np.asarray(np.maximum(a, floor))
    smaller = np.asarray(np.maximum(b, floor))
    return np.asarray((1.0 - relevant) * larger > smaller)


# the signed-rank test


def p_values(differences: ArrayLike) -> np.ndarray:
    """Return the one-sided p-values with which differences (..., n), NaN for none, lie above 0; 1
    without any.

    The statistic is the number of pairs i <= j whose sum is above 0: without ties and zeros, the
    sum of the positive ranks. Ties and zeros lower it, so that the test keeps its level.
    """
    given = np.asarray(differences, float)
    p = np.ones(given.shape[:-1])
    for at in np.ndindex(p.shape):
        known = given[at][~np.isnan(given[at])]
        if known.size:
            with np.errstate(invalid="ignore"):  # the sum of opposite infinities is not above 0
                above = known[:, None] + known > 0.0  # each pair i < j twice
            p[at] = _tail(known.size, int(above.sum() + above.trace()) // 2)
    return p


def interval(differences: ArrayLike, error: float) -> tuple[float, float, float]:
    """Return the centre of differences (n,), NaN for none, and the ends of its interval.

    The true centre lies beyond each end with probability `error`. Ends are infinite if the sample
    is too small.
    """
    known = _finite(differences)
    if not known.size:
        return math.nan, math.nan, math.nan
    i, j = np.triu_indices(known.size)
    low, high = _ends(known[None], error)
    return float(np.median(known[i] + known[j])) / 2, float(low[0]), float(high[0])


def _finite(differences: ArrayLike) -> np.ndarray:
    """Return the differences that are known, with finite numbers in place of infinite ones."""
    known = np.asarray(differences, float)
    return np.clip(known[~np.isnan(known)], -MAX_LOG, MAX_LOG)


def _ends(samples: np.ndarray, error: float) -> np.ndarray:
    """Return the ends of the intervals of samples (m, n), as (2, m); infinite if n is too small."""
    i, j = np.triu_indices(samples.shape[1])
    enough = np.flatnonzero(_tail(samples.shape[1], np.arange(i.size + 1)) <= error)
    if not enough.size:
        return np.array([[-math.inf], [math.inf]]).repeat(len(samples), axis=1)
    at = i.size - enough[0], enough[0] - 1
    sums = np.partition(samples[:, i] + samples[:, j], at, axis=1)
    return sums[:, at].T / 2


def min_p(n: int) -> float:
    """Return the smallest one-sided p-value that n differences can have."""
    return 2.0**-n


def _tail(n: int, sums: int | np.ndarray) -> np.ndarray:
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
