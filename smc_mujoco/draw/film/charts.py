"""The strip charts under a film: x, q of free joints, and u of all traces, drawn once and uncovered as the clock runs.

Two pictures are drawn: the charts with every curve, and the charts with the curves as a faint promise. A frame takes
the columns up to the clock from the first and the rest from the second, so that it costs a copy, whatever they hold.
"""

import itertools
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from smc_mujoco.draw import panels, style
from smc_mujoco.draw.decimate import end
from smc_mujoco.metrics.channel_groups import Group
from smc_mujoco.simulation.trace import Trace

DPI = 100
FAINT = 0.16  # opacity of what is still to come
LEFT, RIGHT = 0.062, 0.985  # of the width: where the charts begin and end
GAP = 0.155 / 2.155 * (RIGHT - LEFT)  # of the width, between two charts: 0.155 of one where there are two
CHATTERING = " where it chatters"
CURSOR = np.array(style.rgb(style.MUTED))


class Charts:
    """The charts as pictures of `size` px; `at` gives a frame of them.

    Attributes:
      scale: pixels per px of a film 1280 wide, by which letters and lines grow.
    """

    def __init__(
        self,
        traces: Sequence[Trace],
        names: Sequence[str],
        colours: Sequence[str],
        size: tuple[int, int],
        scale: float,
    ):
        self.end = end(traces)
        self.dot = max(2, round(4.5 * scale))
        with style.page():
            figure = Figure(figsize=(size[0] / DPI / scale, size[1] / DPI / scale), dpi=DPI * scale)
            canvas = FigureCanvasAgg(figure)
            charts = shown(traces)
            axes = figure.subplots(1, len(charts))
            wide = (RIGHT - LEFT + GAP) / len(charts) - GAP
            figure.subplots_adjust(left=LEFT, right=RIGHT, bottom=0.2, top=0.855, wspace=GAP / wide)
            draw_axes(axes, charts, self.end, DPI * scale / 72)
            for ax in axes:
                panels.jumps(ax, style.jumps(traces, names), named=ax is axes[0])
            drawn = [
                panels.over_time(ax, parts, colours, name, group)
                for ax, (name, group, parts) in zip(axes, charts, strict=True)
            ]
            self.full = picture(canvas)
            for artist in itertools.chain(*drawn):
                artist.set_alpha(FAINT * (artist.get_alpha() or 1.0))
            self.faint = picture(canvas)
            self.frames = [frame(ax, self.full.shape[0]) for ax in axes]
            self.paths = [
                [path(ax, part, name, self.full.shape[0]) for part in parts]
                for ax, (name, _, parts) in zip(axes, charts, strict=True)
            ]
        self.colours = [np.array(style.rgb(colour)) for colour in colours]

    def at(self, time: float) -> np.ndarray:
        """The charts at a time in s, (height, width, 3) uint8."""
        image = self.faint.copy()
        for (left, top, right, bottom), paths in zip(self.frames, self.paths, strict=True):
            now = round(left + (right - left) * min(time / self.end, 1.0))
            rows, past = slice(top - 3 * self.dot, bottom + 1), slice(left - self.dot, now + 1)
            image[rows, past] = self.full[rows, past]
            image[top : bottom + 1, now] = CURSOR
            for (t, y), colour in zip(paths, self.colours, strict=True):
                if time <= t[-1] + 1e-9 and np.isfinite(y[0]):  # a run that failed has no place on the cursor
                    self.disc(image, now, np.interp(time, t, y), colour)
        return image

    def disc(self, image: np.ndarray, x: float, y: float, colour: np.ndarray) -> None:
        """A dot with a soft edge at x, y px."""
        r = self.dot + 2
        i, j = round(y), round(x)
        rows, cols = np.mgrid[max(i - r, 0) : i + r + 1, max(j - r, 0) : j + r + 1]
        rows, cols = rows[:, (cols < image.shape[1])[0]], cols[:, (cols < image.shape[1])[0]]
        keep = (rows < image.shape[0])[:, 0]
        rows, cols = rows[keep], cols[keep]
        distance = np.hypot(rows - y, cols - x)
        for radius, ink in ((self.dot + 1.5, np.array(style.rgb(style.PAPER))), (self.dot, colour)):
            cover = np.clip(radius + 0.5 - distance, 0.0, 1.0)[..., None]
            image[rows, cols] = (image[rows, cols] * (1 - cover) + ink * cover).astype(np.uint8)


def shown(traces: Sequence[Trace]) -> list[tuple[str, Group, list[Trace]]]:
    """What the charts are of, from left to right: x of each group of channels, and u of the driven ones."""
    parts = style.split(traces)
    return [("x", *each) for each in parts.items()] + [("u", *each) for each in parts.items() if each[0].driven]


def draw_axes(axes: Sequence[Axes], charts: Sequence[tuple[str, Group, list[Trace]]], end: float, point: float) -> None:
    """Frames, names and units, and what lines and bands are; a point has `point` px."""
    for ax, (quantity, group, parts) in zip(axes, charts, strict=True):
        n, unit = len(group.channels), style.units(group)[quantity]
        name = f"control u ({unit})" if quantity == "u" else f"{style.quantity(group)} {style.letter(group)} ({unit})"
        words = note(n, panels.mean_window(parts), band=True) if quantity == "u" else note(n)
        room = ax.get_window_extent().width - style.width(name, 11 * point, bold=True) - 15 * point
        brief = words.replace(CHATTERING, "")  # in a narrow chart, what the band is goes before what the line is
        shorter = (words, brief, brief.partition(", ")[2], "")
        words = next(text for text in shorter if not text or style.width(text, 9.5 * point) <= room)
        ax.set_title(name)
        ax.set_title(words, loc="right", fontweight="normal", fontsize=9.5, color=style.MUTED)
        ax.set_xlim(0.0, end)
        ax.set_xlabel("time (s)", labelpad=2)
        ax.tick_params(length=0)


def note(n: int, window: float | None = None, band: bool = False) -> str:
    """What is drawn of n channels, where a line is a mean over them or over a window of time in s."""
    over = [f"of {n}"] if n > 1 else []
    over += [f"over {1e3 * window:.3g} ms{CHATTERING}"] if window else []
    if not over:
        return ""
    single = len(panels.light(n))
    light = [f"light: {'each' if single == n else f'{single} of them'}"] if n > 1 else []
    return ", ".join(["band: range"] * band + [f"line: mean {' '.join(over)}"] + light)


def picture(canvas: FigureCanvasAgg) -> np.ndarray:
    """What the canvas shows, (height, width, 3) uint8."""
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def frame(ax: Axes, height: int) -> tuple[int, int, int, int]:
    """The axes' frame, px from the top left: left, top, right, bottom."""
    box = ax.get_window_extent()
    return round(box.x0), round(height - box.y1), round(box.x1), round(height - box.y0)


def path(ax: Axes, trace: Trace, name: str, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Where a trace's dot is: times in s and px from the top, kept within the frame."""
    t, y = panels.curve(trace, panels.QUANTITIES[name](trace).mean(axis=1), name)
    y = np.clip(y, *ax.get_ylim())
    return t, height - ax.transData.transform(np.column_stack([t, y]))[:, 1]
