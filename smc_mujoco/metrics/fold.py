"""Metrics that take one sample after the other: each is one row, a `Fold`, beside its name.

Two read a row: `Fold.of` with numpy, over a trace, and the fast engine, which folds while it runs
(see `analysis/engine/scores.py`). Metrics that need a second pass or the whole series stay
functions of a trace, in the catalogue.
"""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Array

LAST_PART = 0.2  # of the run's duration
ROUNDING = 1e-9  # of the duration: a sample that is so little before the last part belongs to it
TRANSIENT_SHARE = 0.25  # of the run, which an "early" part leaves out
# of the run's duration: the last part and as much before it, where a load is periodic; chosen
TWO_PARTS = 0.85
# s, chosen: friction's change of sign is over by then in loops of 5 Hz and more
AFTER_TURN = 0.15


class Fold(NamedTuple):
    """A metric as a row: what is taken of each sample, and how samples are put together."""

    # a column of a trace, or one that `conventions.signal` makes of some: "e", "rest" (e over the
    # scale), "turned", "slips"
    signal: str
    # of the worst channel: "largest", "range", "sum", "mean"; summed over the channels: "integral"
    # by the trapezoid rule, "held" of a signal that is held between samples
    reduction: Literal["largest", "range", "sum", "mean", "integral", "held"]
    # of the signal's magnitude; of a mean 2 with its root; 0 takes the signal with its sign
    power: int = 1
    part: Literal["", "early", "late"] = ""  # all samples; all but the transient; the last part
    change: bool = False  # whether it is of the change from the sample before
    timed: bool = False  # whether it is weighted by the time since the start
    rate: bool = False  # whether it is over the time of its part

    def of(self, t: Array, signal: Array, first: int | None = None) -> float:
        """Return the value for times t, (K + 1,), and a signal, (K + 1, n), whose part begins with
        sample `first`; default: that of `first_sample`.
        """
        if self.reduction not in ("integral", "held"):
            return self.channels(t, signal, first).max()
        t, y = self._taken(t, signal, first)
        total = y.sum(axis=1)
        if self.timed:
            total = (t - t[0]) * total
        return np.trapezoid(total, t) if self.reduction == "integral" else total[:-1] @ np.diff(t)

    def channels(self, t: Array, signal: Array, first: int | None = None) -> Array:
        """Return the value of each channel, (n,), of a fold of the worst channel."""
        t, y = self._taken(t, signal, first)
        if self.reduction == "largest":
            return y.max(axis=0, initial=0.0)
        if self.reduction == "range":
            return np.ptp(y, axis=0)
        if self.reduction == "mean":
            mean = y.mean(axis=0)
            return np.sqrt(mean) if self.power == 2 else np.abs(mean)
        total = y.sum(axis=0)
        return total / ((t[-1] - t[0]) or np.inf) if self.rate else total

    def _taken(self, t: Array, signal: Array, first: int | None) -> tuple[Array, Array]:
        """Return the times of the part, and what is taken of each sample in it."""
        if first is None:
            first = first_sample(self.part, t)
        y = signal[first:]
        if self.change:
            y = np.diff(y, axis=0)
        if self.power:
            y = np.abs(y) ** self.power
        return t[first:], y


def slipped(before: Any, now: Any) -> Any:
    """Return whether friction let a joint go, which it held for these times, s, before and now.
    Arrays, or numbers.
    """
    return (before > 0.0) & (now == 0.0)


def after_turn(passed: Any) -> Any:
    """Return whether a turn of the reference, which has passed by so many seconds, still counts.
    Arrays, or numbers.
    """
    return passed <= AFTER_TURN * (1 + 1e-9)


def late_periods(duration: float, period: float) -> int:
    """Return how many whole periods of a load are the last part of a run, s; 0 if the load has no
    period, or if two such parts are longer than TWO_PARTS of the run.
    """
    if not 0.0 < period < duration:
        return 0
    count = math.ceil(LAST_PART * (1.0 - ROUNDING) * duration / period)
    return count if 2.0 * count * period <= TWO_PARTS * duration else 0


def judges_last_part(duration: float, period: float) -> bool:
    """Return whether the last part of a run, s, says how it goes on: a piece of a period does not.

    The load has a period, s, or 0 for none.
    """
    return period == 0.0 or late_periods(duration, period) > 0


def first_sample(part: str, t: Array, late: float = 0.0) -> int:
    """Return the index of the first sample of a part of a run with these times, (K + 1,), whose
    last part has a length `late`, s; 0 for LAST_PART of the run.
    """
    if not part:
        return 0
    start, end = t[[0, -1]]
    if part == "late":
        length = LAST_PART * (end - start)
        if 0.0 < late < end - start:
            length = late
        since = end - length - LAST_PART * ROUNDING * (end - start)
    else:
        since = start + TRANSIENT_SHARE * (1.0 - ROUNDING) * (end - start)
    return int(np.searchsorted(t, since))
