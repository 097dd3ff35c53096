"""A board: laws compared in one metric, its verdict in words, and boards as tables.

A table has a line for each law and a column for each metric, with medians and their intervals.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from smc_mujoco.analysis.bootstrap import LEVEL, MIN_INTERVAL_SAMPLES, Interval
from smc_mujoco.analysis.paired_runs import MIN_COMMAND_SHARE, SETTLES
from smc_mujoco.analysis.ranking import Effect, Rank, min_p
from smc_mujoco.analysis.step_halving import UNTRIED
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.common.text import capital, counted, every, joined, number
from smc_mujoco.control.source import Source, in_words, kinds
from smc_mujoco.draw import style
from smc_mujoco.mechanisms.plant import catalogue
from smc_mujoco.metrics.catalogue import CATALOGUE

if TYPE_CHECKING:
    from smc_mujoco.studies.worst_case import WorstCase

MAX_RATIO_OF_TIMES_LESS = 0.5  # a smaller ratio is "so many times less", a larger one so many percent; chosen
MIN_RATIO_OF_TIMES_AS_MUCH = 10.0  # a larger ratio is "so many times as much", not so many percent; chosen
MIN_DIFFERENCE = 1e-9  # smaller differences are not printed, see `number`
MAX_NAMES = 4  # of plants or conditions in a verdict
NO_BOARDS = Tabular(headings=["no boards: no metric applies"], rows=[])


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry:
    """A law's line in a board.

    Attributes:
      law: its name.
      interval: its median, or the share of its runs that settle, over its samples.
      rank: its place.
      failed: number of its runs that failed, or have no value, such as those that never settle.
      runs: number of its runs, equal ones counted once.
      sources: where its gains come from; none where the table does not say.
    """

    law: str
    interval: Interval
    rank: Rank
    failed: int
    runs: int
    sources: tuple[Source, ...] = ()

    @property
    def about_defaults(self) -> bool:
        """Whether some of its gains were searched about their defaults, because one has no unit."""
        return any(source.search and source.search.about_defaults for source in self.sources)


class Lead(NamedTuple):
    """The law in front in a block, its closest rival (with the largest p-value), and how they compare, in a unit."""

    law: str
    rival: str
    effect: Effect
    unit: str

    @property
    def words(self) -> str:
        """How the law compares with its rival, such as "12 % less than pid (8 to 16 %), ahead in 24 of 24 runs"."""
        samples = "sets of gains" if self.effect.sets else "runs"
        size = size_in_words(self.effect, self.unit, self.rival)
        return f"{size}, ahead in {self.effect.ahead} of {self.effect.samples} {samples}"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Block:
    """Laws compared on one plant in one condition.

    Attributes:
      plant, condition: their names.
      medians: law -> median over the seeds; for "settles" the share of runs that do not settle.
      lacking: law -> number of runs that failed or have no value.
      best: the laws that no other law is better than, without such a run, and with enough samples to tell.
      undecided: the laws that no other is better than, but only because there are too few samples, see `ranking`.
      lead: how the law in front compares with its closest rival; None for one law, for "settles", or if it has runs
        without a value.
      seeds: number of seeds in which every law ran.
      runs: number of distinct runs among these. In the others every law has the same result as in an earlier seed.
      samples: largest number of samples of any two laws, see `ranking`; of one law that of its runs.
      sets: smallest number of sets of gains of a law that has several; 1 if none has.
      untuned: the laws with default gains, over which no other law is named the winner.
      ahead: the law that is better than every other, laws with default gains included.
    """

    plant: str
    condition: str
    medians: Mapping[str, float]
    lacking: Mapping[str, int]
    best: tuple[str, ...]
    undecided: tuple[str, ...]
    ahead: str | None
    lead: Lead | None
    seeds: int
    runs: int
    samples: int
    sets: int
    untuned: tuple[str, ...] = ()

    @property
    def winner(self) -> str | None:
        """The law that is better than every other, among several, unless `barred`."""
        return None if self.barred else self.ahead

    @property
    def barred(self) -> tuple[str, ...]:
        """The laws with default gains that are worse than the law ahead, which is then not named the winner."""
        return tuple(law for law in self.untuned if law != self.ahead) if self.ahead else ()

    @property
    def sample(self) -> str:
        """The size of the sample in words, such as "20 seeds, 1 distinct run" or "24 seeds, 3 sets of gains"."""
        distinct = [counted(self.runs, "distinct run")] * (self.runs < self.seeds)
        return ", ".join([counted(self.seeds, "seed"), *distinct, *[f"{self.sets} sets of gains"] * (self.sets > 1)])


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Board(Tables):
    """Laws compared in one metric within one group of runs.

    Attributes:
      group: what the runs have in common, such as {"plant": "duffing"}.
      metric: a metric's name, or "settles".
      unit: of the medians, with {x} and {u} as in `conventions.Metric.unit`; "" for "settles", which is 0 to 1.
      entries: lowest mean rank first. A median over several plants is NaN if its unit depends on the plant.
      blocks: the same laws on each plant in each condition.
      family: number of blocks of the table for which winners are corrected.
      relevant: share of a value that is relevant.
      resolution: the largest lower bound on the least relevant difference, in the unit of the board.
      by_step: whether it is about chattering without RK4, which half the physics step may change.
    """

    group: Mapping[str, str]
    metric: str
    unit: str
    entries: tuple[Entry, ...]
    blocks: tuple[Block, ...]
    family: int
    relevant: float
    resolution: float
    by_step: bool

    @property
    def best(self) -> tuple[str, ...]:
        """The laws that no other is better than, in any block. With several blocks there may be none."""
        return tuple(entry.law for entry in self.entries if entry.rank.best)

    @property
    def winner(self) -> str | None:
        """The law that wins in every block, if there is one."""
        winners = {block.winner for block in self.blocks}
        return winners.pop() if len(winners) == 1 else None

    @property
    def tables(self) -> list[Tabular]:
        """The board as a table, see `Boards.tables`."""
        return tables([self])

    @property
    def about(self) -> str:
        """What the runs have in common, such as "duffing, nominal"; "all runs" if nothing."""
        return ", ".join(self.group.values()) or "all runs"

    def wins(self, law: str) -> list[str]:
        """Return the names of the blocks in which a law wins, see `name`."""
        return [self.name(block) for block in self.blocks if block.winner == law]

    def losses(self, law: str) -> list[str]:
        """Return the names of the blocks in which another law is better, or in which runs of this law fail."""
        return [self.name(block) for block in self.blocks if law not in (*block.best, *block.undecided)]

    def name(self, block: Block) -> str:
        """Return the name of a block within the board: its condition, its plant, or both."""
        place = {"plant": block.plant, "condition": block.condition}
        return ", ".join(value for what, value in place.items() if what not in self.group)

    @property
    def kind(self) -> str:
        """The kind of the blocks: "conditions", "plants", or "cells" if plants and conditions differ."""
        return {"plant": "conditions", "condition": "plants"}.get("".join(self.group), "cells")

    @property
    def label(self) -> str:
        """The metric in words, such as "ultimate bound"."""
        return "share that settles" if self.metric == SETTLES else CATALOGUE[self.metric].label

    @property
    def where(self) -> str:
        """The plants and conditions in words, such as " on duffing under noise"."""
        parts = {"on": [block.plant for block in self.blocks], "under": [block.condition for block in self.blocks]}
        return "".join(f" {preposition} {_some_of(names)}" for preposition, names in parts.items())

    @property
    def verdict(self) -> str:
        """The metric, the plants, the conditions and the `result`."""
        return f"{self.label}{self.where}: {self.result}"

    @property
    def result(self) -> str:
        """The result in words: the winner, else where laws win and lose, why there is no winner, or the best laws."""
        if self.winner:
            leads = [block.lead for block in self.blocks if block.lead]
            # ratios come before differences, and are ordered by the end of their interval
            closest = max(leads, key=lambda lead: lead.effect.high if lead.effect.relative else -math.inf, default=None)
            several = f" in {every(len(self.blocks))} {self.kind}" * (len(self.blocks) > 1)
            how = f": {'at least ' * (len(leads) > 1)}{closest.words}" if closest else ""
            return f"{self.winner} wins{several}{how}{self._gains([self.winner])}"
        results = {}
        for law in (entry.law for entry in self.entries):
            if wins := self.wins(law):
                losses = self.losses(law)
                results[law] = f"{law} wins under {_listed(wins)}" + f", loses under {_listed(losses)}" * any(losses)
        if results:
            words = "; ".join(results.values()) + self._gains(results)
            return f"no winner in {every(len(self.blocks))} {self.kind}: {words}"
        if self.why:
            return f"no winner: {self.why}"
        if len(self.best) == len(self.entries):
            return "no winner: all laws are level" if len(self.best) > 2 else "no winner: both laws are level"
        return f"no winner, undefeated: {_listed(self.best)}"

    def _gains(self, laws: Collection[str]) -> str:
        """Return what limits the results of laws that win, after commas: their search, and "for these gains"."""
        others = [entry.law for entry in self.entries if entry.law in laws and entry.about_defaults]
        names, its = f"{joined(others)} " * (len(laws) > 1), "its" if len(others) == 1 else "their"
        limits = [f"{names}with gains searched about {its} defaults and not by the rule"] * bool(others)
        limits += ["for these gains"] * all(block.sets == 1 for block in self.blocks)
        return "".join(f", {limit}" for limit in limits)

    @property
    def why(self) -> str:
        """Why there is no winner; "" if there is one, or if several laws are the best."""
        if len(self.entries) == 1:
            return "one law"
        if barred := self.barred:
            return f"none is named over {joined(barred)} with default gains"
        if all(not block.best for block in self.blocks) and all(all(block.lacking.values()) for block in self.blocks):
            return f"every law has runs that {'never end' if self.unit == 's' else 'fail'}"
        undecided = ", or has too few samples to tell" * any(block.undecided for block in self.blocks)
        return self.too_few or ("" if self.best else f"each loses to another, or fails{undecided}")

    @property
    def barred(self) -> list[str]:
        """The laws with default gains over which no winner is named in any block, see `Block.barred`."""
        return list(dict.fromkeys(law for block in self.blocks for law in block.barred))

    @property
    def too_few(self) -> str:
        """The size of the sample in words, if no block has enough samples for a winner; else ""."""
        largest = max(self.blocks, key=lambda block: block.samples)
        smallest_p, error = 2 * min_p(largest.samples), 1 - LEVEL
        if smallest_p <= error / self.family:
            return ""
        compared = f", too few for {self.family} comparisons" if smallest_p <= error else ", too few"
        if largest.samples < largest.sets or (largest.sets > 1 and largest.samples > largest.sets):
            return f"{largest.samples} samples{compared}"
        if largest.sets > 1:
            return f"{largest.sets} sets of gains{compared}"
        if largest.samples < largest.runs:
            return f"{largest.sample}, of two laws {counted(largest.samples, 'distinct run')}"
        return largest.sample + compared * (largest.runs == largest.seeds or smallest_p <= error)

    def failures(self, entry: Entry) -> str:
        """Return how many of a law's runs failed, such as "2 of 24 failed"; "" if none did.

        In a metric that is a time, runs that never end are counted too: "2 of 24 never".
        """
        return f"{entry.failed} of {entry.runs} {'never' if self.unit == 's' else 'failed'}" if entry.failed else ""


def size_in_words(effect: Effect, unit: str = "", rival: str = "") -> str:
    """Return how much less or more a law has than a rival, with the interval, such as "12 % less (8 to 16 %)".

    A difference that is no ratio has the unit. The rival's name, if given, stands before the interval.
    """
    if effect.low == effect.high == float(effect.relative):
        return "no difference"
    if not effect.relative and max(map(abs, effect[:3])) < MIN_DIFFERENCE:
        return f"no difference of {MIN_DIFFERENCE:g} or more"
    endless = math.isinf(effect.high) and effect.low == (0.0 if effect.relative else -math.inf)
    if effect.relative and effect.high < MAX_RATIO_OF_TIMES_LESS:
        times = [number(1 / value) if value else "inf" for value in (effect.value, effect.high, effect.low)]
        words, span = f"{times[0]} times less", f"{times[1]} to {times[2]} times"
    elif effect.relative and effect.low > MIN_RATIO_OF_TIMES_AS_MUCH:
        value, low, high = ("inf" if math.isinf(value) else number(value) for value in effect[:3])
        words, span = f"{value} times as much", f"{low} to {high} times"
    else:
        saved = [float(effect.relative) - value for value in (effect.value, effect.high, effect.low)]
        less = saved[0] >= 0
        value, *ends = saved if less else [0.0 - saved[k] for k in (0, 2, 1)]
        shown, unit = (_percent, " %") if effect.relative else (number, f" {unit}" * (unit not in ("", "1")))
        words, span = f"{shown(value)}{unit} {'less' if less else 'more'}", f"{' to '.join(map(shown, ends))}{unit}"
    named = f" {'as' if words.endswith(' as much') else 'than'} {rival}" * bool(rival)
    return f"{words}{named} ({'too few for an interval' if endless else span})"


def _percent(share: float) -> str:
    """Return a share in percent, with two digits where it is small."""
    return f"{share:g}" if math.isinf(share) else f"{100 * share:.2g}" if abs(share) < 0.0995 else f"{100 * share:.0f}"


def _some_of(names: Sequence[str]) -> str:
    """Return different names in words; if they are many, the first and the last."""
    several = list(dict.fromkeys(names))
    return joined(several) if len(several) <= MAX_NAMES else f"{several[0]} ... {several[-1]} ({len(several)})"


class Boards(Tables, list[Board]):
    """Boards: a list that terminals, notebooks and `print` show as tables, with a verdict on each board.

    Attributes:
      worst: plant -> law -> its `worst_case`, for a column of the plant's tables; empty for none.
      failures: a sentence for each law with failed runs, below the last table.
    """

    worst: Mapping[str, Mapping[str, WorstCase]] = frozen({})
    failures: Sequence[str] = ()

    @property
    def tables(self) -> list[Tabular]:
        """A table for each group of runs: a line for each law, a column for each metric.

        A cell has a median with its interval. The median is marked if no law is better in any block, no run failed, and
        there are enough runs for a winner.
        """
        return tables(self, self.worst, self.failures)


def _listed(names: Sequence[str]) -> str:
    """Join names by commas, or by semicolons if a name has a comma in it."""
    return ("; " if any("," in name for name in names) else ", ").join(names)


def size(value: float, metric: str) -> str:
    """Return a median as text: "" for NaN, a share in percent."""
    if math.isnan(value):
        return ""
    return f"{100 * value:.0f}" if metric == SETTLES else CATALOGUE[metric].text(value)


def spread(interval: Interval, metric: str) -> str:
    """Return the ends of an interval, rounded like its median, so that the printed median is within.

    "" if they are not known, or both infinite.
    """
    if math.isinf(interval.low):
        return ""
    ends = [size(value, metric) for value in (interval.low, interval.high)]
    return "–".join(ends) if all(ends) else ""


def heading(board: Board) -> str:
    """Return a metric's label with its unit, if that is known."""
    if board.metric == SETTLES:
        return "settles (%)"
    units = {plant.unit for block in board.blocks if (plant := catalogue().get(block.plant))}
    metric = dataclasses.replace(CATALOGUE[board.metric], unit=board.unit)  # in V where commands are voltages
    unit = metric.unit_for(units.pop()) if len(units) == 1 else "" if "{" in metric.unit else metric.unit
    return metric.label + (f" ({unit})" if unit not in ("", "1") else "")


def tables(
    boards: Iterable[Board], worst: Mapping[str, Mapping[str, WorstCase]] | None = None, failures: Sequence[str] = ()
) -> list[Tabular]:
    """Return a table for each group of runs, with what each metric's board says below, and a key below the last.

    Args:
      worst: plant -> law -> its worst case, for a last column.
      failures: how laws failed, in sentences above the key.
    """
    groups: dict[str, list[Board]] = {}
    for board in boards:
        groups.setdefault(board.about, []).append(board)
    made = [_table(name, its, (worst or {}).get(its[0].group.get("plant", ""), {})) for name, its in groups.items()]
    if not made:
        return [NO_BOARDS]
    words = key([board for its in groups.values() for board in its])
    return [*made[:-1], dataclasses.replace(made[-1], notes=(*made[-1].notes, *failures, words))]


def _table(name: str, boards: Sequence[Board], worst: Mapping[str, WorstCase]) -> Tabular:
    """Return the table of one group of runs. Laws stand by place in the first metric, then in the next ones."""
    sources_of = sources(boards)
    known = ["gains"] * any(sources_of.values())
    rows: dict[str, list[Cell | str]] = {}
    places: dict[str, list[float]] = {}
    for i, board in enumerate(boards):
        for entry in board.entries:
            left = [Cell(entry.law, colour=style.law_colour(entry.law)), *([kinds(sources_of[entry.law])] * len(known))]
            row = rows.setdefault(entry.law, [*left, *[""] * len(boards)])
            row[len(left) + i] = _cell(board, entry)
            places.setdefault(entry.law, []).append(entry.rank.place)
    for law, case in worst.items():
        rows[law].append(Cell(case.shown(case.value), f"median {case.shown(case.median)}"))
    units = [f"worst found ({case.unit})" for case in worst.values()][:1]
    largest = max(boards, key=lambda board: len(board.blocks))
    name = ", ".join(filter(None, [name, largest.name(largest.blocks[0]) if len(largest.blocks) == 1 else ""]))
    samples = {block.sample: largest.name(block) for block in reversed(largest.blocks)}
    several = "; ".join(f"{sample} ({block}{' ...' * (len(largest.blocks) > 2)})" for sample, block in samples.items())
    return Tabular(
        headings=["law", *known, *map(heading, boards), *units],
        rows=[rows[law] for law in sorted(rows, key=lambda law: (places[law], law))],
        title=f"{name}: {several if len(samples) > 1 else largest.blocks[0].sample}",
        notes=_verdicts(boards),
        left=1 + len(known),
        stacked=True,
    )


def _cell(board: Board, entry: Entry) -> Cell:
    """Return a law's median, strong if no law is better, no run failed and there are enough runs for a winner."""
    median = size(entry.interval.median, board.metric)
    best = entry.rank.best and median != "" and not board.too_few and not board.barred
    return Cell(median, spread(entry.interval, board.metric), best, alarm=board.failures(entry))


def key(boards: Sequence[Board]) -> str:
    """Return what the cells of a table show."""
    words = f"Medians with {100 * LEVEL:g} % intervals over runs, or over sets of gains that runs share"
    medians = [entry.interval for board in boards if board.metric != SETTLES for entry in board.entries]
    if any(interval.n < MIN_INTERVAL_SAMPLES for interval in medians):
        words += f"; of fewer than {MIN_INTERVAL_SAMPLES} samples the interval is their range, and covers less"
    family = max(board.family for board in boards)
    several = f", corrected for {family} comparisons a metric" * (family > 1)
    words += (
        ". Marked: no law is better, and no run failed. A winner is better than every other law in a paired test"
        f"{several}; how much: by pairs of runs, not by the medians; ahead: by more than the least relevant "
        f"difference, {relevance(boards[0].relevant, [(board.metric, board.resolution) for board in boards])}."
    )
    words += f" {capital(UNTRIED)}." * any(board.by_step for board in boards)
    gains = in_words(sources(boards))
    return f"{words} {capital(gains)}." if gains else words


def relevance(share: float, floors: Iterable[tuple[str, float]], x: str = "rad or m") -> str:
    """Return the least relevant difference in words: a share, and a lower bound for each metric, of positions in x."""
    of_unit: dict[str, float] = {}
    for metric, floor in floors:
        unit = "" if metric == SETTLES else CATALOGUE[metric].unit.removesuffix("/s")
        of_unit[unit] = max(floor, of_unit.get(unit, 0.0))
    words = f"{100 * share:g} % of the larger value"
    if resolved := of_unit.get("{x}"):
        words += f", for positions at least what the sensor resolves, up to {number(resolved)} {x}"
    if of_unit.get("{u}"):
        words += f", for u and its variation at least {100 * MIN_COMMAND_SHARE:g} % of its bound"
    return words


def sources(boards: Iterable[Board]) -> dict[str, list[Source]]:
    """Return law -> where its gains come from, by name, for every law of some boards."""
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
    return [f"{', '.join(board.label for board in same)}{same[0].where}: {result}." for result, same in results.items()]
