"""Gains by one rule for every law: same actuator bound, objective, budget and search space.

The search has several starts, each independent of the others and of gains that someone tuned before. A start has 64
evaluations for each gain:

1. An eighth screens a Latin hypercube in the logarithm of the gains.
2. A half evolves from the best of them by CMA-ES (N. Hansen & A. Ostermeier, Evolutionary Computation 9:159, 2001; the
   package cmaes), which copes with the rough J of laws that chatter.
3. The rest descends twice from the best by COBYQA (T. M. Ragonneau, PhD thesis, The Hong Kong Polytechnic University,
   2022; scipy's), which fits a quadratic model to the logarithm of J within a trust region.

The first two are cheap: they use Euler's method at 1 ms if the plant's own method is RK4, which costs a third. Only the
accurate evaluations of the descents count as results.

The search has converged when three starts end within 1 % of the best J. It makes new starts until it has converged and
knows 24 near-optimal sets of gains, or until the budget has no room for another start. A set is near-optimal within 3 %
of the best J. A careful user could have ended with any of them, so runs of a law use them in turn, see `gain_sets`. If
fewer are known after the starts, the rest of the budget draws gains at random about the known ones. A law with few sets
would be a small sample, which no rival can beat.

Gains are rounded to four digits, so the printed gains are those that were run. A set that was evaluated before costs no
budget. `search_space` gives the box from which starts are drawn; a descent may leave it by a decade. `Tuned.at_bound`
names gains at the limit of that. No start depends on the budget, so a search with a larger budget repeats the starts of
a shorter one. `objective` defines what is minimised.
"""

import dataclasses
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from smc_mujoco.analysis.tuning import result, search_space
from smc_mujoco.analysis.tuning.objective import FAILURE_COST, OBJECTIVES, Objective
from smc_mujoco.analysis.tuning.result import Evaluation, Tuned, converged, near_optimal, versions
from smc_mujoco.analysis.tuning.search_space import Box
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, find, users_stacklevel, whole
from smc_mujoco.common.progress import bar
from smc_mujoco.common.text import joined
from smc_mujoco.control.component import Component, Template, unit_cure
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.grid import Starts
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario, default_u_max
from smc_mujoco.simulation.trace import Trace

EVALUATIONS_PER_GAIN = 64  # of a start
SCREENED_SHARE, EVOLVED_SHARE = 1 / 8, 1 / 2  # of the evaluations; the rest descend
FIRST_DEVIATION = 0.3  # decades: first standard deviation of the evolution; chosen
FIRST_RADII = (0.2, 0.1)  # decades: first radius of the trust region in each of a start's descents; chosen
LAST_RADIUS = 0.005  # decades
SPARE_EVALUATIONS = 96  # starts after the first leave so many for further near-optimal sets; chosen
BUDGET = 768 + SPARE_EVALUATIONS  # evaluations: three starts of a law of four gains, six of one of two
# Factors on the random step after a near-optimal set, and after another. They balance if a third is near-optimal.
STEP_GROWTH, STEP_SHRINKAGE = 1.5, 1.5**-0.5
GAIN_DIGITS = 4
MAX_BUDGET = 1_000_000  # evaluations
RULE = (
    "CMA-ES and COBYQA from several starts, in the logarithm of the gains: each start has"
    f" {EVALUATIONS_PER_GAIN} evaluations a gain. An eighth screens a Latin hypercube, within 1.5 decades about the"
    " gains' scale by dimension, forces up to u_max, and a half evolves from the best of them by CMA-ES, both under"
    " Euler's method at 1 ms. The rest descends from the best of these by COBYQA under RK4. Both may leave the box by"
    " a decade. Starts end when"
    f" {result.AGREEING_STARTS} starts end within {100 * result.AGREEMENT_TOLERANCE:g} % of the best and"
    f" {result.MAX_SETS} sets of gains within {100 * result.NEAR_OPTIMAL_TOLERANCE:g} % of it are known, or when"
    f" {SPARE_EVALUATIONS} evaluations are left."
    " These are random steps from the sets that are known, until they are as many"
)
Report = Callable[[int], None]


class BrokenLawError(ScenarioError):
    """An error: a law fails whatever its gains are."""


def tune(
    plant: Plant | str,
    law: Component | Template | str,
    budget: int = BUDGET,
    seed: int = 0,
    objective: Objective | str = "balanced",
    threads: int | None = None,
    progress: bool = False,
    conditions: Sequence[Condition | str] | Condition | str | None = None,
    starts: Starts | None = None,
    chattering: float | None = None,
) -> Tuned:
    """Find the law's best gains on the plant, by the rule that is the same for every law.

    Args:
      plant, law: names, or your own plant and law. The search does not start from the law's gains; `Tuned.before` is
        their objective. Gains declared with `held=True` keep their value.
      budget: largest number of sets of gains to evaluate, each in one run per condition.
      seed: seed of the search, and of initial states and noise, which are the same for all candidates; below 10^9.
      objective: an Objective, "balanced", or "tracking", without a cost of the variation of u.
      threads, progress: as in `run`.
      conditions, starts, chattering: in place of the objective's, see `Objective`.

    Raises:
      ScenarioError: a gain of unknown unit whose default is not positive, a plant without scales, an argument out of
        range, or a law whose own code fails in every run, with its own gains and with those of a whole start.

    Warns:
      ScenarioWarning: a gain of unknown unit, which is searched about its default; the law's original gains are better
        than any that were tried; or all chatter more than is wanted.
    """
    changes = {"conditions": conditions, "starts": starts, "chattering": chattering}
    goal = objective if isinstance(objective, Objective) else find("objective", objective, OBJECTIVES)
    goal = dataclasses.replace(goal, **{name: value for name, value in changes.items() if value is not None})
    budget = whole("budget", budget, 1, MAX_BUDGET)
    whole("seed", seed, 0, 10**9)
    cases = goal.scenarios(plant, coerce.law(law), seed)
    plant, law = cases[0].plant, cases[0].law
    bound = goal.u_max or default_u_max(plant)
    goal = dataclasses.replace(goal, u_max=bound)
    reach = goal.starts.largest(dataclasses.replace(cases[0], x0=None))
    scales = search_space.scales(plant, bound, cases[0].model == "nominal", reach)
    box = search_space.box(law, scales)
    if search_space.without_unit(law):
        _warn(_without_unit_warning(law))
    traces = run(cases, threads)
    failure = _failure_of_law(traces)
    if failure and (all(trace.diverged_at == 0.0 for trace in traces) or prepare(cases[0]).why_not):
        raise _broken(law, failure)
    tracking, variation = goal.terms(traces)
    before = tracking + goal.weight * variation + goal.excess(cases[0])
    with bar(f"{law.name} on {plant.name}", budget, shown=progress, counted=True) as progress_bar:
        ledger = _Ledger(goal, cases, tuple(box), bound, budget, threads, progress_bar.advance)
        searched = search_space.widened(law, box)
        ends = _search(ledger, box, searched, seed, failure)
    tuned = _result(ledger, ends=ends, before=before, seed=seed, scales=scales, bounds=box, searched=searched)
    _warn_of_result(tuned, chatters=bool(ledger.excess(tuple(tuned.gains.values()))))
    return tuned.sourced()


def _result(ledger: "_Ledger", **fields: Any) -> Tuned:
    best, case = min(ledger.evaluations, key=lambda e: e.objective), ledger.cases[0]
    return Tuned(
        law=_with_gains(case.law, ledger.names, best.gains),
        objective=best.objective,
        history=tuple(ledger.evaluations),
        screened=ledger.screened,
        plant=case.plant,
        definition=ledger.goal,
        rule=RULE,
        budget=ledger.budget,
        versions=versions(),
        **fields,
    )


def _warn_of_result(tuned: Tuned, chatters: bool) -> None:
    tried = f"tried for {tuned.law.name} on {tuned.plant.name}"
    if tuned.objective > tuned.before:
        values = f"an objective of {tuned.objective:.3g} s² instead of {tuned.before:.3g} s²"
        _warn(f"no set of gains {tried} is better than the law's own, with {values}: give a larger budget")
    if chatters:
        words = f"to chatter with more than {tuned.definition.chattering:g}"
        _warn(f"all gains {tried} are predicted {words}: give a larger budget, or a larger chattering")


def _failure_of_law(traces: Sequence[Trace]) -> str:
    """Return how the first run failed, if the law fails in every run, and the plant in none; else ""."""
    fails = all(trace.broken for trace in traces)
    return traces[0].broken if fails else ""


def _broken(law: Component, failure: str) -> BrokenLawError:
    return BrokenLawError(f"{law.name} cannot be tuned, {failure}: correct the law or signal")


def _warn(words: str) -> None:
    warnings.warn(words, ScenarioWarning, users_stacklevel())


def _without_unit_warning(law: Component) -> str:
    names = list(search_space.without_unit(law))
    have, whose = ("have", "their defaults") if len(names) > 1 else ("has", "its default")
    search = f"no unit, and so a search about {whose} in place of the rule of all laws"
    return f"{law.name}'s {joined(names)} {have} {search}: {unit_cure(names[0], law.gains[names[0]])}"


@dataclasses.dataclass
class _Ledger:
    """The accurate evaluations, in order, and the number of cheap ones."""

    goal: Objective
    cases: Sequence[Scenario]
    names: tuple[str, ...]
    u_max: float
    budget: int
    threads: int | None
    report: Report
    screened: int = 0
    evaluations: list[Evaluation] = dataclasses.field(default_factory=list)
    objectives: dict[tuple[float, ...], float] = dataclasses.field(default_factory=dict)

    @property
    def left(self) -> int:
        """The evaluations that the budget has left."""
        return self.budget - self.screened - len(self.evaluations)

    def screen(self, logs: np.ndarray) -> np.ndarray:
        """Return J of candidates (candidates, gains), given as log10 gains, from cheap runs."""
        candidates = [self.gains(row) for row in logs.tolist()]
        costs = [one.objective for one in self.evaluate(candidates, [_under_euler(case) for case in self.cases])]
        self.screened += len(candidates)
        self.report(len(candidates))
        return np.array(costs)

    def cost(self, logs: np.ndarray) -> float:
        """Return the accurate J of a candidate, given as log10 gains (gains,)."""
        gains = self.gains(logs.tolist())
        if gains not in self.objectives:
            self.evaluations += self.evaluate([gains], self.cases)
            self.objectives[gains] = self.evaluations[-1].objective
            self.report(1)
        return self.objectives[gains]

    def gains(self, logs: Sequence[float]) -> tuple[float, ...]:
        """Return the gains of a candidate, none above the actuator's limit, see `search_space`."""
        gains = {name: _rounded(10.0**z) for name, z in zip(self.names, logs, strict=True)}
        for name, limit in search_space.actuator_limits(self.cases[0].law, gains, self.u_max).items():
            gains[name] = min(gains[name], _rounded(limit))
        return tuple(gains.values())

    def evaluate(self, candidates: Sequence[tuple[float, ...]], cases: Sequence[Scenario]) -> list[Evaluation]:
        """Run candidates in all cases, as one batch."""
        size = len(cases)
        laws = [_with_gains(cases[0].law, self.names, gains) for gains in candidates]
        traces = run([dataclasses.replace(case, law=law) for law in laws for case in cases], self.threads)
        made = []
        for k, gains in enumerate(candidates):
            tracking, variation = self.goal.terms(traces[k * size : (k + 1) * size])
            cost = tracking + self.goal.weight * variation + self.excess(gains)
            made.append(Evaluation(gains, cost, tracking, variation))
        return made

    def excess(self, gains: tuple[float, ...]) -> float:
        """Return what a candidate's predicted chattering costs, s^2."""
        law = _with_gains(self.cases[0].law, self.names, gains)
        return self.goal.excess(dataclasses.replace(self.cases[0], law=law))


def _rounded(gain: float) -> float:
    return float(f"{gain:.{GAIN_DIGITS}g}")


def _under_euler(case: Scenario) -> Scenario:
    return dataclasses.replace(case, integrator="Euler") if case.resolved.integrator == "RK4" else case


def _with_gains(law: Component, names: Sequence[str], values: Sequence[float]) -> Component:
    """Return the law with other gains, without a warning for violated conditions of its theorem."""
    return dataclasses.replace(law, gains=dict(law.gains) | dict(zip(names, values, strict=True)))


def _search(ledger: _Ledger, box: Box, searched: Box, seed: int, failure: str) -> tuple[float, ...]:
    """Make starts in a box until they have converged or the budget is spent, and return the best J of each, s^2.

    Bad gains may make the numbers of a law overflow, and others may cure that. So a law whose own gains fail in every
    run is refused, with this failure, only after a whole start in which every run fails.
    """
    ends: list[float] = []
    whole_start = EVALUATIONS_PER_GAIN * len(box)
    while not ends or ledger.left >= whole_start + SPARE_EVALUATIONS:
        random, size = np.random.default_rng([seed, len(ends)]), min(whole_start, ledger.left)
        screened = ledger.screened
        logs, cost = _screened(ledger, box, random, int(SCREENED_SHARE * size))
        logs = _evolved(ledger, searched, random, logs, cost, int(EVOLVED_SHARE * size))
        ends.append(_descend(ledger, searched, logs, size - (ledger.screened - screened)))
        if failure and size == whole_start and ends[0] >= FAILURE_COST * len(ledger.cases):
            raise _broken(ledger.cases[0].law, failure)
        if converged(ends) and len(near_optimal(ledger.evaluations)) >= result.MAX_SETS:
            break
    _spread(ledger, searched, np.random.default_rng([seed, len(ends)]))
    return tuple(ends)


def _spread(ledger: _Ledger, box: Box, random: np.random.Generator) -> None:
    """Draw gains about the near-optimal ones, until enough near-optimal ones are known or the budget is spent."""
    low, high = np.log10(list(box.values())).T
    step = FIRST_RADII[-1]  # decades, standard deviation
    for _ in range(ledger.left):
        near = near_optimal(ledger.evaluations)
        if len(near) >= result.MAX_SETS or near[0].failed:
            return
        logs = np.log10(near[random.integers(len(near))].gains) + step * random.standard_normal(len(low))
        cost = ledger.cost(np.clip(logs, low, high))
        is_near = cost <= near[0].objective * (1.0 + result.NEAR_OPTIMAL_TOLERANCE)
        step = max(step * (STEP_GROWTH if is_near else STEP_SHRINKAGE), LAST_RADIUS)


def _screened(ledger: _Ledger, box: Box, random: np.random.Generator, size: int) -> tuple[np.ndarray, float]:
    """Return the log10 gains of the best of a Latin hypercube in the box, and their J; the middle if size is 0."""
    from scipy.stats.qmc import LatinHypercube

    low, high = np.log10(list(box.values())).T
    if not size:
        return (low + high) / 2.0, np.inf
    logs = low + (high - low) * LatinHypercube(len(low), rng=random).random(size)
    costs = ledger.screen(logs)
    return logs[np.argmin(costs)], costs.min()


def _evolved(
    ledger: _Ledger, box: Box, random: np.random.Generator, logs: np.ndarray, cost: float, size: int
) -> np.ndarray:
    """Return the best log10 gains of an evolution from those given, whose J is `cost`, within a box."""
    from cmaes import CMA

    if len(logs) < 2:  # CMA-ES adapts a covariance
        return logs
    bounds, seed = np.log10(list(box.values())), int(random.integers(2**31))
    evolution = CMA(mean=logs, sigma=FIRST_DEVIATION, bounds=bounds, seed=seed)
    for _ in range(size // evolution.population_size):
        candidates = np.array([evolution.ask() for _ in range(evolution.population_size)])
        costs = ledger.screen(candidates)
        evolution.tell(list(zip(candidates, costs, strict=True)))
        if costs.min() < cost:
            logs, cost = candidates[np.argmin(costs)], costs.min()
    return logs


def _descend(ledger: _Ledger, box: Box, logs: np.ndarray, size: int) -> float:
    """Descend from log10 gains within a box with at most `size` accurate evaluations, and return the best J."""
    from scipy.optimize import Bounds, minimize

    low, high = np.log10(list(box.values())).T
    costs = [ledger.cost(logs)]

    def cost(z: np.ndarray) -> float:
        costs.append(ledger.cost(np.clip(z, low, high)))
        return np.log(costs[-1])

    radii = FIRST_RADII if size > 4 * len(logs) + 4 else FIRST_RADII[:1]  # a first model needs 2 n + 1 evaluations
    for radius in radii if size > 1 else ():
        logs = minimize(
            cost,
            logs,
            method="COBYQA",
            bounds=Bounds(low, high),  # pyright: ignore[reportArgumentType]
            options={"maxfev": (size - 1) // len(radii), "initial_tr_radius": radius, "final_tr_radius": LAST_RADIUS},
        ).x
    return min(costs)
