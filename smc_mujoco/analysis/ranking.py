"""Comparison of laws on the runs that they share: which law is better in which block, and places
over all blocks.

Blocks and samples are as in `bootstrap`. A unit is one run, with the gains that one search found,
in one instance of the conditions; or all runs that share sets of gains of either law, directly or
through others: its lead is the median of theirs. A run that repeats the results of both laws is not
counted.

The lead. With y a law's value in a run, y' that of the same run at half the physics step, and rho
how the value changes over the last part of the run, which is the share 1/p of it, with p = 5
without a periodic load,

    high = max(y, y') max(1, rho)^p         low = min(y, y') min(1, rho)^p
    d_i  = log( max(low of the rival, q) / max(high of the law, q) )        one for each unit i

q is the smallest value that matters in the problem, see `paired_runs.floor`. If the trend goes on,
the value changes by the factor rho^p in as much time again: only a law that rises and a rival that
falls are charged. rho is the median of a law's runs in a block, and 1 if it differs from 1 by no
more than what is relevant. Where only some of the runs were repeated at half the step, the median
of their relative changes widens the others. For shares, d is the difference.

The test. A law is better than a rival if the number of pairs i <= j with d_i + d_j > -2 log(1 - r)
is too large for the exact law of the signed ranks, see `signed_rank`; r is the share that is
relevant. So it rejects that the law is not lower by the share r. It is monotone: d never falls
because a value of the law's own falls, or one of its rival's rises; so a law that becomes better in
its block stays better than its rivals. There is one exception. Where only some runs were repeated,
a value that falls alone is farther from that at half the step, and widens the others. The test does
not depend on the metric's unit. Besides, the law must not fail more often.

Winners. The winner of a block is better than every other law. Its p-value is the largest of those
against the others, and needs no correction for their number (S. Gutmann, Z. Maymin, Annals of
Statistics 15(1), 1987): the error is largest where two laws are equal and the others far behind.
The family is all blocks of a metric in a table, however the table is grouped into boards. It is
corrected by S. Holm's method (Scandinavian Journal of Statistics 6(2), 1979), with two-sided
p-values: the probability of any wrong winner of a metric is at most 5 %.

The best. Where no law wins, a law may be the best unless another is better, with a p-value of at
most 5 % / 15: multiple comparisons with the best (J. C. Hsu, Annals of Statistics 12(3), 1984) with
Bonferroni's inequality. So in each block the law that is best is taken for a worse one with a
probability of at most 5 %, beside up to 15 rivals; with more, the level is 5 % over their number.
It is that of 16 laws however few there are, so that it does not depend on a law that is added. It
is not corrected over blocks, as the printed intervals are not.

What an added law changes. It changes no values and intervals of others. If it is not among the best
itself, it does not change which others are, as far as was seen (`docs/winners.md`). If it is, it
takes those out that it is better than, and may keep a law from winning, which brings back those
that only a winner beats. No rule could do without both: let a be better than b, and c level with
either. Then {a, b} has a winner, and {a, c}, {b, c} and {a, b, c} have none.

Below the floor. A law is below q in a block if its high values are at most q in more than half of
its units. Two laws below q are not ranked: neither is better, and they have no least visible lead.
If only one is, and is better, its lead is at least the median of the rival's low values over q.
Beside a law that is below, no law above q is among the best.

Too few samples. A law whose sets of gains, or runs, are too few for a p-value as small as that of a
winner or of the best is not ranked; the others are ranked without it.

No winner. Two laws are level only if there are 12 units or more and the 95 % interval of their
ratio lies within 10 %. Otherwise one cannot tell, and `least_visible_lead` says which lead would
have been seen.

A law with a run that failed, has no value, or has not arrived (`metrics.catalogue.arrived`) wins
nothing, and is not among the best. In every order the laws with fewer runs without a value come
first.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smc_mujoco.analysis.bootstrap import LEVEL, middle
from smc_mujoco.analysis.differ import differ
from smc_mujoco.analysis.relevant import RELEVANT
from smc_mujoco.analysis.signed_rank import (
    MAX_LOG,
    interval,
    least_visible_lead,
    min_p,
    p_values,
)
from smc_mujoco.common.constraints import Number, constrained

Relevant = Annotated[float, Number(low=0.0, high=0.5)]
# p where the last part is a fifth of a run: a trend that lasts as long again goes on for 5 of them
TREND_POWER = 5.0
LEVEL_SHARE = 0.1  # laws are level if the interval of their ratio lies within this share; chosen
MIN_LEVEL_UNITS = 12  # with fewer units no laws are called level; chosen
# of log rho: a value that has vanished within the last fifth of a run has fallen enough
MAX_RISE = 60.0
WIN_ERROR = (1.0 - LEVEL) / 2  # one-sided, of any wrong winner of a metric
BEST_ERROR = 1.0 - LEVEL  # of the best law of a block taken for a worse one
RIVALS = 15  # of a law, for which levels are corrected even if it has fewer; chosen


class Rank(NamedTuple):
    """A law's place among laws, 1 the best; ties share the mean of their places."""

    law: str  # its name
    mean: float  # mean rank over the blocks, which orders laws and decides nothing
    place: float  # by the number of runs without a value, then by mean rank
    best: bool  # whether the law is among the best of every block


class Effect(NamedTuple):
    """How a law's values compare with a rival's, in one block."""

    value: float  # ratio of the law's values to the rival's
    low: float  # of its 95 % interval
    high: float
    ahead: int  # number of units in which the law is better by more than what is relevant
    samples: int  # number of units
    sets: bool  # whether the units are sets of gains; otherwise they are seeds
    below: bool = False  # whether the law is below the floor and the rival is not
    relevant: float = RELEVANT  # share of a value that is


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
      powers: p of all blocks, or of each.
      rivals: the number of a law's rivals for which levels are corrected, even if it has fewer.
      looks: how often the laws may be judged, each time with more units; every look has an equal
        share of the errors.
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
        powers: ArrayLike = TREND_POWER,
        rivals: int = RIVALS,
        looks: int = 1,
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
        of_blocks = np.broadcast_to(np.asarray(powers, float), blocks)
        self.low, self.high = bounds(
            self.cells, self.halves, rises, of_blocks, self.floors, shares, relevant
        )
        plain = self.cells if shares else _logarithms(self.cells, self.floors)
        self.beyond = relevant if shares else -math.log1p(-relevant)  # what d must exceed
        ran = ~np.isnan(self.cells[0])
        # runs that failed, have no value or have not arrived
        missing = self._cube(arrived, 1) == 0
        self.away = np.isinf(self.cells) | missing
        self.below = np.zeros((count, blocks), bool)
        self.sets = np.ones((count, blocks), int)  # number of sets of gains of a law's runs
        self.units = np.zeros((count, blocks), int)  # of each law alone: its sets, or its runs
        # d of the first law over the second by unit, then NaN; and without halves and trends
        self.leads = np.full((blocks, count, count, seeds), math.nan)
        self.plain = self.leads.copy()
        for k in range(blocks):
            for a in range(count):
                self.sets[a, k], self.units[a, k] = _counted(gains[a, k, ran[k]])
                # the law alone, then beside each other
                for b in range(a + 1):
                    pair = sorted({a, b})
                    first = first_of_kind(results[pair, k][:, None], ran[[k]])[0]
                    units = linked(*gains[pair, k][:, first])
                    if a == b:
                        self.below[a, k] = self._is_below(a, k, first, units)
                    else:
                        self._lead(a, b, k, first, units, plain)
                        self._lead(b, a, k, first, units, plain)
        # (blocks, laws, laws), one-sided p-value, not corrected, that a law is better; 1 of itself
        self.p = p_values(self.leads - self.beyond)
        self.p[self.pairs_below_floor] = 1.0
        # the largest p-values with which a law is better than another, and wins a block
        self.limit = BEST_ERROR / looks / max(count - 1, rivals)
        self.error = WIN_ERROR / looks  # of any wrong winner
        self.family = 1  # number of blocks for which winners are corrected
        self.winning = self.first = self.error  # after Holm's last step, and after his first
        corrected([self])

    def _is_below(
        self, law: int, block: int, runs: np.ndarray, units: tuple[int, ...] | None
    ) -> bool:
        """Return whether a law's high values are below the floor in more than half of its units."""
        floor = self.floors[block]
        if self.shares or floor <= 0.0:
            return False
        highest = self.high[law, block, runs]
        high = _by_unit(highest, units, self.cells.shape[2])
        # of an even number, the median is above q if only half are at most q
        return bool(middle(high) <= math.log(floor))

    def _lead(
        self,
        law: int,
        rival: int,
        block: int,
        runs: np.ndarray,
        units: tuple[int, ...] | None,
        plain: np.ndarray,
    ) -> None:
        """Set the lead of a law over a rival by unit, and that without halves and trends."""
        seeds = self.cells.shape[2]
        difference = _difference(self.low[rival, block], self.high[law, block])
        charged = difference[runs]
        raw = _difference(plain[rival, block], plain[law, block])
        as_run = raw[runs]
        self.leads[block, law, rival] = _by_unit(charged, units, seeds)
        self.plain[block, law, rival] = _by_unit(as_run, units, seeds)

    def _cube(self, by_law: Mapping[str, ArrayLike] | None, unknown: ArrayLike) -> np.ndarray:
        if by_law:
            return np.array([np.atleast_2d(by_law[law]) for law in self.laws], float)
        return np.broadcast_to(unknown, self.cells.shape)

    @property
    def centres(self) -> np.ndarray:
        """The medians, or means, over the seeds, (laws, blocks)."""
        if self.shares:
            return np.nanmean(self.cells, axis=2)
        return middle(self.cells)

    @property
    def pairs_below_floor(self) -> np.ndarray:
        """Whether two laws are both below the floor, (blocks, laws, laws)."""
        return self.below.T[:, :, None] & self.below.T[:, None, :]

    @property
    def without_value(self) -> np.ndarray:
        """The number of runs that failed or have no value, (laws, blocks); 0 for shares."""
        return np.isinf(self.cells).sum(axis=2)

    @property
    def seeds(self) -> np.ndarray:
        """The number of seeds of each block, (blocks,)."""
        ran = ~np.isnan(self.cells[0])
        return ran.sum(axis=1)

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
    def ranked(self) -> np.ndarray:
        """Whether the units are enough for a law to win, or to be worse than another, beside
        another such law, (laws, blocks).
        """
        level = max(self.limit, self.first)
        ranked = min_p(self.units) <= level
        return ranked & (ranked.sum(axis=0) > 1)

    @property
    def better(self) -> np.ndarray:
        """Whether a law is better than another, (blocks, laws, laws)."""
        better = (self.p <= self.limit) & self._eligible
        for block, ranked, winner in zip(better, self.ranked.T, self.winners, strict=True):
            if winner is not None:
                losers = np.array(self.laws) != winner
                block[self.laws.index(winner)] |= ranked & losers
        return better

    @property
    def winner_p(self) -> np.ndarray:
        """The one-sided p-value with which a law is better than every other that is ranked,
        (blocks, laws); 1 of a law that is not.
        """
        ranked = self.ranked.T
        itself = np.eye(len(self.laws), dtype=bool)
        against = ranked[:, None, :] & ~itself
        losses = np.where(against, self.p, 0.0)
        worst = losses.max(axis=2)
        return np.where(ranked, worst, 1.0)

    @property
    def winners(self) -> list[str | None]:
        """The law of each block that is better than every other, if there is one."""
        eligible = self._eligible | ~self.ranked.T[:, None, :]
        significant = self.winner_p <= self.winning
        wins = significant & np.all(eligible, axis=2)
        wins &= ~self.away.any(axis=2).T
        names = np.array([*self.laws, None])
        any_win = wins.any(axis=1)
        first = np.where(any_win, wins.argmax(axis=1), -1)
        return names[first].tolist()

    @property
    def worse(self) -> np.ndarray:
        """Whether another law is better, (laws, blocks)."""
        return np.asarray(self.better.any(axis=1)).T

    @property
    def best(self) -> np.ndarray:
        """Whether a law may be the best, (laws, blocks): the winner, or where there is none, no
        other is better, its units and those of another law are enough to say so, all its runs have
        a value and have arrived, and it is below the floor if one of these is.
        """
        enough = self.ranked & (min_p(self.units) <= self.limit)
        enough &= enough.sum(axis=0) > 1
        fails = self.away.any(axis=2)
        best = enough & ~self.worse & ~fails
        lowest = best & self.below
        best = np.where(lowest.any(axis=0), lowest, best)
        for k, winner in enumerate(self.winners):
            if winner is not None:
                best[:, k] = np.array(self.laws) == winner
        return best

    @property
    def level(self) -> np.ndarray:
        """Whether two laws are level: the interval of their ratio lies within 10 %, or the same
        runs settle, (blocks, laws, laws).
        """
        if self.shares:
            within = ~np.any(self.leads**2 > 0.0, axis=3)
        else:
            within = p_values(self.leads - math.log1p(-LEVEL_SHARE)) <= WIN_ERROR
        enough = self.samples >= MIN_LEVEL_UNITS
        level = within & within.swapaxes(1, 2) & enough
        level &= ~(self.below.T[:, :, None] | self.below.T[:, None, :])
        return level | np.eye(len(self.laws), dtype=bool)

    def effect(self, block: int, law: str, rival: str) -> Effect:
        """Return how a law compares with a rival in a block, with a 95 % interval."""
        a = self.laws.index(law)
        b = self.laws.index(rival)
        leads = self.leads[block, a, b]
        with np.errstate(over="ignore"):
            low = np.exp(interval(self.leads[block, b, a], WIN_ERROR)[1])
            high = np.exp(-interval(leads, WIN_ERROR)[1])
            plain = self.plain[block, a, b]
            value = np.exp(-interval(plain, WIN_ERROR)[0])
        below = bool(self.below[a, block] and not self.below[b, block])
        if below:
            low = 0.0
            high = 1.0
            if self.better[block, a, b]:
                nearest = np.nanmedian(self.low[b, block])
                floor = math.log(self.floors[block])
                high = math.exp(floor - nearest)
            value = high
        return Effect(
            value=float(np.clip(value, low, high)),
            low=float(low),
            high=float(high),
            ahead=int((leads > self.beyond).sum()),
            samples=int(self.samples[block, a, b]),
            sets=bool(self.sets[[a, b], block].max() > 1),
            below=below,
            relevant=self.relevant,
        )

    def visible(self, block: int, law: str, rival: str) -> float:
        """Return the least lead of a law over a rival with which a winner is seen with a
        probability of 80 %, as a share; NaN if one of them is below the floor.

        It makes up for what half the step and trends charge, too.
        """
        pair = block, self.laws.index(law), self.laws.index(rival)
        ours_or_theirs = self.below[list(pair[1:]), block]
        if ours_or_theirs.any():
            return math.nan
        lead = least_visible_lead(self.leads[pair], self.first, self.relevant)
        return 1.0 - (1.0 - lead) * (1.0 - self.charged(block, law, rival))

    def charged(self, block: int, law: str, rival: str) -> float:
        """Return the lead of a law over a rival that half the step and trends take from it, as a
        share.
        """
        pair = block, self.laws.index(law), self.laws.index(rival)
        difference = _difference(self.plain[pair], self.leads[pair])
        charged = np.nan_to_num(middle(difference))
        return -math.expm1(-max(float(charged), 0.0))

    def step_change(self, block: int, law: str) -> tuple[float, float] | None:
        """Return the medians of a law's runs that were repeated at half the physics step, before
        and after; None unless they `differ`.
        """
        a = self.laws.index(law)
        half = self.halves[a, block]
        again = ~np.isnan(half)
        if self.shares or not again.any():
            return None
        first = middle(self.cells[a, block, again])
        pair = float(first), float(middle(half))
        floor = float(self.floors[block])
        changed = differ(pair, floor, bool(self.first_order[block]))
        return pair if changed else None


def bounds(
    cells: np.ndarray,
    halves: np.ndarray,
    trends: np.ndarray,
    powers: np.ndarray,
    floors: np.ndarray,
    shares: bool,
    relevant: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return low and high of every run, (laws, blocks, seeds): logarithms, or the shares
    themselves.
    """
    if shares:
        return np.fmin(cells, halves), np.fmax(cells, halves)
    as_run = _logarithms(cells)
    half = _logarithms(halves)
    of_halves = _logarithms(halves, floors)
    of_cells = _logarithms(cells, floors)
    change = np.abs(_difference(of_halves, of_cells))
    # of a law in a block, for its runs that were not repeated
    typical = np.nan_to_num(middle(change))
    widening = np.minimum(typical, MAX_LOG)[..., None]
    with np.errstate(divide="ignore"):
        rise = np.log(middle(trends))[..., None]
    matters = np.abs(rise) > (relevant or RELEVANT)
    clipped = np.clip(rise, -MAX_RISE, MAX_RISE)
    rise = powers[:, None] * np.where(matters, clipped, 0.0)
    q = _logarithms(floors[:, None])
    once = np.isnan(half)
    lowest = np.where(once, as_run - widening, half)
    low = np.fmin(as_run, lowest) + np.minimum(rise, 0.0)
    highest = np.where(once, as_run + widening, half)
    high = np.fmax(as_run, highest) + np.maximum(rise, 0.0)
    return np.maximum(low, q), np.maximum(high, q)


def _logarithms(values: np.ndarray, floors: ArrayLike = 0.0) -> np.ndarray:
    """Return the logarithms of values (laws, blocks, seeds), at least those of the floors."""
    floor = np.reshape(floors, (-1, 1))
    least = np.maximum(floor, np.finfo(float).tiny)
    return np.log(np.maximum(np.abs(values), least))


def _difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a - b; 0 where both are the same infinity."""
    with np.errstate(invalid="ignore"):
        same = (a == b) & np.isinf(a)
        return np.where(same, 0.0, a - b)


def _by_unit(by_run: np.ndarray, units: tuple[int, ...] | None, size: int) -> np.ndarray:
    """Return the median of each unit, then NaN, (size,); without units each run is one."""
    centres = np.full(size, math.nan)
    if units is None:
        centres[: by_run.size] = by_run
        return centres
    for unit in range(max(units) + 1):
        of_unit = by_run[np.array(units) == unit]
        # between two opposite infinite values lies 0
        centre = middle(of_unit)
        centres[unit] = np.nan_to_num(centre, nan=0.0, posinf=np.inf, neginf=-np.inf)
    return centres


def _counted(sets: np.ndarray) -> tuple[int, int]:
    """Return the number of sets of gains and the number of units of a law's runs, (runs,)."""
    units = linked(sets)
    return np.unique(sets).size, sets.size if units is None else max(units) + 1


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
            for number in distinct:
                of_one_set.append(numbers == number)
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
        outcomes_there = outcomes[:, k, seeds]
        _, first_seeds = np.unique(outcomes_there, axis=1, return_index=True)
        first[k, seeds[first_seeds]] = True
    return first


def corrected(comparisons: Sequence[Comparison]) -> None:
    """Correct the winners' limits of comparisons whose blocks form one family."""
    with_rivals = [comparison for comparison in comparisons if len(comparison.laws) > 1]
    blocks = sum(len(comparison.floors) for comparison in with_rivals)
    for comparison in with_rivals:
        comparison.family = blocks
        comparison.first = comparison.error / blocks
    p = [comparison.winner_p.min(axis=1) for comparison in with_rivals]
    for comparison in with_rivals:
        comparison.winning = holm(np.concatenate(p), comparison.error)


def holm(p: np.ndarray, error: float) -> float:
    """Return the p-value up to which Holm's method rejects."""
    allowed = error / np.arange(p.size, 0, -1)
    accepted = np.flatnonzero(np.sort(p) > allowed)
    return float(allowed[accepted[0]]) if accepted.size else error


def needed_to_win(blocks: int) -> int:
    """Return the number of units from which a law can win in one of the blocks of a family."""
    return _units(WIN_ERROR / blocks)


def needed_to_rank(laws: int) -> int:
    """Return the number of units from which one of several laws can be taken for a worse one."""
    return _units(BEST_ERROR / max(laws - 1, RIVALS))


def _units(error: float) -> int:
    n = 1
    while min_p(n) > error:
        n += 1
    return n


def ranks(comparison: Comparison) -> list[Rank]:
    """Return the laws' ranks over all blocks, see `placed` and `ranks_by_block`."""
    lacking = comparison.without_value
    tied = comparison.pairs_below_floor.transpose(1, 2, 0)
    by_block = ranks_by_block(
        lacking, comparison.centres, comparison.floors, comparison.relevant, tied
    )
    best = np.all(comparison.best, axis=1)
    return placed(comparison.laws, by_block, lacking, best)


def ranks_by_block(
    lacking: np.ndarray,
    centres: np.ndarray,
    floors: ArrayLike = 0.0,
    relevant: float = RELEVANT,
    tied: ArrayLike = False,
) -> np.ndarray:
    """Return the rank of each law in each block, (laws, blocks): by the number of runs without a
    value, then by median. Irrelevant differences and laws that are `tied` share the mean of ranks.
    """
    behind = lacking[:, None] > lacking
    beats = exceeds(centres[:, None], centres, floors, relevant)
    larger = beats & ~np.asarray(tied)
    behind |= (lacking[:, None] == lacking) & larger
    ahead = len(centres) + 1 + behind.sum(axis=1)
    return (ahead - behind.sum(axis=0)) / 2


def placed(
    laws: Sequence[str], by_block: np.ndarray, lacking: np.ndarray, best: np.ndarray
) -> list[Rank]:
    """Return laws by the number of their runs without a value, then by mean rank over the blocks.

    Args:
      by_block, lacking: ranks and numbers of runs without a value, (laws, blocks).
      best: whether a law may be the best, (laws,).
    """
    means = by_block.mean(axis=1).tolist()
    lacked = lacking.sum(axis=1).tolist()
    rounded = np.round(means, 9).tolist()
    order = list(zip(lacked, rounded, strict=True))
    placed_laws = []
    for law, mean, own, star in zip(laws, means, order, best.tolist(), strict=True):
        better = sum(standing < own for standing in order)
        place = better + (1 + order.count(own)) / 2
        placed_laws.append(Rank(law, mean, place, star))
    return sorted(placed_laws, key=lambda rank: (rank.place, rank.law))


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
