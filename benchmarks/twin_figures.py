"""What simulation said of real machines, and what these did: a row for each figure of each public
record.

    for one in rows("qube_servo"):
        one.machine, one.twin, one.use        # of theta in record 11: 0.2638, 0.2628, "held out"

A twin is a distribution over its parameter sets and seeds, so that each figure has a range. Whether
a record was used is not written down with the figure but follows from the rig: one that was
identified from no record here is "unfitted"; of others the records of `Rig.identified_from` are
"fitted on", and all the rest are "held out".

The records are not in the repository. `python benchmarks/machines.py FOLDER --write` computes the
rows from them, and draws docs/rigs.svg.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from smc_mujoco.common.errors import find
from smc_mujoco.common.files import read_json
from smc_mujoco.draw import colouring, style
from smc_mujoco.draw import page as pages
from smc_mujoco.identification.published_rig import rig_catalogue

FILE = Path(__file__).with_suffix(".json")
UNFITTED = "unfitted"
FITTED = "fitted on"
HELD_OUT = "held out"
WIDTH = 4.4  # inches of the page of twins, whose letters are read on a phone
LINE, BESIDE, GAP = 11.0, 2.5, 6.0  # points: a line of words; from mark to mark; between machines
LEAST, MOST = 0.25, 4.0  # ends of the axis: a triangle there stands for what is beyond


@dataclasses.dataclass(frozen=True, kw_only=True)
class TwinFigure:
    """A figure of a record of a law on a machine, and the same figure of the machine's twin.

    Attributes:
      rig, record, law: names; the law is "none" where a command was repeated.
      figure, unit: what is compared, such as "theta rms", and its unit.
      machine: the recorded figure; NaN where it is kept aside, and only the order of laws is known
        here.
      twin: the figure by the rig's own quantities, or the median of all runs where there are
        several seeds; inf if the twin falls.
      low, high: the least and the largest over parameter sets; of runs from several seeds their 5 %
        and 95 % quantiles.
      runs: number of these runs.
      fit: of the whole signal, percent, see `Rig.fit`; NaN for a figure that is not of a signal.
      published: the figure by published numbers of the machine; NaN without any, inf if they let it
        fall.
      variant: what of the twin is left out or changed, as "without the commutator"; "" for the
        whole twin.
    """

    rig: str
    record: str
    law: str
    figure: str
    unit: str
    machine: float
    twin: float
    low: float
    high: float
    runs: int
    fit: float = math.nan
    published: float = math.nan
    variant: str = ""

    @property
    def use(self) -> str:
        """What the record was for the twin: "unfitted", "fitted on" or "held out"."""
        sources = rig_catalogue()[self.rig].identified_from
        if self.record in sources:
            return FITTED
        return HELD_OUT if sources else UNFITTED

    @property
    def apart(self) -> float:
        """How far the twin's figure is from the machine's, as a share of this; NaN if it is kept
        aside.
        """
        return abs(self.twin / self.machine - 1.0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Order:
    """In how many of a twin's parameter sets its laws stand in the machine's order.

    `laws`: in that order, the least `figure` first. `tau`: Kendall's, over machine and twin, the
    mean over sets.
    """

    rig: str
    condition: str
    figure: str
    laws: Sequence[str]
    ordered: int
    sets: int
    tau: float
    variant: str = ""


class Summary(NamedTuple):
    """How far a machine's figures of records with one use are from those of its whole twin."""

    rig: str
    use: str
    count: int  # of figures that are known  # pyright: ignore[reportIncompatibleMethodOverride]
    median: float  # of how far the twin is from the machine, a share
    largest: float
    inside: int  # number of the machine's figures within the twin's range
    published: float  # median of how far published numbers are, a share; NaN without any


def known(rows: Sequence[TwinFigure]) -> list[TwinFigure]:
    """Return the figures of whole twins, without those that are kept aside."""
    return [row for row in rows if not row.variant and not math.isnan(row.machine)]


def summaries(rows: Sequence[TwinFigure]) -> list[Summary]:
    """Return the known figures by machine and use."""
    groups: dict[tuple[str, str], list[TwinFigure]] = {}
    for row in known(rows):
        groups.setdefault((row.rig, row.use), []).append(row)
    twin_figures = []
    for (rig, use), group in groups.items():
        apart = [row.apart for row in group]
        published = np.array([abs(row.published / row.machine - 1.0) for row in group])
        published = published[~np.isnan(published)]
        twin_figures.append(
            Summary(
                rig=rig,
                use=use,
                count=len(group),
                median=float(np.median(apart)),
                largest=max(apart),
                inside=sum(row.low <= row.machine <= row.high for row in group),
                published=float(np.median(published)) if len(published) else math.nan,
            )
        )
    return twin_figures


@functools.cache
def _stored() -> tuple[list[TwinFigure], list[Order]]:
    """Return the rows of the file; None stands for NaN, and "falls" for inf."""
    meaning: dict[Any, Any] = {None: math.nan, "falls": math.inf}
    data = read_json(FILE)
    figures = []
    for row in data["figures"]:
        figures.append(TwinFigure(**{name: meaning.get(row[name], row[name]) for name in row}))
    return figures, [Order(**row) for row in data["orders"]]


def rows(rig: str = "") -> list[TwinFigure]:
    """Return the rows of a rig, or of all, in the order of the file.

    Raises:
      ScenarioError: an unknown rig.
    """
    name = rig and find("rig", rig, rig_catalogue()).name
    return [row for row in _stored()[0] if name in ("", row.rig)]


def orders(rig: str = "") -> list[Order]:
    """Return the orders of laws on the machines that ran several, as `rows`."""
    name = rig and find("rig", rig, rig_catalogue()).name
    return [row for row in _stored()[1] if name in ("", row.rig)]


class Row(NamedTuple):
    """The marks of a machine's records of one use, and the words beside them.

    `places`: the height of each figure's mark; `name`, `words`: that of the machine's name, NaN
    below the first row of the machine, and that of the use. All in points from the top.
    """

    figures: Sequence[TwinFigure]
    places: Sequence[float]
    name: float
    words: float
    end: float


def laid_out(rows: Sequence[TwinFigure]) -> list[Row]:
    """Return the rows of the figure: one for each machine and use of its records."""
    groups: dict[tuple[str, str], list[TwinFigure]] = {}
    for row in known(rows):
        groups.setdefault((row.rig, row.use), []).append(row)
    placed_rows: list[Row] = []
    top = 0.0
    for (rig, _), figures in groups.items():
        first = not placed_rows or placed_rows[-1].figures[0].rig != rig
        lines = 2 if first else 1
        if first and placed_rows:
            top += GAP
        marks = BESIDE * (len(figures) + 2)
        deep = max(LINE * lines, marks)
        middle = top + 0.5 * deep
        places = middle + BESIDE * (np.arange(len(figures)) - 0.5 * (len(figures) - 1))
        words = middle + 0.5 * LINE * (lines - 1)
        name = middle - 0.5 * LINE if first else math.nan
        placed_rows.append(Row(figures, places.tolist(), name, words, top + deep))
        top += deep
    return placed_rows


def twins_page(rows: Sequence[TwinFigure]) -> Figure:
    """Return a figure of the twin's figures over the machine's: a row for each machine and use of
    its records, with a mark for each figure of each record.

    A line is a mark's range, a cross is by published numbers. Figures that are kept aside, and
    variants of a twin, are left out.
    """
    placed_rows = laid_out(rows)
    rigs = list(dict.fromkeys(row.figures[0].rig for row in placed_rows))
    colours = dict(zip(rigs, colouring.spread(len(rigs)), strict=True))
    with style.page(WIDTH):
        handles = [
            pages.entry("twin, with its range", style.INK, lw=1.0, marker="o", ms=3.5),
            pages.entry("published numbers", marker="x", ms=3.5, ls=""),
        ]
        height = pages.head_height(WIDTH, handles) + (placed_rows[-1].end + GAP) / 72 + 0.5
        page = pages.blank(WIDTH, height)
        ax = page.subplots()
        for row in placed_rows:
            for place, twin_figure in zip(row.places, row.figures, strict=True):
                _mark(ax, place, twin_figure, colours[twin_figure.rig])
        _name_rows(ax, placed_rows, colours)
        ax.axvline(1.0, color=style.RULE, lw=0.8, zorder=0)
        ax.set(xscale="log", xlim=(LEAST, MOST), ylim=(placed_rows[-1].end + GAP / 2, -GAP / 2))
        ax.set_xlabel("twin over machine")
        ax.set_xticks([0.25, 0.5, 1.0, 2.0, 4.0], ["¼", "½", "1", "2", "4"])
        ax.xaxis.set_minor_locator(NullLocator())
        pages.set_head(page, WIDTH, "What simulation said, and what the machine did", handles)
    assert isinstance(page, Figure)
    return page


def twins_figure(rows: Sequence[TwinFigure], path: str | Path) -> list[Path]:
    """Write `twins_page` to PATH.svg and PATH.png."""
    paths = pages.files(Path(path).with_suffix(""))
    pages.write_page(twins_page(rows), paths)
    return paths


def _name_rows(ax: Axes, rows: Sequence[Row], colours: dict[str, str]) -> None:
    """Write the machines' names beside their rows, and how many figures are of which use; draw a
    rule between machines.
    """
    ticks = []
    labels = []
    looks = []
    for row in rows:
        first_figure = row.figures[0]
        if not math.isnan(row.name):
            ticks.append(row.name)
            labels.append(first_figure.rig)
            looks.append({"color": colours[first_figure.rig], "fontweight": "bold"})
        ticks.append(row.words)
        labels.append(f"{len(row.figures)} figures, {first_figure.use}")
        looks.append({})
    ax.set_yticks(ticks, labels)
    ax.tick_params(axis="y", length=0.0, pad=6.0)
    ax.grid(False, axis="y")
    for label, look in zip(ax.get_yticklabels(), looks, strict=True):
        label.set(**look)
    for row, below in itertools.pairwise(rows):
        if not math.isnan(below.name):
            ax.axhline(row.end + GAP / 2, color=style.GRID, lw=0.8, zorder=0)


def _mark(ax: Axes, place: float, row: TwinFigure, colour: str) -> None:
    """Draw a figure's ratio and its range; a triangle at the end of the axis stands for what of
    them is beyond, and for a twin that falls.
    """
    ends = np.array([row.low / row.machine, row.high / row.machine])
    ax.plot(np.clip(ends, LEAST, MOST), [place, place], color=colour, lw=1.0)
    marks = [(row.published / row.machine, "x", style.MUTED), (row.twin / row.machine, "o", colour)]
    for end in ends[(ends < LEAST) | (ends > MOST)]:
        marks.append((end, "", colour))
    for ratio, shape, ink in marks:
        if math.isnan(ratio):
            continue
        mark = shape
        if ratio > MOST:
            mark = ">"
        elif ratio < LEAST:
            mark = "<"
        drawn_ratio = min(max(ratio, LEAST), MOST)
        ax.plot(drawn_ratio, place, mark, color=ink, ms=3.5, clip_on=False)
