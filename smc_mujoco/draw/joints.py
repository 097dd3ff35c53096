"""One small panel for each joint of an arm: how far it is from its reference, and the tip's distance or force.

joints([trace, other], "joints.svg", labels=["computed torque", "passivity"])
"""

import os
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from smc_mujoco.draw import page as pages
from smc_mujoco.draw import panels, style
from smc_mujoco.draw.decimate import end, finite
from smc_mujoco.draw.page import Size
from smc_mujoco.mechanisms.hardware.part import joint_names
from smc_mujoco.metrics import tip
from smc_mujoco.simulation.trace import Trace

WIDE, SLIM = (4, 3), (2, 3)  # panels in a row of a page, and of a narrow one: the number that leaves fewer cells empty
ROW = 2.0  # inches on a full page
LEAVING = 0.6  # points, width of a curve that leaves its panel
CONTACT = "force of contact (N)"


class Quantity(NamedTuple):
    """What a panel shows: its title, and its values in a trace, (K + 1,)."""

    title: str
    of: Callable[[Trace], np.ndarray]


def joints(
    traces: Sequence[Trace],
    path: str | os.PathLike | None = None,
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

    Returns:
      The figure.

    Raises:
      ScenarioError: as `figure`.
    """
    traces = [finite(trace) for trace in style.same_plant(traces)]
    names, colours = style.labels(traces, labels), style.law_colours([trace.scenario.law for trace in traces])
    plant, shown = traces[0].scenario.plant, quantities(traces)
    marks = style.jumps(traces, names) | style.blows(traces)
    paths = [] if path is None else pages.files(path, format)
    width, height = pages.measure(size, fig)
    columns = min(SLIM if width < pages.NARROW else WIDE, key=lambda n: -len(shown) % n)
    rows = -(-len(shown) // columns)
    with style.page(width):
        page = pages.blank(width, height or style.points(ROW * rows + 0.9), fig)
        grid = page.subplots(rows, columns, sharex=True, squeeze=False)
        for ax, quantity in zip(grid.flat, shown, strict=False):
            draw(ax, quantity, traces, names, colours)
            panels.jumps(ax, marks, named=False)
        for k, ax in enumerate(grid.flat):
            ax.set_visible(k < len(shown))
            if k + columns >= len(shown):
                ax.set_xlabel("time (s)")
                ax.tick_params(labelbottom=True)
        handles = [
            Line2D([], [], color=colour, lw=style.points(3.0), label=name)
            for name, colour in zip(names, colours, strict=True)
        ]
        dotted = {"color": style.INK, "lw": style.points(0.9), "ls": (0, (2, 2))}
        handles += [Line2D([], [], **dotted, label=f"{what} at {time:g} s") for time, what in sorted(marks.items())]
        pages.set_head(page, width, title or style.plant_name(plant), handles)
        pages.write(page, paths)
    return page


def quantities(traces: Sequence[Trace]) -> list[Quantity]:
    """Return what the panels show: the error of each joint, and what the tip does."""
    plant = traces[0].scenario.plant
    found = [
        Quantity(
            f"{name}, error ({'mrad' if unit == 'rad' else 'mm'})", lambda trace, i=i: 1e3 * (trace.x - trace.r)[:, i]
        )
        for i, (name, unit) in enumerate(zip(joint_names(plant), plant.units, strict=True))
    ]
    if plant.tip:
        found.append(Quantity("tip off its path (mm)", lambda trace: 1e3 * tip.tip_error(trace)))
    if all(tip.knows_contacts(trace.scenario) for trace in traces):
        found.append(Quantity(CONTACT, lambda trace: tip.contacts(trace).force))
    return found


def draw(ax: Axes, quantity: Quantity, traces: Sequence[Trace], names: Sequence[str], colours: Sequence[str]) -> None:
    """Draw a panel. Curves that lie on each other are dashed in turn; a run far off leaves the panel, which says so."""
    values = [quantity.of(trace) for trace in traces]
    sizes = [float(np.abs(one).max()) for one in values]
    away = panels.far_off(sizes)
    usual = [one for k, one in enumerate(values) if k != away]
    low, high = min(one.min() for one in usual), max(one.max() for one in usual)
    air = 0.08 * (high - low) or 1.0
    ax.set_ylim(low - air, high + air * (1.0 if away is None else 4.0))
    ax.set_xlim(0.0, end(traces))
    lines = [(trace.t, one) for trace, one in zip(traces, values, strict=True)]
    dashes = panels.dashes(lines, ax.get_ylim())
    for k, ((t, one), colour, dash) in enumerate(zip(lines, colours, dashes, strict=True)):
        width = LEAVING if k == away else panels.LINE
        ax.plot(t, one, color=colour, lw=style.points(width), ls=dash, zorder=3 - 0.1 * k)
        if quantity.title == CONTACT:
            mark_losses(ax, t, one, colour, k)
    ax.set_title(quantity.title, fontsize=style.points(10.0))
    if away is not None:
        room = 72 * ax.get_position().width * ax.figure.bbox.width / ax.figure.dpi
        size = style.points(8.5)
        most = f": up to {style.short(sizes[away])}"
        words = style.cropped(names[away], 0.95 * room - style.width(most, size), size) + most
        look = {"fontsize": size, "color": colours[away], "ha": "right", "va": "top", "parse_math": False}
        ax.annotate(words, (1.0, 1.0), (-2, -1), "axes fraction", "offset points", **look)


def mark_losses(ax: Axes, t: np.ndarray, force: np.ndarray, colour: str, row: int) -> None:
    """Mark when a contact that was there is lost, by bars at the bottom of the panel."""
    touched = np.flatnonzero(force > 0.0)
    lost = (force <= 0.0) & (np.arange(len(t)) > (touched[0] if len(touched) else len(t)))
    ax.fill_between(
        t,
        0.02 + 0.035 * row,
        0.045 + 0.035 * row,
        where=lost.tolist(),
        color=colour,
        transform=ax.get_xaxis_transform(),
    )
