"""Text on a film's frames: title, key to the arrows, the label and state of each machine, the
clock; with Pillow.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.control.source import by_words
from smc_mujoco.draw import style
from smc_mujoco.draw.film.arrows import Scale
from smc_mujoco.draw.film.camera import Room
from smc_mujoco.draw.film.scene import MAX_CHANNELS
from smc_mujoco.draw.states import CALM, STRUCK, STUCK, State
from smc_mujoco.metrics.conventions import Group
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

# Sizes are px of a film of full size, and chosen.
LETTERS = 18  # height
TITLE_SIZE = 24
EDGE = 24  # from the picture's edge to text
PILL = 1.75 * LETTERS  # height of a label
KEY_TOP = 46  # of the key's first line
KEY_PITCH = 24  # from line to line
KEY_TIME = 2.0  # s of a film for which the key is shown
FADE_TIME = 0.4  # s, in which it fades
MIN_ROOM = 0.73  # of the picture's height, for machines: a longer key lies over them
MAX_LABEL_SHARE = 0.3  # of the picture's width, for a label beside its machine
STRIP_WIDTH = 110  # of an encoder's strip
STRIP_COUNTS = 6
LOOKS = {  # mood -> colours of a badge and of its rim
    CALM: (style.PAPER, style.MUTED),
    STUCK: (style.INK, style.PAPER),
    STRUCK: (style.REACTION, style.REACTION),
}


class Caption:
    """The text over the stage of a film; `room` is the part of the picture that is free for the
    machines.

    Machines stand in a `row` across the picture, or behind each other. `below`, width and height in
    px of a full-size film, is what others draw in place of badges. The `parts` of the key are by
    default what arrows and ghosts mean.
    """

    def __init__(
        self,
        traces: Sequence[Trace],
        names: Sequence[str],
        colours: Sequence[str],
        title: str | None,
        size: tuple[int, int],
        scale: float,
        scales: Mapping[Group, Scale],
        states: Sequence[Sequence[State | None]] = (),
        row: bool = True,
        below: tuple[float, float] | None = None,
        parts: Sequence[str] | None = None,
    ):
        self.traces = traces
        self.names = names
        self.colours = colours
        self.size = size
        self.scale = s = scale
        self.beside = not row  # machines behind each other have their labels at the left
        self.arms = below is not None
        self.changes = style.marks(traces, names, blows=False)
        inside = size[0] - 2 * EDGE * s
        self.clock = style.width("00.000 s", TITLE_SIZE * s, bold=True) + EDGE * s
        self.clock += self.wide("8× slower") + 2 * LETTERS * s
        title = title or style.head([trace.scenario for trace in traces])
        self.title = style.cropped(title, inside - self.clock, TITLE_SIZE * s, bold=True)
        note = 0.0
        for time, words in self.changes.items():
            note = max(note, self.wide(f"{words} since {time:g} s"))
        self.note_room = min(note + EDGE * s, 0.4 * inside)
        sources = [trace.scenario.law.source.words for trace in traces]
        self.source = by_words(dict(zip(names, sources, strict=True)))
        if parts is None:
            parts = key(traces, scales)
        self.key = wrapped(parts, inside - self.note_room, LETTERS * s)
        self.badge = self.badges_sizes(states, below)
        self.max_label = MAX_LABEL_SHARE * size[0]
        bottom = size[1] - 20 * s
        left = 40 * s
        if self.beside:
            self.in_line = False
            left = max(self.widths() + self.badge[:, 0]) + 30 * s
        else:
            self.max_label = (size[0] - left) / len(traces) - 0.8 * LETTERS * s
            if max(self.wide(name) for name in names) + 2.5 * LETTERS * s > self.max_label:
                self.names = style.distinct(names)
            both = self.widths() + self.badge[:, 0] + 0.4 * PILL * s
            self.in_line = bool((both < self.max_label).all())  # labels with their badges
            high = self.badge[:, 1].max()
            if self.in_line:
                bottom = size[1] - 12 * s - max(PILL * s, high)
            elif self.arms:
                bottom = size[1] - 1.15 * PILL * s - high
            else:
                bottom = size[1] - 12 * s - PILL * s - high
        top = min((KEY_TOP + KEY_PITCH * len(self.key) + 6) * s, bottom - MIN_ROOM * size[1])
        self.room = Room(left, max(top, (KEY_TOP + 4) * s), size[0] - 40 * s, bottom)

    def badges_sizes(
        self, states: Sequence[Sequence[State | None]], below: tuple[float, float] | None
    ) -> np.ndarray:
        """Return width and height of what is shown below each label, (machines, 2) px.

        It is a machine's state, the strip of its encoder, or what others draw.
        """
        s = self.scale
        sizes = np.zeros((len(self.traces), 2))
        self.gauges = np.zeros(len(self.traces), bool)
        if below is not None:
            sizes[:] = np.array(below) * s
            return sizes
        for k, trace in enumerate(self.traces):
            for state in states[k] if states else ():
                if state:
                    wide = self.wide(state.words) + 1.2 * LETTERS * s
                    sizes[k, 0] = max(sizes[k, 0], wide)
            self.gauges[k] = gauges(trace.scenario) and not sizes[k, 0]
            if self.gauges[k]:
                sizes[k, 0] = STRIP_WIDTH * s
        if sizes.any():
            sizes[:, 1] = 1.6 * LETTERS * s
        return sizes

    @property
    def apart(self) -> float:
        """The width, px, that an arm in a row needs for its label and what is below it; 0 for other
        machines.
        """
        if not self.arms:
            return 0.0
        both = np.maximum(self.widths(), self.badge[:, 0])
        if self.in_line:
            both = self.widths() + self.badge[:, 0]
        return float(both.max()) + 1.2 * LETTERS * self.scale

    def wide(self, text: str) -> float:
        """Return the width of bold letters, px."""
        return style.width(text, LETTERS * self.scale, bold=True)

    def texts(self, failed: Sequence[bool] | None = None) -> list[str]:
        """Return the labels, with the time of failure of machines that have failed; default: of all
        that will fail.
        """
        words = []
        for k, (name, trace) in enumerate(zip(self.names, self.traces, strict=True)):
            end = ""
            if trace.diverged_at is not None and (failed is None or failed[k]):
                end = f": {style.ending(trace)}"
            room = self.max_label - self.wide(end) - 2.5 * LETTERS * self.scale
            words.append(style.cropped(name, room, LETTERS * self.scale, bold=True) + end)
        return words

    def widths(self) -> np.ndarray:
        """Return the widths of the labels, (machines,) px."""
        return np.array([self.wide(text) for text in self.texts()]) + 2.5 * LETTERS * self.scale

    def place(self, boxes: np.ndarray) -> None:
        """Place the labels under machines in a row, else at the left of each; `boxes` are their
        places, (n, 4) px.

        A badge is below its label, or at its right.
        """
        widths = self.widths()
        height = PILL * self.scale
        gap = 0.4 * height
        middle = (boxes[:, :2] + boxes[:, 2:]) / 2
        wide, high = self.badge.T
        foot = boxes[:, 3].max()
        y = np.empty(len(widths))
        if self.in_line:
            whole = widths + np.where(wide > 0, wide + 0.3 * height, 0.0)
            x = spread(middle[:, 0], whole + gap, self.size[0]) - (whole - widths) / 2
            tall = max(height, high.max())
            y[:] = min(foot + 0.35 * height + tall / 2, self.size[1] - tall / 2 - gap / 2)
            across = x + widths / 2 + 0.3 * height + wide / 2
            down = y
        elif not self.beside:
            x = spread(middle[:, 0], np.maximum(widths, wide) + gap, self.size[0])
            y[:] = min(foot + 0.85 * height, self.size[1] - 0.6 * height - high.max())
            across = x
            down = y + (height + high) / 2 + 0.1 * height * (high > 0)
        else:
            x = np.maximum(boxes[:, 0] - gap, widths + wide + gap) - wide - widths / 2
            y = spread(middle[:, 1], np.full(len(x), 1.15 * height), self.size[1])
            across = x + (widths + wide) / 2 + 0.1 * height
            down = y
        self.pills = around(x, y, widths, height)
        self.badges = around(across, down, wide, high)

    def over(
        self,
        picture: np.ndarray,
        time: float,
        failed: Sequence[bool],
        states: Sequence[State | None] = (),
        speed: float = 1.0,
        shown: float = 0.0,
    ) -> np.ndarray:
        """Return the picture with the text on it: machines that have failed, their states, and the
        playback speed.

        The picture is `shown` so long after the film's beginning, s.
        """
        image = Image.fromarray(picture)
        draw = ImageDraw.Draw(image)
        self.head(draw, time, speed)
        for k, text in enumerate(self.texts(failed)):
            if failed[k]:
                colour = style.FAILED
            else:
                colour = self.colours[k]
            self.label(draw, tuple(self.pills[k]), text, colour)
            state = states[k] if states else None
            if state:
                self.box(draw, self.badges[k], state.words, *LOOKS[state.mood])
            if self.gauges[k] and not failed[k]:
                self.strip(draw, k, time)
        ink = min(1.0, (KEY_TIME + FADE_TIME - shown) / FADE_TIME)
        if ink > 0.0:
            image = Image.blend(image, self.keyed(image), ink)
        return np.asarray(image)

    def head(self, draw: ImageDraw.ImageDraw, time: float, speed: float) -> None:
        """Write the title and where gains come from, the clock, the playback speed, and the last
        change of the plant.
        """
        s = self.scale
        big = style.font(TITLE_SIZE * s, bold=True)
        draw.text((EDGE * s, 16 * s), self.title, style.INK, big)
        left = 2 * EDGE * s + style.width(self.title, TITLE_SIZE * s, bold=True)
        right = self.size[0] - EDGE * s
        room = right - self.clock - left
        if room > 4 * TITLE_SIZE * s:
            words = style.cropped(self.source, room, LETTERS * s)
            draw.text((left, 21 * s), words, style.DISTURBANCE, style.font(LETTERS * s))
        draw.text(
            (right, 16 * s), f"{time:.{3 if speed < 0.2 else 2}f} s", style.INK, big, anchor="ra"
        )
        if abs(speed - 1.0) > 1e-9:
            pace = f"{speed:.3g}× faster"
            look = (style.PAPER, style.MUTED)
            if speed < 1.0:
                pace = f"{1.0 / speed:.3g}× slower"
                look = (style.INK, style.INK)
            end = right - style.width("00.000 s", TITLE_SIZE * s, bold=True) - LETTERS * s
            half = 0.85 * LETTERS * s
            start = end - self.wide(pace) - LETTERS * s
            self.box(draw, (start, 28 * s - half, end, 28 * s + half), pace, *look, radius=half)
        change = max((at for at in self.changes if at <= time), default=None)
        if change is not None:
            words = f"{self.changes[change]} since {change:g} s"
            words = style.cropped(words, self.note_room - 8 * s, LETTERS * s, bold=True)
            start = right - self.wide(words) - 8 * s
            box = (start, 45 * s, right + 8 * s, 67 * s)
            self.box(draw, box, words, style.INK, None)

    def box(
        self,
        draw: ImageDraw.ImageDraw,
        box: Sequence[float] | np.ndarray,
        words: str,
        fill: str,
        rim: str | None,
        radius: float | None = None,
    ) -> None:
        """Draw a box, left, top, right, bottom px, with words in it."""
        s = self.scale
        left, top, right, bottom = map(float, box)
        corner = 5 * s if radius is None else radius
        draw.rounded_rectangle((left, top, right, bottom), corner, fill, rim, max(1, round(s)))
        middle = ((left + right) / 2, (top + bottom) / 2)
        letters = style.font(LETTERS * s, bold=True)
        draw.text(middle, words, style.letters_on(fill), letters, anchor="mm")

    def label(
        self, draw: ImageDraw.ImageDraw, box: tuple[float, ...], text: str, colour: str
    ) -> None:
        """Draw a machine's label in a box, px, with a dot of its colour."""
        s = self.scale
        left, top, _, bottom = box
        half = (bottom - top) / 2
        draw.rounded_rectangle(box, half, style.PAPER, style.RULE, max(1, round(s)))
        disc(draw, left + 1.3 * half, top + half, 0.6 * half, colour)
        place = (left + half + 1.1 * LETTERS * s, top + half)
        draw.text(place, text, style.INK, style.font(LETTERS * s, bold=True), anchor="lm")

    def keyed(self, image: Image.Image) -> Image.Image:
        """Return the image with the key, on paper where it lies over the machines."""
        s = self.scale
        paper = image.copy()
        letters = style.font(LETTERS * s)
        places = (KEY_TOP + KEY_PITCH * np.arange(len(self.key))) * s
        for y, text in zip(places.tolist(), self.key, strict=True):
            if y + KEY_PITCH * s > self.room.top:
                right = (EDGE + 4) * s + style.width(text, LETTERS * s)
                box = ((EDGE - 4) * s, y - 1, right, y + KEY_PITCH * s)
                ImageDraw.Draw(paper).rectangle(box, style.PAPER)
        paper = Image.blend(image, paper, 0.75)
        for y, text in zip(places.tolist(), self.key, strict=True):
            ImageDraw.Draw(paper).text((EDGE * s, y), text, style.DISTURBANCE, letters)
        return paper

    def strip(self, draw: ImageDraw.ImageDraw, k: int, time: float) -> None:
        """Draw the counts of machine k's encoder around its position at a time, s, and which of
        them is read.
        """
        left, top, right, bottom = self.badges[k].tolist()
        s = self.scale
        trace = self.traces[k]
        sensor = trace.scenario.sensor
        assert sensor is not None
        count = sensor.quantum(trace.scenario.plant.unit == "rad")
        now, then = np.interp([time, time - sensor.delay], trace.t, trace.x[:, 0]) / count
        middle = (left + right) / 2
        step = (right - left) / STRIP_COUNTS
        thin = max(1, round(s))
        box = (left, top, right, bottom)
        draw.rounded_rectangle(box, 5 * s, style.PAPER, style.MUTED, thin)
        first = math.ceil(now - STRIP_COUNTS / 2)
        for tick in range(first, math.floor(now + STRIP_COUNTS / 2) + 1):
            x = middle + (tick - now) * step
            if left + 3 * s < x < right - 3 * s:
                line = (x, top + 0.62 * (bottom - top), x, bottom - 2 * s)
                draw.line(line, style.INK, max(1, round(1.5 * s)))
        draw.line((middle, top + 2 * s, middle, bottom - 2 * s), style.MUTED, thin)
        read = middle + (round(then + sensor.bias / count) - now) * step
        read = float(np.clip(read, left + 5 * s, right - 5 * s))
        disc(draw, read, top + 0.35 * (bottom - top), 3.5 * s, self.colours[k])


def disc(draw: ImageDraw.ImageDraw, x: float, y: float, radius: float, colour: str) -> None:
    """Fill a disc about a place, px."""
    draw.ellipse((x - radius, y - radius, x + radius, y + radius), colour)


def around(x: np.ndarray, y: np.ndarray, wide: np.ndarray, high: np.ndarray | float) -> np.ndarray:
    """Return boxes of these sizes about places, (n, 4) px: left, top, right, bottom."""
    return np.stack([x - wide / 2, y - high / 2, x + wide / 2, y + high / 2], axis=1)


def key(traces: Sequence[Trace], scales: Mapping[Group, Scale]) -> list[str]:
    """Return what arrows and ghosts mean, and how much of a network is shown."""

    def longest(quantity: str) -> str:
        """Return the values of the longest arrows, one a group, such as "6 N"; "" if there are
        none.
        """
        unit = "u" if quantity == "control" else "force"
        words = []
        for group, scale in scales.items():
            if size := getattr(scale, quantity):
                words.append(f"{style.short(size)} {style.units(group)[unit]}")
        return ", ".join(words)

    words = []
    plant = traces[0].scenario.plant
    if sizes := longest("control"):
        drive = any(scale.drive for scale in scales.values())
        what = "force of the drive" if drive else "mean control"
        words.append(f"arrow: {what}, longest {sizes}")
        words.append("bar: its range")
        if drive:
            words.append("pale arrow: command")
    if plant.pose:
        words.append("line: path; dark: the wanted path")
    if sizes := longest("disturbance"):
        words.append(f"dark arrow: disturbance, longest {sizes}")
    if sizes := longest("reaction"):
        words.append(f"violet arrow: reaction, longest {sizes}")
    words.append("translucent: reference")
    if plant.scenery:
        words.append(plant.scenery)
    if any(gauges(trace.scenario) for trace in traces):
        words.append("strip: counts of the encoder, the line is the position, the dot what is read")
    count = max(trace.scenario.plant.n for trace in traces)
    if count > MAX_CHANNELS and not plant.direct:
        words.append(f"machines: the first {MAX_CHANNELS} of {count} pendulums")
    return words


def gauges(scenario: Scenario) -> bool:
    """Return whether a strip shows the counts of a scenario's encoder: for one channel."""
    sensor = scenario.sensor
    return sensor is not None and sensor.counts < math.inf and scenario.plant.n == 1


def wrapped(parts: Sequence[str], room: float, size: float) -> list[str]:
    """Return the parts in as few lines as the room allows."""
    lines: list[str] = []
    for part in parts:
        longer = f"{lines[-1]}  ·  {part}" if lines else part
        if lines and style.width(longer, size) <= room:
            lines[-1] = longer
        else:
            lines.append(style.cropped(part, room, size))
    return lines


def spread(centres: np.ndarray, widths: np.ndarray, room: float) -> np.ndarray:
    """Return the centres, moved as little as needed for intervals of these widths to lie apart
    within 0 .. room.
    """
    order = np.argsort(centres)
    half = widths / 2
    placed = centres.astype(float)
    edge = 0.0
    for i in order:
        placed[i] = max(placed[i], edge + half[i])
        edge = placed[i] + half[i]
    edge = room
    for i in order[::-1]:
        placed[i] = min(placed[i], edge - half[i])
        edge = placed[i] - half[i]
    return placed
