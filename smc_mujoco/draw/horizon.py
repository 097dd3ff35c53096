"""Which part of the runs a figure shows: until all are at rest, or from a time on."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from smc_mujoco.draw import shared_axes
from smc_mujoco.draw.decimate import arrays_within, end
from smc_mujoco.draw.quantities import span
from smc_mujoco.metrics.conventions import last_exit, scale, settling_band
from smc_mujoco.simulation.trace import Trace

REST_BAND = 0.02  # of a panel's height: an x that stays within it rests; chosen
# panels show ZOOM times the time until all rest, if that is less than this part of a run
ZOOM = 1.3
MAX_ZOOMED = 0.5


def horizon(traces: Sequence[Trace]) -> float:
    """Return the time that panels of x, u and s show, s: the whole run, or the first part if all
    rest after it, and have settled if they ever do.

    Nothing changes or disturbs the plant after that part, and no reference moves.
    """
    duration = end(traces)
    last = 0.0
    for group, parts in shared_axes.split(traces).items():
        low, high = span(parts, "x")
        for trace in parts:
            ways = trace.x - trace.x[-1]
            away = np.abs(ways).max(axis=1)
            moved = away > REST_BAND * (high - low)
            pushed = (trace.d != 0.0).any(axis=1)
            led = (trace.r != trace.r[-1]).any(axis=1)
            acted = pushed | led
            times = trace.t[moved | (acted & group.driven)]
            last = max(last, *times[-1:], trace.diverged_at or 0.0)
            settled = settles_at(trace)
            if group.driven and np.isfinite(settled):
                last = max(last, settled)
            if trace.scenario.jump:
                last = max(last, trace.scenario.jump.time)
            if trace.scenario.fault:
                last = max(last, trace.scenario.fault.at)
    if 0.0 < ZOOM * last < MAX_ZOOMED * duration:
        return ZOOM * last
    return duration


def settles_at(trace: Trace) -> float:
    """Return when all channels of a trace of one group have settled for good, s; inf for never."""
    misses = trace.x - trace.r
    error = np.abs(misses).max(axis=1)
    return last_exit(trace.t, error, settling_band(trace.scenario, scale(trace)))


def until(trace: Trace, time: float) -> Trace:
    """Return the trace up to a time, s, with two samples at least."""
    count = max(2, int(np.searchsorted(trace.t, time + 1e-9)))
    if count >= len(trace.t):
        return trace
    part = arrays_within(trace, slice(count))
    return dataclasses.replace(trace, **part)


def since(trace: Trace, time: float) -> Trace:
    """Return the trace from a time on, s, as a run of its own, which is not smoothed."""
    first = min(int(np.searchsorted(trace.t, time - 1e-9)), len(trace.t) - 2)
    part = arrays_within(trace, slice(first, None))
    part["t"] = part["t"] - part["t"][0]
    duration = float(part["t"][-1])
    calm = {"duration": duration, "jump": None, "fault": None}
    scenario = dataclasses.replace(trace.scenario, **calm)
    return dataclasses.replace(trace, scenario=scenario, **part)
