"""What the checks of a user's values take, at and around their bounds, and what they say of all
else.
"""

import math
import sys
import warnings

import numpy as np
import pytest

from smc_mujoco.common import annexes, errors, extras, libmujoco
from smc_mujoco.common.errors import (
    ScenarioError,
    find,
    items_of,
    name,
    number,
    one_line,
    shown,
    unknown,
    whole,
)
from smc_mujoco.common.frozen import frozen

pytestmark = pytest.mark.quick

LAWS = ("super_twisting", "lqr", "terminal")


class Silent:
    """An object of a user's whose words fail."""

    def __repr__(self):
        raise KeyError

    __iter__ = __str__ = __repr__


class Odd(Exception):
    """An exception of a user's whose message fails."""

    def __str__(self):
        raise KeyError


TAKEN = [  # call, what it returns
    (lambda: number("k", 2), 2.0),
    (lambda: number("k", np.array(3.5)), 3.5),
    (lambda: number("k", 1e-9, above=0.0), 1e-9),
    (lambda: number("k", -2.0, low=-2.0, high=3.0), -2.0),
    (lambda: number("k", 3.0, low=-2.0, high=3.0), 3.0),
    (lambda: number("k", math.inf, infinite=True), math.inf),
    (lambda: number("k", 10**400, infinite=True), math.inf),
    (lambda: whole("n", 2.0, 2, 5), 2),
    (lambda: whole("n", np.int64(5), 2, 5), 5),
    (lambda: name("label", "a" * 100), "a" * 100),
    (lambda: find("law", "lqr", {"lqr": 3}), 3),
    (lambda: items_of("runs", iter("ab")), ["a", "b"]),
    (lambda: shown("x" * 58), "'" + "x" * 58 + "'"),
    (lambda: shown("x" * 59), "'" + "x" * 56 + "..."),
    (lambda: shown([0] * 70), "[" + "0, " * 18 + "0,..."),
    (lambda: shown({"a": "b\n"}), r"{'a': 'b\n'}"),
    (lambda: shown(Silent()), "<Silent>"),
    (lambda: errors.printable("a\n\x1b[1m\u2028ä"), r"a\n\x1b[1m\u2028ä"),
    (lambda: one_line("a \n b\x07", 5), "a b?"),
    (lambda: one_line("abcdef", 6), "abcdef"),
    (lambda: one_line("abcdefg", 6), "abc..."),
    (lambda: errors.words(KeyError("k")), "KeyError: 'k'"),
    (lambda: errors.words(Odd()), "Odd, whose message cannot be read"),
    (lambda: str(ScenarioError("a" * 1500)), "a" * 1500),
    (lambda: str(ScenarioError("a" * 1001 + "b" * 500)), "a" * 997 + "..." + "b" * 500),
    (lambda: dict(frozen({"a": 1})), {"a": 1}),
    (lambda: hash(frozen({"a": 1, "b": 2})) == hash(frozen({"b": 2, "a": 1})), True),
    (lambda: extras.missing_extra("film", "A film", "sys", "json"), None),
    (
        lambda: extras.missing_extra("film", "It", "a_", "sys", "b_"),
        "It needs a_ and b_: pip install 'smc-mujoco[film]'",
    ),
]
REFUSED = [  # call, what the sentence says
    (lambda: number("k", True), "k is True: give a number"),
    (lambda: number("k", np.timedelta64(1)), "k is np.timedelta64(1): give a number"),
    (lambda: number("k", "1"), "k is '1': give a number"),
    (lambda: number("k", np.ones(1)), "k is array([1.]): give a number"),
    (lambda: number("k", math.nan, infinite=True), "k is nan: give a finite number"),
    (lambda: number("k", -math.inf), "k is -inf: give a finite number"),
    (lambda: number("k", 0.0, above=0.0), "k is 0: give a number greater than 0"),
    (lambda: number("k", -2.1, low=-2.0), "k is -2.1: give at least -2"),
    (lambda: number("k", 3.1, high=3.0), "k is 3.1: give at most 3"),
    (lambda: whole("n", 2.5, 2, 5), "n is 2.5: give a whole number from 2 to 5"),
    (lambda: whole("n", 6, 2, 5), "n is 6: give a whole number from 2 to 5"),
    (lambda: whole("n", 1, 2, 5), "n is 1: give a whole number from 2 to 5"),
    (lambda: whole("n", None, 2, 5), "n is None: give a whole number from 2 to 5"),
    (lambda: name("label", " "), "label is ' ': give a name of printable characters"),
    (lambda: name("label", "a\n"), r"label is 'a\n': give a name of printable characters"),
    (lambda: name("label", 3), "label is 3: give a name of printable characters"),
    (
        lambda: name("label", "a" * 101),
        f"label is '{'a' * 56}..., 101 characters: give at most 100",
    ),
    (lambda: items_of("runs", range(10**6 + 1)), "runs has more than 1,000,000 items: give fewer"),
    (lambda: items_of("runs", 3), "runs is 3: give a list"),
    (lambda: items_of("runs", Silent()), "runs is <Silent>: give a list"),
    (lambda: find("law", "lqrr", dict.fromkeys(LAWS)), "unknown law 'lqrr': did you mean 'lqr'?"),
    (
        lambda: find("law", 3, dict.fromkeys(LAWS)),
        "unknown law 3: choose from lqr, super_twisting, terminal",
    ),
]
NAMES = {  # what is typed -> what is said of it
    "STX": "choose from lqr, super_twisting, terminal",
    "sta": "choose from lqr, super_twisting, terminal",
    "Terminal": "did you mean 'terminal'?",
    "twist": "did you mean 'super_twisting'?",
    "": "choose from lqr, super_twisting, terminal",
}


@pytest.mark.parametrize("call", range(len(TAKEN)))
def test_what_is_taken_comes_back(call):
    call_made, expected = TAKEN[call]
    assert call_made() == expected
    assert type(call_made()) is type(expected)


@pytest.mark.parametrize("call", range(len(REFUSED)))
def test_what_is_refused_is_one_sentence(call):
    call_made, sentence = REFUSED[call]
    with pytest.raises(ScenarioError) as refused:
        call_made()
    assert str(refused.value) == sentence


@pytest.mark.parametrize("typed", NAMES)
def test_an_unknown_name_is_answered_with_the_nearest_or_with_all(typed):
    assert str(unknown("law", typed, LAWS)) == f"unknown law {typed!r}: {NAMES[typed]}"


def test_of_many_names_three_are_said_and_where_all_are():
    many = [f"law_{letter}" for letter in "abcdefghijklm"]
    said = str(unknown("law", "zzz", many))
    assert said.count("law_") == 3
    assert "smc-mujoco list laws" in said
    assert str(unknown("bound", "zzz", many)).count("law_") == 13


def test_a_frozen_mapping_does_not_change():
    values = frozen({"a": 1})
    changes = (lambda: values.update(b=2), values.clear, values.popitem, lambda: values.pop("a"))
    changes += (lambda: values.setdefault("b", 2), lambda: values.__setitem__("a", 2))
    for change in (*changes, lambda: values.__delitem__("a"), lambda: values.__ior__({"a": 2})):
        with pytest.raises(TypeError, match=r"^a checked mapping does not change: make a new one$"):
            change()
    assert values == {"a": 1}


def test_a_warning_points_to_the_line_of_the_user():
    """The nearest caller outside the package: the frame of this test, from however deep."""
    space = {"__name__": "smc_mujoco.deep", "users_stacklevel": errors.users_stacklevel}
    exec("def level(n):\n    return users_stacklevel() if n == 0 else level(n - 1)", space)
    assert [space["level"](n) for n in range(3)] == [2, 3, 4]


# what is missing


def test_a_missing_package_is_named_with_its_cure(monkeypatch):
    for wait, cure in (
        (extras.extra("film", "A film"), "pip install 'smc-mujoco[film]'"),
        (extras.package("onnx", "A film"), "pip install onnx"),
    ):
        with pytest.raises(extras.MissingPackageError) as missing, wait:
            import nope_  # noqa: F401  # pyright: ignore[reportMissingImports]
        if "smc-mujoco" in cure:
            what = "an optional package"
        else:
            what = "onnx"
        assert str(missing.value) == f"A film needs {what} (No module named 'nope_'): {cure}"
        assert isinstance(missing.value, ImportError | ScenarioError)
    with (
        pytest.raises(extras.MissingPackageError, match="no attribute 'nope'"),
        extras.extra("film", "A film"),
    ):
        math.nope  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]
    monkeypatch.setattr(sys, "version_info", (3, 13, 0))
    assert extras.cure("dm") == "take Python 3.12, the last for which pip can install it"
    assert extras.cure("film") == "pip install 'smc-mujoco[film]'"
    monkeypatch.setattr(sys, "version_info", (3, 12, 9))
    assert extras.cure("dm") == "pip install 'smc-mujoco[dm]'"


def test_a_missing_annex_is_named_and_no_other_module(monkeypatch):
    monkeypatch.setattr(annexes, "ANNEXES", ("metrics", "letters"))
    assert annexes.missing_annex("smc_mujoco.letters.post") == "letters"
    assert annexes.missing_annex("smc_mujoco.metrics.fold") == ""
    with pytest.raises(extras.MissingPackageError) as missing:
        annexes.module("smc_mujoco.letters.post", "a letter")
    assert (
        str(missing.value)
        == "a letter needs smc_mujoco.letters, which is missing here: install all of smc-mujoco"
    )
    assert annexes.module("smc_mujoco.metrics", "C").__name__ == "smc_mujoco.metrics"
    assert annexes.module("smc_mujoco.common.text", "a number").__name__ == "smc_mujoco.common.text"


def test_mujoco_without_its_library_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(libmujoco.mujoco, "__file__", str(tmp_path / "__init__.py"))
    with pytest.raises(ScenarioError, match=r"^no MuJoCo library in .*: reinstall mujoco$"):
        libmujoco.path()
    (tmp_path / "libmujoco.so.3").write_text("")
    assert libmujoco.path() == tmp_path / "libmujoco.so.3"


def test_parts_of_mujoco_of_two_versions_are_named_with_the_cure(tmp_path):
    """pip leaves the parts of 4.0.0 below an older mujoco, and `pip check` is content."""
    for part in ("mujoco-3.17.0", "mujoco_mjx-4.1.0", "mujoco_warp-3.17.0"):
        (tmp_path / f"{part}.dist-info").mkdir()
    libmujoco.check_parts(tmp_path)
    (tmp_path / "mujoco_core-4.0.0.dist-info").mkdir()
    with pytest.raises(
        ScenarioError,
        match=r"\(mujoco 3.17.0, mujoco-core 4.0.0\): run `pip uninstall mujoco mujoco-core`",
    ):
        libmujoco.check_parts(tmp_path)


def test_a_long_message_keeps_its_start_and_its_cure():
    said = str(ScenarioError("a" * 2000 + "b" * 500))
    assert said == "a" * 997 + "..." + "b" * 500
    assert len(str(ScenarioError("a" * 1500))) == 1500


def test_a_doubt_is_told_once_whatever_its_numbers_but_of_each_joint():
    token = errors.warned.set(set())
    sentences = [
        "x0 of j1 is 30 rad: give 0.5236",
        "x0 of j1 is -3.15e-2 rad: give 0.55",
        "x0 of j2 is 30 rad: give 0.5236",
    ]
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            for sentence in sentences:
                errors.warn_once(sentence)
    finally:
        errors.warned.reset(token)
    assert [str(warning.message) for warning in caught] == [sentences[0], sentences[2]]
