"""A check: a measured number against its limit. And what is told beside the checks, and decides nothing."""

import math
import operator
from collections.abc import Callable
from typing import NamedTuple

from smc_mujoco.common.errors import find

RELATIONS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


class Check(NamedTuple):
    """One measured comparison: `value relation limit`; and which of the claim's sentences it is about."""

    what: str
    value: float
    relation: str
    limit: float
    holds: bool
    sentence: str = ""

    @property
    def slack(self) -> float:
        """By how much it holds, as a share of the limit (of 1 where that is 0); negative: by how much it is missed."""
        room = self.limit - self.value if self.relation in ("<", "<=") else self.value - self.limit
        if math.isnan(room):
            return -math.inf
        return room / (abs(self.limit) or 1.0) if math.isfinite(self.limit) else room


class Beside(NamedTuple):
    """A number told beside the checks: what theory says, or how a law does that the paper does not have."""

    what: str
    value: float


def check(what: str, value: float, relation: str, limit: float, sentence: str = "") -> Check:
    """A Check of a value against its limit.

    NaN never holds, and nor does infinity against the same infinity: of two times neither of which comes, none is the
    shorter, nor are they alike.

    Raises:
      ScenarioError: a relation other than <, <=, > and >=.
    """
    compare = find("relation", relation, RELATIONS)
    value, limit = float(value), float(limit)
    undecided = math.isinf(value) and value == limit
    return Check(what, value, relation, limit, bool(compare(value, limit)) and not undecided, sentence)


def about(sentence: str, *checks: Check) -> list[Check]:
    """Checks of one of the sentences that a claim consists of."""
    return [one._replace(sentence=sentence) for one in checks]


def ratio(value: float, reference: float) -> float:
    """value / reference; x / 0 is infinite, and NaN where x is 0; inf / inf is NaN."""
    if reference == 0.0:
        return math.nan if value == 0.0 else math.copysign(math.inf, value)
    return value / reference
