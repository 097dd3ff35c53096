"""A friction or a drive from a Python function, which is compiled as a law is."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

from smc_mujoco.common.aliases import Fields, Numbers
from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.common.frozen import frozen
from smc_mujoco.mechanisms.hardware.joint_force import Drive, JointForce, JointPart, NumberPerJoint
from smc_mujoco.mechanisms.hardware.own_friction import (
    BESIDE_REST,
    OWN,
    HeldForce,
    OwnFriction,
    is_of_speed,
    returns_bounds,
)
from smc_mujoco.mechanisms.plant import MAX_PARAMETER

MAX_MEMORY = 1000  # numbers of a joint; chosen


def friction_function(
    *, numbers: Numbers | None = None, memory: int = 0
) -> Callable[[Callable], Callable[..., JointForce]]:
    """Turn a function (y, p, memory) -> level of friction, N m (N), into a kind of friction.

        @smc.hardware.friction_function(numbers={"coulomb": 0.2, "static": 0.5, "speed": 0.1})
        def stribeck(y, p, memory):
            return p.coulomb + (p.static - p.coulomb) * math.exp(-((y.v / p.speed) ** 2))

        smc.Scenario(plant="duffing", law="pid", friction=stribeck(static=0.3))

    y is a JointState of the start of a physics step or of a stage: t, h, x, v, u, motor and load,
    in SI units. p has the numbers of the joint by name, and memory is the joint's own, 0 at the
    start.

    The function returns the level at the speed y.v, 0 or more. Friction has the sign that resists,
    and holds a joint at rest up to the level at y.v = 0, as `ServoFriction` does. Or it returns
    three numbers: F, the force with its sign that a joint needs to move against friction, and low
    and high, the bounds of the force that holds at rest; 0 and 0 if nothing does.

    With a memory, one number is a force on the joint, with its sign, that is held over the step, as
    for bristles: y.h times its slope in y.v must stay below the joint's inertia.

    Args:
      numbers: names of the numbers that it reads as p, with their defaults. In the friction each is
        one number, or one for each joint.
      memory: how many numbers it keeps for each joint, 0 or more.

    Returns:
      A decorator. The decorated function, called with its numbers, returns the friction of a
      Scenario.

    Raises:
      ScenarioError: for a name or a number that cannot be one. A scenario refuses a friction that
        flips its sign at v = 0, or whose level is negative beside it; elsewhere that ends the run.
    """
    return functools.partial(_friction, numbers, memory)


def _friction(numbers: Numbers | None, memory: int, function: Callable) -> Any:
    size = _size(memory, function)
    if size and not returns_bounds(function, frozen({} if numbers is None else numbers), size):
        space = {"memory": size, "force": staticmethod(function)}
        return _part_class(HeldForce, numbers, space, function)
    space = {"memory": OWN + 2 * size, "own_memory": size, "function": staticmethod(function)}
    space["of_speed"] = not size and is_of_speed(
        function, frozen({} if numbers is None else numbers)
    )
    return _part_class(OwnFriction, numbers, space, function)


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
    return functools.partial(_drive, numbers, memory, delay)


def _drive(numbers: Numbers | None, memory: int, delay: float, function: Callable) -> Any:
    space = {"memory": _size(memory, function), "delay": delay, "force": staticmethod(function)}
    return _part_class(Drive, numbers, space, function)


def _size(memory: int, function: Callable) -> int:
    return int(number(f"memory of {function.__name__}", memory, low=0, high=MAX_MEMORY))


def _part_class(
    base: type[JointPart], numbers: Numbers | None, space: Fields, function: Callable
) -> Any:
    name = function.__name__
    taken = {*dir(base), *BESIDE_REST}
    fields = []
    for key, value in frozen({} if numbers is None else numbers).items():
        if not (isinstance(key, str) and key.isidentifier()) or key in taken:
            raise ScenarioError(f"{name} has the number {shown(key)}: give it another name")
        default = number(f"{key} of {name}", value, low=-MAX_PARAMETER, high=MAX_PARAMETER)
        fields.append((key, NumberPerJoint, dataclasses.field(default=default)))
    space = space | {
        "__doc__": function.__doc__,
        "__module__": function.__module__ or "__main__",
        "__qualname__": function.__qualname__,
    }
    return dataclasses.make_dataclass(name, fields, bases=(base,), namespace=space, frozen=True)
