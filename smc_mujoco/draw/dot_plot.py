"""Dot plots of a study: the median of each law with its interval, by condition."""

import itertools
import os
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from smc_mujoco.analysis.bootstrap import Interval, median_interval, share_interval
from smc_mujoco.analysis.paired_runs import SETTLES, Columns, sources, values
from smc_mujoco.common.errors import ScenarioError, items_of, shown, unknown
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import panels as drawing
from smc_mujoco.draw import style
from smc_mujoco.draw.page import Handle, Size
from smc_mujoco.draw.pareto import MARKS
from smc_mujoco.mechanisms.plant import catalogue as plants_catalogue
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation.trace import Trace

METRICS = ("settling_time", "ultimate_bound", "tv_rate")
MIN_SIZE = 1e-9  # a size below it is printed as "<1e-9"
LINE_HEIGHT = 0.18  # inches on a full page, height of a law's line


def plot(
    table: Columns,
    path: str | os.PathLike[str] | None = None,
    metrics: Sequence[str] = METRICS,
    title: str | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure | SubFigure:
    """Draw the median of each law over the seeds, with its 95 % bootstrap interval: dots, by condition.

    There is a column of panels per metric and a row per plant. A dot at the right edge, under "never", is a law whose
    median run fails or does not settle. Sizes below 1e-9 are rounding: they are drawn at 1e-9.

    Args:
      table: a study's runs, as `smc.Table.read` returns them.
      metrics: names of metrics, or "settles" for the share of runs that settle.
      path, title, size, format, fig: as in `figure`.

    Raises:
      ScenarioError: no runs, an unknown metric, or as `figure`.
    """
    if isinstance(table, Trace):
        raise ScenarioError(f"table is {shown(table)}: smc.figure draws traces, and this draws the table of a study")
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    names = items_of("metrics", metrics)
    for name in names:
        if name != SETTLES and name not in CATALOGUE:
            raise unknown("metric", name, [SETTLES, *CATALOGUE])
    plants, laws, conditions = (list(dict.fromkeys(table.column(c).tolist())) for c in ("plant", "law", "condition"))
    if not plants or not names:
        raise ScenarioError("no runs or no metrics to draw: give a table with rows, and at least one metric")
    colours = dict(zip(laws, style.law_colours(laws), strict=True))
    marks = dict(zip(laws, itertools.cycle(MARKS), strict=False))
    with style.page(width):
        key, shared = _key(table, colours, marks)
        tall = [0.5 + LINE_HEIGHT * (len(laws) + 1) * len(_conditions_of(table, plant, conditions)) for plant in plants]
        space = pages.head_height(width, key) + style.points(0.6)
        page = pages.blank(width, height or space + style.points(sum(tall)), fig)
        axes = page.subplots(len(plants), len(names), squeeze=False, height_ratios=tall)
        room = 72 * width / len(names) - style.points(50)  # what the axis' numbers and the space beside it leave
        for i, plant in enumerate(plants):
            for k, (name, label) in enumerate(zip(names, _labels(names, plant, room), strict=True)):
                _panel(axes[i, k], table, plant, name, conditions, laws, colours, marks)
                axes[i, k].set_xlabel(label)
                axes[i, k].tick_params(labelleft=k == 0)
            over_never = 1.0 + style.points(1.7 * pages.TEXT_SIZE / 72) / style.points(tall[i])
            above = None if width >= pages.NARROW else over_never
            axes[i, 0].set_title(style.plant_name(plant), y=above, parse_math=False)
        pages.set_head(page, width, title or "Medians by condition", key, shared)
        pages.write(page, paths)
    return page


def _key(table: Columns, colours: Mapping[str, str], marks: Mapping[str, str]) -> tuple[list[Handle], str]:
    """Return the entries of the legend, law by law, and where all gains come from if that is the same."""
    known, key = sources(table), []
    gains, shared = pages.gain_sources([known.get(law, ()) for law in colours])
    for law, source in zip(colours, gains, strict=True):
        look = {"marker": marks[law], "ms": style.points(6), "mec": "none", "lw": style.points(1.5)}
        key.append(Line2D([], [], color=colours[law], label=style.law_name(law) + source, **look))
    return [*key, Line2D([], [], color=style.MUTED, lw=style.points(1.5), label="95 % interval of the median")], shared


def _conditions_of(table: Columns, plant: str, conditions: Sequence[str]) -> list[str]:
    """Return the conditions in which a plant ran, in order."""
    ran = set(table.column("condition")[table.column("plant") == plant].tolist())
    return [condition for condition in conditions if condition in ran]


def _panel(ax: Axes, table: Columns, plant: str, metric: str, conditions, laws, colours, marks) -> None:
    """Draw a metric of one plant: a block of lines per condition, with a dot per law."""
    column, found = values(table, metric), {}
    of_plant, of_law, of_condition = (table.column(name) for name in ("plant", "law", "condition"))
    there = _conditions_of(table, plant, conditions)
    for j, condition in enumerate(there):
        for k, law in enumerate(laws):
            here = column[(of_plant == plant) & (of_law == law) & (of_condition == condition)]
            here = here[~np.isnan(here)]
            if len(here) and metric == SETTLES:
                found[law, j * (len(laws) + 1) + k] = share_interval(float((here == 0.0).mean()), len(here))
            elif len(here):
                one = median_interval(here)
                middle, low, high = (max(v, MIN_SIZE) if v > 0.0 else v for v in one[:3])
                found[law, j * (len(laws) + 1) + k] = Interval(middle, low, high, one.n)
    sizes = [v for one in found.values() for v in one[:3] if np.isfinite(v)]
    if metric != SETTLES and sizes and min(sizes) > 0.0 and max(sizes) > 20.0 * min(sizes):
        ax.set_xscale("log")
        ax.xaxis.set_minor_formatter(NullFormatter())  # numbers between decades would overlap
    for (law, line), one in found.items():
        _dot(ax, one, line, {"color": colours[law], "marker": marks[law], "ms": style.points(6), "mec": "none"})
    if not sizes:
        ax.set_xticks([])
    for j in range(1, len(there)):
        ax.axhline(j * (len(laws) + 1) - 1, color=style.RULE, lw=style.points(0.8))
    middles = [j * (len(laws) + 1) + (len(laws) - 1) / 2 for j in range(len(there))]
    ax.set_yticks(middles, [name.replace("_", " ") for name in there])
    ax.set_ylim(len(there) * (len(laws) + 1) - 1, -1)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)


def _dot(ax: Axes, one: Interval, line: int, look: dict) -> None:
    """Draw a median with its interval. An infinite median is at the right edge, under "never"."""
    never = {"transform": ax.get_yaxis_transform(), "clip_on": False}
    if np.isfinite(one.median):
        ax.plot(one.median, line, **look)
    else:
        ax.plot(1.0, line, **look | {"mfc": style.PAPER, "mec": look["color"]}, **never)
        drawing.note(ax, "never")
    if np.isfinite(one.low) and np.isfinite(one.high):
        ax.plot([one.low, one.high], [line, line], color=look["color"], lw=style.points(1.5))
    elif np.isfinite(one.low):  # up to "never"
        ax.plot(one.low, line)  # nothing is seen: the axis comprises the interval
        look = {"arrowstyle": "-", "color": look["color"], "lw": style.points(1.5), "ls": ":"}
        ax.annotate("", (1.0, line), (one.low, line), ("axes fraction", "data"), "data", arrowprops=look)


def _labels(metrics: Sequence[str], plant: str, room: float) -> list[str]:
    """Return the labels of a row of panels, all in two lines if one is wider than `room`, in points."""
    labels = [_label(metric, plant) for metric in metrics]
    if any(style.width(label, style.points(pages.TEXT_SIZE)) > room for label in labels):
        return [label.replace(" (", "\n(").replace(" that", "\nthat") for label in labels]
    return labels


def _label(metric: str, plant: str) -> str:
    """Return a metric's label with its unit on a plant."""
    if metric == SETTLES:
        return "share of runs that settle"
    known = plants_catalogue().get(plant)
    unit = CATALOGUE[metric].unit_for(known.unit).replace("^2", "²").replace(" ", "·") if known else ""
    return CATALOGUE[metric].label + (f" ({unit})" if unit not in ("", "1") else "")
