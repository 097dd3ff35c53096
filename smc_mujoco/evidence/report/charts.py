"""Charts of a report: plotly's figures, with a panel for each plant and a colour for each law; and SVG pictures.

Numbers have five digits. The pictures are those of the suite's other commands.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from smc_mujoco.draw import region
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.films import picture
from smc_mujoco.evidence.report.words import style
from smc_mujoco.evidence.rigs.figure import residual_figure
from smc_mujoco.mechanisms.plant import catalogue as known_plants

if TYPE_CHECKING:
    from smc_mujoco.analysis.margins import Margin
    from smc_mujoco.analysis.region_of_attraction import Basin
    from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable
    from smc_mujoco.evidence.report.rigs import Repeated
    from smc_mujoco.evidence.report.stages import Field, Front

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
KEYS_PER_LINE = 5  # laws in a line of a legend
LINE_HEIGHT = 21  # px, of a line of a legend
NAME_FONT = {"size": 11.5, "color": style.INK}  # of laws beside their lines
FALLS, RISES = "#DCEAF4", "#C05A21"  # where V falls, where it rises: different in lightness, not only in hue
# Of logarithmic axes. Plotly writes powers a quarter larger than this size.
LOG_AXIS: dict[str, Any] = {"type": "log", "exponentformat": "power", "tickfont": {"size": 9}}
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
}
Panel = dict[str, Any]  # row and column


def panels(
    titles: Sequence[str], height: int, margin: tuple[int, int, int, int], gap: float
) -> tuple[go.Figure, list[Panel]]:
    """Return a figure of panels in a row, with a title at the left of each; and the panels.

    Height and margin (left, right, top, bottom) are in px, the gap between panels is a share of the whole.
    """
    fig = make_subplots(1, len(titles), subplot_titles=titles, horizontal_spacing=gap)
    font = {"size": 12, "color": style.INK}
    fig.update_annotations(font=font, xanchor="left", align="left", yanchor="bottom", yshift=4)
    for title, axis in zip(fig.layout.annotations, fig.select_xaxes(), strict=True):  # pyright: ignore[reportAttributeAccessIssue] plotly makes it
        title.x = axis.domain[0]
    sides = dict(zip("lrtb", margin, strict=True))
    fig.update_layout(height=height, margin=sides, showlegend=False)
    fig.layout.template = {"layout": STYLE}  # in place of plotly's own, of 7 kB
    return fig, [{"row": 1, "col": 1 + k} for k in range(len(titles))]


def _label(law: str) -> str:
    """Return a law's name for a chart."""
    return words.escape(words.law(law))


def _plants(plants: Sequence[str]) -> list[str]:
    """Return titles of panels, on two lines where there are more than three."""
    names = [words.bold(words.plant(plant)) for plant in plants]
    return [name.replace(" network", "<br>network") for name in names] if len(names) > 3 else names


def rounded(values: Sequence[float] | np.ndarray, digits: int = 5) -> list[float | None]:
    """Return numbers with few digits; None for what is not finite."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.asarray(values, float).tolist()]


def fronts(drawn: "Sequence[Front]") -> go.Figure:
    """Draw tracking against variation: a panel per plant, a staircase per law; a dot at the study's gains."""
    plants = list(dict.fromkeys(front.plant for front in drawn))
    laws = list(dict.fromkeys(front.law for front in drawn))
    legend = LINE_HEIGHT * math.ceil(len(laws) / KEYS_PER_LINE)  # px that it takes above the panels
    fig, places = panels(_plants(plants), 380 + legend, (60, 12, 62 + legend, 54), 0.035)
    named: set[str] = set()  # laws in the legend, where a click switches all their curves
    for front in drawn:
        place, colour = places[plants.index(front.plant)], words.colour(front.law)
        common = {"name": _label(front.law), "legendgroup": front.law, **place}
        common["hovertemplate"] = "variation %{x:.3g} 1/s<br>tracking %{y:.3g} s²"
        across, up = zip(*sorted(zip(front.variation, front.tracking, strict=True)), strict=True)  # steps to the right
        line, small = {"color": colour, "width": 1.5, "shape": "hv"}, {"size": 4, "color": colour}
        key = {"mode": "lines+markers", "line": line, "marker": small, "showlegend": front.law not in named}
        fig.add_scatter(**common, **key, x=rounded(across), y=rounded(up))
        dot = {"size": 12, "color": colour, "line": {"width": 2, "color": "#FFFFFF"}}
        tracking, variation = front.chosen
        fig.add_scatter(**common, x=[variation], y=[tracking], mode="markers", marker=dot, showlegend=False)
        named.add(front.law)
    for place, plant in zip(places, plants, strict=True):
        on_plant = [front for front in drawn if front.plant == plant]
        across = _span([v for f in on_plant for v in (*f.variation, f.chosen[1])], 1e-3)
        up = _span([v for f in on_plant for v in (*f.tracking, f.chosen[0])], None)
        tick = max(1, math.ceil((across[1] - across[0]) / 4))
        fig.update_xaxes(LOG_AXIS, title_text="variation, 1/s", range=across, tickangle=0, dtick=tick, **place)
        fig.update_yaxes(LOG_AXIS, range=up, dtick=1, **place)
    fig.update_yaxes(title_text="tracking, s²", row=1, col=1)
    return fig.update_layout(showlegend=True, legend={"y": 1 + 52 / 264})


def _span(values: Sequence[float], floor: float | None) -> list[float]:
    """Return the ends of a logarithmic axis, in decades.

    It shows all values down to `floor` of the largest, or up to 1000 times the smallest where that is None.
    """
    above = [v for v in values if v > 0] or [1.0]
    low, high = (min(above), min(max(above), 1e3 * min(above))) if floor is None else (0.0, max(above))
    low = max(low, min(above), (floor or 0.0) * high)
    return [math.log10(low) - 0.15, math.log10(high) + 0.15]


def margins(drawn: "Sequence[Margin]", kind: str) -> go.Figure:
    """Draw the largest level of one kind that each law tolerates: a panel per plant; a bar marks linear theory.

    A triangle means that the search ended there without a failure, a cross that even the level 0 is not tolerated.
    """
    plants = list(dict.fromkeys(margin.plant for margin in drawn))
    laws = list(dict.fromkeys(margin.law for margin in drawn))
    fig, places = panels(_plants(plants), 98 + 19 * len(laws), (172, 14, 42, 28), 0.025)
    names = [_label(law) for law in reversed(laws)]  # the first at the top
    fig.update_yaxes(categoryarray=names, categoryorder="array", range=[-0.6, len(laws) - 0.4], showgrid=False, dtick=1)
    fig.update_yaxes(showticklabels=False).update_yaxes(showticklabels=True, tickfont=NAME_FONT, **places[0])
    for place, plant in zip(places, plants, strict=True):
        its = [margin for margin in drawn if (margin.plant, margin.kind) == (plant, kind)]
        theory = [margin for margin in its if margin.theory is not None and math.isfinite(margin.theory)]
        sizes = [v for margin in its for v in (margin.value, margin.theory or 0.0) if math.isfinite(v)]
        end = 1.15 * (max(sizes, default=0.0) or 1.0)
        symbols = ["x" if math.isnan(m.value) else "circle" if m.value < m.searched else "triangle-right" for m in its]
        x = [0.0 if math.isnan(margin.value) else min(margin.value, end) for margin in its]
        marker = {"size": 10, "color": [words.colour(margin.law) for margin in its], "symbol": symbols}
        stems = {"array": [0.0] * len(x), "arrayminus": x, "symmetric": False, "color": style.RULE, "width": 0}
        common = {"mode": "markers", "cliponaxis": False, **place}
        common["hovertemplate"] = "<b>%{y}</b><br>%{x:.3g}<extra></extra>"
        fig.add_scatter(**common, x=x, y=[_label(margin.law) for margin in its], marker=marker, error_x=stems)
        bar = {"size": 15, "symbol": "line-ns", "line": {"width": 2.5, "color": style.INK}}
        fig.add_scatter(**common, x=[m.theory for m in theory], y=[_label(m.law) for m in theory], marker=bar)
        fig.update_xaxes(range=[-0.03 * end, end], nticks=4, rangemode="tozero", **place)
    return fig


def meanings(drawn: "Sequence[Basin]") -> dict[str, str]:
    """Return colour -> its meaning, for the colours that occur in any of the maps."""
    after = region.convergence_times(drawn)
    there = {int(k) for basin in drawn for k in np.unique(region.colour_indices(basin, after))}
    texts = region.meanings(after, "at rest, known after {:g} s", "does not come to rest here")
    return {region.COLOURS[k]: text for k, text in texts.items() if k in there}


def basins(drawn: "Sequence[Basin]", after: Sequence[float]) -> go.Figure:
    """Draw the maps of one plant: a panel a law, x across, x' up; `after` is from `convergence_times` of all maps."""
    fig, places = panels([words.bold(words.law(basin.law)) for basin in drawn], 232, (54, 8, 24, 44), 0.02)
    unit = drawn[0].unit
    for place, basin, title in zip(places, drawn, fig.layout.annotations, strict=True):  # pyright: ignore[reportAttributeAccessIssue] plotly makes it
        title.font.color = words.colour(basin.law)
        fig.add_trace(_plane(basin.x, basin.v, region.colour_indices(basin, after), region.COLOURS), **place)
    for place, basin in zip(places, drawn, strict=True):
        corner = {"x": 1, "y": 1, "xref": "x domain", "yref": "y domain", "xanchor": "right", "yanchor": "bottom"}
        font = {"size": 11, "color": style.MUTED}
        share = f"{100 * basin.share:.0f} %"
        fig.add_annotation(corner, text=share, font=font, yshift=4, showarrow=False, **place)
    fig.update_xaxes(title_text=f"x, {unit}", showgrid=False, nticks=5)
    fig.update_yaxes(showgrid=False, nticks=6, showticklabels=False)
    for place in places[1:]:
        fig.update_yaxes(matches="y", **place)
    return fig.update_yaxes(title_text=f"x′, {unit}/s", showticklabels=True, **places[0])


def _plane(x: np.ndarray, v: np.ndarray, classes: np.ndarray, colours: Sequence[str]) -> go.Heatmap:
    """Return a map of classes (nv, nx), 0, 1, ..., each in its colour."""
    steps = len(colours)
    bands = [[(k + side) / steps, colour] for k, colour in enumerate(colours) for side in (0, 1)]
    common = {"zmin": -0.5, "zmax": steps - 0.5, "colorscale": bands, "showscale": False}
    hover = "x %{x:.3g}, x′ %{y:.3g}<extra></extra>"
    return go.Heatmap(common, x=rounded(x), y=rounded(v), z=classes.astype(np.int8), hovertemplate=hover)


def fields(drawn: "Sequence[Field]") -> go.Figure:
    """Draw where V rises, dark, and the line s = 0: a panel per plant, x across, x' up."""
    titles = _plants([field.plant for field in drawn])
    titles = [f"{title}, {100 * field.share:.0f} %" for title, field in zip(titles, drawn, strict=True)]
    fig, places = panels(titles, 246, (48, 8, 38, 44), 0.045)
    lines = {"coloring": "none", "start": 0, "end": 0, "size": 1, "showlabels": False}
    zero = {"contours": lines, "hoverinfo": "skip", "showscale": False, "line": {"width": 1.5, "color": style.INK}}
    for place, field in zip(places, drawn, strict=True):
        fig.add_trace(_plane(field.x, field.v, field.rises, (FALLS, RISES)), **place)
        heights = [rounded(row, 3) for row in field.s[::4, ::4]]
        fig.add_contour(**zero, x=rounded(field.x[::4]), y=rounded(field.v[::4]), z=heights, **place)
        unit = known_plants()[field.plant].unit if field.plant in known_plants() else ""
        fig.update_xaxes(title_text=f"x, {unit}", showgrid=False, nticks=4, **place)
    return fig.update_yaxes(showgrid=False, nticks=5).update_yaxes(title_text="x′, rad/s or m/s", **places[0])


def orders(table: "AccuracyTable") -> bytes:
    """Draw the largest errors over the control period, with theory's slopes."""
    return picture(lambda path: table.plot(path, format="svg"))


def record(shown: "Repeated") -> bytes:
    """Draw the columns of a record, measured and as its twin repeats them, and the residuals."""
    fits, title = {"twin": shown.fits["the twin’s"]}, f"{shown.rig.name}: {shown.name}"
    units, twin = shown.rig.units, {"twin": shown.twin}
    return picture(lambda path: residual_figure(title, shown.t, shown.measured, twin, fits, units, path))
