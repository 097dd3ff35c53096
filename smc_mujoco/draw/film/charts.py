"""Charts below a film: x of each group of channels, and u, or a map of paths, drawn once and
uncovered as the clock runs.

Two pictures are drawn: the panels with every curve, and the panels with faint curves. A frame takes
the columns up to the clock from the first and the rest from the second, so that it costs one copy.
The time until all rest has most of the width; the rest of the run has a grey strip.
"""

import functools
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
from PIL import Image, ImageDraw

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import panels, style
from smc_mujoco.draw.decimate import end
from smc_mujoco.draw.film import arrows, flight
from smc_mujoco.draw.film.caption import fitted
from smc_mujoco.draw.panels import Panel
from smc_mujoco.metrics.conventions import last_exit, scale, settling_band
from smc_mujoco.simulation.trace import Trace

# Numbers of presentation here are chosen.
DPI = 120
LETTER_POINTS = 22.2  # height in points: that of the captions' letters
WINDOW_WIDTH = 0.82  # of a chart's width, of the time until all rest
TIME_TICKS = 5  # at most, until all rest
FUTURE_LINE = 0.45  # opacity of what is still to come
FUTURE_BAND = 0.12
LANE_BAND = 0.45  # opacity of a band in a lane of its own
LANE_GAP = 8  # points between a lane, and how far u swings
LANE_HEIGHT = 0.84  # of a lane's pitch
END_SHARE = 0.1  # of the run: its end, over which a lane says how far u swings
MAX_SWITCHES = 20  # of a u that shares its axes with others
SMOOTH_SHARE = 0.02  # of a panel's range: a swing below it is none
RIGHT = 0.985
BOTTOM = 0.19  # of the height
TOP = 0.83

Row = tuple[Axes, Panel, Sequence[str]]  # axes, what they show, its colours


class Charts:
    """The charts as pictures of `size` px, letters and lines `scale` times as large as in a film
    1280 px wide. They begin at the time `start` of the film, s.
    """

    def __init__(
        self,
        traces: Sequence[Trace],
        names: Sequence[str],
        colours: Sequence[str],
        size: tuple[int, int],
        scale: float,
        start: float = 0.0,
    ):
        self.start = start
        self.end = end(traces)
        self.window = panels.horizon(traces)
        self.times = [0.0, self.window, self.end]
        self.shares = [0.0, WINDOW_WIDTH, 1.0]
        if self.window >= self.end:
            self.times = [0.0, self.end]
            self.shares = [0.0, 1.0]
        self.dot = max(2, round(4.5 * scale))
        self.colours = colours
        strip = panels.strip(traces)
        larger = LETTER_POINTS / style.RC["xtick.labelsize"]
        letters: dict[Any, Any] = {"axes.titlesize": LETTER_POINTS, "axes.titleweight": "normal"}
        for name in ("font.size", "xtick.labelsize", "ytick.labelsize"):
            letters[name] = larger * float(style.RC[name])
        with style.page(), rc_context(letters):
            figure = Figure(figsize=(size[0] / DPI / scale, size[1] / DPI / scale), dpi=DPI * scale)
            canvas = FigureCanvasAgg(figure)
            axes = figure.subplots(1, len(strip))
            left = style.width("−00.00", LETTER_POINTS * DPI * scale / 72) / size[0]
            gap = left / (RIGHT / len(strip) - left)
            figure.subplots_adjust(left=left, right=RIGHT, bottom=BOTTOM, top=TOP, wspace=gap)
            artists: list[Artist] = []
            rows = []
            flown = None
            for ax, panel in zip(axes, strip, strict=True):
                point = DPI * scale / 72
                room = ax.get_window_extent().width
                if panel.quantity == "path":
                    artists += flight.paths(ax, panel, colours)
                    flown = functools.partial(flight.flights, ax, panel.traces)
                    continue
                words, high = fitted(panel.label, room, LETTER_POINTS * point)
                ax.set_title(words, fontsize=high / point)
                laned = in_lanes(panel)
                found = lanes(ax, panel, colours) if laned else [(ax, panel, colours)]
                bands = laned or not panels.crowded(panel)
                for row, part, shades in found:
                    self.set_time(row)
                    row.tick_params(length=0)
                    panels.mark(row, style.marks(traces, names), named=False)
                    artists += panels.over_time(row, part, shades, panel.traces, bands, names)
                    artists += settled(row, part, shades)
                    if laned:
                        tell_swing(row, part.traces[0], shades[0])
                rows.append(found)
            self.full = picture(canvas)
            fade(artists)
            self.faint = picture(canvas)
        self.find(rows)
        self.flights = flown(self.full.shape[0]) if flown else []

    def find(self, rows: Sequence[Sequence[Row]]) -> None:
        """Find the frames of the panels in the picture, px, and the paths of their dots."""
        height = self.full.shape[0]
        self.frames = []
        self.paths = []
        self.words = []  # boxes that the cursor does not cross
        for row in rows:
            box = Bbox.union([ax.get_window_extent() for ax, *_ in row])
            sides = (box.x0, height - box.y1, box.x1, height - box.y0)
            self.frames.append(tuple(map(round, sides)))
            paths = []
            for ax, part, _ in row:
                for text in ax.texts:
                    box = text.get_window_extent()
                    sides = (box.x0, height - box.y1, box.x1, height - box.y0)
                    self.words.append(tuple(map(round, sides)))
                paths += [path(ax, trace, part.quantity, height) for trace in part.traces]
            self.paths.append(paths)

    def share(self, time: Any) -> Any:
        """Return where a time, s, is in a chart, as a share of its width."""
        return np.interp(time, self.times, self.shares)

    def time(self, share: Any) -> Any:
        """Return the time, s, at a share of a chart's width."""
        return np.interp(share, self.shares, self.times)

    def set_time(self, ax: Axes) -> None:
        """Set the time axis of axes, with the grey strip after all rest."""
        ax.set_xscale("function", functions=(self.share, self.time))
        ax.set_xlim(0.0, self.end)
        wide = ax.get_window_extent().width  # px
        point = ax.figure.dpi / 72
        last = 1.0 - style.width(f"000{self.end:.3g} s", LETTER_POINTS * point) / wide
        stop = min(1.01 * self.window, self.end)
        count = min(
            TIME_TICKS, int(wide * self.shares[1] / style.width("0.0000", LETTER_POINTS * point))
        )
        ticks = np.asarray(MaxNLocator(max(count, 1)).tick_values(0.0, self.window))
        ticks = ticks[(self.share(ticks) < last) & (ticks < stop)].tolist()
        last_words = f"{self.end:.3g} s"
        ax.set_xticks([*ticks, self.end], [*(f"{tick:g}" for tick in ticks), last_words])
        labels = ax.get_xticklabels()
        for label, side in zip(labels[:1] + labels[-1:], ("left", "right"), strict=False):
            label.set_horizontalalignment(side)
        if self.window < self.end:
            ax.axvspan(self.window, self.end, color=style.BAND, lw=0, zorder=0.5)

    def at(self, time: float) -> Array:
        """Return the charts at a time in s, (height, width, 3) uint8."""
        time -= self.start
        charts = self.faint.copy()
        dots = []
        for (left, top, right, bottom), paths in zip(self.frames, self.paths, strict=True):
            now = round(left + (right - left) * float(self.share(time)))
            rows = slice(top - 3 * self.dot, bottom + 1)
            past = slice(left - self.dot, now + 1)
            charts[rows, past] = self.full[rows, past]
            charts[top : bottom + 1, now] = style.rgb(style.MUTED)
            for first, above, last, below in self.words:
                if first <= now <= last:
                    charts[above : below + 1, now] = self.faint[above : below + 1, now]
            lasting = []  # a run that failed has no place on the cursor
            for (t, y), colour in zip(paths, self.colours, strict=True):
                if time <= t[-1] + 1e-9 and np.isfinite(y[0]):
                    lasting.append((now, float(np.interp(time, t, y)), colour))
            dots += reversed(lasting)  # the first on top
        if self.flights:
            mask = Image.new("L", charts.shape[1::-1])
            for (t, line), colour in zip(
                reversed(self.flights), reversed(self.colours), strict=False
            ):
                flown = line[t <= time + 1e-9]
                ImageDraw.Draw(mask).line(flown.ravel().tolist(), 255, 3 * self.dot)
                dots.append((*flown[-1].tolist(), colour))
            charts = np.where(np.asarray(mask)[..., None] > 0, self.full, charts)
        image = Image.fromarray(charts)
        for x, y, colour in dots:
            self.disc(image, x + 0.5, y + 0.5, self.dot + 1.5, style.PAPER)
            self.disc(image, x + 0.5, y + 0.5, self.dot, colour)
        return np.asarray(image)

    def disc(self, image: Image.Image, x: float, y: float, radius: float, colour: str) -> None:
        """Draw a disc with smooth edges about x, y px."""
        angles = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
        edge = np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])
        arrows.paint(image, edge, arrows.rgba(colour))


def fade(artists: Sequence[Artist]) -> None:
    """Make curves and bands faint, as what is still to come is."""
    for artist in artists:
        if isinstance(artist, PolyCollection):
            artist.set_alpha(FUTURE_BAND)
        else:
            artist.set_alpha(FUTURE_LINE * (artist.get_alpha() or 1.0))


def in_lanes(panel: Panel) -> bool:
    """Return whether each law's u has its own lane, because a wide band would hide the others, or
    one that switches often.
    """
    if panel.quantity != "u" or len(panel.traces) < 2:
        return False
    least = panels.MIN_WIDE_BAND * np.ptp(panels.limits(panel.traces, "u"))
    switches = [np.sum(np.abs(np.diff(trace.u, axis=0)) > least) for trace in panel.traces]
    return max(switches) > MAX_SWITCHES or panels.crowded(panel, 0)


def settled(ax: Axes, panel: Panel, colours: Sequence[str]) -> list[Artist]:
    """Mark when each run's x has settled for good, where it does after the start, and return the
    marks.
    """
    marks: list[Artist] = []
    if panel.quantity != "x":
        return marks
    look = {"ms": style.points(7), "mec": style.PAPER, "mew": style.points(0.7)}
    for trace, colour in zip(panel.traces, colours, strict=True):
        error = np.abs(trace.x - trace.r).max(axis=1)
        time = last_exit(trace.t, error, settling_band(trace.scenario, scale(trace)))
        if trace.diverged_at is None and 0.0 < time < trace.t[-1]:
            y = float(np.interp(time, trace.t, trace.x.mean(axis=1)))
            marks += ax.plot(time, y, "v", color=colour, zorder=6, clip_on=False, **look)
    return marks


def lanes(ax: Axes, panel: Panel, colours: Sequence[str]) -> list[Row]:
    """Return a lane for each trace of a panel, from above, in place of its axes, which keep the
    title.
    """
    ax.set_axis_off()
    pitch = 1.0 / len(panel.traces)
    point = ax.figure.dpi / 72  # px
    beside = style.width("smooth", LETTER_POINTS * point) + LANE_GAP * point
    wide = 1.0 - beside / ax.get_window_extent().width
    rows = list[Row]()
    for i, (trace, colour) in enumerate(zip(panel.traces, colours, strict=True), 1):
        lane = ax.inset_axes((0.0, 1.0 - i * pitch, wide, LANE_HEIGHT * pitch))
        lane.tick_params(labelbottom=i == len(panel.traces), labelleft=False)
        rows.append((lane, panel._replace(traces=[trace]), [colour]))
    return rows


def tell_swing(lane: Axes, trace: Trace, colour: str) -> None:
    """Say beside a lane how far u swings at the end of the run, with a bar; "smooth" if it does
    not.
    """
    low, high = lane.get_ylim()
    for band in lane.collections:
        band.set_alpha(LANE_BAND)
    u = trace.u[-max(2, round(END_SHARE * len(trace.t))) :]
    u = u[np.isfinite(u)]
    least = float(u.min(initial=np.inf))
    most = float(u.max(initial=-np.inf))
    swing = 0.5 * (most - least)
    if trace.diverged_at is not None:
        words = "fails"
    elif swing > SMOOTH_SHARE * (high - low):
        words = f"±{swing:.2g}"
        ends = lane.transLimits.transform([(0.0, least), (0.0, most)])[:, 1]
        look = {"color": colour, "lw": style.points(5), "clip_on": False}
        lane.plot([1.012, 1.012], ends, transform=lane.transAxes, **look)
    else:
        words = "smooth"
    look = {"va": "center", "fontsize": LETTER_POINTS, "color": style.INK}
    place = {"xytext": (LANE_GAP, 0.0), "textcoords": "offset points"}
    lane.annotate(words, (1.0, 0.5), xycoords="axes fraction", **place, **look)


def picture(canvas: FigureCanvasAgg) -> Array:
    """Return what the canvas shows, (height, width, 3) uint8."""
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def path(ax: Axes, trace: Trace, name: str, height: int) -> tuple[Array, Array]:
    """Return the path of a trace's dot: times in s and px from the top, kept within the axes."""
    t, y = panels.curve(trace, panels.QUANTITIES[name](trace).mean(axis=1), name)
    y = np.clip(y, *ax.get_ylim())
    return t, height - ax.transData.transform(np.column_stack([t, y]))[:, 1]
