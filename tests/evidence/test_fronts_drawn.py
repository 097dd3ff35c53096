"""The figure of docs/where_sliding_mode_loses.md: every law is drawn, and the best rival is that."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from benchmarks import fronts_figure, fronts_sentences
from benchmarks.fronts_sentences import LAWS, RIVALS, ROWS
from smc_mujoco.draw import style

POINTS = fronts_sentences.read(Path(fronts_figure.__file__).with_name("fronts.json"))
PLANTS = ("duffing", "inverted_pendulum", "van_der_pol")


@pytest.fixture(scope="module")
def figure():
    drawn = fronts_figure.drawn(POINTS, LAWS)
    drawn.draw_without_rendering()
    return drawn


def shown(plant, row):
    """The laws' errors in a panel, at its lower edge where they are below it."""
    place = fronts_figure.Panel(plant, *row)
    points = [one for one in POINTS if fronts_sentences.of_figure(one) and one["model"] == "none"]
    return fronts_figure.fronts(points, place, LAWS)


def test_every_law_is_drawn_in_every_panel_and_no_mark_is_outside_its_frame(figure):
    looks = fronts_figure.looks(LAWS)
    for ax, (plant, row) in zip(figure.axes, itertools.product(PLANTS, ROWS), strict=True):
        for law, front in shown(plant, row).items():
            look = looks[law]["marker"], looks[law]["color"]
            its = [line for line in ax.lines if (line.get_marker(), line.get_color()) == look]
            assert len(its) == bool(front), (plant, row, law)
            for line in its:
                assert sorted(front) == list(line.get_xdata())
                known = [max(front[level], fronts_figure.LEAST) for level in sorted(front)]
                assert known == list(line.get_ydata())
        heights = np.concatenate([np.asarray(line.get_ydata()) for line in ax.lines])
        assert fronts_figure.LEAST <= heights.min() <= heights.max() <= fronts_figure.MOST


def test_the_thick_line_is_the_least_error_of_all_rivals(figure):
    for ax, (plant, row) in zip(figure.axes, itertools.product(PLANTS, ROWS), strict=True):
        (thick,) = [line for line in ax.lines if line.get_linewidth() > 2.0]
        assert thick.get_color() == style.INK
        found = shown(plant, row)
        for level, error in zip(thick.get_xdata(), thick.get_ydata(), strict=True):
            errors = [found[law][level] for law in RIVALS if level in found[law]]
            assert error == max(min(errors), fronts_figure.LEAST)
        levels = set().union(*(found[law] for law in RIVALS))
        assert sorted(levels) == list(thick.get_xdata())


def test_sliding_laws_have_colours_and_rivals_one_grey():
    looks = fronts_figure.looks(LAWS)
    colours = [looks[law]["color"] for law in LAWS if law not in RIVALS]
    assert len(set(colours)) == len(colours) == 4
    (grey,) = {looks[law]["color"] for law in RIVALS}
    assert grey not in colours
    marks = [look["marker"] for look in looks.values()]
    assert len(set(marks)) == len(LAWS)
    assert len(set(marks) & set("o8hHp.")) == 1, "one mark looks like a circle"


def test_the_axis_begins_just_below_the_floor(figure):
    for ax in figure.axes:
        low, high = ax.get_ylim()
        assert fronts_sentences.FLOOR / 3.0 < low < fronts_sentences.FLOOR < high


def test_the_figure_is_no_higher_than_wide_and_its_words_are_on_the_page(figure):
    assert figure.bbox.height <= figure.bbox.width
    for ax in figure.axes:
        box = ax.get_tightbbox()
        assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.legends[0].get_window_extent().y0
