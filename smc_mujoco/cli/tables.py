"""Every table that the command line prints: scores, answers, traces, leaderboards, margins, tunings, claims."""

import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from smc_mujoco.analysis.margins import Margin
from smc_mujoco.analysis.paired_runs import SETTLES
from smc_mujoco.analysis.tuning.result import Tuned
from smc_mujoco.common.text import number
from smc_mujoco.draw import style
from smc_mujoco.mechanisms.hardware.part import joints
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.metrics.catalogue import scores as metric_scores
from smc_mujoco.metrics.channel_groups import Group, groups
from smc_mujoco.metrics.conventions import Metric
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.leaderboard import Block, Board
from smc_mujoco.studies.paper.claims.verdict import (
    MARKS,
    NOT_TESTABLE,
    PARTLY,
    REFUTED,
    SUPPORTED,
    VERDICTS,
    Check,
    Claim,
)

# Columns of a table of scores: heading -> metric.
SHOWN = {
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
SPARKS = "▁▂▃▄▅▆▇█"
BOARD_KEY = (
    "median, #place, {level:.3g} % interval over seeds; * undefeated: no law is better in any condition; a winner is "
    "better than every other law: its median is lower by more than 3 %, and the seeds bear it out; over several "
    "conditions: median of their medians, place by mean rank, won and lost under how many, and a winner wins under "
    "each; x, u of driven joints, in rad or m, N m or N"
)
NARROW = 6  # runs, with fewer of which no interval of a median covers 95 %, see `analysis.bootstrap`
# Verdicts have a colour beside their mark, from a palette for the colour-blind.
COLOURS = {SUPPORTED: "blue", PARTLY: "yellow", REFUTED: "red", NOT_TESTABLE: "dim"}


def titled(title: str, *columns: str, **options: Any) -> Table:
    """Return an empty table with a title at its left, and a rule below the headings of its columns."""
    options = {"box": box.SIMPLE_HEAD, "title_justify": "left", "title_style": "bold"} | options
    return Table(*columns, title=title or None, **options)


def plain(**options: Any) -> Table:
    """Return an empty table without rules, whose columns are two spaces apart."""
    return Table(**{"box": None, "padding": (0, 2, 0, 0), "pad_edge": False, "show_header": False} | options)


# scores of runs


def scores(title: str, traces: Mapping[str, Trace]) -> list[Table]:
    """Return a table for each group of channels: a line for each run, a column for each metric.

    Titles name the groups where there are several.
    """
    style.same_plant(list(traces.values()))
    plant = next(iter(traces.values())).scenario.plant
    values = {label: metric_scores(trace) for label, trace in traces.items() if trace.diverged_at is None}
    tables = []
    for group, heading in headings(plant).items():
        fit = {m.name: m.unit_for(group.unit) for m in metrics() if m.fits(group)}
        shown = {head: name for head, name in SHOWN.items() if name in fit}
        table = _by_label(", ".join(filter(None, (title, heading))))
        for head, name in shown.items():
            table.add_column(f"{head}\n[dim]{fit[name]}[/]", justify="right", no_wrap=True, vertical="bottom")
        for label, trace in traces.items():
            told = [number(values[label][group.name][name]) for name in shown.values()] if label in values else [FAILED]
            table.add_row(_label(label, trace), *told)
        tables.append(table)
    return tables


def headings(plant: Plant) -> dict[Group, str]:
    """Return the plant's groups of channels, with a heading that names their joints; a single group has none."""
    found = groups(plant)
    if len(found) == 1:
        return {found[0]: ""}
    names = [joint.name for joint in joints(plant.spec())]
    return {group: _heading(group, [names[i] for i in group.channels]) for group in found}


def _heading(group: Group, names: Sequence[str]) -> str:
    kind = "driven" if group.driven else "free"
    each = ", ".join(names) if len(names) <= MAX_NAMED_JOINTS else f"{len(names)} joints"
    return f"{kind}: {each} ({group.unit})"


def answers(names: Sequence[str], traces: Mapping[str, Mapping[str, Trace]]) -> list[Table]:
    """Return the tables of some metrics of condition -> label -> trace.

    There is a table for each metric, with a line for each label and a column for each condition. A single condition
    has one table, with a column for each metric. Metrics that no plant has a value of are left out.
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
    """Return a table with a line for every label; each column is a metric of labelled runs."""
    table = _by_label(title, width=30)
    table.min_width = len(title)  # which would be broken over a narrower table
    for head in heads:
        table.add_column(Text(head), justify="right", vertical="bottom")
    lines = {label: trace for _, runs in reversed(columns) for label, trace in runs.items()}
    for label in dict.fromkeys(label for _, runs in columns for label in runs):
        table.add_row(_label(label, lines[label]), *(_cell(metric, runs.get(label)) for metric, runs in columns))
    return table


def _cell(metric: Metric, trace: Trace | None) -> Text | str:
    """Return a metric of a run as text: "" where there is no run, or the metric is not for its plant."""
    if trace is None or metric.refusal(trace.scenario.plant):
        return ""
    return FAILED if trace.diverged_at is not None else number(metric.of(trace))


def _by_label(title: str, width: int = 16) -> Table:
    """Return an empty table whose lines begin with a label, shown up to a width."""
    table = titled(title, padding=0, show_edge=False, pad_edge=False)
    table.add_column("law", no_wrap=True, vertical="bottom", max_width=width, overflow="ellipsis")
    return table


def _label(label: str, trace: Trace) -> Text:
    return Text(label, style=style.law_colour(trace.scenario.law.name))


def trace_summary(trace: Trace) -> list[Table]:
    """Return a table for each group of channels: every metric of one trace, with its unit and its meaning.

    Metrics of realistic parts are there where the scenario has such parts.
    """
    values, tables = metric_scores(trace), []
    for group, heading in headings(trace.scenario.plant).items():
        table = titled(heading, box=None, padding=(0, 2, 0, 0))
        for head in ("metric", "value", "unit", ""):
            table.add_column(head, justify="right" if head == "value" else "left")
        for m in metrics():
            if m.name in values[group.name] and (trace.scenario.realistic or not m.realistic):
                told = number(values[group.name][m.name])
                table.add_row(m.name, told, m.unit_for(group.unit), Text(m.summary))
        tables.append(table)
    return tables


def spark(values: Sequence[float] | np.ndarray, width: int = 60) -> str:
    """Return a line of block characters that rise and fall with the values."""
    y = np.asarray(values, float)
    y = y[np.linspace(0, len(y) - 1, min(width, len(y))).astype(int)]
    finite = y[np.isfinite(y)]
    low, high = (finite.min(), finite.max()) if len(finite) else (0.0, 0.0)
    level = (y - low) / ((high - low) or 1.0) * (len(SPARKS) - 1)
    return "".join(SPARKS[round(v)] if np.isfinite(v) else " " for v in level)


def catalogue(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    """Return a table of names, each with a line about it."""
    table = titled(title, show_header=False, box=None, padding=(0, 2))
    table.add_column(no_wrap=True)
    table.add_column()
    for name, about in rows:
        table.add_row(Text(name, style="cyan"), Text(about))
    return table


# leaderboards


def leaderboard(boards: Sequence[Board]) -> Table:
    """Return a table of boards: a part for each group, a line for each law, a column for each metric."""
    metrics = {board.metric: board.unit for board in boards}
    table = Table(box=box.SIMPLE_HEAD, padding=0, pad_edge=False, show_edge=False)  # the box keeps columns apart
    lines = max((metric.count("_") for metric in metrics), default=0)
    table.add_column("law", no_wrap=True, min_width=0 if boards else 30)
    for metric, unit in metrics.items():
        head = Text("\n" * (lines - metric.count("_")) + metric.replace("_", "\n"))
        head.append(f"\n{unit.format(x='x', u='u') or '%'}", "dim not bold")
        table.add_column(head, justify="right", overflow="fold")  # no digit is cut off
    for group in dict.fromkeys(tuple(board.group.items()) for board in boards):
        own = {board.metric: board for board in boards if tuple(board.group.items()) == group}
        shown = [own.get(metric) for metric in metrics]
        for line in _group_lines("\n".join(_folded(name) for _, name in group) or "all", own, shown):
            table.add_row(*line)
        table.add_section()
    table.caption = BOARD_KEY.format(level=100 * boards[0].level) if boards else "no boards: no metric applies"
    if any(block.runs < NARROW for board in boards for block in board.blocks):
        table.caption += f"; of fewer than {NARROW} runs an interval is their range, and covers less"
    table.caption_justify = "left"
    return table


def _group_lines(name: str, own: Mapping[str, Board], shown: Sequence[Board | None]) -> Iterator[list[Text]]:
    """Yield a group's lines: the winner in each block if there are several, then every law, and the winner overall."""
    largest = max(own.values(), key=lambda board: len(board.blocks))
    several = len(largest.blocks) > 1
    only = "" if several else _folded(largest.name(largest.blocks[0])) + "\n"
    runs = f"{largest.cells} run{'s' * (largest.cells != 1)},\n{_sample(largest.blocks)}"
    yield [Text(f"{name}\n", "bold").append(only, "italic not bold").append(runs, "dim not bold")]
    for block in largest.blocks if several else ():
        at = block.plant, block.condition
        blocks = [
            next((b for b in board.blocks if (b.plant, b.condition) == at), None) if board else None for board in shown
        ]
        size = f"\n{_folded(block.sample, 15)}" if block.runs < block.seeds else ""
        head = Text(_folded(largest.name(block)), "italic").append(size, "dim not italic")
        yield [head, *(_block_cell(board, b) for board, b in zip(shown, blocks, strict=True))]
    if several:
        yield [Text(f"\nall {len(largest.blocks)}\n{largest.kind}", "dim")]
    for law in sorted({entry.law for board in own.values() for entry in board.entries}):
        yield [Text(_folded(law), style.law_colour(law)), *(_law_cell(board, law) for board in shown)]
    yield [Text(""), *(_winner_cell(board) for board in shown)]


def _sample(blocks: Sequence[Block]) -> str:
    """Return the sample of the blocks in words, or the most seeds where samples differ."""
    samples = {_folded(block.sample, 15) for block in blocks}
    return samples.pop() if len(samples) == 1 else f"{max(block.seeds for block in blocks)} seeds"


def _block_cell(board: Board | None, block: Block | None) -> Text:
    """Return the winner of a block, with its median and the next one; or how many laws are level."""
    if board is None or block is None:
        return Text("")
    medians = block.medians
    if board.metric == SETTLES:
        medians = {law: 1 - share for law, share in medians.items()}
    if block.winner is None:
        return Text("too few" if board.too_few else f"{len(block.best)} level", "dim")
    first, second = sorted(block.medians, key=block.medians.__getitem__)[:2]
    told = (">" if board.metric == SETTLES else "<").join(
        _median(medians[law], board.metric, digits=2) for law in (first, second)
    )
    return Text(_folded(first, 12), style.law_colour(first)).append(f"\n{told}", "dim")


def _folded(name: str, width: int = 13) -> str:
    """Return a name on several lines, broken after underscores."""
    return "\n".join(line.replace("_ ", "_") for line in textwrap.wrap(name.replace("_", "_ "), width))


def _law_cell(board: Board | None, law: str) -> Text:
    """Return a law's median, place and interval."""
    entry = next((e for e in board.entries if e.law == law), None) if board else None
    if board is None or entry is None:
        return Text("")
    middle = _median(entry.interval.median, board.metric)
    low, high = (_median(value, board.metric, digits=2) for value in entry.interval[1:3])
    text = Text(f"{middle} " if middle else "", "bold" if entry.rank.best else "")
    text.append(f"#{entry.rank.place:g}").append("*" if entry.rank.best else " ")
    return text.append(f"\n{low}–{high}" if low else "", "dim not bold")


def _median(value: float, metric: str, digits: int = 3) -> str:
    if math.isnan(value):
        return ""
    return f"{100 * value:.0f}" if metric == SETTLES else number(value, digits)


def _winner_cell(board: Board | None) -> Text:
    """Return the winner of a board, or what each law has won and lost."""
    if board is None:
        return Text("")
    if board.winner:
        return Text("winner\n").append(_folded(board.winner, 12), f"bold {style.law_colour(board.winner)}")
    text = Text("no winner\n", "dim")
    counts = {entry.law: (len(board.wins(entry.law)), len(board.losses(entry.law))) for entry in board.entries}
    if not any(wins for wins, _ in counts.values()):
        if len(board.best) == 1 and not board.why:
            return text.append("undefeated:\n").append(_folded(board.best[0], 12), style.law_colour(board.best[0]))
        return text.append(board.why or f"{len(board.best)} of {len(board.entries)}*")
    for law, (wins, losses) in counts.items():
        if wins:
            text.append(f"{_folded(law, 12)}\n", style.law_colour(law)).append(f"{wins} won {losses} lost\n")
    text.right_crop(1)
    return text


# margins and tunings


def margins(kind: str, found: Sequence[Margin]) -> Table:
    """Return the margins of one kind: a line for each plant and law."""
    made = titled(f"largest {kind} tolerated", "plant", "law")
    for head in ("margin", "to within", "theory"):
        made.add_column(head, justify="right", no_wrap=True)
    made.add_column("unit")
    last = None
    for margin in found:
        value = "none" if margin.value != margin.value else f"{'>= ' * margin.open}{number(margin.value)}"
        theory = "" if margin.theory is None else "any" if margin.theory == float("inf") else number(margin.theory)
        plant = "" if margin.plant == last else margin.plant
        law = Text(margin.law, style=style.law_colour(margin.law))
        within = number(margin.resolution) if margin.resolution else ""
        made.add_row(plant, law, value, within, theory, margin.unit)
        last = margin.plant
    return made


def tuning(tuned: Tuned) -> Table:
    """Return a line for each gain that was tuned: its value, between which bounds, and whether it is at one."""
    title = f"{tuned.law.name} on {tuned.plant.name}"
    heads = ("gain", "tuned", "searched from", "to", "")
    found = Table(*heads, title=title, title_justify="left", box=None, padding=(0, 2, 0, 0))
    for name, (low, high) in tuned.searched.items():
        notes = [f"at its {tuned.at_bound[name]} bound"] if name in tuned.at_bound else []
        notes += ["bound widened by a decade"] if name in tuned.widened else []
        found.add_row(name, f"{tuned.gains[name]:g}", f"{low:.3g}", f"{high:.3g}", ", ".join(notes))
    return found


# claims


def print_claims(claims: Sequence[Claim], console: Console, full: bool) -> None:
    """Print a table of claims with their verdicts, or each of them in full, and how many have each verdict."""
    if full:
        for claim in claims:
            _print_claim(claim, console)
    else:
        console.print(claims_overview(claims))
    console.print(claims_tally(claims), highlight=False)


def claims_overview(claims: Sequence[Claim]) -> Table:
    """Return a line for each claim: its verdicts, and the check that decides under the last set of gains."""
    sets = list(claims[0].verdicts) if claims else []
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False, pad_edge=False)
    table.add_column("id", justify="right", style="cyan", no_wrap=True, vertical="top")
    table.add_column("claim", ratio=2)
    table.add_column("verdict", no_wrap=True)
    for name in sets if len(sets) > 1 else []:
        table.add_column(name, justify="center", no_wrap=True)
    table.add_column(f"decided by, {sets[-1]} gains" if sets else "decided by", ratio=3)
    for claim in claims:
        marks = [_mark(claim.verdicts[name]) for name in sets] if len(sets) > 1 else []
        one = claim.decisive(sets[-1])
        verdict = _mark(claim.verdict) + Text(
            f" {claim.verdict}{', flips' * claim.flips}", style=COLOURS[claim.verdict]
        )
        table.add_row(claim.id, Text(claim.text), verdict, *marks, Text(check_sentence(one) if one else claim.note))
    return table


def _print_claim(claim: Claim, console: Console) -> None:
    """Print one claim in full."""
    console.print(Text.assemble((claim.id, "bold cyan"), f"  {claim.text}", (f"  {claim.where}", "dim")))
    about = plain()
    about.add_column(style="dim", no_wrap=True)
    about.add_column()
    flips = ", flips with the gains" if claim.flips else ""
    verdict = Text(f"{claim.verdict}{flips}", style=f"bold {COLOURS[claim.verdict]}")
    for label, value in (
        ("kind", claim.quantifier),
        ("measured", claim.measured),
        ("holds if", claim.holds_if),
        ("note", claim.note),
    ):
        if value:
            about.add_row(label, Text(value))
    about.add_row("verdict", verdict)
    console.print(Padding(about, (0, 0, 1, 2)))
    for name, verdict in claim.verdicts.items():
        console.print(Padding(_claim_checks(claim, name, verdict), (0, 0, 1, 2)))


def _claim_checks(claim: Claim, name: str, verdict: str) -> Table:
    """Return a line for each check under one set of gains, and for each number beside them."""
    table = plain(title=Text(f"{name} gains: {verdict}", style=COLOURS[verdict]), title_justify="left")
    table.add_column(no_wrap=True)
    table.add_column()
    table.add_column(justify="right", no_wrap=True)
    table.add_column(no_wrap=True)
    for one in claim.checks(name):
        mark = Text("✓", style=COLOURS[SUPPORTED]) if one.holds else Text("✗", style=COLOURS[REFUTED])
        limit = f"{one.relation} {_measured(one.limit, one.what)}"
        table.add_row(mark, Text(one.what), _measured(one.value, one.what), limit)
    for what, value in claim.beside[name].items():
        table.add_row("", Text(what, style="dim"), Text(_measured(value, what), style="dim"), "")
    return table


def claims_tally(claims: Sequence[Claim]) -> Text:
    """Return how many claims have each verdict, with its mark."""
    counts = {verdict: sum(claim.verdict == verdict for claim in claims) for verdict in VERDICTS}
    flips = sum(claim.flips for claim in claims)
    parts = [f"{MARKS[verdict]} {count} {verdict}" for verdict, count in counts.items() if count]
    return Text(", ".join(parts) + (f" ({flips} of them depend{'s' * (flips == 1)} on the gains)" if flips else ""))


def check_sentence(one: Check) -> str:
    """Return a check in a line: what was found, and what the claim asks for."""
    return f"{one.what} = {_measured(one.value, one.what)} (asked: {one.relation} {_measured(one.limit, one.what)})"


def _measured(value: float, what: str = "") -> str:
    """Return three significant digits; "none" for NaN, and "never" for an infinite time."""
    if math.isnan(value):
        return "none"
    return "never" if value == math.inf and "time" in what else f"{value:.3g}"


def _mark(verdict: str) -> Text:
    return Text(MARKS[verdict], style=COLOURS[verdict])
