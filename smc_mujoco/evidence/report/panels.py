"""Panels of the report's charts: plotly figures as plain dicts, made without importing plotly.

Small multiples throughout: the same axes, one panel a plant (and a law), one colour a law. Numbers have five digits.
"""

import base64
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.words import style

Figure = dict[str, Any]
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
LOG_SPAN, MAX_DECADES = 50.0, 5  # an axis of a wider span is logarithmic, and shows at most so many decades
AXIS = {
    "gridcolor": style.GRID,
    "showline": True,
    "linecolor": style.RULE,
    "zeroline": False,
    "ticks": "",
    "tickfont": {"size": 11, "color": style.MUTED},
    "title": {"font": {"size": 12, "color": style.MUTED}, "standoff": 6},
}
STYLE = {
    "font": {"family": FONT, "size": 12, "color": style.INK},
    "paper_bgcolor": "rgba(0,0,0,0)",
    "plot_bgcolor": "rgba(0,0,0,0)",
    "legend": {"orientation": "h", "x": 0, "yanchor": "bottom", "font": {"size": 12}},
    "hoverlabel": {"font": {"family": FONT, "size": 12}, "bgcolor": "#FFFFFF", "bordercolor": style.RULE},
    "hovermode": "closest",
    "dragmode": "zoom",
    "xaxis": AXIS,
    "yaxis": AXIS,
    "annotationdefaults": {
        "xref": "paper",
        "yref": "paper",
        "yshift": 4,
        "xanchor": "left",
        "yanchor": "bottom",
        "align": "left",
        "showarrow": False,
        "font": {"size": 12, "color": style.INK},
    },
}


class Panel(NamedTuple):
    """A pair of axes: their ending ("", "2", ...) and their domains, shares of the whole."""

    end: str
    x: tuple[float, float]
    y: tuple[float, float]

    @property
    def trace(self) -> dict[str, Any]:
        """What puts a trace on these axes."""
        return {"xaxis": f"x{self.end}", "yaxis": f"y{self.end}"}

    def axes(self, x: Mapping[str, Any], y: Mapping[str, Any]) -> dict[str, Any]:
        """Return the layout of the two axes."""
        return {
            f"xaxis{self.end}": {"domain": self.x, "anchor": f"y{self.end}"} | dict(x),
            f"yaxis{self.end}": {"domain": self.y, "anchor": f"x{self.end}"} | dict(y),
        }

    def heading(self, text: str, **fields: Any) -> dict[str, Any]:
        """Return a text above the panel, at its left; fields of the annotation."""
        return {"text": text, "x": self.x[0], "y": self.y[1]} | fields

    def title(self, text: str, **fields: Any) -> dict[str, Any]:
        """Return a heading in bold, where HTML tags have no effect."""
        return self.heading(f"<b>{words.escape(text)}</b>", **fields)


def panels(rows: int, columns: int, gaps: tuple[float, float]) -> list[Panel]:
    """Return the panels of a grid, row by row; gaps across and up are shares of the whole."""
    width, height = (1 - gaps[0] * (columns - 1)) / columns, (1 - gaps[1] * (rows - 1)) / rows
    boxes = []
    for k in range(rows * columns):
        left, top = (k % columns) * (width + gaps[0]), 1 - (k // columns) * (height + gaps[1])
        boxes.append(Panel("" if k == 0 else str(k + 1), (left, left + width), (max(top - height, 0.0), top)))
    return boxes


def plant_titles(grid: Sequence[Panel], plants: Sequence[str]) -> list[dict[str, Any]]:
    """Return a title for each panel, on two lines where there are more than three panels."""
    made = [panel.title(words.plant(plant)) for panel, plant in zip(grid, plants, strict=True)]
    for title in made if len(made) > 3 else ():
        title["text"] = title["text"].replace(" network", "<br>network")
    return made


def figure(
    data: list[dict], layout: dict[str, Any], height: int, margin: tuple[int, int, int, int], **fields: Any
) -> Figure:
    """Return a figure in the report's style. Height and margin (left, right, top, bottom) are in px."""
    sides = dict(zip("lrtb", margin, strict=True))
    common = {"template": {"layout": STYLE}, "height": height, "margin": sides, "showlegend": False}
    return {"data": data, "layout": common | layout | fields}


def law_axis(laws: Sequence[str], shown: bool) -> dict[str, Any]:
    """Return a y axis with a line for each law, the first at the top; their names where shown."""
    names = [words.escape(words.law(law)) for law in reversed(laws)]
    y = {"categoryarray": names, "categoryorder": "array", "range": [-0.6, len(laws) - 0.4], "showgrid": False}
    return y | {"dtick": 1, "showticklabels": shown, "tickfont": {"size": 11.5, "color": style.INK}}


def rounded(values: Sequence[float] | np.ndarray, digits: int = 5) -> list[float | None]:
    """Return numbers with few digits; None for what is not finite."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.asarray(values, float).tolist()]


def packed(values: np.ndarray) -> dict[str, str]:
    """Return an array of int8 as plotly reads it."""
    shape = ", ".join(str(n) for n in values.shape)
    return {"dtype": "i1", "bdata": base64.b64encode(values.astype(np.int8).tobytes()).decode(), "shape": shape}


def scale(values: Sequence[float], logarithmic: bool | None = None) -> tuple[bool, float, float]:
    """Return whether an axis for these values is logarithmic, and its ends; values beyond get room at the upper end.

    With None it is logarithmic where values span more than LOG_SPAN, and shows at most MAX_DECADES.
    """
    finite = [v for v in values if math.isfinite(v)]
    top = max([0.0, *finite]) or 1.0
    above = [v for v in finite if v > top * 10.0**-MAX_DECADES]
    if logarithmic is None:
        logarithmic = min(finite, default=top) < top / LOG_SPAN and len(above) > 1
    if logarithmic and above:
        return True, min(above) / 2, top * 2.5
    return False, 0.0, 1.15 * top
