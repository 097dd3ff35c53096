"""A board: laws compared in one metric, its verdict in words, and boards as tables, with medians
and intervals.
"""

import dataclasses
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from smc_mujoco.analysis.bootstrap import LEVEL, MIN_INTERVAL_SAMPLES, Interval
from smc_mujoco.analysis.paired_runs import MIN_COMMAND_SHARE, OBJECTIVE, SETTLES, UNITS
from smc_mujoco.analysis.ranking import LEVEL_SHARE, POWER, Effect, Rank, min_p
from smc_mujoco.analysis.step_halving import APART, UNTRIED
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.common.text import capital, counted, every, joined, number
from smc_mujoco.control.source import Source, in_words, kinds
from smc_mujoco.draw import style
from smc_mujoco.metrics.catalogue import CATALOGUE

if TYPE_CHECKING:
    from smc_mujoco.analysis.law_time import LawTime
    from smc_mujoco.studies.worst_case import WorstCase

MAX_RATIO_OF_TIMES_LESS = (
    0.5  # a smaller ratio is "so many times less", a larger one so many percent; chosen
)
MIN_RATIO_OF_TIMES_AS_MUCH = (
    10.0  # a larger ratio is "so many times as much", not so many percent; chosen
)
LABELS = {SETTLES: "share that settles", OBJECTIVE: "J on runs that no search has seen"}
MAX_NAMES = 6  # in a sentence; chosen
MAX_VISIBLE = 0.995  # a larger lead that would have been seen is called none
TIMED = (
    "Time: of the law's compiled code a sample on this machine, the median over that of pid; below it, the median and "
    "the 99 % quantile over the samples of a run."
)
SMALL = "by less than the problem can show"
LEVEL_WORDS = f"level within {100 * LEVEL_SHARE:g} %"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry:
    """A law's line in a board."""

    law: str
    interval: Interval  # of its median, or of the share of its runs that settle, over its samples
    rank: Rank
    failed: int  # number of its runs that failed, or have no value, such as those that never settle
    runs: int  # number of its runs, equal ones counted once
    sources: tuple[Source, ...] = ()  # of its gains; none where the table does not say


class Lead(NamedTuple):
    """The law in front in a block, its closest rival (with the largest p-value), and how they
    compare.
    """

    law: str
    rival: str
    effect: Effect
    # whether their medians differ by less than the problem can show, see `paired_runs.floor`
    small: bool = False

    @property
    def words(self) -> str:
        """How the law compares with its rival, such as "12 % less than pid (8 to 16 %), ahead in 24
        of 24 runs".
        """
        small = f", {SMALL}" if self.small else ""
        return f"{size_in_words(self.effect, self.rival)}, {ahead_in_words(self.effect)}{small}"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Block:
    """Laws compared on one plant in one condition."""

    plant: str
    condition: str
    medians: Mapping[
        str, float
    ]  # law -> median over the seeds; for "settles" the share of runs that do not settle
    lacking: Mapping[str, int]  # law -> number of runs that failed or have no value
    best: tuple[
        str, ...
    ]  # laws that no other is better than, with a value in every run and enough samples to tell
    undecided: tuple[
        str, ...
    ]  # laws that no other is better than, but only because there are too few samples
    worse: tuple[str, ...]  # laws that another is better than
    ahead: str | None  # the law that is better than every other, laws with default gains included
    lead: (
        Lead | None
    )  # None for one law, for "settles", or if the law in front has runs without a value
    seeds: int  # in which every law ran
    # distinct runs in these seeds; in the other seeds every law repeats the result of an earlier
    # one
    runs: int
    level: bool  # whether the `best` laws are all level with each other
    visible: Mapping[
        str, float
    ]  # law -> the least lead that would have been seen, a share; {} without a test
    by_step: Mapping[
        str, tuple[float, float]
    ]  # law -> medians at the step and at half of it, where they differ much
    samples: (
        int  # largest number of samples of any two laws, see `ranking`; for one law, of its runs
    )
    sets: int  # smallest number of sets of gains of a law that has several; 1 if none has
    given: tuple[str, ...] = ()  # the laws with one set of gains, where another law has several
    untuned: tuple[
        str, ...
    ] = ()  # the laws with default gains, over which no other law is named the winner

    @property
    def winner(self) -> str | None:
        """The law that is better than every other, among several, unless `barred`."""
        return None if self.barred else self.ahead

    @property
    def barred(self) -> tuple[str, ...]:
        """The laws with default gains that are worse than the law ahead, which is then not named
        the winner.
        """
        if self.ahead:
            return tuple(law for law in self.untuned if law != self.ahead)
        return ()

    @property
    def sample(self) -> str:
        """The size of the sample in words, such as "20 seeds, 1 distinct run" or "24 seeds, 3 sets
        of gains".
        """
        distinct = [counted(self.runs, "distinct run")] * (self.runs < self.seeds)
        return ", ".join(
            [
                counted(self.seeds, "seed"),
                *distinct,
                *[f"{self.sets} sets of gains"] * (self.sets > 1),
            ]
        )


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Board(Tables):
    """Laws compared in one metric within one group of runs."""

    group: Mapping[str, str]  # what the runs have in common, such as {"plant": "duffing"}
    metric: str  # its name, or "settles"
    # of the medians, with {x} and {u} as in `Metric.unit`; "" for "settles", which is 0 to 1
    unit: str
    entries: tuple[Entry, ...]  # lowest mean rank first
    blocks: tuple[Block, ...]  # the same laws in each condition
    family: int  # number of blocks of the table for which winners are corrected
    relevant: float  # share of a value that is relevant
    resolution: (
        float  # the largest lower bound on the least relevant difference, in the unit of the board
    )
    # whether halving the physics step may change its numbers, and no run was repeated with it
    by_step: bool
    x: str = ""  # the unit of positions, "rad" or "m"; "" where it is not known

    @property
    def best(self) -> tuple[str, ...]:
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
    def tables(self) -> list[Tabular]:
        """The board as a table."""
        return Boards([self]).tables

    @property
    def about(self) -> str:
        """What the runs have in common, such as "duffing, nominal"."""
        return ", ".join(self.group.values())

    def wins(self, law: str) -> list[str]:
        """Return the conditions in which a law wins."""
        return [block.condition for block in self.blocks if block.winner == law]

    def losses(self, law: str) -> list[str]:
        """Return the conditions in which another law is better."""
        return [block.condition for block in self.blocks if law in block.worse]

    def fails(self, law: str) -> list[str]:
        """Return the conditions in which no other law is better, but runs of this law fail or have
        no value.
        """
        return [
            block.condition
            for block in self.blocks
            if block.lacking[law] and law not in block.worse
        ]

    @property
    def label(self) -> str:
        """The metric in words, such as "ultimate bound"."""
        return LABELS.get(self.metric) or CATALOGUE[self.metric].label

    @property
    def where(self) -> str:
        """The plant and the conditions in words, such as " on duffing under noise"."""
        if self.metric == OBJECTIVE:
            return f" on {self.group['plant']}"
        return (
            f" on {self.group['plant']} under {first_of(block.condition for block in self.blocks)}"
        )

    @property
    def verdict(self) -> str:
        """The metric, the plant, the conditions and the `result`."""
        return f"{self.label}{self.where}: {self.result}"

    @property
    def result(self) -> str:
        """The result in words: the winner, else where laws win and lose, why there is no winner, or
        the best laws.
        """
        blocks = f"in {every(len(self.blocks))} conditions"
        these = self._these_gains
        if self.winner:
            leads = [block.lead for block in self.blocks if block.lead]
            closest = max(leads, key=lambda lead: lead.effect.high, default=None)
            if closest:
                how = f": {'at least ' * (len(leads) > 1)}{closest.words}"
            else:
                how = ""
            if closest and not closest.small:
                how += self._small(self.winner)
            return f"{self.winner} wins{f' {blocks}' * (len(self.blocks) > 1)}{how}{self._search(self.winner)}{these}"
        results = []
        for law in (entry.law for entry in self.entries if self.wins(entry.law)):
            losses = f", loses under {_listed(self.losses(law))}" * bool(self.losses(law))
            fails = f", has runs that {self._fail} under {_listed(self.fails(law))}" * bool(
                self.fails(law)
            )
            won = f"{law} wins under {_listed(self.wins(law))}{self._small(law)}"
            results.append(f"{won}{losses}{fails}{self._search(law)}")
        if results:
            return f"no winner {blocks}: {'; '.join(results)}{these}"
        if self.why:
            return f"no winner: {self.why}"
        if len(self.best) == len(self.entries):
            if len(self.best) > 2:
                which = "all laws"
            else:
                which = "both laws"
            return f"no winner: {f'{which} are {LEVEL_WORDS}' if self.level else self.cannot_tell}"
        if len(self.best) > 1:
            apart = f"; {LEVEL_WORDS if self.level else self.cannot_tell}"
        else:
            apart = ""
        defeated = any(self.losses(entry.law) for entry in self.entries)
        if defeated:
            told = f"undefeated: {joined(self.best)}{apart}"
        else:
            told = "none beaten"
        return "; ".join([f"no winner, {told}", *self._doubts])

    @property
    def _doubts(self) -> list[str]:
        """Why laws that are not the best may not be beaten, in words."""
        open_ones = []
        for entry in self.entries:
            if entry.law not in self.best and not self.losses(entry.law):
                open_ones.append(entry.law)
        failing = [law for law in open_ones if self.fails(law)]
        few = [law for law in open_ones if law not in failing]
        doubts = []
        if few:
            doubts.append(
                f"too few samples to tell whether {joined(few)} {'is' if len(few) == 1 else 'are'} beaten"
            )
        if failing:
            if len(failing) == 1:
                have = "has"
                are = "it is"
            else:
                have = "have"
                are = "they are"
            doubts.append(
                f"{joined(failing)} {have} runs that {self._fail}, too few to tell whether {are} beaten"
            )
        return doubts

    @property
    def _fail(self) -> str:
        """What runs without a value do, in words."""
        return "never end" if self.unit == "s" else "fail"

    @property
    def level(self) -> bool:
        """Whether the laws that are not beaten are level with each other in every block."""
        return all(block.level for block in self.blocks)

    @property
    def cannot_tell(self) -> str:
        """That laws cannot be told apart, and the largest of the least leads that would have been
        seen, in words.
        """
        visible = []
        for block in self.blocks:
            for law in self.best:
                if law in block.visible:
                    visible.append(block.visible[law])
        if not visible:
            return "cannot tell them apart"
        if max(visible) >= MAX_VISIBLE:
            return "cannot tell them apart: no lead would have been seen"
        seen = f"a lead of {_percent(max(visible))} % would have been seen in {100 * POWER:g} % of such comparisons"
        return f"cannot tell them apart: {seen}"

    def visible(self, law: str) -> float:
        """Return the largest, over the blocks, of the least leads that would have been seen, a
        share; NaN for none.
        """
        return max(
            (block.visible[law] for block in self.blocks if law in block.visible), default=math.nan
        )

    def step_change(self, law: str) -> tuple[float, float] | None:
        """Return the medians of a law at the physics step and at half of it, in the first block
        that is marked.
        """
        return next((block.by_step[law] for block in self.blocks if law in block.by_step), None)

    def _small(self, law: str) -> str:
        """Return the conditions in which a law wins by less than the problem can show, after a
        comma.
        """
        won = []
        for block in self.blocks:
            if block.winner == law and block.lead and block.lead.small:
                won.append(block)
        if won:
            return f", {SMALL} under {_listed([block.condition for block in won])}"
        return ""

    @property
    def _these_gains(self) -> str:
        """That the result holds for the gains of laws that have one set of them, after a comma."""
        if all(block.sets == 1 for block in self.blocks):
            return ", for these gains"
        given = dict.fromkeys(law for block in self.blocks for law in block.given)
        return f", for these gains of {first_of(given)}" * bool(given)

    def _search(self, law: str) -> str:
        """Return how the gains of a law that wins were searched, after a comma, if not by the rule."""
        its = (source for entry in self.entries if entry.law == law for source in entry.sources)
        about = any(source.search and source.search.about_defaults for source in its)
        return ", with gains searched about its defaults and not by the rule" * about

    @property
    def why(self) -> str:
        """Why there is no winner; "" if there is one, or if several laws are the best."""
        if len(self.entries) == 1:
            return "one law"
        if barred := self.barred:
            return f"none is named over {joined(barred)} with default gains"
        if all(not block.best for block in self.blocks) and all(
            all(block.lacking.values()) for block in self.blocks
        ):
            return f"every law has runs that {self._fail}"
        undecided = ", or has too few samples to tell" * any(
            block.undecided for block in self.blocks
        )
        return self.too_few or ("" if self.best else f"each loses to another, or fails{undecided}")

    @property
    def barred(self) -> list[str]:
        """The laws with default gains over which no winner is named in any block, see
        `Block.barred`.
        """
        return list(dict.fromkeys(law for block in self.blocks for law in block.barred))

    @property
    def too_few(self) -> str:
        """The size of the sample in words, if no block has enough samples for a winner; else ""."""
        largest = max(self.blocks, key=lambda block: block.samples)
        if 2 * min_p(largest.samples) <= (1 - LEVEL) / self.family:
            return ""
        if largest.sets > 1:
            known = largest.sets
        else:
            known = largest.runs
        samples = f": {counted(largest.samples, 'sample')}" * (largest.samples != known)
        few = f"{largest.sample}{samples}, too few" + f" for {self.family} comparisons" * (
            self.family > 1
        )
        if largest.runs < largest.seeds and largest.sets == 1:
            return f"{few}: most seeds change nothing here"
        least = next(n for n in itertools.count(1) if 2 * min_p(n) <= (1 - LEVEL) / self.family)
        searches = f" and as many searches (searches={least}, without --quick)" * (largest.sets > 1)
        return f"{few}: take {least} seeds (--seeds {least}){searches}"

    def failures(self, entry: Entry) -> str:
        """Return how many of a law's runs failed, or never reach a time, such as "2 of 24 failed";
        "" if none did.
        """
        if entry.failed:
            return f"{entry.failed} of {entry.runs} {'never' if self.unit == 's' else 'failed'}"
        return ""


def size_in_words(effect: Effect, rival: str = "") -> str:
    """Return how much less or more a law has than a rival, with the interval, such as "12 % less (8
    to 16 %)".
    """
    if math.isnan(effect.value) or effect.value in (0.0, math.inf):
        return f"{rival or 'the other'} {'has no value' if effect.value == 0.0 else 'alone has a value'} in most runs"
    if effect.low == effect.high == 1.0:
        return "no difference"
    endless = effect.low == 0.0 and math.isinf(effect.high)
    if effect.high < MAX_RATIO_OF_TIMES_LESS:
        times = [
            number(1 / value) if value else "" for value in (effect.value, effect.high, effect.low)
        ]
        words = f"{times[0]} times less"
        if times[2]:
            span = f"{times[1]} to {times[2]} times"
        else:
            span = f"{times[1]} times or more"
    elif effect.low > MIN_RATIO_OF_TIMES_AS_MUCH:
        value, low, high = map(number, effect[:3])
        words = f"{value} times as much"
        if math.isinf(effect.high):
            span = f"{low} times or more"
        else:
            span = f"{low} to {high} times"
    else:
        saved = [1.0 - value for value in (effect.value, effect.high, effect.low)]
        less = saved[0] >= 0
        if less:
            value, *ends = saved
        else:
            value, *ends = [0.0 - saved[k] for k in (0, 2, 1)]
        words, (low, high) = (
            f"{_percent(value)} % {'less' if less else 'more'}",
            map(_percent, ends),
        )
        if math.isinf(ends[1]):
            span = f"{low} % or more"
        else:
            span = f"{low} to {high} %"
    named = f" {'as' if words.endswith(' as much') else 'than'} {rival}" * bool(rival)
    return f"{words}{named} ({'too few for an interval' if endless else span})"


def ahead_in_words(effect: Effect) -> str:
    """Return in how many samples a law is better, such as "ahead in 24 of 24 runs"."""
    return (
        f"ahead in {effect.ahead} of {effect.samples} {'sets of gains' if effect.sets else 'runs'}"
    )


def _percent(share: float) -> str:
    """Return a share in percent, with two digits where it is small."""
    if math.isinf(share):
        return f"{share:g}"
    if abs(share) < 0.0995:
        return f"{100 * share:.2g}"
    return f"{100 * share:.0f}"


def _listed(names: Sequence[str]) -> str:
    """Return names in a row, between semicolons if a name has a comma in it, as that of a condition
    may have.
    """
    if any("," in name for name in names):
        return "; ".join(names)
    return joined(names)


def first_of(names: Iterable[str]) -> str:
    """Return names in a row; if they are many, the first ones and how many more there are."""
    several = list(names)
    more = len(several) - MAX_NAMES
    if more > 1:
        return joined([*several[:MAX_NAMES], f"{more} more"])
    return joined(several)


class Boards(Tables, list[Board]):
    """Boards: a list that terminals, notebooks and `print` show as tables, with a verdict on each
    board.
    """

    worst: Mapping[str, Mapping[str, "WorstCase"]] = frozen(
        {}
    )  # plant -> law -> its worst case, for a column
    times: Mapping[str, Mapping[str, "LawTime"]] = frozen(
        {}
    )  # plant -> law -> its time, for the plant's first table
    failures: Sequence[str] = ()  # a sentence for each law with failed runs, below the last table

    @property
    def tables(self) -> list[Tabular]:
        """A table for each group of runs, with what each metric's board says below, and a key below
        the last.

        It has a line for each law and a column for each metric. A cell has a median with its
        interval. The median is marked if no law is better in any block, no run failed, and there
        are enough runs for a winner.
        """
        groups: dict[str, list[Board]] = {}
        for board in self:
            groups.setdefault(board.about, []).append(board)
        if not groups:
            return [Tabular(headings=["no boards: no metric applies"], rows=[])]
        plants = [its[0].group.get("plant", "") for its in groups.values()]
        made = list[Tabular]()
        for i, (name, its) in enumerate(groups.items()):
            if plants[i] not in plants[:i]:
                times = self.times.get(plants[i], {})
            else:
                times = {}
            made.append(_table(name, its, self.worst.get(plants[i], {}), times))
        notes = (
            *made[-1].notes,
            *self.failures,
            f"{key(self)} {TIMED}" if self.times else key(self),
        )
        return [*made[:-1], dataclasses.replace(made[-1], notes=notes)]


def size(value: float, metric: str) -> str:
    """Return a median as text: "" for NaN, a share in percent."""
    if math.isnan(value):
        return ""
    if metric == OBJECTIVE:
        return number(value)
    if metric == SETTLES:
        return f"{100 * value:.0f}"
    return CATALOGUE[metric].text(value)


def spread(interval: Interval, metric: str) -> str:
    """Return the ends of an interval, rounded like its median; "" if they are not known, or both
    infinite.
    """
    if math.isinf(interval.low):
        return ""
    ends = [size(value, metric) for value in (interval.low, interval.high)]
    return "–".join(ends) if all(ends) else ""


def heading(board: Board) -> str:
    """Return a metric's label with its unit, if that is known."""
    if board.metric == SETTLES:
        return "settles (%)"
    if board.metric == OBJECTIVE:
        return "J (s^2)"
    return dataclasses.replace(CATALOGUE[board.metric], unit=board.unit).heading(
        board.x
    )  # in V for voltages


def _table(
    name: str,
    boards: Sequence[Board],
    worst: Mapping[str, "WorstCase"],
    times: Mapping[str, "LawTime"],
) -> Tabular:
    """Return the table of one group of runs.

    Laws stand by place in the first metric, then in the next ones.
    """
    sources_of = sources(boards)
    cells = {
        (i, entry.law): _cell(board, entry)
        for i, board in enumerate(boards)
        for entry in board.entries
    }
    places: dict[str, list[float]] = {}
    for entry in (entry for board in boards for entry in board.entries):
        places.setdefault(entry.law, []).append(entry.rank.place)
    rows: list[list[Cell | str]] = []
    for law in sorted(places, key=lambda law: (places[law], law)):
        name_cell = Cell(law, kinds(sources_of[law]), colour=style.law_colour(law))
        found = worst.get(law)
        case = [
            Cell(found.shown(found.value), f"median {found.shown(found.median)}") if found else ""
        ] * bool(worst)
        time = [_time(times[law]) if law in times else ""] * bool(times)
        rows.append(
            [name_cell, *(cells.get((i, law), "") for i in range(len(boards))), *case, *time]
        )
    units = [f"worst found ({case.unit})" for case in worst.values()][:1]
    largest = max(boards, key=lambda board: len(board.blocks))
    if len(largest.blocks) == 1:
        name = f"{largest.group['plant']}, {largest.blocks[0].condition}"
    samples = {block.sample: block.condition for block in reversed(largest.blocks)}
    several = "; ".join(
        f"{sample} ({block}{' ...' * (len(largest.blocks) > 2)})"
        for sample, block in samples.items()
    )
    return Tabular(
        headings=["law", *map(heading, boards), *units, *["time (of pid's)"] * bool(times)],
        rows=rows,
        title=f"{name}: {several if len(samples) > 1 else largest.blocks[0].sample}",
        notes=_verdicts(boards),
    )


def _time(one: "LawTime") -> Cell:
    """Return the time of a law a sample: over that of pid, and below it median and 99 % quantile."""
    return Cell(
        f"{one.ratio:.2g}" if one.ratio < 100.0 else f"{one.ratio:.0f}",
        f"{_ns(one.median)}, {_ns(one.high)}",
    )


def _ns(seconds: float) -> str:
    if seconds < 1e-6:
        return f"{1e9 * seconds:.3g} ns"
    return f"{1e6 * seconds:.3g} us"


def _cell(board: Board, entry: Entry) -> Cell:
    """Return a law's median, strong if no law is better, no run failed and there are enough runs
    for a winner.
    """
    median = size(entry.interval.median, board.metric)
    visible = board.visible(entry.law)
    change = board.step_change(entry.law)
    blind = board.too_few or visible >= MAX_VISIBLE
    best = entry.rank.best and median != "" and not blind and not board.barred
    if visible < MAX_VISIBLE:
        seen = f"sees {_percent(visible)} %"
    else:
        seen = "sees no lead" * (not math.isnan(visible))
    if change:
        step = " to ".join(size(value, board.metric) for value in change) + " by the step"
    else:
        step = ""
    lines = "\n".join(filter(None, (spread(entry.interval, board.metric), seen)))
    return Cell(median, lines, best, alarm="\n".join(filter(None, (board.failures(entry), step))))


def key(boards: Sequence[Board]) -> str:
    """Return what the cells of a table show."""
    words = (
        f"Medians with {100 * LEVEL:g} % intervals over runs, or over sets of gains that runs share"
    )
    medians = []
    for board in boards:
        if board.metric != SETTLES:
            for entry in board.entries:
                medians.append(entry.interval)
    if any(interval.n < MIN_INTERVAL_SAMPLES for interval in medians):
        words += f"; of fewer than {MIN_INTERVAL_SAMPLES} samples the interval is their range, and covers less"
    family = max(board.family for board in boards)
    several = f", corrected for {family} comparisons a metric" * (family > 1)
    least = relevance(boards[0].relevant, [(board.metric, board.resolution) for board in boards])
    words += (
        ". Marked: no law is better, no run failed, and the samples are enough to see a lead. A winner is better than "
        f"every other law in a paired test{several}. Pairs of runs tell by how much, not the medians. Ahead means by "
        f"more than the least relevant difference, {least}."
    )
    if any(block.visible for board in boards for block in board.blocks):
        words += (
            " 'sees 24 %': a lead of 24 % between the law and the one in front would have been seen in "
            f"{100 * POWER:g} % of such comparisons, at the level of {100 * (1 - LEVEL):.0f} % for all."
        )
    if any(
        block.lead and block.lead.small and block.winner
        for board in boards
        for block in board.blocks
    ):
        words += (
            f" '{SMALL}': the medians differ by less than half a count of the encoder, the noise or 1e-4 of the start, "
            "or by less than follows from these for other units."
        )
    if any(block.by_step for board in boards for block in board.blocks):
        words += f" 'by the step': the medians at the physics step and at half of it, which differ by more than {APART}."
    words += f" {capital(UNTRIED)}." * any(board.by_step for board in boards)
    gains = in_words(sources(boards))
    if gains:
        return f"{words} {capital(gains)}."
    return words


def relevance(share: float, floors: Iterable[tuple[str, float]], x: str = "rad or m") -> str:
    """Return the least relevant difference in words: a share, and q by unit; `x` is the unit of
    positions.
    """
    of_unit: dict[str, float] = {}
    for metric, floor in floors:
        unit = UNITS[metric].removesuffix("/s")
        of_unit[unit] = max(floor, of_unit.get(unit, 0.0))
    words = f"{100 * share:g} % of the larger value"
    if resolved := of_unit.get("{x}"):
        parts = [f"up to {number(resolved)} {x} of a position"]
    else:
        parts = []
    parts += [f"{100 * MIN_COMMAND_SHARE:g} % of the bound on u"] * bool(of_unit.get("{u}"))
    if parts:
        return f"{words}, where values below what the problem can show count as equal ({', '.join(parts)})"
    return words


def sources(boards: Iterable[Board]) -> dict[str, list[Source]]:
    """Return law -> the sources of its gains, for every law of some boards, in alphabetical order."""
    by_law: dict[str, list[Source]] = {}
    for board in boards:
        for entry in board.entries:
            by_law.setdefault(entry.law, []).extend(entry.sources)
    return dict(sorted(by_law.items()))


def _verdicts(boards: Sequence[Board]) -> list[str]:
    """Return the verdicts of boards; metrics with the same result share a sentence."""
    results: dict[str, list[Board]] = {}
    for board in boards:
        results.setdefault(board.result, []).append(board)
    return [
        f"{', '.join(board.label for board in same)}{same[0].where}: {result}."
        for result, same in results.items()
    ]
