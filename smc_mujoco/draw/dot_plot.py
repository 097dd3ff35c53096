"""Dot plots of a study: the median of each law with its interval, by condition."""

import itertools
import os
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from smc_mujoco.analysis.bootstrap import MIN_INTERVAL_SAMPLES, Interval, median_of, share_interval
from smc_mujoco.analysis.paired_runs import (
    GROUPS,
    SETTLES,
    Columns,
    by_row,
    groups,
    is_table,
    scenarios,
    sources,
    unit_of_x,
)
from smc_mujoco.analysis.ranking import linked
from smc_mujoco.common.errors import ScenarioError, items_of, shown, unknown
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import panels as drawing
from smc_mujoco.draw import style
from smc_mujoco.draw.page import Handle, Size
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation.trace import Trace

METRICS = ("settling_time", "ultimate_bound", "tv_rate")
MIN_SIZE = 1e-9  # smaller sizes are drawn at it
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
    """Draw the median of each law over the seeds, with its 95 % bootstrap interval: dots, by
    condition.

    Medians and intervals are those of a leaderboard: of the runs that all laws have. Runs that
    share one of several sets of gains are one sample. There is a column of panels per metric and a
    row per plant. A dot at the right edge, under "never", is a law whose median run fails or does
    not settle. Sizes below 1e-9 are drawn at it.

    Args:
      table: a study's runs, as `smc.Table.read` returns them.
      metrics: names of metrics, or "settles" for the share of runs that settle.
      path, title, size, format, fig: as in `figure`.

    Raises:
      ScenarioError: no runs, an unknown metric, laws without runs in common, or as `figure`.
    """
    if isinstance(table, Trace):
        raise ScenarioError(
            f"table is {shown(table)}: smc.figure draws traces, and this draws the table of a study"
        )
    is_table(table)
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    names = items_of("metrics", metrics)
    for name in names:
        if name != SETTLES and name not in CATALOGUE:
            raise unknown("metric", name, [SETTLES, *CATALOGUE])
    plants, laws, conditions = (
        list(dict.fromkeys(table.column(c).tolist())) for c in ("plant", "law", "condition")
    )
    if not plants or not names:
        raise ScenarioError(
            "no runs or no metrics to draw: give a table with rows, and at least one metric"
        )
    colours = dict(zip(laws, style.law_colours(laws), strict=True))
    marks = dict(zip(laws, itertools.cycle(style.MARKS), strict=False))
    intervals = _intervals(table, names)
    by_plant = {group.name["plant"]: scenarios(table, group) for group in groups(table, GROUPS[:1])}
    units = {plant: unit_of_x(plant, its) for plant, its in by_plant.items()}
    ran = set(zip(table.column("plant").tolist(), table.column("condition").tolist(), strict=True))
    conditions_of = {
        plant: [name for name in conditions if (plant, name) in ran] for plant in plants
    }
    with style.page(width):
        key, shared = _key(
            table, colours, marks, min((interval.n for interval in intervals.values()), default=0)
        )
        tall = [0.5 + LINE_HEIGHT * (len(laws) + 1) * len(conditions_of[plant]) for plant in plants]
        space = pages.head_height(width, key) + style.points(0.6)
        page = pages.blank(width, height or space + style.points(sum(tall)), fig)
        axes = page.subplots(len(plants), len(names), squeeze=False, height_ratios=tall)
        room = 72 * width / len(names) - style.points(
            50
        )  # what the axis' numbers and the space beside it leave
        for i, plant in enumerate(plants):
            for k, (name, label) in enumerate(
                zip(names, _labels(names, units[plant], room), strict=True)
            ):
                of_panel = {}
                for cell, its in intervals.items():
                    if cell[:2] == (name, plant):
                        of_panel[cell[2:]] = its
                _panel(axes[i, k], of_panel, conditions_of[plant], colours, marks, name != SETTLES)
                axes[i, k].set_xlabel(label)
                axes[i, k].tick_params(labelleft=k == 0)
            over_never = 1.0 + style.points(1.7 * pages.TEXT_SIZE / 72) / style.points(tall[i])
            if title or len(plants) > 1:
                its_name = style.plant_name(plant)
            else:
                its_name = ""
            beside = (
                style.width(f"{its_name}  never", style.points(pages.TEXT_SIZE), bold=True) < room
            )
            axes[i, 0].set_title(its_name, y=None if beside else over_never, parse_math=False)
        pages.set_head(
            page,
            width,
            title or f"Medians: {style.heading(plants, conditions, short=len(plants) > 1)}",
            key,
            shared,
        )
        pages.write(page, paths)
    return page


def _intervals(table: Columns, metrics: Sequence[str]) -> dict[tuple[str, str, str, str], Interval]:
    """Return (metric, plant, condition, law) -> the median, or the share of runs that settle, with
    its interval.
    """
    of_metric = {metric: by_row(table, metric) for metric in metrics}
    intervals = {}
    for group in groups(table, GROUPS):
        for metric in metrics:
            scores = group.scores(of_metric[metric])
            for law, of_law in scores.values.items():
                interval = median_of(of_law, linked(*scores.sets[law]))
                if metric == SETTLES:
                    interval = share_interval(float((of_law == 0.0).mean()), interval.n)
                else:
                    middle, low, high = (max(v, MIN_SIZE) if v > 0.0 else v for v in interval[:3])
                    interval = Interval(middle, low, high, interval.n)
                intervals[metric, *group.blocks[0], law] = interval
    return intervals


def _key(
    table: Columns, colours: Mapping[str, str], marks: Mapping[str, str], samples: int
) -> tuple[list[Handle], str]:
    """Return the entries of the legend, law by law, and where all gains come from if that is the
    same.
    """
    known = sources(table)
    key = []
    gains, shared = pages.gain_sources([known.get(law, ()) for law in colours])
    for law, source in zip(colours, gains, strict=True):
        look = {"marker": marks[law], "ms": style.points(6), "mec": "none", "lw": style.points(1.5)}
        key.append(Line2D([], [], color=colours[law], label=style.law_name(law) + source, **look))
    few = f"; a median's is the range of fewer than {MIN_INTERVAL_SAMPLES} samples" * (
        samples < MIN_INTERVAL_SAMPLES
    )
    label = f"95 % interval{few}"
    return [*key, Line2D([], [], color=style.MUTED, lw=style.points(1.5), label=label)], shared


def _panel(
    ax: Axes,
    intervals: Mapping[tuple[str, str], Interval],
    conditions: Sequence[str],
    colours: Mapping[str, str],
    marks: Mapping[str, str],
    log: bool,
) -> None:
    """Draw a metric of one plant, (condition, law) -> its interval: a block of lines per condition,
    a dot per law.

    If `log`, its axis is logarithmic where values differ much.
    """
    height = len(colours) + 1
    sizes = []
    for interval in intervals.values():
        for v in interval[:3]:
            if np.isfinite(v):
                sizes.append(v)
    if log and sizes and min(sizes) > 0.0 and max(sizes) > style.LOG_RANGE * min(sizes):
        ax.set_xscale("log")
        ax.xaxis.set_minor_formatter(NullFormatter())  # numbers between decades would overlap
    for (j, condition), (k, law) in itertools.product(enumerate(conditions), enumerate(colours)):
        if (condition, law) in intervals:
            said = (
                f"{style.law_name(law)}, {condition.replace('_', ' ')}: "
                f"{intervals[condition, law].median:.3g}"
            )
            look = {
                "color": colours[law],
                "marker": marks[law],
                "ms": style.points(6),
                "mec": "none",
            }
            look["gid"] = pages.hint(said)
            _dot(ax, intervals[condition, law], j * height + k, look)
    if not sizes:
        ax.set_xticks([])
    for j in range(1, len(conditions)):
        ax.axhline(j * height - 1, color=style.RULE, lw=style.points(0.8))
    middles = [j * height + height / 2 - 1 for j in range(len(conditions))]
    ax.set_yticks(middles, [name.replace("_", " ") for name in conditions])
    ax.set_ylim(len(conditions) * height - 1, -1)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)


def _dot(ax: Axes, interval: Interval, line: int, look: dict) -> None:
    """Draw a median with its interval. An infinite median is at the right edge, under "never"."""
    never = {"transform": ax.get_yaxis_transform(), "clip_on": False}
    median, low, high = interval[:3]
    if np.isfinite(median):
        ax.plot(median, line, **look)
    else:
        ax.plot(1.0, line, **look | {"mfc": style.PAPER, "mec": look["color"]}, **never)
        drawing.note(ax, "never")
    if np.isfinite(low) and np.isfinite(high):
        ax.plot([low, high], [line, line], color=look["color"], lw=style.points(1.5))
    elif np.isfinite(low):  # up to "never"
        ax.plot(low, line)  # nothing is seen: the axis comprises the interval
        look = {"arrowstyle": "-", "color": look["color"], "lw": style.points(1.5), "ls": ":"}
        ax.annotate(
            "", (1.0, line), (low, line), ("axes fraction", "data"), "data", arrowprops=look
        )


def _labels(metrics: Sequence[str], x: str, room: float) -> list[str]:
    """Return the labels of a row of panels with the metrics' units where positions are in x.

    All are in two lines if one is wider than `room`, in points.
    """
    labels = []
    for metric in metrics:
        words = "share of runs that settle"
        bracket = ""
        unit = ""
        if metric != SETTLES:
            words, bracket, unit = CATALOGUE[metric].heading(x).partition(" (")
        labels.append(words + bracket + unit.replace("^2", "²").replace(" ", "·"))
    if any(style.width(label, style.points(pages.TEXT_SIZE)) > room for label in labels):
        return [label.replace(" (", "\n(").replace(" that", "\nthat") for label in labels]
    return labels
