"""What decorators take and refuse: gains with units, old words, options of other kinds."""

import contextlib
import itertools
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.control import estimator, surface
from smc_mujoco.control.component import gain_at
from smc_mujoco.control.law import all_laws
from smc_mujoco.control.units import RATE, Gain

pytestmark = pytest.mark.quick


def zero(y, gains, memory):
    return 0.0, 0.0


def test_gain_keeps_its_unit_and_the_decorators_sign():
    template = smc.law_function(
        gains={"a": Gain(1.0, RATE), "b": 2.0}, positive=("a",), nonnegative=("b",)
    )(zero)
    assert template.gains == {
        "a": Gain(1.0, RATE, positive=True),
        "b": Gain(2.0, nonnegative=True),
    }
    assert template.defaults == {"a": 1.0, "b": 2.0}


def test_a_channel_without_a_gain_in_a_list_has_the_last_and_one_number_is_each_channel_s():
    assert [gain_at((1.0, 2.5), i) for i in range(4)] == [1.0, 2.5, 2.5, 2.5]
    assert [gain_at(1.5, i) for i in range(2)] == [1.5, 1.5]


# conditions

TEMPLATES = [
    *all_laws().values(),
    *surface.surface_catalogue().values(),
    *estimator.estimator_catalogue().values(),
]
# many of them lie on bounds
VALUES = 0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0, 64.0, 128.0, 256.0, 257.0
RATIOS = 1.0 + np.geomspace(1e-3, 1e3, 500)
AS_PYTHON = (
    (r", (for|or|else) .*", ""),  # what follows from the condition, or from its opposite
    (r"(\w+) is ((\d, )*\d) or (\d)", r"\1 in (\2, \4)"),
    (r"^(\w+), (\w+) > 0$", r"\1 > 0 and \2 > 0"),
    (r"whole (\w+) and (\w+),", r"\1 % 1 == \2 % 1 == 0"),
    (r"\|(\w+)\|", r"abs(\1)"),
    (r" = ", " == "),
    (r"\^", "**"),
    (r"(\w|\)) (?=[\w(])(?<!or )(?<!and )(?<!in )(?!or |and |in )", r"\1 * "),
)


def meaning(words):
    """The function of the gains that a condition's words describe."""
    words, _, variables = words.partition(" for some ")
    for pattern, python in AS_PYTHON:
        words = re.sub(pattern, python, words)
    code = compile(words, words, "eval")
    if variables:  # r > b
        return lambda g: any(eval(code, {"r": g["b"] * ratio}, g) for ratio in RATIOS)
    return lambda g: eval(code, {"abs": abs, "sqrt": math.sqrt}, g)


def test_a_condition_holds_exactly_where_its_words_say():
    formulas = 0  # conditions whose words are a formula, which is true and false of some values
    for template in TEMPLATES:
        for words, holds in template.conditions.items():
            names = [name for name in template.gains if re.search(rf"\b{name}\b", words)]
            allowed = []
            for name in names:
                allowed.append([v for v in VALUES if v or not template.gains[name].positive])
            conditions = []
            for values in itertools.product(*allowed):
                conditions.append(dict(zip(names, values, strict=True)))
            with contextlib.suppress(SyntaxError, NameError):  # of a sentence
                means = meaning(words)
                said = [bool(means(gains)) for gains in conditions]
                assert said == [holds(SimpleNamespace(**gains)) for gains in conditions], (
                    template.name,
                    words,
                )
                formulas += {False, True} == set(said)
    assert formulas >= 30


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda one: f"{one.kind} {one.name}")
def test_a_component_names_its_equation_and_source_and_refuses_gains_that_are_no_numbers(template):
    assert template.doc[0].isupper()
    assert template.name == "measured" or re.search(r":\s", template.doc)
    assert template.name == "measured" or "=" in template.doc
    assert template.name in ("none", "filtered_difference", "measured") or "Source" in template.doc
    for name, gain in template.gains.items():
        assert gain.unit is not None or gain.held
        for value in [math.nan, *[-1.0] * (gain.positive or gain.nonnegative)]:
            with pytest.raises(smc.ScenarioError, match=name):
                template(**{name: value})


def test_gains_that_miss_a_condition_are_warned_of_in_its_words():
    with pytest.warns(smc.errors.GainWarning, match="r1 > r2"):
        smc.law("twisting", r1=2.0, r2=3.0)
    with pytest.warns(smc.errors.GainWarning, match="1/2 < p < 1"):
        smc.surface("terminal", p=0.3)


NAMES = ("text", "name", "self", "law", "plant", "function", "kind", "gains", "value", "count")


@pytest.mark.parametrize("gain", NAMES)
def test_a_gain_may_have_any_name(gain):
    @smc.law_function(gains={gain: 1.0})
    def own(y, gains, memory):
        return -y.e, y.e

    for law in (own(**{gain: 2.0}), smc.law(own, **{gain: 2.0}), smc.law(own(), **{gain: 2.0})):
        assert law.gains == {gain: 2.0}


@pytest.mark.parametrize("value", [5, "k", 2.5, np.float64(3.0), {"a": 5}], ids=str)
@pytest.mark.parametrize("option", ["positive", "nonnegative", "plants", "conditions", "advice"])
@pytest.mark.parametrize(
    "kind", [smc.law_function, smc.design.surface_function, smc.estimator_function]
)
def test_an_option_of_another_type_is_refused_at_the_decorator(kind, option, value, refused):
    if option == "plants" and (kind is not smc.law_function or isinstance(value, dict)):
        return
    refused(lambda: kind(gains={"k": 1.0}, **{option: value}), option)
