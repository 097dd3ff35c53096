"""Charts below a film: x of each group of channels, and u, drawn once and uncovered as the clock runs.

Two pictures are drawn: the panels with every curve, and the panels with faint curves. A frame takes the columns up to
the clock from the first and the rest from the second, so that it costs one copy.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from smc_mujoco.draw import panels, style
from smc_mujoco.draw.decimate import end
from smc_mujoco.draw.panels import Panel
from smc_mujoco.simulation.trace import Trace

DPI = 100
FUTURE_OPACITY = 0.16  # of curves that are still to come
LEFT, RIGHT = 0.062, 0.985  # of the width: where the charts begin and end
CHART_GAP = 0.155 / 2.155 * (RIGHT - LEFT)  # of the width, between two charts: 0.155 of one if there are two
CURSOR = np.array(style.rgb(style.MUTED))


class Charts:
    """The charts as pictures of `size` px, letters and lines `scale` times as large as in a film 1280 px wide."""

    def __init__(
        self, traces: Sequence[Trace], names: Sequence[str], colours: Sequence[str], size: tuple[int, int], scale: float
    ):
        self.end = end(traces)
        self.dot = max(2, round(4.5 * scale))
        self.colours = [np.array(style.rgb(colour)) for colour in colours]
        strip = panels.strip(traces)
        with style.page():
            figure = Figure(figsize=(size[0] / DPI / scale, size[1] / DPI / scale), dpi=DPI * scale)
            canvas = FigureCanvasAgg(figure)
            axes = figure.subplots(1, len(strip))
            wide = (RIGHT - LEFT + CHART_GAP) / len(strip) - CHART_GAP
            figure.subplots_adjust(left=LEFT, right=RIGHT, bottom=0.2, top=0.855, wspace=CHART_GAP / wide)
            artists = []
            for ax, panel in zip(axes, strip, strict=True):
                set_titles(ax, panel, DPI * scale / 72)
                ax.set_xlim(0.0, self.end)
                ax.set_xlabel("time (s)", labelpad=2)
                ax.tick_params(length=0)
                panels.mark(ax, style.marks(traces, names), named=False)
                artists += panels.over_time(ax, panel, colours, bands=not panels.crowded(panel))
            self.full = picture(canvas)
            for artist in artists:
                artist.set_alpha(FUTURE_OPACITY * (artist.get_alpha() or 1.0))
            self.faint = picture(canvas)
        height = self.full.shape[0]
        boxes = [ax.get_window_extent() for ax in axes]
        self.frames = [tuple(round(c) for c in (b.x0, height - b.y1, b.x1, height - b.y0)) for b in boxes]
        self.paths = [
            [path(ax, trace, panel.quantity, height) for trace in panel.traces]
            for ax, panel in zip(axes, strip, strict=True)
        ]

    def at(self, time: float) -> np.ndarray:
        """Return the charts at a time in s, (height, width, 3) uint8."""
        image = self.faint.copy()
        for (left, top, right, bottom), paths in zip(self.frames, self.paths, strict=True):
            now = round(left + (right - left) * min(time / self.end, 1.0))
            rows, past = slice(top - 3 * self.dot, bottom + 1), slice(left - self.dot, now + 1)
            image[rows, past] = self.full[rows, past]
            image[top : bottom + 1, now] = CURSOR
            for (t, y), colour in reversed(list(zip(paths, self.colours, strict=True))):  # the first on top
                if time <= t[-1] + 1e-9 and np.isfinite(y[0]):  # a run that failed has no place on the cursor
                    self.disc(image, now, np.interp(time, t, y), colour)
        return image

    def disc(self, image: np.ndarray, x: float, y: float, colour: np.ndarray) -> None:
        """Draw a dot with a soft edge at x, y px."""
        r, (height, width) = self.dot + 2, image.shape[:2]
        i, j = round(y), round(x)
        rows, cols = np.ogrid[max(i - r, 0) : min(i + r + 1, height), max(j - r, 0) : min(j + r + 1, width)]
        distance = np.hypot(rows - y, cols - x)
        for radius, ink in ((self.dot + 1.5, np.array(style.rgb(style.PAPER))), (self.dot, colour)):
            cover = np.clip(radius + 0.5 - distance, 0.0, 1.0)[..., None]
            image[rows, cols] = (image[rows, cols] * (1 - cover) + ink * cover).astype(np.uint8)


def set_titles(ax: Axes, panel: Panel, point: float) -> None:
    """Set the panel's label at the left and, at the right, as much of what its lines mean as fits; `point` in px."""
    words = [
        f"{name}: {text}"
        for name, text in panels.meaning([panel]).items()
        if not (name == "band" and panels.crowded(panel))
    ]
    room = ax.get_window_extent().width - style.width(panel.label, 11 * point, bold=True) - 15 * point
    while words and style.width(", ".join(words), 9.5 * point) > room:
        words.pop()
    ax.set_title(panel.label)
    panels.note(ax, ", ".join(words))


def picture(canvas: FigureCanvasAgg) -> np.ndarray:
    """Return what the canvas shows, (height, width, 3) uint8."""
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def path(ax: Axes, trace: Trace, name: str, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the path of a trace's dot: times in s and px from the top, kept within the axes."""
    t, y = panels.curve(trace, panels.QUANTITIES[name](trace).mean(axis=1), name)
    y = np.clip(y, *ax.get_ylim())
    return t, height - ax.transData.transform(np.column_stack([t, y]))[:, 1]
