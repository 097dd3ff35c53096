"""A part takes exactly the numbers that its docstring says, and refuses all others in one sentence."""

import dataclasses
import inspect
import math
import re

import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.plant import MAX_PARAMETER

pytestmark = pytest.mark.quick

PUBLIC = [getattr(home, name) for home in (smc, smc.hardware, smc.signals) for name in home.__all__]
PARTS = [value for value in PUBLIC if isinstance(value, type) and issubclass(value, Part)]
NAMES = re.compile(r"^  ((?:\w+)(?:, \w+)*): (.*?)(?=^  \w|\Z)", re.DOTALL | re.MULTILINE)
LEAST, RANGE = re.compile(r"([\d.e-]+)(?: \([^)]*\))? or more"), re.compile(r"([\d.]+) \.\. ([\d.]+)")


def numbers(part):
    """Name of each field that is a number -> what the docstring says of it."""
    texts = [inspect.cleandoc(one.__doc__).partition("Attributes:\n")[2] for one in part.__mro__[:3]]
    pairs = [pair for text in texts for pair in NAMES.findall(text)]
    said = {name: " ".join(words.split()) for names, words in pairs for name in names.split(", ")}
    kinds = {field.name: str(field.type) for field in dataclasses.fields(part) if field.name != "counts"}  # is whole
    return {name: said[name] for name, kind in kinds.items() if "float" in kind or "PerJoint" in kind}


SAID = {(part, name): words for part in PARTS for name, words in numbers(part).items()}
CASES = [case for case in SAID if case != (smc.hardware.LuGre, "static")]  # its bound is another field, coulomb
MOTOR = {"inductance": 0.0, "torque_constant": 1.0, "gear": 1.0}  # even, and strong for every resistance


def made(part, **given):
    """A part with these numbers, and 1 where there is no default."""
    required = {field.name: 1.0 for field in dataclasses.fields(part) if field.default is dataclasses.MISSING}
    return part(**required | ({"kind": "stops"} if "kind" in required else {}) | given)


def accepts(part, name, value):
    """Whether a part takes a number, or else says the field, the number and the cure."""
    try:
        return getattr(made(part, **(MOTOR if part is smc.DCMotor else {}) | {name: value}), name) == value
    except smc.ScenarioError as error:
        said = str(error)
    assert said.startswith(f"{part.__name__}'s {name} is {value if value is None else f'{value:g}'}: give ")
    return False


@pytest.mark.parametrize(("part", "name"), CASES, ids=[f"{part.__name__}-{name}" for part, name in CASES])
def test_a_number_is_taken_just_where_its_docstring_says(part, name):
    words = SAID[part, name]
    low, high = -math.inf, math.inf if part is smc.Encoder or "math.inf" in words else MAX_PARAMETER
    if between := RANGE.search(words):
        low, high = map(float, between.groups())
    elif least := LEAST.search(words):
        low = float(least[1])
    if "greater than 0" in words:
        assert not accepts(part, name, 0.0)
        assert accepts(part, name, 1e-3)
    elif math.isinf(low):
        assert accepts(part, name, -2.0)
    else:
        assert accepts(part, name, low)
        assert not accepts(part, name, low - 1e-12)
    if math.isfinite(high) and name != "coulomb":  # which the static friction bounds
        assert accepts(part, name, high)
        assert not accepts(part, name, math.nextafter(high, math.inf))
    assert accepts(part, name, math.inf) == ("math.inf" in words)
    assert accepts(part, name, None) == ("None: " in words)


ABOUT = (
    "drives",
    "in_callback",
    "limited",
    "delay",
    "scale",
    "unit",
    "nominal",
    "stall",
    "bristles",
    "forces",
)


def test_a_part_is_of_the_kind_that_is_recorded(snapshot):
    parts = {part.__name__: made(part) for part in PARTS}
    assert {
        name: ", ".join(f"{what} {getattr(part, what)}" for what in ABOUT if hasattr(part, what))
        for name, part in parts.items()
    } == snapshot
