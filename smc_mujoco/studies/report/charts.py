"""Charts of numbers: medians with intervals, fronts of error against effort, margins, curves over time.

What cannot stand on an axis (inf, or less than a logarithm shows) stands at its end as a triangle.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from smc_mujoco.studies.report import words
from smc_mujoco.studies.report.findings import Curve, Front, Scene, Score
from smc_mujoco.studies.report.panels import AXIS, Figure, axes, figure, heading, panels, rounded, scale, titles
from smc_mujoco.studies.report.words import style

if TYPE_CHECKING:
    from smc_mujoco.analysis.margins import Margin

# Of logarithmic axes; plotly writes powers a quarter larger than it is told.
KEYS = 5  # laws in a line of a legend
POWERS: dict[str, Any] = {"exponentformat": "power", "tickfont": AXIS["tickfont"] | {"size": 9}}


def forest(scores: Sequence[Score], metrics: Sequence[str], plants: Sequence[str], laws: Sequence[str]) -> Figure:
    """Draw medians with intervals in one condition: a row per metric, a column per plant, a line per law."""
    grid = panels(len(metrics), len(plants), (0.028, 0.12))
    known = {(s.metric, s.plant, s.law): s for s in scores}
    data: list[dict] = []
    above = [each | {"yshift": 17} for each in titles(grid[: len(plants)], [words.plant(p) for p in plants], 12)]
    layout: dict[str, Any] = {"annotations": above}
    for k, panel in enumerate(grid):
        metric, plant = metrics[k // len(plants)], plants[k % len(plants)]
        cells = [known[metric, plant, law] for law in laws if (metric, plant, law) in known]
        ends = scale([v for cell in cells for v in (cell.low, cell.median, cell.high)])
        data += [_whisker(cell, panel[0], ends) for cell in cells]
        unit = words.unit(metric, plant)
        layout["annotations"].append(
            heading(panel, words.metric(metric)) | {"text": f"{words.metric(metric)}, {unit}", "font": {"size": 11}}
        )
        x = {"type": "log" if ends[0] else "linear", "range": _range(ends), "nticks": 4}
        x |= {"dtick": _decades(ends)} | POWERS if ends[0] else {}
        y = {"categoryarray": [words.escape(words.law(law)) for law in reversed(laws)], "categoryorder": "array"}
        y |= {"dtick": 1, "showticklabels": k % len(plants) == 0, "tickfont": {"size": 11.5, "color": style.INK}}
        layout |= axes(panel, x, y | {"range": [-0.6, len(laws) - 0.4], "showgrid": False})
    return figure(
        data, layout | {"margin": {"l": 172, "r": 14, "t": 58, "b": 34}}, 84 + (32 + 16 * len(laws)) * len(metrics)
    )


def _range(ends: tuple[bool, float, float]) -> list[float]:
    logarithmic, low, high = ends
    return [math.log10(low), math.log10(high)] if logarithmic else [low, high]


def _decades(ends: tuple[bool, float, float]) -> int:
    """Return the decades between ticks that leave at most four ticks."""
    return max(1, math.ceil(math.log10(ends[2] / ends[1]) / 4))


def _whisker(score: Score, end: str, ends: tuple[bool, float, float]) -> dict[str, Any]:
    """Return a law's point with its interval, on the panel whose axes have this ending."""
    logarithmic, low, high = ends
    off = (high / low) ** 0.035 if logarithmic else 1.0  # off the ends, clear of the labels
    inner = (low * off, high / off) if logarithmic else (low, high * 0.97)
    at, left, right = (min(max(v, inner[0]), inner[1]) for v in (score.median, score.low, score.high))
    symbol = "triangle-right" if score.median > inner[1] else "triangle-left" if score.median < inner[0] else "circle"
    colour = words.colour(score.law)
    text = f"{words.number(score.median)} {words.unit(score.metric, score.plant)}"
    spread = words.interval(score.median, score.low, score.high)
    return {
        "type": "scatter",
        "mode": "markers",
        "cliponaxis": False,
        "x": [at],
        "y": [words.escape(words.law(score.law))],
        "xaxis": f"x{end}",
        "yaxis": f"y{end}",
        "error_x": {
            "type": "data",
            "symmetric": False,
            "array": [right - at],
            "arrayminus": [at - left],
            "color": colour,
            "thickness": 2,
            "width": 0,
        },
        "marker": {
            "size": 9,
            "color": colour,
            "symbol": symbol if score.best else f"{symbol}-open",
            "line": {"width": 2, "color": colour},
        },
        "hovertemplate": f"<b>{words.escape(words.law(score.law))}</b><br>{text}"
        + (f"<br>95 %: {spread}" if spread else "")
        + "<extra></extra>",
    }


def fronts(found: Sequence[Front], plants: Sequence[str]) -> Figure:
    """Draw tracking against variation: a panel per plant, a staircase per law; a dot at the study's gains."""
    grid = panels(1, len(plants), (0.035, 0))
    data: list[dict] = []
    layout: dict[str, Any] = {"annotations": titles(grid, [words.plant(plant) for plant in plants])}
    laws = dict.fromkeys(front.law for front in found)
    for panel, plant in zip(grid, plants, strict=True):
        for front in (f for f in found if f.plant == plant):
            data += _front(front, panel[0])
        own = [f for f in found if f.plant == plant]
        across = _span([v for f in own for v in (*f.variation, f.chosen[1])], 1e-3)
        up = _span([v for f in own for v in (*f.tracking, f.chosen[0])], None)
        x = {"type": "log", "title": AXIS["title"] | {"text": "variation, 1/s"}} | POWERS
        y = {"type": "log", "dtick": 1} | POWERS
        x |= {"range": across, "dtick": max(1, math.ceil((across[1] - across[0]) / 4)), "tickangle": 0}
        if panel[0] == "":
            y["title"] = AXIS["title"] | {"text": "tracking, s²"}
        layout |= axes(panel, x, y | {"range": up})
    data += [_key(law) for law in laws]
    key = 21 * math.ceil(len(laws) / KEYS)  # px that the legend takes above the panels
    layout |= {"margin": {"l": 60, "r": 12, "t": 62 + key, "b": 54}}
    layout |= {"legend": {"orientation": "h", "x": 0, "y": 1 + 52 / 264, "yanchor": "bottom", "font": {"size": 12}}}
    return figure(data, layout, 380 + key, legend=True)


def _span(values: Sequence[float], least: float | None) -> list[float]:
    """The ends of a logarithmic axis, in decades: all values down to `least` of the largest, or up to 1000 times the
    smallest where that is None."""
    above = [v for v in values if v > 0] or [1.0]
    low, high = (min(above), min(max(above), 1e3 * min(above))) if least is None else (0.0, max(above))
    low = max(low, min(above), (least or 0.0) * high)
    return [math.log10(low) - 0.15, math.log10(high) + 0.15]


def _key(law: str) -> dict[str, Any]:
    """Return a law's entry in the legend, which switches all of its curves."""
    return {
        "type": "scatter",
        "mode": "lines+markers",
        "x": [None],
        "y": [None],
        "name": words.escape(words.law(law)),
        "legendgroup": law,
        "line": {"color": words.colour(law), "width": 2},
        "marker": {"size": 8, "color": words.colour(law)},
    }


def _front(front: Front, end: str) -> list[dict[str, Any]]:
    colour, name = words.colour(front.law), words.escape(words.law(front.law))
    common = {"type": "scatter", "xaxis": f"x{end}", "yaxis": f"y{end}", "legendgroup": front.law, "showlegend": False}
    told = f"<b>{name}</b><br>variation %{{x:.3g}} 1/s<br>tracking %{{y:.3g}} s²<extra></extra>"
    across, up = zip(*sorted(zip(front.variation, front.tracking, strict=True)), strict=True)  # for steps to the right
    line = {"mode": "lines+markers", "line": {"color": colour, "width": 1.5, "shape": "hv"}}
    line["marker"] = {"size": 4, "color": colour}
    dot = {"mode": "markers", "marker": {"size": 12, "color": colour, "line": {"width": 2, "color": "#FFFFFF"}}}
    return [
        common | line | {"x": rounded(across), "y": rounded(up), "hovertemplate": told},
        common | dot | {"x": [front.chosen[1]], "y": [front.chosen[0]], "hovertemplate": "The study's gains: " + told},
    ]


def margins(found: "Sequence[Margin]", kind: str, plants: Sequence[str], laws: Sequence[str]) -> Figure:
    """Draw the largest level of one kind that each law tolerates: a panel per plant; a bar marks linear theory.

    A triangle means that the search ended there without a failure.
    """
    grid = panels(1, len(plants), (0.025, 0))
    names = [words.escape(words.law(law)) for law in reversed(laws)]
    chosen = [m for m in found if m.kind == kind]
    data: list[dict] = []
    layout: dict[str, Any] = {"annotations": titles(grid, [words.plant(plant) for plant in plants])}
    for panel, plant in zip(grid, plants, strict=True):
        here = [m for m in chosen if m.plant == plant]
        ends = scale([v for m in here for v in (m.value, m.theory or 0.0)], False)
        for margin in here:
            data += _margin(margin, panel[0], ends[2])
        x = {"range": [-0.03 * ends[2], ends[2]], "nticks": 4, "rangemode": "tozero"}
        y = {"categoryarray": names, "categoryorder": "array", "range": [-0.6, len(laws) - 0.4], "showgrid": False}
        y |= {"dtick": 1, "showticklabels": panel[0] == "", "tickfont": {"size": 11.5, "color": style.INK}}
        layout |= axes(panel, x, y)
    return figure(data, layout | {"margin": {"l": 172, "r": 14, "t": 42, "b": 28}}, 98 + 19 * len(laws))


def _margin(margin: "Margin", end: str, most: float) -> list[dict[str, Any]]:
    colour, name = words.colour(margin.law), words.escape(words.law(margin.law))
    common = {"type": "scatter", "mode": "markers", "xaxis": f"x{end}", "yaxis": f"y{end}", "y": [name]}
    common["cliponaxis"] = False
    if math.isnan(margin.value):
        cross = {"size": 8, "symbol": "x-thin", "line": {"width": 2, "color": colour}}
        told = f"<b>{name}</b><br>not within bounds without any, either<extra></extra>"
        return [common | {"x": [0.0], "marker": cross, "hovertemplate": told}]
    beyond = margin.value >= margin.searched
    marker = {"size": 10, "color": colour, "symbol": "triangle-right" if beyond else "circle"}
    told = f"<b>{name}</b><br>{'at least ' if beyond else ''}{words.number(margin.value)} {margin.unit}"
    told += f" (to {words.number(margin.resolution)})<extra></extra>"
    stem = {"array": [0], "arrayminus": [min(margin.value, most)], "symmetric": False, "type": "data"}
    stem |= {"color": colour, "thickness": 1.5, "width": 0}
    found = [common | {"x": [min(margin.value, most)], "marker": marker, "error_x": stem, "hovertemplate": told}]
    if margin.theory is not None and math.isfinite(margin.theory):
        bar = {"size": 15, "symbol": "line-ns", "line": {"width": 2.5, "color": style.INK}}
        told = f"linear theory<br>{words.number(margin.theory)} {margin.unit}<extra></extra>"
        found.append(common | {"x": [margin.theory], "marker": bar, "hovertemplate": told})
    return found


def curves(scene: Scene) -> Figure:
    """Draw x and u of every law over time. Where u chatters, a band is its range and the line its running mean."""
    grid = panels(1, 2, (0.075, 0))
    data: list[dict] = []
    for curve in scene.curves:
        data += _curve(curve)
    force = "N·m" if scene.unit == "rad" else "N"
    extremes = [np.concatenate([c.u, c.low, c.high]) for c in scene.curves]
    bound = 1.08 * (max((float(np.abs(each).max()) for each in extremes if each.size), default=0.0) or scene.u_max)
    time = {"title": AXIS["title"] | {"text": "t, s"}, "matches": "x"}
    layout: dict[str, Any] = axes(grid[0], time | {"matches": None}, {"zeroline": True, "zerolinecolor": style.RULE})
    layout |= axes(grid[1], time, {"range": [-bound, bound], "zeroline": True, "zerolinecolor": style.RULE})
    layout["annotations"] = [
        heading(grid[0], f"{'angle' if scene.unit == 'rad' else 'position'} x, {scene.unit}"),
        heading(grid[1], f"control u, {force}"),
    ]
    layout |= {"margin": {"l": 48, "r": 12, "t": 62, "b": 46}}
    layout |= {"legend": {"orientation": "h", "x": 0, "y": 1.12, "yanchor": "bottom", "font": {"size": 12}}}
    return figure(data, layout, 305, legend=True)


def _curve(curve: Curve) -> list[dict[str, Any]]:
    colour, name = words.colour(curve.law), words.escape(words.law(curve.law))
    line = {"type": "scatter", "mode": "lines", "legendgroup": curve.law, "line": {"color": colour, "width": 1.8}}
    told = f"<b>{name}</b> %{{y:.4g}} at %{{x:.3f}} s<extra></extra>"
    found = [line | {"x": rounded(curve.t), "y": rounded(curve.x), "name": name, "hovertemplate": told}]
    second = {"xaxis": "x2", "yaxis": "y2", "showlegend": False}
    if len(curve.tb):
        around = np.concatenate([curve.tb, curve.tb[::-1]]), np.concatenate([curve.high, curve.low[::-1]])
        band = {"fill": "toself", "fillcolor": _clear(colour), "line": {"width": 0}, "hoverinfo": "skip"}
        found.append(line | second | band | {"x": rounded(around[0], 4), "y": rounded(around[1], 3)})
    found.append(line | second | {"x": rounded(curve.tu), "y": rounded(curve.u), "hovertemplate": told})
    return found


def _clear(colour: str, opacity: float = 0.18) -> str:
    return "rgba({}, {}, {}, {})".format(*style.rgb(colour), opacity)
