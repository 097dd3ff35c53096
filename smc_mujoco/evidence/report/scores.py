"""A study's table as a report shows it: each law's score in every cell, and the laws' places over many cells.

A cell is a plant in a condition. Every `metric` is the name of one in `metrics`, or "settles".
"""

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.bootstrap import median_of
from smc_mujoco.analysis.paired_runs import SETTLES
from smc_mujoco.analysis.ranking import RELEVANT, linked
from smc_mujoco.evidence.report import words
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.studies.leaderboard import leaderboard

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table


class Score(NamedTuple):
    """A law's median in a cell over the seeds, with its 95 % interval; inf is never."""

    plant: str
    condition: str
    law: str
    metric: str
    median: float
    low: float
    high: float
    best: bool  # no other law is better there, and no run failed, see `ranking`; several laws may be
    beaten: bool  # another law is better, or runs failed; neither where samples are too few to tell
    wins: bool  # it is better than every other
    lead: str  # by how much it wins
    seeds: int  # of the runs
    failed: int  # runs
    runs: int  # distinct ones
    sample: str  # its size in words
    floor: float  # see `paired_runs.floor`


class Place(NamedTuple):
    """A law's place in a metric over all cells of a plant, or of all plants, where `plant` is ""."""

    plant: str
    metric: str
    law: str
    mean: float  # rank over the cells, 1 is the best
    failed: int  # runs that failed or have no value; laws with fewer come first
    best: bool  # no law is better in any cell
    median: float  # of the cells' medians, NaN where units differ; of "settles" the share of runs that settle
    wins: int  # cells
    losses: int  # cells in which another law is better, it has runs that fail, or samples are too few to tell
    of: int  # cells


def scores(table: "Table", relevant: float = RELEVANT) -> tuple[Score, ...]:
    """Return a score for every law, cell and column of the leaderboard, in the table's order."""
    columns = [table.column(name).tolist() for name in ("plant", "condition", "law", "failure")]
    failed = Counter(tuple(cell) for *cell, failure in zip(*columns, strict=True) if failure is not None)
    order = list(dict.fromkeys(columns[2]))
    boards = leaderboard(table, words.TABLE_METRICS, by=("plant",), relevant=relevant)
    blocks = {(block.plant, block.condition, board.metric): block for board in boards for block in board.blocks}
    by_row = {metric: paired_runs.values(table, metric) for metric in words.TABLE_METRICS}
    rows = []
    for group in paired_runs.groups(table, by=("plant", "condition")):
        ((plant, condition),) = group.blocks
        (ran,) = paired_runs.scenarios(table, group)
        for metric in words.TABLE_METRICS:
            by_law = group.scores(by_row[metric])
            for law in sorted(by_law.values, key=order.index):
                block = blocks[plant, condition, metric]
                interval = median_of(by_law.values[law], linked(*by_law.sets[law]))
                wins = block.winner == law
                score = Score(
                    plant=plant,
                    condition=condition,
                    law=law,
                    metric=metric,
                    median=interval.median,
                    low=interval.low,
                    high=interval.high,
                    best=law in block.best,
                    beaten=law not in (*block.best, *block.undecided),
                    wins=wins,
                    lead=block.lead.words if wins and block.lead else "",
                    seeds=block.seeds,
                    failed=failed[plant, condition, law],
                    runs=block.runs,
                    sample=block.sample,
                    floor=paired_runs.floor(ran, CATALOGUE[metric].unit),
                )
                rows.append(score)
    return tuple(rows)


def places(table: "Table", relevant: float = RELEVANT) -> tuple[Place, ...]:
    """Return every law's place in each metric that the overview ranks, by plant and over all plants."""
    by_law: dict[tuple[str, str], list[Place]] = {}
    for board in leaderboard(table, words.RANKED_METRICS, by=("plant",), relevant=relevant):
        for entry in board.entries:
            place = Place(
                plant=board.group["plant"],
                metric=board.metric,
                law=entry.law,
                mean=entry.rank.mean,
                failed=entry.failed,
                best=entry.rank.best,
                median=entry.interval.median,
                wins=len(board.wins(entry.law)),
                losses=sum(entry.law not in block.best for block in board.blocks),
                of=len(board.blocks),
            )
            by_law.setdefault((board.metric, entry.law), []).append(place)
    most = {metric: max(len(its) for (name, _), its in by_law.items() if name == metric) for metric, _ in by_law}
    on_plants = [place for its in by_law.values() for place in its]
    return (*on_plants, *(_overall(its) for (metric, _), its in by_law.items() if len(its) == most[metric]))


def _overall(by_plant: Sequence[Place]) -> Place:
    """Return a law's place over all plants, from its places on each; every cell weighs the same."""
    first, cells = by_plant[0], [place.of for place in by_plant]
    mean, median = np.average([(place.mean, place.median) for place in by_plant], axis=0, weights=cells).tolist()
    sums = {name: sum(getattr(place, name) for place in by_plant) for name in ("failed", "wins", "losses", "of")}
    median = median if first.metric == SETTLES else math.nan
    return first._replace(plant="", mean=mean, best=all(place.best for place in by_plant), median=median, **sums)
