"""Facts that an answer states: frozen records, filled where they are computed."""

import math

from smc_mujoco.common.aliases import Names
from smc_mujoco.common.data import frozen_data, keyword_dataclass


@keyword_dataclass
class Lead:
    """How far a law's value is below a rival's, as a share of the rival's, over an interval."""

    law: str
    rival: str
    metric: str  # as a reader says it, such as "J"
    low: float  # a share; the least that the interval holds
    high: float = math.nan  # a share; NaN where the value is below its floor: no ratio is known
    gaps: str = ""  # in how many runs the rival has no value, such as "5 of 24"


@keyword_dataclass
class Trails:
    """A law that others beat: how many times the first law's value it has."""

    law: str
    leader: str
    metric: str
    times: float  # the middle of the ratio in paired runs
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
    sets_needed: int = 0  # sets of gains with which a verdict is possible; 0 if these suffice


@keyword_dataclass
class Unranked:
    """Why no law can win in a metric, or which laws are not ranked, in the field's words."""

    metric: str
    reason: str


@frozen_data
class Settles:
    """How many runs settle, of how many."""

    count: int
    of: int


@keyword_dataclass
class Use:
    """The law to use, with its gains, and the laws that lead in other metrics."""

    law: str
    gains: str  # as a user writes them, "k1=41.2, k2=310"; "" for a law without gains
    unless: tuple[tuple[str, str], ...] = ()  # (what matters most, the law then)


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
