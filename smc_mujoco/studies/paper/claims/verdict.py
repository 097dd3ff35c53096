"""From checks to verdicts: a measured number against its limit, a claim under one set of gains, and over several.

A claim consists of one sentence or of several. A sentence holds where all its checks hold; an existential one ("may",
"there is") where one does. Under one set of gains a claim is supported where all its sentences hold, refuted where none
does, partly supported between; without checks it is not testable.

Over several sets the verdict is the one that they have in common; where they differ it is partly supported, and flips.
A universal claim ("every", "any", "by construction") speaks of all gains: a counter-example under one set refutes it.
An existential one is supported by an example under one set.
"""

import dataclasses
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from smc_mujoco.common import files
from smc_mujoco.common.errors import ScenarioError, find

SUPPORTED, PARTLY, REFUTED, NOT_TESTABLE = VERDICTS = ("supported", "partly supported", "refuted", "not testable")
MARKS = {SUPPORTED: "●", PARTLY: "◐", REFUTED: "○", NOT_TESTABLE: "–"}

UNIVERSAL, NAMED, EXISTENTIAL = QUANTIFIERS = ("universal", "of what it names", "existential")

RELATIONS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


class Check(NamedTuple):
    """A measured number against its limit: `value relation limit`. `sentence`: which of the claim's it is about."""

    what: str
    value: float
    relation: str
    limit: float
    holds: bool
    sentence: str = ""

    @property
    def slack(self) -> float:
        """By how much it holds, as a share of the limit, or of 1 where that is 0; negative where it is missed."""
        room = self.limit - self.value if self.relation in ("<", "<=") else self.value - self.limit
        if math.isnan(room):
            return -math.inf
        return room / (abs(self.limit) or 1.0) if math.isfinite(self.limit) else room


class Beside(NamedTuple):
    """A number that decides nothing: what theory says, or how a law does that the paper does not have."""

    what: str
    value: float


def check(what: str, value: float, relation: str, limit: float, sentence: str = "") -> Check:
    """Return the check of a value against its limit.

    NaN never holds. Nor does infinity against infinity: of two laws that never settle, neither is faster.

    Raises:
      ScenarioError: a relation other than <, <=, > and >=.
    """
    compare = find("relation", relation, RELATIONS)
    value, limit = float(value), float(limit)
    undecided = math.isinf(value) and value == limit
    return Check(what, value, relation, limit, bool(compare(value, limit)) and not undecided, sentence)


def about(sentence: str, *checks: Check) -> list[Check]:
    """Return the checks as checks of one of the claim's sentences."""
    return [one._replace(sentence=sentence) for one in checks]


def ratio(value: float, reference: float) -> float:
    """Return value / reference; x / 0 is infinite, 0 / 0 and inf / inf are NaN."""
    if reference == 0.0:
        return math.nan if value == 0.0 else math.copysign(math.inf, value)
    return value / reference


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
        """Return the checks under a set of gains."""
        return [Check(what, **numbers) for what, numbers in self.numbers[gains].items()]

    def decisive(self, gains: str) -> Check | None:
        """Return the check missed by most, else that with the least room, under a set of gains; None without checks."""
        return min(self.checks(gains), key=lambda one: (one.holds, one.slack), default=None)

    def plain(self) -> dict[str, Any]:
        """Return the claim as JSON data; numbers that JSON lacks become "Infinity", "-Infinity" and "NaN"."""
        return files.plain(dataclasses.asdict(self))


def verdict(found: Found, quantifier: str = NAMED) -> str:
    """Return the verdict under one set of gains."""
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
    """Return the verdict over all sets of gains, whether it flips between them, and a sentence about that."""
    kinds = set(verdicts.values())
    if len(kinds) == 1:
        return kinds.pop(), False, ""
    told = ", ".join(f"{kind} with {name} gains" for name, kind in verdicts.items())
    decisive = {UNIVERSAL: REFUTED, EXISTENTIAL: SUPPORTED}.get(quantifier)
    if decisive in kinds:
        return str(decisive), True, f"The claim is {quantifier}, so that one set of gains decides: {told}."
    return PARTLY, True, f"The verdict depends on the gains: {told}."


def numbers(found: Found) -> tuple[dict[str, dict[str, Any]], dict[str, float]]:
    """Return checks and the numbers beside them, by what they measure.

    Raises:
      ScenarioError: two of one name.
    """
    for i, one in enumerate(found):
        if any(one.what == other.what for other in found[:i]):
            raise ScenarioError(f"a claim measures {one.what!r} twice: name the two apart")
    told = ("value", "relation", "limit", "holds", "sentence")
    checks = {one.what: {name: getattr(one, name) for name in told} for one in found if isinstance(one, Check)}
    return checks, {one.what: float(one.value) for one in found if isinstance(one, Beside)}
