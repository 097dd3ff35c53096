"""Tables of the command line: scores, margins, chattering."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, TypeVar

from rich import box
from rich.padding import Padding
from rich.table import Column, Table
from rich.text import Text

from smc_mujoco.analysis.differ import differ
from smc_mujoco.analysis.paired_runs import floor
from smc_mujoco.analysis.step_halving import MARK, NOTE, SCORE_NOTE, first_order
from smc_mujoco.answers.answer import Answer
from smc_mujoco.common.registry import Catalogue
from smc_mujoco.common.tabular import Tables, Tabular
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
    "largest\nerror": ("max_error", "mm", 1e3),
    "error at\nthe end": ("last_error", "mm", 1e3),
    "mean\nforce": ("mean_force", "N", 1.0),
    "off the\nwanted": ("force_error", "%", 1.0),
    "force\nvaries by": ("force_ripple", "N", 1.0),
    "touching": ("touching", "%", 1.0),
    "deepest": ("depth", "mm", 1e3),
}

# Columns of a table of scores: heading -> metric.
SCORE_COLUMNS = {
    "settles": "settling_time",
    "overshoot": "overshoot",
    "ultimate\nbound": "ultimate_bound",
    "ITAE": "itae",
    "max |u|": "max_u",
    "TV rate": "tv_rate",
    "spread\nsettles": "spread_settling_time",
}
FAILED = Text("failed", style="red")
MAX_NAMED_JOINTS = 4  # in the heading of a group


def titled(title: str, *columns: Column | str, **options: Any) -> Table:
    """Return an empty table with a title at its left, and a rule below its headings."""
    options = {"box": box.SIMPLE_HEAD, "title_justify": "left", "title_style": "bold"} | options
    return Table(*columns, title=title or None, **options)


def plain(*columns: Column | str, **options: Any) -> Table:
    """Return an empty table without rules or headings, with columns two spaces apart."""
    return Table(
        *columns,
        **{"box": None, "padding": (0, 2, 0, 0), "pad_edge": False, "show_header": False} | options,
    )


# scores of runs


def scores(title: str, traces: Mapping[str, Trace], again: Again | None = None) -> list[Table]:
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
        for head, name in SCORE_COLUMNS.items():
            if name in units:
                names.append(name)
                heads.append(_head(head, units[name]))
        rows: dict[str, list[Text]] = {}
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


def _head(head: str, unit: str) -> Text:
    """Return a column's heading with the unit below."""
    return Text(f"{head}\n").append(unit, "dim")


def _noted(tables: list[Table], *words: str) -> list[Table]:
    """Return tables with words below the last one, and what a mark means if a cell has one."""
    notes = list(filter(None, words))
    if any(map(_has_mark, tables)):
        notes.append(SCORE_NOTE)
    if tables and notes:
        tables[-1].caption = "; ".join(notes)
        tables[-1].caption_justify = "left"
    return tables


def _has_mark(table: Table) -> bool:
    """Return whether a cell of a table has a mark."""
    for column in table.columns:
        for cell in column.cells:
            if MARK in str(cell):
                return True
    return False


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


def _marked(values: Sequence[float | None], scenario: Scenario, least: float = 0.0) -> Text:
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
            texts[value] = FAILED.plain
        else:
            texts[value] = number(value)
    low = texts[min(values, key=size)]
    high = texts[max(values, key=size)]
    numbers = [math.inf if value is None else value for value in values]
    if low != high and differ(numbers, least, first_order(scenario)):
        return Text(f"{low}{MARK} (..{high})")
    return FAILED if values[0] is None else Text(texts[values[0]])


def tips(title: str, traces: Mapping[str, Trace], again: Again | None = None) -> list[Table]:
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
    rows: dict[str, list[Text]] = {}
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
) -> list[Table]:
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


def _answer(title: str, columns: Sequence[tuple[str, Metric, Mapping[str, Trace], Again]]) -> Table:
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
    table = _by_label(title, [Text(head) for head, *_ in columns], traces, rows, 30)
    table.min_width = len(title)  # a narrower table would break the title
    return table


def _cell(metric: Metric, trace: Trace | None, again: Sequence[Trace] = ()) -> Text | str:
    """Return a metric of a run as text; "" if there is no run, or if the metric does not apply to
    its plant.
    """
    if trace is None or metric.refusal(trace.scenario):
        return ""
    values = _of_runs(metric.of, (trace, *again))
    return _marked(values, trace.scenario, floor(trace.scenario, metric.name))


def number_columns(heads: Iterable[Text | str], **options: Any) -> list[Column]:
    """Return the columns of numbers of a table, with other options of `Column`."""
    return [Column(head, justify="right", **options) for head in heads]


def _by_label(
    title: str,
    heads: Iterable[Text],
    traces: Mapping[str, Trace],
    rows: Mapping[str, Iterable[Text | str]],
    width: int = 16,
) -> Table:
    """Return a table with a row of cells for each labelled run, or "failed"; labels have up to
    `width` letters.
    """
    laws = {trace.scenario.law.name for trace in traces.values()}
    # labels of runs of one law say what differs
    head = "run" if len(laws) == 1 < len(traces) else "law"
    label = Column(head, no_wrap=True, vertical="bottom", max_width=width, overflow="ellipsis")
    numbers = number_columns(heads, vertical="bottom")
    table = titled(title, label, *numbers, padding=0, show_edge=False, pad_edge=False)
    for label, trace in traces.items():
        table.add_row(
            Text(label, style.law_colour(trace.scenario.law.name)), *rows.get(label, [FAILED])
        )
    return table


def trace_summary(trace: Trace) -> list[Table]:
    """Return a table for each group of channels: every metric of one trace, with its unit and its
    meaning.
    """
    values = metric_scores(trace)
    tables = []
    for group, heading in headings(trace.scenario).items():
        table = titled(
            heading,
            "metric",
            Column("value", justify="right"),
            "unit",
            "",
            box=None,
            padding=(0, 2, 0, 0),
        )
        for m in metrics():
            if m.name in values[group.name] and (trace.scenario.realistic or not m.realistic):
                value = number(values[group.name][m.name])
                unit = m.unit_for(group.unit, group.effort)
                table.add_row(m.name, value, unit, Text(m.summary))
        tables.append(table)
    return tables


def document(printed: Iterable[Any]) -> dict[str, Any]:
    """Return what a command printed as JSON data: tables, with numbers as numbers, and notes."""
    tables: list[Tabular] = []
    notes: list[str] = []
    for printable in printed:
        content = printable.renderable if isinstance(printable, Padding) else printable
        if isinstance(content, Table):
            tables.append(_tabular(content))
        elif isinstance(content, Tabular):
            tables.append(content)
        elif isinstance(content, Tables):
            tables += content.tables
            if isinstance(content, Answer):
                notes += content.lines
        elif str(content):
            notes.append(str(content))
    return {"tables": [table.about() for table in tables], "notes": notes}


def _tabular(table: Table) -> Tabular:
    """Return the texts of a table of rich."""
    heads = []
    for column in table.columns:
        heads.append(" ".join(str(column.header).split()))
    rows = zip(*(map(str, column.cells) for column in table.columns), strict=True)
    notes = [str(table.caption)] if table.caption else []
    return Tabular(headings=heads, rows=list(rows), title=str(table.title or ""), notes=notes)


def catalogue(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    """Return a table of names, each with a line about it."""
    table = titled(
        title, Column(no_wrap=True, style="cyan"), "", show_header=False, box=None, padding=(0, 2)
    )
    for row in rows:
        table.add_row(*map(Text, row))
    return table


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
) -> Table:
    """Return predicted and measured limit cycles of a channel (amplitude of s, Hz), a line for each
    scenario.
    """
    plant = scenarios[0].plant
    last = "coupling" if plant.driven > 1 else "third\nharmonic"
    heads = [f"s ({plant.units[channel]}/s)\npredicted", "\nmeasured"]
    heads += ["Hz\npredicted", "\nmeasured", "±", last]
    numbers = number_columns(heads, no_wrap=True, vertical="bottom")
    law = Column("law", no_wrap=True, vertical="bottom")
    about = f"chattering of {plant.name}"
    table = titled(about, law, *numbers, padding=(0, 1, 0, 0), show_edge=False, pad_edge=False)
    for scenario, cycle, (amplitude, frequency), change in zip(
        scenarios, cycles, measured, changes, strict=True
    ):
        law = Text(scenario.law.name, style=style.law_colour(scenario.law.name))
        mark = MARK if change.marked else ""
        sizes = number(cycle.amplitude), number(amplitude) + mark
        rates = number(cycle.frequency), number(frequency) + mark
        share = cycle.coupling if plant.driven > 1 else cycle.third_harmonic
        table.add_row(law, *sizes, *rates, _share(cycle.uncertainty), _share(share))
    if any(change.marked for change in changes):
        table.caption = NOTE
        table.caption_justify = "left"
    return table


def _share(share: float) -> str:
    """Return a share in percent; "" for NaN."""
    if math.isnan(share):
        return ""
    return f"{100 * share:.0f} %" if share <= 1.0 else "> 100 %"
