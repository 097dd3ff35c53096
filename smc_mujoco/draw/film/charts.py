"""Charts below a film: x of each group of channels, and u, drawn once and uncovered as the clock
runs.

Two pictures are drawn: the panels with every curve, and the panels with faint curves. A frame takes
the columns up to the clock from the first and the rest from the second, so that it costs one copy.
The time until all rest has most of the width; the rest of the run has a grey strip.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from smc_mujoco.draw import panels, style
from smc_mujoco.draw.decimate import end
from smc_mujoco.draw.panels import Panel
from smc_mujoco.metrics.conventions import SETTLING_BAND, last_exit, scale
from smc_mujoco.simulation.trace import Trace

DPI = 100
LETTERS, TITLE_LETTERS = 13.0, 13.5  # points of a chart 1280 px wide: 18 px and more
WINDOW_WIDTH = 0.82  # of a chart's width, of the time until all rest; chosen
TIME_TICKS = 5  # at most, until all rest
FUTURE_LINE, FUTURE_BAND = 0.45, 0.12  # opacity of what is still to come
LANE_BAND = 0.45  # opacity of a band in a lane of its own
LANE_WIDTH, LANE_HEIGHT = (
    0.82,
    0.84,
)  # of a panel's width and of a lane's pitch; beside a lane is how far u swings
END_SHARE = 0.1  # of the run: its end, over which a lane says how far u swings
SMOOTH_SHARE = 0.02  # of a panel's range: a swing below it is none
LEFT, RIGHT = 0.062, 0.985  # of the width: where the charts begin and end
CHART_GAP = (
    0.155 / 2.155 * (RIGHT - LEFT)
)  # of the width, between two charts: 0.155 of one if there are two
TITLES: dict[Any, float] = {"axes.titlesize": TITLE_LETTERS}
SIZES = ("font.size", "xtick.labelsize", "ytick.labelsize")
SAME_PLACE = 0.5  # of a dot's radius: all dots no farther apart are one, in ink
AGREED = np.array(style.rgb(style.INK))
CURSOR = np.array(style.rgb(style.MUTED))


class Charts:
    """The charts as pictures of `size` px, letters and lines `scale` times as large as in a film
    1280 px wide.
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
        self.window = panels.horizon(traces)
        rests = bool(self.window < self.end)
        self.times = [0.0, *[self.window] * rests, self.end]
        self.shares = [0.0, *[WINDOW_WIDTH] * rests, 1.0]
        self.dot = max(2, round(4.5 * scale))
        self.colours = [np.array(style.rgb(colour)) for colour in colours]
        strip = panels.strip(traces)
        larger = LETTERS / style.RC["xtick.labelsize"]
        sizes: dict[Any, float] = {size: larger * float(style.RC[size]) for size in SIZES}
        with style.page(), rc_context(sizes | TITLES):
            figure = Figure(figsize=(size[0] / DPI / scale, size[1] / DPI / scale), dpi=DPI * scale)
            canvas = FigureCanvasAgg(figure)
            axes = figure.subplots(1, len(strip))
            wide = (RIGHT - LEFT + CHART_GAP) / len(strip) - CHART_GAP
            figure.subplots_adjust(
                left=LEFT, right=RIGHT, bottom=0.13, top=0.85, wspace=CHART_GAP / wide
            )
            artists = []
            rows = []
            for ax, panel in zip(axes, strip, strict=True):
                set_titles(ax, panel, DPI * scale / 72)
                rows.append(
                    lanes(ax, panel, colours) if in_lanes(panel) else [(ax, panel, colours)]
                )
                for row, part, shades in rows[-1]:
                    self.set_time(
                        row, ax.get_window_extent().width * (LANE_WIDTH if in_lanes(panel) else 1.0)
                    )
                    row.tick_params(length=0)
                    panels.mark(row, style.marks(traces, names), named=False)
                    bands = in_lanes(panel) or not panels.crowded(panel)
                    artists += panels.over_time(row, part, shades, panel.traces, bands, names)
                    artists += settled(row, part, shades)
                if in_lanes(panel):
                    swings(rows[-1])
            bands = [artist for artist in artists if isinstance(artist, PolyCollection)]
            self.full = picture(canvas)
            for artist in artists:
                artist.set_alpha(
                    FUTURE_BAND if artist in bands else FUTURE_LINE * (artist.get_alpha() or 1.0)
                )
            self.faint = picture(canvas)
        height = self.full.shape[0]
        boxes = [Bbox.union([ax.get_window_extent() for ax, *_ in row]) for row in rows]
        self.frames = [
            tuple(round(c) for c in (b.x0, height - b.y1, b.x1, height - b.y0)) for b in boxes
        ]
        self.paths = [
            [path(ax, trace, part.quantity, height) for ax, part, _ in row for trace in part.traces]
            for row in rows
        ]

    def share(self, time: Any) -> Any:
        """Return where a time, s, is in a chart, as a share of its width."""
        return np.interp(time, self.times, self.shares)

    def set_time(self, ax: Axes, wide: float) -> None:
        """Set the time axis of axes so wide, px, with the grey strip after the time until all rest."""
        ax.set_xscale(
            "function",
            functions=(self.share, lambda share: np.interp(share, self.shares, self.times)),
        )
        ax.set_xlim(0.0, self.end)
        last = 1.0 - style.width(f"0{self.end:g} s", LETTERS * ax.figure.dpi / 72) / wide
        ticks = []
        for t in MaxNLocator(TIME_TICKS).tick_values(0.0, self.window):
            if self.share(t) < last:
                ticks.append(t)
        ticks = [t for t in ticks if t < min(1.01 * self.window, self.end)]
        ax.set_xticks([*ticks, self.end], [*(f"{t:g}" for t in ticks), f"{self.end:g} s"])
        for label in ax.get_xticklabels()[-1:]:
            label.set_horizontalalignment("right")
        if self.window < self.end:
            ax.axvspan(self.window, self.end, color=style.BAND, lw=0, zorder=0.5)

    def at(self, time: float) -> np.ndarray:
        """Return the charts at a time in s, (height, width, 3) uint8."""
        image = self.faint.copy()
        for (left, top, right, bottom), paths in zip(self.frames, self.paths, strict=True):
            now = round(left + (right - left) * float(self.share(time)))
            rows = slice(top - 3 * self.dot, bottom + 1)
            past = slice(left - self.dot, now + 1)
            image[rows, past] = self.full[rows, past]
            image[top : bottom + 1, now] = CURSOR
            lasting = [  # a run that failed has no place on the cursor
                (float(np.interp(time, t, y)), colour)
                for (t, y), colour in zip(paths, self.colours, strict=True)
                if time <= t[-1] + 1e-9 and np.isfinite(y[0])
            ]
            together = len(lasting) > 1 and np.ptp([y for y, _ in lasting]) < SAME_PLACE * self.dot
            for y, colour in reversed(lasting):  # the first on top
                self.disc(image, now, y, AGREED if together else colour)
        return image

    def disc(self, image: np.ndarray, x: float, y: float, colour: np.ndarray) -> None:
        """Draw a dot with a soft edge at x, y px."""
        r, (height, width) = self.dot + 2, image.shape[:2]
        i = round(y)
        j = round(x)
        rows, cols = np.ogrid[
            max(i - r, 0) : min(i + r + 1, height), max(j - r, 0) : min(j + r + 1, width)
        ]
        distance = np.hypot(rows - y, cols - x)
        for radius, ink in ((self.dot + 1.5, np.array(style.rgb(style.PAPER))), (self.dot, colour)):
            cover = np.clip(radius + 0.5 - distance, 0.0, 1.0)[..., None]
            image[rows, cols] = (image[rows, cols] * (1 - cover) + ink * cover).astype(np.uint8)


Row = tuple[Axes, Panel, Sequence[str]]  # axes, what they show, its colours


def in_lanes(panel: Panel) -> bool:
    """Return whether each law's u has a lane: else bands of several laws would hide each other."""
    return panel.quantity == "u" and len(panel.traces) > 1 and panels.crowded(panel)


def settled(ax: Axes, panel: Panel, colours: Sequence[str]) -> list[Artist]:
    """Mark when each run's x has settled for good, where it does after the start, and return the
    marks.
    """
    marks: list[Artist] = []
    for trace, colour in zip(panel.traces, colours, strict=True) if panel.quantity == "x" else ():
        time = last_exit(
            trace.t, np.abs(trace.x - trace.r).max(axis=1), SETTLING_BAND * scale(trace)
        )
        if trace.diverged_at is None and 0.0 < time < trace.t[-1]:
            y = float(np.interp(time, trace.t, trace.x.mean(axis=1)))
            look = {
                "ms": style.points(7),
                "mec": style.PAPER,
                "mew": style.points(0.7),
                "zorder": 6,
                "clip_on": False,
            }
            marks += ax.plot(time, y, "v", color=colour, **look)
    return marks


def lanes(ax: Axes, panel: Panel, colours: Sequence[str]) -> list[Row]:
    """Return a lane for each trace of a panel, from above, in place of its axes, which keep the
    title.
    """
    ax.set_axis_off()
    pitch = 1.0 / len(panel.traces)
    rows = list[Row]()
    for i, (trace, colour) in enumerate(zip(panel.traces, colours, strict=True)):
        lane = ax.inset_axes((0.0, 1.0 - (i + 1) * pitch, LANE_WIDTH, LANE_HEIGHT * pitch))
        lane.tick_params(labelbottom=i + 1 == len(panel.traces), labelleft=False)
        rows.append((lane, panel._replace(traces=[trace]), [colour]))
    return rows


def swings(rows: Sequence[Row]) -> None:
    """Say beside each lane how far u swings at the end of the run, with a bar; "smooth" if it does
    not.
    """
    for lane, panel, (colour,) in rows:
        (trace,), (low, high) = panel.traces, lane.get_ylim()
        for band in lane.collections:
            band.set_alpha(LANE_BAND)
        u = trace.u[-max(2, round(END_SHARE * len(trace.t))) :]
        u = u[np.isfinite(u)]
        least = float(u.min(initial=np.inf))
        most = float(u.max(initial=-np.inf))
        swing = 0.5 * (most - least)
        if swing > SMOOTH_SHARE * (high - low):
            words = f"±{swing:.2g}"
        else:
            words = "smooth"
        if trace.diverged_at is not None:
            words = "fails"
        if words.startswith("±"):
            ends = lane.transLimits.transform([(0.0, least), (0.0, most)])[:, 1]
            lane.plot(
                [1.012, 1.012],
                ends,
                color=colour,
                lw=style.points(5),
                transform=lane.transAxes,
                clip_on=False,
            )
        size = LETTERS
        lane.text(
            1.035, 0.5, words, transform=lane.transAxes, va="center", fontsize=size, color=style.INK
        )


def set_titles(ax: Axes, panel: Panel, point: float) -> None:
    """Set the panel's label at the left and, at the right, as much of what its lines mean as fits;
    `point` in px.
    """
    words = []
    for name, text in panels.meaning([panel]).items():
        if not (name == "band" and panels.crowded(panel)):
            words.append(f"{name}: {text}")
    room = ax.get_window_extent().width - style.width(panel.label, TITLE_LETTERS * point, bold=True)
    while words and style.width(", ".join(words), LETTERS * point) > room - 10 * point:
        words.pop()
    if panel.quantity == "x":
        marks = [f"▼ {to}{100 * SETTLING_BAND:g} %" for to in ("settled to ", "")]
        words = [mark for mark in marks if style.width(mark, LETTERS * point) < room - 10 * point][
            :1
        ]
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
