"""A race: sets of gains in turn over the laws, until one law wins, on one plant.

Every law gets its first set of gains, then every law its second, so that laws have equal numbers
wherever the race stops. Where time is short the first sets come from shorter searches, which the
clock may end, so that every law has one; a law for which not even that fits does not race. J of a
set is that of unseen runs of all conditions, in one number, so that neither more laws nor more
conditions ask for more sets. This is a race in the sense of O. Maron, A. W. Moore, "Hoeffding
races" (NIPS 6, 1994), by the tests of `analysis.ranking`.

- u = 0, the law "none", races too, and wins if it wins.
- After three sets a law is dropped whose best J is more than twice the worst one of the law that
  leads. It is not tested against the others. Two laws beside "none" always stay.
- A search is made once more, from another draw, if its J in training is more than twice the least
  of its law's others: it was stuck. The better of both is the set.
- The laws are judged after 7 sets, and if none wins, after 12, unless the 7 say that probably
  more than 24 are needed. Each look has half of the errors: one of two equal laws wins in at most
  5 % of races, one of more laws in fewer, and the best law is taken for a worse one in at most 5 %.
  A race that does not go on makes errors only rarer.

The folder keeps each search and each judgement.
"""

import json
import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis.paired_runs import EPS
from smc_mujoco.analysis.ranking import Comparison
from smc_mujoco.analysis.signed_rank import units_needed
from smc_mujoco.analysis.tuning import search
from smc_mujoco.analysis.tuning.evaluator import with_gains
from smc_mujoco.analysis.tuning.objective import Objective, objectives
from smc_mujoco.analysis.tuning.quick_search import OutOfTime
from smc_mujoco.analysis.tuning.result import SearchResult
from smc_mujoco.analysis.tuning.run_limits import LIMIT_COST
from smc_mujoco.common.aliases import Array
from smc_mujoco.common.cache import CachedResult
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.files import writable
from smc_mujoco.common.progress import Bar, bar
from smc_mujoco.common.text import joined
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import run_key
from smc_mujoco.simulation.workers import called, opened
from smc_mujoco.studies.answer_time import AnswerTime
from smc_mujoco.studies.fair_gains import Candidate, Trial
from smc_mujoco.studies.study import REPEATED_SEEDS

SETS = "sets of gains tried"  # what a bar counts
LOOKS = (7, 12)  # numbers of sets after which the laws are judged
WITHIN = 24  # sets that would decide, above which a race ends at the first look; chosen
TIMED = 2  # sets after which the number of sets that fit is known: the first compiles, too
FIRST = 3  # sets after which a law may be dropped; chosen
FAR = 2.0  # times the leader's worst J, above which it is; chosen
STUCK = 2.0  # times the least J of its law's others, above which a search is made again; chosen
LAST_ROOM = 0.7  # of the time left, which first searches take before tables; chosen
LEAST_ROOM = 0.3  # of a law's time for its first set, which its search has at least; chosen
SHORTER = (1, 2, 4)  # by which the evaluations of a first search may be divided; chosen
DECIDED_RUNS = 3  # sets of gains that a quick search runs as a judgement does
TOLD = 5  # laws that the bar names
WITHOUT = "none"  # the law u = 0


class Unseen(NamedTuple):
    """J of a set of gains on unseen runs, s^2."""

    value: float
    half: float  # at half the physics step, NaN where it was not computed


class Entrant:
    """A law in a race with the J of its sets of gains."""

    searched = False

    def __init__(self, law: Component):
        self.law = law
        self.J: list[Unseen | None] = []

    def gains(self, k: int) -> Component:
        """Return the law with set k of its gains."""
        raise NotImplementedError

    @property
    def count(self) -> int:
        """The number of sets that differ; 1 for a law with given gains."""
        raise NotImplementedError

    @property
    def values(self) -> list[float]:
        """J of each set."""
        return [of_set.value for of_set in self.J if of_set]


class ReadyEntrant(Entrant):
    """A law whose sets of gains are known: given, shipped or default ones, which it takes in turn;
    or one without gains.
    """

    def __init__(self, candidate: Candidate):
        super().__init__(candidate.law)
        self.candidate = candidate

    def gains(self, k: int) -> Component:
        """Return the law with set k of its gains."""
        return self.candidate(k)

    @property
    def count(self) -> int:
        """The number of sets that differ."""
        return len(self.candidate.sets)


class SearchedEntrant(Entrant):
    """A law whose sets of gains searches find."""

    searched = True

    def __init__(self, task: search.TuningTask):
        super().__init__(task.law)
        self.task = task
        self.results: list[SearchResult] = []
        self.again: set[int] = set()  # searches that were made once more
        self.share = 1  # by which the evaluations of the first search are divided
        self.files: dict[tuple[int, int, int], CachedResult[SearchResult]] = {}

    @cached_property
    def failure(self) -> str:
        """How its first run failed, see `search.failure_of_law`."""
        return search.failure_of_law(self.task)

    def gains(self, k: int) -> Component:
        """Return the law with set k of its gains."""
        return with_gains(self.task.law, tuple(self.task.box), self.results[k].best.gains)

    @property
    def count(self) -> int:
        """The number of sets."""
        return len(self.results)

    def task_of(self, k: int) -> search.TuningTask:
        """Return the task of search k, of which the first may be a shorter one."""
        if k or self.share == 1:
            return self.task
        return self.task._replace(budget=max(1, self.task.budget // self.share))

    def search(self, k: int, draw: int, ends: float) -> SearchResult:
        """Make search k, from a draw. At the time `ends` the first one ends with what it has; of
        others, or without anything, raise OutOfTime.
        """

        def report(count: int) -> None:
            if time.monotonic() > ends:
                raise OutOfTime

        result = self.task_of(k).search(k, self.failure, report, draw)
        if k or draw:
            report(0)
        return result

    def file(self, k: int, draw: int, folder: Path) -> CachedResult[SearchResult]:
        """Return the file of search k in a folder, the same in every call."""
        key = k, draw, self.share if k == 0 else 1
        if key not in self.files:
            self.files[key] = self.task_of(k).file(k, folder, draw)
        return self.files[key]

    def call(self, k: int, draw: int) -> tuple:
        """Return the arguments with which a worker makes search k."""
        return self.task_of(k).call(k, self.failure, draw)


class RaceSearch(NamedTuple):
    """A search of a race."""

    entrant: SearchedEntrant
    k: int
    draw: int = 0


class Race(NamedTuple):
    """How laws stand after a race."""

    entrants: Mapping[str, Entrant]  # by name, those that were dropped, too
    unsearched: Sequence[str]  # the laws whose first search the clock ended or did not begin
    # law -> its best J over the worst of the leader's, of laws that were dropped
    dropped: Mapping[str, float]
    comparison: Comparison | None  # of the others, by J of their sets; None for one law
    sets: int  # of each law that was not dropped
    looked: int  # at how many of them the comparison looks: a third look would have no error left
    stopped: bool  # whether the time was over before a winner or the last look
    seconds: float  # that a set of each law takes together; 0 if none was searched in this call
    shorter: bool = False  # whether a first set is from a shorter search

    @property
    def running(self) -> list[str]:
        """The laws that were not dropped, those of lower J first."""
        names = [name for name in self.entrants if name not in self.dropped]
        return sorted(names, key=lambda name: (float(np.median(self.entrants[name].values)), name))

    @property
    def laws(self) -> list[str]:
        """The laws that raced beside "none"."""
        return [name for name in self.entrants if name != WITHOUT]

    @property
    def winner(self) -> str | None:
        """The law that wins, if there is one."""
        return self.comparison.winners[0] if self.comparison else None

    @property
    def first(self) -> list[str]:
        """The winner; without one, the laws than which no other is better."""
        if self.winner:
            return [self.winner]
        if self.comparison is None or self.sets < LOOKS[0]:  # too few for a lead to count
            return self.running
        beaten = dict(zip(self.comparison.laws, self.comparison.worse[:, 0], strict=True))
        return [law for law in self.running if not beaten[law]]


class RaceCourse(NamedTuple):
    """What a race is run on."""

    trial: Trial
    plant: Plant
    goal: Objective
    clock: AnswerTime


def race(course: RaceCourse, entrants: Sequence[Entrant], relevant: float) -> Race:
    """Race laws by J of the course's goal, as long as its clock lets it. `relevant` is as in
    `ranking`.

    Sets that the folder has are taken even if the time is over.
    """
    clock = course.clock
    dropped: dict[str, float] = {}
    comparison, looked = None, 0
    stopped = False
    laws = [*searched_laws(entrants)]
    count = len(entrants)
    with bar(SETS, LOOKS[0] * count, course.trial.progress, counted=True) as progress:
        progress.latest = clock.ends
        in_folder = _are_kept(
            course, [RaceSearch(entrant, 0) for entrant in searched_laws(entrants)]
        )
        everyone = _first_sets(course, entrants, progress)
        running = dict(everyone)
        # s that a law took in each round
        rounds = [] if in_folder or not laws else [_further(course, laws)]
        for k in range(1, LOOKS[-1]):
            count = len(running)
            _expect(progress, k, count)
            start = time.monotonic()
            pieces = [RaceSearch(entrant, k) for entrant in searched_laws(running.values())]
            ends = clock.race_ends(count)
            over = start + len(pieces) * _expected(rounds) > ends
            if k == TIMED and rounds and pieces:
                _tell_if_short(progress, k, (ends - start) / len(pieces), rounds)
            in_folder = _are_kept(course, pieces)
            progress.latest = ends
            if (over and not in_folder) or not _search_round(course, pieces, ends, progress):
                stopped = True
                break
            _again(course, list(searched_laws(running.values())), ends)
            _judge(course, list(running.values()), k + 1)
            if not in_folder and pieces:
                rounds.append((time.monotonic() - start) / len(pieces))
            if k + 1 == FIRST:
                values = {name: entrant.values for name, entrant in running.items()}
                dropped = hopeless(values)
                for name in dropped:
                    del running[name]
                if dropped:
                    names = joined("u = 0" if name == WITHOUT else name for name in dropped)
                    names = names if len(dropped) < TOLD else f"{len(dropped)} laws"
                    progress.says(f"{SETS} (out of the race: {names})")
            if k + 1 in LOOKS:
                comparison, looked = judged(running, course.goal, relevant), k + 1
                if comparison is None or comparison.winners[0] or needed(comparison) > WITHIN:
                    break
    count = len(next(iter(running.values())).J)
    if count < LOOKS[0]:
        comparison, looked = judged(running, course.goal, relevant), count
    unsearched = [entrant.law.name for entrant in entrants if entrant.law.name not in everyone]
    pieces = [*searched_laws(running.values()), *unsearched]
    return Race(
        entrants=everyone,
        unsearched=unsearched,
        dropped=dropped,
        comparison=comparison,
        sets=count,
        looked=looked,
        stopped=stopped,
        seconds=len(pieces) * _expected(rounds),
        shorter=any(entrant.share > 1 for entrant in searched_laws(everyone.values())),
    )


def searched_laws(entrants: Iterable[Entrant]) -> Iterator[SearchedEntrant]:
    """Yield the laws whose gains are searched."""
    for entrant in entrants:
        if isinstance(entrant, SearchedEntrant):
            yield entrant


def _first_sets(
    course: RaceCourse, entrants: Sequence[Entrant], progress: Bar
) -> dict[str, Entrant]:
    """Search the first set of each law and judge it at once, so that the time of what follows is
    known. Return the laws that have one, by name.
    """
    clock = course.clock
    ready = [entrant for entrant in entrants if not entrant.searched]
    progress.says(f"{SETS} (now u = 0 and given gains)")
    _judge(course, ready, 1)
    if ready and 0.0 < clock.left < math.inf:  # once more, as the first runs compiled
        _judge(course, ready[:1], 2)
        del ready[0].J[1:]
    progress.says(SETS, float(len(ready)))
    pieces = [RaceSearch(entrant, 0) for entrant in searched_laws(entrants)]
    start = time.monotonic()
    for i, result in _results(course, pieces, clock.first_sets_end, shorten=True):
        entrant = pieces[i].entrant
        entrant.results.append(result)
        spent = time.monotonic() - start
        clock.searched(_work(course, entrant), spent)
        _judge(course, [entrant], 1)
        ready.append(entrant)
        progress.advance(1.0)
        start = time.monotonic()
    return {entrant.law.name: entrant for entrant in entrants if entrant in ready}


def _further(course: RaceCourse, laws: Sequence[SearchedEntrant]) -> float:
    """Return how long a further set of a law takes, s, on average, as the first runs and searches
    tell. These took longer, as they compiled, too, or less long, where they were shorter.
    """
    clock = course.clock
    searches = [clock.search_seconds(_work(course, entrant, 1)) for entrant in laws]
    return sum(searches) / len(searches) + clock.pace * clock.unit * judgements([1])


def _work(course: RaceCourse, entrant: SearchedEntrant, k: int = 0) -> float:
    """Return the work of a law's search k: coarse runs, and those of the sets that it decides as a
    judgement does.
    """
    task = entrant.task_of(k)
    coarse = 0.0
    for case in task.cases(0):
        coarse += case.samples * case.plant.n
    return DECIDED_RUNS * course.clock.unit + task.size * coarse


def _shorten(course: RaceCourse, entrant: SearchedEntrant, waiting: int) -> float:
    """Divide the evaluations of a law's first search so that it and others that are `waiting` end
    in time, as far as it may, and return when it must end.
    """
    clock = course.clock
    now = time.monotonic()
    last = LAST_ROOM * (clock.first_sets_end - now)
    room = max(clock.race_ends(waiting + 1, first=True) - now, last) / waiting
    for share in SHORTER:
        entrant.share = share
        if clock.search_seconds(_work(course, entrant)) <= room:
            break
    after = clock.pace * clock.unit * (1 + judgements([0]))  # the best set is decided and judged
    return now + max(room - after, LEAST_ROOM * room)


def _search_round(
    course: RaceCourse, pieces: Sequence[RaceSearch], ends: float, progress: Bar
) -> bool:
    """Make one search of each law, and return whether all ended in time; else none counts."""
    results = {}
    for i, result in _results(course, pieces, ends):
        results[i] = result
        progress.advance(1.0)
    if len(results) < len(pieces):
        return False
    for i, piece in enumerate(pieces):
        piece.entrant.results.append(results[i])
    return True


def _expected(rounds: Sequence[float]) -> float:
    """Return how long a further set of a law takes, s: as the longest of those after the first,
    which compiles, too.
    """
    return max(rounds[1:] or rounds, default=0.0)


def _expect(progress: Bar, done: int, laws: int) -> None:
    """Set the work done and the whole work of the bar before a round, in sets of gains of laws that
    go on.
    """
    last = next(look for look in LOOKS if look > done)
    progress.reached(done * laws, last * laws)


def _tell_if_short(progress: Bar, done: int, seconds: float, rounds: Sequence[float]) -> None:
    """Say beside the bar if the time that each law has, s, is too short for the first look."""
    fit = done + seconds / _expected(rounds)
    if fit < LOOKS[0]:
        enough = f"{LOOKS[0]} can name a winner"
        progress.what = f"{SETS} (about {math.floor(fit)} of each law fit, and {enough})"


def hopeless(J: Mapping[str, Sequence[float]]) -> dict[str, float]:
    """Return the laws to drop, law -> its least J over the largest one of the law that leads, which
    is more than FAR. Two laws beside "none" stay.
    """
    lead = min(map(max, J.values()))
    shares = {}
    for law, values in J.items():
        shares[law] = min(values) / lead
    order = sorted(shares, key=lambda law: (shares[law], law))
    stay = [law for law in order if law != WITHOUT][:2]
    return {law: shares[law] for law in order if shares[law] > FAR and law not in stay}


def stuck(J: Sequence[float]) -> list[int]:
    """Return the searches of a law whose J in training is more than STUCK times the least of the
    others.
    """
    again = []
    for k, value in enumerate(J):
        rest = [*J[:k], *J[k + 1 :]]
        if rest and value > STUCK * min(rest):
            again.append(k)
    return again


def judged(running: Mapping[str, Entrant], goal: Objective, relevant: float) -> Comparison | None:
    """Return the comparison of laws by J of their sets; None for one law."""
    if len(running) < 2:
        return None
    values = {}
    halves = {}
    numbers = {}
    fine = {}
    for name, entrant in running.items():
        full_step, halved = zip(*filter(None, entrant.J), strict=True)
        values[name] = np.array(full_step)
        halves[name] = np.array(halved)
        numbers[name] = np.arange(len(full_step)) % entrant.count
        fine[name] = values[name] < LIMIT_COST
    return compared(values, goal, halves, numbers, fine, relevant, looks=len(LOOKS))


def needed(comparison: Comparison) -> float:
    """Return the number of sets with which the law in front would probably win, if further sets
    were like those that there are; inf for any number.
    """
    medians = np.median(comparison.cells[:, 0], axis=1)
    middles = np.where(comparison.ranked[:, 0], medians, np.inf)
    count = int(comparison.ranked[:, 0].sum())
    if count < 2:
        return math.inf
    first, *rivals = np.argsort(middles, kind="stable")[:count].tolist()
    needs = []
    for rival in rivals:
        needs.append(
            units_needed(comparison.leads[0, first, rival], comparison.error, comparison.relevant)
        )
    return max(needs)


def compared(
    values: Mapping[str, Array],
    goal: Objective,
    halves: Mapping[str, Array],
    sets: Mapping[str, Array],
    fine: Mapping[str, Array],
    relevant: float,
    looks: int = 1,
) -> Comparison:
    """Return the comparison of laws, all of them chosen beforehand, by J."""
    least = EPS * len(goal.conditions) * goal.duration**2 / 2.0
    return Comparison(
        values,
        least,
        sets=sets,
        relevant=relevant,
        halves=halves,
        arrived=fine,
        rivals=1,
        looks=looks,
    )


def _are_kept(course: RaceCourse, pieces: Sequence[RaceSearch]) -> bool:
    """Return whether there are searches, and the folder has them all."""
    return bool(pieces) and all(_file(course, piece).read() for piece in pieces)


def _file(course: RaceCourse, piece: RaceSearch) -> CachedResult[SearchResult]:
    """Return the file of a search."""
    folder = course.trial.folder / "gains" / "searches"
    return piece.entrant.file(piece.k, piece.draw, folder)


def _results(
    course: RaceCourse, pieces: Sequence[RaceSearch], ends: float, shorten: bool = False
) -> Iterator[tuple[int, SearchResult]]:
    """Yield the number and the result of each search: those that the folder has first, then the
    others, in turn or as workers end them, until the time `ends`.
    """
    missing = []
    for i, piece in enumerate(pieces):
        file = _file(course, piece)
        if result := file.read():
            yield i, result
        else:
            missing.append(i)
            writable(file.path)
    if course.trial.search.executor is None:
        yield from _results_here(course, pieces, missing, ends, shorten)
    elif missing:
        calls = []
        for i in missing:
            calls.append(pieces[i].entrant.call(pieces[i].k, pieces[i].draw))
        with opened(course.trial.search.executor) as pool:
            for j, result in called(pool, search.search_task, calls):
                yield missing[j], _file(course, pieces[missing[j]]).keep(result)
                if time.monotonic() > ends:
                    return


def _results_here(
    course: RaceCourse,
    pieces: Sequence[RaceSearch],
    missing: Sequence[int],
    ends: float,
    shorten: bool,
) -> Iterator[tuple[int, SearchResult]]:
    """Make searches one after the other until the time `ends`; if they may be shorter, take those
    that the folder has after that, too.
    """
    for count, i in enumerate(missing):
        piece = pieces[i]
        last = ends
        if shorten and math.isfinite(ends):
            last = _shorten(course, piece.entrant, len(missing) - count)
        file = _file(course, piece)
        result = file.read()
        if result is None and time.monotonic() < ends:
            try:
                result = file.keep(piece.entrant.search(piece.k, piece.draw, last))
            except OutOfTime:
                continue
        if result is not None:
            yield i, result


def _again(course: RaceCourse, running: Sequence[SearchedEntrant], ends: float) -> None:
    """Make stuck searches once more, and take the better ones."""
    pieces = []
    for entrant in running:
        for k in stuck([result.best.objective for result in entrant.results]):
            if k not in entrant.again:
                pieces.append(RaceSearch(entrant, k, 1))
    for i, result in _results(course, pieces, ends):
        entrant, k, _ = pieces[i]
        entrant.again.add(k)
        if result.best.objective < entrant.results[k].best.objective:
            entrant.results[k] = result
            if k < len(entrant.J):
                entrant.J[k] = None


def _judge(course: RaceCourse, running: Sequence[Entrant], count: int) -> None:
    """Compute J of the first sets, on unseen runs, where it is not known, and tell the clock how
    long that took.
    """
    unjudged = []
    files = []
    for entrant in running:
        entrant.J += [None] * (count - len(entrant.J))
        for k in range(count):
            if entrant.J[k] is None:
                file = _judgement(course, entrant, k)
                entrant.J[k] = file.read()
                if entrant.J[k] is None:
                    unjudged.append((entrant, k))
                    files.append(file)
    if not unjudged:
        return
    numbers = [k for _, k in unjudged]
    laws = [entrant.gains(k) for entrant, k in unjudged]
    start = time.monotonic()
    values, halves = unseen(course.trial, course.plant, laws, course.goal, numbers)
    course.clock.judged(judgements(numbers), time.monotonic() - start)
    for (entrant, k), value, half, file in zip(
        unjudged, values.tolist(), halves.tolist(), files, strict=True
    ):
        writable(file.path)
        entrant.J[k] = file.keep(Unseen(value, half))


def _judgement(course: RaceCourse, entrant: Entrant, k: int) -> CachedResult[Unseen]:
    """Return the file of J of a law's set k."""
    trial, plant, goal, _ = course
    (first,) = trial.draws.numbers(1)
    (case,) = goal.holdout(plant, entrant.gains(k), first + k, 1)
    path = trial.folder / "unseen" / f"{plant.name}-{entrant.law.name}-set-{k}.json"

    def save(J: Unseen, file: Path) -> None:
        content = json.dumps([J.value, None if math.isnan(J.half) else J.half])
        file.write_text(content, encoding="utf-8")

    def load(file: Path) -> Unseen:
        value, half = json.loads(file.read_text(encoding="utf-8"))
        return Unseen(value, math.nan if half is None else half)

    return CachedResult(path, [run_key.run_key(case), goal.describe(), first + k, k], save, load)


def judgements(numbers: Sequence[int]) -> int:
    """Return how often as much as one instance `unseen` computes for instances: one in four runs
    once more, at half the step.
    """
    return len(numbers) + 2 * sum(k % REPEATED_SEEDS == 0 for k in numbers)


def unseen(
    trial: Trial, plant: Plant, laws: Sequence[Component], goal: Objective, numbers: Sequence[int]
) -> tuple[Array, Array]:
    """Return J of laws on unseen instances, and of one instance in four at half the physics step,
    NaN elsewhere, (laws,) s^2.

    Runs under RK4 have twice the usual physics step here, where that fits, and the usual one in
    that one of four. J moves by some thousandths, for half of the time.
    """
    (first,) = trial.draws.numbers(1)
    instances = [first + k for k in numbers]
    values, _ = objectives(plant, laws, goal, instances, trial.threads, doubled=True)
    halves = np.full(len(laws), math.nan)
    again = []
    laws_again = []
    repeated = []
    for i, k in enumerate(numbers):
        if k % REPEATED_SEEDS == 0:
            again.append(i)
            laws_again.append(laws[i])
            repeated.append(instances[i])
    if again:
        halves[again], _ = objectives(
            plant, laws_again, goal, repeated, trial.threads, halved=True, doubled=True
        )
    return values, halves
