"""Boards as an answer: one screen, and below it tables of medians with intervals."""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence

from smc_mujoco.analysis.bootstrap import LEVEL, MIN_INTERVAL_SAMPLES
from smc_mujoco.analysis.ranking import BEST_ERROR, RIVALS
from smc_mujoco.analysis.step_halving import UNTRIED
from smc_mujoco.answers import answers
from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.facts import Fact, Screen
from smc_mujoco.common.aliases import Names
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import capital, counted, joined
from smc_mujoco.control.source import kinds
from smc_mujoco.draw import style
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.studies.board import Block, Board, BoardEntry, sources
from smc_mujoco.studies.board_numbers import heading, in_order, sizes, spread
from smc_mujoco.studies.contests import contests

FEW = (
    f"With fewer than {MIN_INTERVAL_SAMPLES} samples an interval is their range, with a coverage "
    f"below {100 * LEVEL:g} %."
)
# A word in headings and cells -> what LaTeX prints about it below the last table.
UNDER = {
    "": f"Below each median is its {100 * LEVEL:g} % interval.",
    "J (": "Tuning minimises J, summed over conditions: ITAE divided by the initial error, "
    "plus 0.001 s^3 times the variation of u divided by u_max and by the duration. J in tables is "
    "from separate runs, which tuning has not seen.",
    "shipped": "Shipped gains come with smc_mujoco.",
    "tuned here": "Gains tuned here were found by searches with smc_mujoco.",
    "settled runs": "Settled runs are given as a share, not as a median. A run counts as settled "
    "if it settles before its last fifth.",
    "settling time": "Settling time is when the error enters its band to stay: 2 % of its initial "
    "value, or of the reference's range if that is larger.",
    "final error": "The final error is the largest absolute error of any channel in the last "
    "part of a run: its last fifth, or whole periods of a periodic load or reference.",
    "ITAE": "ITAE is the integral of time times absolute error.",
    "variation of u": "Variation of u is its total variation per second in the last part of a run.",
    "default": "Default gains are those of the law's own file.",
    "given": "Gains marked given are the authors' own choice.",
    "strong=True": "Bold: may be the best: no other law is shown to be better (a paired test at "
    f"{100 * BEST_ERROR:g} %, corrected for multiple comparisons: for {RIVALS} rivals even if "
    "there are fewer, for all if there are more). A law "
    "without bold is not always shown to be worse. A law wins if it is shown to be better than "
    "every other.",
    "floor ": "Floor: the median is below this floor (of noise, resolution, or a small share of "
    "the start or of u_max). Values below it count as equal; where one is bold, no value above the "
    "floor is.",
    "may exceed ": "May exceed a floor: the median is below it, but need not stay there.",
    "at half": "At half the step: the median of the runs that were repeated with half the physics "
    "step, before and after.",
}


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
    commands: Sequence[str] = ()
    failures: Sequence[str] = ()
    untouched: Sequence[str] = ()
    # why metrics have no board, shown if none has
    absent: Sequence[str] = ()
    labels: Mapping[str, str] = {}  # law -> what LaTeX calls it
    plants: Mapping[str, Plant] = {}  # by name

    @property
    def remarks(self) -> list[str]:
        """These sentences."""
        return [*self.commands, *self.failures, *self.untouched]

    @property
    def bewares(self) -> list[Fact]:
        """The same as facts of an answer."""
        return [Fact("beware", text=sentence) for sentence in self.remarks]

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
    def order(self) -> list[str]:
        """All laws, by the number of their runs without a value, then by mean rank over all
        blocks.
        """
        standing: dict[str, tuple[int, float]] = {}
        for board in self:
            for entry in board.entries:
                failed, rank = standing.get(entry.law, (0, 0.0))
                rank += entry.rank.mean * len(board.blocks)
                standing[entry.law] = failed + entry.failed, round(rank, 9)
        return sorted(standing, key=lambda law: (standing[law], law))

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
        tabulars = [_table(boards, self.labels, self.plants) for boards in groups.values()]
        words = str([(table.headings, table.rows) for table in tabulars])
        last = tabulars[-1]
        notes = [*last.notes, *self.remarks]
        if any(board.by_step for board in self):
            notes.append(f"{capital(UNTRIED)}.")
        under = *last.under, _key(self, words)
        return [*tabulars[:-1], dataclasses.replace(last, notes=notes, under=under)]


def _table(
    boards: Sequence[Board], labels: Mapping[str, str], plants: Mapping[str, Plant]
) -> Tabular:
    """Return the table of one group of runs, with `Boards.labels` and `Boards.plants`."""
    sources_of = sources(boards)
    cells: dict[str, list[Cell | str]] = {}
    for i, board in enumerate(boards):
        for entry in board.entries:
            cells.setdefault(entry.law, [""] * len(boards))[i] = _cell(board, entry)
    rows = []
    for law in in_order(boards):
        name_cell = Cell(law, kinds(sources_of[law]), colour=style.law_colour(law))
        label = labels.get(law) or style.law_name(law)
        rows.append([name_cell._replace(label=label), *cells[law]])
    largest = max(boards, key=lambda board: len(board.blocks))
    plant = largest.group["plant"]
    under = []
    if "strong=True" in str(rows):
        facts = [board.verdict(block) for board in boards for block in board.blocks[:1]]
        decided = [
            fact for fact, board in zip(facts, boards, strict=True) if fact and _is_one(board)
        ]
        under = [
            answers.printed_verdicts(decided, lambda law: labels.get(law) or style.law_name(law))
        ]
    return Tabular(
        headings=["law", *map(heading, boards)],
        rows=rows,
        title=_title(largest, plant),
        label=_title(largest, style.plant_name(plants.get(plant, plant)), style.condition_name),
        notes=list(itertools.chain.from_iterable(board.lines for board in boards)),
        under=under,
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
    samples = dict.fromkeys(map(_sample, board.blocks))
    return f"{about}: {'; '.join(samples)}"


def _sample(block: Block) -> str:
    """Return the size of a sample, such as "20 seeds, 1 distinct run, 3 sets of gains"."""
    sample = block.sample
    parts = [counted(sample.seeds, "seed")]
    if sample.runs < sample.seeds:
        parts.append(counted(sample.runs, "distinct run"))
    if sample.sets > 1:
        least = "at least " if sample.more else ""
        alone = " (one for some laws)" if sample.single else ""
        parts.append(f"{least}{sample.sets} sets of gains{alone}")
    return ", ".join(parts)


def _cell(board: Board, entry: BoardEntry) -> Cell:
    """Return a law's median, strong if the law may be the best in every block."""
    interval = entry.interval
    changes = []
    for block in board.blocks:
        if entry.law in block.by_step:
            changes.append(block.by_step[entry.law])
    numbers = [interval.median, interval.low, interval.high, *itertools.chain(*changes[:1])]
    median, low, high, *step = sizes(numbers, board.metric)
    below = [spread(interval, low, high), _floor(board, entry.law)]
    alarms = [board.failures(entry)]
    if step:
        before, after = step
        alarms.append(f"some runs {before}, at half the step {after}")
    says = entry.law == board.winner or not entry.vague
    barred: Names = tuple(itertools.chain.from_iterable(block.barred for block in board.blocks))
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


def _key(boards: Sequence[Board], words: str) -> str:
    """Return what LaTeX prints about the words of tables."""
    sentences = [text for word, text in UNDER.items() if word in words]
    entries = itertools.chain.from_iterable(board.entries for board in boards)
    if any(entry.interval.n < MIN_INTERVAL_SAMPLES for entry in entries):
        sentences.insert(1, FEW)
    return " ".join(sentences)
