"""A component: a pure function with named gains and a memory - what laws, surfaces and estimators are made of.

A `Template` is the function with its default gains; calling it with gains gives a `Component`, plain data that a
Scenario holds. The function is called as `function(y, gains, memory)`: y and gains are read by attribute, memory is a
float array, zero at the start of a run, one per channel, free to change.
"""

import dataclasses
import importlib
import inspect
import keyword
import math
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping
from types import SimpleNamespace

from smc_mujoco.common import errors
from smc_mujoco.common.errors import ScenarioError, number, shown, unknown, users_frame, whole
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.registry import modules


@dataclasses.dataclass(frozen=True, kw_only=True)
class Component:
    """A function bound to its gains. `function` is None when a loaded trace names one that is not at hand."""

    kind: str
    name: str
    gains: Mapping[str, float]
    memory: int
    function: Callable | None
    degree: int = 1
    plants: tuple[str, ...] = ()
    modelled: bool = False

    def __repr__(self) -> str:
        return f"{self.kind}({', '.join([repr(self.name), *(f'{k}={v:g}' for k, v in self.gains.items())])})"

    def __reduce__(self):
        """By the name of its template: that of the decorated function no longer leads to it."""
        home = getattr(self.function, "__module__", ""), getattr(self.function, "__qualname__", "?")
        found = _at(*home)
        if isinstance(found, Template) and found.function is self.function:
            return _bind, (*home, dict(self.gains))
        return super().__reduce__()

    def __post_init__(self):
        gains = {name: number(f"{self.name}'s {name}", gain, infinite=True) for name, gain in self.gains.items()}
        object.__setattr__(self, "gains", frozen(gains))
        whole(f"memory of {self.name}", self.memory, 1, 10_000)

    def __str__(self):
        return f"{self.name}({', '.join(f'{k}={v:g}' for k, v in self.gains.items())})"


def _at(module: str, name: str) -> object:
    """What stands in a module under a dotted name, or None."""
    found: object = sys.modules.get(module)
    for part in name.split("."):
        found = getattr(found, part, None)
    return found


def _bind(module: str, name: str, gains: dict[str, float]) -> Component:
    importlib.import_module(module)
    template = _at(module, name)
    assert isinstance(template, Template)
    return template.bind(gains)


class GainWarning(UserWarning):
    """Gains that miss a condition under which the law's theorem holds."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Template:
    """A function, its default gains and how many floats of memory it keeps per channel.

    Attributes:
      degree: relative degree of the sliding variable that a law needs, or that a surface gives.
      conditions: what a theorem asks of the gains, in words -> whether gains, read by attribute, satisfy it.
      plants: names of the plants it is for; empty: every one.
      modelled: whether it cannot do without the nominal model.
    """

    kind: str
    name: str
    function: Callable
    defaults: Mapping[str, float]
    memory: int
    positive: frozenset[str]
    nonnegative: frozenset[str]
    degree: int = 1
    conditions: Mapping[str, Callable[[SimpleNamespace], bool]] = dataclasses.field(default_factory=dict)
    plants: tuple[str, ...] = ()
    modelled: bool = False

    @property
    def doc(self) -> str:
        """The docstring of the function's module if it has a file of its own, else the function's."""
        module = inspect.getmodule(self.function)
        own = module is not None and module.__name__.rsplit(".", 1)[-1] == self.name
        return inspect.cleandoc((module.__doc__ if own and module else self.function.__doc__) or self.name)

    def __call__(self, **gains: float) -> Component:
        """The function with some of its gains changed; errors and warnings as `bind`."""
        return self.bind(gains, warn=True)

    def bind(self, gains: Mapping[str, float], warn: bool = False) -> Component:
        """The function with some of its gains changed.

        Args:
          gains: name -> value.
          warn: whether to warn; not of gains that were warned of before.

            Raises:
              ScenarioError: unknown gain, not a finite number, or not positive where it must be.

        Warns:
          GainWarning: gains that miss a condition of the theorem behind it.
        """
        values = dict(self.defaults)
        for key, value in gains.items():
            if key not in values:
                raise unknown(f"gain of {self.name}", key, values)
            above = 0.0 if key in self.positive else -math.inf
            least = 0.0 if key in self.nonnegative else -math.inf
            endless = math.isinf(self.defaults[key])
            values[key] = number(f"{self.name}'s {key}", value, above=above, least=least, infinite=endless)
        for words, holds in self.conditions.items():
            if warn and not _holds(holds, SimpleNamespace(**values)):
                given = ", ".join(f"{name} = {value:g}" for name, value in values.items())
                warnings.warn(f"{self.kind} {self.name!r} asks for {words}, but {given}", GainWarning, users_frame())
        return Component(
            kind=self.kind,
            name=self.name,
            gains=values,
            memory=self.memory,
            function=self.function,
            degree=self.degree,
            plants=self.plants,
            modelled=self.modelled,
        )


def _holds(condition: Callable[[SimpleNamespace], bool], gains: SimpleNamespace) -> bool:
    """Whether gains satisfy a condition; those for which it cannot be worked out do not."""
    try:
        return condition(gains)
    except (ArithmeticError, ValueError):
        return False


def template(
    kind: str,
    gains: Mapping[str, float] | None,
    memory: int,
    positive: Iterable[str],
    nonnegative: Iterable[str],
    degree: int = 1,
    conditions: Mapping[str, Callable[[SimpleNamespace], bool]] | None = None,
    plants: Iterable[str] = (),
    modelled: bool = False,
) -> Callable[[Callable], Template]:
    """A decorator that makes a Template of a function.

    Raises:
      ScenarioError: a gain's name is no identifier, its default no number, memory no whole number in 1 .. 10000, or
        the function's name longer than 100 characters.
    """
    if not isinstance(gains, Mapping | None):
        raise ScenarioError(f"gains is {shown(gains)}: give names with their defaults, such as {{'k1': 3.0}}")
    for key in gains or {}:
        if not isinstance(key, str) or not key.isidentifier() or key.startswith("_") or keyword.iskeyword(key):
            raise ScenarioError(f"gain {shown(key)} cannot be written as gains.name: call it something like 'k1'")
    defaults = {key: number(f"default of gain {key}", value, infinite=True) for key, value in (gains or {}).items()}
    size, degree = whole("memory", memory, 1, 10_000), whole("degree", degree, 1, 10)
    if isinstance(plants, str):
        raise ScenarioError(f"plants is {shown(plants)}: give several names, such as ({plants!r},)")
    if not isinstance(conditions, Mapping | None) or not all(map(callable, (conditions or {}).values())):
        raise ScenarioError(f"conditions is {shown(conditions)}: give words with functions of the gains")
    for name in (*positive, *nonnegative):
        if name not in defaults:
            raise unknown("gain with a sign", name, defaults)

    def decorate(function: Callable) -> Template:
        name = errors.name(f"name of the {kind}", getattr(function, "__name__", type(function).__name__))
        try:
            inspect.signature(getattr(function, "py_func", function)).bind(None, None, None)
        except TypeError as error:
            raise ScenarioError(f"{kind} {name!r} takes (y, gains, memory): {error}") from None
        return Template(
            kind=kind,
            name=name,
            function=function,
            defaults=defaults,
            memory=size,
            positive=frozenset(positive),
            nonnegative=frozenset(nonnegative),
            degree=degree,
            conditions=dict(conditions or {}),
            plants=tuple(plants),
            modelled=modelled,
        )

    return decorate


def discover(package: str) -> dict[str, Template]:
    """Every Template at the top level of a package's modules, by name."""
    found: dict[str, Template] = {}
    for module in modules(package):
        found |= {value.name: value for value in vars(module).values() if isinstance(value, Template)}
    return dict(sorted(found.items()))
