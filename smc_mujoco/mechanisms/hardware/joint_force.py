"""A friction or a drive that is one function of a joint's speed, load and command.

    @smc.hardware.friction_function(numbers={"stiffness": 500.0, "level": 0.3}, memory=1)
    def dahl(y, p, memory):
        bend = math.copysign(p.level / p.stiffness, y.v)
        force = -p.stiffness * memory[0]
        memory[0] = bend + (memory[0] - bend) * math.exp(-abs(y.v) * y.h / abs(bend))
        return force

    smc.Scenario(plant="cart_pole", law="hierarchical", friction=dahl(level=(0.5, 0.01)))

The function is compiled as a law is. It is called once a physics step for each joint, and its
force, N m (N), is held over the step. y is a JointState, p has the numbers of the joint by name,
and memory is the joint's own, 0 at the start. A force on y.v must be weak: a step times its slope
stays below the joint's inertia. Keep states by their solution over y.h, as here: Euler's step of
this friction diverges where stiffness |y.v| y.h exceeds 2 level.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a function or a property here)
import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any

from smc_mujoco.common.aliases import Fields, Floats, Names, Numbers
from smc_mujoco.common.constraints import Each, Number
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError, number, shown, unknown
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.text import counted
from smc_mujoco.mechanisms.hardware.moments import Run
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction, Part
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, Plant

PerJoint = float | Sequence[float]  # one number for all joints, or one for each
NumberPerJoint = Annotated[PerJoint, Each(one=Number(low=-MAX_PARAMETER, high=MAX_PARAMETER))]
MAX_MEMORY = 1000  # numbers of a joint; chosen


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
            if joint not in (known := channel_names(plant)):
                raise unknown(f"joint of {type(self).__name__} on {plant.name}", joint, known)
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
        self.check_lengths(s.plant, len(self.channels(s.plant)))


def friction_function(
    *, numbers: Numbers | None = None, memory: int = 0
) -> Callable[[Callable], Callable[..., JointForce]]:
    """Turn a function (y, p, memory) -> force on a joint, N m (N), into a kind of friction.

    The force is held over a step: y.h times its slope in y.v must stay below the joint's inertia.

    Args:
      numbers: names of the numbers that it reads as p, with their defaults. In the friction each is
        one number, or one for each joint.
      memory: how many numbers it keeps for each joint, 0 or more.

    Raises:
      ScenarioError: for a name or a number that cannot be one.
    """
    return functools.partial(_made, JointForce, numbers, memory, {})


def actuator_function(
    *, numbers: Numbers | None = None, memory: int = 0, delay: float = 0.0
) -> Callable[[Callable], Callable[..., Drive]]:
    """Turn a function (y, p, memory) -> force of a drive, N m (N), into a kind of actuator.

        @smc.hardware.actuator_function(numbers={"dead": 0.1})
        def dead_zone(y, p, memory):
            return y.u if abs(y.u) > p.dead else 0.0

    Args:
      numbers, memory: as in `friction_function`.
      delay: s, the time constant with which the force follows y.u, 0 or more. The default physics
        step resolves it.

    Returns:
      A decorator. The decorated function, called with its numbers, returns the actuator of a
      Scenario.

    Raises:
      ScenarioError: for a name or a number that cannot be one.
    """
    number("delay", delay, low=0.0)
    return functools.partial(_made, Drive, numbers, memory, {"delay": delay})


def _made(
    base: type[JointPart],
    numbers: Numbers | None,
    memory: int,
    space: Fields,
    function: Callable,
) -> Any:
    name = function.__name__
    taken = set(dir(base))
    fields = []
    for key, value in frozen({} if numbers is None else numbers).items():
        if not (isinstance(key, str) and key.isidentifier()) or key in taken:
            raise ScenarioError(f"{name} has the number {shown(key)}: give it another name")
        default = number(f"{key} of {name}", value, low=-MAX_PARAMETER, high=MAX_PARAMETER)
        fields.append((key, NumberPerJoint, dataclasses.field(default=default)))
    space = space | {
        "memory": int(number(f"memory of {name}", memory, low=0, high=MAX_MEMORY)),
        "force": staticmethod(function),
        "__doc__": function.__doc__,
        "__module__": function.__module__,
        "__qualname__": function.__qualname__,
    }
    return dataclasses.make_dataclass(name, fields, bases=(base,), namespace=space, frozen=True)
