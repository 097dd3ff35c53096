"""Thresholds as text: what a number of a claim must be, as a paper's file states it.

    Threshold.read("exponent", "2 +- 0.1").evidence({"duffing": 1.97})

A threshold is "< 1", "<= 1", "> 1", ">= 1", "2 +- 0.1" (within 0.1 of 2) or "2 to 15". It is about one measure, a
number that the claim's function returns, or several numbers of one kind: one for each plant, law or level.
"""

import math
import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.evidence.audit.verdict import APART, Beside, Check, check

NUMBER = r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|inf)\s*"
LIMIT = re.compile(rf"\s*(<=|>=|<|>){NUMBER}")
WITHIN = re.compile(rf"{NUMBER}(?:\+-|±){NUMBER}")
BETWEEN = re.compile(rf"{NUMBER}to{NUMBER}")
FORMS = 'write it as "< 1", "<= 1", "> 1", ">= 1", "2 +- 0.1" or "2 to 15"'


class Threshold(NamedTuple):
    """What a measure must be: `relation limit`, or a distance from `low` .. `high` that is at most `limit`.

    Attributes:
      measure: the name of the number.
      text: the threshold as it was written.
      relation, limit: what is asked of the number itself, or of its distance from the range.
      low, high: the range; equal for "2 +- 0.1". None for a limit.
      sentence: which of the claim's sentences it is about.
    """

    measure: str
    text: str
    relation: str
    limit: float
    low: float | None = None
    high: float | None = None
    sentence: str = ""

    @classmethod
    def read(cls, measure: str, text: object, sentence: str = "") -> "Threshold":
        """Return the threshold in a text."""
        words = text if isinstance(text, str) else ""
        if found := LIMIT.fullmatch(words):
            return cls(measure, words, found[1], float(found[2]), sentence=sentence)
        if found := WITHIN.fullmatch(words):
            middle, width = map(float, found.groups())
            return cls(measure, words, "<=", width, middle, middle, sentence)
        found = BETWEEN.fullmatch(words)
        if not found or float(found[1]) >= float(found[2]):
            raise ScenarioError(f"the threshold of {measure!r} is {shown(text)}: {FORMS}")
        return cls(measure, words, "<=", 0.0, float(found[1]), float(found[2]), sentence)

    def __str__(self) -> str:
        """Return the measure and what is asked of it."""
        return f"{self.measure} {self.text}" if self.low is None else f"{self.measure} is {self.text}"

    def distance(self, value: float) -> float:
        """Return how far a number is from the range; NaN for NaN."""
        if self.low is None or self.high is None:
            raise ScenarioError(f"the threshold of {self.measure!r} is {self.text!r}, which has no range: {FORMS}")
        return math.nan if math.isnan(value) else max(self.low - value, value - self.high, 0.0)

    def evidence(self, values: Mapping[str, float]) -> Iterator[Check | Beside]:
        """Yield a check for each number, by the name of its case; "" for a number without a case.

        For a range the check is of the distance from it, and the number stands beside.
        """
        for case, value in values.items():
            what = f"{case}: {self.measure}" if case else self.measure
            if self.low is None or self.high is None:
                yield check(what, value, self.relation, self.limit, self.sentence)
                continue
            of = f"{self.low:g}" if self.low == self.high else f"{self.low:g} to {self.high:g}"
            yield check(f"{what}{APART}{of}", self.distance(value), self.relation, self.limit, self.sentence)
            yield Beside(what, value)
