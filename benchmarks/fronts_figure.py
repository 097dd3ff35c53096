"""The figure of docs/where_sliding_mode_loses.md: the least error of each law over J.

The page asks whether sliding mode leads. So the sliding laws have colours, the least error of all
rivals has a strong black line, and each rival a thin grey one.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from benchmarks.fronts_sentences import FLOOR, RIVALS, ROWS, is_settled, of_figure, value
from smc_mujoco.draw import page, style

TICKS = (1.25, 2, 5)
DECADES = (1e-4, 1e-3, 1e-2)
WIDTH, ROW = 5.0, 0.95  # inches: letters are read on a phone
LEAST, MOST = 4e-5, 0.05  # ends of the axis; what is below it is marked at its lower edge
MARKS = {"*": 7.0} | dict.fromkeys("sD^vPXo", 4.0)  # mark -> points; none like another in grey
BEST = "Best rival at each J"
J_IN_WORDS = "J: error and variation of u"

Front = dict[float, float]  # level of J -> least error, of the start


class Panel(NamedTuple):
    """A plant, a control period, s, and a condition."""

    plant: str
    period: float
    condition: str


def fronts(points: Sequence[dict], panel: Panel, laws: Sequence[str]) -> dict[str, Front]:
    """Return the settled errors of each law, the smaller one of both searches."""
    found: dict[str, Front] = {law: {} for law in laws}
    about = panel._asdict()
    for one in points:
        if one["law"] in found and about.items() <= one.items() and is_settled(value(one)):
            front, level, error = found[one["law"]], one["level"], value(one)[0]
            front[level] = min(error, front.get(level, error))
    return found


def best_rivals(found: Mapping[str, Front]) -> dict[float, str]:
    """Return level of J -> the rival with the least error there."""
    best: dict[float, str] = {}
    for law in RIVALS:
        for level, error in found.get(law, {}).items():
            if level not in best or error < found[best[level]][level]:
                best[level] = law
    return dict(sorted(best.items()))


def looks(laws: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the look of each law's line."""
    found: dict[str, dict[str, Any]] = {}
    dashes = iter(style.DASHES)
    grey = style.mixed(style.MUTED, style.PAPER, 0.35)
    for law, colour, mark in zip(laws, style.law_colours(laws), MARKS, strict=False):
        if law in RIVALS:
            found[law] = {"color": grey, "lw": 0.7}
        else:
            found[law] = {"color": colour, "lw": 1.2, "ls": next(dashes)}
            found[law]["zorder"] = 3.0 - 0.1 * len(found)
        found[law] |= {"marker": mark, "ms": MARKS[mark], "mew": 0.0}
    return found


def of_panel(ax: Axes, found: Mapping[str, Front], looks: Mapping[str, dict[str, Any]]) -> None:
    """Draw the fronts of all laws, rivals below, and the least error of all rivals."""
    for law in sorted(filter(found.get, found), key=lambda law: law not in RIVALS):
        front = dict(sorted(found[law].items()))
        errors = [max(error, LEAST) for error in front.values()]
        ax.plot(list(front), errors, clip_on=False, **looks[law])
    best = best_rivals(found)
    errors = [max(found[law][level], LEAST) for level, law in best.items()]
    ax.plot(list(best), errors, color=style.INK, lw=2.2, zorder=2.4)
    for (level, law), error in zip(best.items(), errors, strict=True):
        look = looks[law] | {"color": style.INK, "ms": 6.0, "zorder": 2.5}
        ax.plot(level, error, clip_on=False, **look)
    ax.axhspan(LEAST, FLOOR, color=style.BAND, lw=0, zorder=0)


def drawn(points: Sequence[dict], laws: Sequence[str]) -> Figure:
    """Return the fronts of error over J: a row a plant, a column a period and condition."""
    points = [one for one in points if of_figure(one) and one["model"] == "none"]
    plants = list(dict.fromkeys(point["plant"] for point in points))
    with style.page(WIDTH):
        look = looks(laws)
        key = [Line2D([], [], label=style.law_name(law), **look[law]) for law in laws]
        key.insert(len(laws) - len(RIVALS), page.entry(BEST, style.INK, lw=2.2))
        height = page.head_height(WIDTH, key) + ROW * len(plants) + 0.65
        figure = page.blank(WIDTH, height, None)
        panels = figure.subplots(len(plants), len(ROWS), squeeze=False, sharey=True, sharex=True)
        for row, plant in zip(panels, plants, strict=True):
            for ax, (period, condition) in zip(row, ROWS, strict=True):
                of_panel(ax, fronts(points, Panel(plant, period, condition), laws), look)
                ax.set(xscale="log", yscale="log", ylim=(LEAST, MOST))
                ax.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
                ax.set_yticks(DECADES)
                ax.minorticks_off()
            words = {"color": style.MUTED, "fontsize": "small", "ha": "right", "va": "center"}
            row[-1].text(TICKS[-1], (LEAST * FLOOR) ** 0.5, "not ranked", **words)
            row[0].set_ylabel("\n".join(style.plant_name(plant, short=True).rsplit(" ", 1)))
        for ax, (period, condition) in zip(panels[0], ROWS, strict=True):
            noise = "noise" if "noise" in condition else "no noise"
            ax.set_title(f"{1e3 * period:g} ms\n{noise}")
        letters = rcParams["axes.labelsize"]
        figure.supxlabel("J over the least J of all laws", fontsize=letters)
        figure.supylabel("rms error over the start", y=0.37, fontsize=letters)
        page.set_head(figure, WIDTH, "The price of rejecting a load", key, J_IN_WORDS)
    assert isinstance(figure, Figure)
    return figure


def draw(points: Sequence[dict], path: Path, laws: Sequence[str]) -> None:
    """Write the figure to a file."""
    page.write(drawn(points, laws), page.files(path))
