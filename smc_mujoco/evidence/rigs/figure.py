"""Figures of records beside what twins predict: one record with its residuals, and the figures of
many.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.evidence.rigs.records import Record
from smc_mujoco.evidence.rigs.twin_figures import (
    FITTED,
    HELD_OUT,
    UNFITTED,
    TwinFigure,
    known,
)

ROW_HEIGHT = 2.6  # inches, height of a column's panels
MARKS = {UNFITTED: "D", HELD_OUT: "o", FITTED: "o"}  # filled, but for records that were fitted on
PHONE_WIDTH = 4.0  # inches of the page of twins, whose letters are read on a phone
ROW, BESIDE = 0.2, 0.35  # inches a row; rows from one record of a figure to the next
LEAST, MOST = 0.25, 4.0  # ends of the axis: a triangle there stands for what is beyond


def residual_figure(
    title: str,
    t: np.ndarray,
    measured: Record,
    predicted: Mapping[str, Record],
    fits: Mapping[str, Mapping[str, float]],
    units: Mapping[str, str],
    path: str | Path,
) -> list[Path]:
    """Draw each column of a record, measured and predicted, beside its residuals.

    Write PATH.svg and PATH.png.

    `t`: times, s, (K,). `predicted`, `fits`: name of a twin -> what it predicts, and its fit of
    each column, percent. `units`: of the columns.
    """
    paths = pages.files(Path(path).with_suffix(""))
    colours = dict(zip(predicted, style.spread(len(predicted)), strict=True))
    handles = [Line2D([], [], color=style.INK, label="measured")]
    handles += [Line2D([], [], color=colour, label=twin) for twin, colour in colours.items()]
    with style.page():
        height = pages.head_height(style.FULL_WIDTH, handles) + ROW_HEIGHT * len(measured)
        page = pages.blank(style.FULL_WIDTH, height)
        axes = page.subplots(len(measured), 2, squeeze=False, sharex=True, width_ratios=(3, 2))
        for k, (name, values) in enumerate(measured.items()):
            left, right = axes[k]
            left.plot(t, values, color=style.INK, lw=1.6)
            right.axhline(0.0, color=style.RULE, lw=0.8)
            reached = []
            remains = []
            for twin, colour in colours.items():
                residual = values - predicted[twin][name]
                left.plot(t, predicted[twin][name], color=colour, lw=0.9)
                right.plot(t, residual, color=colour, lw=0.7)
                reached.append(f"{list(fits[twin].values())[k]:.1f}")
                remains.append(f"{np.sqrt(np.mean(residual**2)):.3g}")
            left.set_title(f"fit, %: {', '.join(reached)}")
            right.set_title(f"residual, rms: {', '.join(remains)}")
            left.set_ylabel(f"{name} ({units[name]})")
        for ax in axes[-1]:
            ax.set_xlabel("time (s)")
        pages.set_head(page, style.FULL_WIDTH, title, handles)
        pages.write(page, paths)
    return paths


def twins_figure(rows: Sequence[TwinFigure], path: str | Path) -> list[Path]:
    """Draw the twin's figures over the machine's, a row for each with a mark for each record.

    Write PATH.svg, PATH.png.

    A line is a mark's range, a cross is by published numbers. Figures that are kept aside, and
    variants of a twin, are left out.
    """
    paths = pages.files(Path(path).with_suffix(""))
    rigs: dict[str, dict[tuple[str, str], list[TwinFigure]]] = {}
    for row in known(rows):
        rigs.setdefault(row.rig, {}).setdefault((row.use, row.figure), []).append(row)
    colours = dict(zip(rigs, style.spread(len(rigs)), strict=True))
    place = 0.0
    ticks = []
    places = []
    names = []
    for rig, figures in rigs.items():
        names.append((place + 0.6, rig))
        place += 1.2
        for (_, figure), group in figures.items():
            for k, row in enumerate(group):
                places.append((place + 0.5 + BESIDE * k, row))
            deep = 1.0 + BESIDE * (len(group) - 1)
            count = f", {len(group)} records" if len(group) > 1 else ""
            ticks.append((place + 0.5 * deep, f"{figure}{count}"))
            place += deep
    with style.page(PHONE_WIDTH):
        handles = []
        for use in dict.fromkeys(row.use for _, row in places):
            filling = style.PAPER if use == FITTED else style.INK
            mark: Any = {"color": style.INK, "marker": MARKS[use], "mfc": filling, "ls": ""}
            handles.append(Line2D([], [], label=use, **mark))
        cross = Line2D([], [], color=style.MUTED, marker="x", ls="", label="published numbers")
        handles.append(cross)
        height = pages.head_height(PHONE_WIDTH, handles) + ROW * place + 0.6
        page = pages.blank(PHONE_WIDTH, height)
        ax = page.subplots()
        for at, rig in names:
            ax.text(LEAST * 1.05, at, rig, color=colours[rig], fontweight="bold", va="center")
        for at, row in places:
            _row(ax, at, row, colours[row.rig])
        ax.axvline(1.0, color=style.RULE, lw=0.8, zorder=0)
        ax.set(
            xscale="log", xlim=(LEAST, MOST), ylim=(place + 0.2, 0.0), xlabel="twin over machine"
        )
        ax.set_yticks([at for at, _ in ticks], [words for _, words in ticks])
        ax.set_xticks([0.25, 0.5, 1.0, 2.0, 4.0], ["¼", "½", "1", "2", "4"])
        ax.xaxis.set_minor_locator(NullLocator())
        pages.set_head(page, PHONE_WIDTH, "What simulation said, and what the machine did", handles)
        pages.write(page, paths)
    return paths


def _row(ax: Axes, place: float, row: TwinFigure, colour: str) -> None:
    """Draw a figure's ratio and its range; beyond the axis, or for a twin that falls, a triangle at
    its end.
    """
    ends = np.clip([row.low / row.machine, row.high / row.machine], LEAST, MOST)
    ax.plot(ends, [place, place], color=colour, lw=1.0)
    marks = ((row.published, "x", style.MUTED), (row.twin, MARKS[row.use], colour))
    for value, shape, ink in marks:
        ratio = value / row.machine
        if ratio > MOST:
            mark = ">"
        elif ratio < LEAST:
            mark = "<"
        else:
            mark = shape
        filling = ink
        if row.use == FITTED and mark == shape:
            filling = style.PAPER
        if not math.isnan(ratio):
            at = min(max(ratio, LEAST), MOST)
            ax.plot(at, place, mark, color=ink, mfc=filling, ms=3.5, clip_on=False)
