"""Values that remember what they were compared with, and the tables that tell it when a test fails."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from smc_mujoco.common.errors import ScenarioError, number, shown


class Limit(NamedTuple):
    """What a test asked of a metric: in words, "< 0.6", and whether it was so."""

    metric: str
    words: str
    kept: bool


class Value(float):
    """A metric's value. Compared with a plain number it notes that number as a limit, for the table."""

    metric: str
    limits: list[Limit]

    def __new__(cls, value: float, metric: str, limits: list[Limit]):
        """A value of `metric` that notes its limits in `limits`."""
        new = super().__new__(cls, value)
        new.metric, new.limits = metric, limits
        return new

    def __reduce__(self):
        return float, (float(self),)

    def __repr__(self) -> str:
        return f"{float(self):.6g}"

    def __lt__(self, other: float) -> bool:
        return self._noted("<", other, float.__lt__(self, other))

    def __le__(self, other: float) -> bool:
        return self._noted("<=", other, float.__le__(self, other))

    def __gt__(self, other: float) -> bool:
        return self._noted(">", other, float.__gt__(self, other))

    def __ge__(self, other: float) -> bool:
        return self._noted(">=", other, float.__ge__(self, other))

    def _noted(self, sign: str, other: object, kept: bool) -> bool:
        if isinstance(other, int | float) and not isinstance(other, Value):
            self.limits.append(Limit(self.metric, f"{sign} {told(other)}", kept))
        return kept


def bound(metric: str, value: float, wanted: object) -> Limit:
    """The Limit that `wanted` sets: a number is the most that the value may be, a pair the least and the most.

    Raises:
      ScenarioError: neither.
    """
    if isinstance(wanted, tuple | list):
        if len(wanted) != 2:
            raise ScenarioError(f"limit of {metric} is {shown(wanted)}: give the most, or (least, most)")
        least, most = (number(f"limit of {metric}", end, infinite=True) for end in wanted)
        if least > most:
            raise ScenarioError(f"limits of {metric} are {shown(wanted)}: give the lower one first")
        return Limit(metric, f"{told(least)} .. {told(most)}", least <= value <= most)
    most = number(f"limit of {metric}", wanted, infinite=True)
    return Limit(metric, f"<= {told(most)}", value <= most)


def told(value: float, unit: str = "") -> str:
    """A number, with its unit, as tables have it; inf is "never", as in every table of this package."""
    if math.isinf(value):
        return "never"
    return f"{value:.6g} {unit}".rstrip() if unit != "1" else f"{value:.6g}"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Plain text in columns."""
    lines = [tuple(heads), *map(tuple, rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("  ".join(map(str.ljust, line, widths)).rstrip() for line in lines)


def answer(kept: bool) -> str:
    """What stands under `ok`."""
    return "yes" if kept else "NO"
