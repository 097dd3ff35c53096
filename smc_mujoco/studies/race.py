"""A race: sets of gains in turn over the laws, until one law wins, on one plant.

Every law gets its first set of gains, then every law its second, so that laws have equal numbers
wherever the race stops. A law for whose first set there is no time does not race. J of a set is
that of unseen runs of all conditions, in one number, so that neither more laws nor more conditions
ask for more sets. This is a race in the sense of O. Maron, A. W. Moore, "Hoeffding races" (NIPS 6,
1994), by the tests of `analysis.ranking`.

- After three sets a law is dropped whose best J is more than twice the worst one of the law that
  leads. It is not tested against the others. Two laws always stay.
- A search is made once more, from another draw, if its J in training is more than twice the least
  of its law's others: it was stuck. The better of both is the set.
- The laws are judged after 7 sets, and if none wins, after 12, unless the 7 say that probably
  more than 24 are needed. Each look has half of the errors: one of two equal laws wins in at most
  5 % of races, one of more laws in fewer, and the best law is taken for a worse one in at most 5 %.
  A race that does not go on makes errors only rarer.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis.paired_runs import EPS
from smc_mujoco.analysis.ranking import Comparison
from smc_mujoco.analysis.signed_rank import units_needed
from smc_mujoco.analysis.tuning import search
from smc_mujoco.analysis.tuning.evaluator import with_gains
from smc_mujoco.analysis.tuning.objective import FAILURE_COST, Objective, objectives
from smc_mujoco.analysis.tuning.result import SearchResult
from smc_mujoco.common.aliases import Array
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.files import writable
from smc_mujoco.common.progress import Bar, bar
from smc_mujoco.common.text import joined
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.workers import called, opened
from smc_mujoco.studies.answer_time import AnswerTime
from smc_mujoco.studies.fair_gains import Candidate, Trial
from smc_mujoco.studies.study import REPEATED_SEEDS

LOOKS = (7, 12)  # numbers of sets after which the laws are judged
WITHIN = 24  # sets that would decide, above which a race ends at the first look; chosen
TIMED = 2  # sets after which the number of sets that fit is known: the first compiles, too
FIRST = 3  # sets after which a law may be dropped; chosen
FAR = 2.0  # times the leader's worst J, above which it is; chosen
STUCK = 2.0  # times the least J of its law's others, above which a search is made again; chosen


class Unseen(NamedTuple):
    """J of a set of gains on unseen runs, s^2."""

    value: float
    half: float  # at half the physics step, NaN where it was not computed


class Entrant:
    """A law in a race: its sets of gains, which searches find or which are known, and their J."""

    def __init__(self, known: Candidate | None, task: search.TuningTask | None):
        self.known = known
        self.task = task
        self.law: Component = known.law if known else task.law  # pyright: ignore[reportOptionalMemberAccess]
        self.found: list[SearchResult] = []
        self.again: set[int] = set()  # searches that were made once more
        self.J: list[Unseen | None] = []

    @cached_property
    def failure(self) -> str:
        """How its first run failed, see `search.failure_of_law`."""
        assert self.task is not None
        return search.failure_of_law(self.task)

    def gains(self, k: int) -> Component:
        """Return the law with set k of its gains."""
        if self.task is None:
            return self.known(k)  # pyright: ignore[reportOptionalCall]
        return with_gains(self.task.law, tuple(self.task.box), self.found[k].best.gains)

    def search(self, k: int, draw: int) -> SearchResult:
        """Make search k, from a draw."""
        assert self.task is not None
        return self.task.search(k, self.failure, lambda count: None, draw)

    def call(self, k: int, draw: int) -> tuple:
        """Return the arguments with which a worker makes search k."""
        assert self.task is not None
        return self.task.call(k, self.failure, draw)

    @property
    def count(self) -> int:
        """The number of sets that differ; 1 for a law with given gains."""
        return len(self.found) if self.task else len(self.known.sets)  # pyright: ignore[reportOptionalMemberAccess]

    @property
    def values(self) -> list[float]:
        """J of each set."""
        return [unseen_J.value for unseen_J in self.J if unseen_J]


class Race(NamedTuple):
    """How laws stand after a race."""

    entrants: Mapping[str, Entrant]  # by name, those that were dropped, too
    unsearched: Sequence[str]  # the laws for whose first set there was no time
    # law -> its best J over the worst of the leader's, of laws that were dropped
    dropped: Mapping[str, float]
    comparison: Comparison | None  # of the others, by J of their sets; None for one law
    sets: int  # of each law that was not dropped
    looked: int  # at how many of them the comparison looks: a third look would have no error left
    stopped: bool  # whether the time was over before a winner or the last look
    seconds: float  # that a set of each law takes together; 0 if none was searched in this call

    @property
    def running(self) -> list[str]:
        """The laws that were not dropped, those of lower J first."""
        names = [name for name in self.entrants if name not in self.dropped]
        return sorted(names, key=lambda name: (float(np.median(self.entrants[name].values)), name))

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


def race(
    trial: Trial,
    plant: Plant,
    entrants: Sequence[Entrant],
    goal: Objective,
    clock: AnswerTime,
    relevant: float,
) -> Race:
    """Race laws on a plant by J of `goal`, as long as the clock lets it. `relevant` is as in
    `ranking`.

    The folder of the trial keeps each search. Sets that it has are taken even if the time is over.
    """
    dropped: dict[str, float] = {}
    comparison, looked = None, 0
    stopped = False
    begin = time.monotonic()
    from_folder = _kept(trial, [(entrant, 0, 0) for entrant in entrants if entrant.task])
    with bar(
        "set of gains", LOOKS[0] * len(entrants), trial.progress, counted=True
    ) as progress_bar:
        progress_bar.latest = clock.ends
        everyone = _first_sets(trial, plant, entrants, goal, clock, progress_bar)
        running = dict(everyone)
        # s that a law took in each round
        rounds = [] if from_folder else [(time.monotonic() - begin) / len(running)]
        for k in range(1, LOOKS[-1]):
            _expect(progress_bar, k, len(running))
            start = time.monotonic()
            pieces = [(entrant, k, 0) for entrant in running.values() if entrant.task]
            count = len(running)
            over = start + count * _expected(rounds) > clock.race_ends(count)
            if k == TIMED and rounds:
                _tell_if_short(progress_bar, k, (clock.race_ends(count) - start) / count, rounds)
            from_folder = _kept(trial, pieces)
            progress_bar.latest = clock.race_ends(count)
            if over and not from_folder:
                stopped = True
                break
            for i, result in _searched(trial, pieces):
                pieces[i][0].found.append(result)
                progress_bar.advance(1.0)
            _again(trial, list(running.values()))
            clock.judged(*_judge(trial, plant, list(running.values()), goal, k + 1))
            if not from_folder:
                rounds.append((time.monotonic() - start) / len(running))
            if k + 1 == FIRST:
                values = {name: entrant.values for name, entrant in running.items()}
                dropped = hopeless(values)
                for name in dropped:
                    del running[name]
                if dropped:
                    progress_bar.says(f"{joined(dropped)} dropped: set of gains")
            if k + 1 in LOOKS:
                comparison, looked = judged(running, goal, relevant), k + 1
                if comparison is None or comparison.winners[0] or needed(comparison) > WITHIN:
                    break
    count = len(next(iter(running.values())).J)
    if count < LOOKS[0]:
        comparison, looked = judged(running, goal, relevant), count
    unsearched = [entrant.law.name for entrant in entrants if entrant.law.name not in everyone]
    seconds = (len(running) + len(unsearched)) * _expected(rounds)
    return Race(everyone, unsearched, dropped, comparison, count, looked, stopped, seconds)


def _first_sets(
    trial: Trial,
    plant: Plant,
    entrants: Sequence[Entrant],
    goal: Objective,
    clock: AnswerTime,
    shown: Bar,
) -> dict[str, Entrant]:
    """Search the first set of each law and judge it at once, so that the time of what follows is
    known. Return the laws that have one, by name: those for which there was time, and at least one.
    """
    ready = [entrant for entrant in entrants if entrant.task is None]
    pieces = [(entrant, 0, 0) for entrant in entrants if entrant.task]
    taken: list[float] = []  # s of each law
    last = time.monotonic()
    if ready:
        _judge(trial, plant, ready, goal, 1)

    def over() -> bool:
        end = last + _expected(taken or [0.0])
        return bool(ready) and end > clock.race_ends(len(ready) + 1, first=True)

    for i, result in _searched(trial, pieces, over):
        entrant = pieces[i][0]
        entrant.found.append(result)
        clock.judged(*_judge(trial, plant, [entrant], goal, 1))
        ready.append(entrant)
        shown.advance(1.0)
        taken.append(time.monotonic() - last)
        last = time.monotonic()
    return {entrant.law.name: entrant for entrant in entrants if entrant in ready}


def _expected(rounds: Sequence[float]) -> float:
    """Return how long a further set of a law takes, s: as the longest of those after the first,
    which compiles, too.
    """
    return max(rounds[1:] or rounds, default=0.0)


def _expect(shown: Bar, done: int, laws: int) -> None:
    """Set the work done and the whole work of the bar before a round, in sets of gains of laws that
    go on.
    """
    last = next(look for look in LOOKS if look > done)
    shown.reached(done * laws, last * laws)


def _tell_if_short(shown: Bar, done: int, left: float, rounds: Sequence[float]) -> None:
    """Say beside the bar if the time that is left for each law, s, is too short for the first
    look.
    """
    fit = done + left / _expected(rounds)
    if fit < LOOKS[0]:
        enough = f"{LOOKS[0]} can name a winner"
        shown.what = f"about {math.floor(fit)} sets of each law fit, and {enough}: set of gains"


def hopeless(J: Mapping[str, Sequence[float]]) -> dict[str, float]:
    """Return the laws to drop, law -> its least J over the largest one of the law that leads, which
    is more than FAR. Two laws stay.
    """
    lead = min(map(max, J.values()))
    shares = {}
    for law, values in J.items():
        shares[law] = min(values) / lead
    order = sorted(shares, key=lambda law: (shares[law], law))
    return {law: shares[law] for law in order[2:] if shares[law] > FAR}


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
        fine[name] = values[name] < FAILURE_COST
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


def _kept(trial: Trial, pieces: Sequence[tuple[Entrant, int, int]]) -> bool:
    """Return whether there are searches, and the folder has them all."""
    return bool(pieces) and all(_file(trial, *piece).read() for piece in pieces)


def _file(trial: Trial, one: Entrant, k: int, draw: int):
    """Return the file of a search."""
    assert one.task is not None
    return one.task.file(k, trial.folder / "gains" / "searches", draw)


def _searched(
    trial: Trial,
    pieces: Sequence[tuple[Entrant, int, int]],
    over: Callable[[], bool] = lambda: False,
) -> Iterator[tuple[int, SearchResult]]:
    """Yield the number and the result of each search, given by its law, its k and its draw: those
    that the folder has first, then the others, in turn or as workers end them, until `over`.
    """
    files = {}
    for i, piece in enumerate(pieces):
        file = _file(trial, *piece)
        result = file.read()
        if result is None:
            files[i] = file
            writable(file.path)
        else:
            yield i, result
    missing = list(files)
    if trial.executor is None:
        for i in missing:
            if over():
                return
            entrant, k, draw = pieces[i]
            yield i, files[i].keep(entrant.search(k, draw))
    elif missing:
        calls = []
        for i in missing:
            entrant, k, draw = pieces[i]
            calls.append(entrant.call(k, draw))
        with opened(trial.executor) as pool:
            for j, result in called(pool, search.searched, calls):
                yield missing[j], files[missing[j]].keep(result)
                if over():
                    return


def _again(trial: Trial, running: Sequence[Entrant]) -> None:
    """Make stuck searches once more, and keep the better ones."""
    pieces = []
    for entrant in running:
        for k in stuck([result.best.objective for result in entrant.found]):
            if k not in entrant.again:
                entrant.again.add(k)
                pieces.append((entrant, k, 1))
    for i, result in _searched(trial, pieces):
        entrant, k, _ = pieces[i]
        if result.best.objective < entrant.found[k].best.objective:
            entrant.found[k] = result
            if k < len(entrant.J):
                entrant.J[k] = None


def _judge(
    trial: Trial,
    plant: Plant,
    running: Sequence[Entrant],
    goal: Objective,
    count: int,
) -> tuple[int, float]:
    """Compute J of the first sets, on unseen runs, where it is not known. Return the number of
    `judgements` that this was, and how long it took, s.
    """
    unjudged = []
    laws = []
    numbers = []
    for entrant in running:
        entrant.J += [None] * (count - len(entrant.J))
        for k in range(count):
            if entrant.J[k] is None:
                unjudged.append((entrant, k))
                laws.append(entrant.gains(k))
                numbers.append(k)
    start = time.monotonic()
    values, halves = unseen(trial, plant, laws, goal, numbers)
    spent = time.monotonic() - start
    for (entrant, k), value, half in zip(unjudged, values.tolist(), halves.tolist(), strict=True):
        entrant.J[k] = Unseen(value, half)
    return judgements(numbers), spent


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
    (first,) = trial.seeds(1)
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
