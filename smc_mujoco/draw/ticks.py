"""Ticks of horizontal axes: as many as there is room for, as wide as their labels are."""

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import FontProperties
from matplotlib.ticker import AutoLocator, MaxNLocator

from smc_mujoco.draw import style

MOST = 9  # ticks of an axis, as of matplotlib's own
GAP = 0.6  # between labels, in heights of their letters


class Spaced(AutoLocator):
    """Round places whose labels do not touch. Matplotlib's own takes labels for three heights of a letter wide."""

    def __init__(self):
        super().__init__()
        self.size = FontProperties(size=matplotlib.rcParams["xtick.labelsize"]).get_size_in_points()

    def __call__(self) -> list[float]:
        """Return the ticks of the visible range."""
        assert self.axis is not None
        low, high = sorted(self.axis.get_view_interval())
        box, formatter, ticks = self.axis.axes.bbox, self.axis.get_major_formatter(), []
        for most in range(MOST, 0, -1):
            self.set_params(nbins=most)
            ticks = [tick for tick in self.tick_values(low, high).tolist() if low <= tick <= high]
            widest = max((style.width(text, self.size) for text in formatter.format_ticks(ticks)), default=0.0)
            pitch = 72 * box.width / self.axis.figure.dpi * (ticks[1] - ticks[0]) / (high - low) if ticks[1:] else 0.0
            if widest + GAP * self.size <= pitch:
                return ticks
        return ticks[:1]


def space(page: Figure | SubFigure) -> None:
    """Give the axes of a page ticks whose labels do not touch. Logarithmic axes and ticks that were set stay."""
    for ax in page.findobj(Axes):
        assert isinstance(ax, Axes)
        if isinstance(ax.xaxis.get_major_locator(), MaxNLocator):
            ax.xaxis.set_major_locator(Spaced())
