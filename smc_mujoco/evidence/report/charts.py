"""Charts of a report:

SVG files, drawn as all figures of the suite, put into the page with its colours.
"""

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter

from smc_mujoco.draw import page as pages
from smc_mujoco.draw import region
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.films import WIDTH, picture
from smc_mujoco.evidence.report.words import style
from smc_mujoco.evidence.rigs.figure import residual_figure, twins_figure
from smc_mujoco.evidence.rigs.twin_figures import rows as of_machines
from smc_mujoco.mechanisms.plant import catalogue as known_plants

if TYPE_CHECKING:
    from smc_mujoco.analysis.margins import Margin
    from smc_mujoco.analysis.region_of_attraction import Basin
    from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable
    from smc_mujoco.evidence.report.rigs import Repeated
    from smc_mujoco.evidence.report.stages import Field, Front

FADED = 0.8  # share of paper in the law's colour where V falls; grey, where it rises, is darker
# Colours of the suite's style -> those of the page, which differ by day and by night. All others
# become lighter there.
OF_PAGE = {
    style.INK: "ink",
    style.MUTED: "muted",
    style.GRID: "line",
    style.RULE: "edge",
    style.PAPER: "page",
}
OF_PAGE |= {
    style.RC["axes.edgecolor"]: "edge",
    style.DISTURBANCE: "soft",
    style.BAND: "rule",
    "#000000": "ink",
}


def embedded(svg: bytes, name: str, maps: bool = False) -> str:
    """Return an SVG file as a part of a page, whose width and colours it has; `name` tells its ids
    from others'.

    By night the colours of laws become lighter, those of maps stay.
    """
    text = svg.decode()
    text = re.sub(
        r"<metadata>.*?</metadata>|<style .*?</style>", "", text[text.index("<svg") :], flags=re.S
    )
    text = re.sub(
        r'(<svg[^>]*?) width="[\w.]*" height="[\w.]*"', r"\1", re.sub(r' id="\w+_\d+"', "", text)
    )
    text = re.sub(r'( id="|url\(#|xlink:href="#)', rf"\1{name}-", text)
    own = {known.lower(): f"var(--{css})" for known, css in OF_PAGE.items()}
    if maps:
        other = "{}"
    else:
        other = "color-mix(in srgb, white var(--lift), {})"
    return re.sub(r"#[0-9a-f]{6}(?=[;\"])", lambda m: own.get(m[0], other.format(m[0])), text)


def panels(
    titles: Sequence[str], height: float, share_y: bool = False
) -> tuple[Figure | SubFigure, list[Axes]]:
    """Return a page with panels in a row; the height is in inches."""
    page = pages.blank(WIDTH, height)
    axes = page.subplots(1, len(titles), squeeze=False, sharey=share_y)[0].tolist()
    for ax, title in zip(axes, titles, strict=True):
        ax.set_title(title, parse_math=False)
        ax.tick_params(which="both", length=0)
    return page, axes


def _plants(plants: Sequence[str]) -> list[str]:
    """Return titles of panels, on two lines where there are several."""
    names = list(map(words.plant, plants))
    if len(names) > 2:
        return [name.replace(" network", "\nnetwork") for name in names]
    return names


def fronts(drawn: "Sequence[Front]") -> bytes:
    """Draw tracking against variation: a panel per plant, a staircase per law; a large dot at the
    study's gains.
    """
    plants = list(dict.fromkeys(front.plant for front in drawn))
    laws = list(dict.fromkeys(front.law for front in drawn))
    with style.page(WIDTH):
        keys = [Line2D([], [], color=words.colour(law), lw=3, label=words.law(law)) for law in laws]
        page, axes = panels(_plants(plants), 3.6 + pages.head_height(WIDTH, keys))
        for ax, plant in zip(axes, plants, strict=True):
            on_plant = [front for front in drawn if front.plant == plant]
            for front in on_plant:
                _front(ax, front)
            ax.set(xscale="log", yscale="log", xlabel="variation (1/s)")
            ax.yaxis.set_minor_formatter(NullFormatter())
            ax.set_xlim(
                _span([v for front in on_plant for v in (*front.variation, front.chosen[1])], 1e-3)
            )
            ax.set_ylim(
                _span([v for front in on_plant for v in (*front.tracking, front.chosen[0])], None)
            )
        axes[0].set_ylabel("tracking (s²)")
        pages.set_head(page, WIDTH, "Tracking against variation", keys)
        return picture(lambda path: pages.write(page, [path]))


def _front(ax: Axes, front: "Front") -> None:
    """Draw a law's staircase, and its chosen gains."""
    colour, (tracking, variation) = words.colour(front.law), front.chosen
    across, up = zip(
        *sorted(zip(front.variation, front.tracking, strict=True)), strict=True
    )  # steps to the right
    ax.step(
        across,
        up,
        where="post",
        color=colour,
        marker="o",
        ms=3,
        mec="none",
        gid=pages.hint(words.law(front.law)),
    )
    said = f"{words.law(front.law)}: variation {variation:.3g} 1/s, tracking {tracking:.3g} s²"
    ax.plot(
        variation,
        tracking,
        "o",
        ms=9,
        color=colour,
        mec=style.PAPER,
        mew=1.5,
        zorder=3,
        gid=pages.hint(said),
    )


def _span(values: Sequence[float], floor: float | None) -> tuple[float, float]:
    """Return the ends of a logarithmic axis.

    It shows all values down to `floor` of the largest, or up to 1000 times the smallest where that
    is None.
    """
    above = [v for v in values if v > 0] or [1.0]
    if floor is None:
        low = min(above)
        high = min(max(above), 1e3 * min(above))
    else:
        low = 0.0
        high = max(above)
    return max(low, min(above), (floor or 0.0) * high) / 1.4, high * 1.4


def margins(drawn: "Sequence[Margin]", kind: str) -> bytes:
    """Draw the largest level of one kind that each law tolerates: a panel per plant; a bar marks
    linear theory.

    A triangle means that the search ended there without a failure, a cross that even the level 0 is
    not tolerated.
    """
    plants = list(dict.fromkeys(margin.plant for margin in drawn))
    laws = list(dict.fromkeys(margin.law for margin in drawn))
    with style.page(WIDTH):
        page, axes = panels(_plants(plants), 0.9 + 0.2 * len(laws), share_y=True)
        for ax, plant in zip(axes, plants, strict=True):
            its = [margin for margin in drawn if (margin.plant, margin.kind) == (plant, kind)]
            sizes = [
                v
                for margin in its
                for v in (margin.value, margin.theory or 0.0)
                if math.isfinite(v)
            ]
            end = 1.15 * (max(sizes, default=0.0) or 1.0)
            for margin in its:
                _margin(ax, margin, laws.index(margin.law), end)
            ax.set_xlim(-0.03 * end, end)
            ax.grid(visible=False, axis="y")
        axes[0].set_ylim(len(laws) - 0.4, -0.6)  # the first at the top
        axes[0].set_yticks(range(len(laws)), list(map(words.law, laws)))
        return picture(lambda path: pages.write(page, [path]))


def _margin(ax: Axes, margin: "Margin", line: int, end: float) -> None:
    """Draw a law's margin on its line of a panel that ends at `end`."""
    none = math.isnan(margin.value)
    more = margin.value >= margin.searched
    at = 0.0 if none else min(margin.value, end)
    colour = words.colour(margin.law)
    if none:
        value = "none"
    else:
        value = f"{'at least ' * more}{margin.value:.3g} {words.typeset(margin.unit)}"
    said = pages.hint(f"{words.law(margin.law)}: {value}")
    ax.hlines(line, 0.0, at, color=style.RULE, lw=2.0)
    ax.plot(
        at, line, "x" if none else ">" if more else "o", ms=7, color=colour, clip_on=False, gid=said
    )
    if margin.theory is not None and math.isfinite(margin.theory):
        said = pages.hint(f"linear theory: {margin.theory:.3g} {words.typeset(margin.unit)}")
        ax.plot(margin.theory, line, "|", ms=12, mew=2, color=style.INK, gid=said)


def basins(drawn: "Sequence[Basin]", after: Sequence[float]) -> bytes:
    """Draw the maps of one plant: a panel a law, x across, x' up; `after` is from
    `convergence_times` of all maps.
    """
    unit = drawn[0].unit
    with style.page(WIDTH):
        meanings = region.meanings(
            after, "at rest, known after {:g} s", "does not come to rest here"
        )
        shades = dict(enumerate(region.SHADES))  # of each law's colour
        keys = [
            Patch(
                facecolor=colour,
                edgecolor=style.RULE,
                label=f"{shades[k]}: {text}" if k in shades else text,
            )
            for k, colour in enumerate(region.colours_of(drawn[0].law))
            if (text := meanings.get(k))
        ]
        titles = [f"{words.law(basin.law)}, {100 * basin.share:.0f} %" for basin in drawn]
        page, axes = panels(titles, 2.7 + pages.head_height(WIDTH, keys), share_y=True)
        for ax, basin in zip(axes, drawn, strict=True):
            _plane(
                ax,
                basin.x,
                basin.v,
                region.colour_indices(basin, after),
                region.colours_of(basin.law),
                unit,
            )
        axes[0].set_ylabel(f"x′ ({unit}/s)")
        pages.set_head(page, WIDTH, words.plant(drawn[0].plant), keys)
        return picture(lambda path: pages.write(page, [path]))


def _plane(
    ax: Axes, x: np.ndarray, v: np.ndarray, classes: np.ndarray, colours: Sequence[str], unit: str
) -> None:
    """Draw a map of classes (nv, nx), 0, 1, ..., each in its colour."""
    look = {
        "cmap": ListedColormap(colours),
        "vmin": -0.5,
        "vmax": len(colours) - 0.5,
        "rasterized": True,
    }
    ax.pcolormesh(x, v, classes.astype(np.int8), **look)
    ax.grid(visible=False)
    ax.set_xlabel(f"x ({unit})")


def fields(drawn: "Sequence[Field]") -> bytes:
    """Draw where V rises, grey, and the line s = 0: a panel per plant, x across, x' up."""
    colours = style.mixed(words.colour(words.PAPER_LAW), style.PAPER, FADED), style.FAILED
    titles = _plants([field.plant for field in drawn])
    with style.page(WIDTH):
        page, axes = panels(
            [f"{t}, {100 * f.share:.0f} %" for t, f in zip(titles, drawn, strict=True)], 2.8
        )
        for ax, field in zip(axes, drawn, strict=True):
            if field.plant in known_plants():
                unit = known_plants()[field.plant].unit
            else:
                unit = ""
            _plane(ax, field.x, field.v, field.rises, colours, unit)
            ax.contour(field.x, field.v, field.s, levels=[0.0], colors=[style.INK], linewidths=1.5)
        axes[0].set_ylabel("x′ (rad/s or m/s)")
        return picture(lambda path: pages.write(page, [path]))


def orders(table: "AccuracyTable") -> bytes:
    """Draw the largest errors over the control period, with theory's slopes."""
    return picture(lambda path: table.plot(path, size=(WIDTH, 7.5), format="svg"))


def record(shown: "Repeated") -> bytes:
    """Draw the columns of a record, measured and as its twin repeats them, and the residuals."""
    fits = {"twin": shown.fits["the twin’s"]}
    title = f"{shown.rig.name}: {shown.name}"
    units = shown.rig.units
    twin = {"twin": shown.twin}
    return picture(
        lambda path: residual_figure(title, shown.t, shown.measured, twin, fits, units, path)
    )


def twins() -> bytes:
    """Draw what twins said of public records over what the machines did."""
    return picture(lambda path: twins_figure(of_machines(), path))
