"""The figure of predicted chattering: the crossing, the band and a law without a limit cycle."""

import numpy as np
import pytest
from helpers.drawn_pages import has_units_names_and_places
from helpers.runs import at_defaults

import smc_mujoco as smc
from smc_mujoco.analysis.step_halving import StepChange
from smc_mujoco.chattering.nyquist import nyquist
from smc_mujoco.chattering.prediction import predict


@pytest.fixture(scope="module")
def drawn():
    """The page, and the cycles that it shows."""
    fields = {
        "plant": "duffing",
        "actuator": smc.Lag(0.01),
        "duration": 2.0,
        "x0": 0.05,
    }
    scenarios = []
    for law in ("super_twisting", "observer_free"):
        scenarios.append(smc.Scenario(law=at_defaults(law), **fields))
    cycles = []
    for scenario in scenarios:
        cycles.append(predict(scenario, ranges=False))
    changes = [StepChange(0.06, 0.0), StepChange(0.04, 0.05)]
    return nyquist(scenarios, 0, cycles, smc.run(scenarios), changes), cycles


@pytest.fixture(scope="module")
def page(drawn):
    return drawn[0]


def test_both_curves_pass_minus_one_where_the_mark_is(page):
    lines = {}
    for line in page.axes[0].lines:
        lines[line.get_label()] = line.get_xydata()
    for name in ("L, over frequency", "1/N, over amplitude"):
        assert np.hypot(*(lines[name] - [-1.0, 0.0]).T).min() < 0.1
    (mark,) = [line for line in page.axes[0].lines if line.get_marker() == "o"]
    assert mark.get_xydata().tolist() == [[-1.0, 0.0]]


@pytest.mark.quick
def test_the_legend_names_the_frequency_and_the_curves_as_they_are_drawn(drawn):
    page, (cycle, _) = drawn
    legend = page.legends[0]
    words = [text.get_text() for text in legend.get_texts()]
    assert f"{cycle.frequency:.3g} Hz" in words[0]
    styles_by_name = {line.get_label(): line.get_linestyle() for line in page.axes[0].lines}
    for name, handle in zip(words[2:4], legend.legend_handles[2:4], strict=True):
        assert handle.get_linestyle() == styles_by_name[name]


@pytest.mark.quick
def test_s_of_the_run_fills_the_predicted_band(page):
    (s,) = page.axes[1].lines
    (band,) = page.axes[1].patches
    _, low = band.get_xy()
    assert np.ptp(s.get_ydata()) == pytest.approx(band.get_height(), rel=0.15)
    assert low < s.get_ydata().mean() < low + band.get_height()


def test_a_calm_law_has_no_empty_panel_and_no_band(page):
    assert len(page.axes) == 3
    assert not page.axes[2].patches
    assert page.axes[2].get_position().width > 1.3 * page.axes[1].get_position().width
    assert "do not cross" in page.legends[0].get_texts()[1].get_text()


def test_every_axis_has_its_unit_and_every_colour_its_name(page):
    has_units_names_and_places(page)
