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

A joint sticks when its speed changes sign or is small. x_s is then such that the spring carries the
joint's load, within the bounds: the joint rests where it stops. For a joint at rest from the start
of a run, x_s is its position. It slides again when stiffness (x - x_s) leaves the bounds. So a
stuck joint does not creep, because its friction depends on its position. Under a new load it turns
by load/stiffness. Its speed decays as exp(-200 t/s) if it moves alone, and slower if other joints
move with it.

A joint that slides keeps sliding at the speed at which F equals the load.

Limit: bristles are critically damped for each joint alone. Stuck joints that move together have
less damping. A sudden load makes them overshoot, and may tear a joint loose below the limit that
holds it at rest. Rigid dry friction would hold. With M at the pose and D the inertias that
`bristle` gets, a mode of M w = L D w has the damping L^-1/2. On the Panda in its ready pose L is up
to 13, so a sudden load in that mode tears a joint loose from 71 % of its limit on. A load that
rises within 0.5 s does not, up to 97 %.

The callback writes the bristles' friction as the control of an actuator `passive:<joint>`, held
over each physics step.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Annotated, Any

import mujoco

from smc_mujoco.common.constraints import Each, Number
from smc_mujoco.common.errors import ScenarioError, shown, unknown
from smc_mujoco.common.text import counted
from smc_mujoco.mechanisms.hardware.part import PASSIVE, Friction, joint_names
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, Plant

STICKING_SPEED = 1e-4  # rad/s or m/s, chosen: a joint that becomes slower than this sticks
# rad/s, natural, of a stuck joint, critically damped: chosen, two steps of 1 ms resolve it
BRISTLE_FREQUENCY = 200.0
MAX_EXPONENT = 700.0  # exp of more overflows

PerJoint = float | Sequence[float]  # one number for all joints, or one for each
NaturalPerJoint = Annotated[PerJoint, Each(one=Number(low=0.0, high=MAX_PARAMETER))]
PositivePerJoint = Annotated[PerJoint, Each(one=Number(above=0.0, high=MAX_PARAMETER))]


@dataclasses.dataclass(frozen=True)
class Sliding(Friction):
    """Base of frictions by a formula.

    A class states its numbers as fields. Each is one number for all joints that it acts on, or a
    sequence with one for each of them. With a number for each channel, it acts on all of them.
    """

    bristles = True  # of joints that do not move alone

    @property
    def names(self) -> tuple[str, ...]:
        """The fields, which the formula reads as p."""
        return tuple(field.name for field in dataclasses.fields(self) if field.name != "on")

    @staticmethod
    def value(v: float, motor: float, load: float, p: Any, /) -> tuple[float, float, float]:
        """Return F and the bounds low and high of the force at rest, N m (N).

        v is the speed of the joint, rad/s (m/s), motor the force of its drive in the physics step
        before, and load the sum of the other forces on it, N m (N): gravity, gyration, springs, the
        disturbances in a trace's d, and the contacts and limits of the step before, without the
        joint's damping. p has the numbers of its channel, by name.
        """
        raise NotImplementedError

    def check(self, plant: Plant) -> None:
        """Raise ScenarioError if it acts on a joint that is no channel of the plant, or a field is
        a sequence and does not have one number for each joint.
        """
        joints = self.joint_names(plant)
        for joint in joints:
            if joint not in (known := joint_names(plant)):
                raise unknown(f"joint of {type(self).__name__} on {plant.name}", joint, known)
        for name in self.names:
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) != len(joints):
                raise ScenarioError(
                    f"{type(self).__name__}'s {name} is {shown(value)}, and acts on "
                    f"{counted(len(joints), 'joint')} of {plant.name}: give one number, or "
                    f"{len(joints)}"
                )

    def parameters(self, i: int) -> tuple[float, ...]:
        """Return the numbers of its joint i that `value` reads as p; NaN for None."""
        return tuple(
            math.nan if (x := _of(getattr(self, name), i)) is None else x for name in self.names
        )

    def bristle(self, i: int, inertia: float) -> tuple[float, float]:
        """Return stiffness and critical damping of channel i when it sticks.

        The inertia of its joint, kg m^2 (kg), is that in MuJoCo's reference position qpos0, at the
        start of the run.
        """
        if not inertia > 0.0:
            raise ScenarioError(
                f"the inertia of joint {i} is {inertia:g}, and friction needs one above 0: "
                "give others"
            )
        stiffness = inertia * BRISTLE_FREQUENCY**2
        return stiffness, 2.0 * math.sqrt(stiffness * inertia)

    def edit(self, spec: mujoco.MjSpec) -> None:
        for joint in self.joints(spec):
            brake = spec.add_actuator(
                name=PASSIVE + joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
            )
            brake.set_to_motor()


def _of(value: Any, i: int) -> Any:
    """Return the value of joint i, from one value for all or a tuple with one for each."""
    return value[i] if isinstance(value, tuple) else value


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
