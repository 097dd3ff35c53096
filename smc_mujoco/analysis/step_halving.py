"""Whether a number depends on the physics step: the same run at half the step, and from a start
nudged by 1e-9; if its command chatters, at a quarter of the step too; with contacts, under RK4 too.

A number is marked where its values in these runs are apart by the rule of `analysis.differ`: under
an integrator of first order half the step has half of the error, so there 2.5 % are enough. The
rule holds for every number of scenes, boards and tables of chattering. Boards, whose runs start in
many places, repeat them at half the step only, and compare medians.

`smc.accuracy.step_halving([trace])[0].marked` says it of the limit cycle of a run, and takes two to
four more runs. A number without the mark may still depend on the step, and the range beside a mark
need not hold the truth: docs/design.md says how often.
"""

import contextlib
import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from smc_mujoco.analysis.differ import MAX_CHANGE, relative_range
from smc_mujoco.common.errors import ScenarioError, items_of, shown, whole
from smc_mujoco.common.text import number
from smc_mujoco.metrics.conventions import last_part
from smc_mujoco.metrics.limit_cycle import channel_cycle, largest_cycle
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

RANGE = "the true value may lie outside the range"
MARK = "*"  # behind a number that depends on the step
CHATTERS = 10.0  # 1/s: variation of a command a second over its bound, from which it chatters
NUDGE = 1e-9  # of its start, by which a run is moved to see whether it wanders
# at half the step, see `analysis.differ`
APART = f"{100.0 * MAX_CHANGE:g} % ({50.0 * MAX_CHANGE:g} % without RK4)"
NOTE = (
    f"{MARK} marks a value that changes by more than {APART} at half the physics step, or by more "
    f"than {100.0 * MAX_CHANGE:g} % at a quarter of it, under RK4, or from an initial position "
    f"changed by {number(NUDGE)} of its value"
)
SCORE_NOTE = f"{NOTE}. The smallest value is shown, with the largest in brackets; {RANGE}"
UNTRIED = (
    "these runs were not repeated with half the physics step. If the condition or the model has "
    "friction, contact, a motor, an encoder or other such hardware, or if the integrator is not "
    f"RK4, half the step may change values by more than {100.0 * MAX_CHANGE:g} %"
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
        `analysis.differ`.
        """
        return max(self.amplitude, self.frequency) > MAX_CHANGE


def repeats_every_run(scenario: Scenario) -> bool:
    """Return whether a study repeats every such run at half the step: constraints may act, or it is
    not under RK4.
    """
    return scenario.realistic or first_order(scenario)


def first_order(scenario: Scenario) -> bool:
    """Return whether a scenario is simulated to first order: by any integrator but RK4, and of a
    user's model where constraints may act.
    """
    if scenario.resolved.integrator != "RK4":
        return True
    exact = scenario.plain_equation or scenario.exact_friction
    return scenario.plant.is_user_model and not exact


def halved(scenario: Scenario) -> Scenario:
    """Return the same scenario at half its physics step.

    Raise ScenarioError if that is too short.
    """
    return dataclasses.replace(scenario, physics_step=0.5 * scenario.resolved.physics_step)


def doubled(scenario: Scenario) -> Scenario:
    """Return the same scenario at twice its physics step, if it runs under RK4 and that fits its
    control period, delay and clock; else itself. Stable poles stay stable, by the rule of the step.
    """
    step = 2.0 * scenario.resolved.physics_step
    if scenario.resolved.integrator != "RK4" or step > scenario.control_period:
        return scenario
    try:
        return dataclasses.replace(scenario, physics_step=step).named(scenario.condition)
    except ScenarioError:
        return scenario


def nudged(scenario: Scenario) -> Scenario:
    """Return the same scenario with each start position moved by 1e-9 of its distance from the
    plant's origin. A joint that starts there stays there.
    """
    places = zip(scenario.resolved.x0, scenario.plant.origin, strict=True)
    x0 = [r + (1.0 + NUDGE) * (x - r) for x, r in places]
    return dataclasses.replace(scenario, x0=tuple(x0))


def chatters(trace: Trace) -> bool:
    """Return whether the command of a run chatters in the last part: its variation a second is more
    than 10 times its bound.
    """
    scenario = trace.scenario
    part = last_part(trace)
    u = trace.applied if scenario.plant.pose else trace.u
    bounds = np.array(scenario.limits)
    changes = np.diff(u[part, : bounds.size], axis=0)
    steps = np.abs(changes).sum(axis=0)
    largest = CHATTERS * bounds * np.ptp(trace.t[part])
    return bool(np.any(steps > largest))


def repetitions(trace: Trace) -> list[Scenario]:
    """Return the scenarios of the runs by which the numbers of a run are marked: at half the step,
    from a nudged start, and those of the module's docstring.

    Raise ScenarioError if the step cannot be halved.
    """
    scenario = trace.scenario
    repeated = [halved(scenario), nudged(scenario)]
    if chatters(trace):
        with contextlib.suppress(ScenarioError):  # the step is too short for a quarter
            repeated.append(halved(halved(scenario)))
    if scenario.contact and scenario.resolved.integrator != "RK4":
        step = scenario.resolved.physics_step
        with contextlib.suppress(ScenarioError):  # another part needs this integrator
            repeated.append(dataclasses.replace(scenario, integrator="RK4", physics_step=step))
    return repeated


def step_halving(
    traces: Sequence[Trace], channel: int | None = None, threads: int | None = None
) -> list[StepChange]:
    """Return how the limit cycle of each run changes in its `repetitions`.

        trace = smc.run(smc.Scenario(plant="duffing", law=smc.law("classical"), duration=1.0))
        print(smc.accuracy.step_halving([trace]))

    Args:
      traces: the runs, each of which is repeated two to four times.
      channel: the one whose s is compared. Default: that with the largest limit cycle.
      threads: as in `run`.

    Returns:
      A list of `StepChange`, one for each trace: relative changes of amplitude and frequency, 0
      also if no run has a limit cycle.
    """
    traces = items_of("traces", traces)
    for trace in traces:
        if not isinstance(trace, Trace):
            raise ScenarioError(f"traces has {shown(trace)}: give what smc.run returns")
        if channel is not None:
            last_channel = trace.scenario.plant.n - 1
            channel = whole("channel", channel, 0, last_channel)
    scenarios = list(map(repetitions, traces))
    flat = list(itertools.chain(*scenarios))
    again = iter(run(flat, threads=threads))
    changes = []
    for trace, repeated in zip(traces, scenarios, strict=True):
        cycles = []
        for same in (trace, *itertools.islice(again, len(repeated))):
            cycle = largest_cycle(same) if channel is None else channel_cycle(same, channel)
            cycles.append(cycle)
        order = first_order(trace.scenario)
        amplitudes, frequencies = zip(*cycles, strict=True)
        changes.append(
            StepChange(
                relative_range(amplitudes, 0.0, order), relative_range(frequencies, 0.0, order)
            )
        )
    return changes
