"""Limits that a test sets on metrics, and the message if one is violated."""

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, ParamSpec, TypeVar

from smc_mujoco.answers.answers import labelled
from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.common.text import number as shortened
from smc_mujoco.metrics.catalogue import CATALOGUE

__tracebackhide__ = True  # pytest hides the frames of a module that has it
P = ParamSpec("P")
R = TypeVar("R")


class Limit(NamedTuple):
    """A metric with its value and its limit, both as text, and whether the value is within the
    limit.
    """

    metric: str
    value: str
    limit: str
    within: bool


def bound(metric: str, value: float, unit: str, limit: object) -> Limit:
    """Return the Limit of a value that may be up to `limit`, or in the range `limit` = (lowest,
    highest).

    A metric of a limit cycle is NaN in a run without one. `Metric.absent` is then compared with the
    limit.
    """
    compared = value
    if math.isnan(value):
        compared = CATALOGUE[metric.rpartition(" ")[2]].absent
    what = f"limit of {metric}"
    if not isinstance(limit, tuple | list):
        high = number(what, limit, infinite=True)
        text = _near(value, unit, [high])
        return Limit(metric, text, f"<= {quantity(high)}", compared <= high)
    if len(limit) != 2:
        raise ScenarioError(
            f"{what} is {shown(limit)}: give the highest value, or (lowest, highest)"
        )
    low, high = (number(what, end, infinite=True) for end in limit)
    if low > high:
        raise ScenarioError(f"{what} is {shown(limit)}: give the lower one first")
    words = f"{quantity(low)} .. {quantity(high)}"
    return Limit(metric, _near(value, unit, [low, high]), words, low <= compared <= high)


def _near(value: float, unit: str, limits: Sequence[float]) -> str:
    """Return a value with three digits, or with more where it lies that near to a limit."""
    text = shortened(value)
    if not math.isfinite(value) or any(shortened(limit) == text for limit in limits):
        return quantity(value, unit)
    return f"{text} {unit}".removesuffix(" 1").rstrip()


def judge(limits: Sequence[Limit], word: str, *notes: tuple[str, str]) -> None:
    """Raise an AssertionError if a limit is violated: which ones, those that hold, and labelled
    notes, a line each.
    """
    missed = []
    holding = []
    for metric, value, limit, within in limits:
        if within:
            holding.append(f"{metric} {value}, {limit}")
        else:
            missed.append(f"{metric} is {value}, {word} {limit}")
    if missed:
        pairs = [("holds", "; ".join(holding)), *notes] if holding else notes
        raise AssertionError("\n".join(["; ".join(missed), *labelled(pairs)]))


def quantity(value: float, unit: str = "") -> str:
    """Return a number with its unit for tables.

    As in every table of this package inf is "never", and NaN "none".
    """
    if math.isnan(value):
        return "none"
    if math.isinf(value):
        return "never"
    if unit != "1":
        return f"{value:.6g} {unit}".rstrip()
    return f"{value:.6g}"


def without_frames(function: Callable[P, R]) -> Callable[P, R]:
    """Return the function.

    At its ScenarioErrors pytest shows the test's line, and not the lines of this package.
    """

    @functools.wraps(function)
    def call(*args: P.args, **named: P.kwargs) -> R:
        try:
            return function(*args, **named)
        except ScenarioError as error:
            raise ScenarioError(str(error)) from None

    return call
