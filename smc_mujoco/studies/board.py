"""A board: laws compared in one metric, and the verdict in each of its blocks, as facts."""

import dataclasses
from collections.abc import Iterable, Mapping

import numpy as np

from smc_mujoco.analysis.bootstrap import Interval, median_of, share_interval
from smc_mujoco.analysis.paired_runs import without_floor
from smc_mujoco.analysis.ranking import Comparison, Rank, linked, ranks
from smc_mujoco.answers import answers
from smc_mujoco.answers.facts import NotRanked, Verdict
from smc_mujoco.common.aliases import Array, Names
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.text import joined
from smc_mujoco.control.source import Source
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.studies.block import Block, label_of

MAX_RATIO = 4.0  # of the ends of a median's interval, above which it says too little; chosen
Sources = Mapping[str, tuple[Source, ...]]  # law -> those of its gains


@keyword_dataclass
class BoardEntry:
    """A law's line in a board."""

    law: str
    interval: Interval  # of its median, or of the share of its runs that settle, over its samples
    vague: bool  # whether the median is not known within a factor of MAX_RATIO
    rank: Rank
    failed: int  # number of its runs that failed, or have no value, such as those that never settle
    runs: int  # number of its runs, equal ones counted once
    sources: tuple[Source, ...] = ()  # of its gains


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Board:
    """Laws compared in one metric within one group of runs. `print` shows its verdicts."""

    group: Mapping[str, str]  # what the runs have in common, such as {"plant": "duffing"}
    metric: str  # its name, or "settles"
    # of the medians, with {x} and {u} as in `Metric.unit`; "" for "settles", which is 0 to 1
    unit: str
    comparison: Comparison
    sets: Mapping[str, Array]  # law -> the number of the set of gains of each run
    sources: Sources
    blocks: tuple[Block, ...]  # the same laws in each condition
    # whether halving the physics step may change its numbers, and no run was repeated with it
    by_step: bool
    x: str = ""  # the unit of positions, "rad" or "m"; "" where it is not known
    summed: Names = ()  # the conditions whose runs a number sums, as J does

    def __repr__(self) -> str:
        return f"{self.about}: {'; '.join(self.lines)}"

    @cached_property
    def entries(self) -> tuple[BoardEntry, ...]:
        """The laws, lowest mean rank first."""
        return tuple(map(self._entry, ranks(self.comparison)))

    def _entry(self, rank: Rank) -> BoardEntry:
        """Return the entry of a law."""
        compared = self.comparison
        i = compared.laws.index(rank.law)
        values = compared.cells[i]
        interval = median_of(values, linked(*np.atleast_2d(self.sets[rank.law])))
        vague = interval.high > MAX_RATIO * max(interval.low, compared.floors.min())
        if compared.shares:
            share = float(1 - np.nanmean(values, axis=1).mean())
            interval = share_interval(share, interval.n)
        return BoardEntry(
            law=rank.law,
            interval=interval,
            vague=vague and not compared.shares,
            rank=rank,
            failed=int(compared.without_value[i].sum()),
            runs=int((~np.isnan(values)).sum()),
            sources=self.sources.get(rank.law, ()),
        )

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
        return {block.condition: block.verdict for block in self.blocks}

    @property
    def not_ranked(self) -> list[NotRanked]:
        """The laws with too few samples to be ranked beside others that are, each once."""
        facts = {fact.law: fact for block in self.blocks for fact in block.not_ranked}
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
