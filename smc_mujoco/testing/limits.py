"""Limits that a test sets on metrics, and the sentence and table of those that are missed."""

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, ParamSpec, TypeVar

from smc_mujoco.common.errors import ScenarioError, number, shown

P = ParamSpec("P")
R = TypeVar("R")


class Limit(NamedTuple):
    """A metric with its value and its limit, both in words, and whether it keeps within the limit."""

    metric: str
    value: str
    limit: str
    kept: bool


def bound(metric: str, value: float, unit: str, limit: object) -> Limit:
    """Return the Limit for a number, the most that the value may be, or a pair, the least and the most.

    Raises:
      ScenarioError: neither.
    """
    if not isinstance(limit, tuple | list):
        most = number(f"limit of {metric}", limit, infinite=True)
        return Limit(metric, told(value, unit), f"<= {told(most)}", value <= most)
    if len(limit) != 2:
        raise ScenarioError(f"limit of {metric} is {shown(limit)}: give the most, or (least, most)")
    least, most = (number(f"limit of {metric}", end, infinite=True) for end in limit)
    if least > most:
        raise ScenarioError(f"limits of {metric} are {shown(limit)}: give the lower one first")
    return Limit(metric, told(value, unit), f"{told(least)} .. {told(most)}", least <= value <= most)


def judge(limits: Sequence[Limit], kind: str, word: str, note: object) -> None:
    """Raise an AssertionError with a table of all limits if one is missed.

    Args:
      kind: heading of the limits.
      word: what stands between a value and the limit that it misses.
      note: said in parentheses.
    """
    __tracebackhide__ = True
    if missed := [f"{metric} is {value}, {word} {limit}" for metric, value, limit, kept in limits if not kept]:
        lines = table(("metric", "value", kind, "ok"), [(*line, "yes" if kept else "NO") for *line, kept in limits])
        raise AssertionError(f"{'; '.join(missed)} ({note})\n{lines}")


def told(value: float, unit: str = "") -> str:
    """Return a number with its unit as tables show it. Infinity is "never", as in every table of this package."""
    if math.isinf(value):
        return "never"
    return f"{value:.6g} {unit}".rstrip() if unit != "1" else f"{value:.6g}"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return plain text in columns."""
    lines = [tuple(heads), *map(tuple, rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("  ".join(map(str.ljust, line, widths)).rstrip() for line in lines)


def without_frames(function: Callable[P, R]) -> Callable[P, R]:
    """Return the function with its ScenarioErrors raised anew, so that pytest shows no frame of this package."""

    @functools.wraps(function)
    def call(*args: P.args, **named: P.kwargs) -> R:
        __tracebackhide__ = True
        try:
            return function(*args, **named)
        except ScenarioError as error:
            raise ScenarioError(str(error)) from None

    return call
