"""Laws compared in one metric on a plant in a condition: who wins, by how much, or why nobody does,
as facts for boards.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from smc_mujoco.analysis.paired_runs import OBJECTIVE, OF_J, SETTLES
from smc_mujoco.analysis.ranking import Comparison, Effect, needed_to_rank, needed_to_win
from smc_mujoco.answers import answers
from smc_mujoco.answers.facts import Barred, Fact, Lead, NotRanked, Open, Tied, Trails, Verdict
from smc_mujoco.common.aliases import Array, Names, Pair
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.metrics.catalogue import CATALOGUE

LABELS = {SETTLES: answers.SHARE, OBJECTIVE: answers.ON_PLANT}


def label_of(metric: str) -> str:
    """Return a metric in words, such as "final error"."""
    return LABELS.get(metric) or CATALOGUE[metric].label


def nearest(comparison: Comparison, at: int, law: str, rivals: Sequence[str]) -> tuple[str, Effect]:
    """Return the rival over which the lead of a law is least in a block, by the upper end of the
    interval, and how the two compare.
    """
    effects = {rival: comparison.effect(at, law, rival) for rival in rivals}
    rival = max(rivals, key=lambda rival: effects[rival].high)
    return rival, effects[rival]


@keyword_dataclass
class Block:
    """Laws compared on one plant in one condition. A law's name is the key of the mappings."""

    comparison: Comparison
    index: int = 0  # which of its blocks
    metric: str
    plant: str
    condition: str
    seeds: int  # in which every law ran
    floor: str = ""  # in words, such as "0.01 rad"; "" where it is not known
    untuned: Names = ()  # the laws with default gains, over which no other is named the winner
    bound: float = math.nan  # of |u|, in the unit of u; NaN where it is not one number

    def _named(self, chosen: Array) -> Names:
        """Return the laws of which an array (laws, blocks) is true."""
        return tuple(np.array(self.comparison.laws)[chosen[:, self.index]].tolist())

    def _by_law(self, values: Array) -> dict[str, Any]:
        """Return law -> its value in an array (laws, blocks)."""
        return dict(zip(self.comparison.laws, values[:, self.index].tolist(), strict=True))

    @property
    def label(self) -> str:
        """The metric in words."""
        return label_of(self.metric)

    # numbers

    @cached_property
    def medians(self) -> dict[str, float]:
        """Medians over the seeds; for "settles" the shares of runs that do not settle."""
        return self._by_law(self.comparison.centres)

    @property
    def lacking(self) -> dict[str, int]:
        """Numbers of runs that failed or have no value."""
        return self._by_law(self.comparison.without_value)

    @property
    def best(self) -> Names:
        """Laws that may be the best, see `ranking`."""
        return self._named(self.comparison.best)

    @cached_property
    def away(self) -> Names:
        """Laws with runs that failed or have not arrived, which do not win."""
        return self._named(self.comparison.away.any(axis=2))

    @property
    def below(self) -> Names:
        """Laws below the floor, which are not ranked among themselves."""
        return self._named(self.comparison.below)

    @property
    def rising(self) -> Names:
        """Laws whose median is below the floor, but need not stay there."""
        compared = self.comparison
        return self._named((compared.centres <= compared.floors) & ~compared.below)

    @property
    def few(self) -> Names:
        """Laws that are not ranked, as they have so few sets of gains or runs."""
        return self._named(~self.comparison.ranked)

    @property
    def by_step(self) -> dict[str, Pair]:
        """Medians at the physics step and at half of it, of laws where they differ much."""
        changes = {
            law: self.comparison.step_change(self.index, law) for law in self.comparison.laws
        }
        return {law: change for law, change in changes.items() if change}

    @property
    def runs(self) -> int:
        """Distinct runs; in the other seeds every law repeats the result of an earlier one."""
        return int(self.comparison.seeds[self.index])

    @property
    def order(self) -> list[str]:
        """The winner first, then by failed runs, then by median."""
        winner = self.comparison.winners[self.index]
        lacking, medians = self.lacking, self.medians
        return sorted(medians, key=lambda law: (law != winner, lacking[law], medians[law]))

    # verdicts

    @property
    def winner(self) -> str | None:
        """The law that is better than every other, among several."""
        return self.verdict.law if isinstance(self.verdict, Lead) else None

    @property
    def barred(self) -> bool:
        """Whether the law that is better than every other does not win, as others have their
        default gains.
        """
        return isinstance(self.verdict, Barred) and self.verdict.defaults

    @cached_property
    def verdict(self) -> Verdict | None:
        """Who wins, or why nobody does; None for a single law."""
        laws = self.comparison.laws
        winner = self.comparison.winners[self.index]
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
        comparison = self.comparison
        if comparison.shares:
            return Lead(law=winner, rival="", metric=self.label)
        rivals = [law for law in self.order[1:] if law not in self.few]
        rival, effect = nearest(comparison, self.index, winner, rivals)
        lacking = self.lacking[rival]
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
            gaps=f"{lacking} of {self.runs}" if lacking else "",
            floor=self.floor if effect.below else "",
            ahead=effect.ahead,
            samples=effect.samples,
            unit="sets of gains" if effect.sets else unit,
            lower=tuple(law for law in rivals if self.medians[law] < self.medians[winner]),
            **numbers,
        )

    @property
    def _undecided(self) -> Tied | Open:
        """Why no law wins, where one might."""
        comparison, metric = self.comparison, self.label
        laws, best = comparison.laws, self.best
        if self.metric == SETTLES and {*self.medians.values()} in ({0.0}, {1.0}):
            return Tied(metric=metric, laws=laws)
        lowest = self.below
        if lowest != laws or self.away:
            lowest = tuple(law for law in lowest if law in best)
        if len(lowest) > 1:
            return Tied(metric=metric, laws=lowest, floor=self.floor)
        if needed := self.needed:
            return Open(metric=metric, laws=laws, needed=needed, unit=self.unit)
        starred = comparison.best[:, self.index]
        if len(best) > 1 and comparison.level[self.index][np.ix_(starred, starred)].all():
            return Tied(metric=metric, laws=best)
        hidden, charged = self._hidden
        return Open(
            metric=metric,
            laws=best or self._named(~comparison.worse),
            hidden=hidden,
            charged=charged if charged > comparison.relevant else 0.0,
        )

    @property
    def _hidden(self) -> tuple[float, float]:
        """The least lead of the first of the best laws with which it would have been seen to be
        better than all others of them, and what half the step and trends take from it, shares; NaN
        and 0 without a test.
        """
        comparison, best = self.comparison, self.best
        leads = [(math.nan, 0.0)]
        if not comparison.shares:
            first, *rivals = [law for law in self.order if law in best] or [""]
            for rival in rivals:
                pair = self.index, first, rival
                leads.append((comparison.visible(*pair), comparison.charged(*pair)))
        return max(leads, key=lambda lead: (not math.isnan(lead[0]), lead[0]))

    @property
    def behind(self) -> dict[str, Trails]:
        """The laws that others are better than."""
        comparison, order = self.comparison, self.order
        better = comparison.better[self.index]
        behind = {}
        for law in order[1:]:
            beaten_by = better[:, comparison.laws.index(law)]
            ahead = tuple(rival for rival in order if beaten_by[comparison.laws.index(rival)])
            if not ahead:
                continue
            times = math.nan
            if not comparison.shares:
                effect = comparison.effect(self.index, ahead[0], law)
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
            return self.runs
        return int(self.comparison.samples[self.index].max())

    @property
    def _sets(self) -> tuple[int, bool]:
        """The smallest number of sets of gains of a law that has several, 1 if none has, and
        whether a law has one set.
        """
        sets = self.comparison.sets[:, self.index]
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
        least, rank = needed_to_win(self.comparison.family), needed_to_rank(len(laws))
        if len(laws) - len(self.few) < 2 or self.samples < least:
            return max(least, self.samples + 1)
        return rank if self.samples < rank else 0

    @cached_property
    def not_ranked(self) -> list[NotRanked]:
        """The laws with too few samples to be ranked, or where none wins to be among the best,
        beside others that are.
        """
        comparison, laws = self.comparison, self.comparison.laws
        win, rank = needed_to_win(self.comparison.family), needed_to_rank(len(laws))
        units = self._by_law(comparison.units)
        needed = dict.fromkeys(self.few, min(win, rank))
        if comparison.winners[self.index] is None and self._named(comparison.best):
            rivals = self._named(~comparison.worse & ~comparison.away.any(axis=2))
            needed |= {law: rank for law in rivals if units[law] < rank}
        if len(laws) - len(self.few) < 2:
            return []
        facts = []
        for law, least in needed.items():
            of_law = {"law": law, "samples": units[law], "needed": least}
            facts.append(NotRanked(metric=self.label, unit=self.unit, **of_law))
        return facts

    @property
    def sample(self) -> Fact:
        """What a number is of."""
        sets, single = self._sets
        return Fact(
            "sample",
            seeds=self.seeds,
            distinct=self.runs if self.runs < self.seeds else None,
            single=single and sets > 1,
            **{"least" if self.samples > sets else "sets": sets if sets > 1 else None},
        )
