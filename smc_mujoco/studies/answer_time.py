"""The time of an answer: when it must be there, and how long the runs after a race will take.

Runs are timed, per unit of `Scenario.work`, wherever they are made, so that a computer that gets
busy is noticed. What follows a race, the choice of gains, the tables and the margins, is a known
number of runs, so its time is known before it begins. A race leaves that much, but for the first
sets of laws, which go before all of it. Where less is left, tables have fewer runs, and margins
take the time of a film, or have fewer kinds. A time is that of `time.monotonic`, s.
"""

import contextlib
import dataclasses
import math
import time
from collections.abc import Iterator

FEWEST_SEEDS = 5  # of the tables, unless the time is over; chosen
FILMED = 0.5  # minutes that are left for the report and a film, which margins may use first, and
FILMED_SHARE = 0.2  # the largest share that they take of the minutes; chosen
SLACK = 0.03  # of the minutes, which nothing plans to use; chosen
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
    least: the work of the runs without which there is no answer.
    pace: how long a unit of work takes, s, as the last runs took; 0 before them.
    searching: how long a unit of a search's work takes, over `pace`, as the last search took.
    """

    ends: float = math.inf
    spare: float = 0.0
    after: float = 0.0
    table: float = 0.0
    choice: float = 0.0
    unit: float = 0.0
    least: float = 0.0
    pace: float = 0.0
    searching: float = 1.0

    @classmethod
    def within(cls, began: float, minutes: float | None) -> "AnswerTime":
        """Return the time of an answer that is asked for within minutes; None for no limit."""
        if minutes is None:
            return cls()
        spare = 60.0 * min(FILMED, FILMED_SHARE * minutes)
        return cls(began + 60.0 * (1.0 - SLACK) * minutes - spare, spare)

    def judged(self, sets: float, seconds: float) -> None:
        """Take note of how long the judgement of that many sets of gains took."""
        self.ran(sets * self.unit, seconds)

    def ran(self, work: float, seconds: float) -> None:
        """Take note of how long runs took."""
        if work:
            self.pace = seconds / work

    @contextlib.contextmanager
    def timed(self, work: float) -> Iterator[None]:
        """Take note of how long the block takes, which makes runs."""
        start = time.monotonic()
        yield
        self.ran(work, time.monotonic() - start)

    def searched(self, work: float, seconds: float) -> None:
        """Take note of how long a search took."""
        if self.pace and work:
            self.searching = seconds / (self.pace * work)

    def search_seconds(self, work: float) -> float:
        """Return how long a search will take, s; 0 before any run was timed."""
        return self.pace * self.searching * work

    def race_ends(self, laws: int, first: bool = False) -> float:
        """Return when a race of so many laws must end. For the `first` set of a law it may go on
        into the time of the choice.
        """
        of_law = self.table if first else self.table + self.choice
        return self.ends - self.pace * (self.after + min(laws, SHOWN) * of_law)

    @property
    def first_sets_end(self) -> float:
        """When the searches for first sets must end, whatever else is left out."""
        return self.ends - self.pace * self.least

    @property
    def left(self) -> float:
        """The time that is left, s."""
        return self.ends - time.monotonic()

    def fits(self, work: float) -> bool:
        """Return whether runs fit in the time that is left."""
        return self.work_left >= work

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
        if the work `then` is to follow: FEWEST_SEEDS at least, or one where the time is over.
        """
        fit = (self.work_left - then) / work
        if fit >= wanted:
            return wanted
        if not self.fits(FEWEST_SEEDS * work):
            return max(1, min(wanted, int(self.work_left / work)))
        return min(wanted, max(FEWEST_SEEDS, int(fit)))
