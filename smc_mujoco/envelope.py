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


def columns(t: np.ndarray, y: np.ndarray, count: int) -> Envelope:
    """Range and mean of y in `count` equal windows, or one a sample where there are fewer samples."""
    count = min(count, len(t) - 1)
    if count < 1:
        return Envelope(t, y, y, y)
    return windows(t, y, np.linspace(t[0], t[-1], count + 1))
