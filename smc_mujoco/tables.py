"""What the command line prints: score tables, catalogues, one trace."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from rich.table import Table
from rich.text import Text

from smc_mujoco import style
from smc_mujoco.metrics import metrics, score
from smc_mujoco.trace import Trace

# What a score table shows, of the metrics there are: heading under which, and metric.
SHOWN = {
    "settling": "settling_time",
    "overshoot": "overshoot",
    "ultimate bound": "ultimate_bound",
    "ITAE": "itae",
    "max |u|": "max_u",
    "TV rate": "tv_rate",
    "energy": "energy",
    "spread settling": "spread_settling_time",
}
SPARKS = "▁▂▃▄▅▆▇█"


def scores(title: str, traces: Mapping[str, Trace]) -> Table:
    """One line a run, one column a metric, units in the heading; a run that failed says so."""
    first = next(iter(traces.values()))
    units = {m.name: m.unit_for(first.scenario.plant.unit) for m in metrics()}
    networks = {m.name for m in metrics() if m.network}
    shown = {head: name for head, name in SHOWN.items() if first.scenario.plant.n > 1 or name not in networks}
    table = Table(title=title, title_justify="left")
    table.add_column("law")
    for head, name in shown.items():
        table.add_column(f"{head}\n{units[name]}", justify="right")
    for label, trace in traces.items():
        name = Text(label, style=style.colour(trace.scenario.law.name))
        if trace.diverged_at is not None:
            table.add_row(name, Text(f"failed at {trace.diverged_at:.3g} s", style="red"))
            continue
        values = score(trace)
        table.add_row(name, *(number(values[metric]) for metric in shown.values()))
    return table


def number(value: float) -> str:
    """Three significant digits; a run that never settles has none."""
    return "never" if np.isinf(value) else f"{value:.3g}"


def catalogue(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    """Names with a line about each."""
    table = Table(title=title, title_justify="left", show_header=False, box=None, padding=(0, 2))
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for row in rows:
        table.add_row(*row)
    return table


def trace_summary(trace: Trace) -> Table:
    """Every metric of one trace, with its unit and what it means."""
    values = score(trace)
    table = Table(title="scores", title_justify="left", box=None, padding=(0, 2))
    for head in ("metric", "value", "unit", ""):
        table.add_column(head, justify="right" if head == "value" else "left")
    for m in metrics():
        if m.name in values:
            table.add_row(m.name, number(values[m.name]), m.unit_for(trace.scenario.plant.unit), m.summary)
    return table


def spark(values: Sequence[float] | np.ndarray, width: int = 60) -> str:
    """A line of block characters that rise and fall with the values."""
    y = np.asarray(values, float)
    y = y[np.linspace(0, len(y) - 1, min(width, len(y))).astype(int)]
    finite = y[np.isfinite(y)]
    low, high = (finite.min(), finite.max()) if len(finite) else (0.0, 0.0)
    level = (y - low) / ((high - low) or 1.0) * (len(SPARKS) - 1)
    return "".join(SPARKS[round(v)] if np.isfinite(v) else " " for v in level)
