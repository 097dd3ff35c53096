"""A study's table as a report shows it: each law's score in every cell, and the laws' places over many cells."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.bootstrap import median_of
from smc_mujoco.analysis.paired_runs import SETTLES
from smc_mujoco.studies.leaderboard import Board, leaderboard
from smc_mujoco.studies.report import words
from smc_mujoco.studies.report.findings import Place, Score

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table


def scores(table: "Table") -> tuple[Score, ...]:
    """Return a score for every law, cell and column of the leaderboard, in the table's order."""
    lost, found = failures(table), []
    order = list(dict.fromkeys(table.column("law").tolist()))
    boards = leaderboard(table, words.COLUMNS, by=("plant",))
    known = {(b.plant, b.condition, board.metric): b for board in boards for b in board.blocks}
    by_row = {metric: paired_runs.values(table, metric) for metric in words.COLUMNS}
    for group in paired_runs.groups(table, by=("plant", "condition")):
        ((plant, condition),) = group.blocks
        for metric in words.COLUMNS:
            _, by_law, _ = group.scores(by_row[metric])
            for law in sorted(by_law, key=order.index):
                block, interval = known[plant, condition, metric], median_of(by_law[law])
                score = Score(
                    plant=plant,
                    condition=condition,
                    law=law,
                    metric=metric,
                    median=interval.median,
                    low=interval.low,
                    high=interval.high,
                    best=law in block.best,
                    seeds=block.seeds,
                    failed=lost.get((plant, condition, law), 0),
                    runs=block.runs,
                )
                found.append(score)
    return tuple(found)


def places(table: "Table") -> tuple[Place, ...]:
    """Return every law's place in each metric that the overview ranks, by plant and over all plants."""
    boards = leaderboard(table, words.RANKED, by=("plant",))
    by_plant = [place for board in boards for place in _places(board)]
    names = dict.fromkeys((place.metric, place.law) for place in by_plant)
    own = {name: [place for place in by_plant if (place.metric, place.law) == name] for name in names}
    most = {metric: max(len(group) for (m, _), group in own.items() if m == metric) for metric, _ in names}
    overall = [_overall(group) for (metric, _), group in own.items() if len(group) == most[metric]]
    return (*by_plant, *overall)


def _places(board: Board) -> list[Place]:
    return [
        Place(
            plant=board.group["plant"],
            metric=board.metric,
            law=entry.law,
            mean=entry.rank.mean,
            low=entry.rank.low,
            high=entry.rank.high,
            best=entry.rank.best,
            median=entry.interval.median,
            wins=len(board.wins(entry.law)),
            losses=len(board.losses(entry.law)),
            of=len(board.blocks),
            why=board.why,
        )
        for entry in board.entries
    ]


def _overall(by_plant: Sequence[Place]) -> Place:
    """Return a law's place over all plants, from its places on each; every cell weighs the same."""
    of = [place.of for place in by_plant]
    first, whys = by_plant[0], {place.why for place in by_plant}
    return Place(
        plant="",
        metric=first.metric,
        law=first.law,
        mean=float(np.average([place.mean for place in by_plant], weights=of)),
        low=math.nan,
        high=math.nan,
        best=all(place.best for place in by_plant),
        median=float(np.average([place.median for place in by_plant], weights=of))
        if first.metric == SETTLES
        else math.nan,
        wins=sum(place.wins for place in by_plant),
        losses=sum(place.losses for place in by_plant),
        of=sum(of),
        why=whys.pop() if len(whys) == 1 else "",
    )


def failures(table: "Table") -> dict[tuple[str, str, str], int]:
    """Return (plant, condition, law) -> how many runs failed, where some did."""
    found: dict[tuple[str, str, str], int] = {}
    columns = [table.column(name).tolist() for name in ("plant", "condition", "law", "failure")]
    for plant, condition, law, failure in zip(*columns, strict=True):
        if failure is not None:
            found[plant, condition, law] = found.get((plant, condition, law), 0) + 1
    return found


def seeds(table: "Table") -> int:
    """Return the number of seeds of a cell, the largest where cells differ."""
    return len(np.unique(table.column("seed")))


def failed(table: "Table") -> int:
    """Return how many runs failed."""
    return sum(failures(table).values()) if len(table) else 0
