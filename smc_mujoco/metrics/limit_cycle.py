"""Chattering of a run: amplitude and frequency of the limit cycle of the sliding variable, if there is one.

    amplitude, frequency = limit_cycle(t, s)      # half the range within a period, Hz; NaN, NaN where there is none

The frequency is that of the largest peak in the spectrum of s', among those that have at least five periods in the
samples, refined by its phase in the two halves. A drift and slow waves, such as those of a swinging load, do not count:
the amplitude is the median, over all windows of one period, of half the range of s less its mean over a period.

There is no limit cycle where s does not oscillate (rounding only), where the peak has less than a tenth of the
spectrum (noise) or no more than leaks from slow waves, where it may be the third harmonic of a larger cycle with fewer
than five periods, or where the oscillation grows or dies, so that its amplitude
differs by more than half from the first to the second half of the samples.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from smc_mujoco.metrics.conventions import last

if TYPE_CHECKING:
    from smc_mujoco.simulation.trace import Trace

PERIODS = 5  # fewest in the samples
LEAK = 2.5e-9  # of the spectrum's largest power: what the window leaks from slow waves
ROUNDING = 1e-10  # of the largest |s|
SHARE = 0.1  # of the spectrum's power, which a peak has at least
STEADY = 0.5  # largest relative change of the amplitude from the first to the second half
NONE = (math.nan, math.nan)


def limit_cycle(t: np.ndarray, s: np.ndarray) -> tuple[float, float]:
    """Return amplitude, in the unit of s, and frequency, Hz, of the limit cycle in samples; NaN, NaN without one.

    Args:
      t: (K,) times, s, evenly spaced.
      s: (K,) sliding variable.
    """
    rates = np.diff(s)
    if len(rates) < 4 * PERIODS or not np.isfinite(s).all():
        return NONE
    h = float(t[-1] - t[0]) / (len(t) - 1)
    spectrum = np.abs(np.fft.rfft((rates - rates.mean()) * _window(len(rates)))) ** 2
    first, leaked = PERIODS, LEAK * float(spectrum.max())
    while first < len(spectrum) - 1 and spectrum[first - 1] > spectrum[first]:
        first += 1  # on the slope of slower waves
    slow = float(spectrum[:first].max())
    spectrum[:first] = 0.0
    total, peak = float(spectrum.sum()), int(spectrum.argmax())
    if peak < 3 * PERIODS and spectrum[peak] < slow:
        return NONE  # it may be the third harmonic of a cycle with fewer periods
    if spectrum[peak] <= leaked or spectrum[peak - 3 : peak + 4].sum() < SHARE * total:
        return NONE
    periods = _refined(rates, peak)
    if periods < PERIODS:
        return NONE
    frequency = periods / (h * len(rates))
    window = max(2, min(round(1.0 / (frequency * h)), len(s) // PERIODS))
    fast = s[window // 2 : window // 2 + len(s) - window + 1] - np.convolve(s, np.full(window, 1.0 / window), "valid")
    ranges = np.ptp(sliding_window_view(fast, window + 1), axis=1)
    early, late = (float(np.median(part)) for part in np.array_split(ranges, 2))
    if max(early, late) <= 2.0 * ROUNDING * np.abs(s).max() or abs(late - early) > STEADY * max(early, late):
        return NONE
    return float(np.median(ranges)) / 2.0, frequency


def _window(count: int) -> np.ndarray:
    """Return the window of four cosines of F. J. Harris, Proc. IEEE 66:51, 1978: its side lobes are below -92 dB."""
    angles = 2.0 * math.pi * (np.arange(count) + 0.5) / count
    return 0.35875 - 0.48829 * np.cos(angles) + 0.14128 * np.cos(2.0 * angles) - 0.01168 * np.cos(3.0 * angles)


def of_trace(trace: Trace, channel: int = 0) -> tuple[float, float]:
    """Return amplitude and frequency of the limit cycle in the last part of a run; NaN, NaN without one."""
    part = last(trace)
    return limit_cycle(trace.t[part], trace.s[part, channel])


def _refined(rates: np.ndarray, peak: int) -> float:
    """Return a peak of the spectrum between its whole numbers: how far its phase turns from one half to the other."""
    half = len(rates) // 2
    turns = np.exp(-2j * math.pi * peak / len(rates) * np.arange(2 * half))
    window = _window(half)
    first, last = ((rates[at : at + half] * turns[at : at + half]) @ window for at in (0, half))
    turned = float(np.angle(last * np.conj(first))) / (2.0 * math.pi)  # of a turn, in half of the samples
    return peak + turned * len(rates) / half
