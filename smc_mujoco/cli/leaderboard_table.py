"""Boards in the terminal: who wins in each condition, every law over all of them, and who wins there."""

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from smc_mujoco.analysis.paired_runs import SETTLES
from smc_mujoco.cli.tables import number
from smc_mujoco.draw import style
from smc_mujoco.studies.leaderboard import Block, Board

KEY = (
    "median, #place, {level:.3g} % interval over seeds; * none is better; a winner is better than every other law: its "
    "median is lower by more than 3 %, and the seeds bear it out; over several conditions: median of their medians, "
    "place by mean rank, won and lost under how many, and a winner wins under each; x, u of driven joints, in rad or "
    "m, N m or N"
)
NARROW = 6  # runs, with fewer of which no interval of a median covers 95 %, see `statistics`


def leaderboard_table(boards: Sequence[Board]) -> Table:
    """Boards for the terminal: a part a group, a line a law, a column a metric, and below them who wins."""
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
        shown = [own.get(metric) for metric in metrics]
        for line in _lines("\n".join(_folded(name) for _, name in group) or "all", own, shown):
            table.add_row(*line)
        table.add_section()
    table.caption = KEY.format(level=100 * boards[0].level) if boards else "no boards: no metric applies"
    if any(block.runs < NARROW for board in boards for block in board.blocks):
        table.caption += f"; of fewer than {NARROW} runs an interval is their range, and covers less"
    table.caption_justify = "left"
    return table


def _lines(name: str, own: Mapping[str, Board], shown: Sequence[Board | None]) -> Iterator[list[Text]]:
    """A group's lines: who wins in each block, if there are several, then every law over all of them, and who wins."""
    largest = max(own.values(), key=lambda board: len(board.blocks))
    several = len(largest.blocks) > 1
    yield [Text(f"{name}\n", "bold").append(f"{largest.cells} runs,\n{_sample(largest.blocks)}", "dim not bold")]
    for block in largest.blocks if several else ():
        at = block.plant, block.condition
        blocks = [
            next((b for b in board.blocks if (b.plant, b.condition) == at), None) if board else None for board in shown
        ]
        size = f"\n{_folded(block.sample, 15)}" if block.runs < block.seeds else ""
        head = Text(_folded(largest.name(block)), "italic").append(size, "dim not italic")
        yield [head, *(_block_cell(board, b) for board, b in zip(shown, blocks, strict=True))]
    if several:
        yield [Text(f"\nall {len(largest.blocks)}\n{largest.kind}", "dim")]
    for law in sorted({entry.law for board in own.values() for entry in board.entries}):
        yield [Text(_folded(law), style.law_colour(law)), *(_cell(board, law) for board in shown)]
    yield [Text(""), *(_winner(board) for board in shown)]


def _sample(blocks: Sequence[Block]) -> str:
    """The seeds of blocks, where they agree in them."""
    samples = {_folded(block.sample, 15) for block in blocks}
    return samples.pop() if len(samples) == 1 else f"{max(block.seeds for block in blocks)} seeds"


def _block_cell(board: Board | None, block: Block | None) -> Text:
    """Who wins in a block, with its median and the next one; or how many are level."""
    if board is None or block is None:
        return Text("")
    medians = block.medians
    if board.metric == SETTLES:
        medians = {law: 1 - share for law, share in medians.items()}
    if block.winner is None:
        return Text("too few" if board.too_few else f"{len(block.best)} level", "dim")
    first, second = sorted(block.medians, key=block.medians.__getitem__)[:2]
    told = (">" if board.metric == SETTLES else "<").join(
        _number(medians[law], board.metric, digits=2) for law in (first, second)
    )
    return Text(_folded(first, 12), style.law_colour(first)).append(f"\n{told}", "dim")


def _folded(name: str, width: int = 13) -> str:
    """A name on several lines, broken after underscores."""
    return "\n".join(line.replace("_ ", "_") for line in textwrap.wrap(name.replace("_", "_ "), width))


def _cell(board: Board | None, law: str) -> Text:
    """A law's median, place and interval."""
    entry = next((e for e in board.entries if e.law == law), None) if board else None
    if board is None or entry is None:
        return Text("")
    middle = _number(entry.interval.median, board.metric)
    low, high = (_number(value, board.metric, digits=2) for value in entry.interval[1:3])
    text = Text(f"{middle} " if middle else "", "bold" if entry.rank.best else "")
    text.append(f"#{entry.rank.place:g}").append("*" if entry.rank.best else " ")
    return text.append(f"\n{low}–{high}" if low else "", "dim not bold")


def _number(value: float, metric: str, digits: int = 3) -> str:
    if math.isnan(value):
        return ""
    return f"{100 * value:.0f}" if metric == SETTLES else number(value, digits)


def _winner(board: Board | None) -> Text:
    """Who wins a board."""
    if board is None:
        return Text("")
    if board.winner:
        return Text("winner\n").append(_folded(board.winner, 12), f"bold {style.law_colour(board.winner)}")
    text = Text("no winner\n", "dim")
    counts = {entry.law: (len(board.wins(entry.law)), len(board.losses(entry.law))) for entry in board.entries}
    if not any(wins for wins, _ in counts.values()):
        return text.append(board.why or f"{len(board.best)} of {len(board.entries)}*")
    for law, (wins, losses) in counts.items():
        if wins:
            text.append(f"{_folded(law, 12)}\n", style.law_colour(law)).append(f"{wins} won {losses} lost\n")
    text.right_crop(1)
    return text
