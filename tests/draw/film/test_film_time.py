"""Charts of films: the time until all rest has most of the width, and settling and agreement are
said.
"""

import dataclasses

import numpy as np
import pytest
from helpers.runs import at_defaults
from helpers.sketch import made

import smc_mujoco as smc
from smc_mujoco.draw import style
from smc_mujoco.draw.film.charts import WINDOW_WIDTH, Charts
from smc_mujoco.draw.panels import horizon

LAWS = ("classical", "pid")
SIZE = (1280, 260)


def resting(law, rate):
    """A run of 4 s whose x decays from 0.5."""
    trace = made(
        smc.Scenario(
            plant="inverted_pendulum",
            law=at_defaults(law),
            duration=4.0,
            x0=0.5,
        )
    )
    zero = np.zeros_like(trace.x)
    return dataclasses.replace(
        trace,
        x=0.5 * np.exp(-rate * trace.t)[:, None],
        r=zero,
        d=zero,
        u=zero,
    )


@pytest.fixture(scope="module")
def charts():
    traces = []
    for law, rate in zip(LAWS, (8.0, 16.0), strict=True):
        traces.append(resting(law, rate))
    return Charts(
        traces, LAWS, style.law_colours([trace.scenario.law for trace in traces]), SIZE, 1.0
    ), traces


def test_the_time_until_all_rest_has_most_of_the_width_and_the_rest_is_grey(charts):
    drawn, traces = charts
    window = horizon(traces)
    assert window < 1.0
    assert [float(drawn.share(time)) for time in (0.0, window / 2, window, 4.0)] == pytest.approx(
        [0.0, WINDOW_WIDTH / 2, WINDOW_WIDTH, 1.0]
    )
    left, top, right, _ = drawn.frames[0]
    picture = drawn.at(0.0)
    for share, colour in (
        (0.75, style.PAPER),
        (0.95, style.BAND),
    ):
        column = picture[top + 2 : top + 60, round(left + share * (right - left))]
        assert (np.abs(column.astype(int) - style.rgb(colour)).max(axis=1) < 3).mean() > 0.8
    now = drawn.at(window / 2)
    cursor = np.flatnonzero((now[top + 5, left:right] == style.rgb(style.MUTED)).all(axis=1))
    assert 0.5 * WINDOW_WIDTH * (right - left) == pytest.approx(cursor.mean(), abs=2.0)


def test_a_mark_says_when_each_law_has_settled(charts):
    """e falls to 2 % of 0.5 after ln 50 / rate."""
    drawn, traces = charts
    left, top, right, bottom = drawn.frames[0]
    picture = drawn.at(4.0)[top:bottom].astype(int)
    colours = map(style.rgb, drawn.colours)
    for trace, rate, colour in zip(traces, (8.0, 16.0), colours, strict=True):
        middle = round(left + (right - left) * float(drawn.share(np.log(50.0) / rate)))
        alike = np.abs(picture[:, middle - 6 : middle + 7] - colour).max(axis=2) < 12
        beside = np.abs(picture[:, middle + 20 : middle + 33] - colour).max(axis=2) < 12
        assert alike.sum() > beside.sum() + 20, trace.scenario.law.name


def test_a_map_shows_the_paths_of_flights_up_to_the_clock_to_one_scale():
    reference = [smc.Sine(0.5, 6.0), *[smc.Constant(0.0)] * 5]
    run = made(
        smc.Scenario(
            plant="quadrotor",
            reference=reference,
            law="geometric",
            duration=1.0,
        )
    )
    x = np.stack([part(6.0 * run.t) for part in (np.sin, np.cos, *[np.zeros_like] * 4)], axis=1)
    shown = Charts(
        [dataclasses.replace(run, x=0.4 * x)],
        ["one"],
        ["#0072B2"],
        SIZE,
        1.0,
    )
    ((t, line),) = shown.flights
    assert np.ptp(line[:, 1]) == pytest.approx(np.ptp(line[:, 0]), rel=0.01)
    for time, wanted in ((0.2, shown.full), (0.9, shown.faint)):
        across, down = np.round(line[np.searchsorted(t, time)]).astype(int)
        near = np.s_[down - 2 : down + 3, across - 2 : across + 3]
        assert (shown.at(0.5)[near] == wanted[near]).all()
    still = dataclasses.replace(run, r=0.0 * run.r)
    fixed = Charts(
        [still],
        ["one"],
        ["#0072B2"],
        SIZE,
        1.0,
    )
    assert not fixed.flights
