"""Words on a film's frames: title, key to the arrows, a label a machine, the clock. Drawn with Pillow."""

import functools
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from smc_mujoco import style
from smc_mujoco.arrows import Longest
from smc_mujoco.camera import Room
from smc_mujoco.stage import SHOWN
from smc_mujoco.trace import Trace

LABEL = 15  # px, height of a label's letters in a film of full size


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
        longest: Longest,
    ):
        self.traces, self.names, self.colours, self.size, self.scale = traces, names, colours, size, scale
        self.title = title or style.plant_name(traces[0])
        self.key = key(traces, longest)
        x, y, _ = traces[0].scenario.plant.lane
        side, below = 40 * scale, 52 * scale
        if abs(y) > abs(x):  # machines behind each other have their labels at the left
            side, below = max(self.width(text) for text in self.texts()) + 30 * scale, 20 * scale
        self.room = Room(side, 106 * scale, size[0] - 40 * scale, size[1] - below)
        self.sheet = functools.lru_cache(maxsize=1)(self._sheet)

    def texts(self, failed: Sequence[bool] | None = None) -> list[str]:
        """The labels; with its time where a machine has failed, or ever will when `failed` is not given."""
        failed = [True] * len(self.traces) if failed is None else failed
        return [
            f"{name}: diverged at {trace.diverged_at:.2f} s" if gone and trace.diverged_at is not None else name
            for name, trace, gone in zip(self.names, self.traces, failed, strict=True)
        ]

    def width(self, text: str) -> float:
        """Width of a label, px."""
        return font(LABEL * self.scale, bold=True).getlength(text) + 1.4 * LABEL * self.scale

    def put(self, boxes: np.ndarray) -> None:
        """Place the labels under machines that stand in a row, else at the left of each. They never touch.

        Args:
          boxes: of the machines, (machines, 4) px: left, top, right, bottom.
        """
        widths, height = np.array([self.width(text) for text in self.texts()]), 1.75 * LABEL * self.scale
        gap, middle = 0.4 * height, (boxes[:, :2] + boxes[:, 2:]) / 2
        if self.room.left < widths.max():  # no room at the left
            x = spread(middle[:, 0], widths + gap, self.size[0])
            y = np.full(len(x), min(boxes[:, 3].max() + 0.9 * height, self.size[1] - 0.7 * height))
        else:
            x = np.maximum(boxes[:, 0] - gap, widths + gap) - widths / 2
            y = spread(middle[:, 1], np.full(len(x), 1.15 * height), self.size[1])
        self.pills = np.stack([x - widths / 2, y - height / 2, x + widths / 2, y + height / 2], axis=1)

    def over(self, picture: np.ndarray, time: float, failed: tuple[bool, ...]) -> np.ndarray:
        """The picture with the words on it."""
        image, sheet, s = Image.fromarray(picture), self.sheet(failed), self.scale
        image.paste(sheet, mask=sheet)
        place = self.size[0] - 24 * s, 16 * s
        ImageDraw.Draw(image).text(place, f"{time:.2f} s", style.INK, font(24 * s, bold=True), anchor="ra")
        return np.asarray(image)

    def _sheet(self, failed: tuple[bool, ...]) -> Image.Image:
        """Everything but the clock."""
        sheet = Image.new("RGBA", self.size, (255, 255, 255, 0))
        draw, s = ImageDraw.Draw(sheet), self.scale
        draw.text((24 * s, 16 * s), self.title, style.INK, font(24 * s, bold=True))
        draw.text((25 * s, 48 * s), self.key, style.MUTED, font(13 * s))
        for text, colour, box, gone in zip(self.texts(failed), self.colours, self.pills, failed, strict=True):
            fill = style.FAILED if gone else colour
            draw.rounded_rectangle(tuple(box), radius=(box[3] - box[1]) / 2, fill=fill)
            middle = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
            draw.text(middle, text, style.letters_on(fill), font(LABEL * s, bold=True), anchor="mm")
        return sheet


@functools.cache
def font(size: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, as matplotlib brings it."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path(), "fonts", "ttf", name)), size)


def key(traces: Sequence[Trace], longest: Longest) -> str:
    """What the arrows mean, and how much of a network is shown."""
    unit = style.units(traces[0])["u"]
    words = [f"coloured arrow: control, longest {longest.control:.2g} {unit}"]
    if longest.disturbance:
        words.append(f"dark arrow: disturbance, longest {longest.disturbance:.2g} {unit}")
    most = max(trace.scenario.plant.n for trace in traces)
    if most > SHOWN:
        words.append(f"the first {SHOWN} of {most} pendulums")
    return "     ".join(words)


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
