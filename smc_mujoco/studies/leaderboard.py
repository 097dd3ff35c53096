"""Leaderboards: comparison of a study's laws on equal runs, with the uncertainty of every number.

    boards = leaderboard(table)                        # a Board for each plant and metric
    boards[0].winner                                   # a law's name, or None if no law is significantly better
    rich.print(tables.leaderboard(boards))             # of `cli.tables`

`analysis.bootstrap` and `analysis.ranking` define intervals, ranks and winners. A board is one metric in one group of
runs. Laws are compared in each of its blocks, a plant in a condition. The p-values are corrected for all pairs of laws
in all blocks of the board. The winner of a board with several blocks wins in every one. The conclusions hold for the
plants and conditions of the table, over initial states and noise. `Board.friedman` says whether they would hold in
others.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from smc_mujoco.analysis import paired_runs as cells
from smc_mujoco.analysis.bootstrap import RESAMPLES, Interval, median_of, share_interval
from smc_mujoco.analysis.paired_runs import SETTLES, Columns
from smc_mujoco.analysis.ranking import SEEDS, Comparison, Friedman, Rank, compare, friedman, ranks
from smc_mujoco.common.errors import ScenarioError, find, shown, whole
from smc_mujoco.common.text import joined
from smc_mujoco.control.source import DEFAULT, Source
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.studies import board_tables

METRICS = (SETTLES, "settling_time", "ultimate_bound", "itae", "tv_rate")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry:
    """A law's line in a board: its median, or the share of its runs that settle, and its place.

    `sources`: where its gains come from; none where the table does not say.
    """

    law: str
    interval: Interval
    rank: Rank
    sources: tuple[Source, ...] = ()


@dataclasses.dataclass(frozen=True, kw_only=True)
class Block:
    """Laws compared on one plant in one condition.

    Attributes:
      plant, condition: their names.
      medians: law -> median over the seeds; for "settles" the share of runs that do not settle.
      best: the laws that no other law is better than.
      seeds: number of seeds in which every law ran.
      runs: number of distinct runs among these. In the others every law has the same result as in an earlier seed.
      most: largest number of distinct runs of any two laws. A seed that changes neither law is no sample of the two.
      fewest: smallest number of distinct runs of any two of the best laws; `most` if only one law is best.
      untuned: the laws with default gains, over which no other law is named the winner.
    """

    plant: str
    condition: str
    medians: Mapping[str, float]
    best: tuple[str, ...]
    seeds: int
    runs: int
    most: int
    fewest: int
    untuned: tuple[str, ...] = ()

    @property
    def winner(self) -> str | None:
        """The law that is better than every other, among several, unless `barred`."""
        return self.best[0] if len(self.best) == 1 < len(self.medians) and not self.barred else None

    @property
    def barred(self) -> tuple[str, ...]:
        """The laws with default gains that are worse than the only best law, which is then not named the winner."""
        return tuple(law for law in self.untuned if law not in self.best) if len(self.best) == 1 else ()

    @property
    def sample(self) -> str:
        """The size of the sample in words, such as "20 seeds, 1 distinct run"."""
        seeds = f"{self.seeds} seed{'s' * (self.seeds > 1)}"
        return seeds if self.runs == self.seeds else f"{seeds}, {_distinct(self.runs)}"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Board:
    """Laws compared in one metric within one group of runs.

    Attributes:
      group: what the runs have in common, such as {"plant": "duffing"}.
      metric: a metric's name, or "settles".
      unit: of the medians, with {x} and {u} as in `conventions.Metric.unit`; "" for "settles", which is 0 to 1.
      entries: lowest mean rank first. A median over several plants is NaN if its unit depends on the plant.
      blocks: the same laws on each plant in each condition.
      cells: number of runs of each law, counting only cells that all laws have, and equal runs once.
      seeds: number of seeds, equal runs included.
      pairs: number of comparisons for which the tests are corrected: all pairs of laws, in every block.
      level: level of intervals and tests.
      friedman: Friedman's test; None for one law, or for one plant in one condition.
    """

    group: Mapping[str, str]
    metric: str
    unit: str
    entries: tuple[Entry, ...]
    blocks: tuple[Block, ...]
    cells: int
    seeds: int
    pairs: int
    level: float
    friedman: Friedman | None

    @property
    def best(self) -> tuple[str, ...]:
        """The laws that no other is better than, in any block. With several blocks there may be none."""
        return tuple(entry.law for entry in self.entries if entry.rank.best)

    @property
    def winner(self) -> str | None:
        """The law that wins in every block, if there is one."""
        winners = {block.winner for block in self.blocks}
        return winners.pop() if len(winners) == 1 else None

    def _repr_html_(self) -> str:
        return Boards([self])._repr_html_()

    def to_latex(self) -> str:
        """Return the board as a LaTeX tabular, which needs the package booktabs, see `Boards.to_latex`."""
        return Boards([self]).to_latex()

    @property
    def about(self) -> str:
        """What the runs have in common, such as "duffing, nominal"; "all runs" if nothing."""
        return ", ".join(self.group.values()) or "all runs"

    def wins(self, law: str) -> list[str]:
        """Return the names of the blocks in which a law wins, see `name`."""
        return [self.name(block) for block in self.blocks if block.winner == law]

    def losses(self, law: str) -> list[str]:
        """Return the names of the blocks in which another law is better."""
        return [self.name(block) for block in self.blocks if law not in block.best]

    def name(self, block: Block) -> str:
        """Return the name of a block within the board: its condition, its plant, or both."""
        own = {"plant": block.plant, "condition": block.condition}
        return ", ".join(value for what, value in own.items() if what not in self.group)

    @property
    def kind(self) -> str:
        """The kind of the blocks: "conditions", "plants", or "cells" if they differ in both."""
        return {"plant": "conditions", "condition": "plants"}.get("".join(self.group), "cells")

    @property
    def verdict(self) -> str:
        """The result in words: the winner, else where laws win and lose, why there is no winner, or the best laws."""
        if self.winner:
            return f"winner: {self.winner}" + f", in all {len(self.blocks)} {self.kind}" * (len(self.blocks) > 1)
        results = []
        for law in (entry.law for entry in self.entries):
            if wins := self.wins(law):
                losses = self.losses(law)
                results.append(f"{law} wins under {_listed(wins)}" + f", loses under {_listed(losses)}" * any(losses))
        if results:
            return f"no winner in all {len(self.blocks)} {self.kind}: {'; '.join(results)}"
        if self.why:
            return f"no winner: {self.why}"
        fewest = min(block.fewest for block in self.blocks)
        few = f", two of which have {_distinct(fewest)}"
        return f"no winner, undefeated: {_listed(self.best)}{few * (fewest < SEEDS)}"

    @property
    def why(self) -> str:
        """Why there is no winner; "" if there is one, or if several laws are the best."""
        if len(self.entries) == 1:
            return "one law"
        if barred := self.barred:
            return f"none is named over {joined(barred)} with default gains"
        return self.too_few or ("" if self.best else "each loses to another")

    @property
    def barred(self) -> list[str]:
        """The laws with default gains over which no winner is named in any block, see `Block.barred`."""
        return list(dict.fromkeys(law for block in self.blocks for law in block.barred))

    @property
    def too_few(self) -> str:
        """The size of the sample in words, if no block has enough runs for a winner; else ""."""
        most = max(self.blocks, key=lambda block: block.most)
        if most.runs < SEEDS:
            return most.sample + ", too few" * (most.runs == most.seeds)
        if most.most < SEEDS:
            return f"{most.sample}, of two laws {_distinct(most.most)}"
        if 2.0 ** (1 - most.most) * self.pairs > 1 - self.level:  # the least p-value of the sign test
            return f"{most.sample}, too few for {self.pairs} comparisons"
        return ""


def _distinct(runs: int) -> str:
    return f"{runs} distinct run{'s' * (runs > 1)}"


class Boards(list[Board]):
    """Boards, a list that notebooks show as tables."""

    def _repr_html_(self) -> str:
        return board_tables.as_html(self)

    def to_latex(self) -> str:
        """Return a LaTeX tabular for each group of runs: a line for each law, a column for each metric.

        It needs the package booktabs. A cell has a median with its interval. The median is bold if no law is better in
        any block and there are enough runs for a winner. Comments above it say what it is of.
        """
        return board_tables.as_latex(self)


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
) -> Boards:
    """Compare the laws of a table in each metric within each group.

    Only cells (plant, condition, seed) that every law of the group has are compared. A failed run is inf in all
    metrics. A seed in which two laws both have the same results as in an earlier seed is no further sample of the two.
    A metric that does not apply to a group has no board for it.

    Args:
      table: a study's runs, as `smc.Table.read` returns them.
      metrics: names of metrics, for which lower is better, or "settles".
      by: what the runs of a group have in common, of "plant" and "condition"; () for one group of all runs.
      level: level of confidence.
      resamples, seed: number of resamples of the bootstrap, and seed of their draws.
      defaults: whether a winner may be named over laws whose gains are their defaults.

    Raises:
      ScenarioError: no runs, an unknown metric or group, two runs in a cell, or laws without a common cell.
    """
    if isinstance(metrics, str) or not metrics:
        raise ScenarioError(f"metrics is {shown(metrics)}: give names, such as ('itae', 'tv_rate')")
    known = {SETTLES: ""} | {name: metric.unit for name, metric in CATALOGUE.items()}
    units = {name: find("metric", name, known) for name in metrics}
    boards, seed = Boards(), whole("seed", seed, 0, 2**53 - 1)
    by_row = {name: cells.values(table, name) for name in units}
    for group in cells.groups(table, by):
        ran, sources = cells.scenarios(table, group), cells.sources(table, group.rows[group.rows >= 0])
        at_default = (law for law, its in sources.items() if any(source.kind == DEFAULT for source in its))
        untuned = () if defaults else tuple(at_default)
        for metric, unit in units.items():
            there, scores, outcomes = group.scores(by_row[metric])
            if not scores:
                continue
            floors = [cells.floor(ran[k], unit) for k in there]
            if all((scenario := ran[k]) is not None and scenario.amplifier for k in there):
                unit = unit.replace("({u})", "V").replace("{u}", "V")  # noqa: PLW2901
            found = compare(scores, floors, metric == SETTLES, level, outcomes)
            blocks = tuple(_block(group, found, at, k, untuned) for at, k in enumerate(there))
            mixed = "{" in unit and len({block.plant for block in blocks}) > 1
            board = Board(
                group=group.name,
                metric=metric,
                unit=unit,
                entries=_entries(found, mixed, resamples, seed, sources),
                blocks=blocks,
                cells=sum(block.runs for block in blocks),
                seeds=max(block.seeds for block in blocks),
                pairs=found.pairs,
                level=found.level,
                friedman=friedman(found),
            )
            boards.append(board)
    return boards


def _block(group: cells.Group, found: Comparison, at: int, k: int, untuned: tuple[str, ...]) -> Block:
    """Return block k of a group, which is number `at` of the compared blocks."""
    plant, condition = group.blocks[k]
    runs, laws = found.runs[at], np.array([law in found.best[at] for law in found.laws], bool)
    best = runs[np.ix_(laws, laws)][np.triu_indices(laws.sum(), 1)]
    most = int(runs.max()) if len(laws) > 1 else int(found.seeds[at])
    return Block(
        plant=plant,
        condition=condition,
        medians=dict(zip(found.laws, found.centres[:, at].tolist(), strict=True)),
        best=found.best[at],
        seeds=group.seeds[k],
        runs=int(found.seeds[at]),
        most=most,
        fewest=int(best.min(initial=most)),
        untuned=untuned,
    )


def _entries(
    found: Comparison, mixed: bool, resamples: int, seed: int, sources: Mapping[str, tuple[Source, ...]]
) -> tuple[Entry, ...]:
    """Return the laws' lines. If `mixed`, values have several units, so there is no median."""
    entries = []
    for rank in ranks(found, resamples, seed):
        scores = found.cells[found.laws.index(rank.law)]
        n = scores.shape[1]
        if found.shares:
            interval = share_interval(float(1 - np.nanmean(scores, axis=1).mean()), n, found.level)
        elif mixed:
            interval = Interval(math.nan, math.nan, math.nan, n)
        else:
            interval = median_of(scores, found.level, resamples, seed)
        entries.append(Entry(law=rank.law, interval=interval, rank=rank, sources=sources.get(rank.law, ())))
    return tuple(entries)
