"""The time of an answer: when it must be there, and how long the runs after a race will take.

The runs by which a race judges sets of gains are timed, per unit of `Scenario.work`. What follows
them, the choice of gains, the tables and the margins, is a known number of runs, so its time is
known before it begins. A race leaves that much. Where less is left, tables have fewer runs, and
margins take the time of a film, or have fewer kinds. A time is that of `time.monotonic`, s.
"""

import dataclasses
import math
import time

FEWEST_SEEDS = 5  # of the tables, however short the time is; chosen
FILMED = 0.5  # minutes that are left for a film, which margins may use first, and
FILMED_SHARE = 0.2  # the largest share that they take of the minutes; chosen
SHOWN = 5  # laws in the tables by condition, at most; chosen


@dataclasses.dataclass
class AnswerTime:
    """When an answer must be there, and how fast runs are.

    ends: a time, inf for no limit.
    spare: how long margins may go on after that, s; what they leave is for a film.
    after: the work of the runs that must follow a race, beside those of single laws.
    table: the work of a law's runs for the tables, at the least.
    choice: the work of the runs that choose a law's gains and compare the law with others.
    unit: the work of a judgement of one set of gains.
    pace: how long a unit of work takes, s, as the last runs of a race took; 0 before them.
    """

    ends: float = math.inf
    spare: float = 0.0
    after: float = 0.0
    table: float = 0.0
    choice: float = 0.0
    unit: float = 0.0
    pace: float = 0.0

    def judged(self, sets: float, seconds: float) -> None:
        """Take note of how long the judgement of that many sets of gains took."""
        if sets and self.unit:
            self.pace = seconds / (sets * self.unit)

    def race_ends(self, laws: int, first: bool = False) -> float:
        """Return when a race of so many laws must end. For the `first` set of a law it may go on
        into the time of the choice.
        """
        of_law = self.table if first else self.table + self.choice
        return self.ends - self.pace * (self.after + min(laws, SHOWN) * of_law)

    @property
    def left(self) -> float:
        """The time that is left, s."""
        return self.ends - time.monotonic()

    @property
    def work_left(self) -> float:
        """The work that fits in the time that is left; inf before any was timed."""
        return max(0.0, self.left) / self.pace if self.pace else math.inf

    @property
    def margins_left(self) -> float:
        """The work that fits in the time that is left for margins; inf before any was timed."""
        return max(0.0, self.left + self.spare) / self.pace if self.pace else math.inf

    def seeds(self, wanted: int, work: float, then: float) -> int:
        """Return from how many seeds the tables are made, of those `wanted`, given the work of one,
        if the work `then` is to follow.
        """
        fit = (self.work_left - then) / work
        return wanted if fit >= wanted else min(wanted, max(FEWEST_SEEDS, int(fit)))
