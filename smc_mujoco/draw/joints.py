"""One small panel for each joint of an arm: how far it is from its reference, and the tip's distance or force.

joints([trace, other], "joints.svg", labels=["computed torque", "passivity"])
"""

import os
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.draw.decimate import finite
from smc_mujoco.draw.page import Size
from smc_mujoco.mechanisms.hardware.part import joint_names
from smc_mujoco.metrics import tip
from smc_mujoco.simulation.trace import Trace

COLUMNS, ROW = 3, 1.75  # panels in a row; inches on a full page
ALONE = 8.0  # times the errors of all other runs: a run so far off leaves the panel instead of flattening them; chosen


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
    with bars at the bottom where a contact is lost.

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
    plant = traces[0].scenario.plant
    panels: list[tuple[str, Callable[[Trace], np.ndarray]]] = [
        (f"{name} ({'mrad' if unit == 'rad' else 'mm'})", lambda trace, i=i: 1e3 * (trace.x - trace.r)[:, i])
        for i, (name, unit) in enumerate(zip(joint_names(plant), plant.units, strict=True))
    ]
    if plant.tip:
        panels.append(("tip, distance (mm)", lambda trace: 1e3 * tip.tip_error(trace)))
    touching = all(trace.scenario.contact.kind != "none" for trace in traces)
    if touching:
        panels.append(("contact, normal force (N)", lambda trace: tip.contacts(trace).force))
    paths = [] if path is None else pages.files(path, format)
    width, height = pages.measure(size, fig)
    rows = -(-len(panels) // COLUMNS)
    with style.page(width):
        page = pages.blank(width, height or style.points(ROW * rows + 0.9), fig)
        grid = page.subplots(rows, COLUMNS, sharex=True, squeeze=False)
        for ax, (label, quantity) in zip(grid.flat, panels, strict=False):
            sizes = []
            for k, (trace, colour) in enumerate(zip(traces, colours, strict=True)):
                values = quantity(trace)
                sizes.append((float(np.abs(values).max()), values.min(), values.max()))
                ax.plot(trace.t, values, color=colour, lw=style.points(1.5), zorder=3 - 0.1 * k)
                if label.startswith("contact"):
                    mark_losses(ax, trace.t, values, colour, k)
            ax.set_title(label, fontsize=style.points(10.0))
            ax.margins(0.0, 0.08)
            keep_within(ax, sizes)
        for ax in grid.flat[len(panels) :]:
            ax.set_visible(False)
        last = [grid[max(row for row in range(rows) if row * COLUMNS + j < len(panels)), j] for j in range(COLUMNS)]
        for ax in last:
            ax.set_xlabel("time (s)")
            ax.tick_params(labelbottom=True)
        handles = [
            Line2D([], [], color=colour, lw=style.points(3.0), label=name)
            for name, colour in zip(names, colours, strict=True)
        ]
        pages.set_head(page, width, title or style.plant_name(plant), handles)
        pages.write(page, paths)
    return page


def keep_within(ax: Axes, sizes: list[tuple[float, float, float]]) -> None:
    """Let one run that is far off leave the panel, and say so. Sizes: largest |y|, least and largest y of each run."""
    *others, largest = sorted(sizes)
    if others and largest[0] > ALONE * others[-1][0] > 0.0:
        low, high = min(one[1] for one in others), max(one[2] for one in others)
        room = 0.3 * (high - low)
        ax.set_ylim(low - room, high + room)
        place = {"xytext": (-3, -3), "textcoords": "offset points", "ha": "right", "va": "top"}
        text = f"one run: up to {style.short(largest[0])}"
        ax.annotate(text, (1.0, 1.0), xycoords="axes fraction", fontsize=style.points(8.0), color=style.MUTED, **place)


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
