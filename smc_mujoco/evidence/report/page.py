"""The HTML page of a report, which needs no network and no other file.

    page(findings)                 # the HTML, a str

Each section is a template of its name. Text is escaped by jinja2. Charts are SVG in the page, films
data URIs. A content security policy in the file forbids everything that is not in it.
"""

import base64
import inspect
import math
import re
from collections.abc import Hashable, Iterable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, TypeVar

from smc_mujoco.analysis.step_halving import APART, NUDGED
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common import html
from smc_mujoco.control.law import laws
from smc_mujoco.draw import style
from smc_mujoco.evidence.audit.verdict import Claim
from smc_mujoco.evidence.papers.gaber import scenarios
from smc_mujoco.evidence.report import answer, charts, oscillation, rigs, words
from smc_mujoco.evidence.report.plan import GAINS
from smc_mujoco.evidence.report.stages import Findings
from smc_mujoco.evidence.rigs import twin_figures
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.studies.board import relevance

if TYPE_CHECKING:
    from jinja2 import Environment

TEMPLATES = Path(__file__).parent / "templates"
SECTIONS = {
    "overview": "The answer",
    "accuracy": "How accurate is it",
    "claims": "The paper’s claims",
    "tradeoffs": "Error against effort",
    "margins": "Margins",
    "chattering": "How much will it chatter",
    "regions": "Regions of attraction",
    "rigs": "On the rig",
    "flight": "In flight",
    "films": "Films and traces",
    "method": "How it was computed",
}

Row = TypeVar("Row", bound=Hashable)
Column = TypeVar("Column", bound=Hashable)
Cell = TypeVar("Cell")


def environment() -> "Environment":
    """Return the jinja2 environment of the templates, with their filters and shared functions."""
    from markupsafe import Markup

    made = html.environment(TEMPLATES)
    made.filters |= {
        "embedded": lambda *of: Markup(charts.embedded(*of)),
        "margin_kind": words.kind,
        "law_name": words.law,
    }
    made.globals |= {"words": words, "checks": checks, "uri": uri, "white": style.WHITE_SHARE}
    return made


def page(findings: Findings) -> str:
    """Return the report as HTML."""
    from markupsafe import Markup

    made = environment()
    share = findings.about.plan.relevant
    made.globals |= {
        "f": findings,
        "about": findings.about,
        "first_film": next((scene for scene in findings.scenes if scene.film), None),
        "gains_set": GAINS,
        "infinity": math.inf,
        "answer": answer,
        "charts": charts,
        "rigs": rigs,
        "oscillation": oscillation,
        "link": link,
    }
    return made.get_template("page.jinja").render(
        css=Markup((TEMPLATES / "style.css").read_text(encoding="utf-8")),
        js=Markup((TEMPLATES / "page.js").read_text(encoding="utf-8")),
        sections=SECTIONS,
        # tables: what identifies a row -> column -> cell
        board=pivot(((s.plant, s.condition, s.law), s.metric, s) for s in findings.scores),
        set_margins=pivot(
            ((m.kind, m.plant, m.law), name, m)
            for name, some in findings.by_set.items()
            for m in some
        ),
        gains=pivot(((row.plant, row.law), row.set, row) for row in findings.about.gains),
        twins=twin_figures.summaries(twin_figures.rows()),
        # how it was computed
        laws=laws(),
        objective=Objective(),
        u_max=scenarios.U_MAX,
        control_period=scenarios.CONTROL_PERIOD,
        relevant=100 * share,
        step_change=APART,
        nudged=NUDGED,
        relevance=relevance(share, ((s.metric, s.floor) for s in findings.scores)),
        metrics={
            metric.name: (inspect.getdoc(metric.formula) or "").split("\n\n")
            for metric in metrics()
        },
    )


def pivot(cells: Iterable[tuple[Row, Column, Cell]]) -> dict[Row, dict[Column, Cell]]:
    """Return row -> column -> cell, in the order of the cells."""
    table: dict[Row, dict[Column, Cell]] = {}
    for row, column, cell in cells:
        table.setdefault(row, {})[column] = cell
    return table


def checks(sets: Sequence[str], claim: Claim) -> list[SimpleNamespace]:
    """Return a row for each check of a claim, those that fail first.

    Each has what is measured, set of gains -> Check, and its limit in words, "" where the sets have
    several limits.
    """
    rows = []
    its_checks = pivot(
        (c.what, name, c) for name in sets if name in claim.numbers for c in claim.checks(name)
    )
    for what, by_set in its_checks.items():
        limits = set()
        for check in by_set.values():
            limits.add(f"{words.pretty(check.relation)} {words.number(check.limit)}")
        rows.append(
            SimpleNamespace(what=what, checks=by_set, must=limits.pop() if len(limits) == 1 else "")
        )
    return sorted(rows, key=lambda row: all(check.holds for check in row.checks.values()))


def link(what: str) -> str:
    """Return the anchor of the metric that a check names, else that of "verdict"."""
    names = {}
    for m in metrics():
        for called in (m.name, words.metric(m.name)):
            names[called] = m.name
    known = "|".join(re.escape(name) for name in sorted(names, key=len, reverse=True))
    match = re.search(rf"(?<!\w)({known})(?!\w)", what)
    if match:
        return f"metric-{names[match[1]]}"
    return "verdict"


def uri(kind: str, data: bytes) -> str:
    """Return bytes as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
