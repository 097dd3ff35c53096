"""Friction of a user's own, by a function that says how large it is, and which holds at rest.

    @smc.hardware.friction_function(numbers={"coulomb": 0.2, "static": 0.5, "speed": 0.1})
    def stribeck(y, p, memory):
        return p.coulomb + (p.static - p.coulomb) * math.exp(-((y.v / p.speed) ** 2))

    smc.Scenario(plant="duffing", law="pid", friction=stribeck(static=0.3))

The function returns one of two things:

- its level at the speed y.v, N m (N), 0 or more: `p.b * abs(y.v)` is viscous friction. Friction has
  the sign that resists. At rest it holds any force up to the level at y.v = 0.
- F, low, high: the force F, with its sign, that a joint needs to move against it, and the bounds of
  the force that it holds at rest. If it holds none, low and high are 0.

How a joint then stops, rests and breaks away is in sliding.py. If all that a function does with y
is to read y.v, and it reads nothing of its file, what its level is at rest and just beside it does
not change in a run. So these levels are numbers of the friction, and the function is called only
while the joint moves.

With a memory, F, low and high may depend on what the function keeps, such as a temperature. The
function moves its memory once a step. If a function with a memory returns one number, this is a
force on the joint, with its sign, that is held over the step: see `joint_force.HeldForce`.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a function or a property here)
import dis
import functools
import itertools
import math
import types as kinds
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar

import numpy as np
from numba import njit, types
from numba.extending import overload, register_jitable

from smc_mujoco.common.aliases import Floats, Names
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.jit import named
from smc_mujoco.common.rebuild import names_in
from smc_mujoco.mechanisms.hardware.joint_force import JointForce, of_joint
from smc_mujoco.mechanisms.hardware.moments import JointState
from smc_mujoco.mechanisms.hardware.sliding import (
    SLIDES,
    STICKING_SPEED,
    Formula,
    Sliding,
)
from smc_mujoco.mechanisms.plant import Plant

OWN = SLIDES + 1  # where the memory of the function begins; a copy for further calls follows it
# of a friction at ten times STICKING_SPEED: one that has more at this speed has a step at rest
STEP_SHARE = 0.5
# of a level that depends on the speed alone: name of a number -> the speed at which this is it
BESIDE_REST = {"level_at_0": 0.0, "level_above_0": STICKING_SPEED, "level_below_0": -STICKING_SPEED}
LOADS = "LOAD_FAST", "LOAD_FAST_BORROW"  # ends of instructions that load a variable last
NO_MEMORY = np.zeros(0)


@frozen_data
class OwnFriction(Sliding):
    """Base of frictions whose function returns a level, or F, low and high."""

    function: ClassVar[Callable]
    own_memory: ClassVar[int] = 0
    of_speed: ClassVar[bool] = False  # whether it is a level that depends on the speed alone

    @property
    def levels(self) -> tuple[Floats, ...]:
        """Its levels at BESIDE_REST, of each joint or of all; () if they are not known."""
        if not self.of_speed:
            return ()
        values = tuple(getattr(self, name) for name in self.per_joint)
        return _levels(type(self).function, self.per_joint, values)

    @property
    def names(self) -> Names:
        return self.per_joint + tuple(BESIDE_REST) if self.levels else self.per_joint

    def parameters(self, i: int) -> Floats:
        numbers = super().parameters(i)
        levels = self.levels
        if not levels:
            return numbers
        return numbers + levels[i if len(levels) > 1 else 0]

    @property
    def formula(self) -> Formula:
        """F and its bounds as functions that compiled code calls."""
        if self.levels:
            return _by_speed(type(self).function)
        return _by_function(type(self).function, self.own_memory)

    @property
    def written(self) -> tuple[Callable, int]:
        """The user's function, and the numbers that it may index."""
        return type(self).function, self.own_memory

    @property
    def steady(self) -> Callable | None:
        return None if self.own_memory else super().steady

    def check(self, plant: Plant) -> None:
        super().check(plant)
        for function in _beside_rest(self, self.own_memory, len(self.joint_names(plant)), 1.0):
            _check_signs(type(self).__name__, function)


@frozen_data
class HeldForce(JointForce):
    """Base of frictions whose function, with a memory, returns a force that is held over a step."""

    def check(self, plant: Plant) -> None:
        super().check(plant)
        for function in _beside_rest(self, self.memory, len(self.joint_names(plant)), 0.0):
            ahead, back = function(STICKING_SPEED), function(-STICKING_SPEED)
            if not isinstance(ahead, tuple) and ahead * back and _step(function, ahead):
                raise ScenarioError(
                    f"friction {type(self).__name__} is {ahead:g} just above v = 0 and {back:g} "
                    "just below, and a force that is held over a step holds no joint at rest: "
                    "return F, low, high, the force F that resists and the bounds of what it holds"
                )


@functools.cache
def _by_function(function: Callable, size: int) -> Formula:
    """Return the formula of a user's function with a memory of some numbers."""
    function = njit(function)

    @njit
    def found(y, v, p, memory):
        own = memory[OWN + size : OWN + 2 * size]
        own[:] = memory[OWN : OWN + size]
        return function(at_speed(y, v), p, own)

    @njit
    def first(y, v, p, memory):
        return function(at_speed(y, v), p, memory[OWN : OWN + size])

    @njit
    def bounds(at_v, y, v, p, memory):
        return _bounds(at_v, at_v if v == 0.0 else found(y, 0.0, p, memory))

    @njit
    def at(y, v, p, memory):
        return _force(found(y, v, p, memory), v)

    @njit
    def beside(y, v, p, memory):
        return at(y, math.copysign(STICKING_SPEED, v), p, memory)

    return Formula(first, _force, bounds, at, beside, True, function.py_func.__module__)


@functools.cache
def _by_speed(function: Callable) -> Formula:
    """Return the formula of a user's level whose numbers have what it is at BESIDE_REST.

    In a step in which the other forces alone stop the joint, the level is that just above rest: so
    the function is not called, and the friction is as near to its mean over the step.
    """
    function = njit(function)

    @njit
    def at(y, v, p, memory):
        return resisting(float(function(at_speed(y, v), p, memory[OWN:OWN])), v)

    @njit
    def beside(y, v, p, memory):
        return math.copysign(p.level_above_0 if v > 0.0 else p.level_below_0, v)

    @njit
    def first(y, v, p, memory):
        if v == 0.0:
            return p.level_at_0
        speed_lost = -math.copysign(y.h * y.mobility, v) * (y.others + y.mean)
        if abs(v) <= speed_lost and p.level_at_0 > 0.0:
            return beside(y, v, p, memory)
        return at(y, v, p, memory)

    @njit
    def bounds(found, y, v, p, memory):
        return -p.level_at_0, p.level_at_0

    return Formula(first, math.copysign, bounds, at, beside, True, function.py_func.__module__)


@register_jitable
def at_speed(y, v):
    """Return the state of a joint as if its speed were v."""
    return JointState(
        y.t, y.h, y.x, v, y.u, y.motor, y.load, y.stage, y.others, y.mean, y.level, y.mobility
    )


@register_jitable
def resisting(found, v):
    """Return the level that was found with the sign that resists the speed v."""
    if found < 0.0:
        raise ValueError("it is negative: return a level of 0 or more, or F, low, high")
    return math.copysign(found, v)


def _force(found, v):
    """Return F of what a user's function returned at the speed v."""
    return found[0] if isinstance(found, tuple) else resisting(found, v)


def _bounds(found, resting):
    """Return low and high of what a user's function returned at a speed, and at rest."""
    if isinstance(found, tuple):
        return found[1], found[2]
    return -resting, resting


@overload(_force)
def _force_of(found, v):
    if isinstance(found, types.BaseTuple):
        return lambda found, v: found[0]
    return resisting


@overload(_bounds)
def _bounds_of(found, resting):
    if isinstance(found, types.BaseTuple):
        return lambda found, resting: (found[1], found[2])
    return lambda found, resting: (-resting, resting)


def returns_bounds(function: Callable, numbers: Mapping[str, float], memory: int) -> bool:
    """Return whether a function returns F, low, high; False if it raises, which its run says."""
    try:
        p = named(tuple(numbers))(*(numbers.values() or (0.0,)))
        return isinstance(function(_state(0.1, 1.0), p, np.zeros(memory)), tuple)
    except Exception:
        return False


def is_of_speed(function: Callable, numbers: Mapping[str, float]) -> bool:
    """Return whether a function without a memory returns a level that depends on the speed alone:
    all that it does with its first argument y is to read y.v, and it reads nothing of its file.
    """
    function = getattr(function, "py_func", function)
    code = getattr(function, "__code__", None)
    if code is None or not code.co_argcount or _reads_its_file(function):
        return False
    if not _levels(function, tuple(numbers), tuple(numbers.values())):
        return False
    state = code.co_varnames[0]
    for instruction, following in itertools.pairwise(dis.get_instructions(code)):
        names = (
            instruction.argval if isinstance(instruction.argval, tuple) else (instruction.argval,)
        )
        if state not in names:
            continue
        loads = instruction.opname.endswith(LOADS) and names.index(state) == len(names) - 1
        if not (loads and following.opname == "LOAD_ATTR" and following.argval == "v"):
            return False
    return True


def _reads_its_file(function: Callable) -> bool:
    """Return whether a function reads a number or calls a function of its file.

    Compiled code keeps the values that these had, and its levels at rest would be of later ones.
    """
    lasting = kinds.NoneType, kinds.ModuleType, kinds.BuiltinFunctionType, np.ufunc
    for name in names_in(function.__code__).variables:
        if not isinstance(function.__globals__.get(name), lasting):
            return True
    return False


@functools.lru_cache(maxsize=256)
def _levels(function: Callable, names: Names, values: tuple) -> tuple[Floats, ...]:
    """Return the levels of a user's function at BESIDE_REST, in Python, of each joint or of all; ()
    if it raises, which its run says.

    The values of the names are numbers, or one for each joint.
    """
    joints = 1
    for value in values:
        if isinstance(value, tuple):
            joints = len(value)
    levels_by_joint = []
    for i in range(joints):
        numbers = []
        for value in values:
            numbers.append(of_joint(value, i))
        p = named(names)(*(numbers or (0.0,)))
        levels = []
        for v in BESIDE_REST.values():
            joint = _state(v, 0.0)
            try:
                level = function(joint, p, NO_MEMORY)
                levels.append(float(level))
            except Exception:
                return ()
        levels_by_joint.append(tuple(levels))
    return tuple(levels_by_joint)


def _state(v: float, load: float) -> JointState:
    """Return a joint at a speed and under a load, at which a function is looked at before a run."""
    return JointState(t=0.0, h=1e-3, x=load, v=v, u=load, motor=load, load=load)


def _beside_rest(
    part: Any, memory: int, joints: int, load: float
) -> Iterator[Callable[[float], Any]]:
    """Yield for each joint a function: speed -> what the user's function returns of it in Python
    under a load, with a fresh memory; none if that raises, which the run says.
    """
    function = getattr(part, "function", None) or type(part).force
    for i in range(joints):
        p = named(part.names)(*(part.parameters(i) or (0.0,)))

        def level_at(v: float, p: Any = p) -> Any:
            returned = function(_state(v, load), p, np.zeros(memory))
            if np.shape(returned) not in ((), (3,)) or not np.all(np.isreal(returned)):
                raise ScenarioError(
                    f"friction {type(part).__name__} returns {shown(returned)}: return its level, "
                    "or F, low, high"
                )
            return returned

        try:
            level_at(STICKING_SPEED)
            level_at(0.0)
        except ScenarioError:
            raise
        except Exception:
            continue
        yield level_at


def _step(function: Callable[[float], float], ahead: float) -> bool:
    """Return whether a friction is a step at rest, from its value at STICKING_SPEED."""
    return abs(ahead) > STEP_SHARE * abs(function(10.0 * STICKING_SPEED))


def _check_signs(name: str, function: Callable[[float], Any]) -> None:
    """Raise ScenarioError for what cannot be a friction that holds, by its values beside rest."""
    ahead = function(STICKING_SPEED)
    back = function(-STICKING_SPEED)
    rest = function(0.0)
    if isinstance(ahead, tuple):
        if ahead[1] > ahead[2]:
            raise ScenarioError(
                f"friction {name} returns low {ahead[1]:g} and high {ahead[2]:g}: give F, low, "
                "high, with low <= high"
            )
        return
    if ahead * back < 0.0 and _step(function, ahead):
        raise ScenarioError(
            f"friction {name} flips from {back:g} to {ahead:g} at v = 0, and a force holds no "
            "joint at rest: return its level without the sign, and the joint is held up to it"
        )
    for place, level in (("just below", back), ("at", rest), ("just above", ahead)):
        if level < 0.0:
            raise ScenarioError(
                f"friction {name} is {level:g} {place} v = 0: return a level of 0 or more, as "
                "p.b * abs(y.v), which gets the sign that resists; a force with a sign of its own "
                "is F, low, high"
            )
    if rest == 0.0 and ahead > 0.0 and _step(function, ahead):
        raise ScenarioError(
            f"friction {name} is {ahead:g} just above v = 0 and 0 at v = 0, so it holds no joint "
            "at rest: return the level at v = 0, too"
        )
