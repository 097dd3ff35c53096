"""Facts that an answer states: frozen records, filled where they are computed."""

import math

from smc_mujoco.common.aliases import Names
from smc_mujoco.common.data import frozen_data, keyword_dataclass


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
    # whether the ratio of the medians in the table lies on the other side of 1
    medians_differ: bool = False


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


@keyword_dataclass
class Sample:
    """What a number of a table is of."""

    seeds: int
    runs: int  # distinct ones
    sets: int  # the least number of sets of gains of a law that has several
    more: bool  # whether some laws have more sets
    single: bool  # whether a law has one set of gains


@frozen_data
class Settles:
    """How many runs settle, of how many."""

    count: int
    total: int


@keyword_dataclass
class Use:
    """The law to use, with its gains, and the laws that lead in other metrics."""

    law: str
    gains: str  # as a user writes them, "k1=41.2, k2=310"; "" for a law without gains
    # (what matters most, the law then, its gains)
    unless: tuple[tuple[str, str, str], ...] = ()
    rivals: Names = ()  # the laws between which it is undecided; () for a winner
    metric: str = "J"  # in which


@frozen_data
class NextStep:
    """What to do next: a whole command to paste, and what it is for."""

    command: str
    purpose: str = ""


@frozen_data
class More:
    """Where the evidence stands: a file, what is in it, and the words that `explain` knows."""

    report: str  # "" if none was written
    contents: str = ""
    words: Names = ()


@frozen_data
class Beware:
    """What the reader must know before use, on one line that says what to do."""

    about: str  # one or two words, the label of the line
    sentence: str


# which


@frozen_data
class SettledRuns:
    """In how many runs a law settles, from when to when, s, and in how many under all conditions at
    once.
    """

    runs: Settles
    first: float  # s, NaN where none settles
    last: float
    together: Settles | None = None


@frozen_data
class Level:
    """A level that a law withstands."""

    kind: str  # a kind of margins
    value: float  # NaN where not even the unchanged run holds
    unit: str
    open: bool  # whether the search ended there


@frozen_data
class RaceSize:
    """How large a race was."""

    raced: int  # laws with a set of gains
    named: int  # laws that were to race
    sets: int  # of gains, of each law
    searched: bool  # whether sets are of searches; else they are runs with the same gains
    shorter: bool  # whether the first sets are from shorter searches
    untried: int  # further laws of the package that suit


@keyword_dataclass
class Caution:
    """What to know before a law is used: a kind of `answers.CAUTIONS`, and its numbers."""

    kind: str
    where: str = ""  # a condition, or names
    value: float = math.nan
    most: float | None = None
    unit: str = ""
    share: float = math.nan
    frequency: float = math.nan  # Hz
    count: int = 0
    run_count: int = 0
    reason: str = ""  # in the words of an error


@keyword_dataclass
class WhichFacts:
    """The answer to which law suits a plant."""

    form: str  # "law", "undecided", "unneeded", "unsettled", "unkept" or "untried"
    never: Names  # conditions in which no law settles
    law: str
    gains: str
    unit: str  # of u, where it is no force
    file: str  # with the gains; "" if they were given
    modelled: bool  # whether the law reads the nominal model
    size: RaceSize
    lead: Lead | None  # of the law over its nearest rival
    over_sets: bool  # whether sets of gains name the law, and not only runs with its gains
    rivals: int  # laws that the lead is over
    over_none: Lead | None
    undecided: Names  # the laws that may be best
    sets_needed: int  # that decide; 0 if more do not help
    minutes_needed: float  # for the missing sets; NaN where that is not known
    runs: SettledRuns
    conditions: Names  # asked for
    limits: Names  # asked for
    levels: tuple[Level, ...]
    untried: Names  # kinds of margins without time
    without: Settles | None  # how many runs settle with u = 0
    cautions: tuple[Caution, ...]
    folder: str


# compare


@keyword_dataclass
class Grid:
    """Numbers of laws, or of what else has a row."""

    columns: tuple[tuple[str, str], ...]  # a name as a reader says it, and its unit
    rows: tuple[tuple[str, tuple[str, ...]], ...]  # a law and its numbers
    winners: Names  # of each column, "" where none wins


@keyword_dataclass
class Contest:
    """Laws compared on a plant in a condition."""

    plant: str
    condition: str
    sample: Sample
    grid: Grid
    summed: Names  # the conditions that J sums; () without J
    settled: tuple[tuple[str, Settles], ...]  # by law
    use: Use | None  # None if no law is to be preferred
    verdicts: tuple[Verdict, ...]
    trails: tuple[Trails, ...] = ()
    not_ranked: tuple[NotRanked, ...] = ()


@keyword_dataclass
class CompareFacts:
    """What a comparison says on one screen."""

    contests: tuple[Contest, ...]
    bewares: tuple[Beware, ...] = ()
    next: NextStep | None = None
    more: More | None = None


# identify


@frozen_data
class IdentifiedNumber:
    """A number of a machine, with its standard error, both as text."""

    name: str
    value: str
    error: str
    unit: str


@keyword_dataclass
class IdentifyFacts:
    """What an identification says on one screen."""

    numbers: tuple[IdentifiedNumber, ...]
    fit: float  # percent: the worst of all columns of all logs
    by_pieces: bool  # whether that is of pieces of 1 s
    held_out: float | None  # the same of the log that was kept aside
    doubts: tuple[str, ...]  # each says what to do


# the boards of tracking problems


@keyword_dataclass
class ProblemStanding:
    """Where an entry stands in a problem."""

    problem: str
    place: int
    level: bool  # whether no other entry leads it
    error: str  # in counts
    first: str  # the entry with the least error
    least: str  # its error


@keyword_dataclass
class EnteredFacts:
    """An entry in a suite, beside those that entered before."""

    entry: str
    suite: str
    entries: int  # in all
    standings: tuple[ProblemStanding, ...]  # one for each problem
    page: str  # the file of the board


# what a law bears


@keyword_dataclass
class MarginsFacts:
    """The most that laws tolerate on each plant."""

    duration: float  # of a run, s
    gains: str  # where they are from
    grids: tuple[tuple[str, Grid], ...]  # by plant
    failing: Names  # laws of which not even the unchanged run is tolerated
    next: NextStep


@keyword_dataclass
class WorstFacts:
    """The worst runs found of laws on a plant."""

    about: str  # the plant, and the metric
    runs: int  # of each law
    bounds: str  # of the class, in words
    grid: Grid
    lead: Lead | None  # of the first law over the second, of the worst runs found
    outside: tuple[tuple[str, str], ...]  # a law, and why its theorem does not cover the class
    next: NextStep


@keyword_dataclass
class SensitivityFacts:
    """What explains the variance of a score."""

    about: str  # the law and the plant
    metric: str
    first: str  # the axis that explains most; "" if the intervals do not tell
    share: tuple[float, float]  # its share of the variance, an interval
    grid: Grid
    spread: tuple[str, str]  # of the metric of 90 % of the runs, with units
    failed: Settles  # runs that fail, of all
    narrow: str  # the half of an axis to keep, in words; "" if none is better
    medians: tuple[str, str]  # before and in that half
    next: NextStep


@keyword_dataclass
class TuneFacts:
    """The gains that searches found for a law."""

    law: str
    plant: str
    gains: str
    objective: float  # s^2
    before: float  # s^2, of the law's own gains
    searches: int
    spread: str  # between the J at which the searches ended, such as "4.1 %"; "" of one search
    at_bound: tuple[tuple[str, str], ...]  # a gain, and "lower" or "upper"
    next: NextStep


# audits


@keyword_dataclass
class ClaimsFacts:
    """The verdicts on a paper's claims."""

    counts: tuple[tuple[str, tuple[str, ...]], ...]  # whose claims: how many have each verdict
    supported: Settles  # claims that hold under every set of gains, of those supported
    refuted: tuple[tuple[str, str], ...]  # an id, and the claim
    next: NextStep | None
