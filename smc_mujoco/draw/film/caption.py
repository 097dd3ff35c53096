"""Text on a film's frames: title, key to the arrows, the clock, and at the foot of each machine's
tile its label and state; with Pillow.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.control.source import by_words
from smc_mujoco.draw import style
from smc_mujoco.draw.film.arrows import Scale
from smc_mujoco.draw.film.scene import MAX_CHANNELS
from smc_mujoco.draw.states import CALM, STRUCK, STUCK, State
from smc_mujoco.metrics.conventions import Group
from smc_mujoco.simulation.trace import Trace

# Sizes are px of a film of full size, and chosen.
LETTERS = 18  # height
KEY_LETTERS = 16
TITLE_SIZE = 24
EDGE = 24  # from the picture's edge to text
PILL = 1.75 * LETTERS  # height of a label
KEY_TOP = 46  # of the key's first line
KEY_PITCH = 22  # from line to line
GAP = 8  # around labels
LEAST_LETTERS = 0.7  # of their size: labels and titles in smaller ones are cut
HALF_LETTERS = 0.75  # of their size: largest letters of a label on two lines
SAMPLE = 38  # of a label's line
SAMPLE_WIDTH = 4
LOOKS = {  # mood -> colours of a badge and of its rim
    CALM: (style.PAPER, style.MUTED),
    STUCK: (style.INK, style.PAPER),
    STRUCK: (style.REACTION, style.REACTION),
}


class Caption:
    """The text of a film: above the tiles of the machines, from `top` px on, and at their feet.

    `below`, width and height in px of a full-size film, is what others draw in place of badges. The
    `parts` of the key are by default what arrows and ghosts mean. A close-up's deflections are
    `factor` times as large.
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
        below: Pair | None = None,
        parts: Sequence[str] | None = None,
        factor: float = 1.0,
    ):
        self.traces = traces
        self.names = style.distinct(names)
        self.colours = colours
        self.size = size
        self.scale = s = scale
        self.changes = style.marks(traces, names, blows=False)
        self.lines = [look["ls"] for look in style.looks(traces)]
        self.beside = (1.9 * LETTERS + SAMPLE) * s  # of a label: its line, and its ends
        inside = size[0] - 2 * EDGE * s
        self.clock = style.width("00.000 s", TITLE_SIZE * s, bold=True) + EDGE * s
        self.clock += self.wide("8× slower") + 2 * LETTERS * s
        title = title or style.head([trace.scenario for trace in traces])
        self.title, self.title_size = fitted(title, inside - self.clock, TITLE_SIZE * s)
        self.close = f"last periods, deflections × {factor:g}"
        note = self.wide(self.close) if factor > 1.0 else 0.0
        for time, words in self.changes.items():
            note = max(note, self.wide(f"{words} since {time:g} s"))
        self.note_room = min(note + EDGE * s, 0.5 * inside)
        sources = [trace.scenario.law.source.words for trace in traces]
        self.source = by_words(dict(zip(names, sources, strict=True)))
        if parts is None:
            parts = key(traces, scales)
        self.key = wrapped(parts, inside - self.note_room, KEY_LETTERS * s)
        self.badge = self.badges_sizes(states, below)
        lines = max(len(self.key), bool(self.changes))
        foot = 4 if lines else 0
        self.top = (KEY_TOP + KEY_PITCH * lines + foot) * s

    def badges_sizes(self, states: Sequence[Sequence[State | None]], below: Pair | None) -> Array:
        """Return width and height of what is shown below each label, (machines, 2) px.

        It is a machine's state, or what others draw.
        """
        s = self.scale
        sizes = np.zeros((len(self.traces), 2))
        if below is not None:
            sizes[:] = np.array(below) * s
            return sizes
        for k, of_machine in enumerate(states):
            for words in {state.words for state in of_machine if state}:
                sizes[k, 0] = max(sizes[k, 0], self.wide(words) + 1.2 * LETTERS * s)
        if sizes.any():
            sizes[:, 1] = 1.6 * LETTERS * s
        return sizes

    def wide(self, text: str) -> float:
        """Return the width of bold letters, px."""
        return style.width(text, LETTERS * self.scale, bold=True)

    def text(self, k: int, failed: bool = True) -> str:
        """Return a machine's label, with the time at which it failed if it has `failed`."""
        trace = self.traces[k]
        if failed and trace.diverged_at is not None:
            return f"{self.names[k]}: {style.ending(trace)}"
        return self.names[k]

    def widths(self, least: bool = False) -> Array:
        """Return the widths of the labels, (machines,) px: on one line, or the least."""
        found = []
        for k in range(len(self.names)):
            text = self.text(k)
            wide = self.wide(text)
            if least:
                half = max(map(self.wide, halves(text)))
                wide = min(LEAST_LETTERS * wide, HALF_LETTERS * LEAST_LETTERS * half)
            found.append(wide)
        return np.array(found) + self.beside

    def strip(self, width: float) -> float:
        """Return the height, px, of labels and badges at the foot of tiles of a width, px; inf if
        they are wider.
        """
        room = width - 2 * GAP * self.scale
        if max(self.widths(least=True).max(), self.badge[:, 0].max()) > room:
            return math.inf
        tall = float(self.badge[:, 1].max())
        gap = GAP * self.scale if tall else 0.0
        both = self.widths() + self.badge[:, 0] + gap
        if (both <= room).all():
            return max(PILL * self.scale, tall) + GAP * self.scale
        return PILL * self.scale + tall + 1.5 * GAP * self.scale

    def place(self, tiles: Array) -> None:
        """Place labels and badges at the feet of tiles, (machines, 4) px: beside each other where
        the strip is low, else the badge below.
        """
        self.tiles = tiles
        s = self.scale
        room = float(tiles[0, 2] - tiles[0, 0]) - 2 * GAP * s
        wide, high = self.badge.T
        widths = self.widths().clip(0.0, room)
        tall = self.strip(room + 2 * GAP * s)
        middle = (tiles[:, 0] + tiles[:, 2]) / 2
        foot = tiles[:, 3] - GAP * s / 2
        if tall <= max(PILL * s, high.max()) + GAP * s:
            gap = GAP * s * (wide > 0.0)
            start = middle - (widths + gap + wide) / 2
            y = foot - max(PILL * s, high.max()) / 2
            self.pills = around(start + widths / 2, y, widths, PILL * s)
            self.badges = around(start + widths + gap + wide / 2, y, wide, high)
        else:
            self.pills = around(middle, foot - high.max() - (PILL + GAP) * s / 2, widths, PILL * s)
            self.badges = around(middle, foot - high.max() / 2, wide, high)

    def over(
        self,
        picture: Array,
        time: float,
        failed: Sequence[bool],
        states: Sequence[State | None] = (),
        speed: float = 1.0,
        factor: float = 1.0,
    ) -> Array:
        """Return the picture with the text on it: machines that have failed, their states, the
        playback speed, and by how much deflections are enlarged.
        """
        image = Image.fromarray(picture)
        draw = ImageDraw.Draw(image)
        self.head(draw, time, speed, factor)
        for k in range(len(self.names)):
            colour = style.FAILED if failed[k] else self.colours[k]
            self.label(draw, k, self.text(k, failed[k]), colour)
            state = states[k] if states else None
            if state:
                self.box(draw, self.badges[k], state.words, *LOOKS[state.mood])
        return np.asarray(image)

    def head(self, draw: ImageDraw.ImageDraw, time: float, speed: float, factor: float) -> None:
        """Write the title and where gains come from, the key, the clock, the playback speed, and
        the last change of the plant.
        """
        s = self.scale
        big = style.font(TITLE_SIZE * s, bold=True)
        letters = style.font(KEY_LETTERS * s)
        title = style.font(self.title_size, bold=True)
        draw.text((EDGE * s, 30 * s), self.title, style.INK, title, anchor="lm")
        for line, text in enumerate(self.key):
            place = (EDGE * s, (KEY_TOP + KEY_PITCH * line) * s)
            draw.text(place, text, style.DISTURBANCE, letters)
        left = 2 * EDGE * s + style.width(self.title, self.title_size, bold=True)
        right = self.size[0] - EDGE * s
        room = right - self.clock - left
        if style.width(self.source, KEY_LETTERS * s) < room:
            draw.text((left, 30 * s), self.source, style.DISTURBANCE, letters, anchor="lm")
        draw.text(
            (right, 30 * s), f"{time:.{3 if speed < 0.2 else 2}f} s", style.INK, big, anchor="rm"
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
            self.box(draw, (start, 30 * s - half, end, 30 * s + half), pace, *look, radius=half)
        change = max((at for at in self.changes if at <= time), default=None)
        words = ""
        if factor > 1.0:
            words = self.close
        elif change is not None:
            words = f"{self.changes[change]} since {change:g} s"
        if words:
            words, size = fitted(words, self.note_room - 8 * s, LETTERS * s)
            start = right - style.width(words, size, bold=True) - 8 * s
            box = (start, 45 * s, right + 8 * s, 67 * s)
            self.box(draw, box, words, style.INK, None, size=size)

    def box(
        self,
        draw: ImageDraw.ImageDraw,
        box: Sequence[float] | Array,
        words: str,
        fill: str,
        rim: str | None,
        radius: float | None = None,
        size: float | None = None,
    ) -> None:
        """Draw a box, left, top, right, bottom px, with words in it."""
        s = self.scale
        left, top, right, bottom = map(float, box)
        corner = 5 * s if radius is None else radius
        draw.rounded_rectangle((left, top, right, bottom), corner, fill, rim, max(1, round(s)))
        middle = ((left + right) / 2, (top + bottom) / 2)
        letters = style.font(size or LETTERS * s, bold=True)
        draw.text(middle, words, style.letters_on(fill), letters, anchor="mm")

    def label(self, draw: ImageDraw.ImageDraw, k: int, text: str, colour: str) -> None:
        """Draw a machine's label in its box with its line in the charts."""
        s = self.scale
        box = tuple(self.pills[k].tolist())
        left, top, right, bottom = box
        middle = (top + bottom) / 2
        draw.rounded_rectangle(box, middle - top, style.PAPER, style.RULE, max(1, round(s)))
        start = left + 0.7 * LETTERS * s
        end = start + SAMPLE * s
        for first, last in dashes(self.lines[k], SAMPLE_WIDTH):
            place = (start + first * s, middle, min(start + last * s, end), middle)
            if place[0] < end:
                draw.line(place, colour, max(2, round(SAMPLE_WIDTH * s)))
        place = (end + 0.5 * LETTERS * s, middle)
        text, size = fitted(text, right - left - self.beside, LETTERS * s, lines=2)
        look = {"font": style.font(size, bold=True), "anchor": "lm", "spacing": 0}
        draw.text(place, text, style.INK, **look)


def dashes(look: Any, width: float) -> Iterator[Pair]:
    """Yield where the dashes of a sample of a line begin and end."""
    if look == "-":
        yield 0.0, SAMPLE
        return
    at = 0.0
    while at < SAMPLE:
        for dash, gap in zip(look[1][::2], look[1][1::2], strict=True):
            yield at, at + dash * width
            at += (dash + gap) * width


def around(x: Array, y: Array, wide: Array, high: Array | float) -> Array:
    """Return boxes of these sizes about places, (n, 4) px: left, top, right, bottom."""
    return np.stack([x - wide / 2, y - high / 2, x + wide / 2, y + high / 2], axis=1)


def key(traces: Sequence[Trace], scales: Mapping[Group, Scale]) -> list[str]:
    """Return what arrows and ghosts mean, and how much of a network is shown.

    Arrows are to scale; of those whose largest value is another, it is said.
    """
    words = []
    plant = traces[0].scenario.plant
    if sizes := largest(scales, "control"):
        drive = any(scale.drive for scale in scales.values())
        what = "force of the drive" if drive else "control"
        words.append(f"arrow: {what}, longest {sizes}")
        words.append("bar: its range")
        if drive:
            words.append("pale: command")
    if plant.pose:
        words.append("line: path; dark: the wanted path")
    if sizes := largest(scales, "disturbance"):
        words.append(f"dark arrow: disturbance up to {sizes}")
    if sizes := largest(scales, "reaction"):
        words.append(f"violet: reaction up to {sizes}")
    words.append("translucent: reference")
    if plant.scenery:
        words.append(plant.scenery)
    count = max(trace.scenario.plant.n for trace in traces)
    if count > MAX_CHANNELS and not plant.direct:
        words.append(f"machines: the first {MAX_CHANNELS} of {count} pendulums")
    return words


def largest(scales: Mapping[Group, Scale], kind: str) -> str:
    """Return the largest values of a kind of arrows, one a group, such as "6 N"; "" if there are
    none.
    """
    unit = "u" if kind == "control" else "force"
    words = []
    for group, scale in scales.items():
        if size := getattr(scale, kind):
            words.append(f"{style.short(size)} {style.units(group)[unit]}")
    return ", ".join(words)


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


def halves(text: str) -> list[str]:
    """Return the text on two lines of about equal length, broken at a space or behind a "_"."""
    breaks = [found.end() for found in re.finditer(r"[ _](?=\S)", text)]
    if not breaks:
        return [text]
    at = min(breaks, key=lambda place: abs(place - len(text) / 2))
    return [text[:at].rstrip(), text[at:]]


def fitted(text: str, room: float, size: float, lines: int = 1) -> tuple[str, float]:
    """Return the text, on up to two lines, and the size of bold letters with which it fits the
    room; cut if it is too wide in small ones.
    """
    text = " ".join(text.split())
    share = min(1.0, room / max(style.width(text, size, bold=True), 1.0))
    if lines == 2 and share < HALF_LETTERS:
        parts = halves(text)
        wide = max(style.width(part, size, bold=True) for part in parts)
        both = min(HALF_LETTERS, room / wide)
        if both > share and both >= HALF_LETTERS * LEAST_LETTERS - 1e-9:
            return "\n".join(parts), both * size
    least = max(share, LEAST_LETTERS) * size
    return style.cropped(text, room + 1.0, least, bold=True), least
