"""The indices of a sensitivity as bars, beside the runs over the two axes that tell most.

A bar is dark up to the first-order index and light up to the total index, with its interval. On the
right a dot is a run, darker the worse its score is, and a cross a run that fails. A dashed line
bounds the first region of failures.
"""

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Patch, Rectangle

from smc_mujoco.draw import colouring, shared_axes, style, wording
from smc_mujoco.draw import page as pages
from smc_mujoco.draw.page import Handle, Size
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.robustness.sobol import CHANCE, Cut, SobolResult, Space, in_words

ROW_HEIGHT = 0.42  # inches, of an axis
MIN_HEIGHT = 3.6  # of the panels
PALE_SHARE = 0.6  # of white in a bar's light part: chosen
DOT_SIZE = 26.0  # points squared, of a run
TONES = 12  # of runs, from the best score to the worst
LIGHTEST = 80.0  # lightness of the best in CIELAB: chosen


def draw_sensitivity(
    found: SobolResult,
    path: str | os.PathLike[str] | None = None,
    title: str | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure:
    """Draw a sensitivity; arguments as in `figure`."""
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    colour = colouring.law_colour(found.scenario.law)
    pale = style.mixed(colour, style.PAPER, PALE_SHARE)
    name = wording.law_name(found.scenario.law)
    about = f"What breaks {name}: {wording.plant_name(found.scenario.plant)}"
    head = wording.titled(title, about)
    with style.page(width):
        worse = f"a run, darker: worse {CATALOGUE[found.metric].label}"
        handles: list[Handle] = [
            Patch(facecolor=colour, label="alone"),
            Patch(facecolor=pale, label="with others, 95 % interval"),
            pages.entry(worse, colour, lw=0, marker="o"),
        ]
        if found.failed.any():
            handles.append(pages.entry("a run that fails", style.INK, lw=0, marker="x"))
        if found.regions:
            border = pages.entry("region of failures", style.INK, ls="--", lw=style.points(1.2))
            handles.append(border)
        tall = style.points(max(MIN_HEIGHT, 0.9 + ROW_HEIGHT * len(found.axes)))
        rows, columns = (2, 1) if width < pages.NARROW else (1, 2)
        tall = pages.head_height(width, handles, bool(head)) + rows * tall
        page = pages.blank(width, height or tall, fig)
        bars, runs = page.subplots(rows, columns)
        _bars(bars, found, colour, pale)
        _runs(runs, found, colour)
        pages.set_head(page, width, head, handles)
        if found.checked:
            page.supxlabel(found.checked, wrap=True, color=style.MUTED, size="small")
        return pages.write_page(page, paths)


def _bars(ax: Axes, found: SobolResult, colour: str, pale: str) -> None:
    """Draw both indices of each axis, the largest at the top."""
    rows = np.arange(len(found.axes))
    first = np.array([axis.first.median for axis in found.axes])
    total = np.array([axis.total[:3] for axis in found.axes])
    median, low, high = 100 * np.clip(total, 0.0, 1.0).T
    ax.barh(rows, median, 0.62, color=pale)
    ax.barh(rows, 100 * np.clip(first, 0.0, 1.0), 0.3, color=colour)
    ax.hlines(rows, low, high, color=style.INK, lw=style.points(1.2))
    ax.set_yticks(rows, [in_words(axis.name) for axis in found.axes], parse_math=False)
    ax.set(
        xlim=(0.0, 100.0), xlabel=f"share of the variance of {CATALOGUE[found.metric].label} (%)"
    )
    ax.invert_yaxis()
    ax.grid(visible=False, axis="y")


def _runs(ax: Axes, found: SobolResult, colour: str) -> None:
    """Draw independent runs over the axes of the first region, then those of the largest
    indices.
    """
    space = found.space
    places = []
    if found.regions:
        places = [cut.axis for cut in found.regions[0].cuts]
    for axis in found.axes:
        place = space.names.index(axis.name)
        if axis.name != CHANCE and place not in places:
            places.append(place)
    columns = []
    factors = []
    for i, axis in zip(places, (ax.xaxis, ax.yaxis), strict=False):
        _, high, unit = space.ends[i]
        factor, unit = shared_axes.prefixed(high, unit)
        factors.append(factor)
        columns.append(factor * space.column(i, found.shares))
        axis.set_label_text(f"{in_words(space.names[i])} ({unit or 'of nominal'})")
        constant = space.columns[i]
        if constant and constant.geometric:
            axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    if len(columns) < 2:  # one axis has the score beside it
        columns.append(found.values)
        unit = found.unit and f" ({found.unit})"
        ax.set_ylabel(f"{CATALOGUE[found.metric].label}{unit}")
    order = np.argsort(found.values)  # the worst on top
    shades = np.array(colouring.ramp(colour, TONES, LIGHTEST))
    tones = np.empty(len(order), object)
    steps = np.linspace(0.0, TONES - 0.5, len(order)).astype(int)
    tones[order] = shades[steps]
    tones[found.failed] = style.INK
    for marker, kind in (("o", ~found.failed), ("x", found.failed)):
        picked = order[kind[order]]
        look = {"c": tones[picked].tolist(), "marker": marker, "s": style.points(DOT_SIZE)}
        ax.scatter(columns[0][picked], columns[1][picked], **look)
    if found.regions:
        _border(ax, found.regions[0].cuts, places, factors, space)


def _border(
    ax: Axes, cuts: Sequence[Cut], at: list[int], factors: list[float], space: Space
) -> None:
    """Draw the border of a region."""
    ends = [list(ax.get_xlim()), list(ax.get_ylim())]
    for cut in cuts:
        k = at.index(cut.axis)
        if cut.low > 0.0:
            ends[k][0] = factors[k] * space.value(cut.axis, cut.low)
        if cut.high < 1.0:
            ends[k][1] = factors[k] * space.value(cut.axis, cut.high)
    (near, far), (low, high) = ends
    look = {"fill": False, "ls": "--", "ec": style.INK, "lw": style.points(1.2)}
    ax.add_patch(Rectangle((near, low), far - near, high - low, **look))
