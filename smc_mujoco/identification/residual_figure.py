"""The figure of a record beside what twins predict, with its residuals."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D

from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.identification.records import Record

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
    paths = pages.files(path)
    colours = dict(zip(predicted, style.spread(len(predicted)), strict=True))
    handles = [Line2D([], [], color=style.INK, label="measured")]
    for twin, colour in colours.items():
        handles.append(Line2D([], [], color=colour, label=twin))
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
