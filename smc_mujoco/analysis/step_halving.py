"""Whether half the physics step changes the chattering of a run: the same runs with half the step.

`smc.fidelity.step_halving([trace])[0].marked` is True if half the step changes amplitude or frequency by more than
10 %.
It costs one more run of twice the steps for each trace. Nothing is run unless this is called. A number without the
mark may still depend on the step: of 69 cycles (5 plants, 8 laws, 8 mechanisms, seed 3, 4 s) that half the step changed
by at most 10 %, an eighth of the step changed 6 by more than 10 %, mostly with backlash.
"""

import dataclasses
import math
from collections.abc import Sequence

from smc_mujoco.metrics.limit_cycle import channel_cycle, largest_cycle
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

MARK = "*"  # behind such a number
MAX_SCORE_CHANGE = 0.05  # relative change of a score above which it is marked: chosen
NUDGE = 1e-9  # of its start, by which a run is moved to see whether it wanders
SCORE_NOTE = (
    f"{MARK} changes by more than {100 * MAX_SCORE_CHANGE:g} % at half the physics step, or from a start moved by "
    f"{NUDGE:g} of itself: the smallest and the largest value"
)
TOLERANCE = 0.1  # relative change of amplitude or frequency above which a number of chattering is marked: chosen
NOTE = f"{MARK} half the physics step changes it by more than {100.0 * TOLERANCE:g} %: give a shorter physics_step"
UNTRIED = (
    "chattering without RK4 was not compared with that of half the physics step, which may change it by more than "
    f"{100.0 * TOLERANCE:g} %: see step_halving"
)


@dataclasses.dataclass(frozen=True)
class StepChange:
    """Relative changes of a run's limit cycle of s with half the physics step; inf if only one run has a cycle."""

    amplitude: float
    frequency: float

    @property
    def marked(self) -> bool:
        """Whether the amplitude or the frequency changes by more than 10 %."""
        return max(self.amplitude, self.frequency) > TOLERANCE


def depends_on_step(scenario: Scenario) -> bool:
    """Return whether chattering may depend on the physics step: whether the integrator is not RK4."""
    return scenario.resolved.integrator != "RK4"


def repeats_all(scenario: Scenario) -> bool:
    """Return whether every run is repeated at half the step: the integrator is not RK4, or constraints may act."""
    return scenario.realistic or depends_on_step(scenario)


def halved(scenario: Scenario) -> Scenario:
    """Return the same scenario at half its physics step. Raise ScenarioError if that is too short."""
    return dataclasses.replace(scenario, physics_step=0.5 * scenario.resolved.physics_step)


def nudged(scenario: Scenario) -> Scenario:
    """Return the same scenario from a start that is moved by 1e-9 of itself."""
    return dataclasses.replace(scenario, x0=tuple((1.0 + NUDGE) * x for x in scenario.resolved.x0))


def apart(values: Sequence[float], least: float = 0.0) -> bool:
    """Return whether scores of a run and of the same run at half the step, or nudged, are more than 5 % apart.

    Values below `least` matter in no problem, see `paired_runs.floor`. NaN is a run without the score.
    """
    known = [max(abs(value), least) for value in values if not math.isnan(value)]
    return len(known) > 1 and max(known) > (1.0 + MAX_SCORE_CHANGE) * min(known)


def step_halving(traces: Sequence[Trace], channel: int | None = None, threads: int | None = None) -> list[StepChange]:
    """Return how half the physics step changes the limit cycle of each run.

    Args:
      traces: the runs, which are repeated with half their steps.
      channel: the one whose s is compared. Default: that with the largest limit cycle.
      threads: as in `run`.
    """
    scenarios = [trace.scenario for trace in traces]
    again = run([halved(one) for one in scenarios], threads=threads)

    def cycle(trace: Trace) -> tuple[float, float]:
        return largest_cycle(trace) if channel is None else channel_cycle(trace, channel)

    return [StepChange(*map(_change, cycle(one), cycle(other))) for one, other in zip(traces, again, strict=True)]


def _change(whole: float, half: float) -> float:
    if math.isnan(whole) or math.isnan(half):
        return 0.0 if math.isnan(whole) and math.isnan(half) else math.inf
    return abs(half / whole - 1.0)
