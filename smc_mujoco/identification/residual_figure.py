"""The figure of a record beside what twins predict, with its residuals.

The record is a broad pale line, so that twins are seen over it, in grey, too. The first twin is
drawn last: of several it is the one that matters.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from smc_mujoco.common.aliases import AnyPath, Array, Fields, Numbers
from smc_mujoco.draw import colouring, lettering, shared_axes, style
from smc_mujoco.draw import page as pages
from smc_mujoco.identification.records import Record
from smc_mujoco.identification.rig import Fall

ROW_HEIGHT = 2.6  # inches, height of a column's panels
RECORD_WIDTH = 3.5  # points, of a record; chosen
TWIN_WIDTH = 1.3  # points, of a twin and its residual; chosen
SHARES = (3, 2)  # of the width: signals, residuals
TITLE_MARGIN = 0.8  # of a panel's share of the page, the part beside its numbers; chosen


def residual_figure(
    title: str,
    t: Array,
    measured: Record,
    predicted: Mapping[str, Record],
    fits: Mapping[str, Numbers],
    units: Mapping[str, str],
    path: AnyPath,
) -> list[Path]:
    """Draw each column of a record, measured and predicted, beside its residuals.

    Write PATH.svg and PATH.png.

    `t`: times, s, (K,). `predicted`, `fits`: name of a twin -> what it predicts, and its fit of
    each column, percent. `units`: of the columns.
    """
    paths = pages.files(path)
    looks = looks_of(list(predicted))
    record = {"color": style.RULE, "lw": RECORD_WIDTH}
    handles = [Line2D([], [], label="measured", **record)]
    for twin, look in looks.items():
        handles.append(Line2D([], [], label=twin, **look))
    with style.page():
        height = pages.head_height(style.FULL_WIDTH, handles) + ROW_HEIGHT * len(measured)
        page = pages.blank(style.FULL_WIDTH, height)
        axes = page.subplots(len(measured), 2, squeeze=False, sharex=True, width_ratios=SHARES)
        labels = next(iter(fits.values()))  # what tables call the columns
        rows = zip(axes, measured.items(), labels, strict=True)
        for (column_axes, residual_axes), (name, values), column in rows:
            unit = units[name].replace(" ", "·")
            column_axes.set_ylabel(lettering.folded(f"{column} ({unit})"))
            column_axes.plot(t, values, **record)
            residuals = {}
            reached = {}
            for twin, look in looks.items():
                residuals[twin] = values - predicted[twin][name]
                reached[twin] = percent(fits[twin][column])
                column_axes.plot(t, predicted[twin][name], **look)
            _entitle(column_axes, "fit", reached, SHARES[0])
            _draw_residuals(residual_axes, t, residuals, looks, unit)
        for ax in axes[-1]:
            ax.set_xlabel("time (s)")
        pages.set_head(page, style.FULL_WIDTH, title, handles)
        pages.write_page(page, paths)
    return paths


def _draw_residuals(
    ax: Axes, t: Array, residuals: Mapping[str, Array], looks: Mapping[str, Fields], unit: str
) -> None:
    """Draw the residuals of a column, twin -> (K,), with the prefix of their unit that suits."""
    largest = max(float(np.abs(error).max()) for error in residuals.values())
    factor, short = shared_axes.prefixed(largest, unit)
    ax.axhline(0.0, color=style.RULE, lw=0.8)
    for twin, residual in residuals.items():
        ax.plot(t, factor * residual, **looks[twin])
    remains = {}
    for twin in looks:
        rms = factor * np.sqrt(np.mean(residuals[twin] ** 2))
        remains[twin] = f"{rms:.3g}"
    ax.set_ylabel(f"residual ({short})")
    _entitle(ax, "rms", remains, SHARES[1])


def looks_of(twins: Sequence[str]) -> dict[str, Fields]:
    """Return the look of each twin's lines. The first lies over the others, which are thinner."""
    looks = {}
    for k, colour in enumerate(colouring.spread(len(twins))):
        width = TWIN_WIDTH if k == 0 else 0.7 * TWIN_WIDTH
        looks[twins[k]] = {"color": colour, "lw": width, "zorder": 3.0 - 0.1 * k}
    return looks


def percent(fit: float) -> str:
    """Return a fit in words, such as "−16.6 %", or when the twin falls."""
    if isinstance(fit, Fall):
        return str(fit)
    return f"{fit:.1f} %".replace("-", "−")


def _entitle(ax: Axes, what: str, numbers: Mapping[str, str], share: float) -> None:
    """Name a number of each twin above a panel that has a share of the page's width; on two lines
    if one is too short.
    """
    words = ", ".join(f"{twin} {number}" for twin, number in numbers.items())
    if len(numbers) == 1:
        words = next(iter(numbers.values()))
    room = TITLE_MARGIN * 72 * style.FULL_WIDTH * share / sum(SHARES)
    title = lettering.wrapped(f"{what}: {words}", room, style.RC["axes.titlesize"], 2, bold=True)
    ax.set_title(title, parse_math=False)
