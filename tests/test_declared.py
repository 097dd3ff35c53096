"""What is declared of a field, an argument, a gain or a parameter is refused where it does not
hold.

Bad values are made from the declarations: of another type, NaN, infinite, just beyond each bound.
The bounds themselves are recorded, so that a changed one is seen.
"""

import dataclasses
import importlib
import inspect
import math
import pkgutil
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest
from helpers import annexes
from helpers.words import recorded

import smc_mujoco as smc
from smc_mujoco.analysis.engine import Available
from smc_mujoco.common import constraints
from smc_mujoco.common.constraints import (
    Called,
    Each,
    FilePath,
    Flag,
    Number,
    OneOf,
    OrNone,
    Range,
    SeedOf,
    Shown,
    Whole,
)
from smc_mujoco.common.errors import shown
from smc_mujoco.control.estimator import estimator_catalogue as estimators
from smc_mujoco.control.law import law_catalogue as laws
from smc_mujoco.control.surface import surface_catalogue as surfaces
from smc_mujoco.mechanisms.plant import plant_catalogue as plants
from smc_mujoco.simulation.scenario import Resolved
from smc_mujoco.simulation.signals import Signal
from smc_mujoco.simulation.workers import ExecutorAddress

pytestmark = pytest.mark.quick

NO_NUMBERS = [
    "1",
    None,
    True,
    [],
    1j,
]
GIVEN = {  # what a class also needs, or two fields that depend on each other
    "Scenario": {"plant": "duffing", "law": "classical"},
    "Jump": {"factors": {}},
    "Feedforward": {"friction": smc.Coulomb(0.1)},
    "Contact": {"kind": "stops"},
    "Stops": {"limits": {}},
    "OfBody": {"body": "arm"},
    "Wall": {"body": "arm", "direction": (0, 0, 1)},
    "Ball": {"body": "arm"},
    "Push": {"body": "bob"},
    "BandLimited": {"high": 2.0},
}


def below(x):
    return math.nextafter(x, -math.inf)


def beyond(x):
    return math.nextafter(x, math.inf)


def bad_numbers(one):
    if one.above >= one.low:
        low = one.above
    else:
        low = below(one.low)
    ends = []
    for x in (low, beyond(one.high)):
        if math.isfinite(x):
            ends.append(x)
    return [*NO_NUMBERS, math.nan, -math.inf, *([] if one.infinite else [math.inf, 10**400]), *ends]


def good_numbers(one):
    ends = [one.low, one.high, max(one.low, beyond(one.above)), min(1e300, one.high)]
    ends = [x for x in ends if math.isfinite(x) and x > one.above] + [math.inf] * one.infinite
    return [1.0] * (max(one.above, one.low) < 1.0 <= one.high) + ends


def bad_by_channel(one):
    many = []
    for value in bad(one.item):
        if not isinstance(value, list):
            many.append([good(one.item)[0], value])
    return [*(value for value in bad(one.item) if value != []), [], *many]


def bad_ranges(one):
    wrong = []
    for value in bad(Number(above=one.above, low=one.low)):
        if isinstance(value, float) and not (one.infinite and math.isinf(value)):
            wrong.append(value)
    return ["ab", None, 1.0, [1.0], (1.0, 2.0, 3.0), (2.0, 1.0), *((value, 2.0) for value in wrong)]


def told_number(one):
    ends = f"> {one.above:g}" * (one.above > -math.inf), f">= {one.low:g}" * (one.low > -math.inf)
    high = f"<= {one.high:g}" * (one.high < math.inf), "or inf" * one.infinite
    return " ".join(filter(None, ["number", *ends, *high]))


BAD = {  # of another kind, and just beyond each end
    OrNone: lambda one: [value for value in bad(one.item) if value is not None],
    Number: bad_numbers,
    Whole: lambda one: (
        [*NO_NUMBERS, math.nan, 2.5, one.low - 1, one.high + 1] + [math.inf] * (not one.infinite)
    ),
    OneOf: lambda one: [None, 3, "", "nobody", f"{one.names[0].upper()}?", [one.names[0]]],
    Flag: lambda one: [None, 1, 0.0, "yes"],
    Each: bad_by_channel,
    Range: bad_ranges,
    FilePath: lambda one: [None, 3, b"x", ["x"]],
    ExecutorAddress: lambda one: [None, 3, "ray", "dask://host", "dask://host:port"],
    Called: lambda one: [None, 3, "x", ()],
}
BAD[Available] = BAD[OneOf]
BAD[Shown] = BAD[Flag]
BAD[SeedOf] = lambda one: [*NO_NUMBERS, math.nan, 2.5, -1, one.high + 1, math.inf]
GOOD = {  # a plain value, and the ends themselves
    OrNone: lambda one: [*good(one.item), None],
    Number: good_numbers,
    Whole: lambda one: [one.low, one.high, float(one.high // 2)] + [math.inf] * one.infinite,
    ExecutorAddress: lambda one: ["dask://host:8786", "tcp://127.0.0.1:1"],
    OneOf: lambda one: [*one.names],
    Flag: lambda one: [True, False],
    Shown: lambda one: [True, False, print],
    SeedOf: lambda one: [0, one.high, float(one.high // 2)],
    Each: lambda one: [*good(one.item), (good(one.item)[0],) * 2],
    Range: lambda one: [(max(1.0, one.low),) * 2, (max(one.low, beyond(one.above), -9.0), 1e300)],
    FilePath: lambda one: [Path("a"), Path("b/c")],
    Called: lambda one: [print],
    Available: lambda one: ["cpu"],
}
TOLD = {
    OrNone: lambda one: f"{reported(one.item)}, or None",
    Number: told_number,
    Whole: lambda one: f"whole {one.low} to {one.high}" + " or inf" * one.infinite,
    OneOf: lambda one: f"one of {', '.join(one.names)}",
    Flag: lambda one: "flag",
    Shown: lambda one: "flag, or a function",
    SeedOf: lambda one: f"whole 0 to {one.high}, or a Generator",
    Each: lambda one: f"{reported(one.item)}, or one for each channel",
    Range: lambda one: f"range of {reported(Number(above=one.above, low=one.low))}",
    FilePath: lambda one: "path",
    ExecutorAddress: lambda one: "an executor, a dask client, or an address",
    Called: lambda one: "function",
    Available: lambda one: f"{', '.join(one.names)} if this machine has it",
}


def bad(one):
    return BAD[type(one)](one)


def good(one):
    return GOOD[type(one)](one)


def reported(one):
    return TOLD[type(one)](one)


def members(room):
    """Yield the classes and functions that a module defines, and its classes' methods."""
    for member in [
        member
        for member in vars(room).values()
        if getattr(member, "__module__", "") == room.__name__
    ]:
        yield member
        if isinstance(member, type):
            yield from (method for method in vars(member).values() if inspect.isfunction(method))


def modules():
    """Yield the package's modules that can be imported here."""
    for module in pkgutil.walk_packages(smc.__path__, "smc_mujoco."):
        if not module.name.endswith("__main__"):
            try:
                yield importlib.import_module(module.name)
            except ImportError:  # of an extra
                continue


def of_class(kind):
    """Field -> constraint. The other parameters of a signal are numbers."""
    if issubclass(kind, Signal):
        plain = []
        for f in dataclasses.fields(kind):
            if f.type is float:
                plain.append(f.name)
    else:
        plain = []
    return dict.fromkeys(plain, Number()) | constraints.of_fields(kind)


FOUND = [member for room in modules() for member in members(room)]
CLASSES = {
    member.__name__: member
    for member in FOUND
    if isinstance(member, type)
    and dataclasses.is_dataclass(member)
    and of_class(member)
    and member is not Resolved
}
DECLARING = [
    member
    for member in FOUND
    if inspect.isfunction(member) and constraints.of_parameters(inspect.unwrap(member))
]
FUNCTIONS = {
    f"{member.__module__[11:]}.{member.__qualname__}": member
    for member in DECLARING
    if hasattr(member, "__wrapped__")
}
COMPONENTS = {
    component.name: component
    for catalogue in (laws, surfaces, estimators)
    for component in catalogue().values()
}


def argued(call):
    """Parameter -> what a call needs beside the one that is tested: a good value, or anything."""
    declared = constraints.of_parameters(inspect.unwrap(call))
    needed = []
    for p in inspect.signature(call).parameters.values():
        if p.default is p.empty and p.kind < p.VAR_KEYWORD:
            needed.append(p)
    return {p.name: good(declared[p.name])[0] if p.name in declared else None for p in needed}


def things():
    """Yield the name of each thing, its constraint, and a function that makes something with a
    value for it.
    """
    for name, kind in CLASSES.items():
        required = [
            f
            for f in dataclasses.fields(kind)
            if f.init and f.default is f.default_factory is f.default
        ]
        plain = {
            f.name: good(declaration)[0]
            for f in required
            if (declaration := of_class(kind).get(f.name))
        } | GIVEN.get(name, {})
        for field, declaration in of_class(kind).items():
            yield (
                f"{name}.{field}",
                field,
                declaration,
                lambda x, k=kind, f=field, p=plain: k(**p | {f: x}),
            )
    for name, call in FUNCTIONS.items():
        for parameter, declaration in constraints.of_parameters(inspect.unwrap(call)).items():
            arguments = argued(call)
            yield (
                f"{name}({parameter})",
                parameter,
                declaration,
                lambda x, c=call, f=parameter, p=arguments: c(**p | {f: x}),
            )
    for name, component in COMPONENTS.items():
        for key, gain in component.gains.items():
            yield (
                f"{name}'s {key}",
                key,
                gain.constraint,
                lambda x, c=component, f=key: c.bind({f: x}),
            )
    for name, plant in plants().items():
        for key in plant.parameters:
            yield (
                f"{name}'s {key}",
                key,
                plant.constraint(key),
                lambda x, n=name, f=key: smc.plant(n, **{f: x}),
            )


THINGS = {name: rest for name, *rest in things()}


@pytest.mark.parametrize("name", THINGS)
def test_what_is_declared_is_refused_in_a_sentence_with_name_value_and_cure(name, refused):
    argument, declaration, make = THINGS[name]
    for value in bad(declaration):
        sentence = refused(lambda value=value: make(value), argument)
        if isinstance(value, list | tuple) and len(value) == 2:
            items = value
        else:
            items = [value]
        numbers = []
        for x in items:
            if isinstance(x, int | float) and abs(x) < 1e308 and not isinstance(x, bool):
                numbers.append(f"{x:g}")
        assert any(text in sentence for text in (*map(shown, [value, *items]), *numbers)), (
            value,
            sentence,
        )


@pytest.mark.parametrize("name", THINGS)
def test_a_bound_itself_is_taken(name):
    argument, declaration, _ = THINGS[name]
    for value in good(declaration):
        assert declaration(argument, value) == value


def test_whoever_declares_an_argument_refuses_it():
    # of data, which declare their fields
    constructors = {of_data.__init__ for of_data in CLASSES.values()}
    assert [
        function.__qualname__
        for function in DECLARING
        if not hasattr(function, "__wrapped__") and function not in constructors
    ] == []
    assert len(CLASSES) > 25
    assert len(FUNCTIONS) > 25


def room(owner):
    """The annex of a class or a function that declares something, or the core."""
    if owner in CLASSES:
        owner = CLASSES[owner].__module__.removeprefix("smc_mujoco.")
    return (annexes.of(owner) if "." in owner else "") or "core"


@pytest.mark.parametrize("of", ["core", *annexes.HERE])
def test_the_declarations_are_those_recorded(of, snapshot):
    alike: dict[tuple[str, str], list[str]] = {}
    for name, (argument, declaration, _) in THINGS.items():
        owner = re.split(rf"(?:\.|\(|'s ){argument}", name)[0]
        if room(owner) == of:
            alike.setdefault((owner, reported(declaration)), []).append(argument)
    recorded_owners = recorded(__file__, dict.fromkeys(owner for owner, _ in alike))
    lines = [
        f"{owner}({', '.join(names)}): {what}"
        for (owner, what), names in alike.items()
        if owner in recorded_owners
    ]
    assert "\n".join(lines) == snapshot


def test_a_class_whose_annotations_are_texts_declares_too(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "mine", mine := ModuleType("mine"))
    code = """
from __future__ import annotations
import dataclasses
from smc_mujoco.common.constraints import Positive
from smc_mujoco.simulation.signals import Signal
from smc_mujoco.simulation.workers import ExecutorAddress

@dataclasses.dataclass(frozen=True)
class Mine(Signal):
    width: Positive
"""
    exec(code, vars(mine))
    refused(lambda: vars(mine)["Mine"](0.0), "Mine's width", "greater than 0")
