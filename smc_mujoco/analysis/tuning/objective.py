"""What tuning minimises: tracking error plus effort, summed over the conditions that a law must cope with.

    J = sum over the conditions of  ITAE / sum |x0|  +  w TV / (u_max duration)        in s^2

ITAE is that of `metrics`, summed over the channels as the |x0| are; TV is the total variation of u, worst channel. A
command that swings from bound to bound at every sample has TV / (u_max duration) = 2 / h, h the control period. The
weight is w = h times 1 s^2 = 1e-3 s^3, chosen so that a run which chatters like that pays 2 s^2: as much as one that
stands at x0 for its first 2 s. Without it ("tracking", w = 0), nothing speaks against chattering.

The conditions are those in which laws are ranked afterwards: nominal, noisy, delayed, disturbed by a sine and by a
constant, and with a mass that is 30 % less and 30 % more than the law's gains were meant for. Every run of them has a
seed, a noise and a start (`initial_states`) that no grid takes, so no law is judged on runs that it was tuned on.

A run that fails has no ITAE. It costs FAILED (2 - t / duration), t the time of its failure. This is finite, more than
any run costs that does not fail, and less the later it fails.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics import catalogue as metrics
from smc_mujoco.simulation.conditions import NAMED, Condition, find_condition
from smc_mujoco.simulation.grid import CONTROL_PERIOD
from smc_mujoco.simulation.initial_states import SEEDS, Starts
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

DURATION = 5.0  # s, chosen: half the study's, 8 T and more of its plants; settled runs add little after it
CONDITIONS = tuple(NAMED[n] for n in ("nominal", "noise", "delay_10ms", "sine", "constant", "light", "heavy"))
AROUND = Starts()
RUNS = 1000  # seeds of runs that a seed of tuning has: one a condition
FAILED = 1e9  # s^2; a run fails beyond |x| = 1e6, so ITAE / |x0| is less for any |x0| > 0.05, and is cut there


@dataclasses.dataclass(frozen=True, kw_only=True)
class Objective:
    """J as data; two tunings are comparable only if theirs are equal.

    Attributes:
      conditions: names, or conditions of your own; each is one run of a candidate.
      starts: where its runs begin, see `starts`.
      weight: w, s^3.
      duration: of a run, s.
      control_period: s.
      u_max: bound on |u|, the same for every law, N or N m. Default, as in a grid: 6, or what the strongest motor gives
        where the plant is a model of yours.

    Raises:
      ScenarioError: an unknown condition, or a number out of its range.
    """

    conditions: tuple[Condition, ...] = CONDITIONS
    starts: Starts = AROUND
    weight: float = 1e-3
    duration: float = DURATION
    control_period: float = CONTROL_PERIOD
    u_max: float | None = None

    def __post_init__(self):
        conditions = self.conditions if isinstance(self.conditions, tuple | list) else (self.conditions,)
        if not 0 < len(conditions) <= RUNS:
            raise ScenarioError(f"conditions is {shown(self.conditions)}: give names, such as ('nominal', 'noise')")
        object.__setattr__(self, "conditions", tuple(map(find_condition, conditions)))
        if not isinstance(self.starts, Starts):
            raise ScenarioError(f"starts is {shown(self.starts)}: give smc.starts(...)")
        number("weight", self.weight, least=0.0)
        for name in ("duration", "control_period", "u_max"):
            if getattr(self, name) is not None:
                number(name, getattr(self, name), above=0.0)

    def __str__(self) -> str:
        terms = f"ITAE/|x0| + {self.weight:g} TV/(u_max {self.duration:g} s)"
        bound = "" if self.u_max is None else f", |u| <= {self.u_max:g}"
        return f"sum over {', '.join(one.name for one in self.conditions)} of {terms}{bound}"

    def describe(self) -> dict[str, Any]:
        """Return it as JSON data, from which `restore` makes it again."""
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return values | {"conditions": list(map(str, self.conditions)), "starts": dataclasses.asdict(self.starts)}

    def scenarios(self, plant: Plant | str, law: Component, seed: int) -> list[Scenario]:
        """Return one run for each condition; every candidate has the same starts and the same noise.

        Raises:
          ScenarioError: a condition in which the plant starts at 0.
        """
        common = {name: getattr(self, name) for name in ("duration", "control_period", "u_max")}
        first = Scenario(plant=plant, law=law, **common)
        fields = [one.on(first.plant, self.duration) for one in self.conditions]
        for one, conditioned in zip(self.conditions, fields, strict=True):
            self.starts.check_condition(one.name, conditioned)
        cases = [dataclasses.replace(first, **conditioned) for conditioned in fields]
        placed = [self.starts.place(case, SEEDS + RUNS * seed + i) for i, case in enumerate(cases)]
        for one, case in zip(self.conditions, placed, strict=True):
            if not any(case.resolved.x0):
                cure = "say where its runs begin, with starts=smc.starts(x0=0.5) or --x0 0.5"
                raise ScenarioError(
                    f"{case.plant.name} starts at 0 under {one.name!r}, where a law has nothing to do: {cure}"
                )
        return placed

    def terms(self, traces: list[Trace]) -> tuple[float, float]:
        """Return tracking and variation of a candidate's runs, each summed; J = tracking + weight variation."""
        parts = [self.parts(trace) for trace in traces]
        return sum(tracking for tracking, _ in parts), sum(variation for _, variation in parts)

    def parts(self, trace: Trace) -> tuple[float, float]:
        """Return ITAE / sum |x0| in s^2 and TV / (u_max duration) in 1/s; for a failed run its price, and 0."""
        if trace.diverged_at is not None:
            return FAILED * (2.0 - min(trace.diverged_at / self.duration, 1.0)), 0.0
        start = float(np.abs(trace.x[0]).sum())
        tracking = min(metrics.itae(trace) / start, FAILED)
        bound = trace.scenario.resolved.u_max if self.u_max is None else self.u_max
        return tracking, metrics.tv(trace) / (bound * self.duration)


def restore(data: Mapping[str, Any]) -> Objective:
    """Return the objective that `Objective.describe` wrote; old files have no starts, and so the default ones."""
    starts = dict(data.get("starts", {}))
    if starts.get("x0") is not None:
        starts["x0"] = tuple(starts["x0"])
    return Objective(**dict(data) | {"conditions": tuple(data["conditions"]), "starts": Starts(**starts)})


OBJECTIVES = {"balanced": Objective(), "tracking": Objective(weight=0.0)}
