"""How claims are shown: a table of verdicts, one claim in full, a JSON document."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from smc_mujoco.common.files import replacing, to_json
from smc_mujoco.common.version import __version__
from smc_mujoco.studies.paper.claims.checks import Check
from smc_mujoco.studies.paper.claims.verdict import NOT_TESTABLE, PARTLY, REFUTED, SUPPORTED, VERDICTS, Claim

# Told by shape as well as by colour, of a palette for the colour-blind.
MARKS = {SUPPORTED: "●", PARTLY: "◐", REFUTED: "○", NOT_TESTABLE: "–"}
COLOURS = {SUPPORTED: "blue", PARTLY: "yellow", REFUTED: "red", NOT_TESTABLE: "dim"}


def tell(claims: Sequence[Claim], console: Console, full: bool) -> None:
    """A table of claims and what came of them; or each of them in full."""
    if full:
        for claim in claims:
            page(claim, console)
    else:
        console.print(overview(claims))
    console.print(tally(claims), highlight=False)


def overview(claims: Sequence[Claim]) -> Table:
    """A line a claim: its verdict, that under each set of gains, and the number that decides under the last of them."""
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
        table.add_row(claim.id, Text(claim.text), verdict, *marks, Text(sentence(one) if one else claim.note))
    return table


def page(claim: Claim, console: Console) -> None:
    """All there is to know of one claim."""
    console.print(Text.assemble((claim.id, "bold cyan"), f"  {claim.text}", (f"  {claim.where}", "dim")))
    about = Table(box=None, show_header=False, padding=(0, 2, 0, 0), pad_edge=False)
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
        console.print(Padding(_checks(claim, name, verdict), (0, 0, 1, 2)))


def _checks(claim: Claim, name: str, verdict: str) -> Table:
    """A line a check under one set of gains, and what stands beside them."""
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, show_header=False)
    table.title, table.title_justify = Text(f"{name} gains: {verdict}", style=COLOURS[verdict]), "left"
    table.add_column(no_wrap=True)
    table.add_column()
    table.add_column(justify="right", no_wrap=True)
    table.add_column(no_wrap=True)
    for one in claim.checks(name):
        mark = Text("✓", style=COLOURS[SUPPORTED]) if one.holds else Text("✗", style=COLOURS[REFUTED])
        limit = f"{one.relation} {number(one.limit, one.what)}"
        table.add_row(mark, Text(one.what), number(one.value, one.what), limit)
    for what, value in claim.beside[name].items():
        table.add_row("", Text(what, style="dim"), Text(number(value, what), style="dim"), "")
    return table


def tally(claims: Sequence[Claim]) -> Text:
    """How many of each verdict, with the marks that stand for them."""
    counts = {verdict: sum(claim.verdict == verdict for claim in claims) for verdict in VERDICTS}
    flips = sum(claim.flips for claim in claims)
    parts = [f"{MARKS[verdict]} {count} {verdict}" for verdict, count in counts.items() if count]
    return Text(", ".join(parts) + (f" ({flips} of them depend{'s' * (flips == 1)} on the gains)" if flips else ""))


def sentence(one: Check) -> str:
    """A check in a line: what was found, and what the claim asks for."""
    return f"{one.what} = {number(one.value, one.what)} (asked: {one.relation} {number(one.limit, one.what)})"


def number(value: float, what: str = "") -> str:
    """Three significant digits; "none" for NaN, and for a time that is infinite "never"."""
    if math.isnan(value):
        return "none"
    return "never" if value == math.inf and "time" in what else f"{value:.3g}"


def _mark(verdict: str) -> Text:
    return Text(MARKS[verdict], style=COLOURS[verdict])


def document(claims: Sequence[Claim]) -> str:
    """The claims as one JSON document: {"smc_mujoco": version, "claims": [...]}."""
    return to_json({"smc_mujoco": __version__, "claims": [dataclasses.asdict(claim) for claim in claims]}, indent=1)


def write(text: str, path: Path) -> None:
    """Write a document to a file, whole or not at all."""
    with replacing(path) as file:
        file.write_text(text + "\n")
