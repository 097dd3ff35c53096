"""Parts that are one function of a joint: of its speed, its load and its command."""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a function or a property here)
import dataclasses
import math
from collections.abc import Sequence
from typing import Annotated, Any

from smc_mujoco.common.aliases import Floats, Names
from smc_mujoco.common.constraints import Each, Number
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError, shown, unknown
from smc_mujoco.common.text import counted
from smc_mujoco.mechanisms.hardware.moments import Run
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction, Part
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, Plant

PerJoint = float | Sequence[float]  # one number for all joints, or one for each
NumberPerJoint = Annotated[PerJoint, Each(item=Number(low=-MAX_PARAMETER, high=MAX_PARAMETER))]


def of_joint(value: Any, i: int) -> float:
    """Return the value of joint i, from one for all or a tuple with one for each; NaN for None."""
    if isinstance(value, tuple):
        value = value[i]
    return math.nan if value is None else value


@frozen_data
class JointPart(Part):
    """Base of parts that are a function of one joint.

    A class states its numbers as fields. Each is one number for all joints that it acts on, or a
    sequence with one for each of them. With a number for each channel, a friction acts on all of
    them.
    """

    @property
    def per_joint(self) -> Names:
        """Names of the fields that are numbers of a joint."""
        return tuple(field.name for field in dataclasses.fields(self) if not field.kw_only)

    @property
    def names(self) -> Names:
        """The fields, which the function reads as p."""
        return self.per_joint

    def parameters(self, i: int) -> Floats:
        """Return the numbers of its joint i; NaN for None."""
        return tuple(of_joint(getattr(self, name), i) for name in self.per_joint)

    def numbers(self, run: Run) -> list[Sequence[float]]:
        return [self.parameters(i) for i in range(run.n)]

    def check_lengths(self, plant: Plant, count: int) -> None:
        """Raise ScenarioError if a field is a sequence and does not have `count` numbers, one for
        each joint that it acts on.
        """
        for name in self.per_joint:
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) != count:
                raise ScenarioError(
                    f"{type(self).__name__}'s {name} is {shown(value)}, and acts on "
                    f"{counted(count, 'joint')} of {plant.name}: give one number, or {count}"
                )


@frozen_data
class JointForce(JointPart, Friction):
    """Base of frictions that are a function of one joint."""

    def check(self, plant: Plant) -> None:
        """Raise ScenarioError if it acts on a joint that is no channel of the plant, or a field has
        too few numbers.
        """
        joints = self.joint_names(plant)
        for joint in joints:
            if joint not in (names := channel_names(plant)):
                raise unknown(f"joint of {type(self).__name__} on {plant.name}", joint, names)
        self.check_lengths(plant, len(joints))


@frozen_data
class Drive(JointPart, Actuator):
    """Base of drives that are a function of one joint: among others of its command y.u."""

    in_callback = True
    is_drive = True

    def suits(self, s: Any, chain: Sequence[Actuator]) -> None:
        drives = [part for part in chain if part.drives]
        if len(drives) > 1:
            raise ScenarioError(
                f"actuator has the drives {shown(tuple(drives))}, and {type(self).__name__} takes "
                "the command itself: give it alone, or with what follows a drive"
            )
        channels = self.channels(s.plant)
        self.check_lengths(s.plant, len(channels))
