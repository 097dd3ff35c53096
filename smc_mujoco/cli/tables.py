"""What the command line prints: score tables, answers to a scene's question, catalogues, one trace."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from rich import box
from rich.table import Table
from rich.text import Text

from smc_mujoco.common.text import number
from smc_mujoco.draw import style
from smc_mujoco.mechanisms.hardware.part import joints
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.metrics.catalogue import scores as metric_scores
from smc_mujoco.metrics.channel_groups import Group, groups
from smc_mujoco.metrics.conventions import Metric
from smc_mujoco.simulation.trace import Trace

# What a score table shows, of the metrics there are: heading under which, and metric.
SHOWN = {
    "settles": "settling_time",
    "overshoot": "overshoot",
    "ultimate\nbound": "ultimate_bound",
    "ITAE": "itae",
    "max |u|": "max_u",
    "TV rate": "tv_rate",
    "spread\nsettles": "spread_settling_time",
}
LEAN = {"padding": 0, "show_edge": False, "pad_edge": False}
FAILED = Text("failed", style="red")
MOST = 4  # joints of a group that a heading names
SPARKS = "▁▂▃▄▅▆▇█"


def scores(title: str, traces: Mapping[str, Trace]) -> list[Table]:
    """A table for each group of channels: one line a run, one column a metric, units in the heading.

    A run that failed says so. Only where there are several groups are they named in the titles.
    """
    style.same_plant(list(traces.values()))
    plant = next(iter(traces.values())).scenario.plant
    values = {label: metric_scores(trace) for label, trace in traces.items() if trace.diverged_at is None}
    tables = []
    for group, heading in headings(plant).items():
        fit = {m.name: m.unit_for(group.unit) for m in metrics() if m.fits(group)}
        shown = {head: name for head, name in SHOWN.items() if name in fit}
        table = _table(", ".join(filter(None, (title, heading))))
        for head, name in shown.items():
            table.add_column(f"{head}\n[dim]{fit[name]}[/]", justify="right", no_wrap=True, vertical="bottom")
        for label, trace in traces.items():
            told = [number(values[label][group.name][name]) for name in shown.values()] if label in values else [FAILED]
            table.add_row(_label(label, trace), *told)
        tables.append(table)
    return tables


def headings(plant: Plant) -> dict[Group, str]:
    """The plant's groups with what they are called: by their joints; a single one has no need of a name."""
    found = groups(plant)
    if len(found) == 1:
        return {found[0]: ""}
    names = [joint.name for joint in joints(plant.spec())]
    return {group: _heading(group, [names[i] for i in group.channels]) for group in found}


def _heading(group: Group, names: Sequence[str]) -> str:
    kind = "driven" if group.driven else "free"
    each = ", ".join(names) if len(names) <= MOST else f"{len(names)} joints"
    return f"{kind}: {each} ({group.unit})"


def answers(names: Sequence[str], traces: Mapping[str, Mapping[str, Trace]]) -> list[Table]:
    """The named metrics of condition -> label -> trace: a table a metric, a line a label, a column a condition.

    Of a single condition: one table, a column a metric. What has no one value for any of the plants is left out.
    """
    plants = {trace.scenario.plant: None for runs in traces.values() for trace in runs.values()}
    known = {m.name: m for m in metrics() if not all(map(m.refusal, plants))}
    names = [name for name in names if name in known]
    units = {name: dict.fromkeys(known[name].unit_for(plant.unit) for plant in plants) for name in names}
    heads = {name: f"{name} ({' or '.join(units[name])})" for name in names}
    if len(traces) == 1:
        (runs,) = traces.values()
        return [_grid("", [heads[name] for name in names], [(known[name], runs) for name in names])]
    return [_grid(heads[name], list(traces), [(known[name], runs) for runs in traces.values()]) for name in names]


def _grid(title: str, heads: Sequence[str], columns: Sequence[tuple[Metric, Mapping[str, Trace]]]) -> Table:
    """A table whose columns are each a metric of labelled runs, with a line for every label."""
    table = _table(title, width=30)
    table.min_width = len(title)  # which would be broken over a narrower table
    for head in heads:
        table.add_column(Text(head), justify="right", vertical="bottom")
    lines = {label: trace for _, runs in reversed(columns) for label, trace in runs.items()}
    for label in dict.fromkeys(label for _, runs in columns for label in runs):
        table.add_row(_label(label, lines[label]), *(_cell(metric, runs.get(label)) for metric, runs in columns))
    return table


def _cell(metric: Metric, trace: Trace | None) -> Text | str:
    """A metric of a run as a table has it; nothing where there is no such run, or the metric is not for its plant."""
    if trace is None or metric.refusal(trace.scenario.plant):
        return ""
    return FAILED if trace.diverged_at is not None else number(metric.of(trace))


def _table(title: str, width: int = 16) -> Table:
    """An empty table whose lines begin with a label, shown up to a width."""
    table = Table(title=title or None, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, **LEAN)
    table.add_column("law", no_wrap=True, vertical="bottom", max_width=width, overflow="ellipsis")
    return table


def _label(label: str, trace: Trace) -> Text:
    return Text(label, style=style.law_colour(trace.scenario.law.name))


def catalogue(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    """Names with a line about each."""
    table = Table(title=title, title_justify="left", title_style="bold", show_header=False, box=None, padding=(0, 2))
    table.add_column(no_wrap=True)
    table.add_column()
    for name, about in rows:
        table.add_row(Text(name, style="cyan"), Text(about))
    return table


def trace_summary(trace: Trace) -> list[Table]:
    """Every metric of one trace, with its unit and what it means; what only realism brings where there is some.

    A table for each group of channels, with its name where there are several.
    """
    values, tables = metric_scores(trace), []
    for group, heading in headings(trace.scenario.plant).items():
        table = Table(box=None, padding=(0, 2, 0, 0), title=heading or None, title_justify="left", title_style="bold")
        for head in ("metric", "value", "unit", ""):
            table.add_column(head, justify="right" if head == "value" else "left")
        for m in metrics():
            if m.name in values[group.name] and (trace.scenario.realistic or not m.realistic):
                told = number(values[group.name][m.name])
                table.add_row(m.name, told, m.unit_for(group.unit), Text(m.summary))
        tables.append(table)
    return tables


def spark(values: Sequence[float] | np.ndarray, width: int = 60) -> str:
    """A line of block characters that rise and fall with the values."""
    y = np.asarray(values, float)
    y = y[np.linspace(0, len(y) - 1, min(width, len(y))).astype(int)]
    finite = y[np.isfinite(y)]
    low, high = (finite.min(), finite.max()) if len(finite) else (0.0, 0.0)
    level = (y - low) / ((high - low) or 1.0) * (len(SPARKS) - 1)
    return "".join(SPARKS[round(v)] if np.isfinite(v) else " " for v in level)
