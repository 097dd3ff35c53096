"""The objective of tuning: tracking error plus variation of the command, summed over several
conditions.

    J = sum over the conditions of  ITAE / sum |x0|  +  w TV / (u_max duration)        in s^2

ITAE is that of `metrics`, summed over the channels like |x0|. TV is the total variation of u, worst
channel. A command that jumps from bound to bound at every sample has TV / (u_max duration) = 2 / h,
with h the control period. The weight is w = h times 1 s^2 = 1e-3 s^3, chosen so that such
chattering costs 2 s^2, as much as a run that stays at x0 for its first 2 s. Without it ("tracking",
w = 0), chattering costs nothing.

Of a free body ITAE / sum |x0| is added up over position and attitude, with |x0| the distance from
the reference at the start, and 1 m or 1 rad where that is 0; TV / u_max is that of its worst force
or torque, each over its own bound. Where tilt follows from the force, only the heading counts.

The conditions are those in which laws are ranked: nominal, noise, delay, a sine and a constant
disturbance, and 30 % less and 30 % more mass. Their runs have seeds, noise and initial states that
no grid uses, so no law is judged on runs that it was tuned on. `evaluator.objectives` computes J on
instances that no search has seen either.

A failed run has no ITAE. It costs FAILURE_COST (2 - t / duration), with t the time of the failure.
This is more than any other run costs, and decreases with t. With a bound on predicted chattering,
gains beyond it cost more than that. A run that breaks a limit costs less, but more than any that
keeps it, see `run_limits`.
"""

import dataclasses
import functools
from collections.abc import Iterator, Sequence
from typing import Annotated, NamedTuple

import numpy as np

from smc_mujoco.analysis import step_halving
from smc_mujoco.analysis.tuning.run_limits import RunLimit
from smc_mujoco.common import annexes
from smc_mujoco.common.aliases import Array, ArrayPair, Data, Fields, Floats, Pair
from smc_mujoco.common.constraints import Natural, Positive, Whole, constrain
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.rotation import pose_errors
from smc_mujoco.metrics import catalogue as metrics
from smc_mujoco.metrics.conventions import settles_in_time
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import CONTROL_PERIOD, NAMED, Condition
from smc_mujoco.simulation.grid import (
    GRID_SEEDS,
    START_CURE,
    Starts,
    checked_starts,
    listed_conditions,
)
from smc_mujoco.simulation.run import run_unjudged
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

# s, chosen: half the study's, at least 8 T of its plants; settled runs add little later
DURATION = 5.0
CONDITIONS = tuple(
    NAMED[n] for n in ("nominal", "noise", "delay_10ms", "sine", "constant", "light", "heavy")
)
DEFAULT_STARTS = Starts()
SEEDS_PER_SEARCH = 1000  # each condition uses one of them
# of a tuning: with 12, 12 runs of two laws decide between them, see `ranking`
SEARCHES = 12
MAX_SEARCHES = 1000
BUDGET, MAX_BUDGET = 64, 10_000  # evaluations of a search, for each gain
Searches = Annotated[int, Whole(low=1, high=MAX_SEARCHES)]
Budget = Annotated[int, Whole(low=1, high=MAX_BUDGET)]
MAX_TUNING_SEED = 10**9
HOLDOUT = MAX_SEARCHES * (MAX_TUNING_SEED + 1)  # instances from this one on belong to no search
# s^2, also the cap of ITAE / |x0|, reached without a failure only from |x0| < 0.05
FAILURE_COST = 1e9
MAX_PLACED = 64  # instances whose runs are kept for further laws; chosen


class Evaluation(NamedTuple):
    """One set of gains, in the order of `Tuned.bounds`:

    J = tracking + weight variation + `Objective.excess`.
    """

    gains: Floats
    objective: float
    tracking: float
    variation: float

    @property
    def failed(self) -> bool:
        """Whether one of its runs failed."""
        return self.tracking >= FAILURE_COST


@keyword_dataclass
class Objective:
    """J as data. Tunings can be compared only if their objectives are equal.

    `chattering` bounds the predicted amplitude of the limit cycle of s of the first channel, in its
    unit, in the first condition, see `smc.design.chattering`. None: chattering costs its variation
    only.
    """

    # names, or your own; each is one run of a candidate
    conditions: tuple[Condition, ...] = CONDITIONS
    starts: Starts = DEFAULT_STARTS  # initial states of the runs
    weight: Natural = 1e-3  # w, s^3
    duration: Positive = DURATION  # of a run, s
    control_period: Positive = CONTROL_PERIOD  # s
    # bound on |u|, the same for every law, N or N m; default: as in a grid
    u_max: Positive | None = None
    chattering: Positive | None = None
    limits: tuple[RunLimit, ...] = ()  # what every run must keep

    def __post_init__(self):
        conditions = listed_conditions(self.conditions)
        if not 0 < len(conditions) <= SEEDS_PER_SEARCH:
            raise ScenarioError(
                f"conditions is {shown(self.conditions)}: give names, such as ('nominal', 'noise')"
            )
        object.__setattr__(self, "conditions", tuple(conditions))
        checked_starts(self.starts)
        constrain(self)

    def __str__(self) -> str:
        conditions = ", ".join(condition.name for condition in self.conditions)
        bound = ""
        if self.u_max is not None:
            bound += f", u_max = {self.u_max:g}"
        if self.chattering is not None:
            bound += f", predicted chattering of s <= {self.chattering:g}"
        for limit in self.limits:
            bound += f", {limit}"
        return (
            f"sum over {conditions} of ITAE/|x0| + {self.weight:g} TV/(u_max {self.duration:g} s)"
            f"{bound}"
        )

    def describe(self) -> Fields:
        """Return it as JSON data, from which `restored_objective` makes an equal one."""
        values = {}
        for f in dataclasses.fields(self):
            values[f.name] = getattr(self, f.name)
        limits = [dataclasses.asdict(limit) for limit in values.pop("limits")]
        values |= {
            "conditions": [condition.text(files=False) for condition in self.conditions],
            "starts": dataclasses.asdict(self.starts),
        }
        return values | ({"limits": limits} if limits else {})

    def scenarios(
        self,
        plant: Plant | str,
        law: Component,
        seed: int = 0,
        search: int = 0,
        count: int | None = None,
    ) -> list[Scenario]:
        """Return one run for each condition, or for the first ones, of a search of a tuning with
        this seed.

        Every candidate of a search gets the same initial states and the same noise, those of other
        searches get others.
        """
        return self._instance(plant, law, MAX_SEARCHES * seed + search, count)

    def _instance(
        self, plant: Plant | str, law: Component, number: int, count: int | None
    ) -> list[Scenario]:
        common = {}
        for name in ("duration", "control_period", "u_max"):
            common[name] = getattr(self, name)
        first = Scenario(plant=plant, law=law, **common)
        fields = []
        conditions = self.conditions[:count]
        for part in conditions:
            fields.append(part.on(first.plant, self.duration))
        cases = []
        for i, (condition, changes) in enumerate(zip(conditions, fields, strict=True)):
            self.starts.check_condition(condition.name, changes)
            case = self.starts.place(
                dataclasses.replace(first, **changes), GRID_SEEDS + SEEDS_PER_SEARCH * number + i
            )
            if case.resolved.x0 == case.plant.origin:
                where = (
                    f"starts at its goal under {condition.name!r}, where a law has nothing to do"
                )
                raise ScenarioError(f"{case.plant.name} {where}: {START_CURE}")
            if case.tracks == "speed":
                raise ScenarioError(
                    f"condition {condition.name!r} tracks a speed, and tuning counts errors of "
                    "positions: give the law's gains, and tune=False to compare"
                )
            cases.append(case)
        return cases

    def evaluation(self, case: Scenario, traces: list[Trace], gains: Floats = ()) -> Evaluation:
        """Return the evaluation of a candidate, given its first case and the traces of all."""
        terms = zip(*map(self.terms_of_run, traces), strict=True)
        tracking, variation = map(sum, terms)
        cost = tracking + self.weight * variation + self.excess(case)
        return Evaluation(gains, float(cost), float(tracking), float(variation))

    def terms_of_run(self, trace: Trace) -> Pair:
        """Return ITAE / sum |x0| in s^2 and TV / (u_max duration) in 1/s; for a failed run its
        cost, and 0.
        """
        if trace.diverged_at is not None:
            return self.terms_of_failure(trace.diverged_at)
        if trace.scenario.plant.pose:
            return self.terms_of_pose(trace.scenario, trace.x, trace.r, trace.u)
        case = trace.scenario
        if metrics.CATALOGUE["tv"].refusal(case):  # each channel over its own bound
            room = np.array(case.limits) * self.duration
            shares = metrics.TV.channels(trace.t, trace.u) / room
            tracking, _ = self.terms_of_sums(
                case, metrics.itae(trace), np.abs(trace.x[0]).sum(), 0.0
            )
            return tracking + self.cost_of_limits(case, trace.x, trace.u), float(shares.max())
        tracking, variation = self.terms_of_sums(
            case, metrics.itae(trace), np.abs(trace.x[0]).sum(), metrics.tv(trace)
        )
        return tracking + self.cost_of_limits(case, trace.x, trace.u), variation

    def cost_of_limits(self, case: Scenario, x: Array, u: Array) -> float:
        """Return what a run costs that breaks limits, s^2, given x and u, (K + 1, n) each."""
        return sum(limit.cost(case, x, u) for limit in self.limits)

    def terms_of_sums(self, case: Scenario, itae: float, start: float, tv: float) -> Pair:
        """Return the terms of a run with this ITAE, sum |x0| and TV; x0 of a user's model counts
        from its goal.
        """
        if any(case.plant.origin):
            off = np.subtract(case.resolved.x0, case.plant.origin)
            start = float(np.abs(off).sum())
        if self.u_max is None:
            bound = float(np.max(case.resolved.u_max))
        else:
            bound = self.u_max
        return min(itae / start, FAILURE_COST), tv / (bound * self.duration)

    def terms_of_pose(self, case: Scenario, x: Array, r: Array, u: Array) -> Pair:
        """Return the terms of a run of a free body, from its log, (K + 1, 6) each; NaN where the
        log has one.
        """
        e = np.abs(pose_errors(x, r))
        t = case.control_period * np.arange(len(x))
        turns = [i for i in case.plant.scored_channels if i >= 3]
        of_place = e[:, :3].sum(axis=1)
        of_turn = e[:, turns].sum(axis=1)
        parts = of_place, of_turn
        tracking = sum(metrics.ITAE.of(t, part[:, None]) / (part[0] or 1.0) for part in parts)
        room = np.array(case.limits) * self.duration
        variation = metrics.TV.channels(t, u) / room
        return min(float(tracking), FAILURE_COST), float(variation.max())

    def terms_of_failure(self, time: float) -> Pair:
        """Return the terms of a run that fails at a time, s."""
        return FAILURE_COST * (2.0 - min(time / self.duration, 1.0)), 0.0

    def holdout(
        self, plant: Plant | str, law: Component, instance: int, count: int | None = None
    ) -> list[Scenario]:
        """Return one run for each condition, or for the first ones, of an instance 0, 1, ... that
        no search uses.
        """
        return self._instance(plant, law, HOLDOUT + instance, count)

    def excess(self, case: Scenario) -> float:
        """Return what predicted chattering costs, s^2: 0 up to the bound, above it in proportion to
        the amplitude.
        """
        if self.chattering is None:
            return 0.0
        what = "a bound on predicted chattering"
        prediction = annexes.module("smc_mujoco.chattering.prediction", what)
        cycle = prediction.predict(case, ranges=False)
        # the largest possible if none is predicted
        if cycle:
            amplitude = cycle.amplitude
        else:
            amplitude = cycle.amplitude_range[1]
        if not amplitude > self.chattering:
            return 0.0
        return 2.0 * FAILURE_COST * len(self.conditions) * amplitude / self.chattering


def restored_objective(data: Data) -> Objective:
    """Return the objective that `Objective.describe` wrote. No file that it names is run."""
    for text in data["conditions"]:
        if ".py:" in text:
            raise ScenarioError(f"condition {shown(text)} names a file, and a record runs none")
    starts = dict(data.get("starts", {}))
    if starts.get("x0") is not None:
        starts["x0"] = tuple(starts["x0"])
    limits = tuple(RunLimit(**limit) for limit in data.get("limits", ()))
    return Objective(
        **dict(data)
        | {"conditions": tuple(data["conditions"]), "starts": Starts(**starts), "limits": limits}
    )


OBJECTIVES = {"balanced": Objective(), "tracking": Objective(weight=0.0)}


def objectives(
    plant: Plant | str,
    laws: Sequence[Component],
    goal: Objective = OBJECTIVES["balanced"],
    instances: Sequence[int] | None = None,
    threads: int | None = None,
    halved: bool = False,
    doubled: bool = False,
) -> ArrayPair:
    """Return J of laws on instances that no search has seen, (laws,), s^2, computed by MuJoCo, and
    whether all runs of an instance have arrived, (laws,).

    Args:
      laws: with their gains. Law i runs on instance i: its own starts and noise, one run for each
        condition.
      instances: numbers of the instances, in place of 0, 1, ...
      threads: as in `run`.
      doubled: whether the runs have twice their physics step where they may, see
        `step_halving.doubled`.
      halved: whether the runs have half their physics step, or half of the doubled one.
    """
    costs = []
    arrived = []
    for cases, runs in _unseen(plant, laws, goal, instances, threads, halved, doubled):
        costs.append(goal.evaluation(cases[0], runs).objective)
        arrived.append(all(map(metrics.arrived, runs)))
    return np.array(costs), np.array(arrived)


def weighed(
    plant: Plant, law: Component, goal: Objective, instances: Sequence[int], threads: int | None
) -> ArrayPair:
    """Return what each run adds to J of a law, tracking and variation, s^2, and whether it settles,
    (instances, conditions) each, on instances that no search has seen, at twice the physics step
    where they may have it.
    """
    costs = []
    settled = []
    for _, runs in _unseen(plant, [law] * len(instances), goal, instances, threads, doubled=True):
        terms = np.array(list(map(goal.terms_of_run, runs)))
        costs.append(terms @ (1.0, goal.weight))
        settled.append(list(map(_settles, runs)))
    return np.array(costs), np.array(settled)


def _settles(trace: Trace) -> bool:
    """Return whether a run does not fail and settles in time."""
    if trace.failure is not None or trace.diverged_at is not None:
        return False
    return bool(settles_in_time(metrics.settling_time(trace), trace.scenario.duration))


@functools.lru_cache(maxsize=MAX_PLACED)
def _placed(plant: Plant | str, goal: Objective, number: int) -> list[Scenario]:
    """Return the runs of an instance, which are the same for every law but for the law: most of the
    time that a run's making takes is that of its start and its condition.
    """
    return goal.holdout(plant, coerce.coerced_law("none"), number)


def _unseen(
    plant: Plant | str,
    laws: Sequence[Component],
    goal: Objective,
    instances: Sequence[int] | None,
    threads: int | None,
    halved: bool = False,
    doubled: bool = False,
) -> Iterator[tuple[list[Scenario], list[Trace]]]:
    """Yield the runs of each law on its instance, one for each condition. Arguments as in
    `objectives`.
    """
    if instances is None:
        numbers = range(len(laws))
    else:
        numbers = instances
    if len(numbers) != len(laws):
        raise ScenarioError(
            f"{len(laws)} laws and {len(numbers)} instances: give an instance for each law"
        )
    cases = []
    for law, number in zip(laws, numbers, strict=True):
        for case in _placed(plant, goal, number):
            cases.append(dataclasses.replace(case, law=law))
    if doubled:
        cases = list(map(step_halving.doubled, cases))
    if halved:
        cases = list(map(step_halving.halved, cases))
    traces = run_unjudged(cases, threads)
    count = len(goal.conditions)
    for first in range(0, len(cases), count):
        yield cases[first : first + count], traces[first : first + count]
