"""Leaderboards: comparison of a study's laws on equal runs, with the uncertainty of every number.

    boards = leaderboard(table)                        # a Board for each plant and metric
    boards[0].winner                                   # a law's name, or None if no law is significantly better
    print(boards[0].verdict)                           # the winner, and by how much it leads
    print(boards)                                      # tables, with all verdicts

`analysis.ranking` defines samples, tests, winners and the correction, `analysis.bootstrap` the intervals of medians. A
board is one metric in one group of runs. Laws are compared in each of its blocks, a plant in a condition. The tests are
corrected for all blocks of the table in this metric, so the verdict on a block is the same on every board that has it.
The winner of a board with several blocks wins in every one. The conclusions hold for the plants and conditions of the
table, over initial states and noise, and over the gains with which the laws ran.
"""

import dataclasses
import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from smc_mujoco.analysis import paired_runs as cells
from smc_mujoco.analysis.bootstrap import RESAMPLES, Interval, median_of, share_interval
from smc_mujoco.analysis.differences import RELEVANT
from smc_mujoco.analysis.paired_runs import SETTLES, Columns
from smc_mujoco.analysis.ranking import (
    Comparison,
    Effect,
    Limits,
    Rank,
    compare,
    corrected,
    ranks,
    samples_of,
)
from smc_mujoco.analysis.signed_rank import least_p
from smc_mujoco.analysis.step_halving import depends_on_step
from smc_mujoco.common.errors import ScenarioError, find, shown, whole
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.tabular import Tables, Tabular
from smc_mujoco.common.text import joined, number
from smc_mujoco.control.source import DEFAULT, Source
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.studies import board_tables

if TYPE_CHECKING:
    from smc_mujoco.simulation.scenario import Scenario
    from smc_mujoco.studies.worst_case import WorstCase

MAX_RATIO_OF_TIMES_LESS = 0.5  # a smaller ratio is "so many times less", a larger one so many percent; chosen
MIN_RATIO_OF_TIMES_AS_MUCH = 10.0  # a larger ratio is "so many times as much", not so many percent; chosen
MIN_DIFFERENCE = 1e-9  # smaller differences are not printed, see `number`
MAX_NAMES = 4  # of plants or conditions in a verdict
METRICS = (SETTLES, "settling_time", "ultimate_bound", "itae", "tv_rate")


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
        """How the law compares with its rival, such as "12 % less than pid (8 to 16 %), ahead in 24 of 24 seeds"."""
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
        seeds = f"{self.seeds} seed{'s' * (self.seeds > 1)}"
        parts = [seeds] + [_distinct(self.runs)] * (self.runs < self.seeds)
        return ", ".join(parts + [f"{self.sets} sets of gains"] * (self.sets > 1))


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Board(Tables):
    """Laws compared in one metric within one group of runs.

    Attributes:
      group: what the runs have in common, such as {"plant": "duffing"}.
      metric: a metric's name, or "settles".
      unit: of the medians, with {x} and {u} as in `conventions.Metric.unit`; "" for "settles", which is 0 to 1.
      entries: lowest mean rank first. A median over several plants is NaN if its unit depends on the plant.
      blocks: the same laws on each plant in each condition.
      cells: number of runs of each law in the cells that all laws have; equal runs count once.
      seeds: number of seeds, equal runs included.
      family: number of blocks of the table for which winners are corrected.
      limits: of the p-values, after the correction.
      level: level of intervals and tests.
      relevant: share of a value that is relevant.
      resolution: the largest difference that a sensor does not resolve, in the unit of the board.
      by_step: whether it is about chattering without RK4, which half the physics step may change.
    """

    group: Mapping[str, str]
    metric: str
    unit: str
    entries: tuple[Entry, ...]
    blocks: tuple[Block, ...]
    cells: int
    seeds: int
    family: int
    limits: Limits
    level: float
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
        return board_tables.tables([self])

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
        return "".join(f" {preposition} {_counted(names)}" for preposition, names in parts.items())

    @property
    def verdict(self) -> str:
        """The metric, the plants, the conditions and the `result`."""
        return f"{self.label}{self.where}: {self.result}"

    @property
    def result(self) -> str:
        """The result in words: the winner, else where laws win and lose, why there is no winner, or the best laws."""
        if self.winner:
            leads = [block.lead for block in self.blocks if block.lead]
            closest = min(leads, key=_closeness, default=None)
            several = f" in all {len(self.blocks)} {self.kind}" * (len(self.blocks) > 1)
            how = f": {'at least ' * (len(leads) > 1)}{closest.words}" if closest else ""
            return f"{self.winner} wins{several}{how}{self._gains([self.winner])}"
        results = {}
        for law in (entry.law for entry in self.entries):
            if wins := self.wins(law):
                losses = self.losses(law)
                results[law] = f"{law} wins under {_listed(wins)}" + f", loses under {_listed(losses)}" * any(losses)
        if results:
            words = "; ".join(results.values()) + self._gains(results)
            return f"no winner in all {len(self.blocks)} {self.kind}: {words}"
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
        smallest_p, error = 2 * least_p(largest.samples), 1 - self.level
        if smallest_p <= error / self.family:
            return ""
        compared = f", too few for {self.family} comparisons" if smallest_p <= error else ", too few"
        if largest.samples < largest.sets or (largest.sets > 1 and largest.samples > largest.sets):
            return f"{largest.samples} samples{compared}"
        if largest.sets > 1:
            return f"{largest.sets} sets of gains{compared}"
        if largest.samples < largest.runs:
            return f"{largest.sample}, of two laws {_distinct(largest.samples)}"
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
    return f"{words}{f' than {rival}' * bool(rival)} ({'too few for an interval' if endless else span})"


def _percent(share: float) -> str:
    """Return a share in percent, with two digits where it is small."""
    return f"{share:g}" if math.isinf(share) else f"{100 * share:.2g}" if abs(share) < 0.0995 else f"{100 * share:.0f}"


def _counted(names: Sequence[str]) -> str:
    """Return different names in words; if they are many, the first and the last."""
    several = list(dict.fromkeys(names))
    return joined(several) if len(several) <= MAX_NAMES else f"{several[0]} ... {several[-1]} ({len(several)})"


def _closeness(lead: Lead) -> float:
    """Return a number that is smallest for the closest lead: ratios by the end of their interval, then differences."""
    return -lead.effect.high if lead.effect.relative else math.inf


def _distinct(runs: int) -> str:
    return f"{runs} distinct run{'s' * (runs > 1)}"


class Boards(Tables, list[Board]):
    """Boards: a list that terminals, notebooks and `print` show as tables, with a verdict on each board.

    Attributes:
      worst: plant -> law -> its `worst_case`, for a column of the plant's tables; empty for none.
    """

    worst: "Mapping[str, Mapping[str, WorstCase]]" = frozen({})

    @property
    def tables(self) -> list[Tabular]:
        """A table for each group of runs: a line for each law, a column for each metric.

        A cell has a median with its interval. The median is marked if no law is better in any block, no run failed, and
        there are enough runs for a winner.
        """
        return board_tables.tables(self, self.worst)


def _listed(names: Sequence[str]) -> str:
    """Join names by commas, or by semicolons if a name has a comma in it."""
    return ("; " if any("," in name for name in names) else ", ").join(names)


def leaderboard(
    table: Columns,
    metrics: Sequence[str] = METRICS,
    by: Sequence[str] = ("plant",),
    level: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
    defaults: bool = False,
    relevant: float = RELEVANT,
    worst: "Mapping[str, Mapping[str, WorstCase]] | None" = None,
) -> Boards:
    """Compare the laws of a table in each metric within each group.

    Only cells (plant, condition, seed) that every law of the group has are compared. A failed run is inf in all
    metrics. A seed in which two laws both have the same results as in an earlier seed is no further sample of the two.
    Runs that share one of several sets of gains of a law are one sample. A metric that does not apply to a group has no
    board for it.

    Args:
      table: a study's runs, as `smc.Table.read` returns them.
      metrics: names of metrics, for which lower is better, or "settles".
      by: what the runs of a group have in common, of "plant" and "condition"; () for one group of all runs.
      level: level of confidence.
      resamples, seed: number of resamples of the bootstrap, and seed of their draws.
      defaults: whether a winner may be named over laws whose gains are their defaults.
      relevant: the least relevant difference, as a share of the larger value; at least what the sensor of a condition
        resolves is relevant too.
      worst: plant -> law -> its `worst_case`, for a column of the tables.

    Raises:
      ScenarioError: no runs, an unknown metric or group, two runs in a cell, or laws without a common cell.
    """
    if isinstance(metrics, str) or not metrics:
        raise ScenarioError(f"metrics is {shown(metrics)}: give names, such as ('itae', 'tv_rate')")
    known = {SETTLES: ""} | {name: metric.unit for name, metric in CATALOGUE.items()}
    units = {name: find("metric", name, known) for name in metrics}
    boards, seed = Boards(), whole("seed", seed, 0, 2**53 - 1)
    boards.worst = worst or {}
    by_row = {name: cells.values(table, name) for name in units}
    groups = list(cells.groups(table, by))
    every = groups if set(by) == set(cells.GROUPS) else list(cells.groups(table, cells.GROUPS))
    families = {name: _family(table, every, by_row[name], name, units[name], level, relevant) for name in units}
    for group in groups:
        ran = cells.scenarios(table, group)
        sources = cells.sources(table, group.rows[group.rows >= 0])
        at_default = (law for law, its in sources.items() if any(source.kind == DEFAULT for source in its))
        untuned = () if defaults else tuple(at_default)
        for metric, unit in units.items():
            limits, family = families[metric]
            scores = group.scores(by_row[metric])
            if not (there := scores.blocks):
                continue
            floors = [cells.floor(ran[k], unit) for k in there]
            if all((scenario := ran[k]) is not None and scenario.amplifier for k in there):
                unit = unit.replace("({u})", "V").replace("{u}", "V")  # noqa: PLW2901
            comparison = compare(
                scores.values, floors, metric == SETTLES, level, scores.outcomes, scores.sets, relevant, limits
            )
            on = [_unit(metric, unit, ran[k]) for k in there]
            blocks = tuple(_block(group, comparison, at, k, untuned, on[at]) for at, k in enumerate(there))
            mixed = "{" in unit and len({block.plant for block in blocks}) > 1
            board = Board(
                group=group.name,
                metric=metric,
                unit=unit,
                entries=_entries(comparison, scores.sets, sources, mixed, resamples, seed),
                blocks=blocks,
                cells=sum(block.runs for block in blocks),
                seeds=max(block.seeds for block in blocks),
                family=family,
                limits=comparison.limits,
                level=comparison.level,
                relevant=comparison.relevant,
                resolution=max(floors),
                by_step=metric.startswith("chattering") and any(map(depends_on_step, filter(None, ran))),
            )
            boards.append(board)
    return boards


def _family(
    table: Columns,
    blocks: Sequence[cells.Group],
    by_row: np.ndarray,
    metric: str,
    unit: str,
    level: float,
    relevant: float,
) -> tuple[Limits, int]:
    """Return the limits of the p-values of a metric, corrected for all blocks of a table, and the number of these."""
    comparisons = []
    for group in blocks:
        try:
            scores = group.scores(by_row)
        except ScenarioError:  # laws that share no run: there is nothing to compare
            continue
        if scores.values:
            floors = [cells.floor(cells.scenarios(table, group)[k], unit) for k in scores.blocks]
            comparisons.append(
                compare(
                    scores.values,
                    floors,
                    metric == SETTLES,
                    level,
                    scores.outcomes,
                    scores.sets,
                    relevant,
                    Limits(0.0, 0.0),
                )
            )
    return corrected(comparisons, level), sum(len(one.laws) > 1 for one in comparisons) or 1


def _unit(metric: str, unit: str, scenario: "Scenario | None") -> str:
    """Return the unit of a board for the plant of a run; "" where it is not known."""
    if metric == SETTLES or scenario is None:
        return "" if "{" in unit else unit
    return dataclasses.replace(CATALOGUE[metric], unit=unit).unit_for(scenario.plant.unit)


def _block(group: cells.Group, comparison: Comparison, at: int, k: int, untuned: tuple[str, ...], unit: str) -> Block:
    """Return block k of a group, block `at` of the comparison, with values in `unit`."""
    plant, condition = group.blocks[k]
    sets = comparison.sets[:, at]
    return Block(
        plant=plant,
        condition=condition,
        medians=dict(zip(comparison.laws, comparison.centres[:, at].tolist(), strict=True)),
        lacking=dict(zip(comparison.laws, comparison.without_value[:, at].tolist(), strict=True)),
        best=comparison.best[at],
        undecided=tuple(np.array(comparison.laws)[comparison.undecided[:, at]].tolist()),
        ahead=comparison.winners[at],
        lead=_lead(comparison, at, unit),
        seeds=group.seeds[k],
        runs=int(comparison.seeds[at]),
        samples=int(comparison.samples[at].max()) if len(comparison.laws) > 1 else int(comparison.seeds[at]),
        sets=int(sets[sets > 1].min()) if (sets > 1).any() else 1,
        untuned=untuned,
    )


def _lead(comparison: Comparison, at: int, unit: str) -> Lead | None:
    """Return how the law in front of a block compares with its closest rival, that with the largest p-value."""
    if len(comparison.laws) < 2 or comparison.shares:
        return None
    lacking, winner = comparison.without_value[:, at], comparison.winners[at]
    order = sorted(range(len(comparison.laws)), key=lambda i: (lacking[i], comparison.centres[i, at]))
    first = order[0] if winner is None else comparison.laws.index(winner)
    if lacking[first]:
        return None
    rival = max((i for i in order if i != first), key=lambda i: comparison.p[at, first, i])
    names = comparison.laws[first], comparison.laws[rival]
    effect = comparison.effect(at, *names)
    return Lead(*names, effect, unit) if math.isfinite(effect.value) and effect.samples else None


def _entries(
    comparison: Comparison,
    sets: Mapping[str, np.ndarray],
    sources: Mapping[str, tuple[Source, ...]],
    mixed: bool,
    resamples: int,
    seed: int,
) -> tuple[Entry, ...]:
    """Return the entries of all laws. If `mixed`, values have several units, so there is no median."""
    entries = []
    for rank in ranks(comparison):
        at = comparison.laws.index(rank.law)
        values, samples = comparison.cells[at], samples_of(sets[rank.law])
        n = values.shape[1] if samples is None else max(samples) + 1
        if comparison.shares:
            interval = share_interval(float(1 - np.nanmean(values, axis=1).mean()), n, comparison.level)
        elif mixed:
            interval = Interval(math.nan, math.nan, math.nan, n)
        else:
            interval = median_of(values, comparison.level, resamples, seed, samples)
        failed, runs = int(comparison.without_value[at].sum()), int((~np.isnan(values)).sum())
        its = sources.get(rank.law, ())
        entries.append(Entry(law=rank.law, interval=interval, rank=rank, failed=failed, runs=runs, sources=its))
    return tuple(entries)
