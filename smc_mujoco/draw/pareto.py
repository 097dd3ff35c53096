"""Pareto fronts of tunings: tracking error against variation of the command, one staircase for each
law.

    pareto([tune("duffing", law) for law in ("observer_free", "classical")], "fronts.svg")

Down and to the left is better. A front has the gains that no others of the search beat in both
terms. No tried gains lie below the staircase. The chosen gains have the least objective, see
`analysis.tuning.objective`. Searches have other runs each, so a front is that of the first one,
whose runs are the same for every law.
"""

import itertools
import os
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from smc_mujoco.analysis.tuning.result import Tuned, compare
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.draw.page import Size

PAGE_HEIGHT = 4.8  # inches on a full page
MIN_VARIATION = 1e-6  # 1/s: smaller ones are drawn here, because the axis may be logarithmic


def pareto(
    tunings: Sequence[Tuned],
    path: str | os.PathLike[str] | None = None,
    title: str | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure | SubFigure:
    """Draw the fronts of tunings of one plant that have the same objective, budget and seed.

    Args:
      tunings: one per law.
      path, size, format, fig: as in `figure`.
      title: default: one with the plant's name.

    Raises:
      ScenarioError: no tunings, tunings that cannot be compared, or as `figure`.
    """
    paths = pages.files(path, format)
    best = compare(tunings)
    width, height = pages.measure(size, fig)
    with style.page(width):
        page = pages.blank(width, height or style.points(PAGE_HEIGHT), fig)
        ax = page.subplots()
        looks = zip(
            best,
            itertools.cycle(style.MARKS),
            style.law_colours([tuned.law for tuned in best]),
            strict=False,
        )
        handles = [_front(ax, *look) for look in looks]
        for scale, (low, high) in {
            "xscale": ax.dataLim.intervalx,
            "yscale": ax.dataLim.intervaly,
        }.items():
            if high > style.LOG_RANGE * low:
                ax.set(**{scale: "log"})
        ax.set_xlabel("tracking: ITAE / |x₀|, summed over conditions (s²)")
        ax.set_ylabel("variation: TV / (u_max T), summed over conditions (1/s)")
        ax.tick_params(which="both", length=0)
        ax.margins(0.04, 0.06)
        handles.append(
            Line2D([], [], color=style.MUTED, marker="o", label="large: chosen gains", **_ring())
        )
        pages.set_head(page, width, title or f"Tuning: {style.plant_name(best[0].plant)}", handles)
        pages.write(page, paths)
    return page


def _ring() -> dict[str, Any]:
    """Return the look of the mark of chosen gains."""
    return {"mfc": "none", "lw": 0, "ms": style.points(11), "mew": style.points(2.0)}


def _front(ax: Axes, tuned: Tuned, mark: str, colour: str) -> Line2D:
    """Draw a law's front with its chosen gains, and return its entry in the legend."""
    words = style.law_name(tuned.law)
    if not tuned.front:
        return Line2D([], [], color=colour, lw=style.points(3), label=f"{words}: every run failed")
    x = [tried.tracking for tried in tuned.front]
    y = [max(tried.variation, MIN_VARIATION) for tried in tuned.front]
    ax.step(
        x, y, where="post", color=colour, marker=mark, ms=style.points(4.5), mec="none", alpha=0.9
    )
    chosen = tuned.searches[0].chosen
    ax.plot(
        [chosen.tracking],
        [max(chosen.variation, MIN_VARIATION)],
        color=colour,
        marker=mark,
        zorder=3,
        **_ring(),
    )
    label = f"{words}: J = {chosen.objective:.3g} s²"
    return Line2D(
        [],
        [],
        color=colour,
        lw=style.points(3),
        marker=mark,
        ms=style.points(7),
        mec="none",
        label=label,
    )
