"""The page of a film: a figure of its runs, with room for the pictures of the machines.

Its title, labels and panels are the artists of figures (page.py, panels.py). They are drawn twice,
with and without curves. A frame has the curves up to the clock, and costs a copy. Only what moves
is drawn in each frame: the clock, what is said of a machine, the cursor, and the dots where the
runs are.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

from smc_mujoco.common.aliases import Array
from smc_mujoco.control.source import DEFAULT
from smc_mujoco.draw import lanes, lettering, panels, style, wording
from smc_mujoco.draw import page as pages
from smc_mujoco.draw.figure import DrawnRuns
from smc_mujoco.draw.film import charts, flight
from smc_mujoco.draw.film.camera import Room
from smc_mujoco.draw.lanes import Row
from smc_mujoco.draw.states import State
from smc_mujoco.metrics.catalogue import settling_time
from smc_mujoco.simulation.trace import Trace

# Numbers of presentation here are chosen. The letters of a page of this width, those of a journal's
# column, are 11 px high where the film is as wide as a phone, 390 px.
WIDTH = 3.9  # inches
ONE_SIZE = dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "axes.titlesize"), 8.0)
LOOK = ONE_SIZE | {"axes.titlepad": 3.0}  # points; below the pictures, which hide what is higher
LINE_PITCH = 1.2  # of letters
EDGE = 0.6  # letters, from the picture's edge to text
CHARTS_SHARE = 0.355  # of the film's height
MAX_LINES = 3  # of a label
SAMPLE = 0.5  # letters, height of the line above a label
INSET = 0.3  # letters, of that line, from its tile's side
LEAST_TITLE = 0.75  # of the size of letters, of a long title, and of long labels
TIME_TICKS = 5  # at most
STATE_PLACE = 0.3  # letters, of what is said of a machine, from the corner of its tile
STATE_HEIGHT = 1.5  # letters, from the top of a tile to below what is said there
EVENT_TIME = 0.6  # s of the film over which words on what has ended fade; chosen
PACE = "4× slower"  # at its widest
APART = 0.5  # letters, more than which the key ends before the room for the pace; chosen
FIRST_LINE, SECOND_LINE = 0.62, 1.57  # lines, from the top to the middle of their letters
HEAD_HEIGHTS = {1: 1.25, 2: 2.1}  # number of lines over the machines -> their height, in lines


class Moment(NamedTuple):
    """What a frame shows beside the machines: the time of the run, s, the speed of playback, what
    is said of each machine, and whether it is a single picture, without a speed.
    """

    time: float
    speed: float
    states: Sequence[State | None]
    still: bool = False


class Moving(NamedTuple):
    """What moves in a panel over time: its cursor, the words before which it passes, and a dot with
    the line that it follows for each run.
    """

    axes: Axes
    cursor: Line2D
    dots: Sequence[tuple[Line2D, Array, Array]]  # dot, times in s, values


def letters(size: tuple[int, int]) -> float:
    """Return the height of the letters of a film of this size, px."""
    return ONE_SIZE["xtick.labelsize"] / 72 * size[0] / WIDTH


def room_of(size: tuple[int, int], lines: int) -> Room:
    """Return the room for machines and their labels in a film of this size, below so many lines."""
    top = HEAD_HEIGHTS[lines] * LINE_PITCH * letters(size)
    foot = (1.0 - CHARTS_SHARE) * size[1]
    return Room(0.0, top, size[0], foot)


def clock_room(size: tuple[int, int], stop: float) -> float:
    """Return the room for the clock of a film that ends at a time, s, px."""
    return lettering.width(f"{stop:.3f} s", letters(size), bold=True)


def key_room(size: tuple[int, int], stop: float, title: str = "") -> float:
    """Return the room for the key beside the clock of a film that ends at a time, s, px; also
    beside the title if it is given.
    """
    high = letters(size)
    room = size[0] - 2 * EDGE * high
    room -= clock_room(size, stop) + lettering.width(PACE, high) + 2 * high
    if title:
        room -= lettering.width(title, high, bold=True) + high
    return room


def head_lines(
    runs: DrawnRuns, size: tuple[int, int], title: str | None, keys: Sequence[Sequence[str]]
) -> int:
    """Return the number of lines over the machines: one where the title has room beside each of
    the keys and the clock, and nothing happens to the plants, which is told there, too; without a
    title one. A film of default gains always says so.
    """
    head = one_line(wording.titled(title, runs.head))
    if not head:
        return 1
    if runs.events:
        return 2
    room = key_room(size, runs.span[1], head)
    gains = least_gains(runs.gains)
    for key in keys:
        words = " · ".join(filter(None, [*key, gains]))
        if lettering.width(words, letters(size)) > room:
            return 2
    return 1


def least_gains(words: str) -> str:
    """Return the least that a film says of where gains come from: which are defaults, or that some
    are; "" if none is.
    """
    if DEFAULT not in words:
        return ""
    return "gains partly default" if "," in words else words


def one_line(words: str) -> str:
    """Return words without breaks of lines."""
    return " ".join(words.split())


def joint_shortened(label: str, room: float, high: float) -> str:
    """Return the label of a panel with its first word, the joint's name, cut to what has room, px;
    the quantity and its unit stay.
    """
    name, gap, quantity = label.partition(" ")
    rest = gap + quantity
    return lettering.cropped(name, room - lettering.width(rest, high), high) + rest


class Labels(NamedTuple):
    """The names of machines, each on some lines, and the height of their letters, px."""

    words: Sequence[str]
    letters: float

    @classmethod
    def of(cls, names: Sequence[str], room: float, high: float) -> "Labels":
        """Return labels for an allowed width, px, with letters `high` px high; with smaller ones
        where a name would be cropped.
        """
        for share in (1.0, LEAST_TITLE):
            size = share * high
            words = []
            for name in wording.distinct(names):
                parts = name.replace("_", "_ ")
                lines = lettering.wrapped(parts, room - EDGE * high, size, MAX_LINES)
                words.append(lines.replace("_ ", "_"))
            if not any("…" in name for name in words):
                break
        return cls(words, size)


def label_sizes(names: Sequence[str], size: tuple[int, int], room: float) -> tuple[Array, float]:
    """Return widths and heights of labels, (n, 2) px, for an allowed width, px, which those that do
    not fit exceed, and how well they are read: smaller ones less well.
    """
    high = letters(size)
    labels = Labels.of(names, room, high)
    sizes = []
    for words, name in zip(labels.words, wording.distinct(names), strict=True):
        lines = [name] if "…" in words else words.split("\n")
        wide = lettering.widest(lines, labels.letters)
        tall = LINE_PITCH * (1 + words.count("\n")) * labels.letters + SAMPLE * high
        sizes.append((wide + EDGE * high, tall))
    return np.array(sizes), labels.letters / high


class Sheet:
    """The page of a film of some size, px, from the time `start` of the run, s.

    `key` has the words below the title, before the `order` of machines in one picture and the
    source of the gains; beside it, of one of the `lines`. `tiles` and `labels`, (machines, 4) px,
    are where the machines and their labels are.
    """

    def __init__(
        self,
        runs: DrawnRuns,
        size: tuple[int, int],
        tiles: Array,
        labels: Array,
        title: str | None = None,
        key: Sequence[str] = (),
        start: float = 0.0,
        lines: int = 2,
        order: str = "",
    ):
        self.runs = runs
        self.size = size
        self.tiles = tiles
        self.start = start
        self.letters = letters(size)
        light = rc_context({"axes.facecolor": style.PAPER})  # whatever the caller's page
        with light, style.page(WIDTH), rc_context(LOOK):  # pyright: ignore[reportArgumentType]
            inches = (WIDTH, WIDTH * size[1] / size[0])
            self.page = Figure(figsize=inches, dpi=size[0] / WIDTH)
            self.canvas = FigureCanvasAgg(self.page)
            self.write_head(one_line(wording.titled(title, runs.head)), key, lines, order)
            self.write_labels(labels)
            rim = withStroke(linewidth=style.points(3), foreground=style.PAPER)
            corners = tiles[:, :2] + STATE_PLACE * self.letters
            look = {"va": "top", "weight": "bold", "path_effects": [rim]}
            self.says = [self.write(*corner, **look) for corner in corners.tolist()]
            curves, self.moving, self.flights = self.draw_panels()
        self.full = self.raster()
        for artist in curves:
            artist.set_visible(False)
        self.empty = self.raster()
        self.frames = [self.box(moving_line.axes) for moving_line in self.moving]

    def raster(self) -> Array:
        """Return the page without what moves, (height, width, 4) uint8."""
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba()).copy()

    def box(self, ax: Axes) -> tuple[int, int, int, int]:
        """Return where axes are: left, top, right, bottom px."""
        box = ax.get_window_extent()
        sides = (box.x0, self.size[1] - box.y1, box.x1, self.size[1] - box.y0)
        left_edge, top, right, bottom = map(round, sides)
        return left_edge, top, right, bottom

    def write(self, x: float, y: float, words: str = "", **look) -> Text:
        """Write words at a place, px from the top left; without words, those of each frame."""
        look = {"fontsize": ONE_SIZE["xtick.labelsize"], "color": style.INK} | look
        place = (x / self.size[0], 1.0 - y / self.size[1])
        return self.page.text(*place, words, parse_math=False, animated=not words, **look)

    def write_head(self, title: str, key: Sequence[str], lines: int, order: str) -> None:
        """Write the title, and below or beside it the key, with the clock at the right."""
        high = self.letters
        stop = self.start + self.runs.span[1]
        left_edge = EDGE * high
        right = self.size[0] - left_edge
        wide = lettering.width(title, high, bold=True)
        share = max(LEAST_TITLE, min(1.0, (right - left_edge) / max(wide, 1.0)))
        words = lettering.cropped(title, right - left_edge, share * high, bold=True)
        first = FIRST_LINE * LINE_PITCH * high
        title_size = share * ONE_SIZE["axes.titlesize"]
        self.write(left_edge, first, words, va="center", weight="bold", fontsize=title_size)
        if lines == 1:
            last = first
            left_edge += wide + high if title else 0.0
            self.room = key_room(self.size, stop, title)
        else:
            last = SECOND_LINE * LINE_PITCH * high
            self.room = key_room(self.size, stop)
        self.clock = self.write(right, last, ha="right", va="center", weight="bold")
        right -= clock_room(self.size, stop) + high
        self.pace = self.write(right, last, ha="right", va="center", color=style.MUTED)
        said = list(filter(None, [*key, order, self.runs.gains]))
        if lettering.width(" · ".join(said), high) > self.room:
            said = list(filter(None, [*key, order, least_gains(self.runs.gains)]))
        least = int(lines == 2 or not title)  # beside the title there may be no words
        while len(said) > least and lettering.width(" · ".join(said), high) > self.room:
            said.pop()
        self.key = lettering.cropped(" · ".join(said), self.room, high)
        self.below = self.write(left_edge, last, va="center", color=style.MUTED)

    def write_labels(self, labels: Array) -> None:
        """Write the machines' names, each below its line in the panels."""
        runs = self.runs
        high = self.letters
        wide = float((labels[:, 2] - labels[:, 0]).min())
        names = Labels.of(runs.names, wide, high)
        pitch = LINE_PITCH * names.letters
        share = names.letters / high
        looks = style.looks(runs.traces)
        parts = zip(labels, self.tiles, names.words, runs.colours, looks, strict=True)
        for box, tile, words, colour, look in parts:
            left_edge, top, right, bottom = box
            middle = (left_edge + right) / 2
            tall = pitch * (1 + words.count("\n")) + SAMPLE * high
            start = top if top >= tile[3] else (top + bottom - tall) / 2  # below it, or beside
            y = start + 0.5 * SAMPLE * high
            ends = np.array([left_edge + INSET * high, right - INSET * high])
            line = (ends / self.size[0], [1.0 - y / self.size[1]] * 2)
            sample = Line2D(*line, color=colour, lw=style.points(2.5), **look)
            self.page.add_artist(sample)
            y = start + tall - 0.3 * names.letters
            place = {"ha": "center", "va": "baseline", "linespacing": LINE_PITCH}
            size = share * ONE_SIZE["xtick.labelsize"]
            self.write(middle, y, words, fontsize=size, **place)

    def draw_panels(self) -> tuple[list[Artist], list[Moving], list[flight.Flight]]:
        """Draw the two panels at the foot of the page, and return the artists of their curves, and
        what moves in them.
        """
        high = self.letters
        panels = charts.strip(self.runs.early)
        settled = list(map(settles_at, self.runs.traces))
        wide = self.size[0] / len(panels)
        label_width = lettering.width("−00.00", high) + 0.5 * high
        top = (1.0 - CHARTS_SHARE) * self.size[1] + 1.15 * LINE_PITCH * high
        foot = 1.15 * LINE_PITCH * high
        room = wide - label_width - EDGE * high
        curves: list[Artist] = []
        moving = []
        flights = []
        for k, panel in enumerate(panels):
            corner = ((k * wide + label_width) / self.size[0], foot / self.size[1])
            sides = (room / self.size[0], 1.0 - (top + foot) / self.size[1])
            ax = self.page.add_axes((*corner, *sides))
            if panel.quantity == "path":
                flights = flight.draw_map(ax, panel, self.runs.colours)
                ax.tick_params(length=0)
            else:
                words = joint_shortened(panel.label, room, high)
                ax.set_title(words, fontweight="normal", parse_math=False)
                self.set_time(ax)
                runs = self.runs
                rows, drawn = lanes.below_film(
                    ax, panel, runs.colours, runs.names, runs.marks, settled
                )
                moving += list(map(set_moving, rows))
                curves += drawn
        return curves, moving, flights

    def set_time(self, ax: Axes) -> None:
        """Set the time axis of axes: all have the same ticks, whatever their width."""
        stop = self.runs.span[0]
        narrow = 0.5 * self.size[0] - lettering.width("−00.00smooth", self.letters)
        count = int(narrow / lettering.width("0.0000", self.letters))
        locator = MaxNLocator(min(max(count, 1), TIME_TICKS), steps=pages.STEPS)
        ticks = np.asarray(locator.tick_values(0.0, stop))
        seen = (ticks >= 0.0) & (ticks <= stop * (1.0 + 1e-9))
        ticks = ticks[seen].tolist()
        ax.set_xlim(0.0, stop)
        ax.set_xticks(ticks, [*(f"{tick:g}" for tick in ticks[:-1]), f"{ticks[-1]:g} s"])
        labels = ax.get_xticklabels()
        labels[0].set_horizontalalignment("left")
        if len(ticks) > 1:
            box = ax.get_position()
            middle = (box.x0 + box.width * ticks[-1] / stop) * self.size[0]
            reach = middle + 0.5 * lettering.width(labels[-1].get_text(), self.letters)
            if ticks[-1] > stop * (1.0 - 1e-9) or reach > self.size[0]:  # it stays on the page
                labels[-1].set_horizontalalignment("right")
        ax.tick_params(length=0)

    def picture(self, moment: Moment, machines: Sequence[Array]) -> Array:
        """Return a frame, (height, width, 3) uint8, with the pictures of the machines in their
        tiles.
        """
        time = moment.time - self.start
        pixels = np.asarray(self.canvas.buffer_rgba())
        pixels[:] = self.empty
        room = round(0.3 * self.letters)
        for moving_line, (left_edge, top, right, bottom) in zip(
            self.moving, self.frames, strict=True
        ):
            share = time / moving_line.axes.get_xlim()[1]
            now = left_edge + round(share * (right - left_edge))
            if share > 1.0 - 1e-9:  # what is beside the curves is of their end
                now = self.size[0] if right > self.size[0] / 2 else self.size[0] // 2
            past = np.s_[top - room : bottom + room, left_edge - room : now]
            pixels[past] = self.full[past]
        for (left_edge, top, right, bottom), machine in zip(self.tiles, machines, strict=True):
            pixels[top:bottom, left_edge:right, :3] = machine
        renderer = self.canvas.get_renderer()
        for artist in self.moved(moment, time):
            artist.draw(renderer)
        return pixels[..., :3].copy()

    def moved(self, moment: Moment, time: float) -> list[Artist]:
        """Return what moves as it is at a time since the start, s, in the order of drawing."""
        drawn: list[Artist] = []
        for ax, cursor, dots in self.moving:
            if time <= ax.get_xlim()[1]:
                cursor.set_xdata([time, time])
                drawn.append(cursor)
                for words in ax.texts:
                    if words.get_bbox_patch():
                        drawn.append(words)
            for dot, t, y in dots:
                if time <= min(t[-1], ax.get_xlim()[1]) + 1e-9 and np.isfinite(y[0]):
                    dot.set_data([time], [np.interp(time, t, y)])
                    drawn.append(dot)
        for curve in self.flights:
            flown = curve.places[:, curve.times <= time + 1e-9]
            curve.past.set_data(*flown)
            curve.dot.set_data(*flown[:, -1:])
        for part in ("past", "goal", "dot"):
            drawn += [getattr(curve, part) for curve in self.flights]
        self.clock.set_text(f"{moment.time:.{3 if moment.speed < 0.2 else 2}f} s")
        words, opacity = self.event_words(moment)
        said = words or self.key
        self.below.set(text=said, alpha=opacity)
        pace = "" if moment.still else pace_words(moment.speed)
        if pace and self.room - lettering.width(said, self.letters) < APART * self.letters:
            pace = f"· {pace}"  # else they read as one phrase
        self.pace.set_text(pace)
        for text, state in zip(self.says, moment.states, strict=True):
            text.set_text(state.words if state else "")
            if state:
                text.set(color=state.colour, alpha=state.opacity)
        return [*drawn, self.clock, self.pace, self.below, *self.says]

    def event_words(self, moment: Moment) -> tuple[str, float]:
        """Return what has changed the plant last, or hits it now, and the opacity of the words:
        those on what has ended fade.
        """
        words = ""
        opacity = 1.0
        for event in self.runs.events:
            passed = max(0.0, moment.time - event.stop) / moment.speed
            if event.time <= moment.time and passed <= EVENT_TIME:
                when = f" since {event.time:g} s"
                if np.isfinite(event.stop):
                    when = f", {event.time:.2f} to {event.stop:.2f} s"
                opacity = 1.0 - passed / EVENT_TIME
                words = event.words + when
                if lettering.width(words, self.letters) > self.room:  # the machines' names say how
                    words = f"changed{when}"
        return words, opacity


def settles_at(trace: Trace) -> float:
    """Return when all joints of a run have settled for good, s, as metrics have it; inf if it
    fails.
    """
    return float(settling_time(trace)) if trace.diverged_at is None else np.inf


def set_moving(row: Row) -> Moving:
    """Add to a row what moves in it."""
    ax, panel, colours = row
    cursor = ax.axvline(0.0, color=style.MUTED, lw=style.points(0.8), animated=True)
    dots = []
    rows = zip(panel.traces, colours, strict=True)
    for trace, colour in reversed(list(rows)):
        t, y = panels.middle(trace, panel.quantity)
        dot = panels.dot(ax, colour)
        clipped = np.clip(y, *ax.get_ylim())
        dots.append((dot, t, clipped))  # the first on top
    return Moving(ax, cursor, dots)


def pace_words(speed: float) -> str:
    """Return a speed of playback in words; "" for real time."""
    if abs(speed - 1.0) <= 1e-9:
        return ""
    return f"{1.0 / speed:.3g}× slower" if speed < 1.0 else f"{speed:.3g}× faster"
