"""Maps of regions of attraction: in a law's hue where it brings the plant to rest, darker if
sooner; else grey.
"""

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from smc_mujoco.analysis.region_of_attraction import CONVERGES, DOES_NOT, Basin
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.source import restore
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.draw.page import Size

SHADES = ("dark", "middle", "light")  # from early to late
UNDECIDED, LIGHTEST = "#F4F4F4", 82.0  # a colour; lightness of the latest shade in CIELAB
MAP_SIZE = (5.4, 5.3)  # inches on a full page, width and height of a map


def draw(
    maps: Sequence[Basin],
    path: str | os.PathLike[str] | None = None,
    size: Size = None,
    fig: Figure | SubFigure | None = None,
) -> Figure | SubFigure:
    """Draw maps side by side; `path`, `size` and `fig` are as in `figure`."""
    paths = pages.files(path)
    if not maps:
        raise ScenarioError("no map to draw: give at least one")
    if size is None and fig is None:
        width = MAP_SIZE[0] * len(maps)
        height = None
    else:
        width, height = pages.measure(size, fig)
    with style.page(style.FULL_WIDTH if size is None and fig is None else width):
        rest = Line2D([], [], color=style.INK, marker="+", ms=style.points(11), lw=0, label="rest")
        if size is not None:
            across = max(1, min(len(maps), int(width / style.points(3.2))))
        else:
            across = len(maps)
        down = -(-len(maps) // across)
        space = pages.head_height(width, [rest])
        if size is None:
            tall = MAP_SIZE[1]
        else:
            tall = down * width / across * 1.08
        page = pages.blank(width, height or tall + space, fig)
        axes = page.subplots(down, across, squeeze=False).ravel()
        after = convergence_times(maps)
        plants = dict.fromkeys(region.plant for region in maps)
        words, gains = pages.gain_sources(
            [[restore({"kind": region.source, "search": None})] for region in maps]
        )
        for ax, region, source in zip(axes, maps, words, strict=False):
            plant = f", {style.plant_name(region.plant, short=True)}" * (len(plants) > 1)
            draw_map(
                ax, region, after, style.law_name(region.law) + plant + source.replace(", ", "\n")
            )
        for ax in axes[len(maps) :]:
            ax.remove()
        pages.set_head(
            page,
            width,
            f"Region of attraction: {style.heading([*plants], short=True)}",
            [rest],
            gains,
        )
        pages.write(page, paths)
    return page


def draw_map(ax: Axes, region: Basin, after: Sequence[float], title: str) -> None:
    """Fill a matplotlib axes with a map and its legend; `after` is from `convergence_times` of all
    maps.
    """
    classes = colour_indices(region, after)
    colours = colours_of(region.law)
    ax.pcolormesh(
        region.x,
        region.v,
        classes,
        cmap=ListedColormap(colours),
        vmin=-0.5,
        vmax=4.5,
        rasterized=True,
    )
    for colour, wide in ((style.PAPER, 3.2), (style.INK, 1.4)):
        ax.plot(
            0.0,
            0.0,
            "+",
            color=colour,
            markersize=style.points(11),
            markeredgewidth=style.points(wide),
        )
    ax.grid(visible=False)
    ax.set_title(title, parse_math=False)
    ax.set_xlabel(f"initial position ({region.unit})")
    ax.set_ylabel(f"initial velocity ({region.unit}/s)")
    marks = [
        Patch(facecolor=colours[k], edgecolor=style.RULE, label=f"{words}: {100 * share:.3g} %")
        for k, words in meanings(
            after, "comes to rest, by {:.3g} s", f"not within {region.duration:g} s"
        ).items()
        if (share := (classes == k).mean())
    ]
    ax.legend(
        handles=marks,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.16),
        ncols=2,
        fontsize=style.points(9.5),
    )


def colours_of(law: str) -> tuple[str, ...]:
    """Return the colours of a law's map: shades of its own from early to late, then of undecided
    states and of others.

    All differ in lightness, so also with colour blindness and in grey.
    """
    return (
        *reversed(style.ramp(style.law_colour(law), len(SHADES), LIGHTEST)),
        UNDECIDED,
        style.FAILED,
    )


def convergence_times(maps: Sequence[Basin]) -> list[float]:
    """Return the run lengths, s, after which states were seen to converge, over all maps."""
    return sorted(
        {
            float(at)
            for region in maps
            for at in np.unique(region.decided_at[region.outcome == CONVERGES])
        }
    )


def colour_indices(region: Basin, after: Sequence[float]) -> np.ndarray:
    """Return the index into `colours_of` for each state, (nv, nx): converging by horizon, then
    undecided, then not.
    """
    shade = np.minimum(np.searchsorted(after, region.decided_at), len(SHADES) - 1)
    return np.where(region.outcome == CONVERGES, shade, np.where(region.outcome == DOES_NOT, 4, 3))


def meanings(after: Sequence[float], rests: str, never: str) -> dict[int, str]:
    """Return index into `colours_of` -> what it means; `rests` has a place for the horizon, s."""
    return {min(k, len(SHADES) - 1): rests.format(at) for k, at in enumerate(after)} | {
        3: "undecided",
        4: never,
    }
