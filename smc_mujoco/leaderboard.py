"""Leaderboards: a study's laws compared on equal runs, with the uncertainty of every number.

    boards = leaderboard(table)                        # a Board for each plant and metric
    boards[0].winner                                   # a law's name, or None inside the noise
    rich.print(leaderboard_table(boards))

What intervals, ranks and winners mean: `statistics`, `ranking`. The conclusions hold for the plants and conditions of
the table, over starts and noise; `Board.friedman` says how they would carry over to other conditions.
"""

import dataclasses
import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from smc_mujoco import cells
from smc_mujoco.cells import SETTLES, Columns
from smc_mujoco.errors import ScenarioError, shown, unknown
from smc_mujoco.ranking import Friedman, Rank, friedman, ranks
from smc_mujoco.statistics import RESAMPLES, Interval, checked, median_of, share_interval

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

METRICS = (SETTLES, "settling_time", "ultimate_bound", "itae", "tv_rate")
KEY = (
    "median, #place by mean rank over the shared runs, {level:.3g} % interval over seeds; * may be the best: "
    "no winner where several may, inside the noise; x, u of driven joints, in rad or m, N m or N"
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry:
    """A law's line: its median, or the share of its runs that settle, and its place."""

    law: str
    interval: Interval
    rank: Rank


@dataclasses.dataclass(frozen=True, kw_only=True)
class Board:
    """Laws compared in one metric within one group of runs.

    Attributes:
      group: what the runs have in common, such as {"plant": "duffing"}.
      metric: a metric's name, or "settles".
      unit: of the medians, with {x} and {u} as in `measure.Metric.unit`; "" for "settles", which is 0 to 1.
      entries: lowest mean rank first. A median over several plants is NaN where its unit depends on the plant.
      cells: how many runs each law has here: those that all laws have.
      seeds: in how many seeds.
      level: of intervals and tests.
      friedman: None of one law, or one plant in one condition.
    """

    group: Mapping[str, str]
    metric: str
    unit: str
    entries: tuple[Entry, ...]
    cells: int
    seeds: int
    level: float
    friedman: Friedman | None

    @property
    def best(self) -> tuple[str, ...]:
        """The laws that may be the best; none where each is beaten by another, in a circle."""
        return tuple(entry.law for entry in self.entries if entry.rank.best)

    @property
    def winner(self) -> str | None:
        """The law that alone may be the best, among several."""
        return self.best[0] if len(self.best) == 1 < len(self.entries) else None

    @property
    def verdict(self) -> str:
        """In words: "winner: classical", or "no winner: ..." with the laws that may be."""
        if self.winner:
            return f"winner: {self.winner}"
        return f"no winner: {self.why or ', '.join(self.best)}"

    @property
    def why(self) -> str:
        """Why there can be no winner, "" if there can be."""
        if len(self.entries) == 1:
            return "one law"
        if 0.5**self.seeds > (1 - self.level) / 2:  # the least p-value of the test, see `ranking`
            return f"{self.seeds} seed{'s' * (self.seeds > 1)}, too few"
        return "" if self.best else "each loses to another"


def leaderboard(
    table: Columns,
    metrics: Sequence[str] = METRICS,
    by: Sequence[str] = ("plant",),
    level: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> list[Board]:
    """The laws of a table, compared in each metric within each group.

    Only cells - plant, condition, seed - that every law of the group has are compared; a run that failed is inf in all
    metrics. A metric that does not apply to a group has no board there.

    Args:
      metrics: names of metrics, lower being better, or "settles".
      by: what makes a group, of "plant" and "condition"; () is all runs together.

    Raises:
      ScenarioError: no runs, an unknown metric or group, two runs of a cell, or laws without a common cell.
    """
    units, found = _units(metrics), []
    by_row = {name: cells.values(table, name) for name in units}
    for group in cells.groups(table, by):
        for metric, unit in units.items():
            if scores := group.scores(by_row[metric]):
                there = ~np.isnan(scores[group.laws[0]])
                board = Board(
                    group=group.name,
                    metric=metric,
                    unit=unit,
                    entries=_entries(scores, metric, group.plants > 1 and "{" in unit, level, resamples, seed),
                    cells=int(there.sum()),
                    seeds=there.shape[1],
                    level=checked(level),
                    friedman=friedman(scores, level),
                )
                found.append(board)
    return found


def _units(metrics: Sequence[str]) -> dict[str, str]:
    """Name -> unit, of the metrics asked for."""
    from smc_mujoco.metrics import metrics as catalogue

    known = {SETTLES: ""} | {m.name: m.unit for m in catalogue()}
    if isinstance(metrics, str) or not metrics:
        raise ScenarioError(f"metrics is {shown(metrics)}: give names, such as ('itae', 'tv_rate')")
    for name in metrics:
        if name not in known:
            raise unknown("metric", name, known)
    return {name: known[name] for name in metrics}


def _entries(
    scores: dict[str, np.ndarray], metric: str, mixed: bool, level: float, resamples: int, seed: int
) -> tuple[Entry, ...]:
    """The laws' lines; `mixed` if there is no median, of values in several units."""
    found = []
    for rank in ranks(scores, level, resamples, seed):
        by_cell = scores[rank.law]
        n = by_cell.shape[1]
        if metric == SETTLES:
            interval = share_interval(float(1 - np.nanmean(by_cell)), n, level)
        elif mixed:
            interval = Interval(math.nan, math.nan, math.nan, n)
        else:
            interval = median_of(by_cell, level, resamples, seed)
        found.append(Entry(law=rank.law, interval=interval, rank=rank))
    return tuple(found)


def leaderboard_table(boards: Sequence[Board]) -> "Table":
    """Boards for the terminal: a part a group, a line a law, a column a metric, and below them who wins."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from smc_mujoco.draw import style

    metrics = {board.metric: board.unit for board in boards}
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    lines = max((metric.count("_") for metric in metrics), default=0)
    table.add_column("law", no_wrap=True, min_width=0 if boards else 30)
    for metric, unit in metrics.items():
        head = Text("\n" * (lines - metric.count("_")) + metric.replace("_", "\n"))
        head.append(f"\n{unit.format(x='x', u='u') or '%'}", "dim not bold")
        table.add_column(head, justify="right", overflow="fold")  # no digit is cut off
    for group in dict.fromkeys(tuple(board.group.items()) for board in boards):
        own = {board.metric: board for board in boards if tuple(board.group.items()) == group}
        seeds = max(board.seeds for board in own.values())
        size = f"{max(board.cells for board in own.values())} runs,\n{seeds} seed{'s' * (seeds > 1)}"
        name = "\n".join(_folded(name) for _, name in group) or "all"
        table.add_row(Text(f"{name}\n", "bold").append(size, "dim not bold"))
        for law in sorted({entry.law for board in own.values() for entry in board.entries}):
            table.add_row(
                Text(_folded(law), style.law_colour(law)), *(_cell(own.get(metric), law) for metric in metrics)
            )
        table.add_row("", *(_winner(own.get(metric)) for metric in metrics), end_section=True)
    table.caption = KEY.format(level=100 * boards[0].level) if boards else "no boards: no metric applies"
    table.caption_justify = "left"
    return table


def _folded(name: str, width: int = 13) -> str:
    """A name on several lines, broken after underscores."""
    return "\n".join(textwrap.wrap(name.replace("_", "_ "), width)).replace("_ ", "_")


def _cell(board: Board | None, law: str) -> "Text":
    """A law's median, place and interval."""
    from rich.text import Text

    entry = next((e for e in board.entries if e.law == law), None) if board else None
    if board is None or entry is None:
        return Text("")
    middle = _number(entry.interval.median, board.metric)
    low, high = (_number(value, board.metric, digits=2) for value in entry.interval[1:3])
    text = Text(f"{middle} " if middle else "", "bold" if entry.rank.best else "")
    text.append(f"#{entry.rank.median:g}").append("*" if entry.rank.best else " ")
    return text.append(f"\n{low}–{high}" if low else "", "dim not bold")


def _number(value: float, metric: str, digits: int = 3) -> str:
    from smc_mujoco.tables import number

    if math.isnan(value):
        return ""
    return f"{100 * value:.0f}" if metric == SETTLES else number(value, digits)


def _winner(board: Board | None) -> "Text":
    """Who wins a board."""
    from rich.text import Text

    from smc_mujoco.draw import style

    if board is None:
        return Text("")
    if board.winner:
        return Text("winner\n").append(_folded(board.winner, 12), f"bold {style.law_colour(board.winner)}")
    return Text(f"no winner\n{board.why or f'{len(board.best)} of {len(board.entries)}*'}", "dim")
