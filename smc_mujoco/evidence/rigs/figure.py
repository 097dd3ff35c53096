"""Figures of records beside what twins predict: one record with its residuals, and the figures of many."""

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
    """Draw each column of a record, measured and predicted, beside its residuals. Write PATH.svg and PATH.png.

    `t`: times, s, (K,). `predicted`, `fits`: name of a twin -> what it predicts, and its fit of each column, percent.
    `units`: of the columns.
    """
    paths = pages.files(Path(path).with_suffix(""))
    colours = dict(zip(predicted, style.spread(len(predicted)), strict=True))
    with style.page():
        handles = [
            Line2D([], [], color=colour, label=twin) for twin, colour in ({"measured": style.INK} | colours).items()
        ]
        height = pages.head_height(style.FULL_WIDTH, handles) + ROW_HEIGHT * len(measured)
        page = pages.blank(style.FULL_WIDTH, height)
        axes = page.subplots(len(measured), 2, squeeze=False, sharex=True, width_ratios=(3, 2))
        for k, ((left, right), (name, values)) in enumerate(zip(axes, measured.items(), strict=True)):
            left.plot(t, values, color=style.INK, lw=1.6)
            right.axhline(0.0, color=style.RULE, lw=0.8)
            reached, left_over = [], []
            for twin, colour in colours.items():
                residual = values - predicted[twin][name]
                left.plot(t, predicted[twin][name], color=colour, lw=0.9)
                right.plot(t, residual, color=colour, lw=0.7)
                fit = list(fits[twin].values())[k]
                reached.append(f"{twin} {fit:.1f}{' %' * (fit > -np.inf)}")
                left_over.append(f"{twin} {np.sqrt(np.mean(residual**2)):.3g}")
            left.set_ylabel(f"{name} ({units[name]})")
            for ax, words in ((left, f"fit: {', '.join(reached)}"), (right, f"residual, rms: {', '.join(left_over)}")):
                room = TITLE_SHARE * 72 * ax.get_window_extent().width / page.dpi
                ax.set_title(style.wrapped(words, room, pages.TEXT_SIZE, lines=2), parse_math=False)
        for ax in axes[-1]:
            ax.set_xlabel("time (s)")
        pages.set_head(page, style.FULL_WIDTH, title, handles)
        pages.write(page, paths)
    return paths


MARKS = {UNFITTED: "D", HELD_OUT: "o", FITTED: "o"}  # filled, but for records that were fitted on
ROW, LEAST, MOST = 0.17, 0.25, 4.0  # inches a row; ends of the axis: a triangle there stands for what is beyond


def twins_figure(rows: Sequence[TwinFigure], path: str | Path) -> list[Path]:
    """Draw the twin's figures over the machine's, a row for each, with its range. Write PATH.svg and PATH.png.

    Figures that are kept aside, and variants of a twin, are left out. A cross is by published numbers.
    """
    paths = pages.files(Path(path).with_suffix(""))
    drawn = [row for row in rows if not row.variant and not math.isnan(row.machine)]
    names = list(dict.fromkeys(row.rig for row in drawn))
    colours = dict(zip(names, style.spread(len(names)), strict=True))
    with style.page():
        keys = [
            Line2D(
                [], [], color=style.INK, marker=MARKS[use], ls="", mfc=style.PAPER if use == FITTED else None, label=use
            )
            for use in dict.fromkeys(row.use for row in drawn)
        ]
        keys.append(Line2D([], [], color=style.MUTED, marker="x", ls="", label="published numbers"))
        height = pages.head_height(style.FULL_WIDTH, keys) + ROW * (len(drawn) + 1.5 * len(names)) + 0.7
        page = pages.blank(style.FULL_WIDTH, height)
        ax = page.subplots()
        place, ticks = 0.0, []
        for name in names:
            place += 1.5
            ax.text(LEAST * 1.03, place - 0.85, name, color=colours[name], fontweight="bold", va="center")
            for row in (one for one in drawn if one.rig == name):
                _row(ax, place, row, colours[name])
                ticks.append((place, f"{row.record}: {row.figure}"))
                place += 1.0
        ax.axvline(1.0, color=style.RULE, lw=0.8, zorder=0)
        ax.set(xscale="log", xlim=(LEAST, MOST), ylim=(place, -0.3), xlabel="twin over machine")
        ax.set_yticks([at for at, _ in ticks], [words for _, words in ticks], fontsize=pages.TEXT_SIZE - 1)
        ax.set_xticks([0.25, 0.5, 0.8, 1.0, 1.25, 2.0, 4.0], ["¼", "½", "0.8", "1", "1.25", "2", "4"])
        ax.xaxis.set_minor_locator(NullLocator())
        pages.set_head(page, style.FULL_WIDTH, "What simulation said, and what the machine did", keys)
        pages.write(page, paths)
    return paths


def _row(ax: Axes, place: float, row: TwinFigure, colour: str) -> None:
    """Draw a figure's ratio and its range; beyond the axis, or for a twin that falls, a triangle at its end."""
    ratios = [value / row.machine for value in (row.low, row.twin, row.high, row.published)]
    low, middle, high, public = (min(max(ratio, LEAST), MOST) for ratio in ratios)
    ax.plot([low, high], [place, place], color=colour, lw=1.4)
    for at, ratio, mark, ink in ((public, ratios[3], "x", style.MUTED), (middle, ratios[1], MARKS[row.use], colour)):
        if math.isnan(ratio):
            continue
        shape = ">" if ratio > MOST else "<" if ratio < LEAST else mark
        filling = style.PAPER if row.use == FITTED and shape == mark else ink
        ax.plot(at, place, shape, color=ink, mfc=filling, ms=4.5, clip_on=False)
