"""Boards as an answer: one screen, and below it tables of medians with intervals."""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence

from smc_mujoco.analysis.step_halving import UNTRIED
from smc_mujoco.answers import answers
from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.explain import meaning
from smc_mujoco.answers.facts import Fact, Screen, renamed
from smc_mujoco.answers.templates import said
from smc_mujoco.common.aliases import Names
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import capital, joined, span
from smc_mujoco.control.source import NONE, kinds
from smc_mujoco.draw import colouring, wording
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.studies.board import Board, BoardEntry, sources
from smc_mujoco.studies.board_numbers import heading, in_order, sizes
from smc_mujoco.studies.contests import contests

# words that print explains below the last table, where a table has them
IN_PRINT = (
    *("interval", "J", "settled runs", "settling time", "final error", "ITAE", "variation of u"),
    *("shipped", "may be the best", "floor", "some runs"),
)
NO_BOARDS = "no boards: no metric applies"
# what boards and comparisons explain on their pages
WORDS = (
    *("star", "may be the best", "lead", "tied", "open", "not ranked", "floor", "interval"),
    *("J", "settled", "settling time", "final error", "ITAE", "variation of u", "arrived"),
    *("shipped", "set of gains", "some runs"),
)


class Boards(Answer, list[Board]):
    """Boards: a list that terminals, notebooks and `print` show as one screen; `full` has the
    tables.
    """

    # sentences: what u is where it is a set-point, for each law with failed runs, and where no run
    # touches
    remarks: Sequence[str] = ()
    # why metrics have no board, shown if none has
    absent: Sequence[str] = ()
    labels: Mapping[str, str] = {}  # law -> what LaTeX calls it
    plants: Mapping[str, Plant] = {}  # by name

    @property
    def bewares(self) -> list[Fact]:
        """The remarks as facts of an answer."""
        return [Fact("sentence", label="beware", text=remark) for remark in self.remarks]

    @property
    def winners(self) -> list[tuple[str, str, str, str]]:
        """The metric, plant, condition and law of each win."""
        won = []
        for board in self:
            for block in board.blocks:
                if block.winner:
                    won.append((board.metric, block.plant, block.condition, block.winner))
        return won

    @property
    def screen(self) -> Screen:
        """The answer: a block for each plant and condition."""
        compared = contests(self, {}, ())
        facts = self.bewares
        if not compared:
            facts = [Fact("sentence", label=NO_BOARDS, text=text) for text in self.absent or [""]]
        return Screen(contests=compared, facts=facts)

    @property
    def words(self) -> Names:
        """The words that the page explains."""
        return WORDS

    @property
    def tables(self) -> list[Tabular]:
        """A table for each group of runs, with the verdicts below.

        It has a line for each law and a column for each metric. A cell has a median with its
        interval. The median is marked if the law may be the best in every block.
        """
        groups: dict[str, list[Board]] = {}
        for board in self:
            groups.setdefault(board.about, []).append(board)
        if not groups:
            return [Tabular(headings=[NO_BOARDS], rows=[], notes=self.absent)]
        tables = list(map(self._table, groups.values()))
        notes = [*tables[-1].notes, *self.remarks]
        if any(board.by_step for board in self):
            notes.append(f"{capital(UNTRIED)}.")
        starred = any(table.starred for table in tables)
        key = " ".join(f"{capital(word)}: {meaning(word)}" for word in self._explained(starred))
        last = dataclasses.replace(tables[-1], notes=notes, under=[*tables[-1].under, key])
        return [*tables[:-1], last]

    def _explained(self, starred: bool) -> list[str]:
        """Return the words of the tables that print explains; `starred`: whether one has a star."""
        entries = [(board, entry) for board in self for entry in board.entries]
        words = {"interval", *(board.label for board in self)}
        if any(source.kind != NONE for _, entry in entries for source in entry.sources):
            words.add("shipped")
        if starred:
            words.add("may be the best")
        if any(_floor(board, entry.law) for board, entry in entries):
            words.add("floor")
        if any(block.by_step for board in self for block in board.blocks):
            words.add("some runs")
        return [word for word in IN_PRINT if word in words]

    def _name(self, law: str) -> str:
        """Return what LaTeX calls a law."""
        return self.labels.get(law) or wording.law_name(law)

    def _table(self, boards: Sequence[Board]) -> Tabular:
        """Return the medians of one group of runs, with the verdicts below in print."""
        sources_of = sources(boards)
        cells: dict[str, list[Cell | str]] = {}
        for i, board in enumerate(boards):
            for entry in board.entries:
                cells.setdefault(entry.law, [""] * len(boards))[i] = _cell(board, entry)
        rows = []
        for law in in_order(boards):
            colour = colouring.law_colour(law)
            name = Cell(law, kinds(sources_of[law]), colour=colour, label=self._name(law))
            rows.append([name, *cells[law]])
        largest = max(boards, key=lambda board: len(board.blocks))
        plant = largest.group["plant"]
        facts = [board.blocks[0].verdict for board in boards if _is_one(board)]
        in_print = [renamed(fact, self._name) for fact in facts if fact]
        return Tabular(
            headings=["law", *map(heading, boards)],
            rows=rows,
            title=_title(largest, plant),
            label=_title(
                largest, wording.plant_name(self.plants.get(plant, plant)), wording.condition_name
            ),
            notes=list(itertools.chain.from_iterable(board.lines for board in boards)),
            under=[f"{capital(': '.join(pair))}." for pair in answers.verdict_lines(in_print)],
        )


def _is_one(board: Board) -> bool:
    """Return whether one verdict holds in all blocks of a board."""
    return len(board.blocks) == 1 or board.winner is not None


def _title(board: Board, plant: str, named: Callable[[str], str] = str) -> str:
    """Return what the runs of a board have in common, and the samples; `named` has the name of a
    condition.
    """
    about = plant
    if len(board.blocks) == 1:
        about += f", {named(board.blocks[0].condition)}"
    if board.summed:
        about += f" under {joined(map(named, board.summed))}"
    samples = dict.fromkeys(said(block.sample)[1] for block in board.blocks)
    return f"{about}: {'; '.join(samples)}"


def _cell(board: Board, entry: BoardEntry) -> Cell:
    """Return a law's median, strong if the law may be the best in every block."""
    interval = entry.interval
    changes = []
    for block in board.blocks:
        if entry.law in block.by_step:
            changes.append(block.by_step[entry.law])
    numbers = [interval.median, interval.low, interval.high, *itertools.chain(*changes[:1])]
    median, low, high, *step = sizes(numbers, board.metric)
    below = [span(low, high), _floor(board, entry.law)]
    alarms = [board.failures(entry)]
    if step:
        before, after = step
        alarms.append(f"some runs {before}, at half the step {after}")
    says = entry.law == board.winner or not entry.vague
    barred = any(block.barred for block in board.blocks)
    best = entry.rank.best and says and median != "" and not barred
    lines = "\n".join(filter(None, below))
    return Cell(median, lines, best, alarm="\n".join(filter(None, alarms)))


def _floor(board: Board, law: str) -> str:
    """Return which floor a law's median is below, in the first block where it is."""
    for block in board.blocks:
        where = f" under {block.condition}" if len(board.blocks) > 1 else ""
        if law in block.below:
            return f"floor {block.floor}{where}"
        if block.floor and law in block.rising:
            return f"may exceed {block.floor}{where}"
    return ""
