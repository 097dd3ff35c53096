"""Maps of regions of attraction: in a law's hue where it brings the plant to rest, darker if
sooner; else grey.
"""

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.source import restored_source
from smc_mujoco.draw import colouring, dark, style, wording
from smc_mujoco.draw import page as pages
from smc_mujoco.robustness.region_of_attraction import CONVERGES, DOES_NOT, Basin

SHADES = 3  # from early to late
UNDECIDED = "#F4F4F4"
LIGHTEST = 82.0  # lightness of the latest shade in CIELAB
MAP_SIZE = (4.4, 5.0)  # inches on a full page, width and height of a map


def draw_regions(maps: Sequence[Basin], path: str | os.PathLike[str] | None = None) -> Figure:
    """Draw maps side by side; `path` is as in `figure`."""
    paths = pages.files(path)
    if not maps:
        raise ScenarioError("no map to draw: give at least one")
    width = MAP_SIZE[0] * len(maps)
    with style.page():
        cross = {"marker": "+", "ms": style.points(11), "lw": 0}
        rest = pages.entry("rest, and its region of attraction", style.INK, **cross)
        page = pages.blank(width, MAP_SIZE[1] + pages.head_height(width, [rest]))
        axes = page.subplots(1, len(maps), squeeze=False)[0]
        after = convergence_times(maps)
        plants = list(dict.fromkeys(region.plant for region in maps))
        sources = []
        for region in maps:
            sources.append([restored_source({"kind": region.source, "search": None})])
        words, gains = pages.gain_sources(sources)
        for ax, region, source in zip(axes, maps, words, strict=True):
            name = wording.law_name(region.law)
            if len(plants) > 1:
                name += f", {wording.plant_name(region.plant, short=True)}"
            draw_map(ax, region, after, name + source.replace(", ", "\n"))
        pages.set_head(page, width, wording.heading(plants, short=len(plants) > 1), [rest], gains)
        return pages.write_page(page, paths)


def draw_map(ax: Axes, region: Basin, after: Sequence[float], title: str) -> None:
    """Fill a matplotlib axes with a map and its legend; `after` is from `convergence_times` of all
    maps.
    """
    classes = colour_indices(region, after)
    neutral = style.neutral_on_dark()
    colours = colours_of(region.law)
    if neutral:  # those that the key has on a dark page
        colours = [dark.on_dark(colour.upper(), neutral) for colour in colours]
    shades = {"cmap": ListedColormap(colours), "vmin": -0.5, "vmax": 4.5}
    ax.pcolormesh(region.x, region.v, classes, rasterized=True, **shades)
    for colour, wide in ((style.PAPER, 3.2), (style.INK, 1.4)):
        ax.plot(0.0, 0.0, "+", color=colour, ms=style.points(11), mew=style.points(wide))
    ax.grid(visible=False)
    ax.set_title(title, parse_math=False)
    ax.set_xlabel(f"initial position ({region.unit})")
    ax.set_ylabel(f"initial velocity ({region.unit}/s)")
    meanings = {3: "undecided", 4: f"not within {region.duration:g} s"}
    for k, time in enumerate(after):
        meanings[min(k, SHADES - 1)] = f"comes to rest, by {time:.3g} s"
    marks = []
    for k in sorted(meanings):
        if share := (classes == k).mean():
            label = f"{meanings[k]}: {100 * share:.3g} %"
            marks.append(Patch(facecolor=colours[k], edgecolor=style.RULE, label=label))
    place = {"loc": "upper left", "bbox_to_anchor": (0.0, -0.16)}
    ax.legend(handles=marks, fontsize=style.points(9.5), **place)


def colours_of(law: str) -> list[str]:
    """Return the colours of a law's map: shades of its own from early to late, then of undecided
    states and of others.

    All differ in lightness, so also with colour blindness and in grey.
    """
    shades = colouring.ramp(colouring.law_colour(law), SHADES, LIGHTEST)
    return [*reversed(shades), UNDECIDED, style.FAILED]


def convergence_times(maps: Sequence[Basin]) -> list[float]:
    """Return the run lengths, s, after which states were seen to converge, over all maps."""
    times = []
    for region in maps:
        times.append(region.decided_at[region.outcome == CONVERGES])
    return np.unique(np.concatenate(times)).tolist()


def colour_indices(region: Basin, after: Sequence[float]) -> np.ndarray:
    """Return the index into `colours_of` for each state, (nv, nx): converging by horizon, then
    undecided, then not.
    """
    shade = np.minimum(np.searchsorted(after, region.decided_at), SHADES - 1)
    undecided_or_not = np.where(region.outcome == DOES_NOT, 4, 3)
    return np.where(region.outcome == CONVERGES, shade, undecided_or_not)
