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
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from smc_mujoco.analysis.sensitivity import CHANCE, Cut, SobolResult, Space, in_words
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.draw.page import Handle, Size
from smc_mujoco.metrics.catalogue import CATALOGUE

ROW_HEIGHT, MIN_HEIGHT = 0.42, 3.6  # inches, of an axis, and of the panels
PALE_SHARE = 0.6  # of white in a bar's light part: chosen
DOT_SIZE = 26.0  # points squared, of a run


def draw(
    found: SobolResult,
    path: str | os.PathLike[str] | None = None,
    title: str | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure | SubFigure:
    """Draw a sensitivity; arguments as in `figure`."""
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    colour = style.law_colour(found.scenario.law)
    pale = style.mixed(colour, style.PAPER, PALE_SHARE)
    name = style.law_name(found.scenario.law)
    handles: list[Handle] = [
        Patch(facecolor=colour, label="alone"),
        Patch(facecolor=pale, label="with others, 95 % interval"),
        Line2D(
            [],
            [],
            ls="",
            marker="o",
            color=colour,
            label=f"a run, darker: worse {CATALOGUE[found.metric].label}",
        ),
        *(
            [Line2D([], [], ls="", marker="x", color=style.INK, label="a run that fails")]
            * bool(found.failed.any())
        ),
    ]
    with style.page(width):
        head = pages.head_height(width, handles)
        tall = max(MIN_HEIGHT, 0.9 + ROW_HEIGHT * len(found.axes))
        page = pages.blank(width, height or head + style.points(tall), fig)
        bars, runs = page.subplots(1, 2, width_ratios=[1.0, 1.1])
        _bars(bars, found, colour, pale)
        _runs(runs, found, colour)
        reported = f"What breaks {name}: {style.plant_name(found.scenario.plant)}"
        pages.set_head(page, width, title or reported, handles)
        pages.write(page, paths)
    return page


def _bars(ax: Axes, found: SobolResult, colour: str, pale: str) -> None:
    """Draw both indices of each axis, the largest at the top."""
    rows = np.arange(len(found.axes))
    first, total = ([getattr(axis, kind) for axis in found.axes] for kind in ("first", "total"))
    ax.barh(rows, [100 * max(its.median, 0.0) for its in total], 0.62, color=pale)
    ax.barh(rows, [100 * min(max(its.median, 0.0), 1.0) for its in first], 0.3, color=colour)
    ends = np.clip([(its.low, its.high) for its in total], 0.0, 1.0) * 100
    ax.hlines(rows, *ends.T, color=style.INK, lw=style.points(1.2))
    ax.set_yticks(rows, [in_words(axis.name) for axis in found.axes])
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
    if found.regions:
        wanted = [cut.axis for cut in found.regions[0].cuts]
    else:
        wanted = []
    ranked = [space.names.index(axis.name) for axis in found.axes if axis.name != CHANCE]
    at = [*wanted, *(i for i in ranked if i not in wanted)][:2]
    scales = [style.prefixed(space.ends[i][1], space.ends[i][2]) for i in at]
    columns = [
        factor * space.column(i, found.shares) for i, (factor, _) in zip(at, scales, strict=True)
    ]
    if len(at) < 2:  # one axis has the score beside it
        columns.append(found.values)
        ax.set_ylabel(f"{CATALOGUE[found.metric].label} ({found.unit})")
    order = np.argsort(found.values)  # the worst on top
    place = np.empty(len(order))
    place[order] = np.linspace(0.0, 1.0, len(order))
    shades = np.array(style.ramp(colour, 12))
    tone = shades[np.minimum((place * len(shades)).astype(int), len(shades) - 1)]
    for marker, kind, of in (
        ("o", ~found.failed, tone),
        ("x", found.failed, np.full(len(tone), style.INK)),
    ):
        picked = order[kind[order]]
        ax.scatter(
            columns[0][picked],
            columns[1][picked],
            style.points(DOT_SIZE),
            of[picked].tolist(),
            marker=marker,
        )
    for k, (i, (_, unit)) in enumerate(zip(at, scales, strict=True)):
        (ax.set_xlabel, ax.set_ylabel)[k](f"{in_words(space.names[i])} ({unit or 'of nominal'})")
        if (constant := space.columns[i]) and constant.geometric:
            (ax.set_xscale, ax.set_yscale)[k]("log", base=2)
    if found.regions:
        _border(ax, found.regions[0].cuts, at, [factor for factor, _ in scales], space)


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
    (left, right), (low, high) = ends
    border = Rectangle(
        (left, low),
        right - left,
        high - low,
        fill=False,
        ls="--",
        ec=style.INK,
        lw=style.points(1.2),
    )
    ax.add_patch(border)
