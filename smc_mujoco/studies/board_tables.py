"""Boards as tables: a line for each law, a column for each metric with medians and their intervals.

`leaderboard` imports this module, so its class Board is not named here.
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from smc_mujoco.analysis.bootstrap import Interval
from smc_mujoco.analysis.paired_runs import SETTLES
from smc_mujoco.analysis.step_halving import UNTRIED
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import number
from smc_mujoco.control.source import Source, in_words, kinds
from smc_mujoco.draw import style
from smc_mujoco.mechanisms.plant import catalogue
from smc_mujoco.metrics.catalogue import CATALOGUE

MIN_INTERVAL_RUNS = 6  # with fewer runs no interval of a median covers 95 %, see `analysis.bootstrap`
NO_BOARDS = Tabular(headings=["no boards: no metric applies"], rows=[])


def size(value: float, metric: str) -> str:
    """Return a median as text: "" for NaN, a share in percent."""
    if math.isnan(value):
        return ""
    return f"{100 * value:.0f}" if metric == SETTLES else CATALOGUE[metric].text(value)


def spread(interval: Interval, metric: str) -> str:
    """Return the ends of an interval, rounded like its median, so that the printed median is within; "" if unknown."""
    ends = [size(value, metric) for value in (interval.low, interval.high)]
    return "–".join(ends) if all(ends) else ""


def heading(board: Any) -> str:
    """Return a metric's label with its unit, if that is known."""
    if board.metric == SETTLES:
        return "settles (%)"
    units = {plant.unit for block in board.blocks if (plant := catalogue().get(block.plant))}
    metric = dataclasses.replace(CATALOGUE[board.metric], unit=board.unit)  # in V where commands are voltages
    unit = metric.unit_for(units.pop()) if len(units) == 1 else "" if "{" in metric.unit else metric.unit
    return metric.label + (f" ({unit})" if unit not in ("", "1") else "")


def tables(boards: Iterable[Any], worst: Mapping[str, Mapping[str, Any]] | None = None) -> list[Tabular]:
    """Return a table for each group of runs, with what each metric's board says below, and a key below the last.

    Args:
      worst: plant -> law -> its worst case, for a last column.
    """
    groups: dict[str, list[Any]] = {}
    for board in boards:
        groups.setdefault(board.about, []).append(board)
    made = [_table(name, each, (worst or {}).get(each[0].group.get("plant", ""), {})) for name, each in groups.items()]
    if not made:
        return [NO_BOARDS]
    words = key([board for each in groups.values() for board in each])
    return [*made[:-1], dataclasses.replace(made[-1], notes=(*made[-1].notes, words))]


def _table(name: str, boards: Sequence[Any], worst: Mapping[str, Any]) -> Tabular:
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


def _cell(board: Any, entry: Any) -> Cell:
    """Return a law's median, strong if no law is better, no run failed and there are enough runs for a winner."""
    median = size(entry.interval.median, board.metric)
    best = entry.rank.best and median != "" and not board.too_few and not board.barred
    return Cell(median, spread(entry.interval, board.metric), best, alarm=board.failures(entry))


def key(boards: Sequence[Any]) -> str:
    """Return what the cells of a table show."""
    words = f"Medians with {100 * boards[0].level:g} % intervals over runs, or over sets of gains that runs share"
    if any(block.runs < MIN_INTERVAL_RUNS for board in boards for block in board.blocks):
        words += f"; of fewer than {MIN_INTERVAL_RUNS} runs the interval is their range, and covers less"
    family = max(board.family for board in boards)
    several = f", corrected for {family} comparisons a metric" * (family > 1)
    words += (
        ". Marked: no law is better, and no run failed. A winner is better than every other law in a paired test"
        f"{several}; how much: by pairs of runs, not by the medians; {relevance(boards)}."
    )
    words += f" {UNTRIED[:1].upper()}{UNTRIED[1:]}." * any(board.by_step for board in boards)
    gains = in_words(sources(boards))
    return f"{words} {gains[:1].upper()}{gains[1:]}." if gains else words


def relevance(boards: Sequence[Any]) -> str:
    """Return the least relevant difference of boards in words."""
    resolved = max((board.resolution for board in boards if board.unit == "{x}"), default=0.0)
    sensor = f", for positions at least what the sensor resolves, up to {number(resolved)} rad or m" if resolved else ""
    return f"least relevant difference: {100 * boards[0].relevant:g} % of the larger value{sensor}"


def sources(boards: Iterable[Any]) -> dict[str, list[Source]]:
    """Return law -> where its gains come from, by name, for every law of some boards."""
    by_law: dict[str, list[Source]] = {}
    for board in boards:
        for entry in board.entries:
            by_law.setdefault(entry.law, []).extend(entry.sources)
    return dict(sorted(by_law.items()))


def _verdicts(boards: Sequence[Any]) -> list[str]:
    """Return the verdicts of boards; metrics with the same result share a sentence."""
    results: dict[str, list[Any]] = {}
    for board in boards:
        results.setdefault(board.result, []).append(board)
    return [f"{', '.join(one.label for one in same)}{same[0].where}: {result}." for result, same in results.items()]
