"""Tables of the commands on claims."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from rich.text import Text

from smc_mujoco.answers import answers
from smc_mujoco.answers.command import instead
from smc_mujoco.answers.facts import Fact, NextStep, Screen, Settles
from smc_mujoco.cli.console import Terminal
from smc_mujoco.common.tabular import Cell, Tabular, of_fields
from smc_mujoco.common.text import capital
from smc_mujoco.evidence.audit import verdict as verdicts
from smc_mujoco.evidence.audit.verdict import REFUTED, SUPPORTED, Claim, Claims, digits_of

MAX_NAMED = 8  # claims whose checks the next step shows; chosen
CHECKED = {
    True: Cell("✓", colour=verdicts.COLOURS[SUPPORTED]),
    False: Cell("✗", colour=verdicts.COLOURS[REFUTED]),
}


def print_claims(claims: Claims, terminal: Terminal, named: bool, full: bool) -> None:
    """Print the answer of an audit; or with `full` a table of claims with their verdicts; or those
    that were `named`, each in full. The two end with the totals of the paper's own sentences.
    """
    if not named and not full:
        terminal.note("\n".join(answers.screen_lines(screen_of(claims))))
        return
    if named:
        for claim in claims:
            _print_claim(claim, terminal)
    else:
        terminal.print(claims.table)
    terminal.print(Text(f"{capital(verdicts.totals_line(claims))}."), highlight=False)
    if any(len(claim.verdicts) > 1 for claim in claims):
        terminal.print(Text(verdicts.over_gains(claims)), highlight=False)


def screen_of(claims: Sequence[Claim]) -> Screen:
    """Return what an audit says on one screen."""
    facts = []
    for whose, words in verdicts.WHOSE_WORDS.items():
        of_whose = Counter(claim.verdict for claim in claims if claim.whose == whose)
        texts = [f"{verdicts.MARKS[kind]} {count} {kind}" for kind, count in of_whose.items()]
        facts.append(Fact("names", label=words, names=texts))
    of_paper = [claim for claim in claims if claim.whose == verdicts.PAPER]
    supported = [claim for claim in of_paper if claim.verdict == SUPPORTED]
    holds = Settles(sum(claim.for_every_set for claim in supported), len(supported))
    facts.append(Fact("every gain", holds=holds if supported else None))
    refuted = [claim for claim in of_paper if claim.verdict == REFUTED]
    step = None
    if refuted:
        ids = " ".join(claim.id for claim in refuted[:MAX_NAMED])
        step = NextStep(instead(f"claims {ids}", {}, ("--paper",)), "shows their checks")
    for claim in refuted:
        facts.append(Fact("sentence", label=f"refuted {claim.id}", text=claim.text))
    return Screen(facts=facts, next=step)


def _print_claim(claim: Claim, terminal: Terminal) -> None:
    """Print one claim in full, then a table for each set of gains: its checks, and the numbers
    beside them.
    """
    about = {**claim.parts, "verdict": claim.verdict_words}
    terminal.print(of_fields(f"{claim.id}  {claim.text}  {claim.where}", about), "")
    for name, verdict in claim.verdicts.items():
        rows = [(CHECKED[check.holds], check.what, *check.texts) for check in claim.checks(name)]
        for what, value in claim.beside[name].items():
            rows.append((Cell(""), what, digits_of(value, what), ""))
        title = f"{name} gains: {verdict}"
        terminal.print(Tabular(headings=("",) * 4, rows=rows, title=title, name_columns=2), "")
