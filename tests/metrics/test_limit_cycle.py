"""The measured limit cycle: sines and triangles are found, and what is none is NaN."""

import math

import numpy as np
import pytest

from smc_mujoco.metrics.limit_cycle import limit_cycle

T = np.arange(0.0, 2.0, 1e-3)


def wave(frequency, amplitude=0.3, phase=0.3):
    return amplitude * np.sin(math.tau * frequency * T + phase)


@pytest.mark.parametrize("frequency", [3.1, 7.3, 19.37, 81.4])
def test_a_sine_has_its_amplitude_and_frequency(frequency):
    amplitude, found = limit_cycle(T, wave(frequency))
    assert found == pytest.approx(frequency, rel=1e-5)
    assert amplitude == pytest.approx(0.3, rel=0.04)  # a period is a whole number of samples


def test_a_wave_of_two_samples_is_found():
    assert limit_cycle(T, 0.2 * (-1.0) ** np.arange(len(T))) == pytest.approx((0.2, 500.0))


def test_slow_waves_and_drifts_do_not_count():
    triangle = 1e-3 * (2.0 / math.pi) * np.arcsin(np.sin(math.tau * 50.0 * T))
    amplitude, frequency = limit_cycle(T, triangle + 0.5 * np.sin(6.0 * T) + 0.2 * T)
    assert frequency == pytest.approx(50.0, rel=1e-3)
    assert amplitude == pytest.approx(1e-3, rel=0.03)


@pytest.mark.parametrize(
    "s",
    [
        np.zeros(len(T)),
        np.exp(-3.0 * T),
        np.exp(-3.0 * T) * np.sin(60.0 * T),
        np.exp(3.0 * T) * np.sin(60.0 * T),
        0.5 * np.sin(6.0 * T),
        (2.0 / math.pi) * np.arcsin(np.sin(math.tau * 2.0 * T)),
        np.random.default_rng(0).normal(size=len(T)),
        1.0 + 1e-12 * wave(30.0),
        np.where(T < 1.0, wave(30.0), math.nan),
        wave(30.0)[:10],
    ],
    ids=["zero", "decay", "dying", "growing", "slow", "slow triangle", "noise", "rounding", "broken", "short"],
)
def test_what_does_not_oscillate_steadily_has_no_limit_cycle(s):
    amplitude, frequency = limit_cycle(T[: len(s)], s)
    assert math.isnan(amplitude)
    assert math.isnan(frequency)
