"""Curves of a network's figure reach over all that its channels do; the slowest is thick."""

import dataclasses

import numpy as np
import pytest
from helpers.sketch import made
from matplotlib.figure import Figure

import smc_mujoco as smc
from smc_mujoco.draw import decimate, panels


def network(n):
    """A network whose channels fall from starts of both signs, the last but one the most slowly."""
    plant = smc.plant("pendulum_network", n=n)
    trace = made(smc.Scenario(plant=plant, law=smc.law("classical"), duration=1.0))
    starts = np.where(np.arange(n) % 4 == 1, -0.4, 0.1 + 0.4 * np.arange(n) / n)
    rates = np.where(np.arange(n) == n - 2, 0.5, 5.0)
    return dataclasses.replace(trace, x=starts * np.exp(-rates * trace.t[:, None]), r=0.0 * trace.r)


@pytest.mark.quick
@pytest.mark.parametrize("n", [5, 20, 60])
def test_no_drawn_range_is_smaller_than_the_data_s(n):
    trace = network(n)
    (panel,) = panels.over_groups([trace], "x")
    ax = Figure().subplots()
    panels.over_time(ax, panel, ["#0072B2"])
    curves = [np.asarray(line.get_ydata(), float) for line in ax.lines if len(line.get_xdata()) > 2]
    lowest = min(curve.min() for curve in curves)
    highest = max(curve.max() for curve in curves)
    assert (lowest, highest) == pytest.approx((trace.x.min(), trace.x.max()), abs=1e-3)
    assert len(curves) >= min(n, panels.MAX_DRAWN_CHANNELS)
    thick = max(ax.lines, key=lambda line: line.get_linewidth())
    assert np.asarray(thick.get_ydata(), float)[-1] == pytest.approx(trace.x[-1, n - 2])


@pytest.mark.parametrize("samples", [1000, 5000])
def test_a_band_is_as_narrow_as_channels_that_cross(samples):
    """Two lines through one point were a block of 20 ms there, far beyond both."""
    t = np.linspace(0.0, 1.0, samples + 1)
    band_times, low, high = decimate.band(t, np.stack([t - 0.5, 0.5 - t], axis=1))
    np.testing.assert_allclose(high, np.abs(band_times - 0.5), atol=2e-3)
    np.testing.assert_allclose(low, -np.abs(band_times - 0.5), atol=2e-3)


def test_a_band_has_no_gaps_of_20_ms_between_swings_and_keeps_longer_ones():
    t = np.linspace(0.0, 3.0, 3001)
    pauses = (t % 0.1 < 0.015) | ((t > 1.0) & (t < 1.2))
    band_times, low, high = decimate.band(
        t, np.where(pauses, 0.0, (-1.0) ** np.arange(3001))[:, None]
    )
    rest = (band_times > 1.02) & (band_times < 1.18)
    assert high[rest].max() == 0.0 == low[rest].min()
    assert (high[(band_times > 0.05) & (band_times < 0.95)] == 1.0).all()
    assert (low[(band_times > 1.25) & (band_times < 2.95)] == -1.0).all()
