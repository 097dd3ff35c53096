"""Friction by a published formula of speed and load, which MuJoCo does not have: the callback
evaluates it.

A formula gives the force F that resists a joint sliding at the speed v, and the bounds [low, high]
of the force that holds the joint at rest. The bounds are needed because a fit to records of moving
joints is a smooth F with F(0) = 0. By F alone, a joint under a load would never rest: it would
creep at the speed at which F equals the load. So a joint slides or sticks.

On joints that move alone the callback gives RK4's stages F itself while the joint slides, and in a
step in which it stops, rests or turns back the moments of `friction.dry_step`. A joint whose speed
falls below STICKING_SPEED is stopped by the bound of the force that holds it at rest. See
`Scenario.exact_friction`.

On all others the force is the level of MuJoCo's dry friction. MuJoCo's solver finds which joints
stop or rest, all together, as it does for Coulomb friction. A joint whose speed changes sign, or is
below STICKING_SPEED, is held within the bounds. It is brought back to where it came to rest, so it
does not creep. A load that passes the bounds for so short a time that the joint does not reach
STICKING_SPEED therefore leaves no motion. Where joints come to rest has an error of first order in
the physics step: in 24 double pendulums drawn at random at most 1.3 % of the range in which
friction can hold them, at the default step.

Limit: MuJoCo gives the force of friction, limits and contacts at a joint as one sum. What friction
may have exerted of it is not counted in the load.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a function or a property here)
import dataclasses
import functools
import math
from collections.abc import Callable, Hashable, Iterator, Mapping
from typing import Annotated, Any, ClassVar, NamedTuple

import mujoco
import numpy as np
from numba import njit
from numba.extending import register_jitable

from smc_mujoco.common.constraints import Each, Number
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import inlined
from smc_mujoco.mechanisms.hardware.friction import (
    FRICTION,
    HIGH,
    RISE,
    SMOOTH,
    Coulomb,
    at_stage,
    begin_step,
    with_rise,
)
from smc_mujoco.mechanisms.hardware.joint_force import JointForce, PerJoint
from smc_mujoco.mechanisms.hardware.moments import JointState, Run
from smc_mujoco.mechanisms.hardware.part import HARD_SOLIMP, HARD_SOLREF, Actuator
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, Field

STICKING_SPEED = 1e-4  # rad/s or m/s, chosen: a joint that becomes slower than this sticks
MAX_EXPONENT = 700.0  # exp of more overflows

NaturalPerJoint = Annotated[PerJoint, Each(item=Number(low=0.0, high=MAX_PARAMETER))]
PositivePerJoint = Annotated[PerJoint, Each(item=Number(above=0.0, high=MAX_PARAMETER))]

# What a joint keeps: its speed at the step before, whether it is stuck and where; at stages of RK4
# the same speed, whether it was held, and whether it slides. A step that slides keeps F and its
# slope in place of what friction.py keeps.
SPEED, STUCK, STUCK_AT = range(3)
STAGE_SPEED, WAS_HELD, SLIDES = range(HIGH + 1, HIGH + 4)
SLOPE = SMOOTH  # of F in the speed, in a step that slides
TINY = 1e-14  # N m (N): a level above 0, so that MuJoCo has a constraint


@dataclasses.dataclass(frozen=True)
class Sliding(JointForce):
    """Base of frictions by a formula."""

    keeps_state = True
    memory = SLIDES + 1

    @staticmethod
    def value(v: float, motor: float, load: float, p: Any, /) -> tuple[float, float, float]:
        """Return F and the bounds low and high of the force at rest, N m (N).

        v is the speed of the joint, rad/s (m/s), motor the force of its drive in the physics step
        before, and load the sum of the other forces on it, N m (N): gravity, gyration, springs, the
        disturbances in a trace's d, and the contacts and limits of the step before, without the
        joint's damping. p has the numbers of its channel, by name.
        """
        raise NotImplementedError

    @property
    def formula(self) -> "Formula":
        """F and its bounds as functions that compiled code calls."""
        return _by_value(type(self).value)

    @property
    def written(self) -> tuple[Callable, int]:
        """The function that its author wrote, and the numbers that it may index."""
        return type(self).value, 0

    @property
    def brake(self) -> Callable:
        """The friction that MuJoCo holds over a step."""
        return _brake(self.formula)

    @property
    def stage_force(self) -> Callable:
        """The friction at a stage of RK4."""
        return _at_stages(self.formula)

    @property
    def steady(self) -> Callable | None:
        """F at a steady speed, without a load."""
        return _steady(self.formula)

    @property
    def exact(self) -> "Sliding":
        return self

    def behind(self, actuator: Actuator) -> bool:
        """Return whether it knows the force of a drive within a step."""
        return actuator.in_callback or actuator.even

    @property
    def zero(self) -> bool:
        """Whether all its fields that are forces are 0."""
        forces = [getattr(self, name) for name in self.forces]
        return bool(forces) and not any(np.any(force or 0.0) for force in forces)

    def structure(self) -> tuple[Hashable, ...]:
        return *super().structure(), self.zero

    def edit(self, spec: mujoco.MjSpec) -> None:
        if not self.zero:  # the callback writes levels of constraints, of which islands are copies
            spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND.value

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        if not self.zero:
            yield from Coulomb(TINY, on=self.on).fields(model)
            yield Field("dof_solref", self.dofs(model), HARD_SOLREF)
            yield Field("dof_solimp", self.dofs(model), HARD_SOLIMP)

    def friction_rows(self, run: Run) -> dict[int, int]:
        if run.rk4:
            return {}
        model = run.model
        dry_dofs = _dry_joints(model)
        if not self.zero:
            unsafe = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE.value
            if unsafe or not {*run.dofs} <= {*dry_dofs}:
                raise ScenarioError(
                    "the model's flags turn off what holds a joint that "
                    f"{type(self).__name__} stops: take constraint, frictionloss and refsafe out "
                    "of its <flag>"
                )
            if run.jump_step > 0 and _dry_joints(run.load(run.jump_step)) != dry_dofs:
                raise ScenarioError(
                    "the jump takes all dry friction of a joint away beside "
                    f"{type(self).__name__}: give a factor such as 1e-9"
                )
        rows = {}
        for i, dof in enumerate(run.dofs):
            if dof in dry_dofs:
                rows[i] = dry_dofs.index(dof)
        return rows


def _dry_joints(model: mujoco.MjModel) -> list[int]:
    """Return the degree of freedom of each row of constraints that is its dry friction, else -1."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    dry = data.efc_type == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF
    return np.where(dry, data.efc_id, -1).tolist()


class Formula(NamedTuple):
    """A friction as compiled code calls it, on a joint whose state is y."""

    first: Callable  # (y, v, p, memory) -> what it is at the speed v; moves its author's memory
    force: Callable  # (found, v) -> F, of what `first` has found
    bounds: Callable  # (found, y, v, p, memory) -> low and high, of what `first` has found
    force_at: Callable  # (y, v, p, memory) -> F at another speed
    beside: Callable  # (y, v, p, memory) -> F at STICKING_SPEED, in the direction of v
    seldom: bool  # whether it is called as seldom as it can be, and not at every stage of RK4
    module: str  # of the author


@functools.cache
def _by_value(value: Callable) -> Formula:
    """Return a formula of speed and load."""
    value = njit(value)

    @njit
    def first(y, v, p, memory):
        return value(v, y.motor, y.load, p)

    @njit
    def force(found, v):
        return found[0]

    @njit
    def bounds(found, y, v, p, memory):
        return found[1], found[2]

    @njit
    def at(y, v, p, memory):
        return value(v, y.motor, y.load, p)[0]

    @njit
    def beside(y, v, p, memory):
        return value(math.copysign(STICKING_SPEED, v), y.motor, y.load, p)[0]

    return Formula(first, force, bounds, at, beside, False, value.py_func.__module__)


def _authored(formula: Formula, function: Callable) -> Callable:
    """Return a function as one of the formula's author, whose code is compared with its Python."""
    function.__module__ = formula.module
    return function


@functools.cache
def _steady(formula: Formula) -> Callable:
    """Return the force that resists a joint at a steady speed, without a load."""
    force_at = formula.force_at

    def steady(y, p, memory):
        return force_at(unloaded(y), y.v, p, memory)

    return _authored(formula, steady)


@register_jitable
def unloaded(y):
    """Return the state of a joint on which no other force acts, and without a command."""
    return JointState(y.t, y.h, y.x, y.v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@functools.cache
def _brake(formula: Formula) -> Callable:
    """Return the force on a joint that slides by a formula, the level of its dry friction, and
    how far it is from where it came to rest.
    """
    first, force, bounds, *_ = formula

    def brake(y, p, memory):
        level = first(y, y.v, p, memory)
        f = force(level, y.v)
        low, high = bounds(level, y, y.v, p, memory)
        slow = abs(y.v) < STICKING_SPEED or y.v * memory[SPEED] < 0.0
        memory[SPEED] = y.v
        if not low < high:  # nothing holds it
            return -f, 0.0, 0.0
        if not slow:
            memory[STUCK] = 0.0
            if f * y.v < 0.0:  # it drives the joint
                return -f, 0.0, 0.0
            return 0.0, abs(f), 0.0
        if memory[STUCK] == 0.0:
            memory[STUCK], memory[STUCK_AT] = 1.0, y.x
        return -0.5 * (low + high), 0.5 * (high - low), y.x - memory[STUCK_AT]

    return _authored(formula, brake)


@functools.cache
def _at_stages(formula: Formula) -> Callable:
    """Return the force at a stage of RK4 on a joint that slides by a formula, or stops or rests in
    the step.

    A formula that is called seldom is so at speed 0 alone where the joint is slow, and while the
    joint stops, F is that of the step's start.
    """
    first, force, bounds, force_at, _, seldom, _ = formula
    starts = _starting(formula)
    later = _while_sliding(formula)

    def stage_force(y, p, memory):
        held = 0.0
        if y.stage == 0.0:
            smooth = y.others + y.mean
            slower = memory[WAS_HELD] != 0.0 or abs(y.v) <= abs(memory[STAGE_SPEED])
            slow = slower and abs(y.v) < STICKING_SPEED
            speed = 0.0 if seldom and slow else y.v
            level = first(y, speed, p, memory)
            f = force(level, y.v)
            if not math.isfinite(f):  # which ends the run
                return -f, 0.0
            memory[STAGE_SPEED] = y.v
            low = high = 0.0
            speed_lost = -math.copysign(y.h * y.mobility, y.v) * (smooth - f)
            if slow or y.v == 0.0 or abs(y.v) <= speed_lost:
                low, high = bounds(level, y, speed, p, memory)
            if not low < high:
                if speed != y.v:
                    f = force_at(y, y.v, p, memory)
                memory[SLIDES], memory[WAS_HELD], memory[RISE] = 1.0, 0.0, 0.0
                memory[FRICTION] = f
                return -f, 0.0
            if slow:
                sliding = -high if y.v > 0.0 else -low
            elif seldom:
                sliding = -f
            else:
                sliding = -force_at(y, 0.5 * y.v, p, memory)
            start, starting = starts(y, p, memory, smooth, low, high)
            # friction that holds less than it exerts in motion would start no joint
            if start * (smooth + starting) <= 0.0:
                low = min(low, smooth)
                high = max(high, smooth)
            held = begin_step(y, memory, sliding, starting, low, high)
            memory[SLIDES], memory[WAS_HELD] = 0.0, held
        if memory[SLIDES] == 0.0:
            return at_stage(y, memory), held
        return later(y, p, memory), held

    return _authored(formula, stage_force)


def _starting(formula: Formula) -> Callable:
    """Return a function (y, p, memory, smooth, low, high) -> the speed at which a joint starts from
    rest, and the force on it then.
    """
    beside = formula.beside
    seldom = formula.seldom

    @inlined
    def starts(y, p, memory, smooth, low, high):
        start = math.copysign(STICKING_SPEED, smooth)
        if smooth > high or smooth < low:  # an offset may leave 0 out of the bounds
            start = math.copysign(STICKING_SPEED, smooth - high)
        elif seldom:  # it does not start
            return start, -high if start > 0.0 else -low
        return start, -beside(y, start, p, memory)

    return starts


def _while_sliding(formula: Formula) -> Callable:
    """Return a function (y, p, memory) -> the force at a stage of RK4 after the first.

    Of a formula that is called seldom, F at the last two stages is on the line through F at the
    first two.
    """
    force_at = formula.force_at
    seldom = formula.seldom

    @inlined
    def later(y, p, memory):
        change = y.v - memory[STAGE_SPEED]
        if seldom and y.stage > 1.0:
            return -memory[FRICTION] - memory[SLOPE] * change
        f = force_at(y, y.v, p, memory)
        if seldom:
            memory[SLOPE] = (f - memory[FRICTION]) / change if change != 0.0 else 0.0
        return with_rise(y, memory, -f)

    return later


@dataclasses.dataclass(frozen=True)
class Sigmoid(Sliding):
    """Friction as a sigmoid of speed, as identified on robot arms.

        F(v) = p1/(1 + exp(-p2 (v + p3))) - p1/(1 + exp(-p2 p3))

    Source: C. Gaz, M. Cognetti, A. Oliva, P. Robuffo Giordano and A. De Luca, Dynamic
    identification of the Franka Emika Panda robot with retrieval of feasible parameters using
    penalty-based optimization, IEEE Robotics and Automation Letters 4(4), 2019, eq. (11).
    `smc.plant("panda").friction` has its numbers.

    The published F is 0 at v = 0, so it cannot hold a joint at rest. Under a load within its limits
    F(-inf) and F(inf) a joint creeps at the speed at which F equals the load: 0.2 rad/s for joint 1
    of the Panda under half of the limit. The module's docstring says how a joint is held here.

    Attributes:
      p1: N m (N), F(inf) - F(-inf); 0 or more.
      p2: s/rad (s/m), greater than 0.
      p3: rad/s (m/s), an offset.
      hold: N m (N), 0 or more: largest force that holds a joint at rest, in both directions. None:
        the limits of F, to which dry friction tends. 0: nothing holds it, and friction is F alone.
    """

    forces = "p1", "hold"
    units: ClassVar[Mapping[str, str]] = {"p1": "{f}", "p2": "s/{x}", "p3": "{x}/s", "hold": "{f}"}

    p1: NaturalPerJoint
    p2: PositivePerJoint
    p3: Annotated[PerJoint, Each(item=Number(low=-MAX_PARAMETER, high=MAX_PARAMETER))] = 0.0
    hold: NaturalPerJoint | None = None

    @staticmethod
    def value(v, motor, load, p):
        rest = p.p1 / (1.0 + math.exp(min(-p.p2 * p.p3, MAX_EXPONENT)))
        f = p.p1 / (1.0 + math.exp(min(-p.p2 * (v + p.p3), MAX_EXPONENT))) - rest
        if math.isnan(p.hold):
            return f, -rest, p.p1 - rest
        return f, -p.hold, p.hold
