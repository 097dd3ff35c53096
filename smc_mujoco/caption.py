"""Words on a film's frames: title, key to the arrows, a label a machine, the clock. Drawn with Pillow."""

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from PIL import ImageDraw, ImageFont

from smc_mujoco import style


@functools.cache
def font(size: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, as matplotlib brings it."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path(), "fonts", "ttf", name)), size)


class Pill(NamedTuple):
    """A label in a rounded box."""

    text: str
    colour: str
    centre: tuple[float, float]  # px


def pill_size(text: str, size: float) -> tuple[float, float]:
    """Width and height in px of a pill with this text."""
    return font(size, bold=True).getlength(text) + 1.4 * size, 1.75 * size


def draw_pill(draw: ImageDraw.ImageDraw, pill: Pill, size: float) -> None:
    """One label: the law's colour with white or black letters, whichever reads better."""
    width, height = pill_size(pill.text, size)
    x, y = pill.centre
    box = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
    draw.rounded_rectangle(box, radius=height / 2, fill=pill.colour)
    red, green, blue = style.rgb(pill.colour)
    letters = style.INK if 0.299 * red + 0.587 * green + 0.114 * blue > 140 else "#FFFFFF"
    draw.text((x, y), pill.text, fill=letters, font=font(size, bold=True), anchor="mm")


def place(
    boxes: np.ndarray, texts: Sequence[str], size: float, picture: tuple[int, int]
) -> list[tuple[float, float]]:
    """Centres of the labels: under machines that stand in a row, else at the left of each.

    Labels that would touch move apart, and none leaves the picture.
    """
    widths, height = [pill_size(text, size)[0] for text in texts], pill_size("", size)[1]
    if in_a_row(boxes):
        x = spread((boxes[:, 0] + boxes[:, 2]) / 2, np.array(widths) + 0.4 * size, picture[0] - 0.4 * size)
        y = min(boxes[:, 3].max() + 0.9 * height, picture[1] - 0.7 * height)
        return [(float(v), float(y)) for v in x]
    y = spread((boxes[:, 1] + boxes[:, 3]) / 2, np.full(len(boxes), 1.15 * height), picture[1] - 0.2 * height)
    x = [
        max(box[0] - width / 2 - size, width / 2 + 0.5 * size)
        for box, width in zip(boxes, widths, strict=True)
    ]
    return list(zip(map(float, x), map(float, y), strict=True))


def in_a_row(boxes: np.ndarray) -> bool:
    """Whether machines stand beside each other in the picture, not behind each other."""
    middle = (boxes[:, :2] + boxes[:, 2:]) / 2
    return bool(np.ptp(middle[:, 0]) >= np.ptp(middle[:, 1]) and (len(boxes) > 1 or wide(boxes[0])))


def wide(box: np.ndarray) -> bool:
    """Whether a lone machine leaves its sides free."""
    return bool(box[2] - box[0] < 2 * (box[3] - box[1]))


def spread(centres: np.ndarray, widths: np.ndarray, room: float) -> np.ndarray:
    """Centres moved as little as needed so that intervals of these widths do not overlap and lie within 0 .. room."""
    order = np.argsort(centres)
    centres = centres[order].astype(float)
    widths = widths[order]
    gap = (widths[1:] + widths[:-1]) / 2
    edge = widths[0] / 2
    for i in range(len(centres)):
        centres[i] = max(centres[i], edge)
        edge = centres[i] + (gap[i] if i < len(gap) else 0.0)
    edge = room - widths[-1] / 2
    for i in reversed(range(len(centres))):
        centres[i] = min(centres[i], edge)
        edge = centres[i] - (gap[i - 1] if i else 0.0)
    back = np.empty_like(centres)
    back[order] = centres
    return back
