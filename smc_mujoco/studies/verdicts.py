"""Who wins a block of a comparison, by how much, or why nobody does: facts for boards."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.analysis.paired_runs import OBJECTIVE, OF_J, SETTLES
from smc_mujoco.analysis.ranking import Comparison, Effect, needed_to_rank, needed_to_win
from smc_mujoco.answers.facts import Barred, Fact, Lead, NotRanked, Open, Tied, Trails, Verdict
from smc_mujoco.common.aliases import Array, Names
from smc_mujoco.studies.board import label_of


def nearest(comparison: Comparison, at: int, law: str, rivals: Sequence[str]) -> tuple[str, Effect]:
    """Return the rival over which the lead of a law is least in a block, by the upper end of the
    interval, and how the two compare.
    """
    effects = {rival: comparison.effect(at, law, rival) for rival in rivals}
    rival = max(rivals, key=lambda rival: effects[rival].high)
    return rival, effects[rival]


class BlockComparison(NamedTuple):
    """The laws of a comparison in one of its blocks."""

    comparison: Comparison
    block: int
    metric: str
    floor: str  # in words, such as "0.01 rad"; "" where it is not known
    family: int  # number of blocks for which winners are corrected
    untuned: Names = ()  # the laws with default gains, over which no other is named the winner

    def named(self, chosen: Array) -> Names:
        """Return the laws of which an array (laws, blocks) is true."""
        return tuple(np.array(self.comparison.laws)[chosen[:, self.block]].tolist())

    def by_law(self, values: Array) -> dict[str, Any]:
        """Return law -> its value in an array (laws, blocks)."""
        return dict(zip(self.comparison.laws, values[:, self.block].tolist(), strict=True))

    @property
    def label(self) -> str:
        """The metric in words."""
        return label_of(self.metric)

    @property
    def away(self) -> Names:
        """Laws with runs that failed or have not arrived, which do not win."""
        return self.named(self.comparison.away.any(axis=2))

    @property
    def few(self) -> Names:
        """Laws that are not ranked, as they have so few sets of gains or runs."""
        return self.named(~self.comparison.ranked)

    @property
    def order(self) -> list[str]:
        """The winner first, then by failed runs, then by median."""
        winner = self.comparison.winners[self.block]
        lacking = self.by_law(self.comparison.without_value)
        medians = self.by_law(self.comparison.centres)
        return sorted(medians, key=lambda law: (law != winner, lacking[law], medians[law]))

    # verdicts

    @property
    def verdict(self) -> Verdict | None:
        """Who wins, or why nobody does; None for a single law."""
        laws = self.comparison.laws
        winner = self.comparison.winners[self.block]
        barred = tuple(law for law in self.untuned if law != winner)
        if len(laws) < 2:
            return None
        if winner and barred:
            return Barred(metric=self.label, laws=barred, defaults=True)
        if winner:
            return self.lead(winner)
        if self.away == laws:
            return Barred(metric=self.label, laws=laws, defaults=False)
        return self._undecided

    def lead(self, winner: str) -> Lead:
        """Return the least lead of the winner; of a share it has no numbers."""
        comparison, block = self.comparison, self.block
        if comparison.shares:
            return Lead(law=winner, rival="", metric=self.label)
        rivals = [law for law in self.order[1:] if law not in self.few]
        rival, effect = nearest(comparison, block, winner, rivals)
        lacking = self.by_law(comparison.without_value)[rival]
        medians = self.by_law(comparison.centres)
        numbers = {}
        if not lacking:
            numbers["low"] = 1.0 - effect.high
            if not effect.below or not self.floor:
                numbers |= {"high": 1.0 - effect.low, "ratio": effect.value}
        unit = OF_J if self.metric == OBJECTIVE else "runs"
        return Lead(
            law=winner,
            rival=rival,
            metric=self.label,
            gaps=f"{lacking} of {comparison.seeds[block]}" if lacking else "",
            floor=self.floor if effect.below else "",
            ahead=effect.ahead,
            samples=effect.samples,
            unit="sets of gains" if effect.sets else unit,
            lower=tuple(law for law in rivals if medians[law] < medians[winner]),
            **numbers,
        )

    @property
    def _undecided(self) -> Tied | Open:
        """Why no law wins, where one might."""
        comparison, block, metric = self.comparison, self.block, self.label
        laws, best = comparison.laws, self.named(comparison.best)
        if self.metric == SETTLES and {*comparison.centres[:, block].tolist()} in ({0.0}, {1.0}):
            return Tied(metric=metric, laws=laws)
        lowest = self.named(comparison.below)
        if lowest != laws or self.away:
            lowest = tuple(law for law in lowest if law in best)
        if len(lowest) > 1:
            return Tied(metric=metric, laws=lowest, floor=self.floor)
        if needed := self.needed:
            return Open(metric=metric, laws=laws, needed=needed, unit=self.unit)
        starred = comparison.best[:, block]
        if len(best) > 1 and comparison.level[block][np.ix_(starred, starred)].all():
            return Tied(metric=metric, laws=best)
        hidden, charged = self._hidden
        return Open(
            metric=metric,
            laws=best or self.named(~comparison.worse),
            hidden=hidden,
            charged=charged if charged > comparison.relevant else 0.0,
        )

    @property
    def _hidden(self) -> tuple[float, float]:
        """The least lead of the first of the best laws with which it would have been seen to be
        better than all others of them, and what half the step and trends take from it, shares; NaN
        and 0 without a test.
        """
        comparison, best = self.comparison, self.named(self.comparison.best)
        leads = [(math.nan, 0.0)]
        if not comparison.shares:
            first, *rivals = [law for law in self.order if law in best] or [""]
            for rival in rivals:
                pair = self.block, first, rival
                leads.append((comparison.visible(*pair), comparison.charged(*pair)))
        return max(leads, key=lambda lead: (not math.isnan(lead[0]), lead[0]))

    @property
    def behind(self) -> dict[str, Trails]:
        """The laws that others are better than."""
        comparison, order = self.comparison, self.order
        better = comparison.better[self.block]
        behind = {}
        for law in order[1:]:
            beaten_by = better[:, comparison.laws.index(law)]
            ahead = tuple(rival for rival in order if beaten_by[comparison.laws.index(rival)])
            if not ahead:
                continue
            times = math.nan
            if not comparison.shares:
                effect = comparison.effect(self.block, ahead[0], law)
                if not effect.below and 0.0 < effect.value < math.inf:
                    times = 1.0 / effect.value
            behind[law] = Trails(
                law=law, leader=ahead[0], metric=self.label, times=times, ahead=ahead
            )
        return behind

    # samples

    @property
    def samples(self) -> int:
        """The largest number of samples of any two laws; for one law, of its runs."""
        if len(self.comparison.laws) == 1:
            return int(self.comparison.seeds[self.block])
        return int(self.comparison.samples[self.block].max())

    @property
    def _sets(self) -> tuple[int, bool]:
        """The smallest number of sets of gains of a law that has several, 1 if none has, and
        whether a law has one set.
        """
        sets = self.comparison.sets[:, self.block]
        return min(sets[sets > 1].tolist(), default=1), bool((sets == 1).any())

    @property
    def unit(self) -> str:
        """What a sample is."""
        sets, single = self._sets
        if sets == 1:
            return "runs"
        return "sets of gains or runs" if single else "sets of gains"

    @property
    def needed(self) -> int:
        """How many samples a verdict takes, where there are fewer; 0 if these are enough."""
        laws = self.comparison.laws
        least, rank = needed_to_win(self.family), needed_to_rank(len(laws))
        if len(laws) - len(self.few) < 2 or self.samples < least:
            return max(least, self.samples + 1)
        return rank if self.samples < rank else 0

    @property
    def not_ranked(self) -> list[NotRanked]:
        """The laws with too few samples to be ranked, or where none wins to be among the best,
        beside others that are.
        """
        comparison, laws = self.comparison, self.comparison.laws
        win, rank = needed_to_win(self.family), needed_to_rank(len(laws))
        units = self.by_law(comparison.units)
        needed = dict.fromkeys(self.few, min(win, rank))
        if comparison.winners[self.block] is None and self.named(comparison.best):
            rivals = self.named(~comparison.worse & ~comparison.away.any(axis=2))
            needed |= {law: rank for law in rivals if units[law] < rank}
        if len(laws) - len(self.few) < 2:
            return []
        facts = []
        for law, least in needed.items():
            of_law = {"law": law, "samples": units[law], "needed": least}
            facts.append(NotRanked(metric=self.label, unit=self.unit, **of_law))
        return facts

    def sample(self, seeds: int) -> Fact:
        """Return what a number is of, in so many seeds in which every law ran. In some every law
        may repeat an earlier result.
        """
        runs = int(self.comparison.seeds[self.block])
        sets, single = self._sets
        return Fact(
            "sample",
            seeds=seeds,
            distinct=runs if runs < seeds else None,
            single=single and sets > 1,
            **{"least" if self.samples > sets else "sets": sets if sets > 1 else None},
        )
