"""A claim's entry in the catalogue: a function of runs that returns checks, and what the paper says.

    @claim("3", "reduces chattering", where="abstract", measured="TV rate against classical SMC, nominal",
           holds_if="< 1 % of classical")
    def reduces_chattering(runs: Runs) -> list[Check]: ...

Thresholds were fixed before any run, and are not moved. What becomes of checks is told in `verdict`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING

from smc_mujoco.studies.paper.claims.verdict import NAMED, Found

if TYPE_CHECKING:
    from smc_mujoco.studies.paper.claims.evidence import Runs

Evidence = Callable[["Runs"], Found]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry:
    """A claim's entry in the catalogue; attributes as of `claim`."""

    id: str
    text: str
    where: str
    measured: str
    holds_if: str
    note: str
    late: bool
    quantifier: str
    evidence: Evidence

    def __call__(self, runs: Runs) -> Found:
        """Its checks under one set of gains, and what is told beside them."""
        return self.evidence(runs)


def claim(
    id: str,
    text: str,
    *,
    where: str,
    measured: str,
    holds_if: str,
    note: str = "",
    late: bool = False,
    quantifier: str = NAMED,
) -> Callable[[Evidence], Entry]:
    """Decorator: enter a function Runs -> checks in the catalogue.

    Args:
      id: as the list of claims numbers it.
      text: what the paper says, in a few words.
      where: in the paper.
      measured: what is run, and what is measured on it.
      holds_if: the threshold, in words.
      note: what a reader must know to judge the numbers: why a part is not testable, what stands for what.
      quantifier: UNIVERSAL, EXISTENTIAL, or NAMED: about the plants and conditions that it names, and no others.
      late: whether it is to look at the runs of all other claims, and so comes after them.
    """

    def enter(evidence: Evidence) -> Entry:
        return Entry(
            id=id,
            text=text,
            where=where,
            measured=measured,
            holds_if=holds_if,
            note=note,
            late=late,
            quantifier=quantifier,
            evidence=evidence,
        )

    return enter
