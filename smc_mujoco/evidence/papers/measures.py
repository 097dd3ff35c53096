"""Measures that the claims of several papers share, and what several of their laws solve."""

from collections.abc import Iterable, Sequence

import numpy as np
from numba import njit

from smc_mujoco.common.aliases import Array
from smc_mujoco.metrics.limit_cycle import limit_cycle
from smc_mujoco.simulation.trace import Trace

END_SAMPLES = (
    3000  # the same at every control period, because a maximum grows with the number of samples
)


def late(signal: Array) -> float:
    """Return the largest magnitude of a signal, (samples, channels), at the end of its run."""
    return float(np.abs(signal[-END_SAMPLES:]).max())


def half(signal: Array) -> Array:
    """Return the last half of a signal."""
    return signal[len(signal) // 2 : -1]


def largest(signal: Array) -> float:
    """Return the largest magnitude in the last half of a signal; NaN if the run failed."""
    return float(np.abs(half(signal)).max())


def late_step(signal: Array) -> float:
    """Return the largest change of a signal, (samples, channels), from sample to sample at the end
    of its run.
    """
    return late(np.diff(signal[:-1], axis=0))


def exponent(levels: Sequence[float], errors: Iterable[float]) -> float:
    """Return p of errors ~ levels^p by least squares of the logarithms; NaN for errors that are 0
    or not finite.

    Errors are in the order of the levels, as many at each. Their logarithms are averaged.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(np.reshape(list(errors), (len(levels), -1))).mean(axis=1)
    if np.isfinite(logs).all():
        return float(np.polyfit(np.log(levels), logs, 1)[0])
    return float("nan")


def settled(trace: Trace, signal: Array, band: float) -> float:
    """Return the time from which a signal, (samples, channels), stays within a band, s; inf if it
    does not.
    """
    outside = np.flatnonzero(~(np.abs(signal).max(axis=1) <= band))
    if not outside.size:
        return 0.0
    if outside[-1] + 1 < len(trace.t):
        return float(trace.t[outside[-1] + 1])
    return float("inf")


def cycle(trace: Trace, part: float = 0.5) -> tuple[float, float]:
    """Return amplitude of s and frequency, Hz, of the limit cycle in the last part of a run; NaN,
    NaN without one.
    """
    first = int(len(trace.t) * (1.0 - part))
    return limit_cycle(trace.t[first:], trace.s[first:, 0])


@njit
def two_signs(first, a, second, b):
    """Return v with v + a sgn(v - first) + b sgn(v - second) = 0, both signs set-valued at 0.

    The left side grows with v and jumps at two places. Its zero is at one of them, or at one of the
    three values that v has between them.
    """
    if first > second:
        first, second, a, b = second, first, b, a
    return min(a + b, max(first, min(b - a, max(second, -a - b))))
