"""Reduction of a dense signal for drawing: to its range in few windows of time, and to one line.

A chattering control drawn sample by sample is a solid block. Its range shows how hard it switches.
Its mean acts on the plant: Utkin's equivalent control (Sliding Modes in Control and Optimization,
1992). The line is this mean while the signal chatters, and the signal itself elsewhere.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.simulation.trace import Trace

# Numbers of presentation here are chosen.
MEAN_SHARE = 0.01  # of the run, over which a mean is taken, see `window`
MIN_MEAN = 40  # samples of it at least
MIN_MOVE = 2e-3  # of the largest value: smaller steps between samples do not count as moves
MIN_REVERSALS = 6  # in a row are chattering, if each follows within a quarter of a window
COLUMNS = 360  # of pixels of a panel: traces of more samples are drawn as means and ranges
MAX_GAP = 0.02  # s: shorter gaps between parts that switch are closed, or they look like a fence
LINE_PARTS = 250  # of a line, of which each keeps its smallest and its largest value


class Envelope(NamedTuple):
    """Range and mean of a signal in windows of time: low, mean and high, each (windows, n)."""

    t: Array  # middles, (windows,)
    low: Array
    mean: Array
    high: Array


def arrays_within(trace: Trace, part: slice) -> dict[str, Array]:
    """Return name -> array of a part of a trace's samples."""
    return {name: array[part] for name, array in trace.arrays().items()}


def finite(trace: Trace) -> Trace:
    """Return the trace up to its last finite sample; if there is none, one sample with the initial
    state.
    """
    lost_x = ~np.isfinite(trace.x).all(axis=1)
    lost_v = ~np.isfinite(trace.v).all(axis=1)
    bad = lost_x | lost_v
    if not bad.any():
        return trace
    count = int(np.argmax(bad))
    part = arrays_within(trace, slice(max(1, count)))
    if count == 0:
        part |= {
            "x": np.array([trace.scenario.resolved.x0]),
            "v": np.array([trace.scenario.resolved.v0]),
        }
    return dataclasses.replace(trace, **part)


def end(traces: Sequence[Trace]) -> float:
    """Return the longest duration of the runs, s."""
    return max(trace.scenario.samples * trace.scenario.control_period for trace in traces)


def windows(t: Array, y: Array, edges: Array) -> Envelope:
    """Return range and mean of y (K+1, n), held from sample to sample, between consecutive edges
    (s, ascending).

    A window has the samples in it and the one held at its left edge.
    """
    places = np.searchsorted(t, edges + 1e-9, side="right") - 1
    start = np.clip(places, 0, len(t) - 1)
    y = y[: start[-1] + 1]
    ends = [*start[:-1], start[-1] + 1]
    counts = np.maximum(np.diff(ends), 1)
    count = counts[:, None]
    low = np.minimum.reduceat(y, start[:-1])
    totals = np.add.reduceat(y, start[:-1])
    mean = totals / count
    middle = (edges[:-1] + edges[1:]) / 2
    high = np.maximum.reduceat(y, start[:-1])
    return Envelope(middle, low, mean, high)


def band(t: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return times with the least and largest y (K+1, n) about them, without gaps up to MAX_GAP
    between swings, and without such a gap before the end.

    There are at most COLUMNS windows, of equally many samples each but for the last; each sample of
    a short y is one.
    """
    from scipy.ndimage import grey_closing, grey_opening

    count = len(t) - 1
    times = t
    low = high = y
    if count > COLUMNS:
        edges = t[:: 2 * -(-count // (2 * COLUMNS))].copy()
        edges[-1] = t[-1]
        e = windows(t, y, edges)
        times = e.t
        low = e.low
        high = e.high
    size = int(np.searchsorted(times - times[0], MAX_GAP, side="right"))
    # of each channel by itself: where channels cross, all of them are close, and that is no gap
    after = ((0, size), (0, 0))
    lower = np.pad(low, after, "minimum", stat_length=size)
    upper = np.pad(high, after, "maximum", stat_length=size)
    lower = grey_opening(lower, (size, 1), mode="nearest")
    upper = grey_closing(upper, (size, 1), mode="nearest")
    return times, lower[: len(times)].min(axis=1), upper[: len(times)].max(axis=1)


def window(trace: Trace) -> int:
    """Return the number of samples that a mean is taken over: a multiple of 4.

    If a control switches irregularly between +-1, its mean over w samples varies by about 2 / w,
    which makes the line jagged. The window is so wide that this is less than the width of the line.
    """
    share = MEAN_SHARE * trace.scenario.samples
    return 4 * round(max(share, MIN_MEAN) / 4)


def chattering_parts(y: Array, width: int) -> list[slice]:
    """Return where y (K+1,) chatters.

    A move is a step between samples of more than MIN_MOVE of the largest |y|. A reversal is a pair
    of successive moves with opposite signs. Reversals are n-close if neither the time between a
    reversal's moves nor the time to the next reversal is longer than n samples. y chatters where
    MIN_REVERSALS or more in a row are (width / 4)-close.

    A part goes from the first move to the last of the width-close reversals around these. It
    extends to the end of y if that is as close. It extends to the start only if that is within a
    quarter of `width`, because a y that rests there longer does not chatter yet.
    """
    near = width // 4
    first, last = reversals(y)
    seeds = []
    for part in close_reversals(first, last, near):
        if len(part) >= MIN_REVERSALS:
            seeds.append(first[part[0]] + 1)
    result = []
    for part in close_reversals(first, last, width):
        start = first[part[0]] + 1
        stop = last[part[-1]] + 1
        if not any(start <= seed <= stop for seed in seeds):
            continue
        if start <= near:
            start = 0
        if stop >= len(y) - width:
            stop = len(y)
        result.append(slice(start, stop))
    return result


def reversals(y: Array) -> tuple[Array, Array]:
    """Return the indices of the two moves of each reversal of y (K+1,)."""
    step = np.diff(y)
    least = MIN_MOVE * np.abs(y).max()
    moving = np.flatnonzero(np.abs(step) > least)
    ways = np.sign(step[moving])
    turns = np.flatnonzero(np.diff(ways))
    return moving[turns], moving[turns + 1]


def close_reversals(first: Array, last: Array, near: int) -> list[Array]:
    """Return the indices of the reversals in each row of `near`-close ones."""
    brief = np.flatnonzero(last - first <= near)
    pauses = first[brief[1:]] - last[brief[:-1]]
    gaps = np.flatnonzero(pauses > near)
    parts = np.split(brief, gaps + 1)
    return list(filter(len, parts))


def smooth(y: Array, width: int) -> Array:
    """Return y (K+1,), replaced where it chatters by its mean over `width` samples with triangular
    weights.

    The weights result from averaging twice over half the width, which suppresses a periodic signal
    far better than one average. Within half a width of the ends of a part the value is that of the
    nearest whole triangle. Where that leaves the range of y within a quarter of the width, y moves
    rather than chatters: there it is that of the longest triangle about the sample. In a part
    shorter than the width the triangle is as long as the part.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    line = y.astype(float)
    around = 2 * (width // 4) + 1
    low = minimum_filter1d(line, around, mode="nearest")
    high = maximum_filter1d(line, around, mode="nearest")
    for part in chattering_parts(y, width):
        middle = (part.stop - part.start + 1) // 2
        half = min(width // 2, middle)
        smoothed = triangular_mean(line[part], half)
        means = np.pad(smoothed, half - 1, "edge")
        off = (means < low[part]) | (means > high[part])
        from_start = line[part], means, off
        from_end = [values_forward[::-1] for values_forward in from_start]
        for values, mean, leaves in (from_start, from_end):
            if not leaves[: half - 1].any():
                continue
            for k in range(1, half):
                mean[k - 1] = triangular_mean(values[: 2 * k - 1], k)[0]
        line[part] = means
    return line


def triangular_mean(y: Array, half: int) -> Array:
    """Return the means of y (K,) with the weights 1, 2, ... half, ... 2, 1, (K - 2 half + 2,)."""
    return running_mean(running_mean(y, half), half)


def running_mean(y: Array, width: int) -> Array:
    """Return the mean of y (K,) over each `width` samples in a row, (K - width + 1,)."""
    total = np.concatenate([[0.0], np.cumsum(y)])
    return (total[width:] - total[:-width]) / width


def line(t: Array, y: Array, width: int) -> tuple[Array, Array]:
    """Return times and values of a curve for y (K+1,): smoothed where it chatters, but within its
    `band`, in few points that keep extremes.
    """
    smoothed = smooth(y, width)
    band_times, low, high = band(t, y[:, None])
    within = np.clip(smoothed, np.interp(t, band_times, low), np.interp(t, band_times, high))
    y = np.where(smoothed == y, y, within)
    size = -(-len(t) // LINE_PARTS)
    starts = np.arange(0, len(t), size)
    missing = len(starts) * size - len(y)
    lengthened = np.pad(y, (0, missing), "edge")
    padded = lengthened.reshape(-1, size)
    lowest = starts + padded.argmin(axis=1)
    highest = starts + padded.argmax(axis=1)
    keep = np.unique([0, *lowest, *highest, len(t) - 1])
    keep = keep[keep < len(t)]
    return t[keep], y[keep]
