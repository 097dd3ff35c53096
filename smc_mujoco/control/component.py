"""Components: pure functions with named gains and a memory. Laws, surfaces and estimators are
components.

A `Template` is the function with its default gains. Called with gains it returns a `Component`, the
plain data in a Scenario. The function is called as `function(y, gains, memory)` and reads y and
gains by attribute. Each channel has its own memory, an array of floats that the function may
change. It is zero at the start of a run.
"""

import dataclasses
import inspect
import keyword
import math
import pkgutil
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple, TypedDict

from smc_mujoco.common import errors
from smc_mujoco.common.aliases import Data, Names, Pair
from smc_mujoco.common.constraints import Each, Number, Whole, constrained
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, find, shown, unknown, users_stacklevel
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control.source import DEFAULT, GIVEN, NONE, GainSearch, Source, combined
from smc_mujoco.control.units import INPUT_GAIN, Gain, Unit

GainConditions = Mapping[str, Callable[[SimpleNamespace], bool]]
GainValue = float | tuple[float, ...]  # one number for all channels, or one for each driven channel
FREE_BODY = "a free body"  # among a law's plants: it is for plants whose channels are a pose
ANY_GAIN = Each(item=Number(infinite=True))
FINITE_TIME = ("", "s", "e")  # values of the option: what a law brings to 0 in finite time
AccuracyOrder = float | Callable[[SimpleNamespace], float]  # a number, or a function of the gains


class LinearPart(NamedTuple):
    """The linear part of a law that is linear near s = 0."""

    # gains -> (lam, k1) of u = -lam (e' + k1 e), near s = 0
    linear: Callable[[SimpleNamespace], Pair]
    force: Callable  # (gains, errors at rest, (k,)) -> the force towards 0 at each, (k,)


class Options(TypedDict, total=False):
    """Options of the decorators; `law_function` explains them."""

    gains: Mapping[str, float | Gain] | None
    memory: int
    positive: Iterable[str]
    nonnegative: Iterable[str]
    relative_degree: int
    conditions: GainConditions | None
    advice: GainConditions | None
    plants: Iterable[str]
    requires_model: bool
    short: str
    label: str
    colour: str
    linear_part: LinearPart | None
    family: str
    continuous: bool
    finite_time: str
    accuracy: Mapping[str, AccuracyOrder] | AccuracyOrder
    admits: Mapping[str, Callable[[SimpleNamespace], float]]
    joint: bool


# option that is a mapping -> its possible keys
OPTION_KEYS = {"accuracy": ("s", "e"), "admits": ("d", "d'")}


class GainWarning(UserWarning):
    """Gains violate a condition of the law's theorem."""


@keyword_dataclass
class Component:
    """A function bound to its gains. Laws with equal gains are equal, whatever their sources."""

    kind: str
    name: str
    gains: Data  # name -> GainValue
    memory: int  # floats per channel
    # None if a loaded trace names one that is not available, and if there is `each`
    function: Callable | None
    relative_degree: int = 1
    plants: Names = ()
    requires_model: bool = False
    joint: bool = False  # whether it is a law of many joints
    shared: Names = ()  # gains that are one number for all joints in a law of many joints
    channel_laws: "tuple[Component, ...]" = ()  # of the driven channels if they differ
    # None if not available
    template: "Template | None" = dataclasses.field(default=None, compare=False, repr=False)
    # where the gains come from
    source: Source = dataclasses.field(default=Source(), compare=False, repr=False)

    def __repr__(self) -> str:
        return f"{self.kind}({_with_gains(repr(self.name), self.gains)})"

    def __reduce__(self):
        """Pickle the name that its template has in its module: that of the function before it was
        decorated.
        """
        name = getattr(self.function, "__module__", ""), getattr(self.function, "__qualname__", "?")
        template = _template_at(*name)
        if template is not None and template.function is self.function:
            return _unpickled, (*name, dict(self.gains), self.name, self.source)
        return super().__reduce__()

    def __post_init__(self):
        gains = {}
        for name, gain in self.gains.items():
            gains[name] = ANY_GAIN(f"{self.name}'s {name}", gain)
        object.__setattr__(self, "gains", frozen(gains))
        if self.template and (
            self.template.function is not self.function or self.template.name != self.name
        ):
            object.__setattr__(self, "template", None)  # the function or the name was replaced
        source = self.source
        if source.gains != self.gains:  # the gains were replaced
            source = Source(kind=GIVEN if gains else NONE, gains=self.gains)
        if any(part.template and part.template.unmet(part.gains) for part in self.parts):
            source = dataclasses.replace(source, outside=True)
        object.__setattr__(self, "source", source)

    def named(self, name: str) -> "Component":
        """Return the same function and gains under another name, to compare two sets of gains of
        one law.

        Tables and figures show the name, and runs under different names are different runs.
        """
        errors.name(f"name of the {self.kind}", name)
        template = self.template and dataclasses.replace(
            self.template, name=name, label="", short="", colour=""
        )
        return dataclasses.replace(self, name=name, template=template)

    def sourced(self, kind: str, search: GainSearch | None = None) -> "Component":
        """Return the same law with another source of its gains, one of `source.KINDS`; a law
        without gains has none.
        """
        source = Source(kind=kind, gains=self.gains, search=search)
        if self.gains:
            return dataclasses.replace(self, source=source)
        return self

    @property
    def uniform(self) -> bool:
        """Whether all channels have the same law with the same gains."""
        return not self.channel_laws and not any(
            isinstance(value, tuple) for value in self.gains.values()
        )

    @property
    def parts(self) -> "tuple[Component, ...]":
        """The laws of its channels if they are different laws, else itself."""
        return self.channel_laws or (self,)

    def on_computed_torque(self) -> "Component":
        """Return the law of many joints whose outer law is this one, see `control.outer_law`."""
        outer = self.template
        if self.joint or self.channel_laws or outer is None or self.plants:
            raise ScenarioError(
                f"{self.name} cannot be the outer law of computed torque: "
                "give one law of one channel, for all plants"
            )
        converted = outer.on_computed_torque()
        gains = {}
        for name, value in self.gains.items():
            if name in converted.gains:
                gains[name] = value
            elif value != outer.gains[name].default:
                raise ScenarioError(
                    f"{self.name}'s {name} is {gain_text(value)}, and on computed torque each "
                    "joint is e'' = v: leave it out"
                )
        return converted.bind(gains).sourced(self.source.kind, self.source.search)

    def of_channel(self, i: int) -> "Component":
        """Return the component of channel i, with one number for each gain."""
        if self.joint:
            raise ScenarioError(f"law {self.name!r} is of many joints: give a law of one channel")
        if self.uniform:
            return self
        if self.channel_laws:
            return self.channel_laws[min(i, len(self.channel_laws) - 1)]
        gains = {}
        for name, value in self.gains.items():
            gains[name] = gain_at(value, i)
        return dataclasses.replace(self, gains=gains, source=self.source.with_gains(gains))

    def of_channels(self, n: int) -> "list[Component]":
        """Return one component for all n channels, or one for each if laws or gains differ."""
        if self.joint or self.uniform:
            return [self]
        return list(map(self.of_channel, range(n)))

    def numbers(self, count: int) -> list[float]:
        """Return each gain's values in so many channels, gain by gain."""
        values = []
        for value in self.gains.values():
            values += [gain_at(value, i) for i in range(count)]
        return values

    def __call__(self, /, **gains: GainValue) -> "Component":
        """Return it with some gains changed, as `smc.law(law, **gains)` does."""
        if self.template is None:
            raise ScenarioError(f"{self.kind} {self.name!r} takes no gains: leave the brackets out")
        return self.template.bind({**self.gains, **gains}, warn=True)

    def __str__(self):
        return f"{self.name}({gains_text(self.gains)})"


def gain_text(value: GainValue) -> str:
    """Return a gain as text, such as 3 or (3, 4.5)."""
    if isinstance(value, tuple):
        return f"({', '.join(f'{number:g}' for number in value)})"
    return f"{value:g}"


def gains_text(gains: Mapping[str, GainValue]) -> str:
    """Return gains as text, such as "k=3, lam=(3, 4.5)"."""
    return ", ".join(f"{name}={gain_text(value)}" for name, value in gains.items())


def bounded(gains: Mapping[str, GainValue]) -> dict[str, GainValue]:
    """Return the gains without those that are inf: no bound, or a number of the plant."""
    return {name: value for name, value in gains.items() if value != math.inf}


def _with_gains(name: str, gains: Mapping[str, GainValue]) -> str:
    """Return a name and gains as the arguments of a call."""
    return ", ".join(filter(None, (name, gains_text(gains))))


def unit_cure(name: str, default: GainValue) -> str:
    """Return how to give a gain a unit, as the end of a refusal."""
    gain = f'gains={{"{name}": Gain({gain_text(default)}, UNIT)}}'
    return (
        f"write {gain} in its decorator, where UNIT is FORCE, RATE, SPEED or another of "
        "smc_mujoco.control.units, or Unit() for a number without one"
    )


def _template_at(module: str, name: str) -> "Template | None":
    """Return the Template with a dotted name in a module, or None."""
    value: object = sys.modules.get(module)
    for part in name.split("."):
        value = getattr(value, part, None)
    return value if isinstance(value, Template) else None


def _unpickled(
    module: str, qualname: str, gains: dict[str, float], name: str, source: Source
) -> Component:
    template = pkgutil.resolve_name(f"{module}:{qualname}")
    component = dataclasses.replace(template.bind(gains), source=source)
    if name != component.name:
        return component.named(name)
    return component


@keyword_dataclass
class Template:
    """A function with the properties that its decorator gives it, see `law_function`."""

    kind: str
    name: str
    function: Callable
    gains: Mapping[str, Gain]
    memory: int  # floats per channel
    relative_degree: int = 1  # of the sliding variable that a law needs, or that a surface gives
    conditions: GainConditions = dataclasses.field(default_factory=dict)
    advice: GainConditions = dataclasses.field(default_factory=dict)
    plants: Names = ()  # empty for all plants
    requires_model: bool = False
    label: str = ""  # this and the next two: "" means automatic, see `smc_mujoco.draw.style`
    short: str = ""
    colour: str = ""
    linear_part: LinearPart | None = None
    family: str = ""
    continuous: bool = False
    finite_time: str = ""
    accuracy: Mapping[str, AccuracyOrder] = dataclasses.field(default_factory=dict)
    admits: Mapping[str, Callable[[SimpleNamespace], float]] = dataclasses.field(
        default_factory=dict
    )
    joint: bool = False

    def __repr__(self) -> str:
        return f"<Template of {self.kind}({_with_gains(repr(self.name), self.defaults)})>"

    @property
    def defaults(self) -> dict[str, float]:
        """Gain -> its default."""
        return {name: gain.default for name, gain in self.gains.items()}

    def on_computed_torque(self) -> "Template":
        """Return the template of the law of many joints whose outer law this one is."""
        from smc_mujoco.control.outer_law import on_computed_torque

        own = {}
        values = []
        for name, gain in self.gains.items():
            if gain.plant:
                values.append(repr(gain.default))
            elif gain.unit == INPUT_GAIN:  # of e'' = v
                values.append("1.0")
            else:
                own[name] = dataclasses.replace(gain, over=None)
                values.append(f"gains.{name}[i]")
        function = on_computed_torque(self.function, tuple(self.gains), ", ".join(values))
        return Template(
            kind="law",
            name=function.__name__,
            function=function,
            gains=own,
            memory=self.memory,
            conditions=self.conditions,
            advice=self.advice,
            requires_model=True,
            label=f"{self.label or self.function.__name__} on computed torque",
            family=self.family,
            continuous=self.continuous,
            accuracy=self.accuracy,
            joint=True,
        )

    @property
    def doc(self) -> str:
        """The docstring of the function, or of its module if both have the same name."""
        module = inspect.getmodule(self.function)
        same_name = module is not None and module.__name__.rsplit(".", 1)[-1] == self.name
        return inspect.cleandoc(
            (module.__doc__ if same_name and module else self.function.__doc__) or self.name
        )

    def order(self, quantity: str, gains: Mapping[str, GainValue]) -> float | None:
        """Return theory's order of accuracy of "s" or "e" with these gains; None if the law does
        not state it.
        """
        order = self.accuracy.get(quantity)
        if callable(order):
            return min(map(order, _per_channel(gains)))
        return order

    def unmet(self, gains: Mapping[str, GainValue]) -> list[str]:
        """Return the conditions of the theorem that these gains violate, in words."""
        return _unmet(self.conditions, gains)

    def __call__(self, /, **gains: float | Sequence[float]) -> Component:
        """Return `bind(gains, warn=True)`."""
        return self.bind(gains, warn=True)

    def bind(self, gains: Mapping[str, float | Sequence[float]], warn: bool = False) -> Component:
        """Bind the function to these gains and the defaults of others. Warn of gains that violate a
        condition.
        """
        values: dict[str, GainValue] = {**self.defaults}
        for key, value in gains.items():
            if key not in values:
                raise unknown(f"gain of {self.name}", key, values)
            gain = self.gains[key]
            values[key] = gain.constraint(f"{self.name}'s {key}", value)
            if isinstance(values[key], tuple) and (gain.shared or self.kind != "law"):
                raise ScenarioError(
                    f"{self.name}'s {key} is {gain_text(values[key])}: "
                    "give one number for all channels"
                )
        if warn:
            text = ", ".join(f"{name} = {gain_text(value)}" for name, value in values.items())
            for words in self.unmet(values):
                message = f"{self.kind} {self.name!r} asks for {words}, but {text}"
                warnings.warn(message, GainWarning, users_stacklevel())
            for words in _unmet(self.advice, values):
                message = f"{self.kind} {self.name!r} advises {words}, but {text}"
                warnings.warn(message, errors.ScenarioWarning, users_stacklevel())
        shared = []
        for name, gain in self.gains.items():
            if gain.shared:
                shared.append(name)
        component = Component(
            kind=self.kind,
            name=self.name,
            gains=values,
            memory=self.memory,
            function=self.function,
            relative_degree=self.relative_degree,
            plants=self.plants,
            requires_model=self.requires_model,
            joint=self.joint,
            shared=tuple(shared),
            template=self,
        )
        if gains:
            return component
        return component.sourced(DEFAULT)


def _unmet(conditions: GainConditions, gains: Mapping[str, GainValue]) -> list[str]:
    """Return the conditions that gains violate in some channel, in words."""
    channels = list(_per_channel(gains))
    unmet = []
    for words, test in conditions.items():
        if not all(_holds(test, gains) for gains in channels):
            unmet.append(words)
    return unmet


def _per_channel(gains: Mapping[str, GainValue]) -> Iterable[SimpleNamespace]:
    """Yield the gains of each channel; once if all are the same in all channels."""
    count = 1
    for value in gains.values():
        if isinstance(value, tuple):
            count = max(count, len(value))
    for i in range(count):
        of_channel = {}
        for name, value in gains.items():
            of_channel[name] = gain_at(value, i)
        yield SimpleNamespace(**of_channel)


def by_channel(laws: "Sequence[Component]") -> Component:
    """Return the law of a plant with one of these laws for each driven channel."""
    first = laws[0]
    for i, law in enumerate(laws):
        if law.joint or not law.uniform:
            raise ScenarioError(
                f"the law of channel {i} is {law}, of many joints or with gains by channel: "
                "give it a law of one channel"
            )
    source = combined([law.source for law in laws])
    if all(law.function is first.function and law.name == first.name for law in laws):
        gains = {}
        for name in first.gains:
            values = tuple(law.gains[name] for law in laws)
            if len(set(values)) > 1:
                gains[name] = values
            else:
                gains[name] = values[0]
        return dataclasses.replace(first, gains=gains, source=source.with_gains(gains))
    gains = {}
    for i, law in enumerate(laws):
        for name, value in law.gains.items():
            gains[f"{name}[{i}]"] = value
    component = Component(
        kind=first.kind,
        name=" + ".join(dict.fromkeys(law.name for law in laws)),
        gains=gains,
        memory=max(law.memory for law in laws),
        function=None,
        relative_degree=max(law.relative_degree for law in laws),
        requires_model=any(law.requires_model for law in laws),
        channel_laws=tuple(laws),
    )
    return component.sourced(source.kind, source.search)


def gain_at(value: GainValue, i: int) -> float:
    """Return a gain's value in channel i. A tuple that is too short, which a scenario refuses,
    gives its last value.
    """
    if isinstance(value, tuple):
        return value[min(i, len(value) - 1)]
    return value


def _holds(condition: Callable[[SimpleNamespace], bool], gains: SimpleNamespace) -> bool:
    """Return whether gains satisfy a condition; False if it cannot be computed."""
    try:
        return condition(gains)
    except (ArithmeticError, ValueError):
        return False


def as_gains(gains: object, known: Mapping[str, GainValue] = frozen({})) -> dict[str, Gain]:
    """Return a decorator's gains, numbers or Gains, as Gains. They follow the known ones and can
    change these.
    """
    if not isinstance(gains, Mapping | None):
        raise ScenarioError(
            f"gains is {shown(gains)}: give names with their defaults, such as {{'k1': 3.0}}"
        )
    checked: dict[str, Gain] = {}
    for key, value in {**known, **(gains or {})}.items():
        named = isinstance(key, str) and key.isidentifier() and not keyword.iskeyword(key)
        if not named or key.startswith("_"):
            raise ScenarioError(
                f"gain {shown(key)} cannot be written as gains.name: call it something like 'k1'"
            )
        if isinstance(value, Gain):
            gain = value
        else:
            gain = Gain(value)
        default = ANY_GAIN(f"default of gain {key}", gain.default)
        checked[key] = dataclasses.replace(gain, default=default)
        if not (gain.unit is None or isinstance(gain.unit, Unit) or callable(gain.unit)):
            raise ScenarioError(
                f"unit of gain {key} is {shown(gain.unit)}: {unit_cure(key, gain.default)}"
            )
    for key, gain in checked.items():
        if gain.over is not None and gain.over not in checked:
            raise unknown(f"gain that {key} is divided by", gain.over, checked)
    return checked


def decorated(
    kind: str, function: Callable | None, options: Mapping
) -> "Callable[[Callable], Template] | Template":
    """Return the Template of a function, or its decorator if the function is None."""
    for option in options:
        find(f"option of {kind}_function", option, Options.__annotations__)
    decorate = template_decorator(kind, **options)
    if function is None:
        return decorate
    return decorate(function)


def _check_names(given: Mapping[str, Any]) -> None:
    """Refuse an option that is not several names."""
    for option, names in given.items():
        if isinstance(names, str) or not isinstance(names, Iterable):
            raise ScenarioError(
                f"{option} is {shown(names)}: give several names, such as ('a', 'b')"
            )


def _check_conditions(given: Mapping[str, Any]) -> None:
    """Refuse an option that is not functions of the gains by their words."""
    for option, tests in given.items():
        if not isinstance(tests, Mapping | None) or not all(map(callable, (tests or {}).values())):
            raise ScenarioError(
                f"{option} is {shown(tests)}: give functions of the gains by their words, such as "
                "{'a < b': lambda g: g.a < g.b}"
            )


def _check_options(options: dict[str, Any]) -> None:
    """Refuse an accuracy, a colour or a finite time that is none."""
    for option, keys in OPTION_KEYS.items():
        value = options.get(option, {})
        if not isinstance(value, Mapping) or not value.keys() <= {*keys}:
            names = " and ".join(map(repr, keys))
            raise ScenarioError(
                f"{option} is {shown(value)}: give numbers, or functions of the gains, for {names}"
            )
    if not re.fullmatch("(#[0-9a-fA-F]{6})?", str(options.get("colour", ""))):
        raise ScenarioError(f"colour is {shown(options['colour'])}: give one like '#0072B2'")
    if str(options.get("finite_time", "")) not in FINITE_TIME:
        raise ScenarioError(f"finite_time is {shown(options['finite_time'])}: give 's', 'e' or ''")


@constrained
def template_decorator(
    kind: str,
    gains: Mapping[str, float | Gain] | None = None,
    memory: Annotated[int, Whole(low=1, high=10_000)] = 8,
    positive: Iterable[str] = (),
    nonnegative: Iterable[str] = (),
    relative_degree: Annotated[int, Whole(low=1, high=10)] = 1,
    conditions: GainConditions | None = None,
    advice: GainConditions | None = None,
    plants: Iterable[str] = (),
    **options: Any,
) -> Callable[[Callable], Template]:
    """Return a decorator that turns a function into a Template."""
    checked = as_gains(gains)
    _check_names({"plants": plants, "positive": positive, "nonnegative": nonnegative})
    _check_conditions({"conditions": conditions, "advice": advice})
    order = options.get("accuracy")
    if isinstance(order, int | float) or callable(order):
        options["accuracy"] = {"s": order, "e": order}
    _check_options(options)
    for name in positive:
        gain = find("gain that is positive", name, checked)
        checked[name] = dataclasses.replace(gain, positive=True)
    for name in nonnegative:
        gain = find("gain that is nonnegative", name, checked)
        checked[name] = dataclasses.replace(gain, nonnegative=True)
    plants = tuple(plants)

    def decorate(function: Callable) -> Template:
        if not callable(function):
            raise ScenarioError(f"{kind} is {shown(function)}: give a function (y, gains, memory)")
        name = errors.name(
            f"name of the {kind}", getattr(function, "__name__", type(function).__name__)
        )
        try:
            inspect.signature(getattr(function, "py_func", function)).bind(None, None, None)
        except (TypeError, ValueError):  # ValueError: a builtin without a signature
            raise ScenarioError(
                f"{kind} {name!r} has other arguments: give it these three, (y, gains, memory)"
            ) from None
        return Template(
            kind=kind,
            name=name,
            function=function,
            gains=checked,
            memory=memory,
            relative_degree=relative_degree,
            conditions=dict(conditions or {}),
            advice=dict(advice or {}),
            plants=plants,
            **options,
        )

    return decorate
