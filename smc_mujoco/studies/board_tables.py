"""Boards as tables in HTML and LaTeX: a line for each law, a column for each metric, its median with its interval.

`leaderboard` imports this module, so its class Board is not named here.
"""

import dataclasses
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from smc_mujoco.analysis.bootstrap import Interval
from smc_mujoco.analysis.paired_runs import SETTLES
from smc_mujoco.common import html
from smc_mujoco.common.text import number
from smc_mujoco.control.source import Source, in_words, kinds
from smc_mujoco.mechanisms.plant import catalogue
from smc_mujoco.metrics.catalogue import CATALOGUE

FIT = r"too wide for a column: \resizebox{\textwidth}{!}{...}, of graphicx, or fewer metrics"
# A character -> as LaTeX writes it, with any engine.
TEX = {c: f"\\{c}" for c in "&%$#_{}"} | {c: f"${c}$" for c in "<>|"}
TEX |= {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
TEX |= {"–": "--", "·": r"$\cdot$", "×": r"$\times$", "±": r"$\pm$", "−": "$-$", "′": "$'$", "″": "$''$"}
LETTERS = "αβγδεζηθικλμνξπρστυφχψωΓΔΘΛΞΠΣΦΨΩ"
NAMES = (
    "alpha beta gamma delta varepsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon varphi chi"
)
NAMES += " psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega"
TEX |= {letter: f"$\\{name}$" for letter, name in zip(LETTERS, NAMES.split(), strict=True)}
TEX |= {c: f"$_{i}$" for i, c in enumerate("₀₁₂₃₄₅₆₇₈₉")} | {c: f"$^{i}$" for i, c in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")}


class Cell(NamedTuple):
    """A law's size of one metric, as text; "" for what is not known."""

    median: str
    interval: str
    failures: str
    best: bool  # no law is better, no run failed, and there are enough runs for a winner


def size(value: float, metric: str, digits: int = 3) -> str:
    """Return a median as text: "" for NaN, and a share in percent."""
    if math.isnan(value):
        return ""
    return f"{100 * value:.0f}" if metric == SETTLES else number(value, digits)


def spread(interval: Interval, metric: str) -> str:
    """Return the ends of an interval with the digits of its median, so that it holds the median as printed.

    It is "" for an interval that is not known.
    """
    ends = [size(value, metric) for value in (interval.low, interval.high)]
    return "–".join(ends) if all(ends) else ""


def heading(board: Any) -> str:
    """Return a metric's label with its unit, if that is known."""
    if board.metric == SETTLES:
        return "settles (%)"
    units = {plant.unit for block in board.blocks if (plant := catalogue().get(block.plant))}
    metric = dataclasses.replace(CATALOGUE[board.metric], unit=board.unit)  # in V where commands are voltages
    unit = metric.unit_for(units.pop()) if len(units) == 1 else "" if "{" in metric.unit else metric.unit
    return metric.label + (f" ({unit})" if unit not in ("", "1") else "")


def as_html(boards: Iterable[Any]) -> html.Html:
    """Return a table for each group of runs, with what each metric's board says below."""
    tables = []
    for name, own in _groups(boards).items():
        left = _left(own)
        heads = *left[""], *(heading(board).replace("^2", "²") for board in own)
        lines = [(*left[law], *map(_html_cell, cells)) for law, cells in _laws(own).items()]
        note = html.Html("<br>".join(map(html.text, [*_verdicts(own), key(own)])))
        tables.append(html.table(heads, lines, name, note, range(len(left[""]), len(heads)), most=40))
    return html.Html("<br>".join(tables)) if tables else html.table((), [("no boards: no metric applies",)])


def as_latex(boards: Iterable[Any]) -> str:
    """Return a tabular for each group of runs, below comments that say what it is of."""
    tables = []
    for name, own in _groups(boards).items():
        left = {law: list(map(_tex, texts)) for law, texts in _left(own).items()}
        lines = [f"% {text}" for text in (name, *_verdicts(own), f"{key(own)}; needs booktabs", FIT)]
        lines += [f"\\begin{{tabular}}{{{'l' * len(left[''])}{'r' * len(own)}}}", "\\toprule"]
        lines += [_tex_line([*left[""], *(_tex(heading(board)) for board in own)]), "\\midrule"]
        lines += [_tex_line([*left[law], *map(_tex_cell, cells)]) for law, cells in _laws(own).items()]
        tables.append("\n".join([*lines, "\\bottomrule", "\\end{tabular}\n"]))
    return "\n".join(tables)


def key(boards: Sequence[Any]) -> str:
    """Return what the cells of a table show."""
    bold = any(cell.best for cells in _laws(boards).values() for cell in cells)
    better = "; bold: no law is better, and no run failed" * bold
    words = f"medians with {100 * boards[0].level:g} % intervals{better}; {relevance(boards)}"
    gains = in_words(sources(boards))
    return f"{words}; {gains}" if gains else words


def relevance(boards: Sequence[Any]) -> str:
    """Return the least relevant difference of boards in words."""
    resolved = max((board.resolution for board in boards if board.unit == "{x}"), default=0.0)
    sensor = f", for positions at least what the sensor resolves, up to {number(resolved)} rad or m" if resolved else ""
    return f"least relevant difference: {100 * boards[0].relevant:g} % of the larger value{sensor}"


def sources(boards: Iterable[Any]) -> dict[str, list[Source]]:
    """Return law -> where its gains come from, by name, for every law of some boards."""
    found: dict[str, list[Source]] = {}
    for board in boards:
        for entry in board.entries:
            found.setdefault(entry.law, []).extend(entry.sources)
    return dict(sorted(found.items()))


def _left(boards: Sequence[Any]) -> dict[str, list[str]]:
    """Return the first cells of each law's line, and of the headings under "": the gains only if they are known."""
    found = sources(boards)
    known = any(found.values())
    return {"": ["law", *["gains"] * known]} | {law: [law, *[kinds(its)] * known] for law, its in found.items()}


def _verdicts(boards: Sequence[Any]) -> list[str]:
    """Return what the boards say, each sentence once, with its metrics before it where boards differ."""
    verdicts: dict[str, list[str]] = {}
    for board in boards:
        verdicts.setdefault(board.verdict, []).append(heading(board).partition(" (")[0])
    if len(verdicts) == 1:
        return list(verdicts)
    return [f"{', '.join(metrics)}: {verdict}" for verdict, metrics in verdicts.items()]


def _groups(boards: Iterable[Any]) -> dict[str, list[Any]]:
    """Return the boards of each group of runs, under its name."""
    groups: dict[str, list[Any]] = {}
    for board in boards:
        groups.setdefault(board.about, []).append(board)
    return groups


def _laws(boards: Sequence[Any]) -> dict[str, list[Cell]]:
    """Return each law's cells, one a board, in the order of the first board."""
    laws: dict[str, list[Cell]] = {}
    for i, board in enumerate(boards):
        for entry in board.entries:
            middle = size(entry.interval.median, board.metric)
            best = entry.rank.best and middle != "" and not board.too_few and not board.barred
            cell = Cell(middle, spread(entry.interval, board.metric), board.failures(entry), best)
            laws.setdefault(entry.law, [Cell("", "", "", False)] * len(boards))[i] = cell
    return laws


def _html_cell(cell: Cell) -> html.Html:
    """Return a median, bold if it is the best, with its interval below it."""
    strong = html.strong(cell.median) if cell.best else html.text(cell.median)
    below = "<br>".join(html.text(text) for text in (cell.interval, cell.failures) if text)
    return html.Html(f'{strong}<br><small style="white-space:nowrap">{below}</small>')


def _tex_line(cells: Iterable[str]) -> str:
    return f"{' & '.join(cells)} \\\\"


def _tex_cell(cell: Cell) -> str:
    """Return a median, bold if it is the best, with its interval beside it."""
    middle, interval = (re.sub(r"([\d.]+)e(-?\d+)", r"\1·10^\2", text) for text in cell[:2])
    strong = f"\\textbf{{{_tex(middle)}}}" if cell.best else _tex(middle)
    failures = f", {_tex(cell.failures)}" if cell.failures else ""
    return (f"{strong} [{_tex(interval)}]" if interval else strong) + failures


def _tex(text: str) -> str:
    """Return text with LaTeX's own characters escaped, and powers, Greek letters and dashes as LaTeX writes them."""
    return re.sub(
        r"\^(-?\d+)|(.)", lambda found: TEX.get(found[2], found[2]) if found[2] else f"$^{{{found[1]}}}$", text
    )
