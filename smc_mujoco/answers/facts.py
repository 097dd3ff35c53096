"""Facts that an answer states: records, filled where they are computed."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from smc_mujoco.common.aliases import Names
from smc_mujoco.common.data import frozen_data, keyword_dataclass
from smc_mujoco.common.tabular import Tabular


class Fact:
    """A fact of one line: its kind, which has a template in `templates.TEXTS`, and the values that
    this has by name. A value may be a record of this file, or facts.
    """

    def __init__(self, kind: str, **values: Any):
        self.kind = kind
        self.values = values


class Span(NamedTuple):
    """A range of numbers; NaN where it is not known."""

    low: float
    high: float


@frozen_data
class Settles:
    """In how many runs something is so, of how many."""

    count: int
    total: int


@frozen_data
class NextStep:
    """What to do next: a whole command to paste, and what it is for."""

    command: str
    purpose: str


# comparisons


@keyword_dataclass
class Lead:
    """How far a law's value is below a rival's, as a share of the rival's, over an interval."""

    law: str
    rival: str  # the runner-up, over which the lead is least; "" if no ratio is known
    metric: str  # as a reader says it, such as "J"
    low: float = math.nan  # a share; the least that the interval holds
    high: float = math.nan  # a share; NaN where the value is below its floor: no ratio is known
    gaps: str = ""  # in how many runs the rival has no value, such as "5 of 24"
    floor: str = ""  # in words, if the value is below it and the rival's is not
    ratio: float = math.nan  # of the law's value to the rival's, the pseudo-median of the pairs
    ahead: int = 0  # number of samples in which the law is better by what counts
    samples: int = 0
    unit: str = "runs"  # what a sample is
    lower: Names = ()  # rivals whose median in the table is below the law's

    @property
    def share(self) -> Span:
        """The interval."""
        return Span(self.low, self.high)


@keyword_dataclass
class Trails:
    """A law that others beat: how many times the first law's value it has."""

    law: str
    leader: str
    metric: str
    times: float  # the middle of the ratio in paired runs; NaN where none is known
    ahead: Names  # the laws that beat it, the first one among them


@keyword_dataclass
class Tied:
    """Laws that are level in a metric, or all below its floor: none need be preferred."""

    metric: str
    laws: Names
    floor: str = ""  # in words, if all are below it


@keyword_dataclass
class Open:
    """Laws of which none is shown to be better in a metric."""

    metric: str
    laws: Names
    hidden: float = math.nan  # a share: a smaller lead would not have been seen
    charged: float = 0.0  # a share that is taken off a lead for what changes late or at half a step
    needed: int = 0  # samples with which a verdict is possible; 0 if these suffice
    unit: str = "runs"  # what a sample is


@keyword_dataclass
class Barred:
    """Laws that keep any rival from winning: by default gains, or as none of all laws arrives."""

    metric: str
    laws: Names
    defaults: bool  # whether by their default gains


@keyword_dataclass
class NotRanked:
    """A law with too few samples to be ranked beside the others."""

    metric: str
    law: str
    samples: int
    needed: int
    unit: str


Verdict = Lead | Tied | Open | Barred


def renamed(fact: Verdict, name: Callable[[str], str]) -> Verdict:
    """Return a verdict with other names of its laws."""
    changes: dict[str, Any] = {}
    for field, value in vars(fact).items():
        if field in ("law", "rival") and value:
            changes[field] = name(value)
        elif field == "laws":
            changes[field] = tuple(map(name, value))
    return dataclasses.replace(fact, **changes)


@keyword_dataclass
class Contest:
    """Laws compared on a plant in a condition."""

    plant: str
    condition: str
    sample: Fact
    table: Tabular  # a law a row, a metric a column; a winner's number is strong
    metrics: Names  # of its columns, as a reader says them
    settled: Fact | None  # how many runs of each law; None if that was not asked
    use: Fact | None  # the law to use; None if none is to be preferred
    verdicts: tuple[Verdict, ...]
    trails: tuple[Trails, ...] = ()
    not_ranked: tuple[NotRanked, ...] = ()


@keyword_dataclass
class Screen:
    """What a result says on one screen, in the order in which it is printed."""

    contests: Sequence[Contest] = ()
    heading: Fact | None = None
    tables: Sequence[Tabular] = ()
    notes: Sequence[Fact] = ()  # below the tables
    facts: Sequence[Fact | Lead] = ()  # each on a line of its own, with a label
    next: NextStep | None = None
    report: str = ""  # the file with the evidence; "" if none was written
    word: str = ""  # that `explain` knows
