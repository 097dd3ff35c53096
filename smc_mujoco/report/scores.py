"""A study's table as a report shows it: a score a law in every cell, and the laws' places over many cells."""

from typing import TYPE_CHECKING

import numpy as np

from smc_mujoco.leaderboard import Board, leaderboard
from smc_mujoco.report import words
from smc_mujoco.report.findings import Place, Score

if TYPE_CHECKING:
    from smc_mujoco.table import Table


def scores(table: "Table") -> tuple[Score, ...]:
    """Every law in every cell in every column of the leaderboard, in the table's order."""
    lost = failures(table)
    order = {law: i for i, law in enumerate(dict.fromkeys(table.column("law").tolist()))}
    found = []
    for board in leaderboard(table, words.COLUMNS, by=("plant", "condition")):
        plant, condition = board.group["plant"], board.group["condition"]
        for entry in sorted(board.entries, key=lambda e: order[e.law]):
            median, low, high, _ = entry.interval
            failed = lost.get((plant, condition, entry.law), 0)
            cell = plant, condition, entry.law, board.metric
            found.append(Score(*cell, median, low, high, entry.rank.best, board.seeds, failed))
    return tuple(found)


def places(table: "Table") -> tuple[Place, ...]:
    """Every law's place in what the overview ranks, plant by plant, and over all of them."""
    boards = leaderboard(table, words.RANKED, by=("plant",)) + leaderboard(table, words.RANKED, by=())
    return tuple(place for board in boards for place in _places(board))


def _places(board: Board) -> list[Place]:
    plant = board.group.get("plant", "")
    return [
        Place(
            plant,
            board.metric,
            entry.law,
            entry.rank.mean,
            entry.rank.low,
            entry.rank.high,
            entry.rank.best,
            entry.interval.median,
            board.why,
        )
        for entry in board.entries
    ]


def failures(table: "Table") -> dict[tuple[str, str, str], int]:
    """(plant, condition, law) -> runs that failed, where some did."""
    found: dict[tuple[str, str, str], int] = {}
    columns = [table.column(name).tolist() for name in ("plant", "condition", "law", "failure")]
    for plant, condition, law, failure in zip(*columns, strict=True):
        if failure is not None:
            found[plant, condition, law] = found.get((plant, condition, law), 0) + 1
    return found


def seeds(table: "Table") -> int:
    """Of every cell; the most where they differ."""
    return len(np.unique(table.column("seed")))


def failed(table: "Table") -> int:
    """Runs that failed."""
    return sum(failures(table).values()) if len(table) else 0
