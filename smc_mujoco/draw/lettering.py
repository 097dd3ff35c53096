"""Letters of pictures: how wide a text is, and how it fits a room."""

import functools
import re
from collections.abc import Iterable
from pathlib import Path

from smc_mujoco.draw.style import RC, points


@functools.cache
def font(size: float, bold: bool = False):
    """Return DejaVu Sans, which comes with matplotlib, as a font of Pillow with letters `size`
    high.
    """
    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    folder = matplotlib.get_data_path()
    return ImageFont.truetype(Path(folder, "fonts", "ttf", name), size)


def width(text: str, size: float, bold: bool = False) -> float:
    """Return the width of a text, in the unit of `size`, the height of its letters."""
    return font(10 * size, bold).getlength(text) / 10  # Pillow rounds small letters to pixels


def widest(lines: Iterable[str], size: float) -> float:
    """Return the width of the widest of these lines, in the unit of `size`."""
    return max(width(line, size) for line in lines)


def cropped(text: str, room: float, size: float, bold: bool = False) -> str:
    """Return the text on one line, with an ellipsis at its end if it is wider than the room."""
    text = " ".join(text.split())
    if width(text, size, bold) <= room:
        return text
    while text and width(f"{text}…", size, bold) > room:
        text = text[:-1]
    return f"{text.rstrip()}…"


def wrapped(text: str, room: float, size: float, lines: int, bold: bool = False) -> str:
    """Return the text on at most `lines` lines, broken between words, with an ellipsis at its end
    if it is too long.

    A number and a short word after it, such as its unit, stay together.
    """
    broken = []
    words = re.split(r"(?<!\d)\s+|\s+(?!\S{1,4}(?:\s|$))", text.strip())
    while words and len(broken) < lines - 1:
        count = len(words)
        while count > 1 and width(" ".join(words[:count]), size, bold) > room:
            count -= 1
        line = " ".join(words[:count])
        broken.append(cropped(line, room, size, bold))
        words = words[count:]
    if words:
        line = cropped(" ".join(words), room, size, bold)
        broken.append(line)
    return "\n".join(broken)


def folded(label: str, room: float = 120.0) -> str:
    """Return an axis's label on up to four lines of a room in points, broken after underscores
    too.
    """
    breakable = label.replace("_", "_ ")
    letters = points(RC["font.size"])
    return wrapped(breakable, room, letters, 4).replace("_ ", "_")
