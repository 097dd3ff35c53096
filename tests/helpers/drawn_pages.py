"""What every page of figures has, whatever it shows."""

import re

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Text

from smc_mujoco.draw import style

# a disturbance that all runs have is named above its panel
NEUTRAL = {style.INK, style.MUTED, style.RULE, style.PAPER, style.GRID, style.DISTURBANCE}
NEUTRAL = set(map(to_hex, NEUTRAL))
UNIT = re.compile(r"\((?:s|ms|1/s|s²|unit of s|[µm]?(?:m|rad|N|N·m|V)(?:/s)?)\)")
UNITLESS = re.compile(r"share of .*|(real|imaginary) part|.*\bs")  # also s, whose unit is the law's


def places(line: Line2D) -> np.ndarray:
    """The points of a line or a mark, (points, 2)."""
    return np.array(line.get_xydata(), float)


def every(page) -> list[Axes]:
    """All axes that show data, also those within others."""
    drawn_axes = list(page.axes)
    for ax in page.axes:
        drawn_axes += ax.child_axes
    return [ax for ax in drawn_axes if ax.lines or ax.collections]


def has_units_names_and_places(page: Figure) -> None:
    """Every axis has its unit, every colour its name, every mark a place."""
    page.draw_without_rendering()
    outer = [ax for ax in page.axes if ax.get_visible()]
    words = {label for ax in outer for label in (ax.get_xlabel(), ax.get_ylabel())} - {""}
    for label in words:
        assert UNIT.search(label) or UNITLESS.fullmatch(label)
    assert all(ax.get_ylabel() for ax in outer)
    labelled = [ax for ax in every(page) if ax.get_xlabel()]
    for ax in every(page):
        assert ax in labelled or any(
            np.allclose(ax.get_xlim(), labelled_axes.get_xlim()) for labelled_axes in labelled
        )
        low, high = sorted(ax.get_xlim())
        for line in ax.lines:
            if line.get_transform() == ax.transData and len(places(line)) == 1:
                assert low <= places(line)[0, 0] <= high
        for text in ax.get_children():
            if isinstance(text, Text):  # also a title
                box = text.get_window_extent()
                assert 0.0 <= box.x0 <= box.x1 <= page.bbox.x1
    entries = set()
    legends: list = page.findobj(Legend)
    for legend in legends:
        assert all(text.get_text() for text in legend.get_texts())
        for handle in legend.legend_handles:
            entries.add(
                to_hex(handle.get_color() if isinstance(handle, Line2D) else handle.get_facecolor())
            )
    drawn = {to_hex(line.get_color()) for ax in every(page) for line in ax.lines} - NEUTRAL
    assert drawn <= entries
