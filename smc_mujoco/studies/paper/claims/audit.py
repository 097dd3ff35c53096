"""The audit of a paper: the verdicts on its claims.

    claims(only=["3", "18"])                       # the verdicts on two claims, under every set of gains

A claim is one function in a file of this package, which is walked to find them: see `entry`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from smc_mujoco.common.errors import ScenarioError, find, taken, unknown
from smc_mujoco.common.registry import modules
from smc_mujoco.control.gain_sets import SETS
from smc_mujoco.studies.paper.claims.entry import Entry
from smc_mujoco.studies.paper.claims.verdict import Claim, Found, combined, numbers, verdict

if TYPE_CHECKING:
    from smc_mujoco.studies.paper.claims.evidence import Held, Substitute
    from smc_mujoco.studies.table import Table

QUICK_SETS = ("tuned",)


def _order(id: str) -> tuple[int, str]:
    """Numbers first, by size, then letters: the order of the list."""
    return (int(id), "") if id.isdigit() else (1_000_000, id)


@functools.cache
def catalogue() -> dict[str, Entry]:
    """Every claim found in this package, by id, in the order of the list.

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
    """The verdicts on the paper's claims, with the numbers behind them, in the order of the list.

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
    from smc_mujoco.studies.paper.claims.evidence import Runs, of_table

    # a table tells of the laws as they are: nothing of it stands for a mutant's runs
    rows: dict[str, Held] = {} if table is None or substitute else of_table(table)
    shared: dict[str, Held] = {}
    entries = wanted(only)
    found: dict[str, dict[str, Found]] = {entry.id: {} for entry in entries}
    for name in sets(gains, quick):
        runs = Runs(name, quick, substitute, threads, rows, shared)
        for entry in sorted(entries, key=lambda entry: entry.late):
            found[entry.id][name] = entry(runs)
            report(1)
    return [judged(entry, found[entry.id]) for entry in entries]


def wanted(only: Iterable[str | int] | None) -> list[Entry]:
    """The entries of some ids, all for None, in the order of the list; an unknown id is a ScenarioError."""
    known = catalogue()
    if only is None:
        return list(known.values())
    ids = {str(id) for id in taken("only", only)}
    for id in sorted(ids - set(known)):
        raise unknown("claim", id, known)
    return [entry for entry in known.values() if entry.id in ids]


def sets(gains: str | Sequence[str] | None, quick: bool) -> list[str]:
    """The sets of gains that `claims` takes for these arguments; an unknown one is a ScenarioError."""
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
    """How often `claims` reports, for a progress bar."""
    return len(wanted(only)) * len(sets(gains, quick))


def judged(entry: Entry, found: dict[str, Found]) -> Claim:
    """A claim's verdict from what was found, set by set."""
    verdicts = {name: verdict(some, entry.quantifier) for name, some in found.items()}
    overall, flips, sentence = combined(verdicts, entry.quantifier)
    told = {name: numbers(some) for name, some in found.items()}
    return Claim(
        id=entry.id,
        text=entry.text,
        where=entry.where,
        measured=entry.measured,
        holds_if=entry.holds_if,
        verdict=overall,
        numbers={name: checks for name, (checks, _) in told.items()},
        beside={name: others for name, (_, others) in told.items()},
        verdicts=verdicts,
        flips=flips,
        quantifier=entry.quantifier,
        note=" ".join(filter(None, (entry.note, sentence))),
    )
