"""What is printed or drawn, without its numbers, for `assert words(...) == snapshot`.

A snapshot holds everything that one page, figure or command says at once; `pytest --snapshot-update` records it anew.
Numbers have tests of their own, and their last digits differ between processors.
"""

import re
import sys
from collections.abc import Iterable
from pathlib import Path

from matplotlib import colors
from matplotlib.figure import Figure, SubFigure
from matplotlib.text import Text

NUMBER = re.compile(r"[-+−]?\b\d+(?:[.,]\d+)*(?:e[-+]?\d+)?\b")
SPACE = re.compile(r"[ \t─━-]{2,}")  # widths of columns depend on numbers


def recorded(file: str, names: Iterable[str]) -> list[str]:
    """Return those names that the snapshots of a test file have as cases, so that a new one needs no recording at once.

    All of them while recording.
    """
    record = Path(file).parent / "__snapshots__" / f"{Path(file).stem}.ambr"
    if "--snapshot-update" in sys.argv or not record.exists():
        return list(names)
    text = record.read_text(encoding="utf-8")
    return [name for name in names if f"[{name}]\n" in text]


def words(text: str) -> str:
    """Return a text with # for its numbers, and one space for a run of spaces or of lines that rule a table."""
    lines = (SPACE.sub(" ", NUMBER.sub("#", line)).strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line)


def looks(page: Figure | SubFigure) -> str:
    """Return what a figure says, axes by axes: words, scales, and for each line its label, colour, style and width."""
    of_axes = {text for axes in page.axes for text in axes.findobj(Text)}
    beside = [text for text in page.findobj(Text) if text not in of_axes and text.get_visible() and text.get_text()]
    said = [words(text.get_text()) for text in beside]
    for axes in page.axes:
        legend = axes.get_legend()
        texts = [axes.get_title(loc="left"), axes.get_title(), axes.get_title(loc="right"), axes.get_xlabel()]
        texts += [axes.get_ylabel(), *(text.get_text() for text in axes.texts)]
        texts += [] if legend is None else [text.get_text() for text in legend.get_texts()]
        ticks = [text.get_text() for axis in (axes.xaxis, axes.yaxis) for text in axis.get_ticklabels()]
        said += ["", f"axes: {axes.get_xscale()}, {axes.get_yscale()}"]
        said += [words(text) for text in (*texts, *ticks) if text and words(text).strip("#.· ")]
        for line in axes.lines:
            colour = colors.to_hex(line.get_color(), keep_alpha=True)
            look = f"{colour} {line.get_linestyle()} {line.get_marker()} {line.get_linewidth():.2g}"
            said.append(f"line {words(str(line.get_label()))}: {look}, layer {line.get_zorder():g}")
        for patch in axes.patches:
            fill, edge = (colors.to_hex(one, keep_alpha=True) for one in (patch.get_facecolor(), patch.get_edgecolor()))
            said.append(f"patch {type(patch).__name__}: {fill}, edge {edge}, layer {patch.get_zorder():g}")
        said += [f"{type(one).__name__}, layer {one.get_zorder():g}" for one in axes.collections]
    return "\n".join(said)
