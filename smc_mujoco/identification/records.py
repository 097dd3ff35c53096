"""Records of rigs: their columns, checks and files.

A record is a mapping from names of columns to arrays, with one value for each control period of the
rig.
"""

import dataclasses
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.common import column_units
from smc_mujoco.common.aliases import AnyPath, Array, ArrayPair, Data, Floats, Names
from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.files import csv_rows, reading
from smc_mujoco.common.text import real
from smc_mujoco.simulation import trace as traces
from smc_mujoco.simulation.python_functions import evaluate
from smc_mujoco.simulation.readings import readings
from smc_mujoco.simulation.trace import Trace

Record = dict[str, np.ndarray]  # column -> values, (K,)
# of the largest other step, and rad, by which a jump of an encoder that wraps differs from a turn
OF_A_STEP, WRAPS_BY = 2.0, 0.1  # chosen
MIN_SAMPLES = 50  # of a replay; chosen
# on each side of a sample, for the cubic that gives its velocity; chosen: 30 ms at 500 Hz
STATE_SAMPLES = 15
RATE_TOLERANCE = 0.02  # of a period, by which the median step of time may differ from it; chosen
# s, between samples: beyond it the time is in another unit, or the motion is missed; chosen
MAX_PERIOD = 0.2
# periods: a longer gap in an open-loop record is refused, shorter ones are interpolated; chosen
MAX_GAP = 10
MAX_GAP_CLOSED = 1.5  # periods: the same for a closed loop, of which no sample may be missing
NORMAL_MEDIAN = 0.6745  # median of |z| for a standard normal z
UNITS_READ = "s, ms, rad, deg, m, mm, N m, N, V and their like"
ROUNDING = 1e-9  # of the largest value: a smaller difference of two is rounding; chosen
RESOLUTION = 1e-6  # s, to which the period of an open-loop record is rounded


@dataclasses.dataclass(frozen=True)
class Columns:
    """Names of a record's columns."""

    time: str = "t"  # s
    # position of each channel, rad or m; or of each joint that has a torque
    x: Names = ("x",)
    u: str = "u"  # command, in the unit of the rig's u
    inputs: Names = ()  # commands of all motors of a machine with several; empty: u alone
    reference: str = "reference"  # of the driven joint, if the loop is closed
    feedforward: str = "feedforward"  # what is added to the controller's u; records may lack it
    other_references: Names = ()  # of the joints that are not driven; records may lack them
    # positions, then velocities, without noise and offset; only simulated runs have them
    state: Names = ()
    # what is subtracted from each channel's column to get the plant's x; empty for 0
    offset: Floats = ()
    # of each joint, for records whose torques are predicted from the motion
    torque: Names = ()

    def needed(self, closed: bool) -> Names:
        """Return the columns that a record must have; for a closed loop also the reference."""
        command = self.torque or self.inputs or (self.u,)
        if closed and not self.torque:
            command = self.u, self.reference
        return self.time, *self.x, *command

    @property
    def readable(self) -> Names:
        """All columns that a replay may read."""
        more = *self.inputs, self.reference, *self.other_references, self.feedforward, *self.state
        return tuple(dict.fromkeys((*self.needed(True), *more)))


def load_record(path: AnyPath, columns: Mapping[str, str] | None = None) -> Record | Trace:
    """Return the columns of a CSV or npz file, or a saved trace.

    `columns`: the rig's name of a column -> the file's.
    """
    cure = "give the path of a CSV file, or of an npz file with arrays by column"
    data = {}
    with reading(path, "record", cure) as file:
        if file.suffix == ".npz":
            with file.open("rb") as opened, np.load(opened) as arrays:
                data = dict(arrays)
    if "about" in data:
        return traces.load(file)
    if data:
        data = _in_si([*data], [*data.values()], str(path))
    return renamed(data or _csv(file), columns, str(path))


def renamed(data: Data, columns: Mapping[str, str] | None, what: str) -> Record:
    """Return columns with those of `columns`, ours -> theirs, under our names, too."""
    if columns is None:
        return dict(data)
    if not isinstance(columns, Mapping):
        raise ScenarioError(
            f"columns are {shown(columns)}: give our names with the log's, as {{'t': 'time'}}"
        )
    columns_by_name = dict(data)
    for ours, theirs in columns.items():
        columns_by_name[ours] = find(f"column of {what}", theirs, data)
    return columns_by_name


def as_columns(record: Any, columns: Mapping[str, str] | None = None) -> Any:
    """Return a record that a user gives as its columns, or as a trace: the path of a file, a trace,
    a data frame, or columns by name.
    """
    if isinstance(record, str | os.PathLike):
        return load_record(record, columns)
    if hasattr(record, "to_dict") and hasattr(record, "columns"):  # a data frame
        frame = record
        values = []
        for k in range(len(frame.columns)):
            values.append(np.asarray(frame.iloc[:, k] if hasattr(frame, "iloc") else frame[:, k]))
        return renamed(_in_si(frame.columns, values, "the data frame"), columns, "the record")
    if isinstance(record, Mapping):
        return renamed(_in_si([*record], [*record.values()], "the log"), columns, "the record")
    return record


def _in_si(heads: Sequence[object], values: Sequence[Any], what: str) -> Record:
    """Return columns by their names without units, those of other known units converted."""
    names, factors = column_units.headings(list(map(str, heads)), what)
    columns = {}
    for name, factor, column in zip(names, factors, values, strict=True):
        columns[name] = column if factor == 1.0 else factor * np.asarray(column)
    return columns


def _csv(file: Path) -> Record:
    """Return the columns of a CSV file. A cell that is empty, or not a number, is NaN."""
    rows = [row for _, row in csv_rows(file)]
    numbers = bool(rows) and not np.isnan(list(map(_cell, rows[0]))).any()
    if len(rows) < 2 or numbers:
        lines = "numbers in its first line" if numbers else f"{len(rows)} lines"
        raise ScenarioError(
            f"{file} has {lines}: give a first line with the columns' names, and samples"
        )
    heads, factors = column_units.headings(rows[0], str(file))
    values = []
    for number, row in enumerate(rows, 1):
        if len(row) != len(heads):
            raise ScenarioError(
                f"{file}, line {number}: {len(row)} cells for {len(heads)} columns: "
                "give one for each"
            )
        values.append(list(map(_cell, row)))
    return dict(zip(heads, (np.array(values[1:]) * factors).T, strict=True))


def _cell(text: str) -> float:
    try:
        return real(text)
    except ValueError:
        return math.nan


def wraps(x: Array) -> Array:
    """Return the samples at which the reading of a hinge jumps by a turn, as that of an encoder
    that wraps; none of them where it jumps otherwise, too.
    """
    steps = np.abs(np.diff(x))
    jumps = steps > math.pi
    allowed = OF_A_STEP * steps[~jumps].max(initial=0.0) + WRAPS_BY
    turns = np.abs(steps[jumps] - 2.0 * math.pi) < allowed
    return np.flatnonzero(jumps) + 1 if turns.all() else np.zeros(0, int)


def positions(trace: Trace, columns: Columns, noisy: bool = False) -> Record:
    """Return a run's positions by column, as encoders read them, see `readings`."""
    return dict(zip(columns.x, readings(trace, noisy).T, strict=False))


def of_trace(trace: Trace, columns: Columns) -> Record:
    """Return a run as a record with a rig's columns."""
    feedforward = trace.scenario.feedforward_signal
    added = np.zeros(len(trace.t))
    if feedforward is not None:
        added[:] = [evaluate(feedforward, t)[0] for t in trace.t]
    record = {
        columns.time: trace.t,
        columns.u: trace.u[:, 0],
        columns.reference: trace.r[:, 0],
    }
    record |= positions(trace, columns, noisy=True)
    for name, zero in zip(columns.x, columns.offset, strict=False):
        record[name] = record[name] + zero
    states = np.column_stack([trace.x, trace.v])
    record |= dict(zip(columns.state, states.T, strict=False))
    return record | {columns.feedforward: added}


def checked(record: Data, columns: Columns, period: float | None, rig: str) -> Record:
    """Return the record's readable columns as float arrays, (K,) each. `rig`: its name, for errors.

    `period`: s, of the rig's controller, at which a closed loop must be recorded. None for an open
    loop, whose columns are interpolated at the record's own median step.
    """
    if not isinstance(record, Mapping):
        raise ScenarioError(
            f"record is {shown(record)}: give a mapping of columns, such as numpy.load(file)"
        )
    _check_columns(record, columns.needed(period is not None), rig)
    data = {}
    for name in columns.readable:
        if name in record:
            data[name] = _numbers(name, record[name], rig)
    t = data[columns.time]
    for name, values in data.items():
        if len(values) != len(t):
            raise ScenarioError(
                f"column {name} of {rig} has {len(values)} samples and {columns.time} has "
                f"{len(t)}: give as many of each"
            )
    step = _checked_step(t, period, rig)
    if period is None:
        last = int((t[-1] - t[0]) / step + 1e-6)
        even = t[0] + step * np.arange(last + 1)
        for name, values in data.items():
            data[name] = np.interp(even, t, values)
    for name, offset in zip(columns.x, columns.offset, strict=False):
        data[name] = data[name] - offset
    return data


def _check_columns(record: Data, needed: Names, rig: str) -> None:
    """Raise ScenarioError for a column that a record lacks, or has in a unit that is not known."""
    missing = []
    for name in needed:
        if name not in record:
            missing.append(name)
    if missing:
        if column := column_units.with_unit(missing[0], list(map(str, record))):
            cure = ""
            if missing[0].startswith("u"):
                cure = (
                    f", or name it by --columns '{missing[0]}={column}' (in Python columns="
                    f"{{{missing[0]!r}: {column!r}}}) and find the joint's gain, JOINT.gain"
                )
            raise ScenarioError(
                f"column {column!r} of {rig} has a unit that is none of {UNITS_READ}: give "
                f"{missing[0]} in such a unit{cure}"
            )
        raise ScenarioError(
            f"the record of {rig} has no column {', '.join(missing)} "
            f"(it has {', '.join(map(str, record)) or 'none'}): add it, or say which it is, as "
            f"--columns {missing[0]}=NAME (in Python columns={{{missing[0]!r}: 'NAME'}})"
        )


def _checked_step(t: Array, period: float | None, rig: str) -> float:
    """Return the median step of a record's times, s. Refuse times that a replay cannot use."""
    if len(t) < 2:
        raise ScenarioError(f"the record of {rig} has {len(t)} samples: give at least two")

    def at(sample: int) -> str:
        return f"{sample}, from {t[sample]:.6g} s to {t[sample + 1]:.6g} s"

    step = step_of(t)
    gaps = np.diff(t)
    if gaps.min() <= 0.0:
        raise ScenarioError(
            f"time of {rig} runs backward after sample {at(int(np.argmax(gaps <= 0.0)))}: "
            "give times that increase"
        )
    if step > MAX_PERIOD:
        raise ScenarioError(
            f"the record of {rig} is sampled every {step:g} s and lasts {t[-1] - t[0]:g} s: "
            "give time in s (a column in ms divided by 1000), with a sample every "
            f"{MAX_PERIOD:g} s or more often"
        )
    if period is not None and abs(step - period) > RATE_TOLERANCE * period:
        raise ScenarioError(
            f"the record of {rig} is sampled every {step:.4g} s and the rig's controller runs "
            f"every {period:g} s: resample it, or record every command"
        )
    longest = step * (MAX_GAP if period is None else MAX_GAP_CLOSED)
    if gaps.max() > longest:
        raise ScenarioError(
            f"the record of {rig} has a gap after sample {at(int(np.argmax(gaps > longest)))}: "
            "fill it in, or cut it there"
        )
    return step


def step_of(t: Array) -> float:
    """Return the median step of times, s."""
    return max(RESOLUTION, round(float(np.median(np.diff(t))) / RESOLUTION) * RESOLUTION)


def noise(data: Record, columns: Columns) -> float:
    """Return the standard deviation of the white noise of the positions, rad or m: the least of all
    columns.
    """
    return min(white_noise(data[name]) for name in columns.x)


def white_noise(values: Array) -> float:
    """Return the standard deviation of the white noise of a column.

    It follows from the fourth differences, which are near 0 for a smooth motion, and have the
    standard deviation sqrt(70) sigma for white noise of sigma. Their median ignores short
    transients.
    """
    median = float(np.median(np.abs(np.diff(values, 4))))
    return median / (NORMAL_MEDIAN * math.sqrt(70.0))


def sensor_step(values: Array) -> float:
    """Return the step of the sensor that gave a column: the least difference of two values that is
    more than rounding; 0 for a constant one.
    """
    gaps = np.diff(np.unique(values))
    rounding = ROUNDING * float(np.abs(values).max(initial=0.0))
    steps = gaps[gaps > rounding]
    return float(steps.min()) if len(steps) else 0.0


def _numbers(name: str, values: Any, rig: str) -> Array:
    """Return a column as finite floats, (K,)."""
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError, OverflowError):
        array = None
    if array is None or array.ndim != 1:
        raise ScenarioError(f"column {name} of {rig} is {shown(values)}: give one number a sample")
    wrong = np.flatnonzero(~np.isfinite(array))
    if len(wrong):
        raise ScenarioError(
            f"column {name} of {rig} is {array[wrong[0]]} at sample {wrong[0]}, one of "
            f"{len(wrong)} that are not finite: fill them in, or cut the record there"
        )
    return array


def stacked(data: Record, names: Sequence[str]) -> Array:
    """Return some columns side by side, (K, names)."""
    return np.column_stack([data[name] for name in names])


def state(data: Record, columns: Columns, period: float, at: int) -> ArrayPair:
    """Return positions and velocities at a sample, (n,) each.

    They come from the columns `state`; if there are none, from a cubic through the samples about
    it.
    """
    if columns.state:
        measured = np.array([data[name][at] for name in columns.state])
        return measured[: len(columns.x)], measured[len(columns.x) :]
    first = max(0, at - STATE_SAMPLES)
    last = min(len(data[columns.time]), at + STATE_SAMPLES + 1)
    times = period * (np.arange(first, last) - at)
    x = []
    v = []
    for name in columns.x:
        _, _, slope, value = np.polyfit(times, data[name][first:last], 3)
        x.append(value if at else data[name][0])
        v.append(slope)
    return np.array(x), np.array(v)


def rate(values: Array, period: float, order: int = 1) -> Array:
    """Return a derivative of columns, (..., K), from a cubic about each sample.

    Order 0 is the cubic itself.
    """
    from scipy.signal import savgol_filter

    return np.asarray(savgol_filter(values, 2 * STATE_SAMPLES + 1, 3, deriv=order, delta=period))
