"""What tuning minimises: tracking error plus effort, over several conditions of the paper's study.

    J = sum over the conditions of  ITAE / sum |x0|  +  w TV / (u_max duration)        in s^2

ITAE is that of `metrics`, summed over the channels as the |x0| are; TV is the total variation of u, worst channel. A
command that swings from bound to bound at every sample has TV / (u_max duration) = 2 / h, h the control period. The
weight is w = h times 1 s^2 = 1e-3 s^3, chosen so that a run which chatters like that pays 2 s^2: as much as one that
stands at x0 for its first 2 s. Without it ("tracking", w = 0), nothing speaks against chattering.

A run that fails has no ITAE. It costs FAILED (2 - t / duration), t the time of its failure: finite, more than any run
that does not fail, and less the later it fails.
"""

import dataclasses
import functools

import numpy as np

from smc_mujoco import metrics, paper
from smc_mujoco.component import Component
from smc_mujoco.errors import ScenarioError, find, number, shown
from smc_mujoco.plant import Plant
from smc_mujoco.scenario import Scenario
from smc_mujoco.trace import Trace

DURATION = 5.0  # s, chosen: half the study's, 8 T and more of its plants; settled runs add little after it
FAILED = 1e9  # s^2; a run fails beyond |x| = 1e6, so ITAE / |x0| is less for any |x0| > 0.05, and is cut there


@dataclasses.dataclass(frozen=True, kw_only=True)
class Objective:
    """J as data; two tunings are comparable only if theirs are equal.

    Attributes:
      conditions: names of conditions of the paper's study; each is one run of a candidate.
      weight: w, s^3.
      duration: of a run, s.
      control_period: s.
      u_max: bound on |u| of every law, N or N m.

    Raises:
      ScenarioError: an unknown condition, or a number out of its range.
    """

    conditions: tuple[str, ...] = ("nominal", "noise", "delay_10ms")
    weight: float = 1e-3
    duration: float = DURATION
    control_period: float = paper.CONTROL_PERIOD
    u_max: float = paper.U_MAX

    def __post_init__(self):
        if isinstance(self.conditions, str) or not self.conditions:
            raise ScenarioError(f"conditions is {shown(self.conditions)}: give names, such as ('nominal', 'noise')")
        object.__setattr__(self, "conditions", tuple(self.conditions))
        for name in self.conditions:
            find("condition of the paper's study", name, paper.CONDITIONS)
        number("weight", self.weight, least=0.0)
        for name in ("duration", "control_period", "u_max"):
            number(name, getattr(self, name), above=0.0)

    def __str__(self) -> str:
        terms = f"ITAE/|x0| + {self.weight:g} TV/(u_max {self.duration:g} s)"
        return f"sum over {', '.join(self.conditions)} of {terms}, |u| <= {self.u_max:g}"

    def scenarios(self, plant: Plant | str, law: Component, seed: int) -> list[Scenario]:
        """One run for each condition; every candidate sees the same noise."""
        common = {name: getattr(self, name) for name in ("duration", "control_period", "u_max")}
        first = Scenario(plant=plant, law=law, seed=seed, **common)
        plant = first.plant.name
        return [dataclasses.replace(first, **paper.fields(name, plant, self.duration)) for name in self.conditions]

    def terms(self, traces: list[Trace]) -> tuple[float, float]:
        """Tracking and variation of a candidate's runs, each summed over them; J = tracking + weight variation."""
        parts = [self.parts(trace) for trace in traces]
        return sum(tracking for tracking, _ in parts), sum(variation for _, variation in parts)

    def parts(self, trace: Trace) -> tuple[float, float]:
        """ITAE / sum |x0| in s^2, and TV / (u_max duration) in 1/s; of a failed run its price, and 0."""
        if trace.diverged_at is not None:
            return FAILED * (2.0 - min(trace.diverged_at / self.duration, 1.0)), 0.0
        start = float(np.abs(trace.x[0]).sum())
        tracking = min(metrics.itae(trace) / start, FAILED)
        return tracking, metrics.tv(trace) / (self.u_max * self.duration)


@functools.cache
def catalogue() -> dict[str, Objective]:
    """Objectives by name."""
    return {"balanced": Objective(), "tracking": Objective(weight=0.0)}


def objective(given: object) -> Objective:
    """An Objective, as given or by its name.

    Raises:
      ScenarioError: neither.
    """
    return given if isinstance(given, Objective) else find("objective", given, catalogue())
