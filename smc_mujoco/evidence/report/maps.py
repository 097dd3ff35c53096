"""Maps of the state plane: the states from which runs converge, and where the paper's Lyapunov function rises."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from smc_mujoco.draw import region
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.panels import Figure, Panel, figure, packed, panels, plant_titles, rounded
from smc_mujoco.evidence.report.words import style
from smc_mujoco.mechanisms.plant import catalogue as plants

if TYPE_CHECKING:
    from smc_mujoco.analysis.region_of_attraction import Basin
    from smc_mujoco.evidence.report.stages import Field

FALLS, RISES = "#DCEAF4", "#C05A21"  # of V; light and dark apart from hue


def meanings(drawn: "Sequence[Basin]") -> dict[str, str]:
    """Return colour -> its meaning, for the colours that occur in any of the maps."""
    after = region.convergence_times(drawn)
    there = {int(k) for basin in drawn for k in np.unique(region.colour_indices(basin, after))}
    texts = region.meanings(after, "at rest, known after {:g} s", "does not come to rest here")
    return {region.COLOURS[k]: text for k, text in texts.items() if k in there}


def basins(drawn: "Sequence[Basin]", after: Sequence[float]) -> Figure:
    """Draw the maps of one plant: a panel a law, x across, x' up; `after` is from `convergence_times` of all maps."""
    grid, unit = panels(1, len(drawn), (0.02, 0)), drawn[0].unit
    data: list[dict] = []
    layout: dict[str, Any] = {"annotations": []}
    for panel, basin in zip(grid, drawn, strict=True):
        data.append(_plane(panel, basin.x, basin.v, region.colour_indices(basin, after), region.COLOURS))
        law = panel.title(words.law(basin.law), font={"color": words.colour(basin.law)})
        share = {"x": panel.x[1], "xanchor": "right", "font": {"size": 11, "color": style.MUTED}}
        layout["annotations"] += [law, panel.heading(f"{100 * basin.share:.0f} %", **share)]
        x = {"title": {"text": f"x, {unit}"}, "showgrid": False, "nticks": 5}
        y = {"showgrid": False, "nticks": 6}
        first = {"title": {"text": f"x′, {unit}/s"}}
        layout |= panel.axes(x, y | (first if panel is grid[0] else {"showticklabels": False, "matches": "y"}))
    return figure(data, layout, 232, (54, 8, 24, 44))


def _plane(panel: Panel, x: np.ndarray, v: np.ndarray, classes: np.ndarray, colours: Sequence[str]) -> dict[str, Any]:
    """Return a map of classes (nv, nx), 0, 1, ..., each in its colour."""
    steps = len(colours)
    return panel.trace | {
        "type": "heatmap",
        "x": rounded(x),
        "y": rounded(v),
        "z": packed(classes),
        "zmin": -0.5,
        "zmax": steps - 0.5,
        "colorscale": [[(k + side) / steps, colour] for k, colour in enumerate(colours) for side in (0, 1)],
        "showscale": False,
        "hovertemplate": "x %{x:.3g}, x′ %{y:.3g}<extra></extra>",
    }


def fields(drawn: "Sequence[Field]") -> Figure:
    """Draw where V rises, dark, and the line s = 0: a panel per plant, x across, x' up."""
    grid = panels(1, len(drawn), (0.045, 0))
    data: list[dict] = []
    layout: dict[str, Any] = {"annotations": plant_titles(grid, [field.plant for field in drawn])}
    for panel, field, title in zip(grid, drawn, layout["annotations"], strict=True):
        title["text"] += f", {100 * field.share:.0f} %"
        data.append(_plane(panel, field.x, field.v, field.rises, (FALLS, RISES)))
        zero = {
            "type": "contour",
            "contours": {"coloring": "none", "start": 0, "end": 0, "size": 1, "showlabels": False},
            "hoverinfo": "skip",
            "x": rounded(field.x[::4]),
            "y": rounded(field.v[::4]),
            "z": [rounded(row, 3) for row in field.s[::4, ::4]],
            "showscale": False,
            "colorscale": [[0, style.INK], [1, style.INK]],
            "line": {"width": 1.5, "color": style.INK},
        }
        data.append(zero | panel.trace)
        unit = plants()[field.plant].unit if field.plant in plants() else ""
        y = {"showgrid": False, "nticks": 5} | ({"title": {"text": "x′, rad/s or m/s"}} if panel is grid[0] else {})
        layout |= panel.axes({"title": {"text": f"x, {unit}"}, "showgrid": False, "nticks": 4}, y)
    return figure(data, layout, 246, (48, 8, 38, 44))
