"""Gains by one rule for every law: same actuator bound, objective, budget and search space.

A tuning makes several searches, twelve in a comparison. Each has its own start, its own seed, and
its own runs with other initial states and noise, so they share nothing: what they end with is a
sample of what a user gets who tunes the law. Run i of a study uses the gains that search i found,
see `gain_sets`. A search has 64 evaluations for each gain:

1. An eighth screens a Latin hypercube in the logarithm of the gains.
2. A half evolves from the best of them by CMA-ES (N. Hansen & A. Ostermeier, Evolutionary
   Computation 9:159, 2001; the package cmaes), which copes with the rough J of laws that chatter.
3. The rest descends from the best by COBYQA (T. M. Ragonneau, PhD thesis, The Hong Kong Polytechnic
   University, 2022; scipy's), which fits a quadratic model to the logarithm of J within a trust
   region. It ends when 2 n + 2 evaluations, with n gains, lower J by less than 0.1 %.

Where a plant is nothing but its equation under RK4, the fast engine takes the place of MuJoCo, in a
thirtieth of the time. J on record is MuJoCo's, from one evaluation of the best gains. If the two J
differ by more than 1 %, the search is made again in MuJoCo. Elsewhere the first two stages are
cheap: they use Euler's method in place of RK4, or one step of another integrator a control period,
and leave out limits and contacts that are the plant's own. Where other constraints act, they leave
out contacts of a model on a fixed base that touches nothing at its start and at its goal. Descents
run as a scenario does.

A set of gains that misses a condition of the law's theorem is drawn again, and the descent is drawn
back to the nearest set on its way that does not, unless `outside_theorem` lifts the conditions.

Gains are rounded to four digits, so the printed gains are those that were run. In the first two
stages a set that was evaluated before costs no budget. `search_space` gives the box from which
starts are drawn; a search may leave it by a decade. `Tuned.at_bound` names gains at that limit. No
search depends on the others, so more of them repeat those of fewer. `objective` defines what is
minimised.
"""

import dataclasses
import math
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import mujoco
import numpy as np

from smc_mujoco.analysis import step_halving
from smc_mujoco.analysis.engine import Device
from smc_mujoco.analysis.engine.scored_runs import worth_compiling
from smc_mujoco.analysis.tuning import quick_search, search_space
from smc_mujoco.analysis.tuning.evaluator import EQUATION, PYTHON, Evaluator, with_gains
from smc_mujoco.analysis.tuning.objective import (
    BUDGET,
    FAILURE_COST,
    MAX_TUNING_SEED,
    OBJECTIVES,
    SEARCHES,
    Budget,
    Evaluation,
    Objective,
    Searches,
)
from smc_mujoco.analysis.tuning.result import SearchResult, Tuned, load_search
from smc_mujoco.analysis.tuning.run_limits import LIMIT_COST, only_limits, shows_limits
from smc_mujoco.analysis.tuning.search_space import Box
from smc_mujoco.analysis.tuning.stages import (
    DRAWS,
    EVOLVED_SHARE,
    SCREENED_SHARE,
    Gains,
    Trials,
    descend,
    evolved,
    hypercube,
)
from smc_mujoco.common import fingerprint
from smc_mujoco.common.aliases import AnyPath, Array, Floats
from smc_mujoco.common.cache import CachedResult
from smc_mujoco.common.constraints import Boolean, FilePath, Progress, SeedOf, constrained
from smc_mujoco.common.errors import (
    BrokenLawError,
    ScenarioError,
    ScenarioWarning,
    find,
    users_stacklevel,
)
from smc_mujoco.common.files import writable
from smc_mujoco.common.progress import Bar, bar
from smc_mujoco.common.text import joined
from smc_mujoco.common.version import versions
from smc_mujoco.control.component import Component, Template, unit_cure
from smc_mujoco.control.law import checked_name
from smc_mujoco.mechanisms.custom import clearance
from smc_mujoco.mechanisms.custom.scales import falls
from smc_mujoco.mechanisms.layout import driven_names
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.conventions import leans
from smc_mujoco.simulation import coerce, run_key
from smc_mujoco.simulation.codes import code_hashes
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.force_bounds import suggested_u_max
from smc_mujoco.simulation.grid import Starts
from smc_mujoco.simulation.integration import stepped_by_mujoco
from smc_mujoco.simulation.model import with_values
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import run_unjudged
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.simulation.workers import Workers, called, opened

OFF = mujoco.mjtDisableBit
AGREEMENT = 0.01  # of J: the equation's and MuJoCo's differ by less, or MuJoCo searches again
SLOTS = 8  # candidates that MuJoCo screens at once: as many as CMA-ES asks for with five gains
RULE = (
    "CMA-ES and COBYQA, in the logarithm of the gains: each search has its own start, seed, "
    "noise and initial states,"
    f" and {BUDGET} evaluations a gain. An eighth screens a Latin hypercube, within 1.5 decades "
    "about the gains' scale"
    " by dimension, further above for products of more than two rates, "
    "and a half evolves from the best of them by CMA-ES. The rest descends from "
    "the best of these by"
    " COBYQA, until 2 n + 2 evaluations for n gains lower J by less than 0.1 %. Both may leave "
    "the box by a decade"
)
Report = Callable[[int], None]


@constrained
def tune(
    plant: Plant | str,
    law: Component | Template | str,
    budget: Budget = BUDGET,
    seed: Annotated[int, SeedOf(high=MAX_TUNING_SEED)] = 0,
    objective: Objective | str = "balanced",
    threads: int | None = None,
    progress: Progress = False,
    conditions: Sequence[Condition | str] | Condition | str | None = None,
    starts: Starts | None = None,
    chattering: float | None = None,
    searches: Searches = SEARCHES,
    out: Annotated[AnyPath, FilePath()] | None = None,
    outside_theorem: bool = False,
    device: Device = "cpu",
    executor: Workers | None = None,
    quick: Boolean = False,
    needs: str | Sequence[str] | None = None,
) -> Tuned:
    """Find gains of a law on the plant by independent searches, by the rule that is the same for
    every law.

        tuned = smc.tune("duffing", "pid", budget=8, searches=2)
        print(tuned, tuned.law)

    Args:
      plant, law: names, or your own plant and law. No search starts from the law's gains;
        `Tuned.before` is their objective. Gains declared with `held=True` keep their value. One
        number of each gain is found for all joints. No search finds gains by joint; a plant with
        one of them as its only channel, and others="held", is tuned for that joint alone.
      budget: largest number of sets of gains that a search evaluates for each gain, each in one run
        per condition. Not counted are the law's own gains, and sets that MuJoCo repeats after the
        fast engine or, if quick, after coarse runs.
      seed: seed of the searches, and of initial states and noise, which differ between searches; at
        most 10^9.
      objective: an Objective, "balanced", or "tracking", without a cost of the variation of u.
      threads, progress: as in `run`.
      conditions, starts, chattering: in place of the objective's, see `Objective`.
      searches: their number. They share nothing: `Tuned.sets` has the best gains of each.
      out: a folder that keeps each search as soon as it ends. After a kill, the same call resumes
        there.
      outside_theorem: whether gains may miss the conditions of the law's theorem.
      device: on which the fast engine runs candidates, "cpu" or "cuda".
      executor: where the searches are made side by side, one on each worker, as in `study`; the
        gains are the same.
      quick: whether all evaluations but the last three of a search take one step a control period,
        which is faster. One such search with 16 evaluations a gain may end at gains that are worse
        than the law's own: give several searches, or a larger budget, and compare `objective` with
        `before` of the answer.
      needs: limits that the gains keep, one or several: "no-overshoot", "overshoot<10" (in % of the
        way to the goal) or "calm" (u rests where nothing moves). Searches keep four fifths of them.

    Returns:
      A `Tuned`: `law` has the gains of the least J that was found, which the law's own gains may
      beat: then a warning says so, and `before` is less than `objective`. `sets` has the best gains
      of each search, and `save(path)` writes a file that every command reads.

    Raises:
      ScenarioError: a gain of unknown unit whose default is not positive, a plant without scales,
        an argument out of range, your law with the name of a law of the library, or a law whose
        own code fails in every run, with its own gains and with those of a whole search.

    Warns:
      ScenarioWarning: a gain of unknown unit, which is searched about its default; the law's
        original gains are better than any that were tried; all break a limit; or all chatter more
        than is wanted.
    """
    limits = None if needs is None else tuple(limit.for_search for limit in only_limits(needs))
    changes = {"conditions": conditions, "starts": starts, "chattering": chattering}
    changes["limits"] = limits
    if isinstance(objective, Objective):
        goal = objective
    else:
        goal = find("objective", objective, OBJECTIVES)
    replaced = {name: value for name, value in changes.items() if value is not None}
    goal = dataclasses.replace(goal, **replaced)
    own = checked_name(coerce.coerced_law(law))
    task = task_of(plant, own, goal, budget, seed, threads, outside_theorem)
    task = task._replace(device=device, quick=quick)
    if why := falls(task.plant):
        _warn(why)
    if search_space.without_unit(task.law):
        _warn(_without_unit_warning(task.law))
    failure = failure_of_law(task)
    words = f"tuning {task.law.name} for {task.plant.name}: evaluation"
    with bar(words, searches * task.size, shown=progress, counted=True) as progress_bar:
        files = [] if out is None else [task.file(i, out) for i in range(searches)]
        results = {}
        missing = []
        for i in range(searches):
            result = files[i].read() if files else None
            if result:
                results[i] = result
            else:
                missing.append(i)
        progress_bar.advance(len(results) * task.size)
        writable(*(files[i].path for i in missing if files))
        if executor is None:
            work = _searched_here(task, missing, failure, progress_bar)
        else:
            work = _searched_elsewhere(task, missing, failure, progress_bar, executor)
        for i, result in work:
            results[i] = files[i].keep(result) if files else result
        in_order = tuple(results[i] for i in range(searches))
        tuned = result_of(task, in_order)
    _warn_of_result(tuned)
    return tuned.sourced()


def _searched_here(
    task: "TuningTask", missing: Sequence[int], failure: str, shown: Bar
) -> Iterator[tuple[int, SearchResult]]:
    """Make searches one after the other, and yield the number and the result of each."""
    before = shown.done
    for count, i in enumerate(missing, 1):
        start = time.monotonic()
        yield i, task.search(i, failure, shown.advance)
        shown.add_piece(time.monotonic() - start, len(missing) - count)
        shown.reached(before + count * task.size, shown.whole)


def _searched_elsewhere(
    task: "TuningTask", missing: Sequence[int], failure: str, shown: Bar, executor: Any
) -> Iterator[tuple[int, SearchResult]]:
    """Have workers make searches side by side, and yield the number and the result of each."""
    calls = [task.call(i, failure) for i in missing]
    with opened(executor) as pool:
        for k, result in called(pool, search_task, calls):
            yield missing[k], result
            shown.advance(task.size)


def search_task(
    plant: Plant,
    law: Component,
    goal: Objective,
    budget: int,
    seed: int,
    outside_theorem: bool,
    quick: bool,
    codes: Any,
    i: int,
    failure: str,
    draw: int,
) -> SearchResult:
    """Make search i of a task, on a worker, on one thread of its processor.

    Raises:
      ScenarioError: the law's code is another one here.
    """
    task = task_of(plant, law, goal, budget, seed, 1, outside_theorem)._replace(quick=quick)
    if task.codes() != codes:
        raise ScenarioError(f"a worker has other code for {law.name}: install the same there")
    return task.search(i, failure, lambda count: None, draw)


class TuningTask(NamedTuple):
    """What every search of a tuning has in common."""

    law: Component
    plant: Plant
    goal: Objective
    scales: dict[str, float]
    box: Box
    searched: Box
    budget: int
    seed: int
    threads: int | None
    inside: Array  # log10 gains in the box that hold the conditions
    outside_theorem: bool
    device: str = "cpu"
    quick: bool = False  # whether searches are those of `quick_search`

    def holds(self, gains: Gains) -> bool:
        """Return whether gains of the box hold the conditions of the law's theorem."""
        template = self.law.template
        if self.outside_theorem or template is None:
            return True
        searched = zip(self.box, gains, strict=True)
        tried = {**self.law.gains, **dict(searched)}
        return not template.unmet(tried)

    @property
    def size(self) -> int:
        """The largest number of evaluations of a search."""
        return self.budget * len(self.box)

    def cases(self, i: int) -> list[Scenario]:
        """Return the runs of search i."""
        return self.goal.scenarios(self.plant, self.law, self.seed, i)

    def first_case(self, i: int) -> Scenario:
        """Return the first run of search i, of which a file's name is made."""
        (first,) = self.goal.scenarios(self.plant, self.law, self.seed, i, 1)
        return first

    def codes(self) -> Any:
        """Return hashes of the code that every search depends on.

        It takes 20 ms for a user's law.
        """
        template = self.law.template
        ranges = template and (dict(template.gains), dict(template.conditions))
        return code_hashes(self.first_case(0), {}), fingerprint.of((self.law.function, ranges))

    def call(self, i: int, failure: str, draw: int = 0) -> tuple:
        """Return the arguments with which a worker makes search i, see `searched`."""
        made_of = self.plant, self.law, self.goal, self.budget, self.seed
        return (*made_of, self.outside_theorem, self.quick, self.codes(), i, failure, draw)

    def file(self, i: int, folder: AnyPath, draw: int = 0) -> "CachedResult[SearchResult]":
        """Return the file of search i in a folder."""
        depends = (
            run_key.run_key(self.first_case(i)),
            self.goal.describe(),
            self.codes(),
            self.budget,
            self.outside_theorem,
            list(self.box.items()),
            self.quick and quick_search.RULE,
            draw,
        )
        again = f"-{draw}" if draw else ""
        path = Path(folder) / f"{self.plant.name}-{self.law.name}-{i}{again}.json"
        return CachedResult(path, depends, SearchResult.save, load_search)

    def search(self, i: int, failure: str, report: Report, draw: int = 0) -> SearchResult:
        """Make search i, with its first random numbers or those of another draw.

        Bad gains may make the numbers of a law overflow, and others may cure that. So a law whose
        own gains fail in every run is refused, with this failure, only after a whole search in
        which every run fails.
        """
        cases = self.cases(i)
        if self.quick:
            cases = list(map(step_halving.doubled, cases))
        # as for all searches of a usual tuning, so that a search does not depend on their number
        work = SEARCHES * self.size * sum(case.work for case in cases)
        by_equation = self._evaluator(cases, self.device != "cpu" or worth_compiling(work))
        random = np.random.default_rng([self.seed, i, draw] if draw else [self.seed, i])
        if self.quick:
            return self._search_quickly(by_equation, random, report, failure)
        if by_equation.engine == EQUATION:
            trials = self._search(self._trials(by_equation, by_equation, report), random)
            best = self._on_record(trials.best.gains, cases)
            if abs(best.objective - trials.best.objective) <= AGREEMENT * best.objective:
                return self._best_of(trials, best, failure)
            random = np.random.default_rng([self.seed, i, draw] if draw else [self.seed, i])
        accurate = self._evaluator(cases)
        trials_of_all = self._trials(_cheap(accurate), accurate, report)
        trials = self._search(trials_of_all, random)
        return self._best_of(trials, trials.best, failure)

    def _evaluator(self, cases: Sequence[Scenario], by_equation: bool = False) -> Evaluator:
        return Evaluator(
            self.goal, cases, tuple(self.box), self.threads, by_equation, device=self.device
        )

    def _trials(self, cheap: Evaluator, accurate: Evaluator, report: Report) -> Trials:
        def limit(gains: dict[str, float]) -> dict[str, float]:
            return search_space.force_limits(self.law, gains, self.goal.u_max or self.scales["F"])

        return Trials(cheap, accurate, tuple(self.box), limit, report, self.holds)

    def _search(self, trials: Trials, random: np.random.Generator) -> Trials:
        """Make a search, from the box, within the bounds `searched`."""
        size = int(SCREENED_SHARE * self.size)
        logs, cost = hypercube(trials, self.box, random, size, self.inside)
        share = int(EVOLVED_SHARE * self.size)
        logs = evolved(trials, self.searched, random, logs, cost, share)
        descend(trials, self.searched, logs, self.size - trials.count)
        return trials

    def _search_quickly(
        self, by_equation: Evaluator, random: np.random.Generator, report: Report, failure: str
    ) -> SearchResult:
        """Make a search by the rule of `quick_search`, all cases by the equation or at one step a
        control period. A `report` that raises OutOfTime ends it with the best set so far.
        """
        if by_equation.engine == EQUATION:
            coarse = by_equation
            accurate = self._evaluator(by_equation.cases)
        else:
            coarse = _cheap(by_equation, at_period=True)
            accurate = by_equation
            accurate.release()
        first = coarse.of_first()
        trials = self._trials(coarse, coarse, report)
        alone = self._trials(first, first, lambda count: report(0))
        space = quick_search.SearchSpace(self.box, self.searched, self.inside)
        spent = 0
        to_decide = quick_search.DECIDED
        try:
            spent = quick_search.search(alone, trials, space, random, self.size)
        except quick_search.OutOfTime:
            to_decide = 1
            if not (trials.decided or alone.decided):
                raise
        if coarse is not accurate:
            coarse.release()
        best_first = quick_search.first(trials) or quick_search.first(alone)
        decided = accurate([evaluation.gains for evaluation in best_first[:to_decide]])
        best = min(decided, key=lambda evaluation: evaluation.objective)
        self._refuse_broken(best, failure)
        count = spent + trials.count + len(decided)
        return SearchResult(
            best=best, history=tuple(decided), evaluations=count, engine=accurate.engine
        )

    def _on_record(self, gains: Floats, cases: Sequence[Scenario]) -> Evaluation:
        """Return the evaluation of a set of gains by MuJoCo."""
        law = with_gains(self.law, tuple(self.box), gains)
        cases = [dataclasses.replace(case, law=law) for case in cases]
        traces = run_unjudged(cases, self.threads)
        return self.goal.evaluation(cases[0], traces, gains)

    def _refuse_broken(self, best: Evaluation, failure: str) -> None:
        """Raise BrokenLawError if every run of a whole search fails."""
        full = self.quick or self.budget >= BUDGET
        if failure and full and best.objective >= FAILURE_COST * len(self.goal.conditions):
            raise _broken(self.law, failure)

    def _best_of(self, trials: Trials, best: Evaluation, failure: str) -> SearchResult:
        self._refuse_broken(best, failure)
        history = tuple(trials.decided.values())
        engine = trials.accurate.engine
        return SearchResult(best=best, history=history, evaluations=trials.count, engine=engine)


def task_of(
    plant: Plant | str,
    law: Component,
    goal: Objective,
    budget: int,
    seed: int,
    threads: int | None,
    outside_theorem: bool = False,
) -> TuningTask:
    """Return what the searches of a tuning share: plant, bound on u, and search space."""
    first, *further = goal.scenarios(plant, law, seed)
    if goal.limits and not shows_limits([first, *further]):
        raise ScenarioError(
            f"no run shows whether {joined([*map(str, goal.limits)])} is kept, as noise, a "
            "reference or a disturbance moves in each: give a condition without these, such as "
            "nominal"
        )
    if len(units := sorted({scenario.efforts[0] for scenario in (first, *further)})) > 1:
        two_units = f"{units[0]} and {units[1]}"
        raise ScenarioError(
            f"the conditions of a tuning have commands in {two_units}: tune for each drive alone"
        )
    _refuse_mixed_commands(first)
    own = suggested_u_max(first.plant)
    largest = float(np.max(own)) if first.force_command else min(first.limits)
    bound = goal.u_max or largest
    if not isinstance(own, tuple):  # where bounds differ, each joint keeps its own
        goal = dataclasses.replace(goal, u_max=bound)
    reach = goal.starts.largest(dataclasses.replace(first, x0=None))
    felt, per_u = bound, None
    if not first.accelerates:
        drives = first.drive_train
        per_u = drives.nominal[0].gain
        if not first.force_command:  # a servo gives no more than its file lets it
            pairs = zip(drives.forces, drives.motors, strict=True)
            felt = min(bound, *(force / motor.nominal.gain for force, motor in pairs))
    scales = search_space.scales(
        first.plant, felt, reach, per_u, max(map(_dead_time, (first, *further)))
    )
    box = search_space.box(first.law, scales)
    low, high = np.log10(list(box.values())).T
    task = TuningTask(
        law=first.law,
        plant=first.plant,
        goal=goal,
        scales=scales,
        box=box,
        searched=search_space.widened(first.law, box),
        budget=budget,
        seed=seed,
        threads=threads,
        inside=(low + high) / 2.0,
        outside_theorem=outside_theorem,
    )
    random = np.random.default_rng(0)
    for _ in range(DRAWS):
        if task.holds(tuple(10.0**task.inside)):
            return task
        task = task._replace(inside=random.uniform(low, high))
    raise ScenarioError(
        f"no gains of {law.name} in its search range meet the conditions of its theorem: "
        "change its gains that are held, or give outside_theorem=True"
    )


def _dead_time(case: Scenario) -> float:
    """Return the time from a reading of the position to the force that follows, s."""
    late = max((encoder.delay for encoder in case.sensors), default=0.0)
    return case.control_period + case.input_delay + late


def _refuse_mixed_commands(case: Scenario) -> None:
    """Raise ScenarioError if joints take commands of different kinds."""
    drives = case.drive_train.motors
    if len({motor.unit for motor in drives}) < 2:
        return
    units = " and ".join(dict.fromkeys(case.efforts[: case.plant.driven]))
    ideal = []
    for motor, joint in zip(drives, driven_names(case.plant), strict=True):
        if motor.unit:
            ideal.append(f"{joint}(motor)")
    raise ScenarioError(
        f"joints of {case.plant.name} take commands in {units}, but a tuning has one bound on u "
        f"and one set of gains for all joints: give {joined(ideal)} in the text of the plant, or "
        "smc.Channel(motor=True), for ideal motors; or name the joints of one kind alone, as the "
        "others then hold their place"
    )


def why_not_tuned(plant: Plant, law: Component | Template, goal: Objective) -> str:
    """Return why a law cannot be tuned on a plant, or "".

    Raise BrokenLawError if it cannot even be run there.
    """
    try:
        task_of(plant, coerce.coerced_law(law), goal, BUDGET, 0, None)
    except BrokenLawError:
        raise
    except ScenarioError as error:
        return str(error)
    return ""


def _cheap(accurate: Evaluator, at_period: bool = False) -> Evaluator:
    """Return an evaluator that screens candidates at less cost, or at the least, one step a control
    period; the same one for laws that do not compile.
    """
    if accurate.engine == PYTHON:
        return accurate
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScenarioWarning)
        cases = []
        for case in accurate.cases:
            coarse = _coarse(case)
            cases.append(_at_period(coarse) if at_period else coarse)
    goal = accurate.goal
    names = accurate.names
    threads = accurate.threads
    return Evaluator(goal, cases, names, threads, off=_left_out(accurate.cases), slots=SLOTS)


def _coarse(case: Scenario) -> Scenario:
    """Return a case under Euler's method in place of RK4, or with one step a control period, if it
    allows that.
    """
    case = stepped_by_mujoco(case)
    integrator = case.resolved.integrator
    if integrator == "RK4" and case.plain_equation:
        return dataclasses.replace(case, integrator="Euler")
    if integrator == "RK4":
        integrator = "implicitfast"
    try:
        return dataclasses.replace(case, integrator=integrator, physics_step=case.control_period)
    except ScenarioError:  # a delay or a clock needs a shorter step
        return case


def _at_period(case: Scenario) -> Scenario:
    """Return a case with one step a control period, if it allows that."""
    try:
        return dataclasses.replace(case, physics_step=case.control_period)
    except ScenarioError:  # a delay or a clock needs a shorter step
        return case


def _left_out(cases: Sequence[Scenario]) -> int:
    """Return MuJoCo's disable flags of what cheap runs leave out: the plant's own limits and
    contacts, or only contacts where something else acts.
    """
    if all(map(_only_limits, cases)):
        return OFF.mjDSBL_CONSTRAINT.value
    if all(map(_touches_nothing, cases)):
        return OFF.mjDSBL_CONTACT.value
    return 0


def _touches_nothing(case: Scenario) -> bool:
    """Return whether a user's model on a fixed base touches nothing where it starts and at its
    goal, and no part adds contacts.
    """
    model = prepare(case).mechanism.model
    if not case.plant.is_user_model or model.npair or _is_free(model):
        return False
    places = case.resolved.x0, case.plant.origin
    return not any(clearance.touches_at(case.plant, x) for x in places)


def _is_free(model: mujoco.MjModel) -> bool:
    """Return whether a model has a body that nothing holds."""
    return bool(np.any(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE))


def _only_limits(case: Scenario) -> bool:
    """Return whether MuJoCo's constraints are only limits and contacts of the plant itself, which
    rarely act.
    """
    model = with_values(prepare(case).mechanism.model, case)
    plain = not case.friction and not case.contact and case.mechanism == "equation"
    dry = model.neq or model.dof_frictionloss.any() or model.tendon_frictionloss.any()
    # a robot may stand on its feet
    stands = not case.plant.pose and _is_free(model)
    return bool(
        plain and not dry and not stands and all(part.in_callback for part in case.actuator)
    )


def result_of(task: TuningTask, found: tuple[SearchResult, ...], beside: bool = True) -> Tuned:
    """Return the tuning that these searches of a task are, with J of the law's own gains `beside`
    it.
    """
    rule = quick_search.RULE if task.quick else RULE
    if task.outside_theorem:
        rule += ", outside the conditions of the law's theorem"
    tuned = Tuned(
        law=task.law,
        searches=found,
        before=np.nan,
        plant=task.plant,
        definition=task.goal,
        rule=rule,
        budget=task.budget,
        seed=task.seed,
        scales=task.scales,
        bounds=task.box,
        searched=task.searched,
        versions=versions(),
    )
    before = math.nan
    if beside:
        cases = task.cases(found.index(tuned.best))
        traces = run_unjudged(cases, task.threads)
        before = task.goal.evaluation(cases[0], traces).objective
    gains = tuned.best.best.gains
    law = with_gains(task.law, tuple(task.box), gains)
    return dataclasses.replace(tuned, law=law, before=before)


def _warn_of_result(tuned: Tuned) -> None:
    tried = f"tried for {tuned.law.name} on {tuned.plant.name}"
    if tuned.objective > tuned.before:
        _warn(
            f"no set of gains {tried} is better than the law's own, with an objective of "
            f"{tuned.objective:.3g} s² instead of {tuned.before:.3g} s²: give a larger budget"
        )
    if LIMIT_COST <= tuned.objective < FAILURE_COST:
        limits = joined([*map(str, tuned.definition.limits)])
        _warn(
            f"no set of gains {tried} keeps {limits} in every run: allow more, or a larger budget"
        )
    first, *_ = tuned.definition.scenarios(tuned.plant, tuned.law, tuned.seed)
    if tuned.plant.is_user_model:
        (trace,) = run_unjudged([first])
        _warn_of_leaning(trace)
    if tuned.definition.excess(first):
        _warn(
            f"all gains {tried} are predicted to chatter with more than "
            f"{tuned.definition.chattering:g}: give a larger budget or a larger limit, chattering="
        )


def _warn_of_leaning(trace: Trace) -> None:
    """Warn of a run of a user's model that leans on something."""
    if leans(trace) and not falls(trace.scenario.plant):
        _warn(
            f"{trace.scenario.law.name} on {trace.scenario.plant.name} stays at the bound of u "
            "with its best gains: it leans on something, or needs more force; give another goal or "
            "start, or a larger u_max if the motor gives more"
        )


def failure_of_law(task: TuningTask) -> str:
    """Return how the first run failed, if the law fails in every run, and the plant in none; else
    "".

    Raise BrokenLawError if it fails at once, or does not compile either.
    """
    cases = task.cases(0)
    traces = run_unjudged(cases, task.threads)
    if all(trace.broken for trace in traces):
        failure = traces[0].broken
    else:
        failure = ""
    if failure and (all(trace.diverged_at == 0.0 for trace in traces) or prepare(cases[0]).why_not):
        raise _broken(task.law, failure)
    return failure


def _broken(law: Component, failure: str) -> BrokenLawError:
    return BrokenLawError(f"{law.name} cannot be tuned, {failure}: correct the law or signal")


def _warn(words: str) -> None:
    warnings.warn(words, ScenarioWarning, users_stacklevel())


def _without_unit_warning(law: Component) -> str:
    names = list(search_space.without_unit(law))
    cure = unit_cure(names[0], law.gains[names[0]])
    return (
        f"gains {joined(names)} of {law.name} have no unit and are searched about their defaults: "
        f"{cure}, or Gain(.., held=True) to keep one, such as an exponent"
    )
