"""What the command line prints: score tables, catalogues, one trace."""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from rich import box
from rich.table import Table
from rich.text import Text

from smc_mujoco.draw import style
from smc_mujoco.metrics import metrics, score
from smc_mujoco.trace import Trace

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
SPARKS = "▁▂▃▄▅▆▇█"


def scores(title: str, traces: Mapping[str, Trace]) -> Table:
    """One line a run, one column a metric, units in the heading; a run that failed says so."""
    first = next(iter(traces.values()))
    units = {m.name: m.unit_for(first.scenario.plant.unit) for m in metrics()}
    networks = {m.name for m in metrics() if m.network}
    shown = {head: name for head, name in SHOWN.items() if first.scenario.plant.n > 1 or name not in networks}
    table = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, **LEAN)
    table.add_column("law", no_wrap=True, vertical="bottom", max_width=16, overflow="ellipsis")
    for head, name in shown.items():
        table.add_column(f"{head}\n[dim]{units[name]}[/]", justify="right", no_wrap=True, vertical="bottom")
    for label, trace in traces.items():
        name = Text(label, style=style.law_colour(trace.scenario.law.name))
        if trace.diverged_at is not None:
            table.add_row(name, Text("failed", style="red"))
            continue
        values = score(trace)
        table.add_row(name, *(number(values[metric]) for metric in shown.values()))
    return table


def number(value: float) -> str:
    """Three significant digits, written short; "never" for inf; "<1e-9" where little but rounding is left."""
    if math.isinf(value):
        return "never"
    if 0.0 < abs(value) < 1e-9:
        return "<1e-9"
    if value == 0.0 or 1e-3 <= abs(value) < 1e5:
        return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}" if value else "0"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def catalogue(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    """Names with a line about each."""
    table = Table(title=title, title_justify="left", title_style="bold", show_header=False, box=None, padding=(0, 2))
    table.add_column(no_wrap=True)
    table.add_column()
    for name, about in rows:
        table.add_row(Text(name, style="cyan"), Text(about))
    return table


def trace_summary(trace: Trace) -> Table:
    """Every metric of one trace, with its unit and what it means."""
    values = score(trace)
    table = Table(box=None, padding=(0, 2, 0, 0))
    for head in ("metric", "value", "unit", ""):
        table.add_column(head, justify="right" if head == "value" else "left")
    for m in metrics():
        if m.name in values:
            table.add_row(m.name, number(values[m.name]), m.unit_for(trace.scenario.plant.unit), Text(m.summary))
    return table


def spark(values: Sequence[float] | np.ndarray, width: int = 60) -> str:
    """A line of block characters that rise and fall with the values."""
    y = np.asarray(values, float)
    y = y[np.linspace(0, len(y) - 1, min(width, len(y))).astype(int)]
    finite = y[np.isfinite(y)]
    low, high = (finite.min(), finite.max()) if len(finite) else (0.0, 0.0)
    level = (y - low) / ((high - low) or 1.0) * (len(SPARKS) - 1)
    return "".join(SPARKS[round(v)] if np.isfinite(v) else " " for v in level)
