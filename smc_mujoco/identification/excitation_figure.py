"""The figure of candidate motions: the reference of each joint, and the expected errors of the
numbers beside it, best motion first.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from smc_mujoco.common.aliases import AnyPath
from smc_mujoco.draw import colouring, style
from smc_mujoco.draw import page as pages

ROW_HEIGHT = 1.15  # inches, of a motion
SHARES = (3, 2)  # of the width: references, errors
TICKS = 1.0, 2.0, 5.0  # of a decade, which have numbers
ROOM = 1.6  # times the least and the largest error, on the axis beyond them


def excitation_figure(
    motions: Sequence[Any], joints: Sequence[str], units: Sequence[str], path: AnyPath
) -> list[Path]:
    """Write PATH.svg and PATH.png, or PATH.pdf, and return the paths.

    Args:
      motions: each an `ExcitingMotion`, best first.
      joints, units: of the driven joints, and of their positions.
    """
    paths = pages.files(path)
    names = list(motions[0].errors)
    colours = colouring.spread(len(joints) + len(names))
    lines = []
    for joint, colour, dashes in zip(joints, colours, style.DASHES, strict=False):
        lines.append({"color": colour, "lw": 1.2, "ls": dashes, "label": joint})
    dots = []
    for k, name in enumerate(names):
        mark = style.MARKS[k % len(style.MARKS)]
        look = {"color": colours[len(joints) + k], "marker": mark, "ls": "", "ms": 6}
        dots.append(look | {"label": name})
    handles = [Line2D([], [], **look) for look in (*lines, *dots)]
    with style.page():
        height = pages.head_height(style.FULL_WIDTH, handles) + ROW_HEIGHT * len(motions) + 0.4
        page = pages.blank(style.FULL_WIDTH, height)
        axes = page.subplots(len(motions), 2, squeeze=False, sharex="col", width_ratios=SHARES)
        for (motion_axes, error_axes), motion in zip(axes, motions, strict=True):
            for row, look in zip(motion.positions, lines, strict=True):
                motion_axes.plot(motion.times, row, **look)
            motion_axes.set_title(motion.name)
            motion_axes.set_ylabel(" and ".join(dict.fromkeys(units)))
            for k, look in enumerate(dots):
                error_axes.plot(100.0 * motion.share(names[k]), -k, **look)
            error_axes.set_title(f"geometric mean {100.0 * motion.mean_share:.2g} %")
            error_axes.set_yticks([])
            error_axes.set_ylim(-len(names), 1)
        shares = [motion.share(name) for motion in motions for name in names]
        percents = 100.0 * np.array(shares)[np.isfinite(shares)]
        axes[-1, 0].set_xlabel("time (s)")
        axes[-1, 1].set_xscale("log")
        axes[-1, 1].set_xlim(percents.min() / ROOM, percents.max() * ROOM)
        axes[-1, 1].xaxis.set_major_locator(LogLocator(subs=TICKS))
        axes[-1, 1].xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes[-1, 1].xaxis.set_minor_formatter(NullFormatter())
        axes[-1, 1].set_xlabel("expected error (% of the number)")
        title = "What to record: expected errors of each motion, least first"
        pages.set_head(page, style.FULL_WIDTH, title, handles)
        pages.write_page(page, paths)
    return paths
