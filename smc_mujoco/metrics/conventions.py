"""Conventions of all metrics, the refusal of broken traces, and the decorator `@metric`.

Groups: a metric compares channels of one kind and one unit, a group of the plant's `groups`,
because metres and radians have no common maximum or sum. Driven channels and free joints, which
have no actuator, are different groups, even if their units agree. If a plant has several groups,
`score` and each metric return the worst group for a time, a percentage or a share of the motion: a
law that drops the pole has settled nothing. A metric with x's unit, or of the command, counts only
driven channels; if these have several units, a metric with x's or u's unit is refused. `scores`
returns every group by itself.

Of a measured base neither x nor y counts, unless the reference names a measured channel.

Of a free body a metric with x's or u's unit is of the position, and its u are the forces of its
actuators, N. Of the attitude only the heading counts where tilt follows from the force, as with
rotors that push one way.

Letters: t (K+1,) s, x (K+1, n) true position, r its reference, e = x - r, u the command, s the
law's sliding variable; h the time between samples. The conventions, all chosen, one for the whole
project:

- scale: the largest |e(0)| over the group's channels, or the largest peak-to-peak range of r over
  them if that is larger; 1 (rad or m) if both are zero. Percentages are percentages of the scale.
- settling band: |e| <= 2 % of the scale; of a run that starts within 15 standard deviations of the
  noise, 5 of them, as no law knows the error better.
- leaning: a joint of a user's model whose u stays at one bound for half of the last part, or whose
  base falls, has neither settled nor arrived.
- settled: the last exit counts, not the first entry. The time, since t[0], of the sample from which
  a signal stays in its band until the end; 0 if it never leaves the band; inf if its last sample is
  outside.
- arrived: in the last part |e| of every group is at most 10 % of its scale, or 5 times what its
  sensor tells apart if that is larger. Boards name no winner that has not arrived, and only a run
  that has arrived has metrics other than errors.
- travelling: r of a channel is a straight line throughout the last part and does not rest, as in a
  speed loop. Such a run has no settling time, and it arrives by its speed: |v - r'| is at most 10 %
  of the largest |r'|.
- tracked: with tracks="speed" of the scenario, x and r stand for x' and r' in all of this, and
  units of x for those of a speed.
- settled in time: settled before the last part. An oscillation that leaves the band again and again
  may be within it when the run ends, and then has a settling time. "settles" counts the runs that
  settle in time.
- last part: the last 20 % of the run, the samples with t >= t0 + 0.8 (tK - t0), at least one.
  Where disturbances and references have a period, it is the least number of whole periods that is
  as long: a piece of a period says where the run ends. If two such parts are more than 85 % of the
  run, the last part is the last 20 %, and no law wins by it.
- approach: the part of one channel's run towards one reference. It begins at t[0], and again at
  each sample at which r has jumped by more than the settling band; the side it comes from is the
  sign of e there.
- at rest: |v| <= 0.1 % of the group's largest |v|, or 1e-5 rad/s or m/s if that is larger. Joints
  held by Coulomb friction or contacts creep at 1e-6 or less. With LuGre friction they move as the
  bristles bend; there a joint sticks while these carry less than 99 % of what slides at its speed.
- slip: a control period in which friction never held a joint, after one in which it did. `held` of
  a trace says for how long it held. Where a trace has none, friction held for a control period if
  the joint is at rest at both its ends, with a reaction.
- after a turn: the 0.15 s after the sample from which r moves back, even if it rested between.
- channels: errors and efforts that are integrals over time are summed over the group's channels;
  every other metric takes its worst channel, so that it does not grow with n.
- commands are held between samples; states are not, their integrals use the trapezoid rule.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import itertools
import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, has, shown
from smc_mujoco.common.text import first_paragraph, joined, number
from smc_mujoco.mechanisms.custom.scales import falls
from smc_mujoco.mechanisms.plant import EFFORT, Plant
from smc_mujoco.metrics.fold import (
    LAST_PART,
    ROUNDING,
    Fold,
    after_turn,
    first_sample,
    judges_last_part,
    late_periods,
    slipped,
)
from smc_mujoco.simulation.python_functions import evaluate

if TYPE_CHECKING:
    from smc_mujoco.simulation.scenario import Scenario
    from smc_mujoco.simulation.trace import Trace

SETTLING_BAND = 0.02  # of the scale
# standard deviations of the noise; within so many a start tells no law where it is, chosen
NEAR_NOISE = 15.0
LEANS = 0.5  # of the last part, chosen: an honest law has left its bound by then
ARRIVAL_BAND = 0.1  # of the scale
ARRIVAL_COUNTS = 5.0  # of what the sensor tells apart
STRAIGHT = 1e-6  # of the steps of a reference: by less they differ on a straight line
# the law's; it follows from that of x, so that metres and radians do not mix
UNIT_OF_S = "unit of s"
REST_SHARE = 1e-3  # of the run's largest |v|
REST_SPEED = 1e-5  # rad/s or m/s: above the creep of stuck joints, see friction.py

CATALOGUE: dict[str, Metric] = {}  # filled by @metric, in order of definition


@keyword_dataclass
class ChannelGroup:
    """Channels of one kind and one unit."""

    name: str  # "driven" or "free"; "driven rad" if several groups are driven
    unit: str  # of their x, "rad" or "m"
    effort: str  # unit of their u: "N m", "N" or "V"; "" if they differ in it
    driven: bool  # whether they have actuators
    channels: tuple[int, ...]  # their indices, ascending

    @property
    def is_set_point(self) -> bool:
        """Whether their u is what a servo holds, and no force or voltage."""
        return self.effort.removesuffix("/s") == self.unit.removesuffix("/s")


def groups(machine: Plant | Scenario) -> tuple[ChannelGroup, ...]:
    """Return the groups of a plant, or of a scenario's plant, driven groups first.

    A scenario's u may be a voltage.
    """
    plant = machine if isinstance(machine, Plant) else machine.plant
    rate = "/s" if getattr(machine, "tracks", "") == "speed" else ""
    every_effort = machine.efforts
    members: dict[tuple[bool, str], list[int]] = {}
    for i, unit in enumerate(plant.units):
        members.setdefault((i < plant.driven, unit), []).append(i)
    kinds = [driven for driven, _ in members]
    channel_groups = []
    for (driven, unit), channels in members.items():
        name = "driven" if driven else "free"
        if kinds.count(driven) > 1:
            name += f" {unit}"
        efforts = {every_effort[i] for i in channels}
        effort = efforts.pop() if len(efforts) == 1 else ""
        channel_groups.append(
            ChannelGroup(
                name=name, unit=unit + rate, effort=effort, driven=driven, channels=tuple(channels)
            )
        )
    return tuple(channel_groups)


def reference_rates(trace: Trace) -> Array:
    """Return r' of all channels, (K+1, n); NaN where r is."""
    rates = np.where(np.isnan(trace.r), np.nan, 0.0)
    for i, signal in enumerate(trace.scenario.references):
        rates[:, i] += [evaluate(signal, t)[1] for t in trace.t.tolist()]
    return rates


def group_trace(trace: Trace, group: ChannelGroup) -> Trace:
    """Return the trace of a group's channels; the same trace if these are all.

    Its scenario has all channels.
    """
    plant = trace.scenario.plant
    arrays_by_name = trace.arrays()
    if trace.scenario.tracks == "speed" and trace.x.shape[1] == plant.n:
        arrays_by_name |= {"x": trace.v, "r": reference_rates(trace)}
    arrays_by_name |= _stuck(trace)
    if len(group.channels) == trace.x.shape[1]:
        changed = any(arrays_by_name[name] is not getattr(trace, name) for name in arrays_by_name)
        return dataclasses.replace(trace, **arrays_by_name) if changed else trace
    if plant.pose:  # metrics take x - r for the error
        arrays_by_name["x"] = trace.r + trace.e
    columns = []
    for i in group.channels:
        if i in trace.scenario.scored_channels:
            columns.append(i)
    arrays = {}
    for name, array in arrays_by_name.items():
        if name != "t":
            arrays[name] = array[:, columns]
    if (
        plant.pose and group.unit == "m" and trace.x.shape[1] == plant.n
    ):  # forces are of the actuators
        arrays["u"] = trace.applied
    return dataclasses.replace(trace, **arrays)


@keyword_dataclass
class Metric:
    """A metric's entry in the catalogue."""

    name: str  # the function's name
    # "s", "%", ...; "" of a share; {x} stands for the unit of x, {u} for that of u, {force} for
    # that of a force, see `unit_for`
    unit: str
    summary: str  # first line of the docstring
    formula: Callable[[Trace], float]  # Trace of one group's channels -> float, without the checks
    label: str  # its name in tables and figures
    # what somebody asks for who wants this number small, such as "fast"; "" if there is none
    need: str = ""
    network: bool = False  # whether it compares channels, and so needs several of a kind
    # whether it is meaningful only for mechanisms with friction, contacts or other parts
    realistic: bool = False
    command: bool = False  # whether it is computed from u or s, which free joints do not have
    late: bool = False  # whether it is of the last part alone, so that it has a trend, see `trends`
    # whether it is of the size of the error, so that a run that has not arrived has a large one
    error: bool = False
    # Value with which laws are compared where the metric is NaN; NaN for a metric that is never NaN
    absent: float = math.nan
    fold: Fold | None = None  # its row, if it takes one sample after the other

    def refusal(self, machine: Plant | Scenario) -> str:
        """Return why the metric has no single value for a plant, or for a scenario with its
        actuators; or "".
        """
        plant = machine if isinstance(machine, Plant) else machine.plant
        driven = [group for group in groups(machine) if group.driven]
        if "{u}" in self.unit and not all(group.effort for group in driven):
            efforts = joined(dict.fromkeys(machine.efforts[: plant.driven]))
            return (
                f"{self.name} has no one value where u is in {efforts}, as in {plant.name}: take a "
                "metric of the error, or smc.metrics.joint_scores for each joint by itself"
            )
        if not any(map(self.applies_to, driven)):
            return (
                f"{self.name} compares channels and {plant.name} has one of a kind: give a "
                "network, n >= 2"
            )
        if ("{" in self.unit or self.unit == UNIT_OF_S) and len(driven) > 1 and not plant.pose:
            units = " and ".join(group.unit for group in driven)
            return (
                f"{self.name} has no one value where channels are in {units}, as in {plant.name}: "
                "use smc.scores"
            )
        return ""

    @property
    def shared(self) -> bool:
        """Whether its single value includes free joints: it follows from the motion, and its unit
        is not that of x.
        """
        return not self.command and "{" not in self.unit

    def of(self, trace: Trace) -> float:
        """Return the value of the worst group, for a trace that `refuse` and `refusal` accept."""
        return self.worst(by_group(trace))

    def worst(self, traces: Mapping[ChannelGroup, Trace]) -> float:
        """Return the value of the worst group, from the result of `by_group`."""
        counted = []
        for group, trace in traces.items():
            if self.applies_to(group) and (group.driven or self.shared):
                counted.append(trace)
        if "{" in self.unit or self.unit == UNIT_OF_S:  # of a pose the position
            counted = counted[:1]
        worst = math.nan
        for trace in counted:
            value = float(self.formula(trace))
            # a group without the value, such as a limit cycle, hides no other
            if math.isnan(worst) or value > worst:
                worst = value
        return worst

    def applies_to(self, group: ChannelGroup) -> bool:
        """Return whether the metric applies to a group by itself."""
        if "{u}" in self.unit and not group.effort:
            return False
        return (group.driven or not self.command) and (len(group.channels) > 1 or not self.network)

    def text(self, value: float) -> str:
        """Return a value as text; inf is "never" for a time, and else that the run fails or has not
        arrived.
        """
        if value == math.inf and self.unit != "s":
            return "fails" if self.error else "not arrived"
        return number(value)

    def unit_for(self, x: str, u: str = "") -> str:
        """Return the unit where positions are in x, "rad" or "m", and commands in u; u="" for
        forces.
        """
        u = u or EFFORT[x]
        text = self.unit.replace("({x})", x).replace("({u})", f"({u})" if " " in u else u)
        return text.format(x=x, u=u, force=EFFORT[x])

    def heading(self, x: str, u: str = "") -> str:
        """Return the label with the unit where positions are in x and commands in u; x="" where
        that is not known, u="" for forces.
        """
        unit = self.unit
        if x:
            unit = self.unit_for(x, u)
        if not unit or "{" in unit:
            return self.label
        return f"{self.label} ({unit})"

    def unit_in(self, machine: Plant | Scenario, group: str = "") -> str:
        """Return the unit in the group of that name, such as "free"; without a name, that of the
        first driven group.
        """
        of_plant = groups(machine)
        chosen = next((own_group for own_group in of_plant if own_group.name == group), of_plant[0])
        return self.unit_for(chosen.unit, chosen.effort)


def metric(
    unit: str, *, label: str = "", need: str = "", **flags: Any
) -> Callable[[Callable[[Trace], float]], Callable[[Trace], float]]:
    """Return a decorator that enters a function Trace -> float in the catalogue and makes it refuse
    broken traces.

    Flags are fields of `Metric`; the label is by default the function's name with spaces.
    """

    def enter(formula: Callable[[Trace], float]) -> Callable[[Trace], float]:
        name = formula.__name__
        entry = CATALOGUE[name] = Metric(
            name=name,
            unit=unit,
            summary=first_paragraph(inspect.getdoc(formula)),
            formula=formula,
            label=label or name.replace("_", " "),
            need=need,
            **flags,
        )

        @functools.wraps(formula)
        def checked(trace: Trace) -> float:
            refuse(trace)
            if why := entry.refusal(trace.scenario):
                raise ScenarioError(why)
            return entry.of(trace)

        return checked

    return enter


def folded(unit: str, fold: Fold, **flags: Any) -> Callable[[Callable], Callable[[Trace], float]]:
    """Return a decorator that enters a fold in the catalogue, by the name and docstring of a
    function that has nothing else. Flags are other ones of `metric`.
    """

    def enter(described: Callable) -> Callable[[Trace], float]:
        @functools.wraps(described)
        def formula(trace: Trace) -> float:
            first = last_part(trace).start if fold.part == "late" else None
            return fold.of(trace.t, signal(trace, fold.signal), first)

        late = fold.part == "late"
        return metric(unit, fold=fold, late=late, command=fold.signal == "u", **flags)(formula)

    return enter


def refuse(trace: Trace) -> None:
    """Raise ScenarioError for anything but a trace of finite signals whose run did not fail."""
    if not has(trace, "scenario"):
        raise ScenarioError(f"cannot score {shown(trace)}: give one Trace")
    names = ("x", "v", "u", "applied", "s", "d", "r", "reaction")
    finite = np.isfinite(trace.t)
    for name in names:
        finite = finite & np.isfinite(getattr(trace, name)).all(axis=1)
    if trace.failure is not None:
        why = trace.failure  # names its time
    elif trace.diverged_at is not None:
        why = f"it diverged at t = {trace.diverged_at:g} s"
    elif not finite.all():
        why = f"it is not finite from t = {trace.t[np.argmin(finite)]:g} s"
    else:
        return
    cure = "change the gains or u_max, or end the run earlier"
    if trace.failure is not None and not trace.plant_diverged:
        cure = "correct the law or signal"
    run = f"{trace.scenario.plant.name} under {trace.scenario.law.name}"
    raise ScenarioError(f"{run} has no score, {why}: {cure}")


def error(trace: Trace) -> Array:
    """Return e = x - r, (K+1, n)."""
    return trace.x - trace.r


def signal(trace: Trace, name: str) -> Array:
    """Return a signal of a group's trace that a fold names, (K + 1, n)."""
    if name == "e":
        return error(trace)
    if name == "rest":
        return error(trace) / scale(trace)
    if name == "turned":
        return np.where(_after_turns(trace), error(trace), 0.0)
    if name == "held":
        return _held(trace)
    if name == "slips":
        held = _held(trace)
        return np.vstack([np.zeros(held.shape[1]), slipped(held[:-1], held[1:])])
    return getattr(trace, name)


def _held(trace: Trace) -> Array:
    """Return the time for which friction or contact held each channel in the control period that
    ends at t_k, (K + 1, n), s.
    """
    if trace.held is not None:
        return trace.held
    rest = at_rest(trace)
    held = np.zeros(rest.shape)
    # a sample's reaction is the mean over the control period before it
    stands = rest[:-1] & rest[1:] & (trace.holding[1:] != 0.0)
    held[1:] = np.diff(trace.t)[:, None] * stands
    return held


def _after_turns(trace: Trace) -> Array:
    """Return whether a sample is after a turn of the reference, (K + 1, n)."""
    directions = np.sign(np.diff(trace.r, axis=0))
    after = np.zeros(trace.r.shape, bool)
    for i, channel in enumerate(directions.T):
        moving = np.flatnonzero(channel)
        turns = moving[1:][np.diff(channel[moving]) != 0.0]
        for turn in turns:
            later = slice(turn + 1, None)
            after[later, i] |= after_turn(trace.t[later] - trace.t[turn])
    return after


def by_group(trace: Trace) -> dict[ChannelGroup, Trace]:
    """Return group -> the trace of its channels, which is the argument of the functions below."""
    traces = {}
    for group in groups(trace.scenario):
        traces[group] = group_trace(trace, group)
    return traces


def scale(trace: Trace) -> float:
    """Return the scale of a group's trace in x's unit, never zero; see the module's conventions."""
    start = np.abs(trace.x[0] - trace.r[0]).max()
    travel = max(map(np.ptp, trace.r.T))
    return float(max(start, travel)) or 1.0


def at_rest(trace: Trace) -> Array:
    """Return where each channel of a group's trace is at rest, (K+1, n); see the module's
    conventions.
    """
    speeds = np.abs(trace.v)
    slow = max(REST_SHARE * float(speeds.max()), REST_SPEED)
    return speeds <= slow


def _stuck(trace: Trace) -> dict[str, Array]:
    """Return `held` of a run with frictions that say by their force where a joint sticks, else
    nothing.
    """
    scenario = trace.scenario
    plant = scenario.plant
    if trace.held is not None or trace.x.shape[1] != plant.n or not scenario.friction:
        return {}
    bends = {}
    jump = scenario.jump_sample
    jumped = scenario.machines[-1].friction  # the same, unless their numbers jump
    for part, after in zip(scenario.friction, jumped, strict=True):
        for i in part.channels(plant) if part.side == "link" else ():
            motion = trace.v[:, i], trace.holding[:, i]
            before, later = part.sticks(*motion), after.sticks(*motion)
            if before is not None and later is not None:
                bends[i] = np.concatenate([before[:jump], later[jump:]])
    if not bends:
        return {}
    rest = at_rest(trace) & (trace.holding != 0.0)
    for i, stuck in bends.items():
        rest[:, i] = stuck & (trace.holding[:, i] != 0.0)
    held = np.zeros(trace.x.shape)
    held[1:] = np.diff(trace.t)[:, None] * (rest[:-1] & rest[1:])
    return {"held": held}


def leans(trace: Trace) -> bool:
    """Return whether a joint of a user's model leans on something, or cannot be judged: u stays at
    one of its bounds for more than LEANS of the last part, or the base falls.
    """
    plant = trace.scenario.plant
    if not plant.has_user_joints:
        return False
    limits = np.array(trace.scenario.limits)
    u = trace.u[last_part(trace)]
    if len(limits) != u.shape[1]:  # a group of some channels
        limits = limits.max()
    ends = np.sign(u) * (np.abs(u) >= limits)
    means = np.abs(ends.mean(axis=0))
    return bool(np.any(means > LEANS)) or bool(falls(plant))


def last_part(trace: Trace) -> slice:
    """Return the samples of the last part."""
    return slice(first_sample("late", trace.t, late_time(trace.scenario)), None)


def late_time(scenario: Scenario) -> float:
    """Return how long the last part of a run under a periodic load is, s; 0 if it is LAST_PART."""
    period = scenario.load_period
    count = late_periods(scenario.duration, period)
    return count * period if count else 0.0


def late_metrics_judged(scenario: Scenario) -> bool:
    """Return whether metrics of the last part may be compared, see the module's conventions."""
    return judges_last_part(scenario.duration, scenario.load_period)


def settles_in_time(time: Any, duration: Any) -> Any:
    """Return whether runs of these durations, s, settle before their last part: an oscillation that
    leaves the band again and again may be within it at the end. Arrays, or numbers.
    """
    return time <= (1.0 - LAST_PART * (1.0 - ROUNDING)) * duration


def travels(trace: Trace) -> bool:
    """Return whether a channel's reference travels, see the module's conventions."""
    if trace.scenario.tracks == "speed":  # r is a speed
        return False
    steps = np.abs(np.diff(trace.r[last_part(trace)], axis=0))
    if len(steps) < 2:  # one step may be a jump
        return False
    straight = np.ptp(steps, axis=0) <= STRAIGHT * steps.max(axis=0)
    return bool(np.any(straight & (steps.min(axis=0) > 0.0)))


def resolution(scenario: Scenario, group: ChannelGroup) -> float:
    """Return what the sensor of a group tells apart: the standard deviation of its noise, or half a
    count if that is larger.
    """
    if scenario.tracks == "speed":
        return scenario.noise.velocity
    apart = scenario.noise.position
    for i in group.channels:
        if (sensor := scenario.encoder(i)) is not None:
            apart = max(apart, sensor.quantum(group.unit == "rad") / 2)
    return apart


def settling_band(scenario: Scenario, largest: float) -> float:
    """Return the settling band of a group with a scale, in its unit."""
    sigma = scenario.noise.velocity if scenario.tracks == "speed" else scenario.noise.position
    if largest < NEAR_NOISE * sigma:
        return ARRIVAL_COUNTS * sigma
    return SETTLING_BAND * largest


def last_exit(t: Array, magnitude: Array, band: float) -> float:
    """Return the time since t[0], s, from which magnitude, (K+1,), stays <= band; 0 if always, inf
    if never.
    """
    outside = np.flatnonzero(magnitude > band)
    if outside.size == 0:
        return 0.0
    if outside[-1] == t.size - 1:
        return math.inf
    return float(t[outside[-1] + 1] - t[0])


def approaches(trace: Trace) -> list[list[slice]]:
    """Return the samples of each approach in order, channel by channel."""
    band = SETTLING_BAND * scale(trace)
    channels = []
    for r in trace.r.T:
        jumps = np.flatnonzero(np.abs(np.diff(r)) > band) + 1
        spans = []
        for ends in itertools.pairwise([0, *jumps.tolist(), r.size]):
            spans.append(slice(*ends))
        channels.append(spans)
    return channels


def row_max(a: Array) -> Array:
    """Return a.max(axis=1) of a, (K, n). It is much faster for few channels."""
    return functools.reduce(np.maximum, a.T)


def turns(y: Array, threshold: float) -> int:
    """Return how often y (K,) turns back by half its range; 0 for a range <= `threshold`."""
    count = 0
    direction = 0
    low = y[0]
    high = y[0]
    swing = float(np.ptp(y)) / 2
    slopes = np.diff(y)
    peaks = np.flatnonzero(slopes[1:] * slopes[:-1] <= 0.0) + 1  # y is monotonic between them
    if 2 * swing <= threshold:
        return 0
    for value in y[[0, *peaks, -1]].tolist():
        low = min(low, value)
        high = max(high, value)
        turned = 0
        if direction >= 0 and value <= high - swing:
            turned = -1
        elif direction <= 0 and value >= low + swing:
            turned = 1
        if turned:
            count += direction != 0
            direction = turned
            low = value
            high = value
    return count
