"""Gains by one rule for every law: same actuator bound, objective, budget and search space.

    tuned = tune("duffing", "classical", budget=96, seed=0)     # Tuned(law, objective, history)
    tuned.save("duffing-classical.json")
    compare([tuned, tune("duffing", "observer_free")])           # best first; refuses tunings made in different ways

The rule has two rounds, as in successive halving (K. Jamieson & A. Talwalkar, AISTATS 2016): many candidates are run
cheaply, and the best of them accurately.

1. A differential evolution (R. Storn & K. Price, J. Global Optimization 11:341, 1997; scipy's, best1bin, weight 0.2 to
   0.7, 16 members, no polishing) in the logarithm of the gains. It begins with a Latin hypercube that includes the
   scales themselves, never with gains that someone tuned before. Its runs use Euler's method at 1 ms if the plant's own
   method is RK4. That costs a third, and changes the objective by at most 0.5 % for laws that do not chatter.
2. After every 48 evaluations the six best candidates that have not been run accurately yet are run accurately. The
   result is the set of gains with the best accurate objective.

Each generation is one batch of runs. Gains are rounded to four digits, so the printed gains are those that were run. A
set that was evaluated before costs no budget. `search_space` gives the bounds. After every 48 evaluations the bounds at
which the best gains lie are moved outwards by a decade, half of the members are drawn again within the new bounds, and
the search continues. `Tuned.at_bound` names gains that are at a bound at the end. A population that has collapsed
starts again. None of this depends on the budget, so a search with a larger budget repeats a shorter one and continues.
It is never worse than one whose budget is a multiple of 48. `objective` defines what is minimised.
"""

import contextlib
import dataclasses
import itertools
import warnings
from collections.abc import Callable, Sequence

import numpy as np

from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.objective import OBJECTIVES, Objective
from smc_mujoco.analysis.tuning.result import Evaluation, Tuned, compare, load, versions
from smc_mujoco.common.errors import ScenarioWarning, find, users_frame, whole
from smc_mujoco.common.progress import bar
from smc_mujoco.control.component import Component, Template
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.initial_states import Starts
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario, default_u_max

__all__ = ["Tuned", "compare", "load", "tune"]

RULE = (
    "differential evolution best1bin (16 members, weight 0.2 to 0.7) in the logarithm of the gains, within 1.5 decades"
    " about their scale by dimension, forces up to u_max, under Euler's method at 1 ms; after every 48 evaluations the"
    " six best that were not yet run under RK4 are, bounds that the best is at are widened by a decade and half of the"
    " members drawn again; the best under RK4 is taken"
)
MEMBERS, STAGE = 16, 48  # size of the population; evaluations between accurate runs of the best
FINALISTS = 6  # candidates run accurately after each stage
DITHER = (0.2, 0.7)  # differential weight, drawn each generation; of three tried the best within 128 evaluations
DIGITS = 4  # of a gain
MAX_CANDIDATES = 1_000_000  # candidates
Report = Callable[[int], None]


def tune(
    plant: Plant | str,
    law: Component | Template | str,
    budget: int = 96,
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
        their objective. Gains that are held keep their value.
      budget: number of sets of gains to evaluate, each in one run per condition.
      seed: seed of the search, and of initial states and noise, which are the same for all candidates; below 10^9.
      objective: an Objective, "balanced", or "tracking", without a cost of the variation of u.
      threads, progress: as in `run`.
      conditions: names or your own conditions, in place of the objective's.
      starts: initial states, see `smc.starts`, in place of the objective's.
      chattering: largest predicted amplitude of the limit cycle of s of the first channel, in its unit, in the first
        condition.

    Raises:
      ScenarioError: a law with gains of unknown unit, a plant without scales, or an argument out of range.

    Warns:
      ScenarioWarning: the law's own gains are better than any that were tried, or all chatter more than is wanted.
    """
    goal = objective if isinstance(objective, Objective) else find("objective", objective, OBJECTIVES)
    if conditions is not None:
        goal = dataclasses.replace(goal, conditions=conditions)  # pyright: ignore[reportArgumentType]
    if starts is not None:
        goal = dataclasses.replace(goal, starts=starts)
    if chattering is not None:
        goal = dataclasses.replace(goal, chattering=chattering)
    budget = whole("budget", budget, 1, MAX_CANDIDATES)
    whole("seed", seed, 0, 10**9)
    cases = goal.scenarios(plant, coerce.law(law), seed)
    plant, law = cases[0].plant, cases[0].law
    bound = goal.u_max or default_u_max(plant)
    goal = dataclasses.replace(goal, u_max=bound)
    reach = goal.starts.reach(dataclasses.replace(cases[0], x0=None))
    scales = search_space.scales(plant, bound, cases[0].model == "nominal", reach)
    start = search_space.box(law, scales)
    tracking, variation = goal.terms(run(cases, threads))
    before = tracking + goal.weight * variation + goal.excess(cases[0])
    with bar(f"{law.name} on {plant.name}", budget, shown=progress, counted=True) as drawn:
        ledger = _Ledger(goal, cases, tuple(start), bound, budget, threads, drawn.advance)
        box = _search(ledger, start, seed)
    best = min(ledger.finals, key=lambda e: e.objective)
    if best.objective > before:
        warnings.warn(
            f"no set of gains tried for {law.name} on {plant.name} is better than the law's own, with an objective of "
            f"{best.objective:.3g} s² instead of {before:.3g} s²: give a larger budget",
            ScenarioWarning,
            users_frame(),
        )
    if ledger.excess(best.gains):
        warnings.warn(
            f"all gains tried for {law.name} on {plant.name} are predicted to chatter with more than "
            f"{goal.chattering:g}: give a larger budget, or a larger chattering",
            ScenarioWarning,
            users_frame(),
        )
    return Tuned(
        law=_with(law, tuple(start), best.gains),
        objective=best.objective,
        history=tuple(ledger.evaluations),
        finals=tuple(ledger.finals),
        before=before,
        plant=plant,
        definition=goal,
        rule=RULE,
        budget=budget,
        seed=seed,
        scales=scales,
        bounds=start,
        searched=box,
        versions=versions(),
    )


class _Spent(Exception):
    """Raised when the budget is spent."""


@dataclasses.dataclass
class _Ledger:
    """The evaluations, cheap and accurate, in order. It raises _Spent when the budget is spent."""

    goal: Objective
    cases: Sequence[Scenario]
    names: tuple[str, ...]
    u_max: float
    budget: int
    threads: int | None
    report: Report
    evaluations: list[Evaluation] = dataclasses.field(default_factory=list)
    finals: list[Evaluation] = dataclasses.field(default_factory=list)
    objectives: dict[tuple[float, ...], float] = dataclasses.field(default_factory=dict)
    excesses: dict[tuple[float, ...], float] = dataclasses.field(default_factory=dict)

    @property
    def best(self) -> Evaluation:
        """The first of the best evaluations."""
        return min(self.evaluations, key=lambda e: e.objective)

    def costs(self, logs: np.ndarray) -> np.ndarray:
        """Return J of candidates given as columns of log10 gains (gains, candidates)."""
        candidates = [self.gains(column) for column in logs.T.tolist()]
        new = [gains for gains in dict.fromkeys(candidates) if gains not in self.objectives]
        left = self.budget - len(self.evaluations)
        evaluated = self.evaluate(new[:left], [_cheap(case) for case in self.cases])
        self.evaluations += evaluated
        self.objectives |= {one.gains: one.objective for one in evaluated}
        self.report(len(evaluated))
        if len(new) >= left:
            raise _Spent
        return np.array([self.objectives[gains] for gains in candidates])

    def gains(self, logs: Sequence[float]) -> tuple[float, ...]:
        """Return the gains of a candidate, none above the actuator's limit, see `search_space`."""
        gains = {name: _rounded(10.0**z) for name, z in zip(self.names, logs, strict=True)}
        for name, most in search_space.largest(self.cases[0].law, gains, self.u_max).items():
            gains[name] = min(gains[name], _rounded(most))
        return tuple(gains.values())

    def decide(self, count: int) -> None:
        """Run the best FINALISTS of the first `count` candidates accurately, without those that were run so before."""
        ran = {one.gains for one in self.finals}
        ranked = sorted(self.evaluations[:count], key=lambda e: e.objective)
        best = [one for one in ranked if one.gains not in ran][:FINALISTS]
        self.finals += self.evaluate([one.gains for one in best], self.cases)

    def evaluate(self, candidates: Sequence[tuple[float, ...]], cases: Sequence[Scenario]) -> list[Evaluation]:
        """Run candidates in all cases, as one batch."""
        size = len(cases)
        laws = [_with(cases[0].law, self.names, gains) for gains in candidates]
        traces = run([dataclasses.replace(case, law=law) for law in laws for case in cases], self.threads)
        terms = [self.goal.terms(traces[i : i + size]) for i in range(0, len(traces), size)]
        return [
            Evaluation(gains, tracking + self.goal.weight * variation + self.excess(gains), tracking, variation)
            for gains, (tracking, variation) in zip(candidates, terms, strict=True)
        ]

    def excess(self, gains: tuple[float, ...]) -> float:
        """Return what a candidate's predicted chattering costs; it is predicted once."""
        if gains not in self.excesses:
            case = self.cases[0]
            self.excesses[gains] = self.goal.excess(dataclasses.replace(case, law=_with(case.law, self.names, gains)))
        return self.excesses[gains]


def _rounded(gain: float) -> float:
    """Return a gain as it is printed."""
    return float(f"{gain:.{DIGITS}g}")


def _cheap(case: Scenario) -> Scenario:
    """Return the case under Euler's method, if its own is RK4."""
    return dataclasses.replace(case, integrator="Euler") if case.resolved.integrator == "RK4" else case


def _with(law: Component, names: Sequence[str], values: Sequence[float]) -> Component:
    """Return the law with other gains, without a warning for violated conditions of its theorem."""
    return dataclasses.replace(law, gains=dict(law.gains) | dict(zip(names, values, strict=True)))


def _search(ledger: _Ledger, start: search_space.Box, seed: int) -> search_space.Box:
    """Spend the budget, and return the bounds at the end."""
    random, box = np.random.default_rng(seed), start
    members = _hypercube(box, random)
    with contextlib.suppress(_Spent):
        for stage in itertools.count(STAGE, STAGE):
            while len(ledger.evaluations) < stage:
                members = _evolve(ledger, box, members, random, until=stage)
            ledger.decide(stage)
            sides = search_space.at_bound(dict(zip(ledger.names, ledger.best.gains, strict=True)), box)
            if sides := search_space.movable(ledger.cases[0].law, sides):
                box = search_space.widened(box, sides)
                members[MEMBERS // 2 :] = _hypercube(box, random)[MEMBERS // 2 :]  # else they crowd at the old bound
    ledger.decide(ledger.budget)
    return box


def _evolve(
    ledger: _Ledger, box: search_space.Box, members: np.ndarray, random: np.random.Generator, until: int
) -> np.ndarray:
    """Evolve the members up to `until` evaluations, and return them; a new population if it has collapsed."""
    from scipy.optimize import differential_evolution

    result = differential_evolution(
        ledger.costs,
        [(low, high) for low, high in np.log10(list(box.values()))],
        strategy="best1bin",
        init=members,  # pyright: ignore[reportArgumentType]
        tol=0.0,
        mutation=DITHER,
        maxiter=100,
        rng=random,
        vectorized=True,
        updating="deferred",
        polish=False,
        callback=lambda intermediate_result: len(ledger.evaluations) >= until,
    )
    return result.population if len(ledger.evaluations) >= until else _hypercube(box, random)


def _hypercube(box: search_space.Box, random: np.random.Generator) -> np.ndarray:
    """Return log10 gains of a first population, (members, gains): the middle of the box, and a Latin hypercube."""
    from scipy.stats.qmc import LatinHypercube

    low, high = np.log10(list(box.values())).T
    unit = LatinHypercube(len(low), rng=random).random(MEMBERS)
    unit[0] = 0.5
    return low + (high - low) * unit
