"""Panels of films: they show the time until all rest, as those of figures, and when each run has
settled; a map shows flights.
"""

import dataclasses

import numpy as np
import pytest
from helpers.films import picture, sheet
from helpers.runs import at_defaults
from helpers.sketch import made
from matplotlib.lines import Line2D

import smc_mujoco as smc
from smc_mujoco.draw import lanes, panels, style
from smc_mujoco.draw.film import charts
from smc_mujoco.draw.horizon import horizon

LAWS = ("classical", "pid")
SIZE = (1280, 720)


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
def page():
    traces = []
    for law, rate in zip(LAWS, (8.0, 16.0), strict=True):
        traces.append(resting(law, rate))
    return sheet(traces, LAWS, SIZE)


def test_curves_do_not_depend_on_how_long_a_run_goes_on_at_rest():
    """Of 10 s of a run that rests after 0.4 s, a film had a point each 40 ms, and ranges of u over
    40 ms in place of its line.
    """
    curves = []
    for duration in (1.5, 10.0):
        scenario = smc.Scenario(plant="inverted_pendulum", law="adrc", duration=duration)
        page = sheet([smc.run(scenario)], ["one"], SIZE)
        assert page.runs.span[0] < 0.7
        own = []
        for moving in page.moving:
            lines = [line for line in moving.axes.lines if line.get_gid() != panels.REFERENCE]
            own.append(max(lines, key=lambda line: len(line.get_xdata())))
        curves.append(own)
    for first, longer in zip(*curves, strict=True):
        ax = first.axes
        time = np.linspace(0.0, ax.get_xlim()[1], 1000)
        apart = np.interp(time, *first.get_data()) - np.interp(time, *longer.get_data())
        assert np.abs(apart).max() < 0.01 * np.ptp(ax.get_ylim())


def cursor(page, time):
    """Where the cursor is in the first panel, as a share of its width; none if it is not there."""
    left_edge, top, right, _ = page.frames[0]
    row = picture(page, time).astype(int)[top + 5, left_edge:right]
    inked = np.flatnonzero(np.abs(row - style.rgb(style.MUTED)).max(axis=1) < 30)
    return inked.mean() / (right - left_edge) if len(inked) else None


def test_panels_show_the_time_until_all_rest_and_then_the_cursor_is_gone(page):
    window = horizon(page.runs.traces)
    assert window < 1.0
    for panel_drawn in page.moving:
        assert panel_drawn.axes.get_xlim() == pytest.approx((0.0, window))
    assert cursor(page, window / 2) == pytest.approx(0.5, abs=0.01)
    assert cursor(page, 2.0) is None
    after = picture(page, 2.0)
    for left_edge, top, right, bottom in page.frames:
        panel = np.s_[top:bottom, left_edge:right]
        assert (after[panel] == page.full[panel][..., :3]).all()


@pytest.mark.quick
def test_all_panels_have_the_same_ticks(page):
    first, second = (panel.axes for panel in page.moving)
    assert first.get_xticks().tolist() == second.get_xticks().tolist()
    assert first.get_xticklabels()[-1].get_text().endswith(" s")


def test_a_mark_says_when_each_law_has_settled(page):
    """e falls to 2 % of 0.5 after ln 50 / rate."""
    left_edge, top, right, bottom = page.frames[0]
    seen = picture(page, 4.0).astype(int)[top - 20 : bottom]
    window = horizon(page.runs.traces)
    for rate, colour in zip((8.0, 16.0), page.runs.colours, strict=True):
        middle = round(left_edge + (right - left_edge) * np.log(50.0) / rate / window)
        alike = np.abs(seen - style.rgb(colour)).max(axis=2) < 12
        near = alike[:, middle - 6 : middle + 7].sum()
        assert near > alike[:, middle + 20 : middle + 33].sum() + 20, rate


def test_the_dashes_over_a_mark_say_whose_it_is(page):
    """In grey nothing said it."""
    styles = []
    for line in page.moving[0].axes.lines:
        if line.get_marker() == "v":
            styles.append(line._unscaled_dash_pattern)
    expected = []
    for look in style.looks(page.runs.traces):
        expected.append(Line2D([], [], **look)._unscaled_dash_pattern)
    assert styles == expected
    assert expected[0] != expected[1]


def test_marks_that_would_hide_each_other_stand_beside_each_other():
    times = [1.05, np.inf, 1.0, 3.0, np.inf]
    assert lanes.apart(times, 0.1) == pytest.approx([1.1, np.inf, 1.0, 3.0, np.inf])


@pytest.mark.parametrize("rate", [6.0, 0.0])
def test_no_run_is_marked_as_settled_whose_free_joint_has_not(rate):
    """A cart was marked whose pole went round."""
    run = made(smc.Scenario(plant="cart_pole", law=at_defaults("lqr"), duration=2.0))
    x = np.exp(-8.0 * run.t[:, None]) * [0.5, 0.0]
    x[:, 1] = 3.0 * np.exp(-rate * run.t)
    still = np.zeros_like(x)
    run = dataclasses.replace(run, x=x, r=still, d=still)
    first, _ = sheet([run], ["one"], SIZE).page.axes
    assert first.get_title("left") == "position x (m)"
    marks = [np.asarray(line.get_xdata())[0] for line in first.lines if line.get_marker() == "v"]
    expected = [np.log(50.0) / rate] if rate else []
    np.testing.assert_allclose(marks, expected, atol=2e-3)


def test_a_map_shows_the_paths_of_flights_up_to_the_clock_to_one_scale():
    reference = [smc.Sine(0.5, 6.0), *[smc.Constant(0.0)] * 5]
    run = made(smc.Scenario(plant="quadrotor", reference=reference, law="geometric", duration=1.0))
    x = np.stack([part(6.0 * run.t) for part in (np.sin, np.cos, *[np.zeros_like] * 4)], axis=1)
    page = sheet([dataclasses.replace(run, x=0.4 * x)], ["one"], SIZE)
    (flight,) = page.flights
    transform = flight.past.axes.transData  # pyright: ignore[reportOptionalMemberAccess]
    line = transform.transform(flight.places.T)
    assert np.ptp(line[:, 1]) == pytest.approx(np.ptp(line[:, 0]), rel=0.01)
    now = picture(page, 0.5).astype(int)
    for time, flown in ((0.2, True), (0.9, False)):
        across, up = np.round(line[np.searchsorted(flight.times, time)]).astype(int)
        pixel = now[SIZE[1] - 1 - up, across]
        assert (np.abs(pixel - style.rgb(page.runs.colours[0])).max() < 20) == flown
    assert not sheet([dataclasses.replace(run, r=0.0 * run.r)], ["one"], SIZE).flights


def test_on_a_map_the_wanted_path_lies_over_those_that_are_flown():
    """Three laws on one path hid it."""
    reference = [smc.Sine(0.5, 6.0), *[smc.Constant(0.0)] * 5]
    run = made(smc.Scenario(plant="quadrotor", reference=reference, law="geometric", duration=1.0))
    page = sheet([dataclasses.replace(run, x=run.r)], ["one"], SIZE)
    left_edge, top, right, bottom = page.box(page.page.axes[1])
    seen = picture(page, 1.0)[top:bottom, left_edge:right].astype(int)
    for colour in (style.INK, page.runs.colours[0]):
        assert (np.abs(seen - style.rgb(colour)).max(axis=2) < 40).sum() > 20


@pytest.mark.parametrize(("channel", "label"), [(2, "height z (m)"), (0, "|x − r| (m)")])
def test_a_free_body_that_is_off_most_in_height_has_its_height_as_first_chart(channel, label):
    run = made(smc.Scenario(plant="quadrotor", law="geometric", duration=0.1))
    stays = np.zeros_like(run.x)
    x = stays.copy()
    x[:, channel] += 0.5
    first, _ = charts.strip([dataclasses.replace(run, x=x, r=stays)])
    assert first.label == label
    if channel == 2:
        np.testing.assert_array_equal(first.traces[0].x[:, 0], x[:, 2])
    moving = stays + 0.1 * np.sin(run.t)[:, None]
    first, path = charts.strip([dataclasses.replace(run, x=x, r=moving)])
    assert (first.label, path.quantity) == ("|x − r| (m)", "path")
