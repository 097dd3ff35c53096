"""A study's table as a report shows it: each law's score in every cell, a plant in a condition."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.bootstrap import median_of
from smc_mujoco.analysis.ranking import linked
from smc_mujoco.evidence.report import words
from smc_mujoco.studies.board import Board

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table


class Score(NamedTuple):
    """A law's median in a cell over the seeds, with its 95 % interval; inf means never."""

    plant: str
    condition: str
    law: str
    metric: str
    median: float
    low: float
    high: float
    best: (
        bool  # no other law is better there, and no run failed, see `ranking`; several laws may be
    )
    beaten: bool  # another law is better, or runs failed; neither where samples are too few to tell
    wins: bool  # it is better than every other
    lead: str  # by how much it wins
    seeds: int  # of the runs
    failed: int  # runs
    runs: int  # distinct ones
    sample: str  # its size in words
    floor: float  # see `paired_runs.floor`
    by_step: tuple[float, float] | None = (
        None  # medians at the physics step and at half of it, where they are apart
    )


def scores(table: "Table", boards: Sequence[Board]) -> tuple[Score, ...]:
    """Return a score for every law, cell and column of the leaderboard, in the table's order;
    boards: of each plant.
    """
    columns = [table.column(name).tolist() for name in ("plant", "condition", "law", "failure")]
    failed = Counter(
        tuple(cell) for *cell, failure in zip(*columns, strict=True) if failure is not None
    )
    order = list(dict.fromkeys(columns[2]))
    blocks = {
        (block.plant, block.condition, board.metric): block
        for board in boards
        for block in board.blocks
    }
    by_row = {metric: paired_runs.by_row(table, metric) for metric in words.TABLE_METRICS}
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
                    floor=paired_runs.floor(ran, metric),
                    by_step=block.by_step.get(law),
                )
                rows.append(score)
    return tuple(rows)
