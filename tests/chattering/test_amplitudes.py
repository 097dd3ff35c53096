"""Amplitude of chattering over the actuator's lag."""

import math

import numpy as np
import pytest
from helpers.drawn_pages import has_units_names_and_places, places
from helpers.runs import at_defaults
from helpers.sketch import made
from matplotlib.colors import to_hex

import smc_mujoco as smc
from smc_mujoco.analysis.step_halving import StepChange
from smc_mujoco.chattering import amplitudes
from smc_mujoco.chattering.amplitudes import crossover, lag
from smc_mujoco.chattering.prediction import Chattering
from smc_mujoco.draw import style


@pytest.mark.quick
def test_the_lag_is_what_all_drives_and_the_delay_add_up_to():
    drives = (smc.Lag(0.01), smc.Lag(0.02), smc.Backlash(0.01))
    assert lag(
        smc.Scenario(
            plant="duffing",
            law="none",
            actuator=drives,
            input_delay=0.005,
        )
    ) == pytest.approx(0.035)


def test_amplitudes_that_grow_with_the_lag_and_with_its_square_cross_where_they_are_equal():
    lags = [1.0, 10.0, 100.0]
    assert crossover(lags, [2.0 * x for x in lags], [0.1 * x * x for x in lags]) == pytest.approx(
        20.0
    )
    assert math.isnan(crossover(lags, [1.0, 2.0, 3.0], [2.0, 3.0, 4.0]))
    assert crossover(lags, [20.0, math.nan, 2000.0], [1.0, 1.0, 1e5]) == pytest.approx(
        100.0 ** (math.log(20.0) / math.log(1000.0))  # between the two lags where both are known
    )
    assert math.isnan(crossover(lags, [math.nan] * 3, lags))


def lags():
    """Two laws whose amplitudes are equal at a lag of 50 ms; half the step changes the run at 10
    ms.
    """
    times = (0.002, 0.01, 0.05)
    laws = {"relay": ("classical", 3.0, 1.0), "smooth": ("super_twisting", 60.0, 2.0)}
    sizes = {}
    runs = {f"{tau:g} s": {} for tau in times}
    for label, (law, factor, power) in laws.items():
        for tau in times:
            fields = {"actuator": smc.Lag(tau), "duration": 0.01}
            trace = made(smc.Scenario(plant="duffing", law=at_defaults(law), **fields))
            sizes[id(trace.scenario)] = sizes[id(trace)] = factor * tau**power
            runs[f"{tau:g} s"][label] = trace
    changes = [StepChange(0.05, 0.0), StepChange(0.2, 0.0), StepChange(0.0, 0.01)]
    with pytest.MonkeyPatch.context() as patch:
        predicted = lambda one, ranges: Chattering(amplitude=sizes[id(one)], frequency=1.0)  # noqa: E731
        patch.setattr(amplitudes, "predict", predicted)
        patch.setattr(amplitudes, "channel_cycle", lambda trace: (1.1 * sizes[id(trace)], 3.0))
        patch.setattr(amplitudes, "step_halving", lambda traces, channel: changes)
        return amplitudes.amplitudes(runs)


def test_laws_whose_amplitudes_are_equal_at_a_lag_are_marked_there_and_doubtful_runs_are_hollow():
    page = lags()
    has_units_names_and_places(page)
    (ax,) = page.axes
    assert [text.get_text() for text in ax.texts] == ["equal at 50 ms"]
    (mark,) = [x for line in ax.lines for x in [places(line)[:, 0]] if len(x) == 2 and x[0] == x[1]]
    assert mark[0] == pytest.approx(50.0)
    lines = [line for line in ax.lines if len(places(line)) == 3]
    expected = [(3.0 * 1e-3, 1.0), (60.0 * 1e-6, 2.0)]
    for line, (factor, power) in zip(lines, expected, strict=True):
        np.testing.assert_allclose(line.get_xdata(), [2.0, 10.0, 50.0])
        np.testing.assert_allclose(line.get_ydata(), factor * np.array([2.0, 10.0, 50.0]) ** power)
    dots = [line for line in ax.lines if line.get_marker() == "o"]
    hollow = []
    for dot in dots:
        if to_hex(dot.get_mfc()) == to_hex(style.PAPER):
            hollow.append(places(dot)[0, 0])
    assert hollow == pytest.approx([10.0, 10.0])
    assert len(dots) == 6
