"""What a field of data or an argument may be, declared with its type:

`tau: Annotated[float, Number(low=0.0)]`.

Data whose __post_init__ calls `constrain`, and the arguments of a function with the decorator
`constrained`, are then what is declared, or a ScenarioError is raised. None passes if the type
names it, as `Positive | None` does. What depends on several values is checked by hand.
"""

import contextlib
import dataclasses
import functools
import inspect
import math
import typing
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TypeVar

import numpy as np

from smc_mujoco.common.aliases import ProgressTo
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, items_of, number, shown, unknown, warned, whole
from smc_mujoco.common.files import as_path

P = ParamSpec("P")
T = TypeVar("T")


class Constraint:
    """Base of constraints.

    Called with the name of a thing and a value, one returns the value as what it declares.
    """

    def __call__(self, what: str, value: Any) -> Any:
        raise NotImplementedError


@keyword_dataclass
class Number(Constraint):
    """A number > `above`, >= `low` and <= `high`, finite unless `infinite`, as a float."""

    above: float = -math.inf
    low: float = -math.inf
    high: float = math.inf
    infinite: bool = False

    def __call__(self, what: str, value: Any) -> float:
        return number(
            what,
            value,
            above=self.above,
            low=self.low,
            high=self.high,
            infinite=self.infinite,
        )


@keyword_dataclass
class Whole(Constraint):
    """A whole number from `low` to `high`, as an int; also inf if `infinite`."""

    low: int
    high: int
    infinite: bool = False

    def __call__(self, what: str, value: Any) -> float:
        if self.infinite and isinstance(value, float) and value == math.inf:
            return value
        return whole(what, value, self.low, self.high)


@keyword_dataclass
class SeedOf(Constraint):
    """A whole number from `low` to `high`, or a numpy Generator, from which one is drawn."""

    high: int
    low: int = 0

    def __call__(self, what: str, value: Any) -> int:
        if isinstance(value, np.random.Generator):
            return int(value.integers(self.low, self.high + 1))
        return whole(what, value, self.low, self.high)


@keyword_dataclass
class OneOf(Constraint):
    """One of some names."""

    names: Sequence[str]

    def __call__(self, what: str, value: Any) -> str:
        if isinstance(value, str) and value in self.names:
            return value
        raise unknown(what, value, self.names)


@keyword_dataclass
class Flag(Constraint):
    """True or False."""

    def __call__(self, what: str, value: Any) -> bool:
        if isinstance(value, bool | np.bool_):
            return bool(value)
        raise ScenarioError(f"{what} is {shown(value)}: give True or False")


class Shown(Flag):
    """Whether to show progress, or a function that is called with a text and the share done."""

    def __call__(self, what: str, value: Any) -> Any:
        return value if callable(value) else super().__call__(what, value)


@keyword_dataclass
class Each(Constraint):
    """A value that satisfies `item`, or a list with such a value for each channel, as a tuple."""

    item: Constraint

    def __call__(self, what: str, value: Any) -> Any:
        is_list = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str | bytes)
        if not is_list or not getattr(value, "ndim", 1):
            return self.item(what, value)
        if not (listed := items_of(what, value)):
            raise ScenarioError(
                f"{what} is {shown(value)}: give a number, or one for each driven channel"
            )
        checked = []
        for i, item in enumerate(listed):
            checked.append(self.item(f"{what}[{i}]", item))
        return tuple(checked)


@keyword_dataclass
class Range(Constraint):
    """Two numbers, as `Number` declares them, the lowest first; also infinite ones if
    `infinite`.
    """

    above: float = -math.inf
    low: float = -math.inf
    infinite: bool = False

    def __call__(self, what: str, value: Any) -> tuple[float, float]:
        if not isinstance(value, tuple | list) or len(value) != 2:
            raise ScenarioError(
                f"{what} is {shown(value)}: give the lowest and the highest, as (0.7, 1.3)"
            )
        low = self._end(what, value[0])
        high = self._end(what, value[1])
        if low > high:
            raise ScenarioError(f"{what} is from {low:g} to {high:g}: give the lowest first")
        return low, high

    def _end(self, what: str, value: Any) -> float:
        if self.infinite and isinstance(value, float) and math.isinf(value):
            return value
        return number(what, value, above=self.above, low=self.low)


@keyword_dataclass
class Called(Constraint):
    """A function."""

    def __call__(self, what: str, value: Any) -> Any:
        if not callable(value):
            raise ScenarioError(f"{what} is {shown(value)}: give a function")
        return value


@keyword_dataclass
class FilePath(Constraint):
    """The path of a file or folder, as a Path."""

    def __call__(self, what: str, value: Any) -> Path:
        return as_path(value, what)


@keyword_dataclass
class OrNone(Constraint):
    """None, or what satisfies `item`."""

    item: Constraint

    def __call__(self, what: str, value: Any) -> Any:
        if value is None:
            return None
        return self.item(what, value)


MAX_SEED = 2**53 - 1  # a float64 holds every whole number up to it exactly

Boolean = Annotated[bool, Flag()]
# whether to show it, or what is called with a text and the share that is done
Progress = Annotated[ProgressTo, Shown()]
Finite = Annotated[float, Number()]
Natural = Annotated[float, Number(low=0.0)]
Positive = Annotated[float, Number(above=0.0)]
Bound = Annotated[float, Number(above=0.0, infinite=True)]  # inf: no bound
Probability = Annotated[float, Number(low=0.0, high=1.0)]
Seed = Annotated[int, SeedOf(high=MAX_SEED)]
Timeout = Annotated[float, Number(above=0.0, high=86_400.0)]  # s, a day at most


def of_type(kind: Any) -> Constraint | None:
    """Return the constraint in a type, which lets None pass if the type names it; None without
    one.
    """
    if typing.get_origin(kind) is Annotated:
        notes = typing.get_args(kind)[1:]
        for note in notes:
            if isinstance(note, Constraint):
                return note
        return None
    options = typing.get_args(kind)
    constraint = next(filter(None, map(of_type, options)), None)
    if constraint and type(None) in options:
        return OrNone(item=constraint)
    return constraint


@functools.cache
def of_fields(kind: type) -> dict[str, Constraint]:
    """Return the constraint of each field of a class of data that declares one."""
    types = {field.name: field.type for field in dataclasses.fields(kind)}
    if any(isinstance(declared, str) for declared in types.values()):
        with contextlib.suppress(NameError):  # names that only a type checker imports
            hints = typing.get_type_hints(kind, include_extras=True)
            for name in types:
                types[name] = hints[name]
    return _declared(types)


@functools.cache
def of_parameters(function: Callable) -> dict[str, Constraint]:
    """Return the constraint of each parameter that declares one."""
    return _declared(function.__annotations__)


def _declared(types: dict[str, Any]) -> dict[str, Constraint]:
    constraints = {}
    for name, declared in types.items():
        if constraint := of_type(declared):
            constraints[name] = constraint
    return constraints


def constrain(data: Any) -> None:
    """Replace the fields of frozen data that declare a constraint by what it makes of them."""
    for name, constraint in of_fields(type(data)).items():
        value = constraint(f"{type(data).__name__}'s {name}", getattr(data, name))
        object.__setattr__(data, name, value)


def suggesting(kind: type[T]) -> type[T]:
    """Make the TypeError for a field that a class of data does not have say which may be meant."""
    make = kind.__init__
    _, *parameters = inspect.signature(make).parameters.values()
    names = [parameter.name for parameter in parameters]
    by_name = all(parameter.kind is parameter.KEYWORD_ONLY for parameter in parameters)

    def made(self: T, *args: Any, **fields: Any) -> None:
        for name in fields:
            if name not in names:
                meant = getattr(kind, "synonyms", {}).get(name, name)
                raise TypeError(_unexpected(kind.__name__, name, meant, names))
        if args and by_name:
            raise TypeError(
                f"{kind.__name__} takes its fields by name: write {kind.__name__}({names[0]}=...)"
            )
        make(self, *args, **fields)

    vars(made)["__signature__"] = inspect.signature(make)
    kind.__init__ = made
    return kind


def _unexpected(what: str, name: str, meant: str, known: Iterable[str]) -> str:
    """Return the words of a TypeError for an unknown argument, with those that may be meant."""
    hint = str(unknown("argument", meant, known)).partition(": ")[2]
    return f"{what}() got an unexpected keyword argument {name!r}: {hint}"


def constrained(function: Callable[P, T]) -> Callable[P, T]:
    """Check the arguments of each call whose parameters declare a constraint or are flags, before
    the function runs.
    """
    kinds = function.__annotations__.items()
    flags = {}
    for name, kind in kinds:
        if kind is bool:
            flags[name] = Flag()
    constraints = flags | of_parameters(function)
    signature = inspect.signature(function)

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError as error:
            unexpected = [name for name in kwargs if name not in signature.parameters]
            if not unexpected:
                return function(*args, **kwargs)  # raises it in the function's own words
            name = unexpected[0]
            words = _unexpected(function.__name__, name, name, signature.parameters)
            raise TypeError(words) from error
        for name, constraint in constraints.items():
            if name in bound.arguments:
                bound.arguments[name] = constraint(name, bound.arguments[name])
        token = warned.set(warned.get(set()))
        try:
            return function(*bound.args, **bound.kwargs)
        finally:
            warned.reset(token)

    return checked
