"""Whether an audit can fail: the claims of a paper, measured on broken laws, the mutants.

    assert survivors("./my_paper") == {}      # in a test: some mutant loses each claim that holds

A mutant is the law that a claim is about with the wrong sign, without gain, without memory, or as a
relay. A paper does not write about such a law, so a claim that holds under every mutant measures
something else. If no mutant can lose a claim, the claim's field `immune` says why.
"""

import functools
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.evidence.audit.audit import measure, select_claims, sets
from smc_mujoco.evidence.audit.claim_runs import ClaimRuns, RunResult
from smc_mujoco.evidence.audit.paper import ClaimEntry, Paper
from smc_mujoco.evidence.audit.paper import paper as find_paper
from smc_mujoco.evidence.audit.variants import variant
from smc_mujoco.evidence.audit.verdict import Evidence, sentences

MUTANTS = ("reversed", "zero", "forgetful", "relay")  # of VARIANTS
KEPT = "kept by every mutant"
BLIND = "not supported, and no mutant changes its numbers"


def survivors(
    paper: str | Path | Paper,
    only: Iterable[str | int] | None = None,
    gains: str | Sequence[str] | None = None,
    quick: bool = True,
    threads: int | None = None,
    report: Callable[[int, int], None] = lambda done, whole: None,
) -> dict[str, str]:
    """Return claim -> KEPT or BLIND, for the claims that no mutant of their first law loses.

    There should be none.

    A mutant loses a claim if a sentence of the claim holds under the law itself and not under the
    mutant, or if the claim's function cannot measure the mutant. A claim of which no sentence holds
    has nothing to lose: there the numbers must change. Claims with `immune` are skipped.

    Args:
      paper, only, gains, quick, threads: as of `smc.audit`.
      report: called with how many rounds are done and how many there are: the law itself is one,
        each mutant another.
    """
    audited = paper if isinstance(paper, Paper) else find_paper(paper)
    claims = {entry.id: entry for entry in select_claims(audited, only) if not entry.immune}
    names = sets(audited, gains, quick)

    def measured(
        entries: Iterable[ClaimEntry], law: str, mutant: str
    ) -> Iterator[tuple[str, str, Evidence | None]]:
        """Yield claim, set of gains, and evidence; None as evidence if the claim's function cannot
        measure a mutant.
        """
        shared: dict[str, RunResult] = {}
        replaced = {law: functools.partial(variant, name=mutant)} if mutant else {}
        for name in names:
            runs = ClaimRuns(audited, name, quick, replaced, threads, {}, shared)
            for entry in sorted(entries, key=lambda entry: entry.late):
                try:
                    yield entry.id, name, measure(entry, runs.of(entry))
                except ScenarioError:
                    if not mutant:
                        raise
                    yield entry.id, name, None

    intact: dict[tuple[str, str], Evidence] = {}
    holding = set()  # claims of which some sentence holds under the law itself
    for id, name, evidence in measured(claims.values(), "", ""):
        intact[id, name] = evidence or []
        if any(sentences(intact[id, name], claims[id].quantifier).values()):
            holding.add(id)
    for done, mutant in enumerate(MUTANTS, 1):
        report(done, 1 + len(MUTANTS))
        for law in sorted({first_law(entry) for entry in claims.values()}):
            about = [entry for entry in claims.values() if first_law(entry) == law]
            for id, name, evidence in measured(about, law, mutant):
                if id in claims and lost(claims[id], intact[id, name], evidence, id in holding):
                    del claims[id]
    return {id: KEPT if id in holding else BLIND for id in claims}


def first_law(entry: ClaimEntry) -> str:
    """Return the law that mutants of a claim replace."""
    if not entry.laws:
        raise ScenarioError(
            f"claim {entry.id} names no law: write laws, first the one that it is about, or immune"
        )
    return entry.laws[0]


def lost(entry: ClaimEntry, intact: Evidence, mutant: Evidence | None, holding: bool) -> bool:
    """Return whether a mutant loses a claim.

    `mutant`: its evidence; None if it cannot be measured.
    """
    if mutant is None:
        return True
    if holding:
        still = sentences(mutant, entry.quantifier)
        before = sentences(intact, entry.quantifier)
        return any(held and not still.get(sentence) for sentence, held in before.items())
    return _numbers(mutant) != _numbers(intact)


def _numbers(evidence: Evidence) -> list[str]:
    """Return the numbers of evidence as texts, in which NaN equals NaN."""
    return [repr(item.value) for item in evidence]
