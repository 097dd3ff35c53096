"""A search over the gains that a paper allows, for a claim about all of them or about some.

A claim about all gains is refuted by one counter-example, and a claim about some is supported by
one example: the search stops there. It tries the gains of the set and the claim's examples first,
then points spread over the bounds, then points around the best of them. It measures these points as
a quick audit does, and the one that decides in full. Nothing is random, so a second audit finds the
same gains.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.evidence.audit.claim_runs import ClaimRuns
from smc_mujoco.evidence.audit.paper import Allowed, ClaimEntry, failed
from smc_mujoco.evidence.audit.verdict import Beside, Check, Evidence

QUICK_SPREAD_SETS, QUICK_NEAR_SETS = 2, 0  # in a quick audit
NEAR_BOUNDS_SHARE = 0.25  # share of the bounds, on a logarithmic scale, around the best
DRAWN_POINTS = 2000  # points drawn to find gains that meet the theorem's conditions

Gains = dict[str, float]
Bounds = Mapping[str, tuple[float, float]]


class TriedGains(NamedTuple):
    """Gains, and the evidence at them."""

    gains: Gains
    evidence: Evidence

    @property
    def rank(self) -> tuple[bool, float]:
        """Key that orders gains: whether all checks hold, then the least slack."""
        held = []
        slacks = []
        for check in self.evidence:
            if isinstance(check, Check):
                held.append(check.holds)
                slacks.append(check.slack)
        return all(held), min(slacks, default=math.inf)


def decisive(
    entry: ClaimEntry, runs: ClaimRuns, measure: Callable[[ClaimRuns], Evidence]
) -> Evidence:
    """Return the evidence at the gains that decide, with these gains and their margins beside.

    A claim about some gains is decided for each plant by itself, because plants may need different
    gains.
    """
    if entry.over == "all" or len(entry.plants) == 1:
        return _decisive(entry, runs, measure, "")
    evidence = []
    for plant in entry.plants:
        claim = dataclasses.replace(entry, plants=(plant,))
        evidence += _decisive(claim, runs.on(plant), measure, f"{plant}: ")
    return evidence


def _decisive(
    entry: ClaimEntry, runs: ClaimRuns, measure: Callable[[ClaimRuns], Evidence], prefix: str
) -> Evidence:
    """Return the evidence at the gains that decide on all plants of a claim."""
    law = entry.searched or entry.laws[0]
    best = min if entry.over == "all" else max
    theorem = Theorem(entry, runs)
    in_full: list[TriedGains] = []
    quickly: list[TriedGains] = []

    def decides(gains: Gains, quick: bool) -> bool:
        """Try gains, and return whether they decide: a counter-example to "all", or an example of
        "some".
        """
        tried = TriedGains(gains, measure(runs.at(law, gains, quick or runs.quick)))
        (quickly if quick else in_full).append(tried)
        return tried.rank[0] != (entry.over == "all")

    def search() -> None:
        spread, near = theorem.allowed.spread, theorem.allowed.near
        if runs.quick:
            spread, near = QUICK_SPREAD_SETS, QUICK_NEAR_SETS
        for gains in theorem.points(theorem.allowed.bounds, spread):
            if decides(gains, True):
                return
        centre = best(quickly, key=lambda tried: tried.rank).gains
        for gains in theorem.points(theorem.around(centre), near):
            if decides(gains, True):
                return

    starts = [{gain: theorem.rest[gain] for gain in theorem.allowed.bounds}]
    if len(entry.plants) == 1 and entry.plants[0] in entry.examples:
        starts.append(dict(entry.examples[entry.plants[0]]))
    met = []
    for gains in starts:
        if theorem.smallest(gains) > 0.0:
            met.append(gains)
    if not any(decides(gains, False) for gains in met):
        search()
        decides(best(quickly, key=lambda tried: tried.rank).gains, False)
    last = best(in_full, key=lambda tried: tried.rank)
    beside = []
    for gain, value in last.gains.items():
        beside.append(Beside(f"{prefix}decided at {gain}", value))
    for name, value in theorem.margins(last.gains).items():
        beside.append(Beside(f"{prefix}margin of {name}", value))
    return [*last.evidence, *beside, Beside(f"{prefix}sets of gains tried", len(quickly) + 1)]


class Theorem:
    """What a paper asks of the gains of a claim's first law."""

    def __init__(self, entry: ClaimEntry, runs: ClaimRuns):
        law = entry.searched or entry.laws[0]
        self.allowed: Allowed = runs.paper.allowed[law]
        self.rest: Mapping[str, float] = runs.paper.law(
            entry.plants[0], law, runs.gains
        ).gains  # of the set
        self._failed = lambda error: failed(runs.paper, entry, error)

    def points(self, bounds: Bounds, count: int) -> Iterator[Gains]:
        """Return gain sets within bounds that meet the conditions, at most `count`."""
        met = self._meeting(bounds)
        first = next(met, None)
        if first is None:
            raise self._failed(
                ScenarioError("no gains in [allowed] meet the conditions: widen its bounds")
            )
        return itertools.islice(itertools.chain([first], met), count)

    def _meeting(self, bounds: Bounds) -> Iterator[Gains]:
        """Yield gain sets within bounds that meet the conditions, spread over the logarithms
        (Halton's points).
        """
        from scipy.stats import qmc

        low, high = np.log(list(bounds.values())).T
        for point in qmc.Halton(len(bounds), scramble=False).random(DRAWN_POINTS)[1:]:
            gains = dict(zip(bounds, np.exp(low + (high - low) * point).tolist(), strict=True))
            if self.smallest(gains) > 0.0:
                yield gains

    def around(self, gains: Gains) -> Bounds:
        """Return narrower bounds around gains, within those of the paper."""
        narrow = {}
        for gain, (low, high) in self.allowed.bounds.items():
            reach = (high / low) ** (NEAR_BOUNDS_SHARE / 2.0)
            narrow[gain] = max(low, gains[gain] / reach), min(high, gains[gain] * reach)
        return narrow

    def margins(self, gains: Gains) -> dict[str, float]:
        """Return condition of the theorem -> margin at these gains; none without conditions."""
        if self.allowed.margins is None:
            return {}
        try:
            margins = {}
            for name, value in self.allowed.margins({**self.rest, **gains}).items():
                margins[name] = float(value)
            return margins
        except Exception as error:  # whatever a user's function raises
            raise self._failed(error) from error

    def smallest(self, gains: Gains) -> float:
        """Return the smallest margin; infinite without conditions."""
        return min(self.margins(gains).values(), default=math.inf)
