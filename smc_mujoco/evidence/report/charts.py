"""Charts of a report, plotly's figures: small multiples with the same axes, one panel a plant, one colour a law.

A value that is not on an axis (inf, or less than a logarithm shows) is a triangle at the end of the axis. Numbers have
five digits.
"""

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from smc_mujoco.draw import region
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.films import Curve, Scene
from smc_mujoco.evidence.report.scores import Score
from smc_mujoco.evidence.report.words import style
from smc_mujoco.mechanisms.plant import catalogue as known_plants

if TYPE_CHECKING:
    from smc_mujoco.analysis.margins import Margin
    from smc_mujoco.analysis.region_of_attraction import Basin
    from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable
    from smc_mujoco.evidence.accuracy.scaling import Accuracy
    from smc_mujoco.evidence.report.rigs import Repeated
    from smc_mujoco.evidence.report.stages import Field, Front

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
LOG_SPAN, MAX_DECADES = 50.0, 5  # an axis of a wider span is logarithmic, and shows at most so many decades
KEYS_PER_LINE = 5  # laws in a line of a legend
LINE_HEIGHT = 21  # px, of a line of a legend
FALLS, RISES = "#DCEAF4", "#C05A21"  # of V; light and dark apart from hue
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
    titles: Sequence[str],
    height: int,
    margin: tuple[int, int, int, int],
    gaps: tuple[float, float],
    rows: int = 1,
    tops: Sequence[str] | None = None,
) -> tuple[go.Figure, list[Panel]]:
    """Return a figure of panels with a title at the left of each, and `tops` above the columns; and the panels.

    Height and margin (left, right, top, bottom) are in px, gaps across and up shares of the whole.
    """
    places = list(itertools.product(range(1, rows + 1), range(1, len(titles) // rows + 1)))
    across, up = gaps
    fig = make_subplots(
        *places[-1], subplot_titles=titles, column_titles=tops, horizontal_spacing=across, vertical_spacing=up
    )
    font = {"size": 12, "color": style.INK}
    fig.update_annotations(font=font, xanchor="left", align="left", yanchor="bottom", yshift=4)
    axes = [*fig.select_xaxes()]
    for title, axis in zip(fig.layout.annotations, axes * 2, strict=False):
        title.x = axis.domain[0]
    sides = dict(zip("lrtb", margin, strict=True))
    fig.update_layout(template={"layout": STYLE}, height=height, margin=sides, showlegend=False)
    return fig, [{"row": row, "col": column} for row, column in places]


def _label(law: str) -> str:
    """Return a law's name for a chart."""
    return words.escape(words.law(law))


def _plants(plants: Sequence[str]) -> list[str]:
    """Return titles of panels, on two lines where there are more than three."""
    names = [words.bold(words.plant(plant)) for plant in plants]
    return [name.replace(" network", "<br>network") for name in names] if len(names) > 3 else names


def _quantity(value: float, unit: str) -> str:
    """Return a number with its unit, in words; "never" has none."""
    return f"{words.number(value)} {unit * math.isfinite(value)}".strip()


def _law_axis(laws: Sequence[str], shown: bool) -> dict[str, Any]:
    """Return a y axis with a line for each law, the first at the top; their names where shown."""
    names = [_label(law) for law in reversed(laws)]
    y = {"categoryarray": names, "categoryorder": "array", "range": [-0.6, len(laws) - 0.4], "showgrid": False}
    return y | {"dtick": 1, "showticklabels": shown, "tickfont": {"size": 11.5, "color": style.INK}}


def rounded(values: Sequence[float] | np.ndarray, digits: int = 5) -> list[float | None]:
    """Return numbers with few digits; None for what is not finite."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.asarray(values, float).tolist()]


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


def forest(scores: Sequence[Score], metrics: Sequence[str], plants: Sequence[str], laws: Sequence[str]) -> go.Figure:
    """Draw medians with intervals in one condition: a row per metric, a column per plant, a line per law."""
    cells = list(itertools.product(metrics, plants))
    titles = [f"{words.metric(metric)}, {words.unit(metric, plant)}" for metric, plant in cells]
    height = 84 + (32 + 16 * len(laws)) * len(metrics)
    fig, places = panels(titles, height, (172, 14, 58, 34), (0.028, 0.08), len(metrics), _plants(plants))
    for k, title in enumerate(fig.layout.annotations):
        title.update({"font": {"size": 11}} if k < len(cells) else {"yshift": 17})
    known = {(s.metric, s.plant, s.law): s for s in scores}
    for place, cell in zip(places, cells, strict=True):
        its = [known[*cell, law] for law in laws if (*cell, law) in known]
        logarithmic, low, high = ends = scale([v for score in its for v in (score.low, score.median, score.high)])
        for score in its:
            fig.add_trace(_whisker(score, ends), **place)
        x: dict[str, Any] = {"type": "linear", "range": [low, high], "nticks": 4}
        if logarithmic:
            ticks = max(1, math.ceil(math.log10(high / low) / 4))  # decades between ticks that leave at most four
            x |= LOG_AXIS | {"range": [math.log10(low), math.log10(high)], "dtick": ticks}
        fig.update_xaxes(x, **place).update_yaxes(_law_axis(laws, place["col"] == 1), **place)
    return fig


def _whisker(score: Score, ends: tuple[bool, float, float]) -> go.Scatter:
    """Return a law's point with its interval, on an axis with these ends."""
    logarithmic, low, high = ends
    off = (high / low) ** 0.035 if logarithmic else 1.0  # off the ends, clear of the labels
    inner = (low * off, high / off) if logarithmic else (low, high * 0.97)
    low, high = (score.median if math.isnan(v) else v for v in (score.low, score.high))  # of a single run
    at, left, right = (min(max(v, inner[0]), inner[1]) for v in (score.median, low, high))
    symbol = "triangle-right" if score.median > inner[1] else "triangle-left" if score.median < inner[0] else "circle"
    symbol += "" if score.best else "-open"
    colour, name = words.colour(score.law), _label(score.law)
    text = f"<b>{name}</b><br>{_quantity(score.median, words.unit(score.metric, score.plant))}"
    spread = words.interval(score.median, score.low, score.high)
    bar = {"type": "data", "symmetric": False, "array": [right - at], "arrayminus": [at - left]}
    marker = {"size": 9, "color": colour, "symbol": symbol, "line": {"width": 2, "color": colour}}
    return go.Scatter(
        {"mode": "markers", "cliponaxis": False, "x": [at], "y": [name], "marker": marker},
        error_x=bar | {"color": colour, "thickness": 2, "width": 0},
        hovertemplate=text + (f"<br>95 %: {spread}" if spread else "") + "<extra></extra>",
    )


def fronts(drawn: "Sequence[Front]") -> go.Figure:
    """Draw tracking against variation: a panel per plant, a staircase per law; a dot at the study's gains."""
    plants = list(dict.fromkeys(front.plant for front in drawn))
    laws = list(dict.fromkeys(front.law for front in drawn))
    legend = LINE_HEIGHT * math.ceil(len(laws) / KEYS_PER_LINE)  # px that it takes above the panels
    fig, places = panels(_plants(plants), 380 + legend, (60, 12, 62 + legend, 54), (0.035, 0))
    for place, plant in zip(places, plants, strict=True):
        on_plant = [front for front in drawn if front.plant == plant]
        fig.add_traces([trace for front in on_plant for trace in _front(front)], **_each(place, 2 * len(on_plant)))
        across = _span([v for f in on_plant for v in (*f.variation, f.chosen[1])], 1e-3)
        up = _span([v for f in on_plant for v in (*f.tracking, f.chosen[0])], None)
        tick = max(1, math.ceil((across[1] - across[0]) / 4))
        fig.update_xaxes(LOG_AXIS, title_text="variation, 1/s", range=across, tickangle=0, dtick=tick, **place)
        fig.update_yaxes(LOG_AXIS, range=up, dtick=1, **place)
    fig.update_yaxes(title_text="tracking, s²", row=1, col=1)
    for law in laws:  # an entry of the legend, which switches all curves of the law
        colour = words.colour(law)
        key = {"name": _label(law), "legendgroup": law, "marker": {"size": 8, "color": colour}}
        fig.add_scatter(**key, x=[None], y=[None], mode="lines+markers", line={"color": colour, "width": 2})
    return fig.update_layout(showlegend=True, legend={"y": 1 + 52 / 264})


def _each(place: Panel, count: int) -> dict[str, Any]:
    """Return the places of several traces in one panel, as `add_traces` takes them."""
    return {"rows": [place["row"]] * count, "cols": [place["col"]] * count}


def _span(values: Sequence[float], floor: float | None) -> list[float]:
    """Return the ends of a logarithmic axis, in decades.

    It shows all values down to `floor` of the largest, or up to 1000 times the smallest where that is None.
    """
    above = [v for v in values if v > 0] or [1.0]
    low, high = (min(above), min(max(above), 1e3 * min(above))) if floor is None else (0.0, max(above))
    low = max(low, min(above), (floor or 0.0) * high)
    return [math.log10(low) - 0.15, math.log10(high) + 0.15]


def _front(front: "Front") -> list[go.Scatter]:
    """Return the staircase of a law, and the dot at the study's gains."""
    colour = words.colour(front.law)
    common = {"legendgroup": front.law, "showlegend": False}
    hover = f"<b>{_label(front.law)}</b><br>variation %{{x:.3g}} 1/s<br>tracking %{{y:.3g}} s²<extra></extra>"
    across, up = zip(*sorted(zip(front.variation, front.tracking, strict=True)), strict=True)  # for steps to the right
    line = {"mode": "lines+markers", "line": {"color": colour, "width": 1.5, "shape": "hv"}}
    line["marker"] = {"size": 4, "color": colour}
    dot = {"mode": "markers", "marker": {"size": 12, "color": colour, "line": {"width": 2, "color": "#FFFFFF"}}}
    chosen = {"x": [front.chosen[1]], "y": [front.chosen[0]], "hovertemplate": "The study's gains: " + hover}
    return [
        go.Scatter(common | line, x=rounded(across), y=rounded(up), hovertemplate=hover),
        go.Scatter(common | dot | chosen),
    ]


def margins(drawn: "Sequence[Margin]", kind: str) -> go.Figure:
    """Draw the largest level of one kind that each law tolerates: a panel per plant; a bar marks linear theory.

    A triangle means that the search ended there without a failure.
    """
    plants = list(dict.fromkeys(margin.plant for margin in drawn))
    laws = list(dict.fromkeys(margin.law for margin in drawn))
    fig, places = panels(_plants(plants), 98 + 19 * len(laws), (172, 14, 42, 28), (0.025, 0))
    for place, plant in zip(places, plants, strict=True):
        on_plant = [margin for margin in drawn if (margin.plant, margin.kind) == (plant, kind)]
        _, _, end = scale([v for m in on_plant for v in (m.value, m.theory or 0.0)], False)
        traces = [trace for margin in on_plant for trace in _margin(margin, end)]
        fig.add_traces(traces, **_each(place, len(traces)))
        fig.update_xaxes(range=[-0.03 * end, end], nticks=4, rangemode="tozero", **place)
        fig.update_yaxes(_law_axis(laws, place["col"] == 1), **place)
    return fig


def _margin(margin: "Margin", end: float) -> list[go.Scatter]:
    """Return the point of a law with its stem, and the bar of linear theory; a cross without any margin."""
    colour, name = words.colour(margin.law), _label(margin.law)
    common = {"mode": "markers", "y": [name], "cliponaxis": False}
    if math.isnan(margin.value):
        cross = {"size": 8, "symbol": "x-thin", "line": {"width": 2, "color": colour}}
        hover = f"<b>{name}</b><br>not within bounds without any, either<extra></extra>"
        return [go.Scatter(common, x=[0.0], marker=cross, hovertemplate=hover)]
    unit = words.either([margin.unit])
    beyond, at = margin.value >= margin.searched, min(margin.value, end)
    marker = {"size": 10, "color": colour, "symbol": "triangle-right" if beyond else "circle"}
    hover = f"<b>{name}</b><br>{'at least ' if beyond else ''}{_quantity(margin.value, unit)}"
    hover += f" (to {words.number(margin.resolution)})<extra></extra>"
    stem = {"array": [0], "arrayminus": [at], "symmetric": False, "type": "data"}
    stem |= {"color": colour, "thickness": 1.5, "width": 0}
    traces = [go.Scatter(common, x=[at], marker=marker, error_x=stem, hovertemplate=hover)]
    if margin.theory is not None and math.isfinite(margin.theory):
        bar = {"size": 15, "symbol": "line-ns", "line": {"width": 2.5, "color": style.INK}}
        hover = f"linear theory<br>{_quantity(margin.theory, unit)}<extra></extra>"
        traces.append(go.Scatter(common, x=[margin.theory], marker=bar, hovertemplate=hover))
    return traces


def accuracies(table: "AccuracyTable") -> go.Figure:
    """Draw the largest error over the control period: a panel for each condition, and dashed theory's slope."""
    laws = list(dict.fromkeys(row.law for row in table))
    legend = LINE_HEIGHT * math.ceil(len(laws) / KEYS_PER_LINE)  # px that it takes above the panels
    titles = [words.bold(f"{words.pretty(title)}, {rows[0].unit}") for title, rows in table.groups.items()]
    fig, places = panels(titles, 380 + legend, (60, 12, 62 + legend, 54), (0.08, 0))
    for place, rows in zip(places, table.groups.values(), strict=True):
        for row in rows:
            fig.add_traces(traces := _accuracy(row, place["col"] == 1), **_each(place, len(traces)))
        errors = [error for row in rows for error in row.e.largest if row.floor < error < math.inf]
        span = [math.log10(min(errors, default=1.0)) - 0.2, math.log10(max(errors, default=1.0)) + 0.2]
        ticks = [1e3 * h for h in rows[0].periods]
        fig.update_xaxes(type="log", title_text="control period, ms", tickvals=ticks, **place)
        fig.update_yaxes(LOG_AXIS, range=span, dtick=1, **place)
    return fig.update_layout(showlegend=True, legend={"y": 1 + 28 / 264})


def _accuracy(row: "Accuracy", named: bool) -> list[go.Scatter]:
    """Return the line of a law's errors over the control period in ms, and theory's slope through its middle."""
    colour, name = words.colour(row.law), _label(row.law)
    h = [1e3 * period for period in row.periods]
    common = {"legendgroup": row.law, "x": rounded(h)}
    hover = f"<b>{name}</b><br>%{{y:.2g}} {row.unit} at %{{x:g}} ms<br>order {row.e}<extra></extra>"
    line = {"mode": "lines+markers", "line": {"color": colour, "width": 1.8}, "marker": {"size": 7, "color": colour}}
    traces = [go.Scatter(common | line, y=rounded(row.e.largest), name=name, showlegend=named, hovertemplate=hover)]
    if row.e.theory is not None and not math.isnan(row.e.order):
        middle = len(h) // 2
        bound = [row.e.largest[middle] * (ms / h[middle]) ** row.e.theory for ms in h]
        dashed = {"mode": "lines", "line": {"color": colour, "width": 1, "dash": "dash"}, "hoverinfo": "skip"}
        traces.append(go.Scatter(common | dashed, y=rounded(bound), showlegend=False))
    return traces


def curves(scene: Scene) -> go.Figure:
    """Draw x and u of every law over time. Where u chatters, a band is its range and the line its running mean."""
    angle, force = ("angle", "N·m") if scene.unit == "rad" else ("position", "N")
    titles = [words.bold(f"{angle} x, {scene.unit}"), words.bold(f"control u, {force}")]
    fig, (left, right) = panels(titles, 305, (48, 12, 62, 46), (0.075, 0))
    extremes = [np.concatenate([c.u, c.low, c.high]) for c in scene.curves]
    bound = 1.08 * (max((float(np.abs(u).max()) for u in extremes if u.size), default=0.0) or scene.u_max)
    fig.update_xaxes(title_text="t, s").update_yaxes(zeroline=True, zerolinecolor=style.RULE)
    fig.update_xaxes(matches="x", **right).update_yaxes(range=[-bound, bound], **right)
    for curve in scene.curves:
        x, *u = _curve(curve)
        fig.add_trace(x, **left).add_traces(u, **_each(right, len(u)))
    return fig.update_layout(showlegend=True, legend={"y": 1.12})


def _curve(curve: Curve) -> list[go.Scatter]:
    """Return the line of x, the band of u if it chatters, and the line of u."""
    colour, name = words.colour(curve.law), _label(curve.law)
    line = {"mode": "lines", "legendgroup": curve.law, "line": {"color": colour, "width": 1.8}}
    hover = {"hovertemplate": f"<b>{name}</b> %{{y:.4g}} at %{{x:.3f}} s<extra></extra>"}
    traces = [go.Scatter(line | hover, x=rounded(curve.t), y=rounded(curve.x), name=name)]
    if len(curve.tb):
        around = np.concatenate([curve.tb, curve.tb[::-1]]), np.concatenate([curve.high, curve.low[::-1]])
        fill = "rgba({}, {}, {}, 0.18)".format(*style.rgb(colour))
        band = line | {"fill": "toself", "fillcolor": fill, "line": {"width": 0}, "hoverinfo": "skip"}
        traces.append(go.Scatter(band, x=rounded(around[0], 4), y=rounded(around[1], 3), showlegend=False))
    return [*traces, go.Scatter(line | hover, x=rounded(curve.tu), y=rounded(curve.u), showlegend=False)]


def record(shown: "Repeated") -> go.Figure:
    """Draw the columns of a record over time, measured and as its twin repeats them: a panel for each, one below."""
    names = list(shown.measured)
    fig, places = panels(
        [words.bold(name) for name in names], 120 + 120 * len(names), (56, 12, 62, 46), (0.0, 0.13), len(names)
    )
    for place, name in zip(places, names, strict=True):
        for label, values, line in (
            ("measured", shown.measured[name], {"color": style.MUTED, "width": 2.4}),
            ("twin", shown.twin[name], {"color": words.colour(words.PAPER_LAW), "width": 1.2}),
        ):
            hover = f"<b>{label}</b> %{{y:.4g}} at %{{x:.3f}} s<extra></extra>"
            key = {"name": label, "legendgroup": label, "showlegend": place["row"] == 1, "hovertemplate": hover}
            fig.add_scatter(**key, x=rounded(shown.t), y=rounded(values), line=line, mode="lines", **place)
    fig.update_xaxes(showticklabels=False).update_xaxes(showticklabels=True, title_text="t, s", **places[-1])
    for place in places[1:]:
        fig.update_xaxes(matches="x", **place)
    return fig.update_layout(showlegend=True, legend={"y": 1.0 + 30 / (120 * len(names))})


def meanings(drawn: "Sequence[Basin]") -> dict[str, str]:
    """Return colour -> its meaning, for the colours that occur in any of the maps."""
    after = region.convergence_times(drawn)
    there = {int(k) for basin in drawn for k in np.unique(region.colour_indices(basin, after))}
    texts = region.meanings(after, "at rest, known after {:g} s", "does not come to rest here")
    return {region.COLOURS[k]: text for k, text in texts.items() if k in there}


def basins(drawn: "Sequence[Basin]", after: Sequence[float]) -> go.Figure:
    """Draw the maps of one plant: a panel a law, x across, x' up; `after` is from `convergence_times` of all maps."""
    fig, places = panels([words.bold(words.law(basin.law)) for basin in drawn], 232, (54, 8, 24, 44), (0.02, 0))
    unit = drawn[0].unit
    for place, basin, title in zip(places, drawn, fig.layout.annotations, strict=True):
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
    fig, places = panels(titles, 246, (48, 8, 38, 44), (0.045, 0))
    lines = {"coloring": "none", "start": 0, "end": 0, "size": 1, "showlabels": False}
    zero = {"contours": lines, "hoverinfo": "skip", "showscale": False, "line": {"width": 1.5, "color": style.INK}}
    for place, field in zip(places, drawn, strict=True):
        fig.add_trace(_plane(field.x, field.v, field.rises, (FALLS, RISES)), **place)
        heights = [rounded(row, 3) for row in field.s[::4, ::4]]
        fig.add_contour(**zero, x=rounded(field.x[::4]), y=rounded(field.v[::4]), z=heights, **place)
        unit = known_plants()[field.plant].unit if field.plant in known_plants() else ""
        fig.update_xaxes(title_text=f"x, {unit}", showgrid=False, nticks=4, **place)
    return fig.update_yaxes(showgrid=False, nticks=5).update_yaxes(title_text="x′, rad/s or m/s", **places[0])
