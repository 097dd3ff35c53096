"""Results: what entries did on a suite, read from a folder or an archive, ranked by question, and
compared.

    found = smc.results("smc-30@1")           # of ./results, or a folder, or a .zip of one
    print(found.boards()["speed"])
    print(found.compare(smc.results("older.zip")))

There is no single number. A board is a question: accuracy under forces, accuracy under sensors,
speed, calm. An entry has the mean rank of its medians over the board's problems, with an interval
over problems, and the share of the targets that it reaches and keeps. Ranks and tests are those of
`analysis.ranking`, with the problems as units: an entry is better than another if the ratio of
their medians says so over the problems.
"""

import functools
import hashlib
import os
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from types import NoneType
from typing import Any

import numpy as np

from smc_mujoco.analysis import ranking
from smc_mujoco.analysis.bootstrap import LEVEL, draws
from smc_mujoco.common.aliases import AnyPath, Array, ArrayPair, Data, Fields, Names, Numbers
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.files import as_path, read_json, reading, slug
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.problems import enter, entry_runs, suite
from smc_mujoco.problems.enter import RESULT, TABLE
from smc_mujoco.problems.problem import problem

MEASURE = {"forces": "accuracy", "sensors": "accuracy", "speed": "settling", "calm": "calm"}
TITLES = {
    "forces": "Accuracy under forces",
    "sensors": "Accuracy under sensors",
    "speed": "Speed",
    "calm": "Calm",
}
WORDS = {
    "accuracy": "largest error of the last fifth",
    "settling": "settling time",
    "calm": "variation of u",
}
CHANGE = 0.01  # a median that changes by less counts as the same; chosen
MOMENTS = 81  # of a curve of targets
CURE = "enter the law again"
ABOUT = {  # what a result has, and of which type
    "suite": str,
    "seed": int,
    "instances": int,
    "entry": dict,
    "failed": int,
    "failures": list,
    "sample": list | NoneType,
    "hashes": dict,
    "versions": dict,
    "machine": str,
}
OF_ENTRY = {
    "name": str,
    "authors": list,
    "source": str,
    "licence": str,
    "division": str,
    "digest": str,
}
HASHES = {"table": str, "rules": str, "suite": str}


def _check(values: Any, fields: Data) -> None:
    """Raise ScenarioError unless values are a mapping with fields of these types."""
    if not isinstance(values, dict):
        raise ScenarioError(f"it has {shown(values)} where names and values are")
    for name, kind in fields.items():
        if not isinstance(values.get(name), kind):
            raise ScenarioError(f"its {name} is {shown(values.get(name))}")


@keyword_dataclass
class Standing:
    """The place of an entry on a board."""

    entry: str
    place: int
    rank: float  # the mean over the problems, 1 is best
    low: float  # ends of its 95 % interval over problems
    high: float
    best: bool  # whether no other entry is better
    reached: float  # share of the targets of all runs that are reached and kept


@keyword_dataclass
class QuestionBoard(Tables):
    """A question and the entries' places; `print` shows them as a table."""

    question: str
    problems: Names
    standings: tuple[Standing, ...]

    @property
    def tables(self) -> list[Tabular]:
        """One table: the entries by place, with a star at those that no other is better than."""
        rows = []
        for standing in self.standings:
            rank = Cell(f"{standing.rank:.1f}", f"{standing.low:.1f}–{standing.high:.1f}")
            name = Cell(standing.entry, strong=standing.best)
            rows.append([f"{standing.place}", name, rank, f"{100 * standing.reached:.0f}"])
        what = f"{WORDS[MEASURE[self.question]]}, {len(self.problems)} problems"
        heads = "place", "entry", "mean rank", "targets (%)"
        title = f"{TITLES[self.question]}: {what}"
        return [Tabular(headings=heads, rows=rows, title=title, name_columns=2)]


class EntryResult:
    """What an entry did. Its runs are read when they are asked for."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.table = folder / TABLE
        with reading(folder / RESULT, "result", CURE) as file:
            self.about: Fields = read_json(file)
            _check(self.about, ABOUT)
            _check(self.about["entry"], OF_ENTRY)
            _check(self.about["hashes"], HASHES)
            if slug(self.name) != folder.name:
                raise ScenarioError(f"it is the result of {shown(self.name)}, in another's folder")
            self.problems = suite.suite(self.about["suite"])
            for what, digest in enter.rules_digests(self.problems).items():
                if digest != self.about["hashes"][what]:
                    raise ScenarioError(f"it is of another {what} than {self.about['suite']} here")
        with reading(self.table, "table of runs", CURE) as file:
            digest = hashlib.sha256(file.read_bytes()).hexdigest()
            if digest != self.about["hashes"]["table"]:
                raise ScenarioError("it is not the table that its result was written for")
            self.runs.check(self.problems, self.about["instances"])

    @property
    def name(self) -> str:
        """The entry's name."""
        return self.about["entry"]["name"]

    @cached_property
    def runs(self) -> entry_runs.EntryRuns:
        """The table of the runs."""
        return entry_runs.EntryRuns(self.table)

    @cached_property
    def medians(self) -> dict[str, dict[str, float]]:
        """Problem -> measure -> the median over its instances, see `Runs.medians`."""
        return self.runs.medians()

    def targets(self, problems: Sequence[str], measure: str) -> Array:
        """Return the times from which the targets of a measure are reached and kept, s, inf for
        never, (targets,).
        """
        times = [np.zeros(0)]
        for name in problems:
            columns = self.runs.columns(name)
            levels = problem(name).targets.get(measure, ())
            for i in range(1, len(levels) + 1):
                times.append(columns[f"{measure}_{i}"])
        return np.nan_to_num(np.concatenate(times), nan=np.inf)


class Results:
    """What entries did on a suite, on the instances of a seed."""

    def __init__(self, name: str, seed: int, entries: Mapping[str, EntryResult]):
        self.suite = name
        self.seed = seed
        self.entries = dict(entries)
        self.problems = suite.suite(name)
        self._informing: dict[str, list[str]] = {question: [] for question in MEASURE}
        for cell in self.problems:
            for question in suite.boards(cell):
                self._informing[question].append(cell)
        self._boards: dict[str, QuestionBoard] = {}

    def __repr__(self) -> str:
        return f"results of {len(self.entries)} entries on {self.title}"

    @property
    def title(self) -> str:
        """The suite, and the seed unless that is 0."""
        if self.seed:
            return f"{self.suite}, seed {self.seed}"
        return self.suite

    def on(self, question: str) -> list[str]:
        """Return the problems that inform a board."""
        return self._informing[question]

    def medians(self, question: str) -> Array:
        """Return the medians of all entries on each problem of a board, (entries, problems); inf
        where an entry has none.
        """
        medians = []
        for entry in self.entries.values():
            of_entry = []
            for cell in self.on(question):
                of_entry.append(entry.medians[cell][MEASURE[question]])
            medians.append(of_entry)
        return np.nan_to_num(np.array(medians), nan=np.inf, posinf=np.inf)

    def ranks(self, question: str) -> Array:
        """Return the ranks of all entries on each problem of a board, (entries, problems); medians
        that differ by no more than what is relevant share a rank.
        """
        medians = self.medians(question)
        return ranking.ranks_by_block(np.isinf(medians), medians)

    def boards(self) -> dict[str, QuestionBoard]:
        """Return question -> board, of the questions that the suite's problems inform."""
        boards = {}
        for question in MEASURE:
            if self.on(question):
                boards[question] = self.board(question)
        return boards

    def board(self, question: str) -> QuestionBoard:
        """Return the board of a question, the best entry first."""
        find("board", question, MEASURE)
        if question not in self._boards:
            standings = tuple(self._standings(question))
            problems = tuple(self.on(question))
            self._boards[question] = QuestionBoard(
                question=question, problems=problems, standings=standings
            )
        return self._boards[question]

    def places(self, entry: str) -> Tabular:
        """Return where an entry stands: a row for each question."""
        rows = []
        for question, board in self.boards().items():
            (standing,) = [standing for standing in board.standings if standing.entry == entry]
            rivals = len(board.standings) - 1
            place = Cell(f"{standing.place} of {rivals + 1}", strong=standing.best and rivals > 0)
            rows.append([TITLES[question], place, f"{100 * standing.reached:.0f}"])
        notes = ["* no other entry is better."] if any(row[1].strong for row in rows) else ()
        return Tabular(headings=("question", "place", "targets (%)"), rows=rows, notes=notes)

    def _standings(self, question: str) -> list[Standing]:
        """Return the places of the entries on a board, the best first."""
        names = list(self.entries)
        medians = self.medians(question)
        ranks = self.ranks(question)
        compared = ranking.Comparison(dict(zip(names, medians, strict=True)))
        unbeaten = set(np.array(compared.laws)[~compared.worse[:, 0]])
        best = np.array([name in unbeaten for name in names])
        count = ranks.shape[1]
        tails = 50.0 * (1.0 - LEVEL), 50.0 * (1.0 + LEVEL)
        ends = np.percentile(ranks @ draws(count) / count, tails, axis=1)
        placed = ranking.placed(names, ranks, np.isinf(medians), best)
        places = np.array([rank.place for rank in placed])
        standings = []
        for rank in placed:
            low, high = ends[:, names.index(rank.law)].tolist()
            standings.append(
                Standing(
                    entry=rank.law,
                    place=1 + int((places < rank.place).sum()),
                    rank=rank.mean,
                    low=low,
                    high=high,
                    best=rank.best,
                    reached=float(self.curve(rank.law, question)[1][-1]),
                )
            )
        return standings

    @functools.cache  # noqa: B019 (results live as long as their process)
    def curve(self, entry: str, question: str) -> ArrayPair:
        """Return times, s, and the share of a board's targets that are reached by then and kept,
        (MOMENTS,) each.
        """
        moments = np.linspace(0.0, problem(self.problems[0]).duration, MOMENTS)
        times = np.sort(self.entries[entry].targets(self.on(question), MEASURE[question]))
        return moments, np.searchsorted(times, moments, side="right") / max(len(times), 1)

    def compare(self, other: "Results") -> "Changes":
        """Return what changed from other results on the suite to these, of the entries that both
        have.
        """
        if other.title != self.title:
            raise ScenarioError(
                f"these are results on {self.title}, the others on {other.title}: give the same"
            )
        changes = []
        for name in self.entries:
            if name in other.entries:
                for question in self.boards():
                    changes.append(self._change(other, name, question))
        return Changes(changes=tuple(changes))

    def _change(self, old: "Results", name: str, question: str) -> "Change":
        """Return how an entry changed on a board."""
        ratios = {}
        for cell in self.on(question):
            now = self.entries[name].medians[cell][MEASURE[question]]
            before = old.entries[name].medians[cell][MEASURE[question]]
            if now == before:
                ratios[cell] = 1.0
            else:
                ratios[cell] = now / before if before else np.inf
        return Change(entry=name, question=question, ratios=ratios)


@keyword_dataclass
class Change:
    """How the medians of an entry on a board's problems changed: problem -> the new one over the
    old one.
    """

    entry: str
    question: str
    ratios: Numbers

    @property
    def worse(self) -> list[str]:
        """The problems on which the median became larger."""
        cells = []
        for cell, ratio in self.ratios.items():
            if ratio > 1.0 + CHANGE:
                cells.append(cell)
        return cells

    @property
    def better(self) -> list[str]:
        """The problems on which the median became smaller."""
        cells = []
        for cell, ratio in self.ratios.items():
            if ratio < 1.0 / (1.0 + CHANGE):
                cells.append(cell)
        return cells

    def __str__(self) -> str:
        line = f"{self.entry}, {TITLES[self.question].lower()}: {len(self.worse)} worse, "
        line += f"{len(self.better)} better, of {len(self.ratios)}"
        if self.worse:
            cell = max(self.ratios, key=self.ratios.__getitem__)
            line += f"; at most {self.ratios[cell]:.3g} times, in {cell}"
        return line


@keyword_dataclass
class Changes:
    """What changed between two results on a suite, by entry and board."""

    changes: tuple[Change, ...]

    @property
    def worse(self) -> bool:
        """Whether any median became worse."""
        return any(change.worse for change in self.changes)

    def __str__(self) -> str:
        return "\n".join(map(str, self.changes)) or "no entry is in both"


def results(source: AnyPath = "smc-30@1", seed: int = 0) -> Results:
    """Return the results on a suite.

    Args:
      source: a suite's name, whose results are in the folder "results"; or the folder of a suite's
        results, such as "results/smc-30@1"; or a .zip of such a folder.
      seed: of the instances, if a suite's name is given.

    Returns:
      A `Results`, with a board for each question.

    Raises:
      ScenarioError: no results there, results on several suites or seeds, or a table that was
        changed since it was written.
    """
    path = as_path(source)
    if str(source) in suite.suites():
        path = Path("results") / suite.folder(str(source), seed)
    loaded, refused = sound(_unpacked(path) if path.suffix == ".zip" else path)
    if refused:
        raise refused[0]
    if len(loaded) != 1:
        titles = " and ".join(loaded_suite.title for loaded_suite in loaded) or "none"
        raise ScenarioError(
            f"{shown(str(path))} has results on {titles}: give a folder of one suite and seed, "
            "which smc-mujoco enter FOLDER writes"
        )
    return loaded[0]


def sound(folder: Path) -> tuple[list[Results], list[ScenarioError]]:
    """Return the results in a folder, by suite and seed, and why others are left out."""
    places = []
    for place, _, files in os.walk(folder):
        if RESULT in files:
            places.append(Path(place))
    refused = []
    entries: dict[tuple[str, int], dict[str, EntryResult]] = {}
    for place in sorted(places):
        try:
            entry = EntryResult(place)
        except ScenarioError as error:
            refused.append(error)
            continue
        entries_of_suite = entries.setdefault((entry.about["suite"], entry.about["seed"]), {})
        if slug(entry.name) in map(slug, entries_of_suite):
            refused.append(
                ScenarioError(f"{place} is another result of {shown(entry.name)}: remove it")
            )
        else:
            entries_of_suite[entry.name] = entry
    return [Results(*key, of_key) for key, of_key in sorted(entries.items())], refused


_UNPACKED: list[TemporaryDirectory[str]] = []  # archives, which are read until the process ends


def _unpacked(path: Path) -> Path:
    """Return a temporary folder with the content of an archive."""
    folder = TemporaryDirectory(prefix="smc_mujoco-", ignore_cleanup_errors=True)
    _UNPACKED.append(folder)
    with reading(path, "zip archive of results", "zip a folder of results") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                archive.extractall(folder.name)
        except zipfile.BadZipFile as error:
            raise ScenarioError(f"it is no archive: {error}") from None
    return Path(folder.name)
