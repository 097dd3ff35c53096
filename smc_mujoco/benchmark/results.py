"""Results: what entries did on a suite, read from a folder or an archive, ranked by question, and
compared.

    found = smc.results("smc-30@1")           # of ./results, or a folder, or a .zip of one
    print(found.boards()["speed"])
    print(found.compare(smc.results("older.zip")))

There is no single number. A board is a question: accuracy under forces, accuracy under sensors,
speed, calm. An entry has the mean rank of its medians over the board's problems, with an interval
over problems, and the share of the targets that it reaches and keeps. On hidden instances only
checked laws have places.
"""

import dataclasses
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

from smc_mujoco.benchmark import enter, runs, suite
from smc_mujoco.benchmark.enter import HIDDEN, RESULT, TABLE
from smc_mujoco.benchmark.problem import problem
from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.files import as_path, read_json, reading, slug

MEASURE = {
    "forces": "accuracy",
    "sensors": "accuracy",
    "speed": "settling",
    "calm": "calm",
}  # of each board
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
DRAWS, LEVEL = 4000, 90.0  # resamples of the problems; %, of the intervals
CHANGE = 0.01  # a median that changes by less counts as the same; chosen
MOMENTS = 81  # of a curve of targets
MAX_UNPACKED = 4 * 10**9  # bytes of an archive; chosen
CURE = "enter the law again"
ABOUT: dict[str, Any] = {  # what a result says, and of which type
    "suite": str,
    "instances": int,
    "entry": dict,
    "checked": bool,
    "marks": list,
    "sample": list | NoneType,
    "hashes": dict,
    "versions": dict,
    "machine": str,
}
OF_ENTRY: dict[str, Any] = dict.fromkeys(
    ("name", "source", "licence", "division", "digest"), str
) | {"authors": list}
HASHES: dict[str, Any] = dict.fromkeys(("table", "rules", "suite"), str)


def _check(values: Any, fields: Mapping[str, Any]) -> None:
    """Raise ScenarioError if values are no mapping with a value of the right type for each field."""
    if not isinstance(values, dict):
        raise ScenarioError(f"it has {shown(values)} where names and values are")
    for name, kind in fields.items():
        if not isinstance(values.get(name), kind):
            raise ScenarioError(f"its {name} is {shown(values.get(name))}")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Standing:
    """The place of an entry on a board."""

    entry: str
    place: (
        int | None
    )  # None: beside the others, as its law is not checked and the instances are hidden
    rank: float  # the mean over the problems, 1 is best
    low: float  # ends of the interval over problems
    high: float
    level: bool  # with the first: the interval of the difference of their ranks holds 0
    reached: float  # share of the targets of all runs that are reached and kept


@dataclasses.dataclass(frozen=True, kw_only=True)
class Board:
    """A question and the entries' places."""

    question: str
    problems: tuple[str, ...]
    standings: tuple[Standing, ...]

    def __str__(self) -> str:
        head = f"{TITLES[self.question]}: {WORDS[MEASURE[self.question]]}, {len(self.problems)} problems"
        lines = []
        for one in self.standings:
            lines.append(
                f"{one.place or '-':>3} {one.entry:<28} {one.rank:5.1f} [{one.low:.1f}, {one.high:.1f}] "
                f"{100 * one.reached:4.0f} %{' level' if one.level and one.place != 1 else ''}"
            )
        return "\n".join([head, *lines])


class Result:
    """What an entry did. Its runs are read when they are asked for."""

    def __init__(self, folder: Path, hidden: bool):
        self.folder = folder
        self.hidden = hidden
        self.table = folder / (HIDDEN[TABLE] if hidden else TABLE)
        with reading(folder / (HIDDEN[RESULT] if hidden else RESULT), "result", CURE) as file:
            self.about: dict[str, Any] = read_json(file)
            _check(self.about, ABOUT)
            _check(self.about["entry"], OF_ENTRY)
            _check(self.about["hashes"], HASHES)
            if (sample := self.about["sample"]) is not None and [*map(type, sample)] != [float] * 3:
                raise ScenarioError(f"its sample is {shown(sample)}")
            self.problems = suite.suite(self.about["suite"])
            for what, digest in enter.made_under(self.problems).items():
                if digest != self.about["hashes"][what]:
                    raise ScenarioError(f"it is of another {what} than {self.about['suite']} here")
        with reading(self.table, "table of runs", CURE) as file:
            digest = hashlib.sha256(file.read_bytes()).hexdigest()
        if digest != self.about["hashes"]["table"]:
            raise ScenarioError(
                f"{self.table} is not the table that its result was written for: {CURE}"
            )
        with reading(self.table, "table of runs", CURE):
            self.runs.check(self.problems, self.about["instances"])

    @property
    def name(self) -> str:
        """The entry's name."""
        return self.about["entry"]["name"]

    @functools.cached_property
    def runs(self) -> runs.Runs:
        """The table of the runs."""
        return runs.Runs(self.table)

    @functools.cached_property
    def medians(self) -> dict[str, dict[str, float]]:
        """Problem -> measure -> the median over its instances; calm counts where the easiest
        accuracy is kept.
        """
        return self.runs.medians()

    def targets(self, problems: Sequence[str], measure: str) -> np.ndarray:
        """Return the times from which the targets of a measure are reached and kept, s, inf for
        never, (targets,).
        """
        times = []
        for name in problems:
            columns = self.runs.columns(name)
            times += [
                columns[f"{measure}_{i}"]
                for i, _ in enumerate(problem(name).targets.get(measure, ()), 1)
            ]
        if times:
            return np.nan_to_num(np.concatenate(times), nan=np.inf)
        return np.zeros(0)


class Results:
    """What entries did on a suite."""

    def __init__(self, name: str, entries: Mapping[str, Result], hidden: bool):
        self.suite = name
        self.entries = dict(entries)
        self.hidden = hidden
        self.problems = suite.suite(name)
        informed = {cell: suite.boards(cell) for cell in self.problems}
        self._informing = {
            question: tuple(c for c in informed if question in informed[c]) for question in MEASURE
        }
        self._boards, self._curves = (
            dict[str, Board](),
            dict[tuple[str, str], np.ndarray](),
        )  # that were asked for

    def __repr__(self) -> str:
        return (
            f"results of {len(self.entries)} entries on {self.suite}"
            + ", hidden instances" * self.hidden
        )

    def on(self, question: str) -> tuple[str, ...]:
        """Return the problems that inform a board."""
        return self._informing[question]

    def ranks(self, question: str, names: Sequence[str]) -> np.ndarray:
        """Return the ranks of entries on each problem of a board, (entries, problems); equal
        medians share a rank.
        """
        from scipy.stats import rankdata

        measure = MEASURE[question]
        medians = [
            [self.entries[name].medians[cell][measure] for cell in self.on(question)]
            for name in names
        ]
        return rankdata(np.array(medians), axis=0)

    def boards(self) -> dict[str, Board]:
        """Return question -> Board, of the questions that the suite's problems inform."""
        return {question: self.board(question) for question in MEASURE if self.on(question)}

    def board(self, question: str) -> Board:
        """Return the board of a question."""
        find("board", question, MEASURE)
        if question not in self._boards:
            self._boards[question] = self._made(question)
        return self._boards[question]

    def _made(self, question: str) -> Board:
        """Return the board of a question, from the runs."""
        ranked = [
            name for name, one in self.entries.items() if one.about["checked"] or not self.hidden
        ]
        beside = [name for name in self.entries if name not in ranked]
        if ranked:
            standings = self._places(question, ranked)
        else:
            standings = []
        for name in beside:
            rank = float(self.ranks(question, [*ranked, name])[-1].mean())
            place = {"place": None, "low": np.nan, "high": np.nan, "level": False}
            standings.append(
                Standing(entry=name, rank=rank, reached=self.reached(name, question), **place)
            )
        return Board(question=question, problems=self.on(question), standings=tuple(standings))

    def _places(self, question: str, names: Sequence[str]) -> list[Standing]:
        """Return the places of entries on a board, the best first."""
        ranks = self.ranks(question, names)
        count = ranks.shape[1]
        means = ranks.mean(axis=1)
        draws = np.random.default_rng(0).integers(count, size=(DRAWS, count))
        drawn = ranks[:, draws].mean(axis=2)  # (entries, DRAWS)
        order = np.argsort(means, kind="stable")
        tails = (50.0 - LEVEL / 2, 50.0 + LEVEL / 2)
        standings = []
        for i in order.tolist():
            low, high = np.percentile(drawn[i], tails).tolist()
            standings.append(
                Standing(
                    entry=str(names[i]),
                    place=1 + int((means < means[i] - 1e-9).sum()),
                    rank=float(means[i]),
                    low=low,
                    high=high,
                    level=bool(np.percentile(drawn[i] - drawn[order[0]], tails[0]) <= 0.0),
                    reached=self.reached(str(names[i]), question),
                )
            )
        return standings

    def reached(self, entry: str, question: str) -> float:
        """Return the share of a board's targets that an entry reaches and keeps, over all runs."""
        return float(self.curve(entry, question)[1][-1])

    def curve(self, entry: str, question: str) -> tuple[np.ndarray, np.ndarray]:
        """Return times, s, and the share of a board's targets that are reached by then and kept,
        (MOMENTS,) each.
        """
        moments = np.linspace(0.0, problem(self.problems[0]).duration, MOMENTS)
        if (entry, question) not in self._curves:
            times = np.sort(self.entries[entry].targets(self.on(question), MEASURE[question]))
            self._curves[entry, question] = np.searchsorted(times, moments, side="right") / max(
                len(times), 1
            )
        return moments, self._curves[entry, question]

    def compare(self, other: "Results") -> "Changes":
        """Return what changed from other results on the suite to these, of the entries that both
        have.
        """
        if other.suite != self.suite:
            raise ScenarioError(
                f"these are results on {self.suite}, the others on {other.suite}: give the same suite"
            )
        both = [name for name in self.entries if name in other.entries]
        return Changes(
            changes=tuple(
                _change(self, other, name, question)
                for name in both
                for question in MEASURE
                if self.on(question)
            )
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Change:
    """How the medians of an entry on a board's problems changed: problem -> the new one over the
    old one.
    """

    entry: str
    question: str
    worse: Mapping[str, float]
    better: Mapping[str, float]
    count: int  # problems of the board

    def __str__(self) -> str:
        told = []
        for word, found, pick in (("worse", self.worse, max), ("better", self.better, min)):
            if found:
                where = pick(found, key=found.__getitem__)
                ratio = found[where]
                if ratio >= 2.0:
                    amount = f"{ratio:.3g} times"
                else:
                    amount = f"{100 * abs(ratio - 1):.2g} %"
                told.append(f"{word} on {len(found)} of {self.count}, by up to {amount} ({where})")
        return f"{self.entry}, {TITLES[self.question].lower()}: {'; '.join(told) or 'the same'}"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Changes:
    """What changed between two results on a suite, by entry and board."""

    changes: tuple[Change, ...]

    @property
    def worse(self) -> bool:
        """Whether any median became worse."""
        return any(change.worse for change in self.changes)

    def __str__(self) -> str:
        return "\n".join(map(str, self.changes)) or "no entry is in both"


def _change(new: Results, old: Results, name: str, question: str) -> Change:
    """Return how an entry changed on a board."""
    measure = MEASURE[question]
    ratios = {}
    for cell in new.on(question):
        now, before = (one.entries[name].medians[cell][measure] for one in (new, old))
        if now == before:
            ratios[cell] = 1.0
        else:
            ratios[cell] = now / before if before else np.inf
    worse = {cell: ratio for cell, ratio in ratios.items() if ratio > 1.0 + CHANGE}
    better = {cell: ratio for cell, ratio in ratios.items() if ratio < 1.0 / (1.0 + CHANGE)}
    return Change(entry=name, question=question, worse=worse, better=better, count=len(ratios))


def results(source: str | os.PathLike[str] = "smc-30@1", hidden: bool = False) -> Results:
    """Return the results on a suite.

    Args:
      source: a suite's name, whose results are in the folder "results"; or the folder of a suite's
        results, such as "results/smc-30@1"; or a .zip of such a folder.
      hidden: whether those on hidden instances, in place of the visible ones.

    Raises:
      ScenarioError: no results there, results on several suites, or a table that was changed since
        it was written.
    """
    if source in suite.suites():
        path = Path("results") / source
    else:
        path = as_path(source)
    found, refused = sound(_unpacked(path) if path.suffix == ".zip" else path, hidden)
    if refused:
        raise refused[0]
    if not found:
        raise ScenarioError(
            f"no results at {shown(str(path))}: enter a law first, with smc-mujoco enter FOLDER"
        )
    if len(found) > 1:
        names = " and ".join(one.suite for one in found)
        raise ScenarioError(f"{shown(str(path))} has results on {names}: give a folder of one")
    return found[0]


def sound(folder: Path, hidden: bool) -> tuple[list[Results], list[ScenarioError]]:
    """Return the results in a folder, by suite, and why others are left out.

    Names that share a folder's name are one: the result stands that is in the folder of its name.
    """
    wanted = HIDDEN[RESULT] if hidden else RESULT
    of_suite = dict[str, dict[str, Result]]()
    refused = []
    for place in sorted(
        Path(place) for place, _, files in os.walk(folder) if wanted in files
    ):  # skips what vanishes
        try:
            one = Result(place, hidden)
        except ScenarioError as error:
            refused.append(error)
            continue
        its = of_suite.setdefault(one.about["suite"], {})
        first = its.setdefault(slug(one.name), one)
        if first is one:
            continue
        if one.folder.name == slug(one.name):
            its[slug(one.name)], one = one, first
        refused.append(
            ScenarioError(f"{one.folder} is another result of {shown(one.name)}: remove it")
        )
    made = [
        Results(name, {one.name: one for one in its.values()}, hidden)
        for name, its in sorted(of_suite.items())
    ]
    return made, refused


_UNPACKED: list[TemporaryDirectory[str]] = []  # archives, which are read until the process ends


def _unpacked(path: Path) -> Path:
    """Return a temporary folder with the content of an archive."""
    with reading(path, "archive of results", "give a .zip of a folder of results") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                if sum(one.file_size for one in archive.infolist()) > MAX_UNPACKED:
                    raise ScenarioError(f"it unpacks to more than {MAX_UNPACKED / 1e9:g} GB")
                _UNPACKED.append(
                    TemporaryDirectory(prefix="smc_mujoco-", ignore_cleanup_errors=True)
                )
                archive.extractall(_UNPACKED[-1].name)
        except zipfile.BadZipFile as error:
            raise ScenarioError(f"it is no archive: {error}") from None
    return Path(_UNPACKED[-1].name)
