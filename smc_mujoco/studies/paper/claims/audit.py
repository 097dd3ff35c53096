"""The audit of the paper: its claims, each a function of runs, and the verdicts on them.

    claims(only=["3", "18"])                       # the verdicts on two claims, under every set of gains

    @claim("3", "reduces chattering", where="abstract", measured="TV rate against classical SMC, nominal",
           holds_if="< 1 % of classical")
    def reduces_chattering(runs: Runs) -> list[Check]: ...

Every claim is a function in a module of this folder; `catalogue` finds them. Thresholds were fixed before any run, and
are not moved. How verdicts follow from checks: `verdict`.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from smc_mujoco.common.errors import ScenarioError, find, taken, unknown
from smc_mujoco.common.files import to_json
from smc_mujoco.common.registry import modules
from smc_mujoco.common.version import __version__
from smc_mujoco.control.gain_sets import SETS
from smc_mujoco.studies.paper.claims.verdict import NAMED, Claim, Found, combined, numbers, verdict

if TYPE_CHECKING:
    from smc_mujoco.studies.paper.claims.runs import Held, Runs, Substitute
    from smc_mujoco.studies.table import Table

Evidence = Callable[["Runs"], Found]
QUICK_SETS = ("tuned",)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry:
    """A claim in the catalogue.

    Attributes:
      id: its number in the list of claims.
      text: what the paper says, in a few words.
      where: the section of the paper.
      measured: what is run, and what is measured on it.
      quick: what a quick audit measures instead, where that is less.
      holds_if: the threshold, in words.
      evidence: from runs under one set of gains to checks and the numbers beside them.
      note: what a reader must know to judge the numbers: why a part is not testable, what stands for what.
      late: whether it looks at the runs of all other claims, and so comes after them.
      quantifier: UNIVERSAL, EXISTENTIAL, or NAMED: about the plants and conditions that it names, and no others.
    """

    id: str
    text: str
    where: str
    measured: str
    holds_if: str
    evidence: Evidence
    note: str = ""
    late: bool = False
    quantifier: str = NAMED
    quick: str = ""


def claim(id: str, text: str, **fields: Any) -> Callable[[Evidence], Entry]:
    """Decorator: enter a function from runs to checks in the catalogue; fields as of `Entry`."""
    return lambda evidence: Entry(id=id, text=text, evidence=evidence, **fields)


def _order(id: str) -> tuple[int, str]:
    """Return the sort key of an id: numbers by size, then letters."""
    return (int(id), "") if id.isdigit() else (1_000_000, id)


@functools.cache
def catalogue() -> dict[str, Entry]:
    """Return every claim of this folder by its id, in the order of the list.

    Raises:
      ScenarioError: two claims of one id.
    """
    found: dict[str, Entry] = {}
    for module in modules("smc_mujoco.studies.paper.claims"):
        for entry in vars(module).values():
            if isinstance(entry, Entry):
                if entry.id in found:
                    raise ScenarioError(f"claim {entry.id!r} is there twice, in {module.__name__}: give one another id")
                found[entry.id] = entry
    return {id: found[id] for id in sorted(found, key=_order)}


def claims(
    table: Table | None = None,
    only: Iterable[str | int] | None = None,
    gains: str | Sequence[str] | None = None,
    quick: bool = False,
    substitute: Substitute | None = None,
    threads: int | None = None,
    report: Callable[[int], None] = lambda done: None,
) -> list[Claim]:
    """Return the verdicts on the paper's claims, with the numbers behind them, in the order of the list.

    Args:
      table: of a study, whose runs are then not made again.
      only: ids of the claims wanted; None for all.
      gains: sets of gains, of `gains.SETS`; None for all of them, or QUICK_SETS where it is to be quick.
      quick: coarser grids, no network above 50 pendulums.
      substitute: law's name -> function that makes its mutant, to see whether the audit can fail.
      threads: simulations at once; None for one per available core.
      report: told 1 as each claim is done under a set of gains, `evaluations` of them in all.

    Raises:
      ScenarioError: an unknown id or set of gains.
    """
    from smc_mujoco.studies.paper.claims.runs import Runs, of_table

    # a table has runs of the laws as they are, not of their mutants
    rows: dict[str, Held] = {} if table is None or substitute else of_table(table)
    shared: dict[str, Held] = {}
    entries = wanted(only)
    found: dict[str, dict[str, Found]] = {entry.id: {} for entry in entries}
    for name in sets(gains, quick):
        runs = Runs(name, quick, substitute, threads, rows, shared)
        for entry in sorted(entries, key=lambda entry: entry.late):
            found[entry.id][name] = entry.evidence(runs)
            report(1)
    return [judged(entry, found[entry.id], quick) for entry in entries]


def wanted(only: Iterable[str | int] | None) -> list[Entry]:
    """Return the entries of some ids, or all for None, in the order of the list; refuse an unknown id."""
    known = catalogue()
    if only is None:
        return list(known.values())
    ids = {str(id) for id in taken("only", only)}
    for id in sorted(ids - set(known)):
        raise unknown("claim", id, known)
    return [entry for entry in known.values() if entry.id in ids]


def sets(gains: str | Sequence[str] | None, quick: bool) -> list[str]:
    """Return the sets of gains that `claims` takes for these arguments; refuse an unknown one."""
    if gains is None:
        return list(QUICK_SETS if quick else SETS)
    names = [gains] if isinstance(gains, str) else taken("gains", gains)
    for name in names:
        find("set of gains", name, dict.fromkeys(SETS))
    if not names:
        raise ScenarioError(f"no set of gains is given: choose from {', '.join(SETS)}")
    return names


def evaluations(
    only: Iterable[str | int] | None = None, gains: str | Sequence[str] | None = None, quick: bool = False
) -> int:
    """Return how often `claims` reports, for a progress bar."""
    return len(wanted(only)) * len(sets(gains, quick))


def judged(entry: Entry, found: dict[str, Found], quick: bool = False) -> Claim:
    """Return a claim with its verdict, from what was found under each set of gains."""
    verdicts = {name: verdict(some, entry.quantifier) for name, some in found.items()}
    overall, flips, sentence = combined(verdicts, entry.quantifier)
    told = {name: numbers(some) for name, some in found.items()}
    return Claim(
        id=entry.id,
        text=entry.text,
        where=entry.where,
        measured=entry.measured + (f"; here, quickly, {entry.quick}" if quick and entry.quick else ""),
        holds_if=entry.holds_if,
        verdict=overall,
        numbers={name: checks for name, (checks, _) in told.items()},
        beside={name: others for name, (_, others) in told.items()},
        verdicts=verdicts,
        flips=flips,
        quantifier=entry.quantifier,
        note=" ".join(filter(None, (entry.note, sentence))),
    )


def document(claims: Sequence[Claim]) -> str:
    """Return claims as one JSON document: {"smc_mujoco": version, "claims": [...]}."""
    return to_json({"smc_mujoco": __version__, "claims": [dataclasses.asdict(claim) for claim in claims]}, indent=1)
