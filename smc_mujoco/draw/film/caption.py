"""Words on a film's frames: title, key to the arrows, a label a machine and its state, the clock. Drawn with Pillow."""

import functools
from collections.abc import Mapping, Sequence

import numpy as np
from PIL import Image, ImageDraw

from smc_mujoco.draw import style
from smc_mujoco.draw.film.arrows import Longest
from smc_mujoco.draw.film.camera import Room
from smc_mujoco.draw.film.stage import SHOWN
from smc_mujoco.draw.states import CALM, HELD, STRUCK, State, play, rubs, touches
from smc_mujoco.metrics.channel_groups import Group
from smc_mujoco.simulation.trace import Trace

LABEL, TITLE, KEY, BADGE = 15, 24, 13, 13  # px, height of letters in a film of full size
EDGE = 24  # px, from the picture's edge to words
MOST = 0.3  # of the picture's width, for a label beside its machine
NEWS = 1.5  # s for which a change of the plant is told loudly


class Caption:
    """All that is written over the stage of a film.

    Attributes:
      room: what the words leave to the machines.
    """

    def __init__(
        self,
        traces: Sequence[Trace],
        names: Sequence[str],
        colours: Sequence[str],
        title: str | None,
        size: tuple[int, int],
        scale: float,
        longest: Mapping[Group, Longest],
        told: Sequence[Sequence[State | None]] = (),
    ):
        self.traces, self.names, self.colours, self.size, self.scale = traces, names, colours, size, scale
        self.jumps = style.jumps(traces, names)
        inside = size[0] - 2 * EDGE * scale
        clock = style.width("00.00 s", TITLE * scale, bold=True) + EDGE * scale
        self.title = style.cropped(title or style.plant_name(traces[0]), inside - clock, TITLE * scale, bold=True)
        notes = [style.width(f"{words} since {time:g} s", KEY * scale, bold=True) for time, words in self.jumps.items()]
        self.note_room = min(max(notes, default=0.0) + EDGE * scale, 0.4 * inside)
        self.key = wrapped(key(traces, longest), inside - self.note_room, KEY * scale)
        x, y, _ = traces[0].scenario.plant.lane
        self.beside = abs(y) > abs(x)  # machines behind each other have their labels at the left
        words = [{state.words for state in each if state} for each in told] or [set()] * len(traces)
        badges = [max((self.badge_width(text) for text in each), default=0.0) for each in words]
        self.badge = np.array([badges, [1.6 * BADGE * scale * any(badges)] * len(traces)]).T  # width and height, px
        side, below = 40 * scale, 52 * scale
        self.most = (size[0] - side) / len(traces) - 0.8 * LABEL * scale  # width of a label
        if self.beside:
            self.most = MOST * size[0]
            widths = [self.width(text) for text in self.texts()] + self.badge[:, 0]
            side, below = max(widths) + 30 * scale, 20 * scale
        else:
            below += self.badge[:, 1].max()
        top = (106 + 1.4 * KEY * (len(self.key) - 1)) * scale
        self.room = Room(side, top, size[0] - 40 * scale, size[1] - below)
        self.sheet = functools.lru_cache(maxsize=1)(self._sheet)

    def texts(self, failed: Sequence[bool] | None = None) -> list[str]:
        """The labels; with its time where a machine has failed, or ever will when `failed` is not given."""
        failed = [True] * len(self.traces) if failed is None else failed
        return [self.label(*each) for each in zip(self.names, self.traces, failed, strict=True)]

    def label(self, name: str, trace: Trace, gone: bool) -> str:
        """A name with how its machine has ended; as much of the name as there is room for."""
        end = f": {style.ending(trace)}" if gone and trace.diverged_at is not None else ""
        size = LABEL * self.scale
        return style.cropped(name, self.most - self.width(end), size, bold=True) + end

    def width(self, text: str) -> float:
        """Width of a label, px."""
        return style.width(text, LABEL * self.scale, bold=True) + 1.4 * LABEL * self.scale

    def badge_width(self, text: str) -> float:
        """Width of a badge, which tells a machine's state, px."""
        return style.width(text, BADGE * self.scale, bold=True) + 1.2 * BADGE * self.scale

    def put(self, boxes: np.ndarray) -> None:
        """Place the labels under machines that stand in a row, else at the left of each. They never touch.

        A badge is below its label, or at its right.

        Args:
          boxes: of the machines, (machines, 4) px: left, top, right, bottom.
        """
        widths, height = np.array([self.width(text) for text in self.texts()]), 1.75 * LABEL * self.scale
        gap, middle, (wide, high) = 0.4 * height, (boxes[:, :2] + boxes[:, 2:]) / 2, self.badge.T
        if not self.beside:
            x = spread(middle[:, 0], np.maximum(widths, wide) + gap, self.size[0])
            y = np.full(len(x), min(boxes[:, 3].max() + 0.9 * height, self.size[1] - 0.7 * height - high.max()))
            across, down = x, y + (height + high) / 2 + 0.1 * height * (high > 0)
        else:
            x = np.maximum(boxes[:, 0] - gap, widths + wide + gap) - wide - widths / 2
            y = spread(middle[:, 1], np.full(len(x), 1.15 * height), self.size[1])
            across, down = x + (widths + wide) / 2 + 0.1 * height, y
        self.pills = np.stack([x - widths / 2, y - height / 2, x + widths / 2, y + height / 2], axis=1)
        self.badges = np.stack([across - wide / 2, down - high / 2, across + wide / 2, down + high / 2], axis=1)

    def over(
        self, picture: np.ndarray, time: float, failed: tuple[bool, ...], told: tuple[State | None, ...] = ()
    ) -> np.ndarray:
        """The picture with the words on it: of each machine whether it has failed, and its state."""
        past = max((start for start in self.jumps if start <= time), default=None)
        image = Image.fromarray(picture)
        sheet, s = self.sheet(failed, told, past, past is not None and time < past + NEWS), self.scale
        image.paste(sheet, mask=sheet)
        place = self.size[0] - EDGE * s, 16 * s
        ImageDraw.Draw(image).text(place, f"{time:.2f} s", style.INK, style.font(TITLE * s, bold=True), anchor="ra")
        return np.asarray(image)

    def _sheet(
        self, failed: tuple[bool, ...], told: tuple[State | None, ...], change: float | None, loud: bool
    ) -> Image.Image:
        """Everything but the clock; `change` is the time of the plant's last change."""
        sheet = Image.new("RGBA", self.size, (255, 255, 255, 0))
        draw, s = ImageDraw.Draw(sheet), self.scale
        draw.text((EDGE * s, 16 * s), self.title, style.INK, style.font(TITLE * s, bold=True))
        for i, text in enumerate(self.key):
            draw.text((EDGE * s, (48 + 1.4 * KEY * i) * s), text, style.MUTED, style.font(KEY * s))
        if change is not None:
            self._note(draw, f"{self.jumps[change]} since {change:g} s", loud)
        for text, colour, box, gone in zip(self.texts(failed), self.colours, self.pills, failed, strict=True):
            fill = style.FAILED if gone else colour
            draw.rounded_rectangle(tuple(box), radius=(box[3] - box[1]) / 2, fill=fill)
            middle = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
            draw.text(middle, text, style.letters_on(fill), style.font(LABEL * s, bold=True), anchor="mm")
        for state, box in zip(told, self.badges, strict=False):
            if state:
                self._badge(draw, state, box)
        return sheet

    def _badge(self, draw: ImageDraw.ImageDraw, state: State, box: np.ndarray) -> None:
        """What a machine does now: pale while it moves, dark while friction holds it, bright while it hits."""
        fill, rim = {CALM: (style.PAPER, style.MUTED), HELD: (style.INK,) * 2, STRUCK: (style.REACTION,) * 2}[
            state.mood
        ]
        size, middle = BADGE * self.scale, ((box[0] + box[2]) / 2, (box[1] + box[3]) / 2)
        draw.rounded_rectangle(
            tuple(box), radius=5 * self.scale, fill=fill, outline=rim, width=max(1, round(self.scale))
        )
        draw.text(middle, state.words, style.letters_on(fill), style.font(size, bold=True), anchor="mm")

    def _note(self, draw: ImageDraw.ImageDraw, text: str, loud: bool) -> None:
        """What has changed, under the clock; in a dark box while it is news."""
        s = self.scale
        text = style.cropped(text, self.note_room, KEY * s, bold=True)
        right, y = self.size[0] - EDGE * s, 56 * s
        if loud:
            box = right - style.width(text, KEY * s, bold=True) - 8 * s, y - 11 * s, right + 8 * s, y + 11 * s
            draw.rounded_rectangle(box, radius=5 * s, fill=style.INK)
        colour = style.PAPER if loud else style.INK
        draw.text((right, y), text, colour, style.font(KEY * s, bold=True), anchor="rm")


def key(traces: Sequence[Trace], longest: Mapping[Group, Longest]) -> list[str]:
    """What the arrows mean, and how much of a network is shown."""
    sizes = [(style.units(group)["u"], each) for group, each in longest.items()]
    control = [f"{style.short(each.control)} {unit}" for unit, each in sizes if each.control]
    disturbance = [f"{style.short(each.disturbance)} {unit}" for unit, each in sizes if each.disturbance]
    reaction = [
        f"{style.short(each.reaction)} {unit}{' or more' * each.blows}" for unit, each in sizes if each.reaction
    ]
    words = []
    if control:
        words += [
            f"coloured arrow: mean control, longest {', '.join(control)}",
            "bar: the range over which it switches",
        ]
    if disturbance:
        words.append(f"dark arrow: disturbance, longest {', '.join(disturbance)}")
    if reaction:
        words.append(f"violet arrow: {reacting(traces)}, longest {', '.join(reaction)}")
    most = max(trace.scenario.plant.n for trace in traces)
    if most > SHOWN:
        words.append(f"machines: the first {SHOWN} of {most} pendulums")
    return words


def reacting(traces: Sequence[Trace]) -> str:
    """What the reaction of these traces is made of."""
    if any(trace.scenario.plant.direct and not trace.scenario.plant.smooth for trace in traces):
        return "friction, limits and contact"
    runs = [trace.scenario for trace in traces if trace.scenario.realistic]
    kinds = {
        "friction": any(rubs(scenario) for scenario in runs),
        "contact": any(touches(scenario) for scenario in runs),
        "backlash": any(play(scenario) for scenario in runs),
    }
    return " and ".join(kind for kind, there in kinds.items() if there)


def wrapped(parts: Sequence[str], room: float, size: float) -> list[str]:
    """The parts in as few lines as the room allows."""
    lines: list[str] = []
    for part in parts:
        longer = f"{lines[-1]}     {part}" if lines else part
        if lines and style.width(longer, size) <= room:
            lines[-1] = longer
        else:
            lines.append(style.cropped(part, room, size))
    return lines


def spread(centres: np.ndarray, widths: np.ndarray, room: float) -> np.ndarray:
    """Centres moved as little as needed for intervals of these widths to lie apart within 0 .. room."""
    order = np.argsort(centres)
    half, placed = widths[order] / 2, centres[order].astype(float)
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
