"""Records of rigs: what their columns are, checks, and files.

A record is a mapping of columns, each an array over the samples at the rig's control period.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown

Record = dict[str, np.ndarray]  # column -> values, (K,)
MIN_SAMPLES = 50  # of a replay; chosen
STATE_SAMPLES = 15  # on each side of a sample, of the cubic that gives its velocity; chosen: 30 ms at 500 Hz
RATE_TOLERANCE = 0.02  # of a period, by which the median step of time may differ; chosen


@dataclasses.dataclass(frozen=True)
class Columns:
    """Names of a record's columns.

    Attributes:
      time: s.
      x: position of each channel, rad or m.
      v: velocity of each channel; empty if it is not recorded.
      u: command, in the unit of the rig's u.
      reference: of the driven joint; "" for none.
      feedforward: what is added to the controller's u; "" for none.
      others: further columns with angles that a replay reads.
    """

    time: str = "t"
    x: tuple[str, ...] = ("x",)
    v: tuple[str, ...] = ()
    u: str = "u"
    reference: str = ""
    feedforward: str = ""
    others: tuple[str, ...] = ()

    @property
    def needed(self) -> tuple[str, ...]:
        """Columns that every record must have."""
        return tuple(name for name in (self.time, *self.x, self.u, self.reference) if name)

    @property
    def angles(self) -> tuple[str, ...]:
        """Columns that may be in degrees."""
        return tuple(name for name in (*self.x, *self.v, self.reference, *self.others) if name)

    @property
    def known(self) -> tuple[str, ...]:
        """All columns that a replay may read."""
        return tuple(dict.fromkeys(name for name in (*self.needed, *self.v, self.feedforward, *self.others) if name))


def checked(record: Mapping[str, Any], columns: Columns, period: float, rig: str) -> Record:
    """Return the record's known columns as float arrays.

    Raises:
      ScenarioError: a missing column, values that are not finite numbers, columns of different lengths, time that runs
        backward, or another sampling rate than the rig's.
    """
    if not isinstance(record, Mapping):
        raise ScenarioError(f"record is {shown(record)}: give a mapping of columns, such as numpy.load(file)")
    missing = [name for name in columns.needed if name not in record]
    if missing:
        has = ", ".join(map(str, record)) or "none"
        raise ScenarioError(f"the record of {rig} has no column {', '.join(missing)} (it has {has}): add it")
    data = {name: _numbers(name, record[name], rig) for name in columns.known if name in record}
    t = data[columns.time]
    for name, values in data.items():
        if len(values) != len(t):
            raise ScenarioError(
                f"column {name} of {rig} has {len(values)} samples and {columns.time} has {len(t)}: "
                "give as many of each"
            )
    if len(t) < 2:
        raise ScenarioError(f"the record of {rig} has {len(t)} samples: give at least two")
    back = np.flatnonzero(np.diff(t) <= 0.0)
    if len(back):
        raise ScenarioError(
            f"time of {rig} runs backward at sample {back[0] + 1}, from {t[back[0]]:.6g} s to {t[back[0] + 1]:.6g} s: "
            "give times that increase"
        )
    step = float(np.median(np.diff(t)))
    if abs(step - period) > RATE_TOLERANCE * period:
        raise ScenarioError(
            f"the record of {rig} is sampled every {step:.4g} s and the rig's controller runs every {period:g} s: "
            "resample it, or record every command"
        )
    gaps = np.flatnonzero(np.diff(t) > 1.5 * period)
    if len(gaps):
        raise ScenarioError(
            f"the record of {rig} has a gap after sample {gaps[0]}, from {t[gaps[0]]:.6g} s to {t[gaps[0] + 1]:.6g} s: "
            "fill it in, or cut the record there"
        )
    return data


def _numbers(name: str, values: Any, rig: str) -> np.ndarray:
    """Return a column as finite floats, (K,)."""
    try:
        found = np.asarray(values, float)
    except (TypeError, ValueError):
        raise ScenarioError(f"column {name} of {rig} is {shown(values)}: give numbers") from None
    if found.ndim != 1:
        raise ScenarioError(f"column {name} of {rig} has the shape {found.shape}: give one number a sample")
    wrong = np.flatnonzero(~np.isfinite(found))
    if len(wrong):
        raise ScenarioError(
            f"column {name} of {rig} is {found[wrong[0]]} at sample {wrong[0]}, one of {len(wrong)} that are not "
            "finite: fill them in, or cut the record there"
        )
    return found


def state(data: Record, columns: Columns, period: float, at: int) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities at a sample, (n,) each, by a cubic through the samples about it."""
    first = max(0, at - STATE_SAMPLES)
    last = min(len(data[columns.time]), at + STATE_SAMPLES + 1)
    times = period * (np.arange(first, last) - at)
    cubics = [np.polyfit(times, data[name][first:last], 3) for name in columns.x]
    return np.array([cubic[3] for cubic in cubics]), np.array([cubic[2] for cubic in cubics])


def in_radians(record: Mapping[str, Any], columns: Columns) -> Record:
    """Return the record with its angles taken for degrees, and converted."""
    angles = {name: np.deg2rad(np.asarray(record[name], float)) for name in columns.angles if name in record}
    return {name: np.asarray(record[name]) for name in columns.known if name in record} | angles


def percent(fit: Mapping[str, float]) -> str:
    """Return a fit in words: "96 / 94 / 85 %"."""
    return " / ".join(f"{value:.0f}" for value in fit.values()) + " %"
