"""Limits that a test sets on metrics, and the message with a table of them if one is violated."""

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, ParamSpec, TypeVar

from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.common.tabular import Tabular
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
    text = quantity(value, unit)
    if not isinstance(limit, tuple | list):
        high = number(what, limit, infinite=True)
        return Limit(metric, text, f"<= {quantity(high)}", compared <= high)
    if len(limit) != 2:
        raise ScenarioError(
            f"{what} is {shown(limit)}: give the highest value, or (lowest, highest)"
        )
    low, high = (number(what, end, infinite=True) for end in limit)
    if low > high:
        raise ScenarioError(f"{what} is {shown(limit)}: give the lower one first")
    words = f"{quantity(low)} .. {quantity(high)}"
    return Limit(metric, text, words, low <= compared <= high)


def judge(limits: Sequence[Limit], kind: str, word: str, note: object) -> None:
    """Raise an AssertionError with a table of all limits if one is violated."""
    missed = []
    rows = []
    for metric, value, limit, within in limits:
        rows.append((metric, value, limit, "yes" if within else "NO"))
        if not within:
            missed.append(f"{metric} is {value}, {word} {limit}")
    if missed:
        table = Tabular(headings=("metric", "value", kind, "ok"), rows=rows)
        raise AssertionError(f"{'; '.join(missed)} ({note})\n{table}")


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
