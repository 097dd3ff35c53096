"""A page of figures: its size, title, legend, ticks and files.

A figure is new, or is drawn into the caller's matplotlib Figure or SubFigure. It is as wide as a
page of this package (8.8 in), an IEEE page or column, a slide, or has any size in inches.
"""

import io
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import get_registered_canvas_class
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import FontProperties
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation
from matplotlib.ticker import MaxNLocator

from smc_mujoco.common.constraints import OneOf
from smc_mujoco.common.errors import ScenarioError, find, items_of, shown
from smc_mujoco.common.files import as_path, replacing
from smc_mujoco.control.source import NONE, Source, kinds
from smc_mujoco.draw import dark, lettering, style, wording
from smc_mujoco.simulation.trace import Trace

DPI = 200  # of a PNG of a full page or a slide
PRINT_DPI = 400  # of a journal's page or column
FORMATS = ("svg", "png", "pdf")
# the key of a file's description, and what would tell the date
METADATA = {
    ".svg": ("Description", {"Date": None}),
    ".png": ("Description", {}),
    ".pdf": ("Subject", {"CreationDate": None}),
}
TEX_POINT = 1.0 / 72.27  # inches
NAMED = {
    "ieee-column": (252.0 * TEX_POINT, None),
    "ieee-page": (516.0 * TEX_POINT, None),
    "slide": (style.SLIDE_WIDTH, 7.5),
}  # inches
MAX_HEIGHT = 9.0  # inches, of a figure in a journal, whose columns are 9.25 high
SIDE_RANGE = (2.0, 100.0)  # inches, shortest and longest
NARROW = 6.0  # inches: narrower pages have one column of panels
TEXT_SIZE = 11.0  # points on a full page
TITLE_SIZE = 17.0
ENTRY_SAMPLE = 3.4  # of a legend's entry, in heights of its letters: its sample
ENTRY_SPACE = 2.3  # and all its spaces
TITLE_PAD = 5.0  # points on a full page, above the title
# largest width of a legend's entry, of the page's: in several columns, in one
MAX_SHARE = 0.55
MAX_SINGLE_SHARE = 0.95
MAX_TICKS = 9  # ticks of an axis, as of matplotlib's
TICK_LETTERS = 6  # of the label of a tick, and of the space beside it
STEPS = (1, 2, 2.5, 5, 10)  # between ticks, as of matplotlib's AutoLocator
Handle = Line2D | Patch
Size = str | tuple[float, float] | None


class Page(Figure):
    """A figure that a notebook shows, although pyplot does not know of it."""

    def _repr_png_(self) -> tuple[bytes, dict[str, float]]:
        content, width = embedded(self)
        return content, {"width": width}


def embedded(page: Figure | SubFigure) -> tuple[bytes, float]:
    """Return the whole figure as a PNG, and its width in px of a web page, 96 an inch."""
    root = page.get_figure(root=True)
    content = io.BytesIO()
    root.savefig(content, format="png", dpi=DPI)
    return content.getvalue(), 96 * root.get_figwidth()


def resolution(page: Figure | SubFigure) -> float:
    """Return the dots per inch of the PNG of the whole figure."""
    if page.get_figure(root=True).get_figwidth() >= style.JOURNAL_WIDTH:
        return DPI
    return PRINT_DPI


def measure(size: Size, fig: Figure | SubFigure | None = None) -> tuple[float, float | None]:
    """Return the width and height of a figure in inches; None for a height that depends on the
    contents.
    """
    if fig is not None:
        if size is not None:
            raise ScenarioError(
                f"size is {shown(size)}, but fig already has a size: give one of the two"
            )
        if not isinstance(fig, Figure | SubFigure):
            raise ScenarioError(f"fig is {shown(fig)}: give a figure of matplotlib")
        box = fig.bbox.transformed(fig.dpi_scale_trans.inverted())
        return box.width, box.height
    if size is None:
        return style.FULL_WIDTH, None
    if isinstance(size, str):
        return find("size", size, NAMED)
    try:
        width, height = map(float, size)
    except (TypeError, ValueError):
        width = height = 0.0
    if not SIDE_RANGE[0] <= min(width, height) <= max(width, height) <= SIDE_RANGE[1]:
        raise ScenarioError(
            f"size is {shown(size)}: give (width, height) in inches, "
            f"each {SIDE_RANGE[0]:g} to {SIDE_RANGE[1]:g}"
        )
    return width, height


def entry(label: str, colour: str = style.MUTED, **look: Any) -> Line2D:
    """Return a legend's entry with a line, of 3 points by default."""
    stated = {"lw": style.points(3.0), **look}
    return Line2D([], [], label=label, color=colour, **stated)


def given_axes(
    ax: Axes, size: Size, fig: Figure | SubFigure | None, panels: Sequence[str] | None
) -> str:
    """Return the panel that is drawn into a caller's axes; refuse what does not go with them."""
    if not isinstance(ax, Axes):
        raise ScenarioError(f"ax is {shown(ax)}: give axes of matplotlib")
    if size is not None or fig is not None:
        raise ScenarioError("ax has a figure and a size: give ax alone, or size or fig")
    chosen = items_of("panels", ["x"] if panels is None else panels)
    if len(chosen) != 1:
        raise ScenarioError(f"panels is {shown(panels)} for one ax: give one, such as ['u']")
    return chosen[0]


def blank(width: float, height: float, fig: Figure | SubFigure | None = None) -> Figure | SubFigure:
    """Return a page to draw on:

    `fig`, or a new one of this size in inches. Its layout keeps texts apart.
    """
    across, down = style.points(7.2) / 72, style.points(TITLE_PAD) / 72  # inches
    layout = ConstrainedLayoutEngine(w_pad=across, h_pad=down, wspace=0.02, hspace=0.02)
    if fig is None:
        return Page(figsize=(width, height), layout=layout)
    if isinstance(fig, Figure) and fig.get_layout_engine() is None:
        fig.set_layout_engine(layout)
    return fig


def head_height(width: float, handles: Sequence[Handle], titled: bool = True) -> float:
    """Return the height of the title, if there is one, and of the legend, in inches."""
    labels, columns = _legend(handles, width)
    lines = np.char.count(labels, "\n") + 1 if labels else np.zeros(0)
    parts = np.array_split(lines, columns)
    rows = max(part.sum() for part in parts)
    above = 1.9 * TITLE_SIZE if titled else 0.0
    return style.points(above + 1.45 * TEXT_SIZE * rows) / 72


def _legend(handles: Sequence[Handle], width: float) -> tuple[list[str], int]:
    """Return a legend's labels, each on up to two lines, and its columns: as many as fit on a page
    of `width` inches.

    In a single column labels may be as wide as the page.
    """
    page = 72 * width
    size = style.points(TEXT_SIZE)
    labels = []
    beside = (ENTRY_SAMPLE + ENTRY_SPACE) * size  # of a label
    for share in (MAX_SHARE, MAX_SINGLE_SHARE):
        labels = []
        widths = []
        for handle in handles:
            words = str(handle.get_label())
            label = lettering.wrapped(words, share * page - beside, size, lines=2)
            labels.append(label)
            widest = lettering.widest(label.split("\n"), size)
            widths.append(beside + widest)
        for columns in range(len(widths), 1, -1):
            parts = np.array_split(widths, columns)
            if sum(map(max, parts)) < page - 16:
                return labels, columns
    return labels, 1


def note_room(width: float) -> float:
    """Return the room for a note beside the title of a page of `width` inches, in points."""
    return MAX_SHARE * (72 * width - 16)


def set_head(
    page: Figure | SubFigure, width: float, title: str, handles: Sequence[Handle], note: str = ""
) -> None:
    """Draw the title with the legend below it, in as few rows as fit, and a note at the right of
    the title.

    A long title has smaller letters, no smaller than the legend's, and then a second line. Without
    a title the legend is at the top.
    """
    size = style.points(TEXT_SIZE)
    big = style.points(TITLE_SIZE)
    room = 72 * width - 16
    words, columns = _legend(handles, width)
    if note:
        note = lettering.cropped(note, note_room(width), size)
        room -= lettering.width(note, size) + big
        place = {"xytext": (-8, -style.points(TITLE_PAD) - big), "textcoords": "offset points"}
        look = {"fontsize": size, "color": style.MUTED, "ha": "right", "va": "baseline"}
        look |= {"parse_math": False, "annotation_clip": False}
        text = Annotation(note, (1.0, 1.0), xycoords=page.transSubfigure, **place, **look)
        page.add_artist(text).set_in_layout(False)
    if title:
        wide = lettering.width(title, big, bold=True)
        big = max(size, min(big, big * room / wide))
    legend = page.legend(
        handles=handles or [Line2D([], [], lw=0)],
        labels=["."] * len(words) or [""],  # matplotlib leaves out labels that begin with _
        title=lettering.wrapped(title, room, big, lines=2, bold=True),
        title_fontproperties={"size": big, "weight": "bold"},
        alignment="left",
        loc="outside upper left",
        ncols=columns,
        fontsize=size,
        borderpad=0.2,
        handlelength=ENTRY_SAMPLE,
        columnspacing=1.5,
    )
    legend.get_title().set_parse_math(False)
    for label, text in zip(legend.get_texts(), words or [""], strict=True):
        label.set_text(text)
        label.set_parse_math(False)


def run_handles(
    traces: Sequence[Trace], names: Sequence[str], colours: Sequence[str]
) -> list[Handle]:
    """Return a legend's entries for runs, which say when a run failed."""
    handles: list[Handle] = []
    looks = style.looks(traces)
    for trace, name, colour, look in zip(traces, names, colours, looks, strict=True):
        how = wording.ending(trace)
        words = f"{name} ({how})" if how else name
        sample = entry(words, colour, lw=style.points(2.0), **look)
        handles.append(sample)
    return handles


def gain_sources(sources: Sequence[Iterable[Source]]) -> tuple[list[str], str]:
    """Return where gains come from: a text behind each label, such as ", gains: default", and a
    note.

    If all gains come from the same source, the note says so, and the texts are "".
    """
    words = []
    for of_law in sources:
        source = kinds(of_law)
        words.append("" if source in ("", NONE) else f"gains: {source}")
    different = set(filter(None, words))
    if len(different) == 1:
        return [""] * len(words), different.pop()
    words_by_law = []
    for text in words:
        words_by_law.append(f", {text}" if text else "")
    return words_by_law, ""


def files(path: str | os.PathLike[str] | None, format: str | None = None) -> list[Path]:
    """Return the files of a figure: a PDF for .pdf, else an SVG and a PNG; only one of them if
    `format` is given.

    ".5" in "lam_0.5" and ".b c" in "a.b c" do not count as endings. Without a path there are no
    files.
    """
    if path is None:
        if format is not None:
            raise ScenarioError(f"format is {shown(format)} without a file: give path too")
        return []
    base = as_path(path)
    if not base.name or "\0" in base.name:
        raise ScenarioError(
            f"cannot draw to {str(path)!r}: give the name of a file, such as network.svg"
        )
    if format is not None:
        OneOf(names=FORMATS)("format", format)
    ending = base.suffix[1:]
    if ending in FORMATS:
        base = base.with_suffix("")
    elif ending.isalnum() and ending[0].isalpha():
        raise ScenarioError(f"cannot draw to {base.name!r}: end the name in .svg, .png or .pdf")
    if format is not None and ending in FORMATS and ending != format:
        raise ScenarioError(
            f"cannot draw to {Path(path).name!r} as {format}: end the name in .{format}"
        )
    if format:
        endings = (format,)
    elif ending == "pdf":
        endings = ("pdf",)
    else:
        endings = ("svg", "png")
    return [base.with_name(f"{base.name}.{ending}") for ending in endings]


def write_page(page: Figure | SubFigure, paths: Sequence[Path]) -> Figure:
    """Suit a figure that is drawn to a dark page, write it as `save` does, and return it."""
    dark.suit_page(page.findobj())
    return save(page, paths)


def save(page: Figure | SubFigure, paths: Sequence[Path]) -> Figure:
    """Write a whole figure to files of these names, its label as their description, and return it.

    The same figure gives the same files.
    """
    root = page.get_figure(root=True)
    if not paths:
        return root
    about = str(page.get_label()) or None
    layout = root.get_layout_engine()
    if layout is not None:
        canvas = root.canvas
        dpi = root.dpi
        canvas_of = get_registered_canvas_class(paths[0].suffix[1:])
        canvas_of(root)  # texts are as large as this canvas draws them
        root.dpi = resolution(root)
        layout.execute(root)
        root.set_canvas(canvas)
        root.dpi = dpi
    root.set_layout_engine(None)  # savefig draws a figure twice while it has a layout
    for path in paths:
        key, dates = METADATA[path.suffix]
        look = {"format": path.suffix[1:], "dpi": resolution(root)}
        with replacing(path) as part:
            root.savefig(part, metadata=dates | {key: about}, **look)
    root.set_layout_engine(layout)
    return root


def space_ticks(page: Figure | SubFigure) -> None:
    """Give the axes of a page so few ticks that labels of TICK_LETTERS letters do not touch.

    Logarithmic axes and ticks that were set stay.
    """
    size = FontProperties(size=matplotlib.rcParams["xtick.labelsize"]).get_size_in_points()
    for ax in page.findobj(Axes):
        assert isinstance(ax, Axes)
        if isinstance(ax.xaxis.get_major_locator(), MaxNLocator):
            room = 72 * ax.get_window_extent().width / ax.figure.dpi
            digit = lettering.width("0" * TICK_LETTERS, size)
            count = int(room / digit)
            most = min(max(count, 1), MAX_TICKS)
            ax.xaxis.set_major_locator(MaxNLocator(most, steps=STEPS))
