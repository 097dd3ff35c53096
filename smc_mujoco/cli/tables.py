"""Tables of the command line: scores, margins."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import chain
from typing import Any, NamedTuple, TypeVar

import numpy as np
from rich.padding import Padding

from smc_mujoco.analysis.differ import differ
from smc_mujoco.analysis.paired_runs import floor
from smc_mujoco.analysis.step_halving import MARK, SCORE_NOTE, first_order
from smc_mujoco.answers.answer import Answer
from smc_mujoco.common.registry import Catalogue
from smc_mujoco.common.tabular import Cell, Tables, Tabular, as_cell
from smc_mujoco.common.text import first_paragraph, number
from smc_mujoco.control.source import in_words
from smc_mujoco.draw import colouring, shared_axes
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.metrics.catalogue import scores as metric_scores
from smc_mujoco.metrics.conventions import CATALOGUE, ChannelGroup, groups
from smc_mujoco.metrics.tip import tip_scores
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

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
MAX_NAMED_JOINTS = 4  # in the heading of a group


# scores of runs


class ScoreColumn(NamedTuple):
    """A column of scores of labelled runs."""

    heading: str
    runs: Mapping[str, Sequence[Trace]]  # label -> a run, and the same run again
    score: Callable[[Trace], float]
    least: Callable[[Scenario], float] = lambda scenario: 0.0  # what matters


def scores(title: str, traces: Mapping[str, Trace], again: Again | None = None) -> list[Tabular]:
    """Return a table for each group of channels, with a line for each run and a column for each
    metric.

    Scores that differ from those of the same runs `again` are marked, with the smallest and the
    largest value.
    """
    shared_axes.traces_of_one_plant(list(traces.values()))
    scenario = next(iter(traces.values())).scenario
    runs = _repeated(traces, again)
    scored = functools.cache(metric_scores)
    tables = []
    for group, heading in headings(scenario).items():
        columns = []
        for name in SCORES:
            metric = CATALOGUE[name]
            if metric in metrics() and metric.applies_to(group):
                columns.append(
                    ScoreColumn(
                        heading=metric.heading(group.unit, group.effort),
                        runs=runs,
                        score=lambda run, of=group.name, name=name: scored(run)[of][name],
                        least=partial(floor, metric=name),
                    )
                )
        tables.append(_table(", ".join(filter(None, (title, heading))), columns, traces))
    gains = {label: [trace.scenario.law.source] for label, trace in traces.items()}
    return _noted(tables, in_words(gains))


def tips(title: str, traces: Mapping[str, Trace], again: Again | None = None) -> list[Tabular]:
    """Return a table of the tips of arms, with scores marked as in `scores`; [] elsewhere."""
    if not next(iter(traces.values())).scenario.plant.tip:
        return []
    runs = _repeated(traces, again)
    scored = functools.cache(tip_scores)
    ended = [run for run in chain.from_iterable(runs.values()) if run.diverged_at is None]
    measured = set().union(*map(scored, ended))
    columns = []
    for head, (name, unit, factor) in TIP_COLUMNS.items():
        if name in measured:
            columns.append(
                ScoreColumn(
                    f"{head} ({unit})",
                    runs,
                    lambda run, name=name, by=factor: by * scored(run).get(name, math.nan),
                )
            )
    return _noted([_table(f"{title}, tip", columns, traces)])


def answers(
    names: Sequence[str],
    traces: Mapping[str, Mapping[str, Trace]],
    again: Mapping[str, Again] | None = None,
) -> list[Tabular]:
    """Return a table for each metric that applies, or one table of them all if there is only one
    condition.
    """
    labelled = dict(chain.from_iterable(runs.items() for runs in traces.values()))
    scenarios = [trace.scenario for runs in traces.values() for trace in runs.values()]
    tables: dict[str, list[ScoreColumn]] = {}
    for metric in map(CATALOGUE.__getitem__, names):
        if all(map(metric.refusal, scenarios)):
            continue
        units = dict.fromkeys(metric.unit_for(s.plant.unit, s.efforts[0]) for s in scenarios)
        about = f"{metric.name} ({' or '.join(units)})"
        for condition, of_condition in traces.items():
            suited = {k: run for k, run in of_condition.items() if not metric.refusal(run.scenario)}
            runs = _repeated(suited, (again or {}).get(condition))
            title, head = (about, condition) if len(traces) > 1 else ("", about)
            column = ScoreColumn(head, runs, metric.of, partial(floor, metric=metric.name))
            tables.setdefault(title, []).append(column)
    return _noted([_table(title, columns, labelled) for title, columns in tables.items()])


def _repeated(traces: Mapping[str, Trace], again: Again | None) -> dict[str, list[Trace]]:
    """Return label -> a run, and the same run again."""
    return {label: [trace, *(again or {}).get(label, ())] for label, trace in traces.items()}


def _table(title: str, columns: Sequence[ScoreColumn], traces: Mapping[str, Trace]) -> Tabular:
    """Return a table with a row for each labelled run."""
    laws = {trace.scenario.law.name for trace in traces.values()}
    # labels of runs of one law say what differs
    head = "run" if len(laws) == 1 < len(traces) else "law"
    rows = []
    for label, trace in traces.items():
        name = Cell(label, colour=colouring.law_colour(trace.scenario.law.name))
        rows.append([name, *(_cell(column, label) for column in columns)])
    heads = [head, *(column.heading for column in columns)]
    return Tabular(headings=heads, rows=rows, title=title)


def _cell(column: ScoreColumn, label: str) -> Cell | str:
    """Return the score of a run; with its range, marked, if those of the same run again are apart;
    "" where the column has no such run.

    A run that failed counts as the largest value, and one without the score as the smallest.
    """
    runs = column.runs.get(label)
    if not runs:
        return ""
    texts = []
    numbers = []
    for run in runs:
        failed = run.diverged_at is not None
        numbers.append(math.inf if failed else column.score(run))
        texts.append("failed" if failed else number(numbers[-1]))
    order = sorted(range(len(runs)), key=lambda i: np.nan_to_num(numbers[i], nan=-math.inf))
    low, high = texts[order[0]], texts[order[-1]]
    scenario = runs[0].scenario
    if low != high and differ(numbers, column.least(scenario), first_order(scenario)):
        return Cell(f"{low}{MARK} (..{high})")
    return Cell(texts[0], colour="red" if texts[0] == "failed" else "")


def _noted(tables: list[Tabular], *words: str) -> list[Tabular]:
    """Return tables with words below the last one, and what a mark means if a cell has one."""
    notes = list(filter(None, words))
    cells = chain.from_iterable(chain.from_iterable(table.rows for table in tables))
    if any(MARK in as_cell(cell).text for cell in cells):
        notes.append(SCORE_NOTE)
    if tables and notes:
        tables[-1] = dataclasses.replace(tables[-1], notes=["; ".join(notes)])
    return tables


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


def trace_summary(trace: Trace) -> list[Tabular]:
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
        heads = "metric", "value", "unit", "meaning"
        tables.append(Tabular(headings=heads, rows=rows, title=heading, name_columns=4))
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


def listed(known: Catalogue[T], doc: Callable[[T], str | None]) -> dict[str, str]:
    """Return the name of every entry -> what its docstring begins with, and its package."""
    rows = {}
    for name, entry in known.items():
        # some end with a colon, because a formula follows
        about = first_paragraph(doc(entry)).rstrip(":")
        rows[name] = with_package(about, known.package(name))
    return rows


def with_package(line: str, package: str) -> str:
    """Return the line about an entry, with the name of its package in brackets; "" stands for this
    package.
    """
    return f"{line} [{package}]" if package else line
