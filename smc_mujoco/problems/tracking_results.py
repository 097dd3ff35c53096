"""What an entry reached in a suite of tracking problems, as a file, and who leads in each problem.

    results/smc-friction@1/pid.json

An entry has two searches in each problem. What counts for it is its worse search where it leads,
and its better one where it trails: one law leads another if it is better in every pairing of their
searches, by the test of `analysis.ranking` over the instances. So a lead is none of a lucky search.
"""

import dataclasses
import datetime
import functools
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.analysis.bootstrap import median_of
from smc_mujoco.analysis.ranking import Comparison
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.answers.facts import Fact, Screen, Settles
from smc_mujoco.common import fingerprint
from smc_mujoco.common.aliases import AnyPath, Array, Pair
from smc_mujoco.common.cache import CachedResult
from smc_mujoco.common.constraints import Progress, constrained
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import read_json, reading, slug, write_json, write_text
from smc_mujoco.common.progress import bar
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import number
from smc_mujoco.common.version import versions
from smc_mujoco.control.law import library_law
from smc_mujoco.problems.tracking import (
    TrackingProblem,
    TrackingSuite,
    filtered_difference,
    tracking_suite,
    tracking_suites,
)
from smc_mujoco.problems.tracking_entry import TrackingEntry, tracking_entry
from smc_mujoco.problems.tracking_search import (
    FIRST_UNSEEN,
    SEARCHES,
    SETS,
    Found,
    GainTrials,
    search,
)
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.workers import Workers, called, opened

SHIPPED = Path(__file__).parent / "boards"
BOUNDS = SHIPPED / "bounds.json"
BOUNDING = 3  # instances of the bounds
ORACLE_SPEEDS = (1.5, 4.0)  # bandwidths of the oracle times the scale of time
FLOOR = 0.5  # counts: smaller errors count as equal, as no encoder shows them
RIVALS = 63  # for which leads are corrected: up to 64 entries, one more changes none between others
SAME = 1.1  # an error is not of the load where that without it is no more than so many times less


@constrained
def enter_tracking(
    text: str,
    suite: str,
    out: AnyPath = "results",
    threads: int | None = None,
    progress: Progress = False,
    executor: Workers | None = None,
) -> Path:
    """Search for an entry's gains in every problem of a suite. Return the file of its result.

    Searches that are done are kept beside it, and a call that was stopped goes on with the others.

    Args:
      text: the entry, see `tracking_entry`.
      suite: its name.
      out: folder of the results.
      threads: how many runs are made at once; None: as many as this machine has cores.
      progress: whether to show a bar.
      executor: where searches are made side by side, in place of threads of this process.

    Raises:
      ScenarioError: a text that is no entry, or an entry that the suite cannot run.
    """
    entry = tracking_entry(text)
    chosen = tracking_suite(suite)
    for problem in chosen.problems:
        GainTrials(problem, entry, threads)  # refuses what does not suit before any search
    target = Path(out) / suite / f"{slug(entry.name)}.json"
    parts = target.with_suffix("")
    parts.mkdir(parents=True, exist_ok=True)
    files = {}
    for problem in chosen.problems:
        for count in range(SEARCHES):
            files[problem, count] = _search_file(parts, problem, entry, count)
    stored = {call: file.read() for call, file in files.items()}
    missing = [call for call in stored if stored[call] is None]
    with bar(f"sets of gains of {entry.name}", len(missing) * SETS, progress) as shown_bar:
        calls = [(problem, entry, count) for problem, count in missing]
        for i, result in _results_in_turn(calls, threads, executor, shown_bar.advance):
            stored[missing[i]] = files[missing[i]].keep(result._asdict())
    searched = {}
    for problem in chosen.problems:
        searched[problem.name] = [stored[problem, count] for count in range(SEARCHES)]
    about = {
        "suite": suite,
        "entry": text,
        "name": entry.name,
        "law": entry.law.name,
        "date": datetime.date.today().isoformat(),
        "versions": versions(),
        "problems": searched,
    }
    write_text(target, _compact(about))
    for part in parts.iterdir():
        part.unlink()
    parts.rmdir()
    return target


def _search_file(
    folder: Path, problem: TrackingProblem, entry: TrackingEntry, count: int
) -> CachedResult[dict]:
    """Return the file of a search's result."""
    depends = [str(problem), entry.name, fingerprint.of(entry.law.function), count]
    return CachedResult(folder / f"{problem.name}-{count}.json", depends, _write, read_json)


def _write(result: dict, path: Path) -> None:
    write_json(path, result)


def _results_in_turn(
    calls: Sequence[tuple[TrackingProblem, TrackingEntry, int]],
    threads: int | None,
    executor: Any,
    advance: Callable[[float], None],
) -> Iterator[tuple[int, Found]]:
    """Yield the number and the result of each search, in the order in which they end."""
    if executor is None:
        for i, call in enumerate(calls):
            yield i, search(*call, threads, advance)
        return
    with opened(executor) as pool:
        for i, result in called(pool, search, [(*call, 1) for call in calls]):
            advance(SETS)
            yield i, result


def _compact(about: Mapping) -> str:
    """Return a result as JSON with a line for each search."""
    problems = []
    for name, searches in about["problems"].items():
        lines = ",\n".join(json.dumps(search) for search in searches)
        problems.append(f"{json.dumps(name)}: [\n{lines}]")
    head = json.dumps({key: value for key, value in about.items() if key != "problems"})
    joined = ",\n".join(problems)
    return f'{head[:-1]},\n"problems": {{\n{joined}}}}}\n'


@keyword_dataclass
class TrackingResult:
    """An entry's result in a suite."""

    name: str
    text: str  # the entry
    law: str  # its name
    date: str
    searches: Mapping[str, tuple[Found, ...]]  # problem -> of each search


@functools.cache
def read_result(path: Path) -> TrackingResult:
    """Return the result in a file. Raise ScenarioError for a file that is none."""
    with reading(path, "result of an entry", "enter the law again") as file:
        about = read_json(file)
        searches = {}
        for problem, results in about["problems"].items():
            searches[problem] = tuple(Found(**result) for result in results)
        return TrackingResult(
            name=about["name"],
            text=about["entry"],
            law=about["law"],
            date=about["date"],
            searches=searches,
        )


def counted_errors(found: Found, limit: float) -> Array:
    """Return the errors of a search; inf where its command varies more than the limit."""
    return np.where(found.rate <= limit, found.errors, np.inf)


@keyword_dataclass
class ProblemStanding:
    """An entry in one problem."""

    entry: str
    error: float  # counts, the median over instances of its worse search
    better: float  # of its better search
    interval: Pair  # 95 %, of `error`
    counted: Found  # the worse search
    leads: bool  # whether no other entry leads it, and it has an error

    @property
    def of_load(self) -> bool:
        """Whether its error is of the load, and not the same without it."""
        return self.error > SAME * self.counted.without


@keyword_dataclass
class ProblemBoard:
    """The entries of a suite in one problem."""

    problem: str
    standings: tuple[ProblemStanding, ...]  # least error first
    told_apart: float  # share of the pairs in which one leads the other

    @property
    def leaders(self) -> list[str]:
        """The entries that no other leads."""
        return [standing.entry for standing in self.standings if standing.leads]


class TrackingBoard:
    """The entries of a suite: those that are shipped, and those of a folder of results."""

    def __init__(self, suite: TrackingSuite, results: Sequence[TrackingResult]):
        if not results:
            raise ScenarioError(
                f"no law has entered {suite.name}: smc-mujoco enter pid --suite {suite.name}"
            )
        self.suite = suite
        self.entries = {result.name: result for result in results}

    def problem(self, name: str) -> ProblemBoard:
        """Return who stands where in a problem."""
        limit = next(task.limit for task in self.suite.problems if task.name == name)
        better, worse, counted = {}, {}, {}
        for entry, result in self.entries.items():
            if name in result.searches:
                errors_of = functools.partial(counted_errors, limit=limit)
                searches = sorted(
                    result.searches[name], key=lambda found: float(np.median(errors_of(found)))
                )
                better[entry], worse[entry] = errors_of(searches[0]), errors_of(searches[-1])
                counted[entry] = searches[-1]
        comparison = Comparison(worse, FLOOR, halves=better, rivals=RIVALS)
        leads = comparison.better[0]
        beaten = dict(zip(comparison.laws, leads.any(axis=0).tolist(), strict=True))
        standings = []
        for entry, errors in worse.items():
            error = float(np.median(errors))
            standing = ProblemStanding(
                entry=entry,
                error=error,
                better=float(np.median(better[entry])),
                interval=median_of(errors[None])[1:3],
                counted=counted[entry],
                leads=not beaten[entry] and error < math.inf,
            )
            standings.append(standing)
        pairs = len(worse) * (len(worse) - 1) / 2
        return ProblemBoard(
            problem=name,
            standings=tuple(sorted(standings, key=lambda standing: standing.error)),
            told_apart=float((leads | leads.T).sum() / 2 / pairs) if pairs else 0.0,
        )

    @functools.cached_property
    def problems(self) -> list[ProblemBoard]:
        """The boards of all problems."""
        return [self.problem(problem.name) for problem in self.suite.problems]

    def standing(self, entry: str) -> Screen:
        """Return where an entry stands."""
        rows = []
        for board in self.problems:
            first, names = board.standings[0], [standing.entry for standing in board.standings]
            place = Cell(f"{1 + names.index(entry)}", strong=entry in board.leaders)
            error, least = number(board.standings[names.index(entry)].error), number(first.error)
            rows.append((board.problem, place, error, first.entry, least))
        headings = "problem", "place", "error", "first", "its error"
        count = sum(entry in board.leaders for board in self.problems)
        level = Settles(count, len(rows)) if count else None
        about = {"entry": entry, "suite": self.suite.name, "level": level, "problems": len(rows)}
        return Screen(
            heading=Fact("entered", **about, others=len(self.entries) - 1),
            tables=[Tabular(headings=headings, rows=rows)],
            notes=[*[Fact("leaders")] * bool(count), Fact("counts")],
        )

    def shares(self) -> dict[str, float]:
        """Return entry -> the share of the problems in which no other leads it, most first."""
        counts = dict.fromkeys(self.entries, 0)
        for board in self.problems:
            for entry in board.leaders:
                counts[entry] += 1
        ordered = sorted(counts, key=lambda entry: (-counts[entry], entry))
        return {entry: counts[entry] / len(self.problems) for entry in ordered}


def relative_errors(board: TrackingBoard) -> dict[str, list[float]]:
    """Return entry -> its error over the least of each problem, of its worse search."""
    ratios: dict[str, list[float]] = {name: [] for name in board.entries}
    for result in board.problems:
        least = result.standings[0].error
        for standing in result.standings:
            worse = standing.error > least
            ratios[standing.entry].append(standing.error / least if worse else 1.0)
    return ratios


def bounds(problem: TrackingProblem) -> tuple[float, float]:
    """Return the error without a law, u = 0, and that of an oracle, counts: medians of BOUNDING
    unseen instances. The oracle knows state, friction and load without noise and delay, and has the
    best of some bandwidths.
    """
    scales = search_space.scales(problem.machine, problem.bound, problem.start, 1.0)
    knows = {"model": "true", "sensor": None, "noise": None, "velocity": None, "input_delay": 0.0}
    runs = []
    for instance in range(FIRST_UNSEEN, FIRST_UNSEEN + BOUNDING):
        still = problem.scenario(
            library_law("none"), filtered_difference(problem.period), None, instance
        )
        runs.append(still)
        for speed in ORACLE_SPEEDS:
            wc = speed / scales["T"]
            oracle = library_law("pid", kp=wc**2, kd=2.0 * wc, ki=0.0, tau=0.0)
            runs.append(dataclasses.replace(still, law=oracle, **knows))
    errors = []
    for trace in run(runs):
        e = (trace.x - trace.r)[-problem.late :, 0]
        errors.append(float(np.sqrt(np.mean(e**2)) / problem.count))
    still, *oracles = np.median(np.reshape(errors, (BOUNDING, -1)), axis=0).tolist()
    return still, min(oracles)


def shipped_bounds(suite: str) -> dict[str, tuple[float, float]]:
    """Return problem -> its bounds as the package ships them, see `bounds`."""
    return {name: tuple(pair) for name, pair in read_json(BOUNDS)[suite].items()}


def write_bounds() -> None:
    """Compute the bounds of all problems again, for the package to ship."""
    by_suite = {}
    for name in tracking_suites():
        by_suite[name] = {}
        for problem in tracking_suite(name).problems:
            by_suite[name][problem.name] = [float(number(bound)) for bound in bounds(problem)]
    write_json(BOUNDS, by_suite)


def tracking_board(suite: str, folder: AnyPath | None = None) -> TrackingBoard:
    """Return the board of a suite.

    Args:
      suite: its name.
      folder: of results, whose entries stand beside those that are shipped, and in place of those
        of the same name.

    Raises:
      ScenarioError: an unknown suite, a broken result, or no entry at all.
    """
    chosen = tracking_suite(suite)
    files: dict[str, Path] = {}
    folders = [SHIPPED] if folder is None else [SHIPPED, Path(folder)]
    for place in folders:
        for path in sorted((place / suite).glob("*.json")):
            files[path.stem] = path
    return TrackingBoard(chosen, [read_result(path) for path in files.values()])
