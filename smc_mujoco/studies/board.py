"""A board: laws compared in one metric, and the verdict in each of its blocks, as facts."""

import dataclasses
import math
from collections.abc import Iterable, Mapping

from smc_mujoco.analysis.bootstrap import Interval
from smc_mujoco.analysis.paired_runs import OBJECTIVE, SETTLES, without_floor
from smc_mujoco.analysis.ranking import Rank, needed_to_rank, needed_to_win
from smc_mujoco.answers import answers
from smc_mujoco.answers.facts import Barred, Lead, NotRanked, Open, Sample, Tied, Trails, Verdict
from smc_mujoco.common.aliases import Names, Numbers, Pair
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.text import joined
from smc_mujoco.control.source import Source
from smc_mujoco.metrics.catalogue import CATALOGUE

LABELS = {SETTLES: answers.SHARE, OBJECTIVE: answers.ON_PLANT}


def label_of(metric: str) -> str:
    """Return a metric in words, such as "final error"."""
    return LABELS.get(metric) or CATALOGUE[metric].label


@keyword_dataclass
class BoardEntry:
    """A law's line in a board."""

    law: str
    interval: Interval  # of its median, or of the share of its runs that settle, over its samples
    vague: bool  # whether the interval is too wide for the median to say enough
    rank: Rank
    failed: int  # number of its runs that failed, or have no value, such as those that never settle
    runs: int  # number of its runs, equal ones counted once
    sources: tuple[Source, ...] = ()  # of its gains


@keyword_dataclass
class Block:
    """Laws compared on one plant in one condition. A law's name is the key of the mappings."""

    plant: str
    condition: str
    # medians over the seeds; for "settles" the share of runs that do not settle
    medians: Numbers
    lacking: Mapping[str, int]  # number of runs that failed or have no value
    best: Names  # laws that may be the best, see `ranking`
    worse: Names  # laws that another is better than
    below: Names  # laws below the floor, which are not ranked among themselves
    floor: str  # in words, such as "0.01 rad"; "" where it is not known
    away: Names  # laws with runs that failed or have not arrived, which do not win
    ahead: str | None  # the law that is better than every other, laws with default gains included
    # None for one law, for "settles", or if the law in front has runs without a value
    lead: Lead | None
    behind: Mapping[str, Trails]  # those of `worse`
    seeds: int  # in which every law ran
    # distinct runs in these seeds; in the others every law repeats the result of an earlier one
    runs: int
    level: bool  # whether the `best` laws are all level with each other
    # the least lead with which one of the `best` would have won, a share; NaN without a test
    resolves: float
    charged: float  # what half the step and trends take from that lead, a share
    # medians at the step and at half of it, where they differ much
    by_step: Mapping[str, Pair]
    samples: int  # largest number of any two laws, see `ranking`; for one law, of its runs
    sets: int  # smallest number of sets of gains of a law that has several; 1 if none has
    single_set: bool  # whether a law has one set of gains
    few: Mapping[str, int]  # laws that are not ranked, as they have so few sets of gains or runs
    rising: Names = ()  # laws whose median is below the floor, but need not stay there
    # the laws with default gains, over which no other law is named the winner
    untuned: Names = ()
    bound: float = math.nan  # of |u|, in the unit of u; NaN where it is not one number

    @property
    def winner(self) -> str | None:
        """The law that is better than every other, among several, unless `barred`."""
        return None if self.barred else self.ahead

    @property
    def barred(self) -> Names:
        """The laws with default gains that are worse than the law ahead, which is then not named
        the winner.
        """
        if self.ahead:
            return tuple(law for law in self.untuned if law != self.ahead)
        return ()

    @property
    def lowest(self) -> Names:
        """Those of the best laws, or all laws, that are below the floor, if these are several."""
        low = tuple(law for law in self.best if law in self.below)
        if len(self.below) == len(self.medians) and not self.away:
            low = tuple(self.medians)
        return low if len(low) > 1 else ()

    @property
    def all_settle_or_none(self) -> bool:
        """Whether every run of every law settles, or none, for the share of runs that do not."""
        shares = set(self.medians.values())
        return shares in ({0.0}, {1.0})

    @property
    def sample(self) -> Sample:
        """The size of the sample."""
        return Sample(
            seeds=self.seeds,
            runs=self.runs,
            sets=self.sets,
            more=self.samples > self.sets,
            single=self.sets > 1 and self.single_set,
        )


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Board:
    """Laws compared in one metric within one group of runs. `print` shows its verdicts."""

    group: Mapping[str, str]  # what the runs have in common, such as {"plant": "duffing"}
    metric: str  # its name, or "settles"
    # of the medians, with {x} and {u} as in `Metric.unit`; "" for "settles", which is 0 to 1
    unit: str
    entries: tuple[BoardEntry, ...]  # lowest mean rank first
    blocks: tuple[Block, ...]  # the same laws in each condition
    family: int  # number of blocks of the table for which winners are corrected
    relevant: float  # share of a value that is relevant
    # whether halving the physics step may change its numbers, and no run was repeated with it
    by_step: bool
    x: str = ""  # the unit of positions, "rad" or "m"; "" where it is not known
    summed: Names = ()  # the conditions whose runs a number sums, as J does

    def __repr__(self) -> str:
        return f"{self.about}: {'; '.join(self.lines)}"

    @property
    def best(self) -> Names:
        """The laws that no other is better than, in any block.

        With several blocks there may be none.
        """
        return tuple(entry.law for entry in self.entries if entry.rank.best)

    @property
    def winner(self) -> str | None:
        """The law that wins in every block, if there is one."""
        winners = {block.winner for block in self.blocks}
        return winners.pop() if len(winners) == 1 else None

    @property
    def about(self) -> str:
        """What the runs have in common, such as "duffing, nominal"."""
        return ", ".join(self.group.values())

    @property
    def label(self) -> str:
        """The metric in words, such as "final error"."""
        return label_of(self.metric)

    @property
    def verdicts(self) -> dict[str, Verdict | None]:
        """Condition -> who wins there, or why nobody does; None for a single law."""
        return {block.condition: self.verdict(block) for block in self.blocks}

    def verdict(self, block: Block) -> Verdict | None:
        """Return who wins a block, or why nobody does."""
        metric = self.label
        laws = tuple(block.medians)
        if len(laws) < 2:
            return None
        if block.winner and block.lead and block.lead.law == block.winner:
            return block.lead
        if block.winner:
            return Lead(law=block.winner, rival="", metric=metric)
        if block.barred:
            return Barred(metric=metric, laws=block.barred, defaults=True)
        if len(block.away) == len(laws):
            return Barred(metric=metric, laws=laws, defaults=False)
        return self._undecided(block, metric)

    def _undecided(self, block: Block, metric: str) -> Tied | Open:
        """Return why no law wins a block in which one might."""
        laws = tuple(block.medians)
        if self.metric == SETTLES and block.all_settle_or_none:
            return Tied(metric=metric, laws=laws)
        if block.lowest:
            return Tied(metric=metric, laws=block.lowest, floor=block.floor)
        if needed := self.needed(block):
            return Open(metric=metric, laws=laws, needed=needed, unit=self.samples_unit(block))
        if block.level and len(block.best) > 1:
            return Tied(metric=metric, laws=block.best)
        unbeaten = block.best or tuple(law for law in laws if law not in block.worse)
        charged = block.charged if block.charged > self.relevant else 0.0
        return Open(metric=metric, laws=unbeaten, hidden=block.resolves, charged=charged)

    def needed(self, block: Block) -> int:
        """Return how many samples a verdict takes in a block that has fewer; 0 if it has enough."""
        least = needed_to_win(self.family)
        ranked = len(block.medians) - len(block.few)
        if ranked < 2 or block.samples < least:
            return max(least, block.samples + 1)
        rank = needed_to_rank(len(self.entries))
        return rank if block.samples < rank else 0

    @staticmethod
    def samples_unit(block: Block) -> str:
        """Return what a sample of a block is."""
        if block.sets == 1:
            return "runs"
        return "sets of gains or runs" if block.single_set else "sets of gains"

    @property
    def not_ranked(self) -> list[NotRanked]:
        """The laws with too few samples to be ranked beside others that are."""
        least = min(needed_to_win(self.family), needed_to_rank(len(self.entries)))
        facts: dict[str, NotRanked] = {}
        for block in self.blocks:
            if len(block.medians) - len(block.few) > 1:
                for law, samples in block.few.items():
                    unit = self.samples_unit(block)
                    facts[law] = NotRanked(
                        metric=self.label, law=law, samples=samples, needed=least, unit=unit
                    )
        return list(facts.values())

    @property
    def lines(self) -> list[str]:
        """The verdicts as lines of evidence, each with the conditions in which it holds."""
        conditions_of: dict[str, list[str]] = {}
        for condition, fact in self.verdicts.items():
            if fact:
                conditions_of.setdefault(answers.evidence(fact), []).append(condition)
        lines = []
        for text, conditions in conditions_of.items():
            lines.append(f"{text} under {joined(conditions)}" if len(self.blocks) > 1 else text)
        lines += [": ".join(pair) for pair in answers.verdict_lines(self.not_ranked)]
        return [*lines, *filter(None, [without_floor(self.metric)])]

    def failures(self, entry: BoardEntry) -> str:
        """Return how many of a law's runs failed, have not arrived, or never reach a time, such as
        "2 of 24 failed"; "" if none did.
        """
        if not entry.failed:
            return ""
        how = "failed"
        if self.unit == "s":
            how = "never"
        elif self.metric in CATALOGUE and not CATALOGUE[self.metric].error:
            how = "not arrived"
        return f"{entry.failed} of {entry.runs} {how}"


def sources(boards: Iterable[Board]) -> dict[str, list[Source]]:
    """Return law -> the sources of its gains, for every law of some boards, by name."""
    by_law: dict[str, list[Source]] = {}
    for board in boards:
        for entry in board.entries:
            by_law.setdefault(entry.law, []).extend(entry.sources)
    return dict(sorted(by_law.items()))
