"""Signals through points in time: of numbers, of a CSV file, of waypoints, and of a tip's path in
space.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numba import njit

from smc_mujoco.common import column_units
from smc_mujoco.common.aliases import AnyPath, Array, Floats
from smc_mujoco.common.errors import ScenarioError, items_of, number, shown, unknown
from smc_mujoco.common.files import csv_rows
from smc_mujoco.common.text import real
from smc_mujoco.mechanisms.inverse_kinematics import solve
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.signals import EARLY, Signal

# longest step over the median step; chosen: a logger's jitter is below, a missing row above
MAX_GAP_STEPS = 1.5
KNOT_SPACING = (
    0.01  # s, of a path in space; chosen: between knots the tip leaves its path by micrometres
)
MAX_POINTS = 10_000_000  # of a series; chosen: a trace has about as many samples at most
MAX_KNOTS = 1_000_000  # of a path in space: minutes of computing


@njit(error_model="numpy")
def last_before(data, t, end, early):
    """Return the last i below `end` for which data[0, i] * early <= t; 0 if there is none."""
    low = 0
    high = end
    while high - low > 1:
        middle = (low + high) // 2
        if t < data[0, middle] * early:
            high = middle
        else:
            low = middle
    return low


@dataclasses.dataclass(frozen=True, repr=False)
class TimeSeries(Signal):
    """Straight lines between the points (times, values), and 0 before the first and after the last
    point.

    Attributes:
      times: (N,), s, increasing, N >= 2.
      values: (N,), in the unit of what the signal is added to.
      data: times and values, (2, N) float64, read-only.

    Raises:
      ScenarioError: a number is not finite, or times do not increase.
    """

    times: Sequence[float]
    values: Sequence[float]

    series = True

    def __post_init__(self):
        kind = type(self).__name__
        for name in ("times", "values"):
            floats = _floats(f"{kind}'s {name}", getattr(self, name))
            object.__setattr__(self, name, floats)
        if len(self.times) != len(self.values):
            raise ScenarioError(
                f"{kind} has {len(self.times)} times and {len(self.values)} values: give as many "
                "of each"
            )
        _check(kind, self.times, "item {}".format)
        with np.errstate(all="ignore"):
            squares = np.diff(self.times) ** 2
            curvature = np.diff(self.values) / squares
        if not np.isfinite(curvature).all():
            raise ScenarioError(
                f"{kind} is too steep for a float: give longer steps of time or smaller ones of "
                "value"
            )
        object.__setattr__(self, "data", self._data())
        self.data.flags.writeable = False

    def _data(self) -> Array:
        """Return the array that `value` reads, (rows, N)."""
        return np.array([self.times, self.values])

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({len(self.times)} points, {self.times[0]:g} to "
            f"{self.times[-1]:g} s)"
        )

    def __reduce__(self):  # a copy has separate data, also read-only
        return type(self), (self.times, self.values)

    def parameters(self) -> dict[str, float]:
        """Return no parameters: all numbers are data."""
        return {}

    @classmethod
    def from_csv(cls, path: AnyPath, column: str | None = None) -> "TimeSeries":
        """Return the series in a CSV file: a row per time, at a nearly constant rate.

        Commas separate the cells. If semicolons do, a comma is a decimal point.

        Args:
          path: the file. Its first row may name the columns, perhaps with a unit: "d [N m]", as
            Trace.export writes it; degrees, ms and the like become SI units. Times are in the
            column "t" or "time", else in the first.
          column: name of the column of values, with its unit or without. Default: the first besides
            time.

        Raises:
          ScenarioError: there is no such file or column, two columns have one name, the unit of
            time is not known, times do not increase, a cell is empty or not a finite number, or a
            step of time is longer than 1.5 median steps. The error names the line.
        """
        rows = csv_rows(path)
        if not rows or len(rows[0][1]) < 2:
            raise ScenarioError(
                f"{path} has no two columns: give time and value, with commas between"
            )
        names = rows[0][1]
        if all(_number(name) is None for name in names):
            rows = rows[1:]
            names, factors = column_units.headings(names, str(path))
        else:
            names = [f"column {i + 1}" for i in range(len(names))]
            factors = [1.0] * len(names)
        places = _columns(path, names, factors, column)
        for line, row in rows:
            if len(row) != len(names):
                raise ScenarioError(
                    f"{path}, line {line}: {len(row)} cells for {len(names)} columns: give as many"
                )
            for i in places:
                if (value := _number(row[i])) is None or not math.isfinite(value):
                    cure = "give a finite number, or cut the file there"
                    raise ScenarioError(
                        f"{path}, line {line}: {names[i]} is {shown(row[i])}: {cure}"
                    )
        of_time, of_value = places
        times = [factors[of_time] * float(row[of_time]) for _, row in rows]
        values = [factors[of_value] * float(row[of_value]) for _, row in rows]
        _check(str(path), times, lambda i: f"line {rows[i][0]}")
        steps = np.diff(times)
        median = np.quantile(
            steps, 0.5, method="lower"
        )  # of two steps the shorter, because the other has the gap
        for i in np.flatnonzero(steps > MAX_GAP_STEPS * median)[:1]:
            raise ScenarioError(
                f"{path} has a gap after line {rows[i][0]}, from {times[i]:g} s to "
                f"{times[i + 1]:g} s, where rows are {median:g} s apart: fill it in, or cut the "
                "file there"
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
      times: (N,), s, increasing, N >= 2. Runs are exact if all times are whole numbers of control
        periods.
      values: (N,), in the unit of what the signal is added to.
    """

    @staticmethod
    def value(t, p, data):
        if t < data[0, 0] * EARLY:
            return 0.0, 0.0, 0.0
        return data[1, last_before(data, t, data.shape[1], EARLY)], 0.0, 0.0


@dataclasses.dataclass(frozen=True, repr=False)
class Waypoints(TimeSeries):
    """The minimum-jerk motion through the points (times, values), at rest before the first and
    after the last.

    No other function through them, at rest at both ends, has a smaller integral of the squared
    jerk: it is the spline of fifth degree whose fourth derivative is continuous. It does not stop
    at inner points. With two points it is `MinimumJerk`. Source: I. J. Schoenberg, "Spline
    functions and the problem of graduation", Proc. Natl. Acad. Sci. 52(4):947, 1964.

    Attributes:
      times: (N,), s, increasing, N >= 2.
      values: (N,), rad or m.
    """

    rows = 4  # times, values and the spline's first and second derivative there

    def _data(self) -> Array:
        from scipy.interpolate import make_interp_spline

        rest = [(1, 0.0), (2, 0.0)]
        spline = make_interp_spline(self.times, self.values, k=5, bc_type=(rest, rest))
        velocities = spline(self.times, 1)
        data = np.array([self.times, self.values, velocities, spline(self.times, 2)])
        data[2:, [0, -1]] = 0.0
        return data

    @staticmethod
    def value(t, p, data):
        last = data.shape[1] - 1
        if t <= data[0, 0]:
            return data[1, 0], 0.0, 0.0
        if t >= data[0, last]:
            return data[1, last], 0.0, 0.0
        low = last_before(data, t, last, 1.0)
        high = low + 1
        # quintic through both ends: r = r0 + v0 T a + a0 T^2 a^2 / 2 + c3 a^3 + c4 a^4 + c5 a^5, a
        # = (t - t0) / T
        T = data[0, high] - data[0, low]
        a = (t - data[0, low]) / T
        v0 = data[2, low] * T
        v1 = data[2, high] * T
        a0 = data[3, low] * T * T
        a1 = data[3, high] * T * T
        # what is missing at the end, in position, velocity and acceleration, without c3, c4 and c5
        dr_end = data[1, high] - data[1, low] - v0 - 0.5 * a0
        dv_end = v1 - v0 - a0
        da_end = a1 - a0
        c3 = 10.0 * dr_end - 4.0 * dv_end + 0.5 * da_end
        c4 = -15.0 * dr_end + 7.0 * dv_end - da_end
        c5 = 6.0 * dr_end - 3.0 * dv_end + 0.5 * da_end
        r = data[1, low] + a * (v0 + a * (0.5 * a0 + a * (c3 + a * (c4 + a * c5))))
        dr = v0 + a * (a0 + a * (3.0 * c3 + a * (4.0 * c4 + a * 5.0 * c5)))
        ddr = a0 + a * (6.0 * c3 + a * (12.0 * c4 + a * 20.0 * c5))
        return r, dr / T, ddr / (T * T)


def _floats(what: str, items: object) -> Floats:
    """Return a user's sequence of finite numbers as floats."""
    if isinstance(items, np.ndarray):
        plain = items.dtype == float and items.ndim == 1 and len(items) <= MAX_POINTS
        if plain and np.isfinite(items).all():
            return tuple(items.tolist())
        items = items.tolist()
    if not isinstance(items, Iterable) or isinstance(items, str | bytes | dict | set):
        raise ScenarioError(f"{what} are {shown(items)}: give a sequence of numbers")
    values = list(itertools.islice(items, MAX_POINTS + 1))
    if len(values) > MAX_POINTS:
        raise ScenarioError(f"{what} are more than {MAX_POINTS:,}: give fewer")
    floats = []
    for i, value in enumerate(values):
        if type(value) is float and math.isfinite(value):
            floats.append(value)
        else:
            floats.append(number(f"{what}[{i}]", value))
    return tuple(floats)


def _check(what: str, times: Sequence[float], where: Callable[[int], str]) -> None:
    """Raise ScenarioError if there are fewer than two points, or times do not increase."""
    if len(times) < 2:
        raise ScenarioError(f"{what} has {len(times)} points: give at least two")
    for i in np.flatnonzero(np.diff(times) <= 0.0)[:1] + 1:
        raise ScenarioError(
            f"{what}, {where(i)}: {times[i]:.12g} s comes after {times[i - 1]:.12g} s: give times "
            "that increase"
        )


def _columns(
    path: AnyPath, names: list[str], factors: list[float], column: str | None
) -> tuple[int, int]:
    """Return the indices of the columns of times and values, which have these names and factors to
    SI units; `column` may have its unit or leave it out.
    """
    time_column = next((names.index(name) for name in ("t", "time") if name in names), 0)
    plain_time = names[time_column] in ("t", "time")
    odd = column_units.with_unit("t", names) or column_units.with_unit("time", names)
    if odd and not plain_time:
        raise ScenarioError(
            f"time column {odd!r} of {path} has a unit that is not known: give times in s"
        )
    if column is None:
        return time_column, int(time_column == 0)
    plain = column
    if isinstance(column, str):
        (plain,), (factor,) = column_units.headings([column], str(path))
        if plain in names and factor not in (1.0, factors[names.index(plain)]):
            raise unknown(f"column of {path}", column, names)
    if not isinstance(plain, str) or plain not in names:
        raise unknown(f"column of {path}", column, names)
    return time_column, names.index(plain)


def _number(cell: str) -> float | None:
    """Return the number in a cell, which may be NaN; None for any other text."""
    try:
        return real(cell)
    except ValueError:
        return None


def _places(points: Sequence[Sequence[float]]) -> Array:
    """Return points in space, (N, 3), m."""
    if not isinstance(points, str | np.ndarray) and np.iterable(points):
        points = items_of("points", points)
    try:
        array = np.asarray(points, float)
    except (TypeError, ValueError, OverflowError):  # no numbers, or rows of unequal lengths
        array = np.asarray(math.nan)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ScenarioError(
            f"points are {shown(points)}: give positions (x, y, z) in m, one a time"
        )
    return array


def _knots(first: float, last: float) -> Array:
    """Return the times at which inverse kinematics computes the joints, s."""
    steps = (last - first) / KNOT_SPACING
    if steps > MAX_KNOTS:
        raise ScenarioError(
            f"times span {last - first:g} s: give a path of {MAX_KNOTS * KNOT_SPACING:g} s at most"
        )
    intervals = np.ceil(steps - 1e-9)
    count = max(2, int(intervals) + 1)
    return np.linspace(first, last, count)


def cartesian_path(
    plant: Plant | str,
    times: Sequence[float],
    points: Sequence[Sequence[float]],
    site: str | None = None,
    body: str | None = None,
    x0: Sequence[float] | None = None,
) -> list[Waypoints]:
    """Return a reference for each channel, under which a tip moves through points in space with
    minimum jerk.

        arm = smc.plant("panda")
        points = [(0.5, 0.0, 0.5), (0.5, 0.1, 0.5)]
        reference = smc.signals.cartesian_path(arm, [0.0, 2.0], points, site="tip")

    Inverse kinematics computes the joints' positions every 10 ms: least squares with MuJoCo's
    Jacobians, damped near singular poses. If an arm has more joints than the task needs, each
    solution is the one nearest to the one before. After a closed path of the tip, the joints may
    then be elsewhere than before.

    Args:
      plant: a plant or its name; its nominal model is used.
      times: (N,), s, increasing.
      points: (N, 3), m, in the world.
      site, body: name of the site or body whose origin is the tip; give one of the two.
      x0: positions at which the search begins, one for each channel; None: the plant's.

    Returns:
      A list of Waypoints, one for each channel, for `reference` of a Scenario.

    Raises:
      ScenarioError: an unknown plant, site or body, numbers out of range, or a point out of reach.
    """
    plant = as_plant(plant)
    if plant.free:
        raise ScenarioError(
            f"{plant.name} has joints without an actuator: a path in space needs all of them driven"
        )
    tip = _tip(site, body)
    array = _places(points)
    path = [Waypoints(times, array[:, i].tolist()) for i in range(3)]
    end = path[0].times[-1]
    knots = _knots(path[0].times[0], end)
    positions = []
    for t in knots:
        place = []
        for axis in path:
            motion = Waypoints.value(t, None, axis.data)
            place.append(motion[0])
        positions.append(place)
    if x0 is None:
        start = plant.x0
    else:
        start = tuple(number("x0", x) for x in items_of("x0", x0))
    if len(start) != plant.n:
        raise ScenarioError(f"x0 has {len(start)} values for {plant.n} channels: give {plant.n}")
    joints = solve(plant, *tip, np.array(positions), start)
    return [Waypoints(knots.tolist(), joints[:, i].tolist()) for i in range(plant.n)]


def _tip(site: str | None, body: str | None) -> tuple[str, str]:
    """Return whether the tip is a site or a body, and its name."""
    if (site is None) == (body is None):
        raise ScenarioError(
            f"site is {shown(site)} and body is {shown(body)}: give the name of one of them"
        )
    if site is not None:
        return "site", str(site)
    return "body", str(body)
