"""Quantities of traces that panels show, by name, and the vertical range that suits each of them
over several runs.
"""

from collections.abc import Callable, Sequence

import numpy as np

from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.draw.decimate import window
from smc_mujoco.metrics.tip import contacts, tip_error
from smc_mujoco.simulation.trace import Trace

# of |reaction|, or of what an arrow shows: values above it are short peaks; chosen
LASTING_QUANTILE = 0.98
MIN_ERROR = 1e-9  # smaller errors are drawn at it; chosen
MIN_RATIO = 4.0  # least ratio of a logarithmic axis, without its margin; chosen
PEAKS = ("settling", "tip")  # drawn as `peaks`, on a logarithmic axis
ERRORS = ("e", "distance", "tip distance")  # whose axis has their zero
# of a run whose plant diverged: its first part sets a panel's range if no run lasts; chosen
UNDIVERGED_SHARE = 0.8
MARGIN = 0.08  # of a panel's height, above and below its curves
# of the largest value: a quantity that varies less is drawn as a constant, without its round-off
MIN_VARIATION = 1e-3


def off_path(trace: Trace) -> Array:
    """Return how far an arm's tip is off its path, (K+1, 1) mm."""
    return peaks(1e3 * tip_error(trace), trace)


def contact_force(trace: Trace) -> Array:
    """Return the force of a contact of an arm's tip, (K+1, 1) N."""
    return contacts(trace).force[:, None]


def share_of_limit(trace: Trace) -> Array:
    """Return the largest |u| of a joint, as a share of its limit, (K+1, 1) %."""
    shares = np.abs(trace.applied) / trace.scenario.limits
    return 100.0 * shares.max(axis=1, keepdims=True)


def error_rate(trace: Trace) -> Array:
    """Return v - r', (K+1, n). Of the slopes of r before and after a sample the smaller counts, so
    that a step of r, which has none, is no peak.
    """
    slopes = np.diff(trace.r, axis=0) / np.diff(trace.t)[:, None]
    before = np.concatenate([slopes[:1], slopes])
    after = np.concatenate([slopes, slopes[-1:]])
    return trace.v - np.where(np.abs(before) < np.abs(after), before, after)


QUANTITIES: dict[str, Callable[[Trace], Array]] = {  # name -> (K+1, n)
    "x": lambda trace: trace.x,
    "e": lambda trace: trace.x - trace.r,
    "v": lambda trace: trace.v,
    "de": error_rate,
    "u": lambda trace: trace.u,
    "applied": lambda trace: trace.applied,
    "d": lambda trace: trace.d,
    "s": lambda trace: trace.s,
    "force": lambda trace: trace.force,
    "reaction": lambda trace: trace.reaction,
    "spread": lambda trace: np.ptp(trace.x, axis=1, keepdims=True),
    "tip": off_path,
    "contact": contact_force,
    "load": share_of_limit,
    "settling": lambda trace: peaks(np.abs(trace.x - trace.r).max(axis=1), trace),
    "distance": lambda trace: np.abs(trace.x - trace.r).max(axis=1, keepdims=True),
    "tip distance": lambda trace: 1e3 * tip_error(trace)[:, None],
    "largest": lambda trace: np.abs(trace.u).max(axis=1, keepdims=True),
}


def peaks(y: Array, trace: Trace) -> Array:
    """Return the largest of y (K+1,) within a window before each sample, the first window as a
    whole, (K+1, 1), or MIN_ERROR if that is more.
    """
    from scipy.ndimage import maximum_filter1d

    width = window(trace)
    origin = (width - 1) // 2
    largest = maximum_filter1d(y, width, mode="nearest", origin=origin)
    largest[:width] = y[:width].max()
    return np.maximum(largest, MIN_ERROR)[:, None]


def peak_window(traces: Sequence[Trace]) -> float:
    """Return the longest time over which `peaks` are taken, s."""
    return max(window(trace) * trace.scenario.control_period for trace in traces)


def lasting(traces: Sequence[Trace], name: str) -> list[Array]:
    """Return the values of successful runs; if there are none, of failed ones without their
    ends.
    """
    values = []
    for trace in traces:
        if trace.diverged_at is None:
            values.append(QUANTITIES[name](trace))
    if not values:
        for trace in traces:
            y = QUANTITIES[name](trace)
            share = UNDIVERGED_SHARE if trace.plant_diverged else 1.0
            count = max(1, int(share * len(y)))
            values.append(y[:count])
    lasts = []
    for y in values:
        if np.isfinite(y).all():
            lasts.append(y)
    return lasts


def span(traces: Sequence[Trace], name: str) -> Pair:
    """Return the least and largest value of the runs that last."""
    parts = list(map(np.ravel, lasting(traces, name)))
    values = np.concatenate(parts or [np.zeros(1)])
    return float(values.min()), float(values.max())


def usual(traces: Sequence[Trace], name: str) -> float:
    """Return the largest magnitude of a quantity in runs that last, without brief values of over
    twice it.

    A brief value takes at most 1 - LASTING_QUANTILE of the time.
    """
    peak = max(map(abs, span(traces, name)))
    largest = 0.0
    for y in lasting(traces, name):
        usual_sizes = np.quantile(np.abs(y), LASTING_QUANTILE, axis=0)
        largest = max(largest, float(usual_sizes.max()))
    return largest if peak > 2.0 * largest else peak


def limits(traces: Sequence[Trace], name: str) -> Pair:
    """Return the vertical range for a quantity: its span with the reference (zero for an error),
    and a margin.
    """
    low, high = span(traces, name)
    if name == "x":
        references = []
        for trace in traces:
            finite = np.isfinite(trace.r)
            references.append(trace.r[finite])
        r = np.concatenate(references)
        low = min(low, r.min(initial=low))
        high = max(high, r.max(initial=high))
    if name in ERRORS:
        low = min(low, 0.0)
        high = max(high, 0.0)
    if name in PEAKS:
        high = max(high, MIN_RATIO * MIN_ERROR)
        least = min(max(low, MIN_ERROR), high / MIN_RATIO)
        return least / 1.5, high * 1.5
    size = max(abs(low), abs(high))
    air = MARGIN * (high - low)
    if high - low <= MIN_VARIATION * size:
        air = size / 2 or 1.0
    return low - air, high + air
