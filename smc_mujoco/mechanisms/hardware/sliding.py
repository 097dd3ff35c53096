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

On all others:

    slides:  friction = -F(v, motor, load)
    sticks:  friction = -clip(stiffness (x - x_s) + damping v, low, high),
             like a LuGre bristle that does not slip

A joint sticks when its speed changes sign or is small. x_s is then such that the spring ends the
acceleration of the step before, within the bounds: the joint rests where it stops. For a joint at
rest from the start of a run, x_s is its position. It slides again when stiffness (x - x_s) leaves
the bounds. So a stuck joint does not creep, because its friction depends on its position. Under a
new load it turns by load/stiffness. Its speed decays as exp(-200 t/s) if it moves alone, and slower
if other joints move with it.

A joint that slides keeps sliding at the speed at which F equals the load.

Limit: bristles are critically damped for each joint alone. Stuck joints that move together have
less damping. A sudden load makes them overshoot, and may tear a joint loose below the limit that
holds it at rest. Rigid dry friction would hold. With M at the pose and D the inertias that
`bristle` gets, a mode of M w = L D w has the damping L^-1/2. On the Panda in its ready pose L is up
to 13, so a sudden load in that mode tears a joint loose from 71 % of its limit on. A load that
rises within 0.5 s does not, up to 97 %.

The bristles' friction is the control of an actuator `passive:<joint>`, held over each physics step.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a function or a property here)
import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import mujoco
from numba import njit

from smc_mujoco.common.constraints import Each, Number
from smc_mujoco.mechanisms.hardware.friction import HIGH, RISE, at_stage, begin_step, with_rise
from smc_mujoco.mechanisms.hardware.joint_force import JointForce, PerJoint
from smc_mujoco.mechanisms.hardware.moments import Run
from smc_mujoco.mechanisms.hardware.part import PASSIVE, Actuator
from smc_mujoco.mechanisms.plant import MAX_PARAMETER

STICKING_SPEED = 1e-4  # rad/s or m/s, chosen: a joint that becomes slower than this sticks
# rad/s, natural, of a stuck joint, critically damped: chosen, two steps of 1 ms resolve it
BRISTLE_FREQUENCY = 200.0
MAX_EXPONENT = 700.0  # exp of more overflows

NaturalPerJoint = Annotated[PerJoint, Each(one=Number(low=0.0, high=MAX_PARAMETER))]
PositivePerJoint = Annotated[PerJoint, Each(one=Number(above=0.0, high=MAX_PARAMETER))]

# What a joint keeps: of bristles whether it sticks, where they are unbent, speed and force at the
# step before; at stages of RK4 the same speed, whether it was held, and whether it slides.
STUCK, STUCK_AT, SPEED, FORCE = range(4)
STAGE_SPEED, WAS_HELD, SLIDES = range(HIGH + 1, HIGH + 4)


@dataclasses.dataclass(frozen=True)
class Sliding(JointForce):
    """Base of frictions by a formula."""

    bristles = True  # of joints that do not move alone
    brakes = True
    memory = SLIDES + 1

    @property
    def names(self) -> tuple[str, ...]:
        """The fields, which the formula reads as p, and the numbers of the bristles."""
        return (*self.per_joint, "bristle_stiffness", "bristle_damping", "bristle_inertia")

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
    def force(self) -> Callable:
        """The friction that is held over a step."""
        return _by_bristles(type(self).value)

    @property
    def stage_force(self) -> Callable:
        """The friction at a stage of RK4."""
        return _at_stages(type(self).value)

    def numbers(self, run: Run) -> list[Sequence[float]]:
        model = run.model
        return [(*self.parameters(i), *bristle(model, dof)) for i, dof in enumerate(run.dofs)]

    @property
    def exact(self) -> "Sliding":
        return self

    def behind(self, actuator: Actuator) -> bool:
        """Return whether it knows the force of a drive within a step."""
        return actuator.in_callback or actuator.even

    def edit(self, spec: mujoco.MjSpec) -> None:
        for joint in self.joints(spec):
            brake = spec.add_actuator(
                name=PASSIVE + joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
            )
            brake.set_to_motor()


def bristle(model: mujoco.MjModel, dof: int) -> tuple[float, float, float]:
    """Return stiffness and critical damping of a degree of freedom that sticks, and the inertia
    that a force on it moves, kg m^2 (kg), all in qpos0.
    """
    inertia = model.dof_M0[dof]
    stiffness = inertia * BRISTLE_FREQUENCY**2
    return stiffness, 2.0 * math.sqrt(stiffness * inertia), 1.0 / model.dof_invweight0[dof]


@functools.cache
def _by_bristles(formula: Callable) -> Callable:
    """Return the force on a joint that slides by a formula, or sticks by a bristle."""
    formula = njit(formula)

    def force(y, p, memory):
        f, low, high = formula(y.v, y.motor, y.load, p)
        stuck = memory[STUCK]
        if stuck == 0.0:
            slows = abs(y.v) < STICKING_SPEED and abs(y.v) <= abs(memory[SPEED])
            if slows or y.v * memory[SPEED] < 0.0:
                stuck = 1.0
                memory[STUCK_AT] = y.x
                if memory[SPEED] != 0.0:  # it stops, else it is at rest from the start
                    load = memory[FORCE] + p.bristle_inertia * (y.v - memory[SPEED]) / y.h
                    memory[STUCK_AT] -= min(max(load, low), high) / p.bristle_stiffness
        if stuck != 0.0:
            spring = p.bristle_stiffness * (y.x - memory[STUCK_AT])
            if low <= spring <= high and low < high:
                f = min(max(spring + p.bristle_damping * y.v, low), high)
            else:
                stuck = 0.0
        memory[STUCK], memory[SPEED], memory[FORCE] = stuck, y.v, f
        return -f

    return force


@functools.cache
def _at_stages(formula: Callable) -> Callable:
    """Return the force at a stage of RK4 on a joint that slides by a formula, or stops or rests in
    the step.
    """
    formula = njit(formula)

    def stage_force(y, p, memory):
        held = 0.0
        if y.stage == 0.0:
            smooth = y.others + y.mean
            f, low, high = formula(y.v, y.motor, y.load, p)
            sliding = -f
            before = memory[STAGE_SPEED]
            slow = abs(y.v) < STICKING_SPEED and (
                memory[WAS_HELD] != 0.0 or abs(y.v) <= abs(before)
            )
            memory[STAGE_SPEED] = y.v
            stops = abs(y.v) <= -math.copysign(y.h * y.mobility, y.v) * (smooth + sliding)
            if not low < high or not (slow or stops or y.v == 0.0):
                memory[SLIDES], memory[WAS_HELD], memory[RISE] = 1.0, 0.0, 0.0
            else:
                if slow:
                    sliding = -high if y.v > 0.0 else -low
                else:
                    sliding = -formula(0.5 * y.v, y.motor, y.load, p)[0]
                start = math.copysign(STICKING_SPEED, smooth)
                starting = -formula(start, y.motor, y.load, p)[0]
                # friction that holds less than it exerts in motion would start no joint
                if smooth * (smooth + starting) <= 0.0:
                    low = min(low, smooth)
                    high = max(high, smooth)
                held = begin_step(y, memory, sliding, starting, low, high)
                memory[SLIDES], memory[WAS_HELD] = 0.0, held
        if memory[SLIDES] != 0.0:
            return with_rise(y, memory, -formula(y.v, y.motor, y.load, p)[0]), held
        return at_stage(y, memory), held

    return stage_force


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

    p1: NaturalPerJoint
    p2: PositivePerJoint
    p3: Annotated[PerJoint, Each(one=Number(low=-MAX_PARAMETER, high=MAX_PARAMETER))] = 0.0
    hold: NaturalPerJoint | None = None

    @staticmethod
    def value(v, motor, load, p):
        rest = p.p1 / (1.0 + math.exp(min(-p.p2 * p.p3, MAX_EXPONENT)))
        f = p.p1 / (1.0 + math.exp(min(-p.p2 * (v + p.p3), MAX_EXPONENT))) - rest
        if math.isnan(p.hold):
            return f, -rest, p.p1 - rest
        return f, -p.hold, p.hold
