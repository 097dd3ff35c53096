"""Calls of public names with what they do not take: one sentence that names the argument, whatever Python says."""

import importlib
import inspect
import itertools
import os
import pickle
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import wild
from wild import nested

import smc_mujoco as smc
from smc_mujoco.common import arguments
from smc_mujoco.common.arguments import kind_of
from smc_mujoco.common.errors import shown


class Shy:
    def __repr__(self):
        raise KeyError("no")


@pytest.fixture(scope="module")
def trace() -> smc.Trace:
    return smc.run(smc.Scenario(plant="duffing", law="classical", duration=0.01))


def refused(call: Callable, *args: Any, **named: Any) -> str:
    with pytest.raises(smc.ScenarioError) as error:
        call(*args, **named)
    return str(error.value)


# names of arguments


def test_a_misspelt_field_of_a_scenario_is_guessed():
    text = refused(smc.Scenario, plant="duffing", law="classical", contol_period=1e-3)
    assert text == "unknown field of Scenario 'contol_period': did you mean 'control_period'?"


def test_a_misspelt_field_in_a_replaced_scenario_is_guessed(trace):
    import dataclasses

    assert refused(dataclasses.replace, trace.scenario, sed=1).endswith("did you mean 'seed'?")


def test_a_misspelt_argument_is_guessed(trace):
    assert refused(smc.run, trace.scenario, thread=2) == "unknown argument of run 'thread': did you mean 'threads'?"


@pytest.mark.parametrize(
    ("args", "named", "text"),
    [
        ((), {}, "Sine lacks amplitude and omega: give amplitude=..."),
        ((1.0, 2.0, 3.0, 4.0), {}, "Sine takes 3 fields without a name, not 4: name the others"),
        ((1.0,), {"amplitude": 2.0, "omega": 1.0}, "Sine got its field 'amplitude' twice: give it once"),
    ],
)
def test_arguments_that_lack_or_are_too_many(args, named, text):
    assert refused(smc.Sine, *args, **named) == text


# what does not fit an annotation


@pytest.mark.parametrize(
    ("path", "text"),
    [
        (None, "path is None: give a path"),
        (3, "path is 3: give a path"),
        (b"a.npz", "path is b'a.npz': give a path"),
        ("\ud800.npz", "path is '\\ud800.npz': give shorter text, without NUL or halves of surrogate pairs"),
    ],
)
def test_a_path_that_is_none(trace, path, text):
    assert refused(trace.save, path) == text


def test_values_that_the_function_does_not_check(trace):
    assert refused(smc.lqr, "duffing", q=3) == "q is 3: give 2 numbers"
    assert refused(smc.run, trace.scenario, progress=np.zeros(2)) == ("progress is array([0., 0.]): give True or False")
    assert refused(lambda: list(smc.stream([trace.scenario], report=3))) == "report is 3: give a function"  # type: ignore
    assert refused(smc.leaderboard, 3) == "table is 3: give something that has column and scenario"


def test_a_method_of_what_a_function_returns(trace):
    assert refused(smc.load, trace) == f"cannot read {trace!r}: give the path of a .npz file that a run wrote"
    tuned = smc.tune("duffing", "classical", budget=8)
    assert refused(tuned.save, None) == "path is None: give a path"


def test_the_first_that_is_no_scenario_ends_a_run_without_end():
    assert refused(smc.run, itertools.count()) == "cannot run 0: give a smc.Scenario"


def test_an_error_that_no_argument_explains_stays_as_it_is(trace):
    def report(steps: int) -> None:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        list(smc.stream([trace.scenario], report=report))


def test_a_sentence_of_the_functions_own_stays_as_it_is():
    assert refused(smc.Sine, "a", 1.0) == "Sine's amplitude is 'a': give a number"
    assert refused(smc.laws, 3).startswith("plant is 3: give a name that smc.plants() lists, or smc.plant(...)")


@pytest.mark.parametrize(
    ("hint", "right", "wrong", "words"),
    [
        (int, [1, np.int64(3)], [1.5, 2.0, True, "1", None, 2**80, np.timedelta64(1, "s")], "a whole number"),
        (float, [1, 0.5, np.float32(1), float("inf")], ["a", True, 1j, None, np.zeros(2), 10**400], "a number"),
        (bool, [True, 0, np.bool_(False)], [2, "yes", np.zeros(2), None], "True or False"),
        (str, ["", "a"], [b"a", 1, "\0", "\udc00"], "text"),
        (str | os.PathLike, ["a", os.curdir, Path("a/b")], [b"a", 1, None, "x" * 256, "\0"], "a path"),
        (Sequence[str] | None, [None, ["a"], ("a",), []], ["a", 3, [3], {"a": 1}], "a list of texts or None"),
        (Iterable[float], [[1], iter("a"), np.zeros(3)], ["a", 3, [1, "a"], np.zeros((2, 2))], "a list of numbers"),
        (tuple[int, int], [(1, 2), [1, 2]], [(1,), (1, 2, 3), "ab", 3, (1, "a")], "2 whole numbers"),
        (Mapping[str, float], [{}, {"a": 1}], [[], {1: 1}, {"a": "b"}], "a dict of texts and numbers"),
        (Callable[[int], None], [print], [3, None], "a function"),
        (smc.Trace | Sequence[smc.Trace], [[]], [3, [3], Shy()], "a Trace or a list of Traces"),
        (Any, [3, None], [], "anything"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_an_annotation_asks_for(hint, right, wrong, words):
    kind = kind_of(hint)
    assert [value for value in right if not kind.takes(value)] == []
    assert [value for value in wrong if kind.takes(value)] == []
    assert kind.one == words


# what they are to a reader


@pytest.mark.parametrize("name", sorted(smc._ORIGINS))
def test_a_public_name_keeps_its_signature_and_words(name):
    value = getattr(smc, name)
    plain = getattr(importlib.import_module(smc._ORIGINS[name]), name)
    assert value.__doc__ == plain.__doc__
    assert value.__name__ == plain.__name__
    if inspect.isfunction(value):
        assert inspect.signature(value) == inspect.signature(plain)
    assert pickle.loads(pickle.dumps(value)) is value


def test_a_class_explains_itself_once():
    before = smc.Trace.save
    assert arguments.explained(smc.Trace).save is before


# lists without end


class Endless(Sequence):
    """A list that cannot be held: whoever takes two million items of it would take them all."""

    def __len__(self):
        return 10**9

    def __getitem__(self, i):
        assert i < 2 * 10**6, "takes every item"
        return i


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda trace, many: smc.Scenario(plant="duffing", law="none", x0=many), "x0 has more than 1,000,000 items"),
        (lambda trace, many: smc.starts(many), "x0 has more than"),
        (lambda trace, many: smc.grid(many, "none"), "plants has more than"),
        (lambda trace, many: smc.grid("duffing", "none", seeds=many), "seeds has more than"),
        (lambda trace, many: smc.margins("duffing", many), "laws has more than"),
        (lambda trace, many: smc.study(many, "out"), "cannot study 0"),
        (lambda trace, many: smc.plant_from(wild.ARM, many), "channels has more than"),
        (lambda trace, many: smc.claims(only=many), "only has more than"),
        (lambda trace, many: smc.claims(gains=many), "gains has more than"),
        (lambda trace, many: smc.figure(many, "a"), "traces has more than"),
        (lambda trace, many: smc.figure(trace, "a", labels=many), "labels are "),
        (lambda trace, many: smc.still(trace, many, "a.png"), "time is "),
        (
            lambda trace, many: smc.Table(data=pa.table({"plant": ["duffing"]})).select(plant=many),
            "plant has more than",
        ),
    ],
)
def test_a_list_without_end_is_refused_before_it_fills_the_memory(trace, call, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert re.match(words, refused(call, trace, Endless()))


def test_a_value_that_cannot_be_iterated_is_no_list():
    for x0 in (wild.Awkward(), np.array(0.5)):
        assert refused(smc.grid, "duffing", "none", seeds=x0).startswith("seeds is ")
    assert refused(smc.Scenario, plant="duffing", law="none", x0=wild.Awkward()).endswith(": give a list")


def test_an_annotation_looks_at_the_beginning_of_a_list_without_end():
    assert kind_of(Sequence[int]).takes(Endless())
    assert not kind_of(Sequence[str]).takes(range(10**9))


# values that cannot be shown


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Shy(), "<Shy>"),
        ([Shy()], "<list>"),
        (nested(100_000), "<list>"),
        (10**5000, "<int>"),
        ("x" * 10**8, f"'{'x' * 56}..."),
        (dict.fromkeys(range(10**6)), f"{str(dict.fromkeys(range(10)))[:57]}..."),
    ],
    ids=["shy", "in a list", "nested", "digits", "long text", "long dict"],
)
def test_a_value_is_shown_whatever_its_repr_does(value, text):
    assert shown(value) == text


def test_a_message_is_one_line_of_bounded_length():
    text = str(smc.ScenarioError(f"cannot write {'x' * 10**6}\n\x1b[31m: choose another"))
    assert len(text) < 2000
    assert text.isprintable()
    assert text.endswith("xx\\n\\x1b[31m: choose another")


def test_a_table_selects_none_of_its_rows():
    table = smc.Table(data=pa.table({"plant": ["duffing"]}))
    assert len(table.select(plant=[])) == 0
    assert len(table.select(plant=["duffing"])) == 1


def test_control_characters_are_shown_as_escapes():
    class Loud:
        def __repr__(self):
            return "\x1b[31m\a\udc00 \n x"

    assert shown(Loud()) == "\\x1b[31m\\x07\\udc00 x"
