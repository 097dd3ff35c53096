"""From checks to verdicts: under one set of gains, and over several.

A claim consists of one sentence or of several. A sentence holds where all its checks hold; an existential one ("may",
"there is") where one does. Under one set of gains a claim is supported where all its sentences hold, refuted where none
does, partly supported between; without checks it is not testable.

Over several sets the verdict is the one that they have in common; where they differ it is partly supported, and flips.
A universal claim ("every", "any", "by construction") speaks of all gains: a counter-example under one set refutes it.
An existential one is supported by an example under one set.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from smc_mujoco.common import files
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.studies.paper.claims.checks import Beside, Check

SUPPORTED, PARTLY, REFUTED, NOT_TESTABLE = VERDICTS = ("supported", "partly supported", "refuted", "not testable")

UNIVERSAL, NAMED, EXISTENTIAL = QUANTIFIERS = ("universal", "of what it names", "existential")

Numbers = dict[str, dict[str, dict[str, Any]]]  # set of gains -> what -> value, relation, limit, holds
Found = Sequence[Check | Beside]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim and its verdict.

    Attributes:
      id, text, where, measured, holds_if: as of the decorator `claim`.
      verdict: over all sets of gains, one of VERDICTS.
      numbers: set of gains -> what was measured -> {"value", "relation", "limit", "holds"}; inf is "never".
      beside: set of gains -> what else was found -> its value, which decides nothing.
      verdicts: set of gains -> verdict.
      flips: whether the verdict depends on the set.
      note: what a reader must know, and on which set the verdict depends.
      quantifier: one of QUANTIFIERS.
    """

    id: str
    text: str
    where: str
    measured: str
    holds_if: str
    verdict: str
    numbers: Numbers
    beside: dict[str, dict[str, float]]
    verdicts: dict[str, str]
    flips: bool
    note: str
    quantifier: str = NAMED

    def checks(self, gains: str) -> list[Check]:
        """The checks under a set of gains."""
        return [Check(what, **numbers) for what, numbers in self.numbers[gains].items()]

    def decisive(self, gains: str) -> Check | None:
        """The check missed by most, or the one with the least room, under a set of gains; None without checks."""
        return min(self.checks(gains), key=lambda one: (one.holds, one.slack), default=None)

    def plain(self) -> dict[str, Any]:
        """As JSON without loss: numbers that JSON lacks become "Infinity", "-Infinity" and "NaN"."""
        return files.plain(dataclasses.asdict(self))


def verdict(found: Found, quantifier: str = NAMED) -> str:
    """The verdict under one set of gains."""
    sentences: dict[str, list[bool]] = {}
    for one in found:
        if isinstance(one, Check):
            sentences.setdefault(one.sentence, []).append(one.holds)
    if not sentences:
        return NOT_TESTABLE
    enough = any if quantifier == EXISTENTIAL else all
    held = [enough(checks) for checks in sentences.values()]
    return SUPPORTED if all(held) else PARTLY if any(held) else REFUTED


def combined(verdicts: Mapping[str, str], quantifier: str = NAMED) -> tuple[str, bool, str]:
    """The verdict over all sets of gains, whether it flips between them, and the sentence that says so."""
    kinds = set(verdicts.values())
    if len(kinds) == 1:
        return kinds.pop(), False, ""
    told = ", ".join(f"{kind} with {name} gains" for name, kind in verdicts.items())
    decisive = {UNIVERSAL: REFUTED, EXISTENTIAL: SUPPORTED}.get(quantifier)
    if decisive in kinds:
        return str(decisive), True, f"The claim is {quantifier}, so that one set of gains decides: {told}."
    return PARTLY, True, f"The verdict depends on the gains: {told}."


def numbers(found: Found) -> tuple[dict[str, dict[str, Any]], dict[str, float]]:
    """Checks and what stands beside them, by what they measure.

    Raises:
      ScenarioError: two of one name.
    """
    for i, one in enumerate(found):
        if any(one.what == other.what for other in found[:i]):
            raise ScenarioError(f"a claim measures {one.what!r} twice: name the two apart")
    told = ("value", "relation", "limit", "holds", "sentence")
    checks = {one.what: {name: getattr(one, name) for name in told} for one in found if isinstance(one, Check)}
    return checks, {one.what: float(one.value) for one in found if isinstance(one, Beside)}
