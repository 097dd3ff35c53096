"""What decorators take and refuse: gains with units, old words, options of other kinds."""

import dataclasses

import pytest
import wild

import smc_mujoco as smc
from smc_mujoco.control.units import RATE, Gain

pytestmark = pytest.mark.quick


def zero(y, gains, memory):
    return 0.0, 0.0


def test_gain_keeps_its_unit_and_the_decorators_sign():
    made = smc.law_function(gains={"a": Gain(1.0, RATE), "b": 2.0}, positive=("a",), nonnegative=("b",))(zero)
    assert made.gains == {"a": Gain(1.0, RATE, positive=True), "b": Gain(2.0, nonnegative=True)}
    assert made.defaults == {"a": 1.0, "b": 2.0}
    with pytest.raises(smc.ScenarioError, match="greater than 0"):
        made(a=0.0)


def present(y, gains, memory):
    return -y.v_eq - gains.eq * y.has_surface, y.s


def former(y, gains, memory):
    return -y.eq - gains.eq * y.surfaced, y.s


@pytest.mark.parametrize("decorator", [smc.surface_function, smc.estimator_function, smc.law_function])
def test_option_of_no_such_component_is_one_sentence(decorator):
    option = "colours" if decorator is smc.law_function else "plants"
    with pytest.raises(smc.ScenarioError, match=f"unknown option of .*{option}"):
        decorator(**{option: ()})


@pytest.mark.parametrize(
    ("option", "value"),
    [("colour", "red"), ("colour", 3), ("label", 3), ("family", 3), ("accuracy", 3), ("admits", {"x": 1.0})],
)
def test_word_that_cannot_be_drawn_and_bound_of_nothing_are_refused(option, value):
    with pytest.raises(smc.ScenarioError, match=f"^{option} is .*: give "):
        smc.law_function(**{option: value})


@pytest.mark.parametrize("value", [{"shoulder": 1.0}, {1.0, 2.0}])
def test_gain_that_is_no_list_of_numbers_is_refused(value):
    with pytest.raises(
        smc.ScenarioError, match=r"k is {.*: give a number, or a list with one for each driven channel$"
    ):
        smc.law("classical", k=value)


def test_template_prints_as_name_and_gains():
    template = smc.law_function(gains={"k": 2.0, "w": Gain((1.0, 0.5))})(lambda y, gains, memory: (0.0, 0.0))
    assert repr(template) == "<Template of law('<lambda>', k=2, w=(1, 0.5))>"


def test_builtin_without_a_signature_is_refused():
    with pytest.raises(smc.ScenarioError, match=r"law 'type' takes \(y, gains, memory\)"):
        smc.law_function()(type)


@pytest.mark.parametrize("value", [wild.nested(50_000), wild.Shy()], ids=["deep", "shy"])
def test_what_python_cannot_print_is_refused(value):
    with pytest.raises(smc.ScenarioError, match=r"surface is <.*>: give a function"):
        smc.surface_function(value)
    with pytest.raises(smc.ScenarioError, match=r"name of a law is <.*>: give a text"):
        dataclasses.replace(smc.law("classical"), name=value)
