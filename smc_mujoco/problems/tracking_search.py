"""The search of a suite for an entry's gains, alike for all entries, and its unseen runs.

Two searches of a problem have nothing in common but the problem. Each draws some of its sets of
gains over the box of a tuning; from the best of these CMA-ES goes on, also a decade beyond the box.
A set is judged by the worst of CHOOSING instances and one without the load: by its error, times
(rate / limit)^4 where the rate is beyond the limit, so that the search comes to good sets from the
side of those that vary too much. Chosen is the least error within the limit, of sets within the
law's theorem. With gains of four digits it then runs on UNSEEN other instances, with and without
the load. The time constant of the estimator of velocities is a gain of every entry.

Two rules make a search cheap, alike for all. A set runs through its instances one by one, and no
further than until JUDGED others of its batch are known to cost less; and these runs end after
WINDOW s of the problem's window, of which the unseen runs have all.

The fast engine makes all runs.
"""

import math
import warnings
import zlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from cmaes import CMA

from smc_mujoco.analysis.engine.form import FAILURE, SCORES, SETTING
from smc_mujoco.analysis.engine.group import FormGroup, why_not
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.evaluator import with_gains
from smc_mujoco.common.aliases import Array, Numbers
from smc_mujoco.common.errors import BrokenLawError, ScenarioError, ScenarioWarning
from smc_mujoco.common.jit import NotCompilable
from smc_mujoco.control.component import Component
from smc_mujoco.problems.tracking import TrackingProblem, filtered_difference
from smc_mujoco.problems.tracking_entry import TrackingEntry
from smc_mujoco.simulation import state
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario

SEARCHES = 2
SETS = 720  # of gains, of a search
DRAWN = 240  # the first of them
POPULATION = 8  # of CMA-ES
JUDGED = POPULATION // 2  # sets of a batch whose cost is that of all runs
SPREAD = 0.6  # of its first population, of the logarithm of gains
CHOOSING, UNSEEN = 4, 24  # instances
WINDOW = 4.1  # s of a problem's window, at most, by which a search judges
FIRST_UNSEEN = 1000
MARGIN = 0.97  # of the limit, within which sets are chosen, so that unseen runs stay about it
POWER = 4.0  # of the rate over its limit, beyond the limit: by it a search's cost grows
LARGEST = 1e30  # cost of a run that fails, and of a set outside the law's theorem
TAUS = (1.0, 30.0)  # control periods: range of the estimator's time constant
METRICS = ("rms_error", "tv_rate")
TAU = "velocity.tau"  # name of the estimator's gain among those of an entry


class Found(NamedTuple):
    """What a search chose in a problem, and its unseen runs; errors in counts."""

    gains: Numbers
    errors: list[float]  # (UNSEEN,), inf for a run that failed
    without: float  # their median without the load
    rate: float  # median, bounds a second


class GainTrials:
    """The runs of an entry in a problem, as rows of the fast engine."""

    def __init__(self, problem: TrackingProblem, entry: TrackingEntry, threads: int | None):
        self.problem = problem
        self.entry = entry
        self.law = entry.law_on(problem)
        self.threads = threads
        scales = search_space.scales(problem.machine, problem.bound, problem.start, 1.0)
        box = search_space.box(self.law, scales)
        self.names = tuple(box)
        taus = [share * problem.period for share in TAUS]
        self.box = np.log([*box.values(), taus])  # (gains, 2)
        self.bounds = np.log([*search_space.widened(self.law, box).values(), taus])
        runs = [(instance, True) for instance in range(CHOOSING)]
        self.choosing = self.group([*runs, (CHOOSING, False)], WINDOW)

    def _scenario(self, instance: int, loaded: bool) -> Scenario:
        velocity = filtered_difference(self.problem.period)
        beside = self.entry.beside(self.problem, loaded)
        return self.problem.scenario(self.law, velocity, beside, instance, loaded)

    def group(self, instances: Sequence[tuple[int, bool]], longest: float = math.inf) -> FormGroup:
        """Return instances, with or without the load, as rows that end after the problem's window,
        or after its first `longest` s, and whose metrics are of that time.
        """
        runs = [self._scenario(*instance) for instance in instances]
        if why := why_not(runs[0], METRICS):
            raise ScenarioError(f"the suite cannot run {self.law.name}: {why}")
        group = FormGroup(runs, METRICS)
        late = group.rows[:, SETTING.samples] - self.problem.late
        window = min(self.problem.window, longest)
        group.rows[:, SETTING.samples] = late + round(window / self.problem.period)
        group.rows[:, SETTING.early] = late + 1
        group.rows[:, SETTING.late] = late
        return group

    def run(self, group: FormGroup, gains: Array, numbers: Array) -> Array:
        """Return error, counts, and rate, 1/s, of sets of gains, (sets, 2), each in the run of a
        group with its number, (sets,); inf where a run fails.
        """
        rows = group.rows[numbers]
        for name, values in zip(self.names, gains.T, strict=False):
            rows[:, group.gain_columns(name)] = values[:, None]
        rows[:, group.layout.estimator.numbers] = gains[:, -1]
        scores = group.run(rows, self.threads)
        fine = scores[:, [FAILURE]] == state.FINE
        measured = np.where(fine, scores[:, SCORES:], np.inf)
        measured[:, 0] /= self.problem.count
        measured[:, 1] /= self.problem.bound
        return np.nan_to_num(measured, nan=np.inf)

    def judged(self, logs: Array) -> tuple[Array, Array]:
        """Return what a search minimises of logarithms of gains, (sets, gains), and which sets are
        within the limit and the law's theorem.

        The JUDGED best have the cost of all runs. As each run can but raise a cost, another set
        runs no further than until it costs more than they do; it counts as beyond the limit.
        """
        gains = np.exp(logs)
        within = self._within_theorem(logs)
        costs = np.where(within, 0.0, LARGEST)
        worst = np.zeros((len(logs), 2))
        runs = np.zeros(len(logs), int)
        pending = np.flatnonzero(within)
        while len(pending):
            measured = self.run(self.choosing, gains[pending], runs[pending])
            worst[pending] = np.maximum(worst[pending], measured)
            runs[pending] += 1
            costs[pending] = self._costs(worst[pending])
            best = np.argsort(costs, kind="stable")[:JUDGED]
            pending = best[(runs[best] < len(self.choosing.rows)) & (costs[best] < LARGEST)]
        complete = runs == len(self.choosing.rows)
        return costs, within & complete & (worst[:, 1] <= MARGIN * self.problem.limit)

    def _costs(self, worst: Array) -> Array:
        """Return what a search minimises of the largest errors and rates of sets, (sets, 2)."""
        excess = np.maximum(worst[:, 1] / (MARGIN * self.problem.limit), 1.0)
        with np.errstate(over="ignore"):
            return np.minimum(worst[:, 0] * excess**POWER, LARGEST)

    def _within_theorem(self, logs: Array) -> Array:
        """Return which sets of gains meet the conditions of the law's theorem."""
        template = self.law.template
        if template is None or not template.conditions:
            return np.ones(len(logs), bool)
        met = []
        for values in np.exp(logs).tolist():
            named = dict(zip(self.names, values, strict=False))
            met.append(not template.unmet({**self.law.gains, **named}))
        return np.array(met)

    def searched(self, number: int, advance: Callable[[float], None]) -> Numbers:
        """Return the gains that a search chooses, by name, of four digits."""
        seed = [number, zlib.crc32(f"{self.problem.name} {self.law.name}".encode())]
        rng = np.random.default_rng(seed)
        chosen, least = None, LARGEST

        def judge(logs: Array) -> Array:
            nonlocal chosen, least
            costs, allowed = self.judged(logs)
            errors = np.where(allowed, costs, LARGEST)
            if errors.min() < least:
                chosen, least = logs[np.argmin(errors)], errors.min()
            advance(len(logs))
            return costs

        logs = rng.uniform(self.box[:, 0], self.box[:, 1], (DRAWN, len(self.box)))
        try:
            costs = judge(logs)
        except NotCompilable as error:
            self._refuse_broken(logs[0])
            raise ScenarioError(f"{self.law.name} does not compile: {error}") from None
        best = logs[np.argmin(costs)]
        if costs.min() >= LARGEST:
            self._refuse_broken(best)
        cma = CMA(best, SPREAD, self.bounds, seed=number, population_size=POPULATION)
        for _ in range(DRAWN, SETS, POPULATION):
            logs = np.array([cma.ask() for _ in range(POPULATION)])
            cma.tell(list(zip(logs, judge(logs), strict=True)))
        return self._named(best if chosen is None else chosen)

    def _named(self, logs: Array) -> Numbers:
        """Return a set of gains of four digits, by name, of its logarithms."""
        values = np.exp(logs).tolist()
        names = (*self.names, TAU)
        return {name: _four_digits(value) for name, value in zip(names, values, strict=True)}

    def _refuse_broken(self, logs: Array) -> None:
        """Raise BrokenLawError if a run with a set of gains fails, with what failed."""
        with warnings.catch_warnings():  # the error says it
            warnings.simplefilter("ignore", ScenarioWarning)
            trace = run(scenario_of(self.problem, self.entry, self._named(logs), 0))
        if trace.failure:
            raise BrokenLawError(f"no set of gains runs in {self.problem.name}: {trace.failure}")

    def unseen(self, gains: Numbers) -> Found:
        """Return what gains reach on instances that chose nothing."""
        instances = range(FIRST_UNSEEN, FIRST_UNSEEN + UNSEEN)
        runs = [(instance, loaded) for loaded in (True, False) for instance in instances]
        values = np.tile(list(gains.values()), (len(runs), 1))
        errors, rates = self.run(self.group(runs), values, np.arange(len(runs))).T
        if not self._within_theorem(np.log(values[:1]))[0]:
            errors[:] = np.inf
        without, rate = np.median(errors[UNSEEN:]), np.median(rates[:UNSEEN])
        return Found(
            gains, list(map(_four_digits, errors[:UNSEEN])), *map(_four_digits, (without, rate))
        )


def _four_digits(value: float) -> float:
    """Return a number with four digits."""
    return float(f"{value:.4g}")


def search(
    problem: TrackingProblem,
    entry: TrackingEntry,
    number: int,
    threads: int | None = None,
    advance: Callable[[float], None] = lambda work: None,
) -> Found:
    """Return what a search for an entry's gains chose in a problem, and its unseen runs."""
    trials = GainTrials(problem, entry, threads)
    return trials.unseen(trials.searched(number, advance))


def scenario_of(
    problem: TrackingProblem,
    entry: TrackingEntry,
    gains: Numbers,
    instance: int,
    loaded: bool = True,
) -> Scenario:
    """Return a run with the gains of an entry, as `smc.run` takes it."""
    own = {name: value for name, value in gains.items() if name != TAU}
    law: Component = with_gains(entry.law_on(problem), tuple(own), tuple(own.values()))
    velocity = filtered_difference(gains[TAU])
    return problem.scenario(law, velocity, entry.beside(problem, loaded), instance, loaded)
