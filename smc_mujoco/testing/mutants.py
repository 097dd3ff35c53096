"""Whether an audit can fail: claims under mutants of the laws that they are about.

    assert survivors("./my_paper") == {}      # in a test: each claim that holds is lost by some mutant of its first law

A law with the wrong sign, without gain, without memory, or as a relay is not what a paper writes about. A claim that
each of them keeps measures something else. A claim that no mutant can lose says why, in its field `immune`.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.component import Component
from smc_mujoco.control.variants import forgetful, relay, reversed_gain, zero_gain
from smc_mujoco.studies.audit.audit import as_paper, measure, sets, wanted
from smc_mujoco.studies.audit.paper import Entry, Paper
from smc_mujoco.studies.audit.runs import Result, Runs
from smc_mujoco.studies.audit.verdict import Evidence, sentences

MUTANTS: dict[str, Callable[[Component], Component]] = {
    "wrong sign": reversed_gain,
    "zero gain": zero_gain,
    "no memory": forgetful,
    "relay": relay,
}
KEPT, BLIND = "kept by every mutant", "refuted, and no mutant changes its numbers"


def mutants(law: Component) -> dict[str, Component]:
    """Return the mutants of a law: with the wrong sign, without gain, without memory, and as a relay."""
    return {name: mutant(law) for name, mutant in MUTANTS.items()}


def survivors(
    paper: str | Path | Paper,
    only: Iterable[str | int] | None = None,
    gains: str | Sequence[str] | None = None,
    quick: bool = True,
    threads: int | None = None,
    report: Callable[[int], None] = lambda done: None,
) -> dict[str, str]:
    """Return claim -> why no mutant of its first law takes anything from it; none of them should be there.

    A claim is lost if fewer of its sentences hold than with the law as it is, or if its function cannot measure the
    mutant. A claim that is refuted has nothing to lose: then its numbers must change. Claims with `immune` are not
    asked.

    Args:
      paper, only, gains, quick, threads: as of `smc.audit`.
      report: called with the number of claims done, under a set of gains and a mutant; `evaluations` in all.
    """
    found = as_paper(paper)
    asked = {entry.id: entry for entry in wanted(found, only) if not entry.immune}
    left = dict(asked)
    names = sets(found, gains, quick)

    def measured(entries: Iterable[Entry], law: str, mutant: str) -> Iterator[tuple[str, str, Evidence | None]]:
        """Yield claim, set of gains and evidence; None where a function cannot measure a law that is broken."""
        shared: dict[str, Result] = {}
        replaced = {law: MUTANTS[mutant]} if mutant else None
        for name in names:
            runs = Runs(found, name, quick, replaced, threads, None, shared)
            for entry in sorted(entries, key=lambda entry: entry.late):
                try:
                    yield entry.id, name, measure(entry, runs.of(entry))
                except ScenarioError:
                    if not mutant:
                        raise
                    yield entry.id, name, None
                report(1)

    true = {(id, name): evidence for id, name, evidence in measured(left.values(), "", "")}
    holding = {id: any(any(sentences(true[id, name] or [], left[id].quantifier)) for name in names) for id in left}
    for mutant in MUTANTS:
        report((len(asked) - len(left)) * len(names))
        for law in sorted({first_law(entry) for entry in left.values()}):
            about = [entry for entry in left.values() if first_law(entry) == law]
            for id, name, evidence in measured(about, law, mutant):
                if id in left and lost(left[id], true[id, name] or [], evidence, holding[id]):
                    del left[id]
    return {id: KEPT if holding[id] else BLIND for id in left}


def evaluations(
    paper: str | Path | Paper,
    only: Iterable[str | int] | None = None,
    gains: str | Sequence[str] | None = None,
    quick: bool = True,
) -> int:
    """Return how often `survivors` reports, for a progress bar."""
    found = as_paper(paper)
    asked = [entry for entry in wanted(found, only) if not entry.immune]
    return len(asked) * len(sets(found, gains, quick)) * (1 + len(MUTANTS))


def first_law(entry: Entry) -> str:
    """Return the law that mutants of a claim replace.

    Raises:
      ScenarioError: the claim names no law.
    """
    if not entry.laws:
        raise ScenarioError(f"claim {entry.id} names no law: write laws, the one it is about first, or immune")
    return entry.laws[0]


def lost(entry: Entry, true: Evidence, mutant: Evidence | None, holding: bool) -> bool:
    """Return whether a mutant loses a claim that holds in part, or changes the numbers of one that does not."""
    if mutant is None:
        return True
    if holding:
        return sum(sentences(mutant, entry.quantifier)) < sum(sentences(true, entry.quantifier))
    return [repr(one.value) for one in mutant] != [repr(one.value) for one in true]  # NaN is like NaN
