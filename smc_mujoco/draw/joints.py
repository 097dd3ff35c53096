"""One small panel for each joint of an arm: how far it is from its reference, and the tip's distance or force."""

import dataclasses
import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from smc_mujoco.draw import page as pages
from smc_mujoco.draw import panels, style
from smc_mujoco.draw.decimate import end, finite
from smc_mujoco.draw.page import Size
from smc_mujoco.draw.panels import Panel
from smc_mujoco.metrics import tip
from smc_mujoco.metrics.channel_groups import group_trace
from smc_mujoco.simulation.trace import Trace

WIDE_COLUMNS, NARROW_COLUMNS = (4, 3), (2, 3)  # in a row: of these two numbers the one that leaves fewer cells empty
ROW_HEIGHT = 2.0  # inches on a full page
TICK_ROOM = 62.0  # points on a full page, for the numbers at the left of a panel
TITLE_SIZE, NOTE_SIZE = 10.0, 8.5  # points on a full page: of a panel's title, and of a note on a run that leaves it
NOTE_ROOM = 0.2  # of a panel's height, above its curves
NOTE_OPACITY = 0.8  # of the paper behind a note


def joints(
    traces: Sequence[Trace],
    path: str | os.PathLike[str] | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure | SubFigure:
    """Draw the error of every joint over time, a panel each, and what the tip does.

    The tip's panels are its distance from where the references want it, and the normal force if it touches something,
    with bars at the bottom where a contact is lost. A blow and a change of the arm are marked by dotted lines.

    Args:
      traces: of one plant.
      path, labels, title, size, format, fig: as in `figure`.

    Raises:
      ScenarioError: as `figure`.
    """
    traces = [finite(trace) for trace in style.same_plant(traces)]
    names, colours = style.labels(traces, labels), style.law_colours([trace.scenario.law for trace in traces])
    drawn, marks = panels_of(traces), style.marks(traces, names)
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    columns = min(NARROW_COLUMNS if width < pages.NARROW else WIDE_COLUMNS, key=lambda n: -len(drawn) % n)
    rows = -(-len(drawn) // columns)
    with style.page(width):
        room = 72 * width / columns - style.points(TICK_ROOM)
        letters = min(style.points(TITLE_SIZE), *(room / style.width(panel.label, 1.0, bold=True) for panel in drawn))
        page = pages.blank(width, height or style.points(ROW_HEIGHT * rows + 0.9), fig)
        grid = page.subplots(rows, columns, sharex=True, squeeze=False)
        for ax, panel in zip(grid.flat, drawn, strict=False):
            draw(ax, panel, names, colours, letters)
            panels.mark(ax, marks, named=False)
        for k, ax in enumerate(grid.flat):
            ax.set_visible(k < len(drawn))
            if k + columns >= len(drawn):
                ax.set_xlabel("time (s)")
                ax.tick_params(labelbottom=True)
        events = [Line2D([], [], **panels.dotted(), label=f"{what} at {time:g} s") for time, what in marks.items()]
        title = title or style.plant_name(traces[0].scenario.plant)
        handles, gains = pages.run_handles(traces, names, colours)
        pages.set_head(page, width, title, [*handles, *events], gains)
        pages.write(page, paths)
    return page


def panels_of(traces: Sequence[Trace]) -> list[Panel]:
    """Return the panels: the error of each joint, and what the tip does."""
    groups, of_joints = list(style.split(traces)), []
    for group in groups:
        for i in group.channels:
            joint = dataclasses.replace(group, channels=(i,))
            of_joints.append(Panel("joint", joint, [group_trace(trace, joint) for trace in traces], i))
    of_joints.sort(key=lambda panel: panel.channel)
    names = ["tip"] * bool(traces[0].scenario.plant.tip)
    names += ["contact"] * all(tip.knows_contacts(trace.scenario) for trace in traces)
    return of_joints + [Panel(name, groups[0], traces) for name in names]


def draw(ax: Axes, panel: Panel, names: Sequence[str], colours: Sequence[str], letters: float) -> None:
    """Draw a panel, with a title of `letters` points.

    A run that is far off leaves the panel. Its name and its largest value are printed at the top.
    """
    panels.over_time(ax, panel, colours)
    ax.set_xlim(0.0, end(panel.traces))
    ax.set_title(panel.label, fontsize=letters)
    for k, (trace, colour) in enumerate(zip(panel.traces, colours, strict=True)):
        if panel.quantity == "contact":
            mark_losses(ax, trace.t, panels.QUANTITIES["contact"](trace)[:, 0], colour, k)
    if (away := panels.far_off(panel.traces, panel.quantity)) is not None:
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + NOTE_ROOM * (high - low))
        name, largest = panels.outside(panel, names)
        room = 72 * ax.get_position().width * ax.figure.bbox.width / ax.figure.dpi
        size = style.points(NOTE_SIZE)
        words = style.cropped(name, 0.95 * room - style.width(largest, size), size) + largest
        look = {"fontsize": size, "color": colours[away], "ha": "right", "va": "top", "parse_math": False}
        look["bbox"] = {"facecolor": style.PAPER, "alpha": NOTE_OPACITY, "lw": 0, "pad": 0.5}
        ax.annotate(words, (1.0, 1.0), (-2, -1), "axes fraction", "offset points", **look)


def mark_losses(ax: Axes, t: np.ndarray, force: np.ndarray, colour: str, row: int) -> None:
    """Mark when a contact that was there is lost, by bars at the bottom of the panel."""
    touched = np.flatnonzero(force > 0.0)
    lost = (force <= 0.0) & (np.arange(len(t)) > (touched[0] if len(touched) else len(t)))
    low, transform = 0.02 + 0.035 * row, ax.get_xaxis_transform()
    ax.fill_between(t, low, low + 0.025, where=lost.tolist(), color=colour, transform=transform)
