"""A dense signal on paper: its range in few windows of time, and one line.

A chattering control drawn sample by sample is a solid block. Its range says how hard it switches, its mean is what the
plant feels: Utkin's equivalent control (Sliding Modes in Control and Optimization, 1992). The line is that mean while
the signal chatters, and the signal itself while it does not.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.trace import ARRAYS, Trace

WINDOW = 0.01, 40  # what a mean is taken over: so much of the run, at least so many samples; chosen, see `window`
STILL = 2e-3  # of the largest value: a smaller step from sample to sample is no move of a chattering signal
REVERSALS = 6  # this many in a row are chattering, if each comes within a quarter of a window from the last
POINTS = 250  # of a line: its least and largest value in each is kept


class Envelope(NamedTuple):
    """Windows (t[i], t[i+1]) of a signal: low, mean and high, each (windows, n)."""

    t: np.ndarray  # middles, (windows,)
    low: np.ndarray
    mean: np.ndarray
    high: np.ndarray


def finite(trace: Trace) -> Trace:
    """The trace up to its last finite sample. Of one that failed at once: where it started, and NaN for the rest."""
    bad = ~np.isfinite(trace.x).all(axis=1) | ~np.isfinite(trace.v).all(axis=1)
    if not bad.any():
        return trace
    count = int(np.argmax(bad))
    part = {name: getattr(trace, name)[: max(1, count)] for name in ARRAYS}
    if count == 0:
        part |= {"x": np.array([trace.scenario.x0]), "v": np.array([trace.scenario.v0])}
    return dataclasses.replace(trace, **part)


def end(traces: Sequence[Trace]) -> float:
    """When the longest run was to end, s."""
    return max(trace.scenario.samples * trace.scenario.control_period for trace in traces)


def windows(t: np.ndarray, y: np.ndarray, edges: np.ndarray) -> Envelope:
    """Range and mean of y (K+1, n), held from sample to sample, between consecutive edges (s, ascending).

    A window has the samples in it and the one held at its left edge.
    """
    start = np.clip(np.searchsorted(t, edges + 1e-9, side="right") - 1, 0, len(t) - 1)
    y, start, stop = y[: start[-1] + 1], start[:-1], np.append(start[1:-1], start[-1] + 1)
    low, total, high = (f.reduceat(y, start, axis=0) for f in (np.minimum, np.add, np.maximum))
    count = np.maximum(stop - start, 1)[:, None]
    return Envelope((edges[:-1] + edges[1:]) / 2, low, total / count, high)


def columns(t: np.ndarray, y: np.ndarray, most: int) -> Envelope:
    """Range and mean of y in at most `most` windows of equally many samples.

    The number is even, so that a control which switches at every sample has the mean that it should.
    """
    count = len(t) - 1
    if count <= most:
        return Envelope(t, y, y, y)
    edges = t[:: 2 * -(-count // (2 * most))]
    return windows(t, y, edges if edges[-1] == t[-1] else np.append(edges, t[-1]))


def window(trace: Trace) -> int:
    """How many samples a mean is taken over: a multiple of 4.

    Of a control that switches irregularly between +-1, the mean over w samples is uncertain by some 2 / w. So a window
    of a column's width on paper shows teeth that are not there; w is chosen so that they are thinner than a line.
    """
    share, least = WINDOW
    return 4 * round(max(share * trace.scenario.samples, least) / 4)


def stretches(y: np.ndarray, width: int) -> list[slice]:
    """Where y (K+1,) chatters: from the first to the last of many reversals that follow each other closely."""
    near, step = width // 4, np.diff(y)
    moves = np.flatnonzero(np.abs(step) > STILL * np.abs(y).max())
    turns = moves[1:][np.sign(step[moves[1:]]) != np.sign(step[moves[:-1]])]
    groups = np.split(turns, np.flatnonzero(np.diff(turns) > near) + 1)
    ends = [(group[0] + 1, group[-1] + 1) for group in groups if len(group) >= REVERSALS]
    return [slice(a if a > near else 0, b if b < len(y) - near else len(y)) for a, b in ends]


def smooth(y: np.ndarray, width: int) -> np.ndarray:
    """y (K+1,), replaced where it chatters by its mean over `width` samples, the nearer ones weighing more.

    It is the mean of means over half the width each: a triangle, which leaves far less of a periodic signal than one
    mean does.
    """
    line = y.astype(float)
    for part in stretches(y, width):
        line[part] = running(running(line[part], width // 2), width // 2)
    return line


def running(y: np.ndarray, width: int) -> np.ndarray:
    """Mean of y (K,) over windows of `width` samples; towards its ends they shrink about their middles, to a half."""
    total, i = np.concatenate([[0.0], np.cumsum(y)]), np.arange(len(y))
    size = np.minimum(2 * np.clip(np.minimum(i, len(y) - i), width // 4, width // 2), len(y))
    start = np.clip(i - size // 2, 0, len(y) - size)
    return (total[start + size] - total[start]) / size


def line(t: np.ndarray, y: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """A curve for y (K+1,): smoothed where it chatters, in few points that keep every extreme."""
    y, size = smooth(y, width), -(-len(t) // POINTS)
    starts = np.arange(0, len(t), size)
    padded = np.pad(y, (0, len(starts) * size - len(y)), "edge").reshape(-1, size)
    keep = np.unique([0, *starts + padded.argmin(axis=1), *starts + padded.argmax(axis=1), len(t) - 1])
    keep = keep[keep < len(t)]
    return t[keep], y[keep]
