"""The audit of the paper: its claims, each a function of runs, and the verdicts on them.

    claims(only=["3", "18"])                       # the verdicts on two claims, under every set of gains

    @claim("3", "reduces chattering", where="abstract", holds_if="< 1 % of classical")
    def reduces_chattering(runs: Runs) -> Evidence:
        \"\"\"TV rate of u against classical SMC, nominal.\"\"\"

Every claim is a function in a module of this folder; `catalogue` finds them. Its docstring says what is measured.
Thresholds were fixed before any run, and are not moved. How verdicts follow from checks: `verdict`.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from smc_mujoco.common.errors import ScenarioError, find, taken, unknown
from smc_mujoco.common.files import to_json
from smc_mujoco.common.registry import modules
from smc_mujoco.common.version import __version__
from smc_mujoco.control.gain_sets import SETS
from smc_mujoco.studies.audit.verdict import Claim, Claims, Evidence, Statement, judged

if TYPE_CHECKING:
    from smc_mujoco.studies.paper.claims.runs import Result, Runs, Substitute
    from smc_mujoco.studies.table import Table

QUICK_SETS = ("tuned",)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry(Statement):
    """A claim in the catalogue. Besides the attributes of a `Statement` it has:

    Attributes:
      evidence: from runs under one set of gains to checks and the numbers beside them.
      quick: what a quick audit measures instead, if that is less.
      late: whether it looks at the runs of all other claims, and so comes after them.
    """

    evidence: Callable[[Runs], Evidence]
    quick: str = ""
    late: bool = False


def claim(id: str, text: str, **fields: Any) -> Callable[[Callable[[Runs], Evidence]], Entry]:
    """Decorator: enter a function from runs to evidence in the catalogue; fields as of `Entry`.

    The first paragraph of its docstring is `measured`, the others are the `note`.
    """

    def enter(evidence: Callable[[Runs], Evidence]) -> Entry:
        measured, _, note = (inspect.getdoc(evidence) or "").partition("\n\n")
        texts: dict[str, Any] = {"measured": " ".join(measured.split()).rstrip("."), "note": " ".join(note.split())}
        return Entry(id=id, text=text, evidence=evidence, **texts | fields)

    return enter


@functools.cache
def catalogue() -> dict[str, Entry]:
    """Return every claim of this folder by its id: numbers by size, then letters.

    Raises:
      ScenarioError: two claims of one id.
    """
    known: dict[str, Entry] = {}
    for module in modules("smc_mujoco.studies.paper.claims"):
        for entry in vars(module).values():
            if isinstance(entry, Entry):
                if entry.id in known:
                    raise ScenarioError(f"claim {entry.id!r} is there twice, in {module.__name__}: give one another id")
                known[entry.id] = entry
    return {id: known[id] for id in sorted(known, key=lambda id: (not id.isdigit(), len(id), id))}


def claims(
    table: Table | None = None,
    only: Iterable[str | int] | None = None,
    gains: str | Sequence[str] | None = None,
    quick: bool = False,
    substitute: Substitute | None = None,
    threads: int | None = None,
    report: Callable[[int], None] = lambda done: None,
) -> Claims:
    """Return the verdicts on the paper's claims, with the numbers behind them, in the order of the list.

    Args:
      table: of a study, whose runs are then not made again.
      only: ids of the claims wanted; None for all.
      gains: sets of gains, of `gains.SETS`; None for all of them, or QUICK_SETS if it is to be quick.
      quick: coarser grids, no network above 50 pendulums.
      substitute: law's name -> function that makes its mutant, to see whether the audit can fail.
      threads: simulations at once; None for one per available core.
      report: called with 1 as each claim is done under a set of gains, `evaluations` times in all.

    Raises:
      ScenarioError: an unknown id or set of gains.
    """
    from smc_mujoco.studies.paper.claims.runs import Runs, of_table

    # a table has runs of the laws as they are, not of their mutants
    rows: dict[str, Result] = {} if table is None or substitute else of_table(table)
    shared: dict[str, Result] = {}
    entries = wanted(only)
    evidence: dict[str, dict[str, Evidence]] = {entry.id: {} for entry in entries}
    for name in sets(gains, quick):
        runs = Runs(name, quick, substitute, threads, rows, shared)
        for entry in sorted(entries, key=lambda entry: entry.late):
            evidence[entry.id][name] = entry.evidence(runs)
            report(1)
    if quick:
        instead = {entry.id: f"; here, quickly, {entry.quick}" if entry.quick else "" for entry in entries}
        entries = [dataclasses.replace(entry, measured=entry.measured + instead[entry.id]) for entry in entries]
    return Claims(judged(entry, evidence[entry.id]) for entry in entries)


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


def document(claims: Sequence[Claim]) -> str:
    """Return claims as one JSON document: {"smc_mujoco": version, "claims": [...]}."""
    return to_json({"smc_mujoco": __version__, "claims": [dataclasses.asdict(claim) for claim in claims]}, indent=1)
