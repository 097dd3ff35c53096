"""Dot plots of a study: the median of each law with its interval, by condition."""

import itertools
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from smc_mujoco.analysis.bootstrap import MIN_INTERVAL_SAMPLES, Interval, median_of, share_interval
from smc_mujoco.analysis.paired_runs import (
    GROUPS,
    OBJECTIVE,
    SETTLED,
    SETTLES,
    RunColumns,
    by_row,
    check_table,
    floor,
    groups,
    labels,
    scenarios,
    sources,
    unit_of_u,
    unit_of_x,
)
from smc_mujoco.analysis.ranking import linked
from smc_mujoco.common.aliases import AnyPath, Array, Fields
from smc_mujoco.common.errors import ScenarioError, items_of, shown, unknown, warn_once
from smc_mujoco.common.text import number
from smc_mujoco.draw import colouring, style, wording
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import panels as drawing
from smc_mujoco.draw.page import Handle, Size
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation.trace import Trace

METRICS = ("settling_time", "ultimate_bound", "tv_rate")
Cell = tuple[str, str, str, str]  # metric, plant, condition, law
MIN_SIZE = 1e-9  # smaller sizes are drawn at it
RING: Fields = {"marker": "o", "mfc": "none", "mec": style.INK, "clip_on": False}  # around a winner
# inches on a full page, heights of a law's line, and of the title, numbers and label of a panel
LINE_HEIGHT = 0.18
WORDS_HEIGHT = 0.9
HEAD_ROOM = 1.5  # inches of a column for the title and the key, about


def plot(
    table: RunColumns,
    path: AnyPath | None = None,
    metrics: Sequence[str] = METRICS,
    title: str | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
    winners: Collection[Cell] | None = None,
    objectives: Mapping[Cell, Interval] | None = None,
) -> Figure:
    """Draw the median of each law over the seeds, with its 95 % bootstrap interval: dots, by
    condition.

        table = smc.study(smc.grid("duffing", ["pid", "adrc"], "noise", duration=1.0), "study")
        smc.plot(table, "study.svg")

    Medians and intervals are those of a leaderboard: of the runs that all laws have. Runs that
    share one of several sets of gains are one sample. There is a column of panels per metric and a
    row per plant; on narrow pages one column. A hollow dot at the right edge, under "never" or "not
    arrived", is a law whose median run fails, does not settle, or has not arrived. Sizes below 1e-9
    are arrows at it. Values below the floor, which count as equal, are on grey.

    Args:
      table: a study's runs, as `smc.Table.read` returns them.
      metrics: names of metrics, or "settles" for the settled runs in %.
      path, title, size, format, fig: as in `figure`.
      winners: (metric, plant, condition, law) of dots that get a ring; `compare`'s plot has those
        of its verdicts. Where none is drawn, the key says so; None: it says nothing.
      objectives: ("objective", plant, condition, law) -> J of the laws, s^2, a panel before the
        metrics; `compare`'s plot has it where each plant has one condition.

    Returns:
      The figure.

    Raises:
      ScenarioError: no runs, an unknown metric, laws without runs in common, or as `figure`.
    """
    if isinstance(table, Trace):
        raise ScenarioError(
            f"table is {shown(table)}: smc.figure draws traces, and this draws the table of a study"
        )
    check_table(table)
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    dots = _dots(table, items_of("metrics", metrics), winners or (), objectives or {})
    head = wording.titled(title, f"Medians: {dots.heading}")
    with style.page(width):
        key, shared = _key(table, dots)
        if winners is not None and not dots.won:
            key.append(pages.entry("no winner in these metrics", lw=0))
        if shared and not head:  # it has no place beside a title
            key.append(pages.entry(shared, lw=0))
            shared = ""
        across = 1 if width < pages.NARROW else len(dots.metrics)
        tall = WORDS_HEIGHT + LINE_HEIGHT * dots.lines
        heights = np.repeat(tall, len(dots.metrics) // across)
        space = pages.head_height(width, key, bool(head)) + style.points(0.6)
        usual = space + style.points(heights.sum())
        if isinstance(size, str) and height is None and usual > pages.MAX_HEIGHT:
            cure = "fewer plants or conditions"
            if across == 1:
                cure = 'size="ieee-page", or fewer metrics, plants or conditions'
            warn_once(
                f'size="{size}" makes the figure {usual:.1f} in high, and a journal\'s page holds '
                f"{pages.MAX_HEIGHT:g} in: take {cure}"
            )
        page = pages.blank(width, height or usual, fig)
        axes = page.subplots(len(heights), across, squeeze=False, height_ratios=heights.tolist())
        by_plant = axes.reshape(len(dots.conditions), -1)
        for plant, high, row in zip(dots.conditions, tall, by_plant, strict=True):
            _draw_plant(row, dots, plant, across == 1)
            if (title is not None and head) or len(dots.conditions) > 1:
                _name_row(row[0], dots.labels[plant], high)
        pages.set_head(page, width, head, key, shared)
        pages.space_ticks(page)
        return pages.write_page(page, paths)


def room_for_metrics(width: float, laws: int, conditions: Sequence[int]) -> int:
    """Return how many metrics a page of a width, in, has room for, with that many laws and
    conditions on each plant: five side by side, or on a narrow page up to three, one below the
    other, in a journal's column.
    """
    if width >= pages.NARROW:
        return 5
    lines = (laws + 1) * sum(conditions)
    with style.page(width):
        tall = style.points(WORDS_HEIGHT * len(conditions) + LINE_HEIGHT * lines)
    return max(1, min(3, int((pages.MAX_HEIGHT - HEAD_ROOM) / tall)))


def _name_row(ax: Axes, plant: Plant | str, high: float) -> None:
    """Write the name of a plant above its row, which is `high` in, clear of the note above it."""
    above = 1.0 + 1.7 * pages.TEXT_SIZE / 72 / (high - WORDS_HEIGHT)
    ax.set_title(wording.plant_name(plant), y=above, parse_math=False)


class Dots(NamedTuple):
    """What a page shows."""

    metrics: list[str]
    conditions: dict[str, list[str]]  # plant -> those in which it ran
    looks: dict[str, Fields]  # law -> colour and mark
    intervals: dict[Cell, Interval]
    won: set[Cell]  # those with a ring
    logarithmic: set[str]  # metrics whose axis is, on all plants
    floors: dict[tuple[str, str, str], float]  # metric, plant, condition -> its floor
    units: dict[str, tuple[str, str]]  # plant -> units of positions and of commands
    labels: dict[str, Plant | str]  # plant -> what pictures call it
    heading: str  # plants and conditions in words

    @property
    def lines(self) -> Array:
        """The number of lines of each plant's panels, (plants,)."""
        counts = list(map(len, self.conditions.values()))
        blocks = np.array(counts)
        return (len(self.looks) + 1) * blocks


def _dots(
    table: RunColumns,
    metrics: Sequence[str],
    winners: Collection[Cell],
    objectives: Mapping[Cell, Interval],
) -> Dots:
    """Return what a page shows of a table. Raise ScenarioError for an unknown metric, or if nothing
    is to be drawn.
    """
    for name in metrics:
        if name != SETTLES and name not in CATALOGUE:
            raise unknown("metric", name, [SETTLES, *CATALOGUE])
    plants = _distinct(table, "plant")
    laws = _distinct(table, "law")
    conditions = _distinct(table, "condition")
    if not plants or not metrics:
        raise ScenarioError(
            "no runs or no metrics to draw: give a table with rows, and at least one metric"
        )
    intervals = {**objectives, **_intervals(table, metrics)}
    if objectives:
        metrics = [OBJECTIVE, *metrics]
    of_plants = table.column("plant").tolist()
    of_conditions = table.column("condition").tolist()
    ran = set(zip(of_plants, of_conditions, strict=True))
    conditions_of = {}
    for plant in plants:
        on_plant = []
        for name in conditions:
            if (plant, name) in ran:
                on_plant.append(name)
        conditions_of[plant] = on_plant
    units = {}
    plant_labels: dict[str, Plant | str] = {}
    for group in groups(table, GROUPS[:1]):
        plant = group.name["plant"]
        runs = scenarios(table, group)
        units[plant] = unit_of_x(plant, runs), unit_of_u(runs)
        plant_labels[plant] = plant
        for scenario in runs:
            if scenario:
                plant_labels[plant] = scenario.plant
                break
    logarithmic = set()
    for name in metrics:
        if _differs_much(intervals, name):
            logarithmic.add(name)
    heading = wording.heading([*plant_labels.values()], conditions, short=len(plants) > 1)
    return Dots(
        metrics=list(metrics),
        conditions=conditions_of,
        looks=_looks(laws, labels(table)),
        intervals=intervals,
        won=intervals.keys() & set(winners),
        logarithmic=logarithmic,
        floors=_floors(table, metrics),
        units=units,
        labels=plant_labels,
        heading=heading,
    )


def _finite(intervals: Iterable[Interval]) -> Array:
    """Return the finite medians and ends of intervals."""
    sizes = np.array([interval[:3] for interval in intervals])
    return sizes[np.isfinite(sizes)]


def _differs_much(intervals: Mapping[Cell, Interval], metric: str) -> bool:
    """Return whether the values of a metric differ so much on one plant that its axis is
    logarithmic; that of the settled runs never is.
    """
    if metric == SETTLES:
        return False
    differs = False
    for plant in dict.fromkeys(cell[1] for cell in intervals):
        here = []
        for cell, interval in intervals.items():
            if cell[:2] == (metric, plant):
                here.append(interval)
        sizes = _finite(here)
        if sizes.size and not sizes.min() > 0.0:
            return False
        differs |= bool(sizes.size and style.LOG_RANGE * sizes.min() < sizes.max())
    return differs


def _distinct(table: RunColumns, column: str) -> list[str]:
    """Return the values of a column in the order of the rows."""
    return list(dict.fromkeys(table.column(column).tolist()))


def _looks(laws: Sequence[str], named: Mapping[str, str]) -> dict[str, Fields]:
    """Return law -> its label, and the colour and the mark of its dots."""
    looks = {}
    marks = itertools.cycle(style.MARKS)
    for law, colour in zip(laws, colouring.law_colours(laws), strict=True):
        label = named.get(law) or wording.law_name(law)
        looks[law] = {"label": label, "color": colour, "marker": next(marks), "mec": "none"}
    return looks


def _draw_plant(row: Array, dots: Dots, plant: str, named: bool) -> None:
    """Draw a panel of each metric of a plant in a row of axes; laws are named at the first, or at
    all if `named`.
    """
    for ax, name in zip(row, dots.metrics, strict=True):
        here = name, plant
        of_panel = {}
        rings = []
        for cell, interval in dots.intervals.items():
            if cell[:2] == here:
                of_panel[cell[2:]] = interval
                if cell in dots.won:
                    rings.append(cell[2:])
        decades = name in dots.logarithmic
        _panel(ax, of_panel, dots.conditions[plant], dots.looks, name, rings, decades)
        floors = [dots.floors[name, plant, condition] for condition in dots.conditions[plant]]
        _shade(ax, floors, len(dots.looks) + 1)
        ax.set_xlabel(_label(name, *dots.units[plant]) + (", log" if decades else ""))
        ax.tick_params(labelleft=named or ax is row[0])


def _floors(table: RunColumns, metrics: Sequence[str]) -> dict[tuple[str, str, str], float]:
    """Return (metric, plant, condition) -> the floor, below which values count as equal."""
    floors = {}
    for group in groups(table, GROUPS):
        (scenario,) = scenarios(table, group)
        for name in metrics:
            floors[name, *group.blocks[0]] = 0.0 if name == OBJECTIVE else floor(scenario, name)
    return floors


def _shade(ax: Axes, floors: Sequence[float], height: int) -> None:
    """Shade the values from 0 to the floor of each condition, in a block of `height` lines."""
    lowest, right = ax.get_xlim()
    start = max(lowest, 0.0)
    for j, least in enumerate(floors):
        lines = [j * height - 1, (j + 1) * height - 1]
        ax.fill_betweenx(lines, start, max(start, least), color=style.BAND, lw=0.0, zorder=0)
    ax.set_xlim(lowest, right)


def _intervals(table: RunColumns, metrics: Sequence[str]) -> dict[Cell, Interval]:
    """Return (metric, plant, condition, law) -> the median, or the settled runs in %, with its
    interval.
    """
    of_metric = {metric: by_row(table, metric) for metric in metrics}
    intervals = {}
    for group in groups(table, GROUPS):
        for metric in metrics:
            scores = group.scores(of_metric[metric])
            for law, of_law in scores.values.items():
                units = linked(*scores.sets[law])
                interval = median_of(of_law, units)
                if metric == SETTLES:
                    settled = float((of_law == 0.0).mean())
                    share = share_interval(settled, interval.n)
                    median, low, high = (100.0 * np.array(share[:3])).tolist()
                else:
                    sizes = np.array(interval[:3])
                    sizes[(sizes > 0.0) & (sizes < MIN_SIZE)] = MIN_SIZE
                    median, low, high = sizes.tolist()
                interval = Interval(median, low, high, interval.n)
                intervals[metric, *group.blocks[0], law] = interval
    return intervals


def _key(table: RunColumns, dots: Dots) -> tuple[list[Handle], str]:
    """Return the entries of the legend, law by law and mark by mark, and where all gains come from
    if that is the same.
    """
    rows = np.arange(len(table.column("law")))
    sources_by_law = sources(table, rows)
    intervals = list(dots.intervals.values())
    key: list[Handle] = []
    line: Fields = {"lw": style.points(1.5)}
    gains, shared = pages.gain_sources([sources_by_law.get(law, ()) for law in dots.looks])
    for look, source in zip(dots.looks.values(), gains, strict=True):
        label = look["label"] + source
        sample = pages.entry(label, look["color"], marker=look["marker"], mec="none", **line)
        key.append(sample)
    label = "95 % interval"
    if min(interval.n for interval in intervals) < MIN_INTERVAL_SAMPLES:
        label += f" (range if under {MIN_INTERVAL_SAMPLES} samples)"
    key.append(pages.entry(label, **line))
    if any(interval.low < dots.floors[cell[:3]] for cell, interval in dots.intervals.items()):
        key.append(pages.entry("below the floor", style.BAND))
    if dots.won:
        ring = pages.entry("winner", style.INK, lw=0.0, **RING)
        key.append(ring)
    if any(interval.median == MIN_SIZE for interval in intervals):
        smallest = number(MIN_SIZE / 2)
        mark = pages.entry(smallest, lw=0.0, marker="<")
        key.append(mark)
    return key, shared


def _panel(
    ax: Axes,
    intervals: Mapping[tuple[str, str], Interval],
    conditions: Sequence[str],
    looks: Mapping[str, Mapping[str, str]],
    metric: str,
    rings: Collection[tuple[str, str]],
    logarithmic: bool,
) -> None:
    """Draw a metric of one plant, (condition, law) -> its interval: a block of lines per condition,
    a dot per law, with a ring around those that win.
    """
    height = len(looks) + 1
    sizes = _finite(intervals.values())
    if logarithmic:
        ax.set_xscale("log")
    for (j, condition), (k, law) in itertools.product(enumerate(conditions), enumerate(looks)):
        if (condition, law) in intervals:
            interval = intervals[condition, law]
            _dot(ax, interval, j * height + k, looks[law])
            if (condition, law) in rings:
                size = style.points(12)
                ax.plot(interval.median, j * height + k, ms=size, **RING)
    if not sizes.size:
        ax.set_xticks([])
    if any(not np.isfinite(interval.median) for interval in intervals.values()):
        late = metric != OBJECTIVE and (CATALOGUE[metric].unit == "s" or CATALOGUE[metric].error)
        drawing.note(ax, "never" if late else "not arrived")
    for j in range(1, len(conditions)):
        ax.axhline(j * height - 1, color=style.RULE, lw=style.points(0.8))
    if len(conditions) == 1:
        names = [look["label"] for look in looks.values()]
        ax.set_yticks(range(len(looks)), names, parse_math=False)
    else:
        places = np.arange(len(conditions))
        middles = height * (places + 0.5) - 1
        ax.set_yticks(middles, list(map(wording.condition_name, conditions)), parse_math=False)
    ax.set_ylim(len(conditions) * height - 1, -1)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
    if logarithmic:
        drawing.number_decades(ax.xaxis, ax.get_xlim())


def _dot(ax: Axes, interval: Interval, line: int, look: Mapping[str, str]) -> None:
    """Draw a median with its interval. An infinite median is at the right edge."""
    median, low, high = interval[:3]
    color = look["color"]
    mark: Fields = {**look, "ms": style.points(6)}
    if median == MIN_SIZE:
        mark["marker"] = "<"
    if np.isfinite(median):
        ax.plot(median, line, **mark)
    else:
        mark |= {"transform": ax.get_yaxis_transform(), "clip_on": False}
        mark |= {"mfc": style.PAPER, "mec": color}
        ax.plot(1.0, line, **mark)
    if np.isfinite(low) and np.isfinite(high):
        ax.plot([low, high], [line, line], color=color, lw=style.points(1.5))
    elif np.isfinite(low):  # up to the edge
        ax.plot(low, line)  # nothing is seen: the axis comprises the interval
        arrow = {"arrowstyle": "-", "color": color, "lw": style.points(1.5), "ls": ":"}
        place = (1.0, line), (low, line), ("axes fraction", "data"), "data"
        ax.annotate("", *place, arrowprops=arrow)


def _label(metric: str, x: str, u: str) -> str:
    """Return the label of a panel with the metric's unit where positions are in x and commands in
    u, on two lines.
    """
    if metric == OBJECTIVE:
        heading = "J (s^2)"
    else:
        heading = SETTLED if metric == SETTLES else CATALOGUE[metric].heading(x, u)
    words, bracket, unit = heading.partition(" (")
    folded = bracket.replace(" ", "\n")
    squared = unit.replace("^2", "²")
    shown_unit = squared.replace(" ", "·")
    return words + folded + shown_unit
