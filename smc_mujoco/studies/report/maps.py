"""Maps of the state plane: the states from which runs converge, and where the paper's Lyapunov function rises."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from smc_mujoco.draw import region
from smc_mujoco.mechanisms.plant import catalogue as plants
from smc_mujoco.studies.report import words
from smc_mujoco.studies.report.findings import Field
from smc_mujoco.studies.report.panels import AXIS, Figure, axes, figure, heading, packed, panels, rounded, titles
from smc_mujoco.studies.report.words import style

if TYPE_CHECKING:
    from smc_mujoco.analysis.region_of_attraction import Basin

FALLS, RISES = "#DCEAF4", "#C05A21"  # of V; light and dark apart from hue
COLOURS = (*region.BLUES, region.OPEN, region.NOT)
ZERO = {"coloring": "none", "start": 0, "end": 0, "size": 1, "showlabels": False}  # the contour at 0


def horizons(found: "Sequence[Basin]") -> list[float]:
    """Return the run lengths, s, after which states were found to converge, over all maps."""
    return sorted({float(at) for basin in found for at in np.unique(basin.decided_at[basin.outcome == 1])})


def classed(basin: "Basin", after: Sequence[float]) -> np.ndarray:
    """Return the index into COLOURS for each state, (nv, nx): converging by time, then undecided, then not."""
    shade = np.minimum(np.searchsorted(after, basin.decided_at), len(region.BLUES) - 1)
    return np.where(basin.outcome == 1, shade, np.where(basin.outcome == -1, len(COLOURS) - 1, len(COLOURS) - 2))


def meanings(found: "Sequence[Basin]") -> dict[str, str]:
    """Return colour -> its meaning, for the colours that occur in any of the maps."""
    after, last = horizons(found), len(region.BLUES) - 1
    told = {min(k, last): f"at rest, known after {at:g} s" for k, at in enumerate(after)}
    told |= {last + 1: "undecided", last + 2: "does not come to rest here"}
    there = {int(k) for basin in found for k in np.unique(classed(basin, after))}
    return {COLOURS[k]: text for k, text in told.items() if k in there}


def basins(found: "Sequence[Basin]", after: Sequence[float]) -> Figure:
    """Draw the maps of one plant: a panel per law, x across, x' up; `after` comes from `horizons` of all maps."""
    grid = panels(1, len(found), (0.02, 0))
    unit = found[0].unit
    steps = len(COLOURS)
    colours = [[(k + side) / steps, colour] for k, colour in enumerate(COLOURS) for side in (0, 1)]
    data: list[dict] = []
    layout: dict[str, Any] = {"annotations": []}
    for panel, basin in zip(grid, found, strict=True):
        first = panel[0] == ""
        data.append(
            {
                "type": "heatmap",
                "x": rounded(basin.x),
                "y": rounded(basin.v),
                "z": packed(classed(basin, after)),
                "zmin": -0.5,
                "zmax": steps - 0.5,
                "colorscale": colours,
                "showscale": False,
                "xaxis": f"x{panel[0]}",
                "yaxis": f"y{panel[0]}",
                "hovertemplate": "x %{x:.3g}, x′ %{y:.3g}<extra></extra>",
            }
        )
        share = 100 * basin.share
        told = heading(panel, words.law(basin.law)) | {"font": {"size": 12, "color": words.colour(basin.law)}}
        layout["annotations"] += [told, heading(panel, "") | _right(panel, f"{share:.0f} %")]
        x = {"title": AXIS["title"] | {"text": f"x, {unit}"}, "showgrid": False, "nticks": 5}
        y = {"showgrid": False, "showticklabels": first, "nticks": 6, "matches": None if first else "y"}
        y |= {"title": AXIS["title"] | {"text": f"x′, {unit}/s"}} if first else {}
        layout |= axes(panel, x, y)
    return figure(data, layout | {"margin": {"l": 54, "r": 8, "t": 24, "b": 44}}, 232)


def _right(panel: tuple[str, list[float], list[float]], text: str) -> dict[str, Any]:
    return {"text": text, "x": panel[1][1], "xanchor": "right", "font": {"size": 11, "color": style.MUTED}}


def fields(found: Sequence[Field]) -> Figure:
    """Draw where V rises, dark, and the line s = 0: a panel per plant, x across, x' up."""
    grid = panels(1, len(found), (0.045, 0))
    colours = [[0, FALLS], [0.5, FALLS], [0.5, RISES], [1, RISES]]
    data: list[dict] = []
    names = [words.plant(field.plant) for field in found]
    layout: dict[str, Any] = {"annotations": titles(grid, names)}
    for field, title in zip(found, layout["annotations"], strict=True):
        title["text"] += f", {100 * field.share:.0f} %"
    for panel, field in zip(grid, found, strict=True):
        at = {"xaxis": f"x{panel[0]}", "yaxis": f"y{panel[0]}", "showscale": False}
        plane = {"x": rounded(field.x), "y": rounded(field.v), "z": packed(field.rises), "zmin": 0, "zmax": 1}
        told = {"hovertemplate": "x %{x:.3g}, x′ %{y:.3g}<extra></extra>"}
        data.append({"type": "heatmap", "colorscale": colours} | plane | at | told)
        few = {"x": rounded(field.x[::4]), "y": rounded(field.v[::4]), "z": [rounded(r, 3) for r in field.s[::4, ::4]]}
        ink = {"colorscale": [[0, style.INK], [1, style.INK]], "line": {"width": 1.5, "color": style.INK}}
        data.append({"type": "contour", "contours": ZERO, "hoverinfo": "skip"} | few | at | ink)
        unit = plants()[field.plant].unit if field.plant in plants() else ""
        x = {"title": AXIS["title"] | {"text": f"x, {unit}"}, "showgrid": False, "nticks": 4}
        y = {"showgrid": False, "nticks": 5}
        y |= {"title": AXIS["title"] | {"text": "x′, rad/s or m/s"}} if panel[0] == "" else {}
        layout |= axes(panel, x, y)
    return figure(data, layout | {"margin": {"l": 48, "r": 8, "t": 38, "b": 44}}, 246)
