"""Text on a film's frames: title, key to the arrows, the label and state of each machine, the
clock; with Pillow.
"""

import functools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.control.source import by_words
from smc_mujoco.draw import style
from smc_mujoco.draw.film.arrows import Scale
from smc_mujoco.draw.film.camera import Room
from smc_mujoco.draw.film.scene import MAX_CHANNELS
from smc_mujoco.draw.states import (
    CALM,
    STRUCK,
    STUCK,
    State,
    backlash_gap,
    has_contact,
    has_dry_friction,
)
from smc_mujoco.metrics.conventions import Group
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

LABEL_SIZE, TITLE_SIZE, KEY_SIZE, BADGE_SIZE = (
    18,
    24,
    18,
    18,
)  # px, height of letters in a film of full size
EDGE = 24  # px, from the picture's edge to text
MAX_LABEL_SHARE = 0.3  # of the picture's width, for a label beside its machine
KEY_TOP, KEY_PITCH = 46, 24  # px, of the key's first line, and from line to line
KEY_TIME, FADE_TIME = 2.0, 0.4  # s of a film for which the key is shown, and in which it fades
# of the picture's height, for machines: a longer key lies over them while it is shown; chosen
MIN_ROOM = 0.73
STRIP_WIDTH, STRIP_COUNTS = 110, 6  # of an encoder's strip, px and counts


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
        self.scale = scale
        self.jumps = style.marks(traces, names, blows=False)
        inside = size[0] - 2 * EDGE * scale
        clock = style.width("00.000 s", TITLE_SIZE * scale, bold=True) + EDGE * scale
        clock += style.width("8× slower", KEY_SIZE * scale, bold=True) + 2 * KEY_SIZE * scale
        self.clock = clock  # width of the clock and of the playback speed, px
        title = title or style.head([trace.scenario for trace in traces])
        self.title = style.cropped(title, inside - clock, TITLE_SIZE * scale, bold=True)
        notes = [f"{words} since {time:g} s" for time, words in self.jumps.items()]
        longest = max(
            (style.width(note, KEY_SIZE * scale, bold=True) for note in notes), default=0.0
        )
        self.note_room = min(longest + EDGE * scale, 0.4 * inside)
        self.source = by_words(
            {name: t.scenario.law.source.kind for name, t in zip(names, traces, strict=True)}
        )
        self.key = wrapped(
            key(traces, scales) if parts is None else parts,
            inside - self.note_room,
            KEY_SIZE * scale,
        )
        self.beside, self.in_line = (
            not row,
            False,
        )  # machines behind each other have their labels at the left
        words = [{state.words for state in of_machine if state} for of_machine in states] or [
            set()
        ] * len(traces)
        letters, margin = (
            BADGE_SIZE * scale,
            1.2 * BADGE_SIZE * scale,
        )  # px, of a badge, which shows a machine's state
        badges = [
            max((style.width(text, letters, bold=True) + margin for text in its), default=0.0)
            for its in words
        ]
        self.gauges = [
            gauges(trace.scenario) and not each for trace, each in zip(traces, words, strict=True)
        ]
        badges = [
            max(wide, STRIP_WIDTH * scale * on)
            for wide, on in zip(badges, self.gauges, strict=True)
        ]
        height = 1.6 * BADGE_SIZE * scale * any(badges)
        self.badge = np.array([(width, height) for width in badges])  # px
        self.below = below is not None
        if below is not None:
            self.badge[:] = np.array(below) * scale
        side = 40 * scale
        below_row = 12 * scale
        pill = 1.75 * LABEL_SIZE * scale
        self.max_label = (size[0] - side) / len(
            traces
        ) - 0.8 * LABEL_SIZE * scale  # width of a label
        if self.beside:
            self.max_label = MAX_LABEL_SHARE * size[0]
            widths = [self.width(text) for text in self.texts()] + self.badge[:, 0]
            side = max(widths) + 30 * scale
            below_row = 20 * scale
        else:
            if max(self.width(name) for name in names) > self.max_label:
                self.names = style.distinct(names)
            both = [self.width(text) for text in self.texts()] + self.badge[:, 0] + 0.4 * pill
            self.in_line = bool((both < self.max_label).all())  # labels with their badges
            high = self.badge[:, 1].max()
            if not (self.in_line or not self.below):
                below_row = 0.15 * pill
            if self.in_line:
                below_row += max(pill, high)
            else:
                below_row += pill + high
        bottom = size[1] - below_row
        top = min((KEY_TOP + KEY_PITCH * len(self.key) + 6) * scale, bottom - MIN_ROOM * size[1])
        self.room = Room(side, max(top, (KEY_TOP + 4) * scale), size[0] - 40 * scale, bottom)
        self.keys = strips(self._keys())
        self.sheet = functools.lru_cache(maxsize=16)(lambda *its: strips(self._sheet(*its)))

    @property
    def apart(self) -> float:
        """The width, px, that an arm in a row needs for its label and what is below it; 0 for other
        machines.
        """
        if not self.below:
            return 0.0
        widths = np.array([self.width(text) for text in self.texts()])
        if self.in_line:
            both = widths + self.badge[:, 0]
        else:
            both = np.maximum(widths, self.badge[:, 0])
        return float(both.max()) + 1.2 * LABEL_SIZE * self.scale

    def texts(self, failed: Sequence[bool] | None = None) -> list[str]:
        """Return the labels, with the time of failure of machines that have failed; default: of all
        that will fail.
        """
        if failed is None:
            failed = [True] * len(self.traces)
        words = []
        for name, trace, gone in zip(self.names, self.traces, failed, strict=True):
            if gone and trace.diverged_at is not None:
                end = f": {style.ending(trace)}"
            else:
                end = ""
            room = self.max_label - self.width(end)
            words.append(style.cropped(name, room, LABEL_SIZE * self.scale, bold=True) + end)
        return words

    def width(self, text: str) -> float:
        """Return the width of a label, px."""
        return style.width(text, LABEL_SIZE * self.scale, bold=True) + 2.5 * LABEL_SIZE * self.scale

    def place(self, boxes: np.ndarray) -> None:
        """Place the labels under machines in a row, else at the left of each; `boxes` are their
        places, (n, 4) px.

        A badge is below its label, or at its right.
        """
        widths = np.array([self.width(text) for text in self.texts()])
        height = 1.75 * LABEL_SIZE * self.scale
        gap, middle, (wide, high) = 0.4 * height, (boxes[:, :2] + boxes[:, 2:]) / 2, self.badge.T
        if self.in_line:
            whole = widths + np.where(wide > 0, wide + 0.3 * height, 0.0)
            x = spread(middle[:, 0], whole + gap, self.size[0]) - (whole - widths) / 2
            tall = max(height, high.max())
            y = np.full(
                len(x),
                min(
                    boxes[:, 3].max() + 0.35 * height + tall / 2, self.size[1] - tall / 2 - gap / 2
                ),
            )
            across = x + widths / 2 + 0.3 * height + wide / 2
            down = y
        elif not self.beside:
            x = spread(middle[:, 0], np.maximum(widths, wide) + gap, self.size[0])
            y = np.full(
                len(x),
                min(boxes[:, 3].max() + 0.85 * height, self.size[1] - 0.6 * height - high.max()),
            )
            across = x
            down = y + (height + high) / 2 + 0.1 * height * (high > 0)
        else:
            x = np.maximum(boxes[:, 0] - gap, widths + wide + gap) - wide - widths / 2
            y = spread(middle[:, 1], np.full(len(x), 1.15 * height), self.size[1])
            across = x + (widths + wide) / 2 + 0.1 * height
            down = y
        self.pills = np.stack(
            [x - widths / 2, y - height / 2, x + widths / 2, y + height / 2], axis=1
        )
        self.badges = np.stack(
            [across - wide / 2, down - high / 2, across + wide / 2, down + high / 2], axis=1
        )

    def over(
        self,
        picture: np.ndarray,
        time: float,
        failed: tuple[bool, ...],
        states: tuple[State | None, ...] = (),
        speed: float = 1.0,
        shown: float = 0.0,
    ) -> np.ndarray:
        """Return the picture with the text on it: machines that have failed, their states, and the
        playback speed.

        The picture is `shown` so long after the film's beginning, s.
        """
        past = max((start for start in self.jumps if start <= time), default=None)
        image = Image.fromarray(picture)
        ink = min(1.0, (KEY_TIME + FADE_TIME - shown) / FADE_TIME)
        for strip, place in self.sheet(failed, states, past):
            image.paste(strip, place, strip)
        for strip, place in self.keys if ink > 0.0 else ():
            image.paste(
                strip,
                place,
                strip.getchannel("A").point(lambda alpha: alpha * ink) if ink < 1.0 else strip,
            )
        for k in np.flatnonzero(self.gauges):
            if not failed[k]:
                self._strip(ImageDraw.Draw(image), int(k), time)
        if speed < 1.0:
            pace = f"{1.0 / speed:.3g}× slower"
        else:
            pace = f"{speed:.3g}× faster"
        pace = pace if abs(speed - 1.0) > 1e-9 else ""
        self._clock(ImageDraw.Draw(image), f"{time:.{3 if speed < 0.2 else 2}f} s", pace)
        return np.asarray(image)

    def _clock(self, draw: ImageDraw.ImageDraw, time: str, speed: str) -> None:
        """Draw the time, and at its left the playback speed."""
        s = self.scale
        font = style.font(TITLE_SIZE * self.scale, bold=True)
        right = self.size[0] - EDGE * s
        draw.text((right, 16 * s), time, style.INK, font, anchor="ra")
        if not speed:
            return
        right -= style.width("00.000 s", TITLE_SIZE * s, bold=True) + KEY_SIZE * s
        left = right - style.width(speed, KEY_SIZE * s, bold=True) - KEY_SIZE * s
        middle = 28 * s
        box = left, middle - 0.85 * KEY_SIZE * s, right, middle + 0.85 * KEY_SIZE * s
        if speed.endswith("slower"):
            fill = style.INK
            rim = style.INK
        else:
            fill = style.PAPER
            rim = style.MUTED
        draw.rounded_rectangle(
            box, radius=0.85 * KEY_SIZE * s, fill=fill, outline=rim, width=max(1, round(s))
        )
        at = ((left + right) / 2, middle)
        letters = style.font(KEY_SIZE * s, bold=True)
        draw.text(at, speed, style.letters_on(fill), letters, anchor="mm")

    def _sheet(
        self, failed: tuple[bool, ...], states: tuple[State | None, ...], change: float | None
    ) -> Image.Image:
        """Draw everything but the clock; `change` is the time of the plant's last change, told in a
        dark box.
        """
        sheet = Image.new("RGBA", self.size, (255, 255, 255, 0))
        draw = ImageDraw.Draw(sheet)
        s = self.scale
        draw.text((EDGE * s, 16 * s), self.title, style.INK, style.font(TITLE_SIZE * s, bold=True))
        left = EDGE * s + style.width(self.title, TITLE_SIZE * s, bold=True) + EDGE * s
        room = self.size[0] - self.clock - EDGE * s - left
        if room > 4 * TITLE_SIZE * s:
            words = style.cropped(self.source, room, KEY_SIZE * s)
            draw.text((left, 21 * s), words, style.DISTURBANCE, style.font(KEY_SIZE * s))
        if change is not None:
            font = style.font(KEY_SIZE * s, bold=True)
            right = self.size[0] - EDGE * s
            y = 56 * s
            words = f"{self.jumps[change]} since {change:g} s"
            words = style.cropped(words, self.note_room - 8 * s, KEY_SIZE * s, bold=True)
            box = (
                right - style.width(words, KEY_SIZE * s, bold=True) - 8 * s,
                y - 11 * s,
                right + 8 * s,
                y + 11 * s,
            )
            draw.rounded_rectangle(box, radius=5 * s, fill=style.INK)
            draw.text((right, y), words, style.PAPER, font, anchor="rm")
        for text, colour, box, gone in zip(
            self.texts(failed), self.colours, self.pills, failed, strict=True
        ):
            fill = style.FAILED if gone else colour
            half = (box[3] - box[1]) / 2
            draw.rounded_rectangle(tuple(box), half, style.PAPER, style.RULE, max(1, round(s)))
            x = box[0] + 1.3 * half
            y = box[1] + half
            draw.ellipse(
                (x - 0.6 * half, y - 0.6 * half, x + 0.6 * half, y + 0.6 * half), fill=fill
            )
            place = box[0] + half + 1.1 * LABEL_SIZE * s, y
            draw.text(place, text, style.INK, style.font(LABEL_SIZE * s, bold=True), anchor="lm")
        looks = {
            CALM: (style.PAPER, style.MUTED),
            STUCK: (style.INK, style.PAPER),
            STRUCK: (style.REACTION,) * 2,
        }
        for state, box in zip(states, self.badges, strict=False):
            if state:  # pale while it moves, dark while friction holds it, bright in contact
                (fill, rim), middle = (
                    looks[state.mood],
                    ((box[0] + box[2]) / 2, (box[1] + box[3]) / 2),
                )
                draw.rounded_rectangle(
                    tuple(box), radius=5 * s, fill=fill, outline=rim, width=max(1, round(s))
                )
                letters = style.font(BADGE_SIZE * s, bold=True)
                draw.text(middle, state.words, style.letters_on(fill), letters, anchor="mm")
        return sheet

    def _keys(self) -> Image.Image:
        """Draw the key, on paper where it lies over the machines."""
        sheet = Image.new("RGBA", self.size, (255, 255, 255, 0))
        draw = ImageDraw.Draw(sheet)
        s = self.scale
        for i, text in enumerate(self.key):
            y = (KEY_TOP + KEY_PITCH * i) * s
            if y + KEY_PITCH * s > self.room.top:
                right = (EDGE + 4) * s + style.width(text, KEY_SIZE * s)
                draw.rectangle(
                    ((EDGE - 4) * s, y - 1, right, y + KEY_PITCH * s),
                    (*style.rgb(style.PAPER), 190),
                )
            draw.text((EDGE * s, y), text, style.DISTURBANCE, style.font(KEY_SIZE * s))
        return sheet

    def _strip(self, draw: ImageDraw.ImageDraw, k: int, time: float) -> None:
        """Draw the counts of machine k's encoder around its position at a time, s, and which of
        them is read.
        """
        (left, top, right, bottom), trace, s = self.badges[k], self.traces[k], self.scale
        sensor = trace.scenario.sensor
        assert sensor is not None
        count = sensor.quantum(trace.scenario.plant.unit == "rad")
        now, then = np.interp([time, time - sensor.delay], trace.t, trace.x[:, 0]) / count
        middle = (left + right) / 2
        step = (right - left) / STRIP_COUNTS
        draw.rounded_rectangle(
            (left, top, right, bottom), 5 * s, style.PAPER, style.MUTED, max(1, round(s))
        )
        for tick in range(
            math.ceil(now - STRIP_COUNTS / 2), math.floor(now + STRIP_COUNTS / 2) + 1
        ):
            x = middle + (tick - now) * step
            if left + 3 * s < x < right - 3 * s:
                draw.line(
                    (x, top + 0.62 * (bottom - top), x, bottom - 2 * s),
                    style.INK,
                    max(1, round(1.5 * s)),
                )
        read = np.clip(
            middle + (round(then + sensor.bias / count) - now) * step, left + 5 * s, right - 5 * s
        )
        draw.line((middle, top + 2 * s, middle, bottom - 2 * s), style.MUTED, max(1, round(s)))
        place = top + 0.35 * (bottom - top)
        r = 3.5 * s
        draw.ellipse((read - r, place - r, read + r, place + r), fill=self.colours[k])


def strips(sheet: Image.Image) -> list[tuple[Image.Image, tuple[int, int]]]:
    """Return the parts of a transparent sheet that have ink, with their places: to paste them takes
    less time.
    """
    ink = np.asarray(sheet.getchannel("A")) > 0
    rows = (
        np.flatnonzero(np.diff(ink.any(axis=1), prepend=False, append=False))
        .reshape(-1, 2)
        .tolist()
    )
    found = []
    for top, bottom in rows:
        columns = np.flatnonzero(ink[top:bottom].any(axis=0))
        left = int(columns[0])
        right = int(columns[-1]) + 1
        found.append((sheet.crop((left, top, right, bottom)), (left, top)))
    return found


def key(traces: Sequence[Trace], scales: Mapping[Group, Scale]) -> list[str]:
    """Return what arrows and ghosts mean, and how much of a network is shown."""

    def longest(quantity: str) -> str:
        """Return the values of the longest arrows, one a group, such as "6 N"; "" if there are
        none.
        """
        unit = "u" if quantity == "control" else "force"
        return ", ".join(
            f"{style.short(size)} {style.units(group)[unit]}{' or more' * (quantity in scale.exceeded)}"
            for group, scale in scales.items()
            if (size := getattr(scale, quantity))
        )

    words = []
    if sizes := longest("control"):
        drive = any(scale.drive for scale in scales.values())
        flies = bool(traces[0].scenario.plant.pose)
        if drive:
            what = "force of the drive"
        elif flies:
            what = "force of an actuator"
        else:
            what = "mean control"
        words += [f"arrow: {what}, longest {sizes}"]
        if flies:
            words += ["line: path; dark: the wanted path"]
        else:
            words += ["bar: its range"]
        words += ["pale arrow: command"] * drive
    if sizes := longest("disturbance"):
        words.append(f"dark arrow: disturbance, longest {sizes}")
    if sizes := longest("reaction"):
        words.append(f"violet arrow: {reaction_words(traces)}, longest {sizes}")
    words += filter(None, ["translucent: reference", traces[0].scenario.plant.scenery])
    if any(gauges(trace.scenario) for trace in traces):
        words.append("strip: counts of the encoder, the line is the position, the dot what is read")
    count = max(trace.scenario.plant.n for trace in traces)
    if count > MAX_CHANNELS and not traces[0].scenario.plant.direct:
        words.append(f"machines: the first {MAX_CHANNELS} of {count} pendulums")
    return words


def gauges(scenario: Scenario) -> bool:
    """Return whether a strip shows the counts of a scenario's encoder: for one channel."""
    return (
        scenario.sensor is not None and scenario.sensor.counts < math.inf and scenario.plant.n == 1
    )


def reaction_words(traces: Sequence[Trace]) -> str:
    """Return what the reaction of these traces consists of."""
    if any(trace.scenario.plant.direct and not trace.scenario.plant.smooth for trace in traces):
        return "friction, limits and contact"
    runs = [trace.scenario for trace in traces if trace.scenario.realistic]
    kinds = {"friction": has_dry_friction, "contact": has_contact, "backlash": backlash_gap}
    return " and ".join(kind for kind, has in kinds.items() if any(map(has, runs)))


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
    half = widths[order] / 2
    placed = centres[order].astype(float)
    edge = 0.0
    for i, h in enumerate(half):
        placed[i] = max(placed[i], edge + h)
        edge = placed[i] + h
    edge = room
    for i in reversed(range(len(placed))):
        placed[i] = min(placed[i], edge - half[i])
        edge = placed[i] - half[i]
    back = np.empty_like(placed)
    back[order] = placed
    return back
