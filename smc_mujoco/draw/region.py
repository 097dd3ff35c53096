"""Maps of regions of attraction: in a law's hue where it brings the plant to rest, darker if sooner; else grey."""

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from smc_mujoco.analysis.region_of_attraction import CONVERGES, DOES_NOT, Basin
from smc_mujoco.control.source import Source
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style

SHADES = ("dark", "middle", "light")  # from early to late
UNDECIDED, LIGHTEST = "#F4F4F4", 82.0  # a colour; lightness of the latest shade in CIELAB
MAP_SIZE = (5.4, 5.3)  # inches, width and height of a map


def draw(region: Basin, path: str | os.PathLike[str] | None = None) -> Figure | SubFigure:
    """Draw a map with its legend; `path` is as in `figure`."""
    after, colours = convergence_times([region]), colours_of(region.law)
    classes, width = colour_indices(region, after), MAP_SIZE[0]
    marks = [
        Patch(facecolor=colours[k], edgecolor=style.RULE, label=f"{words}: {100 * share:.3g} %")
        for k, words in meanings(after, "comes to rest, by {:.3g} s", f"not within {region.duration:g} s").items()
        if (share := (classes == k).mean())
    ]
    with style.page():
        rest = Line2D([], [], color=style.INK, marker="+", ms=style.points(11), lw=0, label="rest")
        page = pages.blank(width, MAP_SIZE[1] + pages.head_height(width, [rest]))
        ax, shades = page.subplots(), ListedColormap(colours)
        ax.pcolormesh(region.x, region.v, classes, cmap=shades, vmin=-0.5, vmax=4.5, rasterized=True)
        for colour, wide in ((style.PAPER, 3.2), (style.INK, 1.4)):
            ax.plot(0.0, 0.0, "+", color=colour, markersize=style.points(11), markeredgewidth=style.points(wide))
        ax.grid(visible=False)
        ax.set_title(style.law_name(region.law), parse_math=False)
        ax.set_xlabel(f"initial position ({region.unit})")
        ax.set_ylabel(f"initial velocity ({region.unit}/s)")
        look = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.16), "fontsize": style.points(9.5)}
        ax.legend(handles=marks, ncols=2, **look)
        _, gains = pages.gain_sources([[Source(kind=region.source)]])
        pages.set_head(page, width, f"Region of attraction: {style.heading([region.plant], short=True)}", [rest], gains)
        pages.write(page, pages.files(path))
    return page


def colours_of(law: str) -> tuple[str, ...]:
    """Return the colours of a law's map: shades of its own from early to late, then of undecided states and of others.

    All differ in lightness, so also with colour blindness and in grey.
    """
    return *reversed(style.ramp(style.law_colour(law), len(SHADES), LIGHTEST)), UNDECIDED, style.FAILED


def convergence_times(maps: Sequence[Basin]) -> list[float]:
    """Return the run lengths, s, after which states were seen to converge, over all maps."""
    return sorted({float(at) for region in maps for at in np.unique(region.decided_at[region.outcome == CONVERGES])})


def colour_indices(region: Basin, after: Sequence[float]) -> np.ndarray:
    """Return the index into `colours_of` for each state, (nv, nx): converging by horizon, then undecided, then not."""
    shade = np.minimum(np.searchsorted(after, region.decided_at), len(SHADES) - 1)
    return np.where(region.outcome == CONVERGES, shade, np.where(region.outcome == DOES_NOT, 4, 3))


def meanings(after: Sequence[float], rests: str, never: str) -> dict[int, str]:
    """Return index into `colours_of` -> what it means; `rests` has a place for the horizon, s."""
    return {min(k, len(SHADES) - 1): rests.format(at) for k, at in enumerate(after)} | {3: "undecided", 4: never}
