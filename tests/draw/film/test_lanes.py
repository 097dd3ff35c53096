"""Where bands of several laws would hide each other, each law's u has a lane, which says how far it
swings.
"""

import dataclasses
import itertools

import numpy as np
import pytest
from helpers.films import picture, sheet
from helpers.runs import at_defaults
from helpers.sketch import made
from matplotlib.figure import Figure

import smc_mujoco as smc
from smc_mujoco.draw import lanes, panels, shared_axes, style

SIZE = (1280, 720)
LAWS = ("observer_free", "classical", "adaptive")


def swinging(law, amplitude):
    """A run whose u switches between +-amplitude at every sample after its first tenth."""
    trace = made(smc.Scenario(plant="duffing", law=at_defaults(law), duration=1.0))
    signs = np.where(np.arange(len(trace.t)) % 2, 1.0, -1.0) * (trace.t > 0.1)
    return dataclasses.replace(trace, u=(amplitude * signs)[:, None])


@pytest.fixture
def drawn(monkeypatch):
    said = []
    plain = lanes.tell_swing
    monkeypatch.setattr(lanes, "tell_swing", lambda *row: (said.append(row), plain(*row))[1])
    traces = []
    for law, amplitude in zip(LAWS, (0.0, 2.0, 6.0), strict=True):
        traces.append(swinging(law, amplitude))
    return sheet(traces, LAWS, SIZE), said


def test_each_law_has_a_lane_that_says_its_swing(drawn):
    _, rows = drawn
    assert [lane.texts[-1].get_text() for lane, *_ in rows] == ["smooth", "±2", "±6"]
    tops = [lane.get_window_extent().y1 for lane, *_ in rows]
    assert tops == sorted(tops, reverse=True)
    for (lane, *_), (below, *_) in itertools.pairwise(rows):
        assert below.get_window_extent().y1 < lane.get_window_extent().y0


def test_a_swing_is_told_in_the_unit_of_the_panel(drawn):
    """A panel in mN said 0.006."""
    _, rows = drawn
    traces = [dataclasses.replace(trace, u=1e-3 * trace.u) for _, trace, _, _ in rows]
    said = [row.axes.texts[-1].get_text() for row in sheet(traces, LAWS, SIZE).moving[1:]]
    assert said == ["smooth", "±2", "±6"]


@pytest.mark.quick
def test_a_law_that_switches_in_few_samples_has_a_lane():
    run = made(
        smc.Scenario(
            plant="duffing",
            law=smc.law("pid"),
            duration=1.0,
        )
    )
    (group,) = shared_axes.split([run])
    runs = []
    for rate in (90.0, 3.0):
        runs.append(dataclasses.replace(run, u=np.sign(np.sin(rate * run.t))[:, None]))
    assert lanes.in_lanes(panels.Panel("u", group, runs))
    assert not lanes.in_lanes(panels.Panel("u", group, runs[1:] * 2))


def test_two_laws_that_chatter_are_told_apart(drawn):
    """In the middle of each lane the height of the band is in proportion to the swing, in the law's
    colour.
    """
    made_of, rows = drawn
    frame = picture(made_of, 1.0).astype(int)
    heights = []
    for lane, _, colour, _ in rows:
        box = lane.get_window_extent()
        column = frame[int(SIZE[1] - box.y1) : int(SIZE[1] - box.y0), int(0.5 * (box.x0 + box.x1))]
        paper = np.array([255.0] * 3)
        ink = np.array(style.rgb(colour), float)
        band_colour = paper + lanes.LANE_BAND * (ink - paper)
        heights.append(int((np.abs(column - band_colour).max(axis=1) < 12).sum()))
    assert heights[0] <= 2
    assert heights[2] == pytest.approx(3.0 * heights[1], rel=0.25)


def test_the_cursor_passes_behind_words():
    runs = [
        made(smc.Scenario(plant="duffing", law=at_defaults(law), duration=1.0)) for law in LAWS[:2]
    ]
    same = sheet(runs, LAWS[:2], SIZE)
    hidden = 0
    for moving in same.moving:
        for text in moving.axes.texts:
            box = text.get_window_extent()
            inverted = moving.axes.transData.inverted()
            time, _ = inverted.transform(((box.x0 + box.x1) / 2, box.y0))
            frame = picture(same, float(time)).astype(int)
            rows = np.s_[SIZE[1] - int(box.y1) + 1 : SIZE[1] - int(box.y0) - 1]
            middle = round((box.x0 + box.x1) / 2)
            cursor = np.array(style.rgb(style.MUTED))
            cursor_rows = (
                np.abs(frame[:, middle - 2 : middle + 3] - cursor).max(axis=2).min(axis=1) < 20
            )
            assert cursor_rows.sum() > 20  # beside the words
            assert cursor_rows[rows].sum() < 0.5 * (rows.stop - rows.start)
            hidden += 1
    assert hidden


@pytest.mark.parametrize(("peak", "top", "said"), [(9.0, 1.16, ["up to 9 N"]), (1.5, 7.0, [])])
def test_a_brief_peak_is_told_and_leaves_room_for_what_lasts(peak, top, said):
    trace = swinging("classical", 1.0)
    u = np.abs(trace.u)
    u[5] = peak
    (group,) = shared_axes.split([trace])
    panel = panels.Panel("largest", group, [dataclasses.replace(trace, u=u)])
    ax = Figure().add_subplot(ylim=(0.0, 7.0))
    lanes.cut_peak(ax, panel)
    assert ax.get_ylim()[1] == pytest.approx(top)
    assert [words.get_text() for words in ax.texts] == said
