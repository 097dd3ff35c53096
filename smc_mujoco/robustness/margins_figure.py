"""Margins as bars: a panel for each kind and plant, a bar for each law.

A bar begins at the level without any effect, such as the nominal mass, and ends at the largest
level that is tolerated. The line beyond it ends at the smallest level
known not to be. A bar whose number has "≥" ends where the search did, and has no line.
"""

import math
import os
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Patch

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.text import number
from smc_mujoco.draw import colouring, shared_axes, style, wording
from smc_mujoco.draw import page as pages
from smc_mujoco.draw.page import Handle, Size

ROW_HEIGHT = 0.3  # inches on a full page, of a law
AROUND = 0.95  # the same, of a panel's ticks, label and title
ACROSS = 3  # panels side by side, at most
NUMBER_ROOM = 1.35  # of the longest bar: the number beside it has room
THEORY = {"marker": "D", "mfc": style.PAPER, "mec": style.INK, "lw": 0.0}


class MarginBar(NamedTuple):
    """A margin as it is drawn: of a law on a plant, both by their names."""

    plant: str
    law: str
    kind: str  # in words
    unit: str
    start: float  # the level without any effect
    value: float  # NaN where the unchanged run fails
    resolution: float  # up to the first level that is not tolerated; 0 if all are
    limit: float  # by linear theory; NaN without one

    @property
    def beyond(self) -> float:
        """The smallest level known not to be tolerated."""
        return (self.start if math.isnan(self.value) else self.value) + self.resolution

    def text(self, factor: float) -> str:
        """Return what is written beside the bar, where values are multiplied by a factor."""
        if math.isnan(self.value):
            return f"fails at {self.start:g}"
        return f"{'' if self.resolution else '≥ '}{number(factor * self.value)}"


def draw_margins(
    found: Sequence[MarginBar],
    path: str | os.PathLike[str] | None = None,
    title: str | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure:
    """Draw margins; arguments as in `figure`."""
    if not found:
        raise ScenarioError("no margins to draw: give at least one")
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    plants = list(dict.fromkeys(bar.plant for bar in found))
    kinds = list(dict.fromkeys(bar.kind for bar in found))
    across = 1 if width < pages.NARROW else min(ACROSS, len(kinds))
    down = math.ceil(len(kinds) / across)
    with style.page(width):
        key = _key(found)
        head = wording.titled(title, f"Margins: {wording.heading(plants)}")
        rows = _most_laws(found)
        tall = style.points(AROUND + ROW_HEIGHT * rows) * down * len(plants)
        page = pages.blank(width, height or pages.head_height(width, key, bool(head)) + tall, fig)
        axes = page.subplots(down * len(plants), across, squeeze=False)
        for plant, of_plant in zip(plants, np.split(axes, len(plants)), strict=True):
            if len(plants) > 1:
                of_plant[0, 0].set_title(wording.plant_name(plant), parse_math=False)
            for ax, kind in zip(of_plant.flat, kinds, strict=False):
                here = [entry for entry in found if (entry.plant, entry.kind) == (plant, kind)]
                _panel(ax, here, named=ax in of_plant[:, 0])
            for ax in of_plant.flat[len(kinds) :]:
                ax.set_axis_off()
        pages.set_head(page, width, head, key)
        pages.space_ticks(page)
        return pages.write_page(page, paths)


def _most_laws(found: Sequence[MarginBar]) -> int:
    """Return the largest number of bars of a panel."""
    counts: dict[tuple[str, str], int] = {}
    for bar in found:
        panel = bar.plant, bar.kind
        counts[panel] = counts.get(panel, 0) + 1
    return max(counts.values())


def _key(found: Sequence[MarginBar]) -> list[Handle]:
    """Return the entries of the legend."""
    key: list[Handle] = [Patch(facecolor=style.MUTED, label="tolerated")]
    if any(bar.resolution for bar in found):
        words = "not known, up to the first level not tolerated"
        key.append(pages.entry(words, style.INK, lw=style.points(1.5)))
    if any(math.isfinite(bar.limit) for bar in found):
        key.append(pages.entry("limit by linear theory", style.INK, **THEORY))
    return key


def _panel(ax: Axes, bars: Sequence[MarginBar], named: bool) -> None:
    """Draw margins of one kind on one plant, the first at the top; laws are written beside them if
    `named`.
    """
    start = bars[0].start
    ends = np.array([start if math.isnan(bar.value) else bar.value for bar in bars])
    beyond = np.array([bar.beyond for bar in bars])
    limits = np.array([bar.limit for bar in bars])
    reached = np.fmax(beyond, limits)
    longest = float(reached.max()) - start
    unit = bars[0].unit
    factor = 1.0
    if unit != "1":
        factor, unit = shared_axes.prefixed(start + longest, unit)
    rows = np.arange(len(bars))
    colours = colouring.law_colours([bar.law for bar in bars])
    start *= factor
    ax.barh(rows, factor * ends - start, 0.6, left=start, color=colours)
    ax.axvline(start, color=style.MUTED, lw=style.points(0.8))
    ax.hlines(rows, factor * ends, factor * beyond, color=style.INK, lw=style.points(1.5))
    ax.plot(factor * limits, rows, ms=style.points(5), **THEORY)
    for row, bar, end in zip(rows, bars, factor * reached, strict=True):
        beside = {"xytext": (style.points(7), 0), "textcoords": "offset points"}
        look = {"va": "center", "color": style.INK, "fontsize": style.points(9.5)}
        ax.annotate(bar.text(factor), (end, row), **beside, **look)
    room = NUMBER_ROOM * factor * longest
    ax.set_xlim(0.0, start + (room or 1.0))
    ax.set_ylim(len(rows) - 0.5, -0.5)
    unit = unit.replace(" ", "·")
    ax.set_xlabel(bars[0].kind if unit == "1" else f"{bars[0].kind} ({unit})")
    names = wording.distinct([wording.law_name(bar.law) for bar in bars])
    ax.set_yticks(rows, names if named else [""] * len(rows), parse_math=False)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
