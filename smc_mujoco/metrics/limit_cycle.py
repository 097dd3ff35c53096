"""Chattering of a run: amplitude and frequency of the limit cycle of the sliding variable, if there
is one.

    amplitude, frequency = limit_cycle(t, s)  # half the range within a period, Hz; else NaN, NaN

The frequency follows from the largest peak in the spectrum of s', among those that have at least
five periods in the samples, refined by its phase in the two halves. If s jumps, that peak may be a
higher harmonic, and is divided by its order. A drift and slow waves, such as those of a swinging
load, do not count: the amplitude is the median, over all windows of one period, of half the range
of s less its mean over a period.

There is no limit cycle where

- s is not finite, or not below 1e100;
- s does not oscillate, except by rounding;
- the peak is no larger than what leaks from slow waves;
- the harmonics of the peak have less than a tenth of the spectrum's power, as in noise, or in the
  irregular steps of a coarse encoder;
- the peak may be a harmonic of a larger cycle with fewer than five periods;
- the oscillation grows or dies: its amplitude differs by more than half from the first to the
  second half of the samples.

Noise that a lightly damped loop filters may look like a cycle for so few periods. So runs of linear
laws, which have no cycle, may show one under a random force.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.metrics.conventions import last_part
from smc_mujoco.metrics.once_per_trace import once_per_trace

if TYPE_CHECKING:
    from smc_mujoco.simulation.trace import Trace

MIN_PERIODS = 5  # of a cycle in the samples
MAX_MAGNITUDE = 1e100  # of s: the power of larger numbers may be infinite
LEAK_SHARE = 2.5e-9  # of the spectrum's largest power: what the window leaks from slow waves
ROUNDING = 1e-10  # of the largest |s|
MIN_POWER_SHARE = 0.1  # of the spectrum's power, in the harmonics of a cycle
MAX_LINE_OFFSET = (
    0.1  # periods: between the line of a first harmonic and a fraction of the line of a higher one
)
MIN_LINE_SHARE = 0.01  # of the largest peak's power, in the line of the first harmonic
MAX_CHANGE = 0.5  # of the amplitude, relative, from the first to the second half
NO_CYCLE = (math.nan, math.nan)


def limit_cycle(t: Array, s: Array) -> Pair:
    """Return amplitude, in the unit of s, and frequency, Hz, of the limit cycle in samples; NaN,
    NaN without one.

    Args:
      t: (K,) times, s, evenly spaced.
      s: (K,) sliding variable.
    """
    rates = np.diff(s)
    if len(rates) < 4 * MIN_PERIODS or not np.abs(s).max() < MAX_MAGNITUDE:
        return NO_CYCLE
    h = float(t[-1] - t[0]) / (len(t) - 1)
    spectrum = np.abs(np.fft.rfft((rates - rates.mean()) * _window(len(rates)))) ** 2
    first = MIN_PERIODS
    while first < len(spectrum) - 1 and spectrum[first - 1] > spectrum[first]:
        first += 1  # on the slope of slower waves
    peak = first + int(spectrum[first:].argmax())
    if spectrum[peak] <= LEAK_SHARE * float(spectrum.max()):
        return NO_CYCLE
    periods = _refined(rates, peak)
    periods /= _order(rates, spectrum, first, peak, periods)
    if periods < MIN_PERIODS or _share(spectrum, first, periods) < MIN_POWER_SHARE:
        return NO_CYCLE
    frequency = periods / (h * len(rates))
    window = max(2, min(round(1.0 / (frequency * h)), len(s) // MIN_PERIODS))
    fast = s[window // 2 : window // 2 + len(s) - window + 1] - np.convolve(
        s, np.full(window, 1.0 / window), "valid"
    )
    ranges = np.ptp(sliding_window_view(fast, window + 1), axis=1)
    early, late = map(np.median, np.array_split(ranges, 2))
    largest = max(early, late)
    if largest <= 2.0 * ROUNDING * np.abs(s).max() or abs(late - early) > MAX_CHANGE * largest:
        return NO_CYCLE
    return float(np.median(ranges)) / 2.0, frequency


def channel_cycle(trace: Trace, channel: int = 0) -> Pair:
    """Return amplitude and frequency of the limit cycle in the last part of a run; NaN, NaN without
    one.
    """
    part = last_part(trace)
    return limit_cycle(trace.t[part], trace.s[part, channel])


@once_per_trace
def largest_cycle(trace: Trace) -> Pair:
    """Return amplitude and frequency of the channel with the largest limit cycle; NaN, NaN where
    none has one.
    """
    part = last_part(trace)
    return largest_of(trace.t[part], trace.s[part])


def largest_of(t: Array, s: Array) -> Pair:
    """Return amplitude and frequency of the largest limit cycle in samples of s, (K, channels);
    NaN, NaN where none has one.
    """
    cycles = []
    for of_channel in s.T:
        cycle = limit_cycle(t, of_channel)
        if not math.isnan(cycle[0]):
            cycles.append(cycle)
    return max(cycles, default=NO_CYCLE)


def _order(rates: Array, spectrum: Array, first: int, peak: int, periods: float) -> int:
    """Return which harmonic of the cycle the largest peak of s' is: 1, or larger for a wave with
    jumps or pulses.

    The first harmonic is the largest in the spectrum of s, and is a line there. Waves with fewer
    than five periods have no separate lines: such a wave is the cycle if the peak may be its second
    or third harmonic.
    """
    of_s = (
        spectrum[1:]
        / np.sin(0.5 * math.pi * np.arange(1, len(spectrum)) / (len(spectrum) - 1)) ** 2
    )
    sizes = np.convolve(np.r_[0.0, of_s], np.ones(5), "same")  # of lines, which the window spreads
    order = 1
    largest = sizes[peak]
    for k in range(2, round(periods / MIN_PERIODS) + 1 if periods >= 3 * MIN_PERIODS else 4):
        line = round(periods / k)
        if sizes[line] <= largest:
            continue
        strong = line >= first and spectrum[line] > MIN_LINE_SHARE * spectrum[peak]
        if line < MIN_PERIODS or (
            strong and abs(_refined(rates, line) - periods / k) < MAX_LINE_OFFSET
        ):
            order = k
            largest = sizes[line]
    return order


def _share(spectrum: Array, first: int, periods: float) -> float:
    """Return the share of a spectrum's power in a cycle's harmonics: 0 for a flat spectrum, at most
    1.
    """
    width = min(3, int(periods - 2) // 2)  # bins to each side of a line
    bins = np.arange(len(spectrum))
    lines = np.abs(bins - periods * np.maximum(np.round(bins / periods), 1.0)) <= width + 0.5
    if lines[first:].all():  # the cycle is the fastest of all: there is nothing beside it
        return 1.0
    covered = lines[first:].mean()
    return float(
        (spectrum[first:][lines[first:]].sum() / spectrum[first:].sum() - covered) / (1.0 - covered)
    )


def _window(count: int) -> Array:
    """Return the window of four cosines of F.

    J. Harris, Proc. IEEE 66:51, 1978: its side lobes are below -92 dB.
    """
    angles = 2.0 * math.pi * (np.arange(count) + 0.5) / count
    return (
        0.35875
        - 0.48829 * np.cos(angles)
        + 0.14128 * np.cos(2.0 * angles)
        - 0.01168 * np.cos(3.0 * angles)
    )


def _refined(rates: Array, peak: int) -> float:
    """Return the number of periods of a peak, to a fraction that follows from its phase in the two
    halves.
    """
    half = len(rates) // 2
    turns = np.exp(-2j * math.pi * peak / len(rates) * np.arange(2 * half))
    window = _window(half)
    early = (rates[:half] * turns[:half]) @ window
    late = (rates[half : 2 * half] * turns[half:]) @ window
    turn = float(np.angle(late * np.conj(early))) / (2.0 * math.pi)  # in half of the samples
    return peak + turn * len(rates) / half
