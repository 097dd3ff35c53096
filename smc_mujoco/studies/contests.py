"""What a comparison says of each plant in each condition on one screen: facts of its boards."""

import math
from collections.abc import Mapping, Sequence

from smc_mujoco.analysis.paired_runs import OBJECTIVE, SETTLES
from smc_mujoco.answers.facts import Contest, Fact, Lead, NotRanked, Open, Settles, Tied, Verdict
from smc_mujoco.common.aliases import Names
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import counted, joined
from smc_mujoco.studies.block import Block
from smc_mujoco.studies.board import Board
from smc_mujoco.studies.board_numbers import heading, in_order, median_text

RATE = "tv_rate"  # the metric that is also given as a share of the bound on u
MANY_BOUNDS = 10.0  # of a share that is no longer said in percent; chosen
Column = tuple[Board, Block]  # a metric, in one condition
Gains = Mapping[str, Mapping[str, str]]  # plant -> law -> its best gains as text


def contests(boards: Sequence[Board], gains: Gains, own: Names) -> tuple[Contest, ...]:
    """Return a contest for each plant in each condition.

    Args:
      boards: those of J, if any, and of the metrics.
      gains: of the laws that may be recommended.
      own: the laws of which it is said how far they trail.
    """
    objectives: dict[str, Column] = {}
    columns_of: dict[tuple[str, str], list[Column]] = {}
    for board in boards:
        for block in board.blocks:
            if board.metric == OBJECTIVE:
                objectives[block.plant] = board, block
            else:
                columns_of.setdefault((block.plant, block.condition), []).append((board, block))
    compared = []
    for (plant, _), of_metrics in columns_of.items():
        of_plant = [objectives[plant]] if plant in objectives else []
        compared.append(_contest([*of_plant, *of_metrics], gains.get(plant, {}), own))
    return tuple(compared)


def _contest(columns: Sequence[Column], gains: Mapping[str, str], own: Names) -> Contest:
    """Return the facts of a plant in a condition."""
    _, last = columns[-1]
    verdicts: list[Verdict] = []
    not_ranked: list[NotRanked] = []
    for board, block in columns:
        fact = block.verdict
        # that all laws settle in the same runs is seen in the number of runs that settle
        if fact and not (board.metric == SETTLES and isinstance(fact, Tied)):
            verdicts.append(fact)
        not_ranked += board.not_ranked
    with_numbers = [column for column in columns if column[0].metric != SETTLES]
    rows = []
    for law in in_order([board for board, _ in columns]):
        rows.append((law, *(_number(board, block, law) for board, block in with_numbers)))
    return Contest(
        plant=last.plant,
        condition=last.condition,
        sample=last.sample,
        table=Tabular(headings=["", *(_heading(board) for board, _ in with_numbers)], rows=rows),
        metrics=tuple(board.label for board, _ in with_numbers),
        settled=_settled(columns),
        use=_use(columns, verdicts, gains),
        verdicts=tuple(verdicts),
        trails=tuple(fact for fact in with_numbers[0][1].behind.values() if fact.law in own)
        if with_numbers
        else (),
        not_ranked=tuple(not_ranked),
    )


def _heading(board: Board) -> str:
    """Return the heading of a board: J with the number of conditions that it sums, a variation of u
    with its share.
    """
    summed = f" over {counted(len(board.summed), 'condition')}" if board.summed else ""
    return heading(board, summed, " (of bound)" if _has_share(board) else "")


def _has_share(board: Board) -> bool:
    return board.metric == RATE and not any(math.isnan(block.bound) for block in board.blocks)


def _number(board: Board, block: Block, law: str) -> Cell:
    """Return the median of a law in a block; of one below its floor, the floor."""
    if law not in block.medians:
        return Cell("")
    median = block.medians[law]
    text = median_text(median, board.metric)
    if law in block.below and block.floor:
        text = f"<{block.floor.split()[0]}"
    elif _has_share(board) and math.isfinite(median):
        text += f" ({_share(median / block.bound)})"
    return Cell(text, strong=law == block.winner)


def _share(share: float) -> str:
    """Return a share of the bound on u a second: "150 %", of many bounds "270 x"."""
    if share >= MANY_BOUNDS:
        return f"{float(f'{share:.2g}'):g} x"
    return f"{float(f'{100.0 * share:.2g}'):g} %"


def _settled(columns: Sequence[Column]) -> Fact | None:
    """Return how many runs of each law settle; None if that was not asked."""
    for board, block in columns:
        if board.metric == SETTLES:
            facts = []
            count = 0
            for law, share in block.medians.items():
                runs = Settles(round((1.0 - share) * block.runs), block.runs)
                count += runs.count
                if runs.count < runs.total:
                    facts.append(Fact("of law", law=law, runs=runs))
            laws = len(block.medians)
            return Fact(
                "settled runs",
                all=None if facts else count,
                none=None if count else laws * block.runs,
                short=facts,
                others=0 < len(facts) < laws,
            )
    return None


def _use(
    columns: Sequence[Column], verdicts: Sequence[Verdict], gains: Mapping[str, str]
) -> Fact | None:
    """Return the law to use: the one that is best in the first metric, or of those that may be
    best there, the first; without the first metric's verdict, none. A law with a run that does not
    arrive in this condition is not recommended.
    """
    if not verdicts:
        return None
    lost = {law for _, block in columns for law in block.away}
    first = verdicts[0]
    rivals: Names = ()
    match first:
        case Lead():
            law = first.law
        case Open() | Tied():
            order = in_order([board for board, _ in columns])  # as the rows of the table
            law, rivals = next(law for law in order if law in first.laws), first.laws
        case _:
            return None
    if law in lost:
        return None
    aims_of: dict[str, list[str]] = {}  # law -> the metrics in which it leads
    for fact in verdicts[1:]:
        if isinstance(fact, Lead) and fact.law != law and fact.law not in lost:
            aims_of.setdefault(fact.law, []).append(fact.metric)
    unless = []
    for leader, aims in aims_of.items():
        about = {"aims": joined(aims, "or"), "law": leader, "gains": gains.get(leader)}
        unless.append(Fact("unless", **about))
    return Fact(
        "use",
        law=law,
        gains=gains.get(law),
        unless=unless,
        **{"level" if isinstance(first, Tied) else "rivals": rivals if len(rivals) > 1 else ()},
        metric=first.metric,
    )
