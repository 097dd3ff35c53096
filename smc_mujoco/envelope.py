"""A dense signal in few columns: its range and its mean in each window of time.

A chattering control drawn sample by sample is a solid block. Its range says how hard it switches, its mean is what the
plant feels: Utkin's equivalent control (Sliding Modes in Control and Optimization, 1992).
"""

from typing import NamedTuple

import numpy as np

from smc_mujoco.trace import Trace


class Envelope(NamedTuple):
    """Windows (t[i], t[i+1]) of a signal: low, mean and high, each (windows, n)."""

    t: np.ndarray  # middles, (windows,)
    low: np.ndarray
    mean: np.ndarray
    high: np.ndarray


def samples(trace: Trace) -> int:
    """How many leading samples of the trace are finite."""
    bad = ~np.isfinite(trace.x).all(axis=1) | ~np.isfinite(trace.v).all(axis=1)
    return int(np.argmax(bad)) if bad.any() else len(trace.t)


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
