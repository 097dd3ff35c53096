"""A user's time series as a signal, from numbers or from a CSV file, which is checked cell by cell."""

import dataclasses
import math
import os
import re
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numba import njit

from smc_mujoco.common.errors import ScenarioError, number, shown, unknown
from smc_mujoco.common.files import csv_rows
from smc_mujoco.simulation.signals import EARLY, Signal

MAX_GAP_STEPS = 1.5  # longest step over the median step; chosen: a logger's jitter is below, a missing row above
NAME_WITH_UNIT = re.compile(r"(.*\S)\s*\[([^\]]*)\]")  # name of a column
SECOND_SPELLINGS = ("s", "sec", "second", "seconds")


@njit(error_model="numpy")
def last_before(data, t, end, early):
    """Return the last i below `end` for which data[0, i] * early <= t; 0 if there is none."""
    low, high = 0, end
    while high - low > 1:
        middle = (low + high) // 2
        if t < data[0, middle] * early:
            high = middle
        else:
            low = middle
    return low


@dataclasses.dataclass(frozen=True, repr=False)
class TimeSeries(Signal):
    """Straight lines between the points (times, values), and 0 before the first and after the last point.

    Attributes:
      times: (N,), s, increasing, N >= 2.
      values: (N,), in the unit of what the signal is added to.
      data: both, (2, N) float64, read-only.

    Raises:
      ScenarioError: a number is not finite, or times do not increase.
    """

    times: Sequence[float]
    values: Sequence[float]

    series = True

    def __post_init__(self):
        kind = type(self).__name__
        for name in ("times", "values"):
            object.__setattr__(self, name, _floats(f"{kind}'s {name}", getattr(self, name)))
        if len(self.times) != len(self.values):
            raise ScenarioError(
                f"{kind} has {len(self.times)} times and {len(self.values)} values: give as many of each"
            )
        _check(kind, self.times, self.values, "item {}".format)
        object.__setattr__(self, "data", self._data())
        self.data.flags.writeable = False

    def _data(self) -> np.ndarray:
        """Return the array that `value` reads, (rows, N)."""
        return np.array([self.times, self.values])

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.times)} points, {self.times[0]:g} to {self.times[-1]:g} s)"

    def __reduce__(self):  # a copy has separate data, also read-only
        return type(self), (self.times, self.values)

    def parameters(self) -> dict[str, float]:
        """Return no parameters: all numbers are data."""
        return {}

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str], column: str | None = None, time: str | None = None) -> "TimeSeries":
        """Return the series in a CSV file: a row per time, at a nearly constant rate.

        Commas separate the cells, or semicolons, beside which a comma is a decimal point.

        Args:
          path: the file. Its first row may name the columns; otherwise they are time and value. A name may have a unit,
            "d [N m]", as Trace.export writes it, which `column` and `time` may leave out.
          column: name of the column of values. Default: the first besides time.
          time: name of the column of times, s. Default: "t" or "time", else the first.

        Raises:
          ScenarioError: there is no such file or column, times are not in s or do not increase, a cell is empty or not
            a finite number, or a step of time is longer than 1.5 median steps. The error names the line.
        """
        rows = csv_rows(path)
        if not rows:
            raise ScenarioError(f"{path} is empty: give a CSV file with the columns t and a value")
        places, body = _columns(path, rows, column, time)
        names = {i: rows[0][1][i] if body is not rows else f"column {i + 1}" for i in places}
        times, values = ([_cell(path, line, names[i], row[i]) for line, row in body] for i in places)

        def where(i: int) -> str:
            return f"line {body[i][0]}"

        _check(str(path), times, values, where)
        steps = np.diff(times)
        median = np.quantile(steps, 0.5, method="lower")  # of two steps the shorter, because the other has the gap
        for i in np.flatnonzero(steps > MAX_GAP_STEPS * median)[:1]:
            raise ScenarioError(
                f"{path} has a gap after {where(i)}, from {times[i]:g} s to {times[i + 1]:g} s, where rows are "
                f"{median:g} s apart: fill it in, or cut the file there"
            )
        return cls(times, values)

    @staticmethod
    def value(t, p, data):
        last = data.shape[1] - 1
        if t < data[0, 0] * EARLY or t > data[0, last] / EARLY:
            return 0.0, 0.0, 0.0
        low = last_before(data, t, last, EARLY)
        slope = (data[1, low + 1] - data[1, low]) / (data[0, low + 1] - data[0, low])
        return data[1, low] + slope * (t - data[0, low]), slope, 0.0


@dataclasses.dataclass(frozen=True, repr=False)
class Held(TimeSeries):
    """Steps: 0 before the first point, then the value of the last point whose time has come.

    Attributes:
      times: (N,), s, increasing, N >= 2. Runs are exact if they are whole numbers of control periods.
      values: (N,), in the unit of what the signal is added to.
    """

    @staticmethod
    def value(t, p, data):
        if t < data[0, 0] * EARLY:
            return 0.0, 0.0, 0.0
        return data[1, last_before(data, t, data.shape[1], EARLY)], 0.0, 0.0


def _floats(what: str, items: object) -> tuple[float, ...]:
    """Return a user's sequence of finite numbers as floats."""
    if isinstance(items, np.ndarray):
        if items.dtype == float and items.ndim == 1 and np.isfinite(items).all():
            return tuple(items.tolist())
        items = items.tolist()
    if not isinstance(items, Iterable) or isinstance(items, str | bytes | dict | set):
        raise ScenarioError(f"{what} are {shown(items)}: give a sequence of numbers")
    return tuple(x if type(x) is float and math.isfinite(x) else number(f"{what}[{i}]", x) for i, x in enumerate(items))


def _check(what: str, times: Sequence[float], values: Sequence[float], where: Callable[[int], str]) -> None:
    """Raise ScenarioError if there are fewer than two points, times do not increase, or a slope overflows."""
    if len(times) < 2:
        raise ScenarioError(f"{what} has {len(times)} points: give at least two")
    for i in np.flatnonzero(np.diff(times) <= 0.0)[:1] + 1:
        raise ScenarioError(
            f"{what}, {where(i)}: {times[i]:.12g} s comes after {times[i - 1]:.12g} s: give times that increase"
        )
    with np.errstate(all="ignore"):
        slopes = np.diff(values) / np.diff(times)
    for i in np.flatnonzero(~np.isfinite(slopes))[:1]:
        raise ScenarioError(
            f"{what}, {where(i + 1)}: from {values[i]:g} to {values[i + 1]:g} within {times[i + 1] - times[i]:g} s is "
            "too steep for a float: give a smaller step of the value or a longer one of time"
        )


def _columns(
    path: str | os.PathLike[str], rows: list[tuple[int, list[str]]], column: str | None, time: str | None
) -> tuple[tuple[int, int], list[tuple[int, list[str]]]]:
    """Return the indices of the columns of times and values, and the rows below the header."""
    names = rows[0][1]
    if len(names) < 2:
        raise ScenarioError(f"{path} has one column in its first line: give two, time and value, with commas between")
    for line, row in rows:
        if len(row) != len(names):
            raise ScenarioError(f"{path}, line {line}: {len(row)} cells for {len(names)} columns: give one for each")
    if all(not name or _is_number(name) for name in names):
        if named := column or time:
            raise ScenarioError(
                f"{path} has no header to find {shown(named)} in: write the columns' "
                "names in its first line, or leave out column and time"
            )
        return (0, 1), rows
    places: dict[str, int] = {}
    for spellings in (names, [NAME_WITH_UNIT.sub(r"\1", name) for name in names]):
        for i, name in enumerate(spellings):
            places.setdefault(name, i)
    if time is None:
        time = next((name for name in ("t", "time") if name in places), names[0])
    if not isinstance(time, str) or time not in places:
        raise unknown(f"time column of {path}", time, names)
    if column is not None and (not isinstance(column, str) or column not in places):
        raise unknown(f"column of {path}", column, names)
    i = places[time]
    if (unit := NAME_WITH_UNIT.fullmatch(names[i])) and unit[2] not in SECOND_SPELLINGS:
        raise ScenarioError(f"time column {names[i]!r} of {path} is not in seconds: give times in s")
    return (i, int(i == 0) if column is None else places[column]), rows[1:]


def _cell(path: str | os.PathLike[str], line: int, name: str, cell: str) -> float:
    """Return the number in a cell."""
    if not cell:
        raise ScenarioError(f"{path}, line {line}: {name} is empty: fill it in, or cut the file there")
    if not _is_number(cell) or not math.isfinite(float(cell)):
        raise ScenarioError(f"{path}, line {line}: {name} is {shown(cell)}: give a finite number")
    return float(cell)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
