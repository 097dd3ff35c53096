"""Figures of records beside what twins predict: one record with its residuals, and the figures of
many.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.evidence.rigs.records import Record
from smc_mujoco.evidence.rigs.twin_figures import FITTED, HELD_OUT, UNFITTED, TwinFigure

TITLE_SHARE = 0.85  # of a panel's width, of the words above it in letters that are not bold
ROW_HEIGHT = 2.6  # inches, height of a column's panels


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
    with style.page():
        handles = [
            Line2D([], [], color=colour, label=twin)
            for twin, colour in ({"measured": style.INK} | colours).items()
        ]
        height = pages.head_height(style.FULL_WIDTH, handles) + ROW_HEIGHT * len(measured)
        page = pages.blank(style.FULL_WIDTH, height)
        axes = page.subplots(len(measured), 2, squeeze=False, sharex=True, width_ratios=(3, 2))
        for k, ((left, right), (name, values)) in enumerate(
            zip(axes, measured.items(), strict=True)
        ):
            left.plot(t, values, color=style.INK, lw=1.6)
            right.axhline(0.0, color=style.RULE, lw=0.8)
            reached = []
            left_over = []
            for twin, colour in colours.items():
                residual = values - predicted[twin][name]
                left.plot(t, predicted[twin][name], color=colour, lw=0.9)
                right.plot(t, residual, color=colour, lw=0.7)
                fit = list(fits[twin].values())[k]
                reached.append(f"{twin} {fit:.1f}{' %' * (fit > -np.inf)}")
                left_over.append(f"{twin} {np.sqrt(np.mean(residual**2)):.3g}")
            left.set_ylabel(f"{name} ({units[name]})")
            for ax, words in (
                (left, f"fit: {', '.join(reached)}"),
                (right, f"residual, rms: {', '.join(left_over)}"),
            ):
                room = TITLE_SHARE * 72 * ax.get_window_extent().width / page.dpi
                ax.set_title(style.wrapped(words, room, pages.TEXT_SIZE, lines=2), parse_math=False)
        for ax in axes[-1]:
            ax.set_xlabel("time (s)")
        pages.set_head(page, style.FULL_WIDTH, title, handles)
        pages.write(page, paths)
    return paths


MARKS = {UNFITTED: "D", HELD_OUT: "o", FITTED: "o"}  # filled, but for records that were fitted on
PHONE_WIDTH = 4.0  # inches of the page of twins, whose letters are read on a phone
ROW, BESIDE = 0.2, 0.35  # inches a row; rows from one record of a figure to the next
LEAST, MOST = 0.25, 4.0  # ends of the axis: a triangle there stands for what is beyond


def twins_figure(rows: Sequence[TwinFigure], path: str | Path) -> list[Path]:
    """Draw the twin's figures over the machine's, a row for each with a mark for each record.

    Write PATH.svg, PATH.png.

    A line is a mark's range, a cross is by published numbers. Figures that are kept aside, and
    variants of a twin, are left out.
    """
    paths = pages.files(Path(path).with_suffix(""))
    groups: dict[tuple[str, str, str], list[TwinFigure]] = {}
    for row in rows:
        if not row.variant and not math.isnan(row.machine):
            groups.setdefault((row.rig, row.use, row.figure), []).append(row)
    names = list(dict.fromkeys(rig for rig, _, _ in groups))
    colours = dict(zip(names, style.spread(len(names)), strict=True))
    with style.page(PHONE_WIDTH):
        keys = []
        for use in dict.fromkeys(use for _, use, _ in groups):
            keys.append(
                Line2D(
                    [],
                    [],
                    color=style.INK,
                    marker=MARKS[use],
                    ls="",
                    mfc=style.PAPER if use == FITTED else None,
                    label=use,
                )
            )
        keys.append(Line2D([], [], color=style.MUTED, marker="x", ls="", label="published numbers"))
        height = len(names) * 1.2 + sum(1.0 + BESIDE * (len(its) - 1) for its in groups.values())
        page = pages.blank(PHONE_WIDTH, pages.head_height(PHONE_WIDTH, keys) + ROW * height + 0.6)
        ax = page.subplots()
        place = 0.0
        ticks = []
        for (rig, _, figure), its in groups.items():
            if rig in names:  # its first
                names.remove(rig)
                ax.text(
                    LEAST * 1.05,
                    place + 0.6,
                    rig,
                    color=colours[rig],
                    fontweight="bold",
                    va="center",
                )
                place += 1.2
            for k, row in enumerate(its):
                _row(ax, place + 0.5 + BESIDE * k, row, colours[rig])
            deep = 1.0 + BESIDE * (len(its) - 1)
            ticks.append(
                (place + 0.5 * deep, f"{figure}, {len(its)} records" if len(its) > 1 else figure)
            )
            place += deep
        ax.axvline(1.0, color=style.RULE, lw=0.8, zorder=0)
        ax.set(
            xscale="log", xlim=(LEAST, MOST), ylim=(place + 0.2, 0.0), xlabel="twin over machine"
        )
        ax.set_yticks([at for at, _ in ticks], [words for _, words in ticks])
        ax.set_xticks([0.25, 0.5, 1.0, 2.0, 4.0], ["¼", "½", "1", "2", "4"])
        ax.xaxis.set_minor_locator(NullLocator())
        pages.set_head(page, PHONE_WIDTH, "What simulation said, and what the machine did", keys)
        pages.write(page, paths)
    return paths


def _row(ax: Axes, place: float, row: TwinFigure, colour: str) -> None:
    """Draw a figure's ratio and its range; beyond the axis, or for a twin that falls, a triangle at
    its end.
    """
    ratios = [value / row.machine for value in (row.low, row.twin, row.high, row.published)]
    low, middle, high, public = (min(max(ratio, LEAST), MOST) for ratio in ratios)
    ax.plot([low, high], [place, place], color=colour, lw=1.0)
    for at, ratio, mark, ink in (
        (public, ratios[3], "x", style.MUTED),
        (middle, ratios[1], MARKS[row.use], colour),
    ):
        if math.isnan(ratio):
            continue
        if ratio > MOST:
            shape = ">"
        else:
            shape = "<" if ratio < LEAST else mark
        if row.use == FITTED and shape == mark:
            filling = style.PAPER
        else:
            filling = ink
        ax.plot(at, place, shape, color=ink, mfc=filling, ms=3.5, clip_on=False)
