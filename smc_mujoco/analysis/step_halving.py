"""Whether a number depends on the physics step: the same run at half the step, and from a start
nudged by 1e-9.

A number is marked where its values in these runs are apart by the rule of `analysis.apart`: under
an integrator of first order half the step has half of the error, so there 2.5 % are enough. The
rule holds for every number of scenes, boards and tables of chattering. Boards, whose runs start in
many places, repeat them at half the step only, and compare medians.

`smc.fidelity.step_halving([trace])[0].marked` says it of the limit cycle of a run, and takes two
more runs. A number without the mark may still depend on the step.
"""

import dataclasses
from collections.abc import Sequence

from smc_mujoco.analysis.apart import MAX_CHANGE, relative_range
from smc_mujoco.metrics.limit_cycle import channel_cycle, largest_cycle
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

MARK = "*"  # behind a number that depends on the step
NUDGE = 1e-9  # of its start, by which a run is moved to see whether it wanders
# at half the step, see `analysis.apart`
APART = f"{100.0 * MAX_CHANGE:g} % ({50.0 * MAX_CHANGE:g} % without RK4)"
NUDGED = (
    f"changes by more than {APART} at half the physics step, or by more than "
    f"{100.0 * MAX_CHANGE:g} % "
    f"from a start moved by {NUDGE:g} of itself"
)
SCORE_NOTE = f"{MARK} {NUDGED}: the smallest and the largest value"
NOTE = (
    f"{MARK} half the physics step changes it by more than {APART}, or a nudged start by "
    f"{100.0 * MAX_CHANGE:g} %"
)
UNTRIED = (
    "with friction, contacts or other parts, and without RK4, half the physics step may change "
    "numbers by more than "
    f"{100.0 * MAX_CHANGE:g} %: these runs were not repeated with it"
)


@dataclasses.dataclass(frozen=True)
class StepChange:
    """Relative changes of a run's limit cycle of s, see `relative_range`; inf if only some of the
    runs have a cycle.
    """

    amplitude: float
    frequency: float

    @property
    def marked(self) -> bool:
        """Whether the amplitude or the frequency depends on the step, by the rule of
        `analysis.apart`.
        """
        return max(self.amplitude, self.frequency) > MAX_CHANGE


def repeats_all(scenario: Scenario) -> bool:
    """Return whether a study repeats every such run at half the step: constraints may act, or it is
    not under RK4.
    """
    return scenario.realistic or first_order(scenario)


def first_order(scenario: Scenario) -> bool:
    """Return whether the integrator of a scenario is of first order: any but RK4."""
    return scenario.resolved.integrator != "RK4"


def halved(scenario: Scenario) -> Scenario:
    """Return the same scenario at half its physics step.

    Raise ScenarioError if that is too short.
    """
    return dataclasses.replace(scenario, physics_step=0.5 * scenario.resolved.physics_step)


def nudged(scenario: Scenario) -> Scenario:
    """Return the same scenario from a start that is moved by 1e-9 of itself."""
    return dataclasses.replace(scenario, x0=tuple((1.0 + NUDGE) * x for x in scenario.resolved.x0))


def step_halving(
    traces: Sequence[Trace], channel: int | None = None, threads: int | None = None
) -> list[StepChange]:
    """Return how the limit cycle of each run changes at half the physics step, and from a nudged
    start.

    Args:
      traces: the runs, each of which is repeated twice.
      channel: the one whose s is compared. Default: that with the largest limit cycle.
      threads: as in `run`.
    """
    again = run(
        [change(trace.scenario) for trace in traces for change in (halved, nudged)], threads=threads
    )

    def cycle(trace: Trace) -> tuple[float, float]:
        if channel is None:
            return largest_cycle(trace)
        return channel_cycle(trace, channel)

    several = zip(traces, again[::2], again[1::2], strict=True)
    changes = []
    for same in several:
        order = first_order(same[0].scenario)
        changes.append(
            StepChange(
                *(relative_range(one, 0.0, order) for one in zip(*map(cycle, same), strict=True))
            )
        )
    return changes
