"""Amplitude of chattering over the actuator's lag."""

import math

import matplotlib.pyplot as plt
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.draw.amplitudes import amplitudes, crossover, lag
from smc_mujoco.metrics.catalogue import chattering_amplitude


def test_the_lag_is_what_all_drives_and_the_delay_add_up_to():
    drives = (smc.Lag(0.01), smc.Lag(0.02), smc.Backlash(0.01))
    assert lag(smc.Scenario(plant="duffing", law="none", actuator=drives, input_delay=0.005)) == pytest.approx(0.035)


def test_amplitudes_that_grow_with_the_lag_and_with_its_square_cross_where_they_are_equal():
    lags = [1.0, 10.0, 100.0]
    assert crossover(lags, [2.0 * x for x in lags], [0.1 * x * x for x in lags]) == pytest.approx(20.0)
    assert math.isnan(crossover(lags, [1.0, 2.0, 3.0], [2.0, 3.0, 4.0]))
    assert crossover(lags, [20.0, math.nan, 2000.0], [1.0, 1.0, 1e5]) == pytest.approx(
        100.0 ** (math.log(20.0) / math.log(1000.0))  # between the two lags where both are known
    )
    assert math.isnan(crossover(lags, [math.nan] * 3, lags))


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_grid")
def test_predictions_are_lines_and_runs_are_dots_of_the_same_colour():
    def trace(law, tau):
        return smc.run(smc.Scenario(plant="duffing", law=law, actuator=smc.Lag(tau), x0=0.02, duration=6.0))

    laws = {"one": "super_twisting", "two": "twisting"}
    runs = {f"{tau:g} s": {label: trace(law, tau) for label, law in laws.items()} for tau in (0.01, 0.005)}
    figure = amplitudes(runs)
    lines = figure.axes[0].lines[:6]
    for label, line, *dots in zip(laws, lines[::3], lines[1::3], lines[2::3], strict=True):
        measured = [chattering_amplitude(runs[name][label]) for name in ("0.005 s", "0.01 s")]
        assert [float(np.asarray(dot.get_ydata())[0]) for dot in dots] == measured
        assert list(line.get_ydata()) == pytest.approx(measured, rel=0.1)
        lags = [float(np.asarray(dot.get_xdata())[0]) for dot in dots]
        assert list(line.get_xdata()) == lags == pytest.approx([5.0, 10.0])
        assert {line.get_color()} == {dot.get_color() for dot in dots}
    plt.close("all")
