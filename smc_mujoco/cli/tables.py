"""Tables of the command line: scores, margins, chattering."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, TypeVar

from rich.console import Console, ConsoleOptions, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from smc_mujoco.analysis.differ import differ
from smc_mujoco.analysis.paired_runs import floor
from smc_mujoco.analysis.step_halving import MARK, NOTE, SCORE_NOTE, first_order
from smc_mujoco.answers.answer import Answer
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.registry import Catalogue
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.common.text import first_paragraph, number
from smc_mujoco.control.source import in_words
from smc_mujoco.draw import style
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.metrics.catalogue import scores as metric_scores
from smc_mujoco.metrics.conventions import CATALOGUE, ChannelGroup, Metric, groups
from smc_mujoco.metrics.tip import tip_scores
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

if TYPE_CHECKING:
    from smc_mujoco.analysis.chattering import Chattering
    from smc_mujoco.analysis.step_halving import StepChange

T = TypeVar("T")
# label -> the same run again, as `step_halving.repetitions` has it
Again = Mapping[str, Sequence[Trace]]
TIP_COLUMNS = {  # of a table of an arm's tip: heading -> score, unit, factor on its SI value
    "largest error": ("max_error", "mm", 1e3),
    "error at the end": ("last_error", "mm", 1e3),
    "mean force": ("mean_force", "N", 1.0),
    "off the wanted": ("force_error", "%", 1.0),
    "force varies by": ("force_ripple", "N", 1.0),
    "touching": ("touching", "%", 1.0),
    "deepest": ("depth", "mm", 1e3),
}

# the metrics of a table of scores
SCORES = (
    *("settling_time", "overshoot", "ultimate_bound", "itae", "max_u", "tv_rate"),
    "spread_settling_time",
)
FAILED = Cell("failed", colour="red")
MAX_NAMED_JOINTS = 4  # in the heading of a group


@keyword_dataclass
class Listing(Tabular):
    """Names with a text about each, without headings or rules."""

    style: str = "cyan"  # of the names
    space: int = 0  # lines below each row

    def __rich_console__(
        self, console: Console, options: ConsoleOptions
    ) -> Iterator[RenderableType]:
        if self.title:
            yield Text(self.title, "bold")
        gap = (0, 2, self.space, 0)
        table = Table(box=None, padding=gap, pad_edge=False, show_header=False)
        table.add_column(no_wrap=True, style=self.style)
        for _ in self.headings[1:]:
            table.add_column()
        for row in self.rows:
            table.add_row(*map(Text, map(str, row)))
        yield table


# scores of runs


def scores(title: str, traces: Mapping[str, Trace], again: Again | None = None) -> list[Tabular]:
    """Return a table for each group of channels, with a line for each run and a column for each
    metric.

    Scores that differ from those of the same runs `again` are marked, with the smallest and the
    largest value.
    """
    style.traces_of_one_plant(list(traces.values()))
    scenario = next(iter(traces.values())).scenario
    values = _several(metric_scores, traces, again)
    tables = []
    for group, heading in headings(scenario).items():
        units = {}
        for metric in metrics():
            if metric.applies_to(group):
                units[metric.name] = metric.unit_for(group.unit, group.effort)
        names = []
        heads = []
        for name in SCORES:
            if name in units:
                names.append(name)
                heads.append(_head(CATALOGUE[name].label, units[name]))
        rows: dict[str, list[Cell]] = {}
        for label, runs in values.items():
            least = {}
            for name in units:
                least[name] = floor(traces[label].scenario, name)
            rows[label] = []
            for name in names:
                of_runs: list[Any] = [run and run[group.name][name] for run in runs]
                rows[label].append(_marked(of_runs, traces[label].scenario, least[name]))
        tables.append(_by_label(", ".join(filter(None, (title, heading))), heads, traces, rows))
    gains = {}
    for label, trace in traces.items():
        gains[label] = [trace.scenario.law.source]
    return _noted(tables, in_words(gains))


def _head(head: str, unit: str) -> str:
    """Return a column's heading with its unit."""
    return f"{head} ({unit})" if unit else head


def _noted(tables: list[Tabular], *words: str) -> list[Tabular]:
    """Return tables with words below the last one, and what a mark means if a cell has one."""
    notes = list(filter(None, words))
    if any(MARK in cell.text for table in tables for row in table.rows for cell in _cells(row)):
        notes.append(SCORE_NOTE)
    if tables and notes:
        tables[-1] = dataclasses.replace(tables[-1], notes=["; ".join(notes)])
    return tables


def _cells(row: Sequence[Cell | str]) -> list[Cell]:
    """Return the cells of a row that are no plain texts."""
    return [cell for cell in row if isinstance(cell, Cell)]


def _several(
    scored: Callable[[Trace], T], traces: Mapping[str, Trace], again: Again | None
) -> dict[str, list[T | None]]:
    """Return label -> scores of a run and of its repetitions, None for one that failed; no label of
    which all did.
    """
    values = {}
    for label, trace in traces.items():
        of_runs = _of_runs(scored, (trace, *(again or {}).get(label, ())))
        if any(of_runs):
            values[label] = of_runs
    return values


def _of_runs(scored: Callable[[Trace], T], runs: Iterable[Trace]) -> list[T | None]:
    """Return what is scored of each run, None for one that failed."""
    scores = []
    for run in runs:
        if run.diverged_at is None:
            scores.append(scored(run))
        else:
            scores.append(None)
    return scores


def _marked(values: Sequence[float | None], scenario: Scenario, least: float = 0.0) -> Cell:
    """Return a number as text; with its range, marked, if its values in the same run again are
    apart.

    None is a run that failed, which counts as the largest value.
    """

    def size(value: float | None) -> float:
        if value is None:
            return math.inf
        return -math.inf if math.isnan(value) else value

    texts = {}
    for value in values:
        if value is None:
            texts[value] = FAILED.text
        else:
            texts[value] = number(value)
    low = texts[min(values, key=size)]
    high = texts[max(values, key=size)]
    numbers = [math.inf if value is None else value for value in values]
    if low != high and differ(numbers, least, first_order(scenario)):
        return Cell(f"{low}{MARK} (..{high})")
    return FAILED if values[0] is None else Cell(texts[values[0]])


def tips(title: str, traces: Mapping[str, Trace], again: Again | None = None) -> list[Tabular]:
    """Return a table of the tips of arms, with scores marked as in `scores`; [] elsewhere."""
    if not next(iter(traces.values())).scenario.plant.tip:
        return []
    values = _several(tip_scores, traces, again)
    measured = set().union(*filter(None, chain.from_iterable(values.values())))
    columns = []
    heads = []
    for head, (name, unit, factor) in TIP_COLUMNS.items():
        if name in measured:
            columns.append((name, factor))
            heads.append(_head(head, unit))
    rows: dict[str, list[Cell]] = {}
    for label, runs in values.items():
        rows[label] = []
        for name, factor in columns:
            of_runs: list[Any] = [run and factor * run.get(name, math.nan) for run in runs]
            rows[label].append(_marked(of_runs, traces[label].scenario))
    return _noted([_by_label(f"{title}, tip", heads, traces, rows)])


def headings(scenario: Scenario) -> dict[ChannelGroup, str]:
    """Return group of channels -> heading that names its joints; "" for an only group."""
    of_plant = groups(scenario)
    if len(of_plant) == 1:
        return {of_plant[0]: ""}
    names = channel_names(scenario.plant)
    titles = {}
    for group in of_plant:
        n = len(group.channels)
        if n <= MAX_NAMED_JOINTS:
            listed = ", ".join(names[i] for i in group.channels)
        else:
            listed = f"{n} joints"
        titles[group] = f"{'driven' if group.driven else 'free'}: {listed} ({group.unit})"
    return titles


def answers(
    names: Sequence[str],
    traces: Mapping[str, Mapping[str, Trace]],
    again: Mapping[str, Again] | None = None,
) -> list[Tabular]:
    """Return a table for each metric that applies, or one table of them all if there is only one
    condition.
    """
    scenarios = {}
    for runs in traces.values():
        for trace in runs.values():
            scenarios[trace.scenario.plant, trace.scenario.efforts] = trace.scenario
    columns = {}
    for metric in map(CATALOGUE.__getitem__, names):
        if not all(map(metric.refusal, scenarios.values())):
            units = {}
            for plant, efforts in scenarios:
                units[metric.unit_for(plant.unit, efforts[0])] = None
            of_metric = []
            for condition, runs in traces.items():
                of_metric.append((condition, metric, runs, (again or {}).get(condition, {})))
            columns[f"{metric.name} ({' or '.join(units)})"] = of_metric
    if len(traces) == 1:
        joined = []
        for head, (column,) in columns.items():
            joined.append((head, *column[1:]))
        columns = {"": joined}
    answered = []
    for head, of_metric in columns.items():
        answered.append(_answer(head, of_metric))
    return _noted(answered)


def _answer(
    title: str, columns: Sequence[tuple[str, Metric, Mapping[str, Trace], Again]]
) -> Tabular:
    """Return a table with a line for every label; each column has a heading, a metric and labelled
    runs, also again.
    """
    traces: dict[str, Trace] = {}
    for _, _, runs, _ in columns:
        traces |= runs
    rows = {}
    for label in traces:
        cells = []
        for _, metric, runs, again in columns:
            cells.append(_cell(metric, runs.get(label), again.get(label, ())))
        rows[label] = cells
    return _by_label(title, [head for head, *_ in columns], traces, rows)


def _cell(metric: Metric, trace: Trace | None, again: Sequence[Trace] = ()) -> Cell | str:
    """Return a metric of a run as text; "" if there is no run, or if the metric does not apply to
    its plant.
    """
    if trace is None or metric.refusal(trace.scenario):
        return ""
    values = _of_runs(metric.of, (trace, *again))
    return _marked(values, trace.scenario, floor(trace.scenario, metric.name))


def _by_label(
    title: str,
    heads: Iterable[str],
    traces: Mapping[str, Trace],
    rows: Mapping[str, Iterable[Cell | str]],
) -> Tabular:
    """Return a table with a row of cells for each labelled run, or "failed"."""
    laws = {trace.scenario.law.name for trace in traces.values()}
    # labels of runs of one law say what differs
    head = "run" if len(laws) == 1 < len(traces) else "law"
    heads = [head, *heads]
    lines = []
    for label, trace in traces.items():
        name = Cell(label, colour=style.law_colour(trace.scenario.law.name))
        cells = [*rows.get(label, [FAILED])]
        lines.append([name, *cells, *[""] * (len(heads) - 1 - len(cells))])
    return Tabular(headings=heads, rows=lines, title=title)


def trace_summary(trace: Trace) -> list[Listing]:
    """Return a table for each group of channels: every metric of one trace, with its unit and its
    meaning.
    """
    values = metric_scores(trace)
    tables = []
    for group, heading in headings(trace.scenario).items():
        rows = []
        for m in metrics():
            if m.name in values[group.name] and (trace.scenario.realistic or not m.realistic):
                value = number(values[group.name][m.name])
                unit = m.unit_for(group.unit, group.effort)
                rows.append((m.name, value, unit, m.summary))
        heads = "metric", "value", "unit", ""
        tables.append(Listing(headings=heads, rows=rows, title=heading))
    return tables


def document(printed: Iterable[Any]) -> dict[str, Any]:
    """Return what a command printed as JSON data: tables, with numbers as numbers, and notes."""
    tables: list[Tabular] = []
    notes: list[str] = []
    for printable in printed:
        if isinstance(printable, Tabular):
            tables.append(printable)
        elif isinstance(printable, Tables):
            tables += printable.tables
            if isinstance(printable, Answer):
                notes += printable.lines
        else:
            content = printable.renderable if isinstance(printable, Padding) else printable
            notes += filter(None, [str(content)])
    return {"tables": [table.about() for table in tables], "notes": notes}


def catalogue(title: str, rows: Iterable[tuple[str, str]]) -> Listing:
    """Return a table of names, each with a line about it."""
    return Listing(headings=("", ""), rows=list(rows), title=title)


def listed(known: Catalogue[T], doc: Callable[[T], str | None]) -> list[tuple[str, str]]:
    """Return the name of every entry, with what its docstring begins with, and its package."""
    rows = []
    for name, entry in known.items():
        # some end with a colon, because a formula follows
        about = first_paragraph(doc(entry)).rstrip(":")
        rows.append((name, with_package(about, known.package(name))))
    return rows


def with_package(line: str, package: str) -> str:
    """Return the line about an entry, with the name of its package in brackets; "" stands for this
    package.
    """
    return f"{line} [{package}]" if package else line


# chattering


def chattering(
    scenarios: Sequence[Scenario],
    channel: int,
    cycles: Sequence[Chattering],
    measured: Sequence[tuple[float, float]],
    changes: Sequence[StepChange],
) -> Tabular:
    """Return predicted and measured limit cycles of a channel (amplitude of s, Hz), a line for each
    scenario.
    """
    plant = scenarios[0].plant
    last = "coupling" if plant.driven > 1 else "third harmonic"
    unit = f"{plant.units[channel]}/s"
    heads = [f"s predicted ({unit})", f"s measured ({unit})"]
    heads = ["law", *heads, "predicted (Hz)", "measured (Hz)", "±", last]
    rows = []
    for scenario, cycle, (amplitude, frequency), change in zip(
        scenarios, cycles, measured, changes, strict=True
    ):
        law = Cell(scenario.law.name, colour=style.law_colour(scenario.law.name))
        mark = MARK if change.marked else ""
        sizes = number(cycle.amplitude), number(amplitude) + mark
        rates = number(cycle.frequency), number(frequency) + mark
        share = cycle.coupling if plant.driven > 1 else cycle.third_harmonic
        off = "irregular" if cycle.uncertainty > 1.0 else _share(cycle.uncertainty)
        rows.append((law, *sizes, *rates, off, _share(share)))
    notes = [NOTE] if any(change.marked for change in changes) else []
    return Tabular(headings=heads, rows=rows, title=f"chattering of {plant.name}", notes=notes)


def _share(share: float) -> str:
    """Return a share in percent; "" for NaN."""
    if math.isnan(share):
        return ""
    return f"{100 * share:.0f} %" if share <= 1.0 else "> 100 %"
