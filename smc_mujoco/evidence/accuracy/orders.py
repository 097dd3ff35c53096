"""Error over control period, both logarithmic: a panel for e and one for s, a colour for each law.

Marks are the means over the starts, with their range. Filled ones are in the fit, hollow ones are
not. The solid line is the fit, with its order at its end; the dashed one has theory's slope. There
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
from smc_mujoco.draw import panels as drawing
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
    looks = dict(
        zip(
            laws,
            zip(style.law_colours(laws), itertools.cycle(style.MARKS), strict=False),
            strict=True,
        )
    )
    with style.page(width):
        narrow = width < pages.NARROW
        down = len(groups) * (len(QUANTITIES) if narrow else 1)
        page = pages.blank(width, height or style.points(ROW_HEIGHT * down), fig)
        axes = page.subplots(down, 1 if narrow else len(QUANTITIES), squeeze=False).ravel()
        panels = itertools.product(groups.items(), QUANTITIES)
        for ax, ((name, group), quantity) in zip(axes, panels, strict=True):
            ends = []
            for row in group:
                its: Scaling = getattr(row, quantity)
                end = _draw(ax, row.periods, its, *looks[row.law])
                if end and (words := _order(its)):
                    ends.append((*end, looks[row.law][0], words))
            if quantity == "e":
                unit = group[0].unit
            else:
                unit = "unit of s"
            ax.set(
                xscale="log",
                yscale="log",
                ylabel=f"{AXIS_NAMES[quantity]} ({unit})",
                xlabel="control period (ms)",
            )
            ax.set_xticks([1e3 * h for h in group[0].periods])
            ax.minorticks_off()
            _write_orders(ax, 1e3 * group[0].periods[0], ends)
            drawing.note(ax, f"order of {quantity} (theory's)")
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


def _order(scaling: Scaling) -> str:
    """Return an order with its interval, and theory's in brackets; "" where neither is known."""
    if scaling.theory is None:
        promised = ""
    else:
        promised = f" ({scaling.theory:.2g})"
    return f"{scaling if _tells(scaling) else 'untold' * bool(promised)}{promised}"


def _write_orders(ax: Axes, last: float, ends: Sequence[tuple[float, float, str, str]]) -> None:
    """Write orders right of the longest period `last`, ms: (error, period, colour, words) of each
    law, moved apart.
    """
    ends, size = sorted(ends), style.points(9.5)
    room = max((style.width(words, size) for *_, words in ends), default=0.0) + 2.0 * size
    box = ax.get_window_extent()
    dots = 72 / ax.figure.dpi
    left = ax.get_xlim()[0]
    share = min(room / (dots * box.width), 0.6)
    ax.set_xlim(left, left * (last / left) ** (1.0 / (1.0 - share)))
    low, high = np.log(ax.get_ylim())
    ends_at = (np.log([error for error, *_ in ends]) - low) / (high - low)
    for (error, period, colour, words), y in zip(
        ends, _apart(ends_at, 1.3 * size / (dots * box.height)), strict=True
    ):
        place = (1.0 - share + 1.5 * size / (dots * box.width), y)
        line = {
            "arrowstyle": "-",
            "color": colour,
            "ls": ":",
            "lw": style.points(0.8),
            "shrinkA": 0.0,
            "shrinkB": style.points(4),
        }
        look = {"fontsize": size, "va": "center", "annotation_clip": False}
        ax.annotate(words, (period, error), place, "data", "axes fraction", arrowprops=line, **look)


def _apart(places: np.ndarray, gap: float) -> np.ndarray:
    """Return ascending places at least `gap` apart, of which the last is at most 1 - gap."""
    steps = gap * np.arange(len(places))
    up = np.maximum.accumulate(places - steps) + steps
    return np.minimum(up, 1.0 - gap - steps[::-1])


def _draw(
    ax: Axes, periods: Sequence[float], scaling: Scaling, colour: str, mark: str
) -> tuple[float, float] | None:
    """Draw the errors of one law, its fit and theory's slope.

    Return where they end, error and period in ms.
    """
    h = 1e3 * np.array(periods)
    errors = np.array(scaling.errors)
    end = None
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
        end = end or (float(means[k]), float(h[k]))
    if not _tells(scaling):
        return end
    counted = np.isin(periods, scaling.used)
    middle = np.exp(np.log(means[counted]).mean())
    ends = h[counted][[0, -1]]
    at = np.exp(np.log(h[counted]).mean())
    for slope, line in ((scaling.theory, "--"), (scaling.order, "-")):
        if slope is not None:
            values = middle * (ends / at) ** slope
            ax.plot(ends, values, line, color=colour, lw=style.points(1.6 if line == "-" else 1.0))
            end = float(values[0]), float(ends[0])
    return end
