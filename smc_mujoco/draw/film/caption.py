"""Text on a film's frames: title, key to the arrows, the clock, and at the foot of each machine's
tile its label and state; with Pillow.
"""

import itertools
import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.control.source import by_words
from smc_mujoco.draw import style
from smc_mujoco.draw.film.arrows import Scale
from smc_mujoco.draw.film.world import MAX_CHANNELS
from smc_mujoco.draw.states import CALM, STRUCK, STUCK, State
from smc_mujoco.metrics.conventions import Group
from smc_mujoco.simulation.trace import Trace

# Sizes are px of a film of full size, and chosen: all letters have one size, which a phone shows.
LETTERS = 37  # height
EDGE = 24  # from the picture's edge to text
LINE_PITCH = 44  # from line to line of title and key
BOX_PITCH = 1.1 * LETTERS  # from line to line in a box
PAD = 8  # in a box, on each side of its words
GAP = 5  # around boxes
SAMPLE_HEIGHT = 10  # room below a label's name, for a sample of its line in the charts
SAMPLE_WIDTH = 6  # of that line
MAX_LINES = 3  # of a label or badge
LEAST_LETTERS = 0.9  # of their size: words in smaller ones are cut
LOOKS = {  # mood -> colours of a badge and of its rim
    CALM: (style.PAPER, style.MUTED),
    STUCK: (style.INK, style.PAPER),
    STRUCK: (style.REACTION, style.REACTION),
}


class Caption:
    """The text of a film: above the tiles of the machines, from `top` px on, and at their feet.

    A close-up's deflections are `factor` times as large.
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
        factor: float = 1.0,
    ):
        self.traces = traces
        self.names = style.distinct(names)
        self.colours = colours
        self.size = size
        self.scale = s = scale
        self.changes = style.marks(traces, names, blows=not traces[0].scenario.plant.tip)
        self.lines = [look["ls"] for look in style.looks(traces)]
        inside = size[0] - 2 * EDGE * s
        title = title or style.head([trace.scenario for trace in traces])
        self.title, self.title_size = fitted(title, inside, LETTERS * s, bold=True)
        self.close = f"last periods, deflections × {factor:g}"
        clock = style.width("00.000 s", LETTERS * s, bold=True)
        self.room = inside - clock - self.text_width("8× slower") - (6 * PAD + EDGE) * s
        sources = [trace.scenario.law.source.words for trace in traces]
        self.source = by_words(dict(zip(names, sources, strict=True)))
        if self.text_width(self.source) > self.room:  # in the order of the machines
            self.source = f"gains: {', '.join(sources)}"
        said = [*key(traces, scales), self.source]
        while said and self.text_width(" · ".join(said)) > self.room:
            said.pop()
        self.key = " · ".join(said)
        self.states = [{state.words for state in one if state} for one in states]
        self.top = (2 * LINE_PITCH + GAP) * s

    def text_width(self, text: str) -> float:
        """Return the width of a text, px."""
        return style.width(text, LETTERS * self.scale)

    def text(self, k: int, failed: bool = True) -> str:
        """Return a machine's label, with the time at which it failed if it has `failed`."""
        trace = self.traces[k]
        if failed and trace.diverged_at is not None:
            return f"{self.names[k]}: {style.ending(trace)}"
        return self.names[k]

    def boxes(self, width: float) -> tuple[Array, Array]:
        """Return width and height of the box of each label and of its badge, (machines, 2) px, in
        tiles of a width, px; inf where words are wider.
        """
        s = self.scale
        room = width - 2 * GAP * s
        labels = []
        badges = []
        for k in range(len(self.names)):
            wide, high = self.box([self.text(k)], room)
            labels.append((wide, high + SAMPLE_HEIGHT * s))
            badges.append(self.box(self.states[k] if self.states else (), room))
        return np.array(labels), np.array(badges)

    def box(self, texts: Collection[str], room: float) -> Pair:
        """Return width and height, px, of a box for one of several texts."""
        s = self.scale
        wide, high = 0.0, 0.0
        for text in texts:
            words, size = fitted(text, room - 2 * PAD * s, LETTERS * s, MAX_LINES)
            wide = max(wide, math.inf if "…" in words else longest(words, size) + 2 * PAD * s)
            high = max(high, (BOX_PITCH * (1 + words.count("\n")) + PAD) * s)
        return wide, high

    def strip(self, width: float) -> float:
        """Return the height, px, of labels and badges at the foot of tiles of a width, px; inf if
        they are wider.
        """
        gap = GAP * self.scale
        (wide, high), (badge, below) = (sizes.max(axis=0) for sizes in self.boxes(width))
        if max(wide, badge) > width - 2 * gap:
            return math.inf
        if wide + badge + 3 * gap <= width:  # side by side
            return float(max(high, below) + 1.5 * gap)
        return float(high + below + 2.5 * gap)

    def place(self, tiles: Array) -> None:
        """Place labels and badges at the feet of tiles, (machines, 4) px."""
        self.tiles = tiles
        gap = GAP * self.scale
        room = float(tiles[0, 2] - tiles[0, 0])
        labels, badges = self.boxes(room)
        middle = (tiles[:, 0] + tiles[:, 2]) / 2
        beside = middle
        foot = tiles[:, 3] - gap
        below = foot - badges[:, 1] / 2
        if labels[:, 0].max() + badges[:, 0].max() + 3 * gap <= room:
            apart = gap * (badges[:, 0] > 0.0)
            beside = middle + (labels[:, 0] + apart) / 2
            middle = middle - (badges[:, 0] + apart) / 2
            below = foot - labels[:, 1] + badges[:, 1] / 2
        else:
            foot = foot - badges[:, 1].max() - gap
        self.badges = around(beside, below, *badges.T)
        labels = labels.clip(0.0, room - 2 * gap)
        self.labels = around(middle, foot - labels[:, 1] / 2, *labels.T)

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
                self.write(draw, self.badges[k], state.words, *LOOKS[state.mood])
        return np.asarray(image)

    def head(self, draw: ImageDraw.ImageDraw, time: float, speed: float, factor: float) -> None:
        """Write the title; below it the key, or in its place a close-up or the last change of the
        plant, the playback speed and the clock.
        """
        s = self.scale
        left = EDGE * s
        bold = style.font(self.title_size, bold=True)
        draw.text((left, 0.6 * LINE_PITCH * s), self.title, style.INK, bold, anchor="lm")
        y = 1.55 * LINE_PITCH * s
        half = 0.46 * LINE_PITCH * s
        change = max((at for at in self.changes if at <= time), default=None)
        words = ""
        if factor > 1.0:
            words = self.close
        elif change is not None:
            words = f"{self.changes[change]} since {change:g} s"
            if LEAST_LETTERS * self.text_width(words) > self.room - 2 * PAD * s:
                words = f"changed since {change:g} s"  # the machines' names say how
        if words:
            end = left + min(self.room, self.text_width(words) + 2 * PAD * s)
            self.write(draw, (left, y - half, end, y + half), words, style.INK, None)
        else:
            letters = style.font(LETTERS * s)
            draw.text((left, y), self.key, style.DISTURBANCE, letters, anchor="lm")
        right = self.size[0] - EDGE * s
        big = style.font(LETTERS * s, bold=True)
        clock = f"{time:.{3 if speed < 0.2 else 2}f} s"
        draw.text((right, y), clock, style.INK, big, anchor="rm")
        if abs(speed - 1.0) > 1e-9:
            pace = f"{speed:.3g}× faster"
            look = (style.PAPER, style.MUTED)
            if speed < 1.0:
                pace = f"{1.0 / speed:.3g}× slower"
                look = (style.INK, None)
            end = right - style.width("00.000 s", LETTERS * s, bold=True) - PAD * s
            start = end - self.text_width(pace) - 4 * PAD * s
            self.write(draw, (start, y - half, end, y + half), pace, *look)

    def write(
        self,
        draw: ImageDraw.ImageDraw,
        box: Sequence[float] | Array,
        words: str,
        fill: str,
        rim: str | None,
    ) -> None:
        """Draw a box, left, top, right, bottom px, with words in it."""
        s = self.scale
        left, top, right, bottom = map(float, box)
        draw.rounded_rectangle((left, top, right, bottom), 5 * s, fill, rim, max(1, round(s)))
        middle = ((left + right) / 2, (top + bottom) / 2)
        lines = round((bottom - top) / (BOX_PITCH * s))
        words, size = fitted(words, right - left - 2 * PAD * s, LETTERS * s, lines)
        look = {"font": style.font(size), "anchor": "mm", "spacing": 0, "align": "center"}
        draw.text(middle, words, style.letters_on(fill), **look)

    def label(self, draw: ImageDraw.ImageDraw, k: int, text: str, colour: str) -> None:
        """Draw a machine's label in its box, over its line in the charts."""
        s = self.scale
        left, top, right, bottom = self.labels[k].tolist()
        y = bottom - SAMPLE_HEIGHT * s
        draw.rounded_rectangle((left, top, right, bottom), 5 * s, style.PAPER)
        self.write(draw, (left, top, right, y), text, style.PAPER, None)
        start = left + PAD * s
        end = right - PAD * s
        for first, last in dashes(self.lines[k], SAMPLE_WIDTH, (end - start) / s):
            place = (start + first * s, y, min(start + last * s, end), y)
            if place[0] < end:
                draw.line(place, colour, max(2, round(SAMPLE_WIDTH * s)))


def dashes(look: Any, width: float, length: float) -> Iterator[Pair]:
    """Yield where the dashes of a sample of a line of a length begin and end."""
    if look == "-":
        yield 0.0, length
        return
    at = 0.0
    while at < length:
        for dash, gap in zip(look[1][::2], look[1][1::2], strict=True):
            yield at, at + dash * width
            at += (dash + gap) * width


def around(x: Array, y: Array, wide: Array, high: Array | float) -> Array:
    """Return boxes of these sizes about places, (n, 4) px: left, top, right, bottom."""
    return np.stack([x - wide / 2, y - high / 2, x + wide / 2, y + high / 2], axis=1)


def key(traces: Sequence[Trace], scales: Mapping[Group, Scale]) -> list[str]:
    """Return the longest arrow of u, or of a drive's force, the largest values of other arrows, and
    how much of a network is shown.

    Arms have no arrows but those with their numbers beside them.
    """
    words = []
    plant = traces[0].scenario.plant
    if plant.tip:
        return words
    drive = any(scale.drive for scale in scales.values())
    kinds = {"control": "drive" if drive else "u", "disturbance": "d", "reaction": "reaction"}
    for kind, name in kinds.items():
        if sizes := largest(scales, kind):
            words.append(f"{name} {sizes}")
    if words:
        words[0] = f"→ {words[0]}"
    count = max(trace.scenario.plant.n for trace in traces)
    if count > MAX_CHANNELS and not plant.direct:
        words.append(f"{MAX_CHANNELS} of {count} pendulums")
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


def longest(text: str, size: float, bold: bool = False) -> float:
    """Return the width of the longest line of a text, in the unit of `size`."""
    return max(style.width(line, size, bold) for line in text.split("\n"))


def fitted(
    text: str, room: float, size: float, lines: int = 1, bold: bool = False
) -> tuple[str, float]:
    """Return the text on the fewest of up to so many lines, broken at a space or behind a "_" or
    "-", and the size of letters with which it fits the room; cut if it is too wide in small ones.
    """
    pieces = re.findall(r".+?(?:[ _-]|$)", " ".join(text.split()))
    found = [""]
    least = size
    for count, share in itertools.product(range(1, lines + 1), (1.0, LEAST_LETTERS)):
        found = [""]
        least = share * size
        for piece in pieces:
            last = (found[-1] + piece).rstrip()
            if found[-1] and len(found) < count and style.width(last, least, bold) > room:
                found.append(piece)
            else:
                found[-1] += piece
        if longest("\n".join(found), least, bold) <= room + 0.5:
            break
    return "\n".join(style.cropped(part, room + 1.0, least, bold) for part in found), least
