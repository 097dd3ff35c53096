"""Panels of the report's charts: plotly figures as plain dicts, made without importing plotly.

Small multiples throughout: the same axes, one panel a plant (and a law), one colour a law. Numbers have five digits.
"""

import base64
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from smc_mujoco.studies.report import words
from smc_mujoco.studies.report.words import style

Figure = dict[str, Any]
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
WIDE, DECADES = 50.0, 5  # of what an axis shows: a wider span than this is drawn in decades, so many at most
AXIS: dict[str, Any] = {
    "gridcolor": style.GRID,
    "linecolor": style.RULE,
    "zeroline": False,
    "ticks": "",
    "tickfont": {"size": 11, "color": style.MUTED},
    "title": {"font": {"size": 12, "color": style.MUTED}, "standoff": 6},
}


def figure(data: list[dict], layout: dict[str, Any], height: int, legend: bool = False) -> Figure:
    """Return a figure in the report's style; height in px."""
    common = {
        "font": {"family": FONT, "size": 12, "color": style.INK},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "height": height,
        "margin": {"l": 56, "r": 12, "t": 34, "b": 48},
        "showlegend": legend,
        "legend": {"orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom", "font": {"size": 12}},
        "hoverlabel": {"font": {"family": FONT, "size": 12}, "bgcolor": "#FFFFFF", "bordercolor": style.RULE},
        "hovermode": "closest",
        "dragmode": "zoom",
    }
    return {"data": data, "layout": common | layout}


def panels(rows: int, columns: int, gaps: tuple[float, float]) -> list[tuple[str, list[float], list[float]]]:
    """Return the axis ending ("", "2", ...), x domain and y domain of each panel; gaps are shares of the whole."""
    wide, high = (1 - gaps[0] * (columns - 1)) / columns, (1 - gaps[1] * (rows - 1)) / rows
    found = []
    for k in range(rows * columns):
        left, top = (k % columns) * (wide + gaps[0]), 1 - (k // columns) * (high + gaps[1])
        found.append(("" if k == 0 else str(k + 1), [left, left + wide], [max(top - high, 0.0), top]))
    return found


def axes(panel: tuple[str, list[float], list[float]], x: dict[str, Any], y: dict[str, Any]) -> dict[str, Any]:
    """Return the two axes of a panel."""
    end, across, up = panel
    return {
        f"xaxis{end}": AXIS | {"domain": across, "anchor": f"y{end}"} | x,
        f"yaxis{end}": AXIS | {"domain": up, "anchor": f"x{end}"} | y,
    }


def heading(panel: tuple[str, list[float], list[float]], text: str, size: int = 12) -> dict[str, Any]:
    """Return a title above a panel, at its left."""
    _, across, up = panel
    return {
        "text": f"<b>{words.escape(text)}</b>",
        "xref": "paper",
        "yref": "paper",
        "x": across[0],
        "y": up[1],
        "yshift": 4,
        "xanchor": "left",
        "yanchor": "bottom",
        "align": "left",
        "showarrow": False,
        "font": {"size": size, "color": style.INK},
    }


def titles(grid: Sequence[tuple[str, list[float], list[float]]], names: Sequence[str], size: int = 12) -> list[Figure]:
    """Return a heading for each panel, on two lines where there are more than three panels."""
    many = len(names) > 3
    made = [heading(panel, name, size) for panel, name in zip(grid, names, strict=True)]
    for each in made if many else ():
        each["text"] = each["text"].replace(" network", "<br>network")
    return made


def rounded(values: Sequence[float] | np.ndarray, digits: int = 5) -> list[float | None]:
    """Return numbers with few digits; None for what is not finite."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.asarray(values, float).tolist()]


def packed(values: np.ndarray) -> dict[str, str]:
    """Return an array of int8 as plotly reads it."""
    shape = ", ".join(str(n) for n in values.shape)
    return {"dtype": "i1", "bdata": base64.b64encode(values.astype(np.int8).tobytes()).decode(), "shape": shape}


def scale(values: Sequence[float], logarithmic: bool | None = None) -> tuple[bool, float, float]:
    """Return whether an axis for these values is logarithmic, and its ends; values beyond get room at the upper end.

    With None it is logarithmic where values span more than WIDE, and shows DECADES at most.
    """
    finite = [v for v in values if math.isfinite(v)]
    top = max([0.0, *finite]) or 1.0
    above = [v for v in finite if v > top * 10.0**-DECADES]
    if logarithmic is None:
        logarithmic = min(finite, default=top) < top / WIDE and len(above) > 1
    if logarithmic and above:
        return True, min(above) / 2, top * 2.5
    return False, 0.0, 1.15 * top
