"""The figure of docs/what_wins_under_friction.md: no row is empty, and no law hides another."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.text import Text

from benchmarks import friction_figure
from benchmarks.friction import LAWS
from benchmarks.friction_figure import JOINTS, MOST, RESTS
from benchmarks.friction_plants import joints
from smc_mujoco.draw import style

POINTS = json.loads(Path(friction_figure.__file__).with_name("friction.json").read_text())
NONE, LATE = "no gains admitted", "gains only at R 100"


@pytest.fixture(scope="module")
def rests():
    """The runs of the boundary layer, which rests far off on one joint and chatters on the other;
    they stand for those of all laws.
    """
    found = {}
    for joint in JOINTS:
        trace = friction_figure.to_rest(POINTS, joint, "boundary_layer")
        found |= {(joint, law): trace for law in RESTS}
    return found


@pytest.fixture(scope="module")
def figure(rests):
    drawn = friction_figure.drawn(POINTS, rests)
    drawn.draw_without_rendering()
    return drawn


def of_row(ax, place):
    """The errors that a row's marks show, and its words."""
    words = [text.get_text() for text in ax.texts if abs(text.get_position()[1] - place) < 0.4]
    errors = set()
    for line in ax.lines:
        heights = np.asarray(line.get_ydata())
        if len(heights) and abs(heights[0] - place) < 0.4:
            errors |= set(np.asarray(line.get_xdata()))
    return errors, words


def test_a_row_has_the_errors_of_the_file_or_says_why_it_has_none(figure):
    silent = {("rail", "classical"): NONE}
    silent |= {("geared", law): LATE for law in ("hodob", "super_twisting")}
    for law in ("pd", "implicit_super_twisting", "boundary_layer", "classical"):
        silent["geared", law] = NONE
    for ax, joint in zip(figure.axes[:2], JOINTS, strict=True):
        for place, law in enumerate(LAWS):
            errors, words = of_row(ax, place)
            known = friction_figure.errors_of(POINTS, joint, law)
            shown = {error for (level, _), error in known.items() if level < 100.0}
            words = [one for one in words if "gains" in one]
            assert "".join(words) == silent.get((joint, law), "")
            assert bool(shown) != bool(words)
            assert errors - {MOST} == shown


def test_a_bar_of_wrong_compensation_is_as_dark_as_a_line_and_tied_to_its_diamond(figure):
    drawn = 0
    for ax, joint in zip(figure.axes[:2], JOINTS, strict=True):
        for place, law in enumerate(LAWS):
            known = friction_figure.errors_of(POINTS, joint, law)
            wrong = {error for (_, share), error in known.items() if share in (0.7, 1.3)}
            if not wrong:
                continue
            right = known[10.0, 1.0]
            its = []
            for line in ax.lines:
                if any(place < height < place + 0.4 for height in line.get_ydata()):
                    its.append(line)
            (mark,) = [line for line in its if line.get_marker() == "D"]
            (bar,) = [line for line in its if set(line.get_xdata()) == wrong]
            (tie,) = [line for line in its if set(line.get_xdata()) == {right} | wrong]
            assert tie.get_linewidth() < bar.get_linewidth()
            assert tie.get_color() == bar.get_color() == mark.get_color()
            assert bar.get_alpha() is None
            assert 1.05 / (style.luminance(bar.get_color()) + 0.05) >= 3.0, law
            assert mark.get_zorder() > bar.get_zorder()
            assert mark.get_markeredgecolor() == style.PAPER, "seen on its bar"
            drawn += 1
    assert drawn == 12


def test_no_line_of_the_grid_is_seen_through_words(figure):
    for ax in figure.axes:
        for text in ax.texts:
            if "gains" in text.get_text() or "rests" in text.get_text():
                box = text.get_bbox_patch()
                assert box is not None
                assert to_hex(box.get_facecolor(), keep_alpha=True).upper() == style.PAPER + "FF"


def test_an_error_beyond_the_axis_has_an_arrow_and_its_number(figure):
    ax = figure.axes[0]
    arrows = [line for line in ax.lines if line.get_marker() == ">"]
    assert [line.get_xdata()[0] for line in arrows] == [MOST]
    assert "1487" in of_row(ax, LAWS.index("implicit_super_twisting"))[1]


def test_what_chatters_is_its_mean_in_a_pale_band_and_what_is_far_is_within_the_axis(figure, rests):
    lanes = np.reshape(figure.axes[2:], (len(RESTS), len(JOINTS)))
    for (column, joint), lane in itertools.product(enumerate(JOINTS), lanes):
        ax = lane[column]
        bands = [one for one in ax.collections if isinstance(one, PolyCollection)]
        assert len(bands) == (joint == "geared")
        trace = rests[joint, "boundary_layer"]
        error = trace.e[trace.t >= 2.0, 0] / joints()[joint].count
        (line,) = ax.lines
        low, high = ax.get_ylim()
        assert low < error.min() < error.max() < high
        if bands:
            assert np.ptp(line.get_ydata()) < 0.5 * np.ptp(error)
            assert np.max(line.get_path().vertices[:, 1]) < error.max()
        said = [text.get_text() for text in ax.texts if "rests" in text.get_text()]
        assert said == ["rests at −75"] * (joint == "rail")


def test_words_are_on_the_page_and_do_not_touch(figure):
    boxes = []
    for text in figure.findobj(Text):
        words = text.get_text().strip()
        box = text.get_window_extent()
        # labels on an axis's other side have no place, and powers of ten may be beyond the axis
        if words and "$" not in words and box.x0 > 0.0:
            boxes.append((words, box))
    for words, box in boxes:
        assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1, words
        assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.bbox.y1, words
    for (one, box), (other, its) in itertools.combinations(boxes, 2):
        assert not box.overlaps(its), (one, other)
