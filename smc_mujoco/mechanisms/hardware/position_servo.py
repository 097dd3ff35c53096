"""A position servo as an actuator of a user's file: u is its set-point.

    force = kp (set-point - x) - kv v + ki z, within its forcerange, as MuJoCo computes it
    z' = set-point - x

`smc.Channel(servo=True)` reads its numbers from a `<position>` or a `<pid>` of the file.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a function or a property here)
import dataclasses
import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar

import mujoco
import numpy as np
from numba.extending import register_jitable

from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.common.constraints import Boolean, Range
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import floats, record_at
from smc_mujoco.common.text import joined
from smc_mujoco.mechanisms.hardware.moments import Run, channel_at, state_at
from smc_mujoco.mechanisms.hardware.part import Actuator, Natural, NominalDrive, Offset, Positive
from smc_mujoco.mechanisms.plant import Field

Span = Annotated[Pair, Range(infinite=True)]
UNBOUNDED = (-math.inf, math.inf)
# Where the numbers lie in the compiled model, in actuator_gainprm, actuator_biasprm and
# actuator_dynprm; of a <pid> the gain is ki
GAIN = 0
BIAS = slice(0, 3)
TIMECONST = 0
LIMITS = slice(0, 2)  # imax and slewmax
POSITION = mujoco.mjtCtrlInput.mjINPUT_POS.value


@frozen_data
class PositionServo(Actuator):
    """Position servo: u is its set-point, counted from `goal`, rad (m on a slide).

        smc.hardware.PositionServo(kp=17.8, kv=0.1, forcerange=(-2.94, 2.94), ctrlrange=(-1.9, 1.9))

    MuJoCo computes the force kp (goal + u - x) - kv v at each stage of a step, as for the file's
    own `<position>`. The set-point is clipped to `ctrlrange`, the force to `forcerange`. u is 0 at
    the goal, so that one bound on |u| reaches equally far to both sides of it. An `input_delay`
    delays only the set-point. Behind a `timeconst` MuJoCo filters the clipped set-point, from the
    goal at the start. A `Lag` or a `RateLimit` may stand before it. A law has no nominal model of
    it.

    Within `dead_band` of the set-point kp and ki do nothing, and beyond it they take the rest of
    the error, as firmware of hobby servos does. MuJoCo has none, so the set-point moves with the
    joint at every stage of a step.

    With `ki` or `slewmax` it is MuJoCo's `<pid>`, whose speed set-point stays 0. MuJoCo integrates
    the error of the position from `integral`, and the set-point follows the command from the goal.

    Attributes:
      kp: N m/rad (N/m) at the joint, greater than 0.
      kv: N m s/rad (N s/m) at the joint, 0 or more.
      forcerange: lowest and highest force, N m (N) at the joint.
      ctrlrange: lowest and highest set-point, rad (m) of the joint.
      goal: position at which u is 0, rad (m) of the joint.
      step: the set-point is rounded to multiples of this, rad (m) of the joint; 0: it is not.
      timeconst: of the first-order filter of the set-point, s; 0: none.
      euler: whether MuJoCo steps that filter by Euler's rule (dyntype filter), else exactly
        (filterexact).
      ki: N m/(rad s) (N/(m s)) at the joint, 0 or more.
      imax: bound on the integral of the error, rad s (m s); 0: none.
      slewmax: bound on the rate of the set-point, rad/s (m/s); 0: none.
      integral: of the error at the start of a run, rad s (m s).
      dead_band: to each side of the set-point, rad (m), 0 or more.

    Raises:
      ScenarioError: `forcerange` does not contain 0 between its ends, a timeconst beside ki or
        slewmax, a dead_band beside timeconst or slewmax, imax or integral without ki, or euler
        without timeconst. In a scenario: another
        drive of the joint, a Fault other than stuck=True, or a nominal model.
    """

    unit = "{x}"
    units: ClassVar[Mapping[str, str]] = {
        "kp": "{f}/{x}",
        "kv": "{f} s/{x}",
        "ki": "{f}/({x} s)",
        "dead_band": "{x}",
    }
    names = ("goal", "step", "zero", "dead_band", "low", "high")

    kp: Positive
    kv: Natural = 0.0
    forcerange: Span = UNBOUNDED
    ctrlrange: Span = UNBOUNDED
    goal: Offset = 0.0
    step: Natural = 0.0
    timeconst: Natural = 0.0
    ki: Natural = 0.0
    imax: Natural = 0.0
    slewmax: Natural = 0.0
    euler: Boolean = False
    integral: Offset = 0.0
    dead_band: Natural = dataclasses.field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        low, high = self.forcerange
        if not low < 0.0 < high:
            raise ScenarioError(
                f"PositionServo's forcerange is {low:g} to {high:g}, but a servo pushes both "
                "ways: give a lowest force below 0 and a highest above it"
            )
        if self.timeconst and self.by_pid:
            raise ScenarioError(
                f"PositionServo has timeconst {self.timeconst:g}, and a servo with ki or slewmax "
                "has no filter: give one of them"
            )
        if self.dead_band and (self.timeconst or self.slewmax):
            raise ScenarioError(
                f"PositionServo has dead_band {self.dead_band:g} beside a timeconst or a slewmax, "
                "which would take the place of the joint for the set-point: give one of them"
            )
        for name, base in (("imax", "ki"), ("integral", "ki"), ("euler", "timeconst")):
            if getattr(self, name) and not getattr(self, base):
                raise ScenarioError(
                    f"PositionServo has {name}, which does nothing without {base}: give {base}, too"
                )

    @property
    def by_pid(self) -> bool:
        """Whether it is a `<pid>` of MuJoCo, whose control is the set-point itself."""
        return bool(self.ki or self.slewmax)

    @property
    def smooth(self) -> bool:
        """Whether RK4 may integrate it: a bounded rate moves the set-point once a step."""
        return not self.slewmax

    @property
    def delay(self) -> float:
        """The time constant of its set-point, s."""
        return self.timeconst

    @property
    def meaning(self) -> str:
        """What u is, in words."""
        return f"the set-point of its servo, in {{x}} from its goal at {self.goal:g}"

    @property
    def bound(self) -> float | None:
        """The largest |u| that the ctrlrange allows, rad (m); None without one."""
        low, high = self.ctrlrange
        farthest = max(self.goal - low, high - self.goal)
        return farthest if 0.0 < farthest < math.inf else None

    @property
    def stall(self) -> float | None:
        """The largest force that it gives in both directions, N m (N); None if unbounded."""
        low, high = self.forcerange
        least = min(-low, high)
        return least if least < math.inf else None

    @property
    def nominal(self) -> NominalDrive:
        """Force per unit of u, and of the velocity. The spring to the goal is not in it."""
        return NominalDrive(self.kp, self.kv)

    def force_at(self, bound: float) -> float:
        force = super().force_at(bound)
        return force if self.stall is None else min(force, self.stall)

    def force_of(self, u: Array, x: Array, v: Array) -> Array:
        return np.clip(self.kp * self._errors(u, x) - self.kv * v, *self.forcerange)

    def _errors(self, u: Array, x: Array) -> Array:
        """Return the errors that kp and ki take: beyond the dead band."""
        errors = np.clip(self.goal + u, *self.ctrlrange) - x
        return errors - np.clip(errors, -self.dead_band, self.dead_band)

    def integrals(self, u: Array, x: Array, period: float) -> Array:
        """Return the integral of its error at K samples of u and x, `period` s apart, (K,): from 0
        at the first one, and within imax.
        """
        bound = self.imax or math.inf
        errors = self._errors(u[:-1], 0.5 * (x[:-1] + x[1:]))
        integrals = np.zeros(len(u))
        for k, error in enumerate(errors.tolist()):
            integrals[k + 1] = min(max(integrals[k] + period * error, -bound), bound)
        return integrals

    def suits(self, s: Any, chain: Sequence[Actuator]) -> None:
        drives = [part for part in chain if part.drives]
        before = [type(part).__name__ for part in drives if part is not self]
        leader = "".join(before)
        if leader in ("Lag", "RateLimit") and self.step:
            raise ScenarioError(
                f"a PositionServo rounds its set-point to steps of {self.step:g}, and not behind a "
                f"{leader}: leave one of them out"
            )
        if leader in ("Lag", "RateLimit") and self.by_pid:
            raise ScenarioError(
                "a PositionServo with ki or slewmax takes its set-point from the command, and not "
                f"from a {leader}: leave one of them out; slewmax limits the rate of the set-point"
            )
        if leader not in ("", "Lag", "RateLimit", "CommandDelay"):
            raise ScenarioError(
                f"a PositionServo is a drive of its own, and so is {joined(before)}: leave that "
                "out, or give smc.Channel(motor=True) for an ideal motor instead"
            )
        if s.fault is not None and not s.fault.stuck:
            raise ScenarioError(
                "a Fault reduces a force or adds a bias to it, but u is the set-point of a "
                "PositionServo: leave fault out, or give stuck=True"
            )
        if s.model != "none":
            raise ScenarioError(
                f"model is {s.model!r}, in which u is a force, but u is the set-point of a "
                "PositionServo: give model='none', or smc.Channel(motor=True)"
            )

    def edit(self, spec: mujoco.MjSpec) -> None:
        for actuator in self.drives_of(spec):
            if self.by_pid:
                actuator.set_to_pid(
                    kp=1.0,
                    ki=1.0 if self.ki else 0.0,
                    slewmax=1.0 if self.slewmax else 0.0,
                    ctrlspec=POSITION,
                )
            else:
                actuator.set_to_position(kp=1.0, timeconst=1.0 if self.timeconst else 0.0)
            if self.timeconst and self.euler:
                actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTER
            actuator.ctrllimited = True
            actuator.ctrlrange = (-1.0, 1.0)
            actuator.forcelimited = True
            actuator.forcerange = (-1.0, 1.0)

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        ids = self.drive_ids(model)
        low, high = self.ctrlrange
        held = 0.0 if self.by_pid else self.kp * self.goal  # N m (N), at u = 0
        gain = self.ki if self.by_pid else self.kp
        commands = model.actuator_ctrladr[ids]
        yield Field("actuator_gainprm", (ids, GAIN), gain)
        yield Field("actuator_biasprm", (ids, BIAS), (held, -self.kp, -self.kv))
        low, high = low - self.dead_band, high + self.dead_band
        yield Field("actuator_ctrlrange", commands, (low - self.zero, high - self.zero))
        yield Field("actuator_forcerange", ids, self.forcerange)
        if self.by_pid:
            yield Field("actuator_dynprm", (ids, LIMITS), (self.imax, self.slewmax))
        if self.timeconst:
            yield Field("actuator_dynprm", (ids, TIMECONST), self.timeconst)

    def structure(self) -> tuple[Hashable, ...]:
        states = bool(self.timeconst), self.euler, bool(self.ki), bool(self.slewmax)
        return *super().structure(), *states

    @property
    def zero(self) -> float:
        """The set-point at which the control of MuJoCo's actuator is 0, rad (m)."""
        return 0.0 if self.by_pid else self.goal

    def begin(self, model: mujoco.MjModel, act: np.ndarray) -> None:
        ids = self.drive_ids(model)
        first = model.actuator_actadr[ids]
        if self.slewmax:
            act[first] = self.goal
        if self.ki:  # the last of its activations
            act[first + model.actuator_actnum[ids] - 1] = self.integral

    def numbers(self, run: Run) -> list[Sequence[float]]:
        return [(self.goal, self.step, self.zero, self.dead_band, *self.ctrlrange)]

    @property
    def act(self) -> Any:
        """The function that writes the set-point, if it is rounded, moves with the joint, or is no
        u; else None.
        """
        return placed if self.step or self.by_pid or self.dead_band else None


numbers_at = record_at(floats(PositionServo.names))


@register_jitable
def placed(sim, data, part):
    """Write the control of MuJoCo's servo at the start of a step: the set-point, a multiple of
    `step`, counted from `zero`. With a dead band it is written at each stage: as far from what the
    servo holds as the error beyond the band.
    """
    p = numbers_at(part.function.parameters, 0)
    if sim.stage == 0 or p.dead_band != 0.0:
        channel = channel_at(sim.channels, part.channel)
        aim = p.goal + state_at(sim.states, part.channel).delayed
        if p.step != 0.0:
            aim = p.step * math.floor(aim / p.step + 0.5)
        if p.dead_band != 0.0:
            x = data.qpos[channel.shaft_qpos if channel.shaft_qpos >= 0 else channel.qpos]
            error = min(max(aim, p.low), p.high) - x
            aim = x + error - min(max(error, -p.dead_band), p.dead_band)
        data.ctrl[channel.ctrl] = aim - p.zero
