"""The docstring of a part says the bounds that are declared with its fields."""

import dataclasses
import inspect
import re

import pytest

import smc_mujoco as smc
from smc_mujoco.common.constraints import Each, Number, OrNone, of_fields
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.plant import MAX_PARAMETER

pytestmark = pytest.mark.quick

PUBLIC = [getattr(home, name) for home in (smc, smc.hardware, smc.signals) for name in home.__all__]
PARTS = [value for value in PUBLIC if isinstance(value, type) and issubclass(value, Part)]
NAMES = re.compile(r"^  ((?:\w+)(?:, \w+)*): (.*?)(?=^  \w|\Z)", re.DOTALL | re.MULTILINE)
LEAST = re.compile(r"([\d.e-]+)(?: \([^)]*\))? or more")
RANGE = re.compile(r"([\d.]+) \.\. ([\d.]+)")


def said(part):
    """Name of each field that is a number -> what the docstring says of it."""
    texts = []
    for one in part.__mro__[:3]:
        texts.append(inspect.cleandoc(one.__doc__).partition("Attributes:\n")[2])
    pairs = []
    for text in texts:
        for pair in NAMES.findall(text):
            pairs.append(pair)
    return {name: " ".join(words.split()) for names, words in pairs for name in names.split(", ")}


def made(part):
    """A part with the number 1 where there is no default."""
    required = {}
    for field in dataclasses.fields(part):
        if field.default is dataclasses.MISSING:
            required[field.name] = 1.0
    return part(**required | ({"kind": "stops"} if "kind" in required else {}))


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.__name__)
def test_a_docstring_says_what_is_declared(part):
    for name, whole in of_fields(part).items():
        words = said(part)[name]
        of_all = whole.one if isinstance(whole, OrNone) else whole
        if isinstance(of_all, Each):
            one = of_all.one
        else:
            one = of_all
        assert isinstance(whole, OrNone) == ("None: " in words), name
        if not isinstance(one, Number) or (part, name) == (
            smc.hardware.LuGre,
            "static",
        ):  # its bound is coulomb
            continue
        ends = RANGE.search(words) or LEAST.search(words)
        assert (one.above == 0.0) == ("greater than 0" in words), name
        assert one.infinite == ("math.inf" in words), name
        assert (
            max(one.low, -MAX_PARAMETER) == (float(ends[1]) if ends else -MAX_PARAMETER)
            or one.above == 0.0
        ), name
        assert min(one.high, MAX_PARAMETER) == (
            float(ends[2]) if ends and ends.re is RANGE else MAX_PARAMETER
        ), name


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
