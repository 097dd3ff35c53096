"""Error over control period, both logarithmic: a panel for e and one for s, a colour for each law.

Marks are the means over the starts, with their range. Filled ones are in the fit, hollow ones are
not. The solid line is the fit; the dashed one has theory's slope. There
is no line where the order's interval holds 0 and 2: it tells nothing, from no gain at all to a
quarter of the error at half the period.
"""

import itertools
import math
import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.source import by_words
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.draw.page import Size
from smc_mujoco.evidence.accuracy.scaling import QUANTITIES, Accuracy, Scaling

ROW_HEIGHT = 5.2  # inches on a full page, height of the panels of a plant in a condition
AXIS_NAMES = {"e": "largest |e|", "s": "largest |s|"}


def orders(
    rows: Sequence[Accuracy],
    path: str | os.PathLike | None = None,
    title: str | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure | SubFigure:
    """Draw how the errors of laws fall with the control period, panels for each plant and
    condition, as `figure`.
    """
    groups: dict[str, list[Accuracy]] = {}
    for row in rows:
        plant = style.plant_name(row.plant, short=True)
        groups.setdefault(f"{plant}, {row.condition.replace('_', ' ')}", []).append(row)
    if not groups:
        raise ScenarioError("no accuracy to draw: give at least one row")
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    laws = list(dict.fromkeys(row.law for row in rows))
    marks = itertools.cycle(style.MARKS)
    looks = dict(zip(laws, zip(style.law_colours(laws), marks, strict=False), strict=True))
    with style.page(width):
        narrow = width < pages.NARROW
        down = len(groups) * (len(QUANTITIES) if narrow else 1)
        page = pages.blank(width, height or style.points(ROW_HEIGHT * down), fig)
        axes = page.subplots(down, 1 if narrow else len(QUANTITIES), squeeze=False).ravel()
        panels = itertools.product(groups.items(), QUANTITIES)
        for ax, ((name, group), quantity) in zip(axes, panels, strict=True):
            for row in group:
                _draw(ax, row.periods, getattr(row, quantity), *looks[row.law])
            unit = group[0].unit if quantity == "e" else "unit of s"
            ax.set(
                xscale="log",
                yscale="log",
                ylabel=f"{AXIS_NAMES[quantity]} ({unit})",
                xlabel="control period (ms)",
            )
            ax.set_xticks([1e3 * h for h in group[0].periods])
            ax.minorticks_off()
            ax.xaxis.set_major_formatter("{x:g}")
            ax.set_title(name if len(groups) > 1 else "")
        common = {"xdata": [], "ydata": [], "lw": style.points(2.0)}
        handles = []
        for law, (c, mark) in looks.items():
            handles.append(Line2D(**common, color=c, marker=mark, label=style.label(law)))
        handles.append(Line2D([], [], color=style.MUTED, ls="--", label="theory's slope"))
        if len(groups) > 1:
            whole = "Accuracy"
        else:
            whole = f"Accuracy: {next(iter(groups))}"
        pages.set_head(
            page, width, title or whole, handles, by_words({row.law: row.gains for row in rows})
        )
        pages.write(page, paths)
    return page


def _tells(scaling: Scaling) -> bool:
    """Return whether an order was found, with an interval that does not hold both 0 and 2."""
    return not (math.isnan(scaling.order) or (scaling.low <= 0.0 and scaling.high >= 2.0))


def _draw(ax: Axes, periods: Sequence[float], scaling: Scaling, colour: str, mark: str) -> None:
    """Draw the errors of one law, its fit and theory's slope."""
    h = 1e3 * np.array(periods)
    errors = np.array(scaling.errors)
    with np.errstate(divide="ignore"):
        means = np.exp(np.log(errors).mean(axis=0))
    for k in np.flatnonzero(np.isfinite(means) & (means > 0.0)).tolist():
        counted = periods[k] in scaling.used
        ax.plot(
            [h[k]] * 2,
            [errors[:, k].min(), errors[:, k].max()],
            color=colour,
            lw=style.points(1.0),
            alpha=0.6,
        )
        ax.plot(
            h[k],
            means[k],
            mark,
            color=colour,
            ms=style.points(6.0),
            mfc=colour if counted else "none",
        )
    if not _tells(scaling):
        return
    counted = np.isin(periods, scaling.used)
    middle = np.exp(np.log(means[counted]).mean())
    ends = h[counted][[0, -1]]
    at = np.exp(np.log(h[counted]).mean())
    for slope, line in ((scaling.theory, "--"), (scaling.order, "-")):
        if slope is not None:
            values = middle * (ends / at) ** slope
            ax.plot(ends, values, line, color=colour, lw=style.points(1.6 if line == "-" else 1.0))
