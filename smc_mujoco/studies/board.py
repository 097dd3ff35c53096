"""A board: laws compared in one metric, and the verdict in each of its blocks, as facts."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence

from smc_mujoco.analysis.bootstrap import Interval
from smc_mujoco.analysis.paired_runs import OBJECTIVE, SETTLES, without_floor
from smc_mujoco.analysis.ranking import Rank
from smc_mujoco.answers import answers
from smc_mujoco.answers.facts import Barred, Fact, Lead, NotRanked, Trails, Verdict
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
    away: Names  # laws with runs that failed or have not arrived, which do not win
    below: Names  # laws below the floor, which are not ranked among themselves
    rising: Names  # laws whose median is below the floor, but need not stay there
    floor: str  # in words, such as "0.01 rad"; "" where it is not known
    verdict: Verdict | None  # who wins, or why nobody does; None for a single law
    behind: Mapping[str, Trails]  # the laws that others are better than
    not_ranked: Sequence[NotRanked]  # the laws with too few samples beside others that are ranked
    # medians at the step and at half of it, where they differ much
    by_step: Mapping[str, Pair]
    # distinct runs; in the other seeds every law repeats the result of an earlier one
    runs: int
    sample: Fact  # what a number is of
    bound: float  # of |u|, in the unit of u; NaN where it is not one number

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


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Board:
    """Laws compared in one metric within one group of runs. `print` shows its verdicts."""

    group: Mapping[str, str]  # what the runs have in common, such as {"plant": "duffing"}
    metric: str  # its name, or "settles"
    # of the medians, with {x} and {u} as in `Metric.unit`; "" for "settles", which is 0 to 1
    unit: str
    entries: tuple[BoardEntry, ...]  # lowest mean rank first
    blocks: tuple[Block, ...]  # the same laws in each condition
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
