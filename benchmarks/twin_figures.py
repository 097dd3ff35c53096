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
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from smc_mujoco.common.errors import find
from smc_mujoco.common.files import read_json
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.identification.rig import catalogue

FILE = Path(__file__).with_suffix(".json")
UNFITTED = "unfitted"
FITTED = "fitted on"
HELD_OUT = "held out"
MARKS = {UNFITTED: "D", HELD_OUT: "o", FITTED: "o"}  # filled, but for records that were fitted on
PHONE_WIDTH = 4.0  # inches of the page of twins, whose letters are read on a phone
ROW, BESIDE = 0.2, 0.35  # inches a row; rows from one record of a figure to the next
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
        sources = catalogue()[self.rig].identified_from
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
    found = []
    for (rig, use), group in groups.items():
        apart = [row.apart for row in group]
        published = np.array([abs(row.published / row.machine - 1.0) for row in group])
        published = published[~np.isnan(published)]
        found.append(
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
    return found


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
    name = rig and find("rig", rig, catalogue()).name
    return [row for row in _stored()[0] if name in ("", row.rig)]


def orders(rig: str = "") -> list[Order]:
    """Return the orders of laws on the machines that ran several, as `rows`."""
    name = rig and find("rig", rig, catalogue()).name
    return [row for row in _stored()[1] if name in ("", row.rig)]


def twins_figure(rows: Sequence[TwinFigure], path: str | Path) -> list[Path]:
    """Draw the twin's figures over the machine's, a row for each with a mark for each record.

    Write PATH.svg, PATH.png.

    A line is a mark's range, a cross is by published numbers. Figures that are kept aside, and
    variants of a twin, are left out.
    """
    paths = pages.files(Path(path).with_suffix(""))
    rigs: dict[str, dict[tuple[str, str], list[TwinFigure]]] = {}
    for row in known(rows):
        rigs.setdefault(row.rig, {}).setdefault((row.use, row.figure), []).append(row)
    colours = dict(zip(rigs, style.spread(len(rigs)), strict=True))
    place = 0.0
    ticks = []
    places = []
    names = []
    for rig, figures in rigs.items():
        names.append((place + 0.6, rig))
        place += 1.2
        for (_, figure), group in figures.items():
            for k, row in enumerate(group):
                places.append((place + 0.5 + BESIDE * k, row))
            deep = 1.0 + BESIDE * (len(group) - 1)
            count = f", {len(group)} records" if len(group) > 1 else ""
            ticks.append((place + 0.5 * deep, f"{figure}{count}"))
            place += deep
    with style.page(PHONE_WIDTH):
        handles = []
        for use in dict.fromkeys(row.use for _, row in places):
            filling = style.PAPER if use == FITTED else style.INK
            mark: Any = {"color": style.INK, "marker": MARKS[use], "mfc": filling, "ls": ""}
            handles.append(Line2D([], [], label=use, **mark))
        cross = Line2D([], [], color=style.MUTED, marker="x", ls="", label="published numbers")
        handles.append(cross)
        handles.append(Line2D([], [], color=style.INK, lw=1.0, label="the twin's range"))
        height = pages.head_height(PHONE_WIDTH, handles) + ROW * place + 0.6
        page = pages.blank(PHONE_WIDTH, height)
        ax = page.subplots()
        for at, rig in names:
            ax.text(LEAST * 1.05, at, rig, color=colours[rig], fontweight="bold", va="center")
        for at, row in places:
            _row(ax, at, row, colours[row.rig])
        ax.axvline(1.0, color=style.RULE, lw=0.8, zorder=0)
        ax.set(
            xscale="log", xlim=(LEAST, MOST), ylim=(place + 0.2, 0.0), xlabel="twin over machine"
        )
        ax.set_yticks([at for at, _ in ticks], [words for _, words in ticks])
        ax.set_xticks([0.25, 0.5, 1.0, 2.0, 4.0], ["¼", "½", "1", "2", "4"])
        ax.xaxis.set_minor_locator(NullLocator())
        pages.set_head(page, PHONE_WIDTH, "What simulation said, and what the machine did", handles)
        pages.write(page, paths)
    return paths


def _row(ax: Axes, place: float, row: TwinFigure, colour: str) -> None:
    """Draw a figure's ratio and its range; beyond the axis, or for a twin that falls, a triangle at
    its end.
    """
    ends = np.clip([row.low / row.machine, row.high / row.machine], LEAST, MOST)
    ax.plot(ends, [place, place], color=colour, lw=1.0)
    marks = ((row.published, "x", style.MUTED), (row.twin, MARKS[row.use], colour))
    for value, shape, ink in marks:
        ratio = value / row.machine
        if ratio > MOST:
            mark = ">"
        elif ratio < LEAST:
            mark = "<"
        else:
            mark = shape
        filling = ink
        if row.use == FITTED and mark == shape:
            filling = style.PAPER
        if not math.isnan(ratio):
            at = min(max(ratio, LEAST), MOST)
            ax.plot(at, place, mark, color=ink, mfc=filling, ms=3.5, clip_on=False)
