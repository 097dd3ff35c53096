"""Ticks of horizontal axes: labels do not touch, and axes that have their own ticks keep them."""

import itertools

import pytest
from matplotlib.figure import Figure

from smc_mujoco.draw import page as pages
from smc_mujoco.draw import panels, style

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("width", [1.0, 1.8, 3.5, 12.0])
@pytest.mark.parametrize(
    ("low", "high"),
    [
        (0.0, 1.0),
        (0.0, 0.002),
        (0.0, 3.0),
        (-60.0, 0.0),
        (99.998, 100.001),
    ],
)
def test_labels_do_not_touch(width, low, high):
    with style.page(3.5):
        page = Figure(figsize=(width, 1.0))
        ax = page.add_axes((0.1, 0.4, 0.8, 0.5), xlim=(low, high))
        pages.space_ticks(page)
        page.draw_without_rendering()
    labels = []
    for tick in ax.xaxis.get_major_ticks():
        if low <= tick.get_loc() <= high:
            labels.append(tick.label1)
    boxes = sorted((label.get_window_extent() for label in labels), key=lambda box: box.x0)
    assert 1 <= len(boxes) <= pages.MAX_TICKS + 1
    assert len(boxes) >= 2 or width == 1.0
    for label_box, next_box in itertools.pairwise(boxes):
        assert label_box.x1 < next_box.x0


def test_ticks_that_were_set_and_logarithmic_axes_stay():
    page = Figure()
    linear_axes, log_axes = page.subplots(2)
    linear_axes.set_xticks([0.1, 0.2])
    log_axes.set(xscale="log", xlim=(1.0, 1e4))
    before = log_axes.get_xticks()
    pages.space_ticks(page)
    assert linear_axes.get_xticks() == pytest.approx([0.1, 0.2])
    assert log_axes.get_xticks() == pytest.approx(before)


@pytest.mark.parametrize(
    "ends", [(1e-6, 1e3), (0.25, 4.0), (0.9, 13.0), (0.0016, 0.0056), (0.016, 0.024), (40.0, 70.0)]
)
def test_a_logarithmic_axis_has_two_numbers_at_least_in_one_line(ends):
    page = Figure(figsize=(3.0, 1.0))
    ax = page.add_axes((0.1, 0.4, 0.8, 0.5), xscale="log", xlim=ends)
    panels.number_decades(ax.xaxis, ends)
    page.draw_without_rendering()
    labels = []
    for label in ax.get_xticklabels(which="both"):
        if label.get_text() and ends[0] <= label.get_position()[0] <= ends[1]:
            labels.append(label)
    assert len(labels) >= 2
    tops = [label.get_window_extent().y1 for label in labels]
    assert max(tops) - min(tops) < 0.5  # pixels
