"""Charts of numbers: medians with intervals, fronts of error against effort, margins, curves over time.

A value that is not on an axis (inf, or less than a logarithm shows) is a triangle at the end of the axis.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.films import Curve, Scene
from smc_mujoco.evidence.report.panels import Figure, figure, law_axis, panels, plant_titles, rounded, scale
from smc_mujoco.evidence.report.scores import Score
from smc_mujoco.evidence.report.words import style

if TYPE_CHECKING:
    from smc_mujoco.analysis.margins import Margin
    from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable
    from smc_mujoco.evidence.accuracy.scaling import Accuracy
    from smc_mujoco.evidence.report.rigs import Repeated
    from smc_mujoco.evidence.report.stages import Front

KEYS_PER_LINE = 5  # laws in a line of a legend
# Of logarithmic axes. Plotly writes powers a quarter larger than this size.
LOG_AXIS: dict[str, Any] = {"type": "log", "exponentformat": "power", "tickfont": {"size": 9}}


def _label(law: str) -> str:
    """Return a law's name for a chart."""
    return words.escape(words.law(law))


def _quantity(value: float, unit: str) -> str:
    """Return a number with its unit, in words; "never" has none."""
    return f"{words.number(value)} {unit * math.isfinite(value)}".strip()


def forest(scores: Sequence[Score], metrics: Sequence[str], plants: Sequence[str], laws: Sequence[str]) -> Figure:
    """Draw medians with intervals in one condition: a row per metric, a column per plant, a line per law."""
    grid = panels(len(metrics), len(plants), (0.028, 0.08))
    known = {(s.metric, s.plant, s.law): s for s in scores}
    data: list[dict] = []
    titles = [title | {"yshift": 17} for title in plant_titles(grid[: len(plants)], plants)]
    layout: dict[str, Any] = {"annotations": titles}
    for k, panel in enumerate(grid):
        metric, plant = metrics[k // len(plants)], plants[k % len(plants)]
        cells = [known[metric, plant, law] for law in laws if (metric, plant, law) in known]
        logarithmic, low, high = ends = scale([v for cell in cells for v in (cell.low, cell.median, cell.high)])
        data += [_whisker(cell, ends) | panel.trace for cell in cells]
        unit = f"{words.metric(metric)}, {words.unit(metric, plant)}"
        titles.append(panel.heading(unit, font={"size": 11}))
        x: dict[str, Any] = {"type": "linear", "range": [low, high], "nticks": 4}
        if logarithmic:
            ticks = max(1, math.ceil(math.log10(high / low) / 4))  # decades between ticks that leave at most four
            x |= LOG_AXIS | {"range": [math.log10(low), math.log10(high)], "dtick": ticks}
        layout |= panel.axes(x, law_axis(laws, k % len(plants) == 0))
    return figure(data, layout, 84 + (32 + 16 * len(laws)) * len(metrics), (172, 14, 58, 34))


def _whisker(score: Score, ends: tuple[bool, float, float]) -> dict[str, Any]:
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
    return {
        "type": "scatter",
        "mode": "markers",
        "cliponaxis": False,
        "x": [at],
        "y": [name],
        "error_x": bar | {"color": colour, "thickness": 2, "width": 0},
        "marker": {"size": 9, "color": colour, "symbol": symbol, "line": {"width": 2, "color": colour}},
        "hovertemplate": text + (f"<br>95 %: {spread}" if spread else "") + "<extra></extra>",
    }


def fronts(drawn: "Sequence[Front]") -> Figure:
    """Draw tracking against variation: a panel per plant, a staircase per law; a dot at the study's gains."""
    plants = list(dict.fromkeys(front.plant for front in drawn))
    laws = list(dict.fromkeys(front.law for front in drawn))
    grid = panels(1, len(plants), (0.035, 0))
    data: list[dict] = []
    layout: dict[str, Any] = {"annotations": plant_titles(grid, plants)}
    for panel, plant in zip(grid, plants, strict=True):
        on_plant = [front for front in drawn if front.plant == plant]
        data += [trace | panel.trace for front in on_plant for trace in _front(front)]
        across = _span([v for f in on_plant for v in (*f.variation, f.chosen[1])], 1e-3)
        up = _span([v for f in on_plant for v in (*f.tracking, f.chosen[0])], None)
        x = LOG_AXIS | {"title": {"text": "variation, 1/s"}, "range": across, "tickangle": 0}
        y = LOG_AXIS | {"dtick": 1, "range": up}
        y |= {"title": {"text": "tracking, s²"}} if panel is grid[0] else {}
        layout |= panel.axes(x | {"dtick": max(1, math.ceil((across[1] - across[0]) / 4))}, y)
    for law in laws:  # an entry of the legend, which switches all curves of the law
        colour = words.colour(law)
        key = {"type": "scatter", "mode": "lines+markers", "x": [None], "y": [None], "name": _label(law)}
        key |= {"legendgroup": law, "line": {"color": colour, "width": 2}, "marker": {"size": 8, "color": colour}}
        data.append(key)
    legend = 21 * math.ceil(len(laws) / KEYS_PER_LINE)  # px that it takes above the panels
    layout["legend"] = {"y": 1 + 52 / 264}
    return figure(data, layout, 380 + legend, (60, 12, 62 + legend, 54), showlegend=True)


def _span(values: Sequence[float], floor: float | None) -> list[float]:
    """Return the ends of a logarithmic axis, in decades.

    It shows all values down to `floor` of the largest, or up to 1000 times the smallest where that is None.
    """
    above = [v for v in values if v > 0] or [1.0]
    low, high = (min(above), min(max(above), 1e3 * min(above))) if floor is None else (0.0, max(above))
    low = max(low, min(above), (floor or 0.0) * high)
    return [math.log10(low) - 0.15, math.log10(high) + 0.15]


def _front(front: "Front") -> list[dict[str, Any]]:
    """Return the staircase of a law, and the dot at the study's gains."""
    colour = words.colour(front.law)
    common = {"type": "scatter", "legendgroup": front.law, "showlegend": False}
    hover = f"<b>{_label(front.law)}</b><br>variation %{{x:.3g}} 1/s<br>tracking %{{y:.3g}} s²<extra></extra>"
    across, up = zip(*sorted(zip(front.variation, front.tracking, strict=True)), strict=True)  # for steps to the right
    line = {"mode": "lines+markers", "line": {"color": colour, "width": 1.5, "shape": "hv"}}
    line["marker"] = {"size": 4, "color": colour}
    dot = {"mode": "markers", "marker": {"size": 12, "color": colour, "line": {"width": 2, "color": "#FFFFFF"}}}
    return [
        common | line | {"x": rounded(across), "y": rounded(up), "hovertemplate": hover},
        common | dot | {"x": [front.chosen[1]], "y": [front.chosen[0]], "hovertemplate": "The study's gains: " + hover},
    ]


def margins(drawn: "Sequence[Margin]", kind: str) -> Figure:
    """Draw the largest level of one kind that each law tolerates: a panel per plant; a bar marks linear theory.

    A triangle means that the search ended there without a failure.
    """
    plants = list(dict.fromkeys(margin.plant for margin in drawn))
    laws = list(dict.fromkeys(margin.law for margin in drawn))
    grid = panels(1, len(plants), (0.025, 0))
    data: list[dict] = []
    layout: dict[str, Any] = {"annotations": plant_titles(grid, plants)}
    for panel, plant in zip(grid, plants, strict=True):
        on_plant = [margin for margin in drawn if (margin.plant, margin.kind) == (plant, kind)]
        _, _, end = scale([v for m in on_plant for v in (m.value, m.theory or 0.0)], False)
        data += [trace | panel.trace for margin in on_plant for trace in _margin(margin, end)]
        x = {"range": [-0.03 * end, end], "nticks": 4, "rangemode": "tozero"}
        layout |= panel.axes(x, law_axis(laws, panel is grid[0]))
    return figure(data, layout, 98 + 19 * len(laws), (172, 14, 42, 28))


def _margin(margin: "Margin", end: float) -> list[dict[str, Any]]:
    """Return the point of a law with its stem, and the bar of linear theory; a cross without any margin."""
    colour, name = words.colour(margin.law), _label(margin.law)
    common = {"type": "scatter", "mode": "markers", "y": [name], "cliponaxis": False}
    if math.isnan(margin.value):
        cross = {"size": 8, "symbol": "x-thin", "line": {"width": 2, "color": colour}}
        hover = f"<b>{name}</b><br>not within bounds without any, either<extra></extra>"
        return [common | {"x": [0.0], "marker": cross, "hovertemplate": hover}]
    unit = words.either([margin.unit])
    beyond, at = margin.value >= margin.searched, min(margin.value, end)
    marker = {"size": 10, "color": colour, "symbol": "triangle-right" if beyond else "circle"}
    hover = f"<b>{name}</b><br>{'at least ' if beyond else ''}{_quantity(margin.value, unit)}"
    hover += f" (to {words.number(margin.resolution)})<extra></extra>"
    stem = {"array": [0], "arrayminus": [at], "symmetric": False, "type": "data"}
    stem |= {"color": colour, "thickness": 1.5, "width": 0}
    traces = [common | {"x": [at], "marker": marker, "error_x": stem, "hovertemplate": hover}]
    if margin.theory is not None and math.isfinite(margin.theory):
        bar = {"size": 15, "symbol": "line-ns", "line": {"width": 2.5, "color": style.INK}}
        hover = f"linear theory<br>{_quantity(margin.theory, unit)}<extra></extra>"
        traces.append(common | {"x": [margin.theory], "marker": bar, "hovertemplate": hover})
    return traces


def accuracies(table: "AccuracyTable") -> Figure:
    """Draw the largest error over the control period: a panel for each condition, and dashed theory's slope."""
    groups = table.groups
    grid = panels(1, len(groups), (0.08, 0))
    data: list[dict] = []
    layout: dict[str, Any] = {"annotations": []}
    laws: set[str] = set()
    for panel, (title, rows) in zip(grid, groups.items(), strict=True):
        layout["annotations"].append(panel.title(f"{words.pretty(title)}, {rows[0].unit}"))
        for row in rows:
            data += [trace | panel.trace for trace in _accuracy(row, row.law not in laws)]
            laws.add(row.law)
        errors = [error for row in rows for error in row.e.largest if row.floor < error < math.inf]
        low, high = min(errors, default=1.0), max(errors, default=1.0)
        span = [math.log10(low) - 0.2, math.log10(high) + 0.2]
        x = {"type": "log", "title": {"text": "control period, ms"}, "tickvals": [1e3 * h for h in rows[0].periods]}
        layout |= panel.axes(x, LOG_AXIS | {"range": span, "dtick": 1})
    legend = 21 * math.ceil(len(laws) / KEYS_PER_LINE)  # px that it takes above the panels
    layout["legend"] = {"y": 1 + 28 / 264}
    return figure(data, layout, 380 + legend, (60, 12, 62 + legend, 54), showlegend=True)


def _accuracy(row: "Accuracy", named: bool) -> list[dict[str, Any]]:
    """Return the line of a law's errors over the control period in ms, and theory's slope through its middle."""
    colour, name = words.colour(row.law), _label(row.law)
    h = [1e3 * period for period in row.periods]
    common = {"type": "scatter", "legendgroup": row.law, "x": rounded(h)}
    hover = f"<b>{name}</b><br>%{{y:.2g}} {row.unit} at %{{x:g}} ms<br>order {row.e}<extra></extra>"
    line = {"mode": "lines+markers", "line": {"color": colour, "width": 1.8}, "marker": {"size": 7, "color": colour}}
    traces = [common | line | {"y": rounded(row.e.largest), "name": name, "showlegend": named, "hovertemplate": hover}]
    if row.e.theory is not None and not math.isnan(row.e.order):
        middle = len(h) // 2
        bound = [row.e.largest[middle] * (ms / h[middle]) ** row.e.theory for ms in h]
        dashed = {"mode": "lines", "line": {"color": colour, "width": 1, "dash": "dash"}, "hoverinfo": "skip"}
        traces.append(common | dashed | {"y": rounded(bound), "showlegend": False})
    return traces


def curves(scene: Scene) -> Figure:
    """Draw x and u of every law over time. Where u chatters, a band is its range and the line its running mean."""
    left, right = panels(1, 2, (0.075, 0))
    extremes = [np.concatenate([c.u, c.low, c.high]) for c in scene.curves]
    bound = 1.08 * (max((float(np.abs(u).max()) for u in extremes if u.size), default=0.0) or scene.u_max)
    time, zero = {"title": {"text": "t, s"}}, {"zeroline": True, "zerolinecolor": style.RULE}
    angle, force = ("angle", "N·m") if scene.unit == "rad" else ("position", "N")
    layout: dict[str, Any] = left.axes(time, zero)
    layout |= right.axes(time | {"matches": "x"}, zero | {"range": [-bound, bound]})
    layout["annotations"] = [left.title(f"{angle} x, {scene.unit}"), right.title(f"control u, {force}")]
    layout["legend"] = {"y": 1.12}
    data = []
    for curve in scene.curves:
        x, *u = _curve(curve)
        data += [x, *(trace | right.trace | {"showlegend": False} for trace in u)]
    return figure(data, layout, 305, (48, 12, 62, 46), showlegend=True)


def _curve(curve: Curve) -> list[dict[str, Any]]:
    """Return the line of x, the band of u if it chatters, and the line of u."""
    colour, name = words.colour(curve.law), _label(curve.law)
    line = {"type": "scatter", "mode": "lines", "legendgroup": curve.law, "line": {"color": colour, "width": 1.8}}
    hover = {"hovertemplate": f"<b>{name}</b> %{{y:.4g}} at %{{x:.3f}} s<extra></extra>"}
    traces = [line | hover | {"x": rounded(curve.t), "y": rounded(curve.x), "name": name}]
    if len(curve.tb):
        around = np.concatenate([curve.tb, curve.tb[::-1]]), np.concatenate([curve.high, curve.low[::-1]])
        fill = "rgba({}, {}, {}, 0.18)".format(*style.rgb(colour))
        band = {"fill": "toself", "fillcolor": fill, "line": {"width": 0}, "hoverinfo": "skip"}
        traces.append(line | band | {"x": rounded(around[0], 4), "y": rounded(around[1], 3)})
    return [*traces, line | hover | {"x": rounded(curve.tu), "y": rounded(curve.u)}]


def record(shown: "Repeated") -> Figure:
    """Draw the columns of a record over time, measured and as its twin repeats them: a panel for each, one below."""
    grid = panels(len(shown.measured), 1, (0.0, 0.13))
    data: list[dict] = []
    layout: dict[str, Any] = {"annotations": [], "legend": {"y": 1.0 + 30 / (120 * len(grid))}}
    for panel, name in zip(grid, shown.measured, strict=True):
        layout["annotations"].append(panel.title(name))
        below = {"title": {"text": "t, s"}} if panel is grid[-1] else {"showticklabels": False}
        layout |= panel.axes(below | ({} if panel is grid[0] else {"matches": "x"}), {})
        for label, values, line in (
            ("measured", shown.measured[name], {"color": style.MUTED, "width": 2.4}),
            ("twin", shown.twin[name], {"color": words.colour(words.PAPER_LAW), "width": 1.2}),
        ):
            trace = {"type": "scatter", "mode": "lines", "x": rounded(shown.t), "y": rounded(values), "line": line}
            hover = f"<b>{label}</b> %{{y:.4g}} at %{{x:.3f}} s<extra></extra>"
            trace |= {"name": label, "legendgroup": label, "showlegend": panel is grid[0], "hovertemplate": hover}
            data.append(trace | panel.trace)
    return figure(data, layout, 120 + 120 * len(grid), (56, 12, 62, 46), showlegend=True)
