"""From checks to verdicts: a measured number against its limit, a claim under one set of gains, and
over several.

A claim consists of one sentence or several. A sentence holds if all its checks hold; an existential
one ("may", "there is") if one does. Under one set of gains a claim is supported if all its
sentences hold, refuted if none does, and else partly supported; without checks it is not testable.
A claim about some gains or cases is supported by one example. Without an example it is not refuted
but "not shown". Nor is a claim refuted by a limit that the paper's words do not give: it is "not as
measured".

A verdict is about what the paper says, or what follows from it. A question beside the paper gets an
answer instead, "yes" for "supported". `totals` counts the paper's own sentences alone.

If all sets of gains give the same verdict, that is the verdict of the claim. If they differ, the
claim is partly supported, and flips. A universal claim ("every", "any", "by construction") and one
over all gains are refuted by a counter-example under one set. An existential one and one over some
gains are supported by an example under one.
"""

import dataclasses
import math
import operator
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from smc_mujoco.common.aliases import Fields, Names, Numbers
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.tabular import Cell, Tabular

SUPPORTED = "supported"
PARTLY = "partly supported"
REFUTED = "refuted"
NOT_SHOWN = "not shown"
NOT_AS_MEASURED = "not as measured"
NOT_TESTABLE = "not testable"
VERDICTS: Names = (SUPPORTED, PARTLY, REFUTED, NOT_SHOWN, NOT_AS_MEASURED, NOT_TESTABLE)
ANSWERS: dict[str, str] = {
    SUPPORTED: "yes",
    PARTLY: "in part",
    REFUTED: "no",
    NOT_SHOWN: "no example",
    NOT_TESTABLE: "no answer",
}
MARKS: dict[str, str] = dict(zip((*VERDICTS, *ANSWERS.values()), "●◐○◌△–■◧□◇–", strict=True))

# Verdicts have a colour beside their mark, from a palette for the colour-blind; answers to
# questions have their own.
COLOURS: dict[str, str] = dict(
    zip(VERDICTS, ("blue", "yellow", "red", "dim", "dim", "dim"), strict=True)
)
COLOURS |= dict.fromkeys(ANSWERS.values(), "cyan")

PAPER, DERIVED, OURS = "paper", "derived", "ours"  # whose a claim is
LIMIT_IS_OURS = "none in the paper: the limit is ours, and refutes nothing"
WHOSE_WORDS = {PAPER: "the paper's", DERIVED: "derived", OURS: "a question"}

DISTANCE_WORDS = ", distance from "  # in a range check's name, between number and range
UNIVERSAL = "universal"
NAMED = "of what it names"
EXISTENTIAL = "existential"
QUANTIFIERS = {
    "universal": UNIVERSAL,
    "existential": EXISTENTIAL,
    "named": NAMED,
}  # as a paper's file names them

NUMBER_PATTERN = r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|inf)\s*"
LIMIT_PATTERN = re.compile(rf"\s*(<=|>=|<|>){NUMBER_PATTERN}")
TOLERANCE_PATTERN = re.compile(rf"{NUMBER_PATTERN}(?:\+-|±){NUMBER_PATTERN}")
RANGE_PATTERN = re.compile(rf"{NUMBER_PATTERN}to{NUMBER_PATTERN}")
CURE = 'write it as "< 1", "<= 1", "> 1", ">= 1", "2 +- 0.1" or "2 to 15"'
RELATIONS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


class Check(NamedTuple):
    """A measured number against its limit: `value relation limit`."""

    what: str
    value: float
    relation: str
    limit: float
    holds: bool
    sentence: str = ""  # the sentence of the claim that it is about

    def __str__(self) -> str:
        value, limit = self.texts
        return f"{self.what} = {value} ({limit} asked)"

    @property
    def texts(self) -> tuple[str, str]:
        """The value, and the relation with its limit, with as many digits as tell the two apart; a
        value that fails because it is its limit is "equal".
        """
        value = digits_of(self.value, self.what, self.limit)
        if self.value == self.limit and not self.holds:
            value = f"{value}, equal"
        return value, f"{self.relation} {digits_of(self.limit, self.what, self.value)}"

    @property
    def slack(self) -> float:
        """The distance to the limit as a share of it, or of 1 if it is 0; negative if the check
        fails.
        """
        if self.relation in ("<", "<="):
            room = self.limit - self.value
        else:
            room = self.value - self.limit
        if math.isnan(room):
            return -math.inf
        if math.isfinite(self.limit):
            return room / (abs(self.limit) or 1.0)
        return room


class Beside(NamedTuple):
    """A number without a threshold, such as a prediction, or the score of a law that the paper
    lacks.
    """

    what: str
    value: float


def check(what: str, value: float, relation: str, limit: float, sentence: str = "") -> Check:
    """Return the check of a value against its limit.

    NaN never holds. Nor does infinity against infinity: of two laws that never settle, neither is
    faster.
    """
    compare = find("relation", relation, RELATIONS)
    value, limit = float(value), float(limit)
    undecided = math.isinf(value) and value == limit
    return Check(
        what, value, relation, limit, bool(compare(value, limit)) and not undecided, sentence
    )


def digits_of(value: float, what: str, *others: float) -> str:
    """Return three significant digits, or as many as tell it from others; "none" for NaN, and
    "never" for an infinite time.
    """
    if math.isnan(value):
        return "none"
    if value == math.inf and "time" in what:
        return "never"
    digits = 3
    while any(f"{value:.{digits}g}" == f"{rival:.{digits}g}" for rival in others if rival != value):
        digits += 1
    return f"{value:.{digits}g}"


def ratio(value: float, reference: float) -> float:
    """Return value / reference; x / 0 is infinite, 0 / 0 and inf / inf are NaN."""
    if reference == 0.0:
        if value == 0.0:
            return math.nan
        return math.copysign(math.inf, value)
    return value / reference


Evidence = Sequence[Check | Beside]


class Threshold(NamedTuple):
    """What a measure must be, as a paper's file states it: "< 1", "<= 1", "> 1", ">= 1", "2 +- 0.1"
    or "2 to 15".

        Threshold.read("exponent", "2 +- 0.1").evidence({"duffing": 1.97})

    It is `relation limit`, or a distance from `low` .. `high` that is at most `limit`. The measure
    is a number that the claim's function returns, or several numbers of one kind: one for each
    plant, law or level.
    """

    measure: str
    text: str  # as it was written
    relation: str
    limit: float
    low: float = (
        math.nan
    )  # `low` .. `high` is the range: 2 .. 2 for "2 +- 0.1", NaN for a limit such as "< 1"
    high: float = math.nan
    sentence: str = ""  # the sentence of the claim that it is about

    @classmethod
    def read(cls, measure: str, text: object, sentence: str = "") -> "Threshold":
        """Return the threshold in a text."""
        words = text if isinstance(text, str) else ""
        if match := LIMIT_PATTERN.fullmatch(words):
            return cls(measure, words, match[1], float(match[2]), sentence=sentence)
        if match := TOLERANCE_PATTERN.fullmatch(words):
            middle, width = map(float, match.groups())
            return cls(measure, words, "<=", width, middle, middle, sentence)
        match = RANGE_PATTERN.fullmatch(words)
        if not match or float(match[1]) >= float(match[2]):
            raise ScenarioError(f"the threshold of {measure!r} is {shown(text)}: {CURE}")
        return cls(measure, words, "<=", 0.0, float(match[1]), float(match[2]), sentence)

    def __str__(self) -> str:
        if math.isnan(self.low):
            return f"{self.measure} {self.text}"
        return f"{self.measure} is {self.text}"

    def distance(self, value: float) -> float:
        """Return how far a number is from the range; NaN for NaN."""
        if math.isnan(value):
            return math.nan
        return max(self.low - value, value - self.high, 0.0)

    def evidence(self, values: Numbers) -> Iterator[Check | Beside]:
        """Yield a check for each case -> number; "" for a number without a case.

        For a range the check is of the distance from it, and the number stands beside.
        """
        for case, value in values.items():
            if case:
                what = f"{case}: {self.measure}"
            else:
                what = self.measure
            if math.isnan(self.low):
                yield check(what, value, self.relation, self.limit, self.sentence)
                continue
            if self.low == self.high:
                levels = f"{self.low:g}"
            else:
                levels = f"{self.low:g} to {self.high:g}"
            yield check(
                f"{what}{DISTANCE_WORDS}{levels}",
                self.distance(value),
                self.relation,
                self.limit,
                self.sentence,
            )
            yield Beside(what, value)


@keyword_dataclass
class Statement:
    """What the paper claims, and how it is measured."""

    id: str
    text: str  # what the paper says, in a few words
    where: str  # section of the paper
    measured: str  # what is run, and what is measured on it
    holds_if: str  # the threshold, in words
    # the paper's words that give the limit; OURS if none do; "" if it follows from what is claimed
    limit: str = ""
    note: str = ""  # what a reader must know to judge the numbers
    # UNIVERSAL, EXISTENTIAL, or NAMED: about only the plants and conditions that it names
    quantifier: str = NAMED
    whose: str = (
        PAPER  # PAPER, a sentence of the paper; DERIVED from one; or OURS, a question beside it
    )
    how: str = ""  # how it was derived, or why it is asked
    read: str = ""  # how much was read of the place where it stands, one of `paper.READ_PARTS`
    # "all" or "some" gains that the paper allows; "" if the paper's gains are known, or none matter
    over: str = ""
    # the set of gains of other laws with which a search over gains decides; "" for each set by
    # itself
    rivals: str = ""
    # plant -> gains of the law with which the claim holds there, which a search tries first
    examples: Mapping[str, Numbers] = frozen({})
    # what the author may claim instead, where it does not hold: a theorem or a measured bound
    instead: str = ""
    shown_by: str = ""  # the command that shows that

    @property
    def source(self) -> str:
        """Whose the claim is and what was read, in a few words."""
        return WHOSE_WORDS[self.whose] + (
            f", {self.read}" if self.read and self.whose != OURS else ""
        )


@keyword_dataclass
class Claim(Statement):
    """A claim and its verdict."""

    verdict: str  # over all sets of gains, one of VERDICTS; of a question one of ANSWERS
    numbers: dict[str, dict[str, Fields]]  # set of gains -> what was measured -> fields of a Check
    beside: dict[
        str, dict[str, float]
    ]  # set of gains -> what else was measured -> its value, which decides nothing
    verdicts: dict[str, str]  # set of gains -> verdict
    flips: bool  # whether the verdict depends on the set

    @property
    def for_every_set(self) -> bool:
        """Whether every set of gains that was run has the same verdict, and not by a search over
        the law's gains.
        """
        searched = self.over == "some" and not self.rivals
        return not self.flips and not searched

    @property
    def parts(self) -> dict[str, str]:
        """What a reader is told of it beside the numbers, without what it lacks."""
        parts = {
            "whose": ": ".join(filter(None, (self.source, self.how))),
            "kind": self.quantifier,
            "gains": f"{self.over} gains that the paper allows" if self.over else "",
            "measured": self.measured,
            "holds if": self.holds_if,
            "words for the limit": LIMIT_IS_OURS if self.limit == OURS else self.limit,
            "note": self.note,
        }
        for plant, gains in self.examples.items():
            words = ", ".join(f"{gain} = {value:g}" for gain, value in gains.items())
            parts[f"holds on {plant} with"] = words
        if self.instead and self.verdict != SUPPORTED:
            parts["instead"] = f"{self.instead} ({self.shown_by})"
        text_by_part = {}
        for name, text in parts.items():
            if text:
                text_by_part[name] = text
        return text_by_part

    @property
    def verdict_words(self) -> str:
        """The verdict with its mark, and whether it flips."""
        flips = ", flips with the gains" if self.flips else ""
        return f"{MARKS[self.verdict]} {self.verdict}{flips}"

    def _repr_html_(self) -> str:
        return Claims([self])._repr_html_()

    def checks(self, gains: str) -> list[Check]:
        """Return the checks under a set of gains."""
        checks = []
        for what, numbers in self.numbers[gains].items():
            checks.append(Check(what, **numbers))
        return checks

    def decisive(self, gains: str) -> Check | None:
        """Return the check that fails by most, else the one nearest to its limit; None without
        checks.
        """
        return min(self.checks(gains), key=lambda check: (check.holds, check.slack), default=None)

    def decided(self, gains: str) -> str:
        """Return the decisive check in a line, with the number instead of its distance; the note
        without checks.
        """
        if not (check := self.decisive(gains)):
            return self.note
        what, apart, middle = check.what.partition(DISTANCE_WORDS)
        if not apart or what not in self.beside.get(gains, {}):
            return str(check)
        width = f" +- {check.limit:g}" if check.limit else ""
        ends = []
        for end in middle.split(" to "):
            ends += [float(end) - check.limit, float(end) + check.limit]
        value = digits_of(self.beside[gains][what], what, *ends)
        return f"{what} = {value} ({middle}{width} asked)"


class Claims(list[Claim]):
    """Claims with their verdicts, a list that notebooks show as a table."""

    @property
    def table(self) -> Tabular:
        """Verdicts by set of gains, the words, and the check that decides for the last set."""
        sets = list(self[0].verdicts) if self else []
        rows = []
        for claim in self:
            marks = []
            for name in sets:
                verdict = claim.verdicts.get(name, claim.verdict)
                marks.append(Cell(MARKS[verdict], colour=COLOURS[verdict]))
            decided = claim.decided(sets[-1]) if claim.verdicts else claim.note
            below = f"{claim.verdict_words}; {claim.source}\n{decided}"
            rows.append((claim.id, *marks, Cell(claim.text, below)))
        last = f" ({sets[-1]} gains)" if sets else ""
        heads = ("id", *sets, f"claim, verdict, whose, decided by{last}")
        return Tabular(headings=heads, rows=rows, name_columns=len(heads))

    def _repr_html_(self) -> str:
        return dataclasses.replace(self.table, notes=[totals_line(self)])._repr_html_()


def totals(claims: Sequence[Claim]) -> dict[str, int]:
    """Return verdict -> how many of the paper's own sentences have it, without zeros."""
    of_paper = [claim.verdict for claim in claims if claim.whose == PAPER]
    counts = {}
    for kind in VERDICTS:
        if kind in of_paper:
            counts[kind] = of_paper.count(kind)
    return counts


def totals_line(claims: Sequence[Claim]) -> str:
    """Return a line: the totals of the paper's own sentences and what was read, then the verdicts
    on the rest.
    """
    read_parts = []
    for claim in claims:
        if claim.whose == PAPER and claim.read:
            read_parts.append(claim.read)
    read = ", ".join(dict.fromkeys(read_parts))
    parts = [
        f"the paper's own sentences{f' ({read} read)' if read else ''}: {_marked(totals(claims))}"
    ]
    for whose, words in ((DERIVED, "derived from it"), (OURS, "questions beside it")):
        rest = Counter()
        for claim in claims:
            if claim.whose == whose:
                rest[claim.verdict] += 1
        if rest:
            parts.append(f"{words}: {_marked(rest)}")
    return "; ".join(parts)


def over_gains(claims: Sequence[Claim]) -> str:
    """Return a sentence on how many supported sentences hold under every set of gains."""
    supported = 0
    same = 0
    for claim in claims:
        if claim.whose == PAPER and claim.verdict == SUPPORTED:
            supported += 1
            same += claim.for_every_set
    return (
        f"Of the paper's {supported} supported sentences {same} hold under every set of gains "
        f"that was run, and {supported - same} for some gains."
    )


def _marked(counts: Mapping[str, int]) -> str:
    """Return counts of verdicts with their marks; "none" without any."""
    words = []
    for kind, count in counts.items():
        words.append(f"{MARKS[kind]} {count} {kind}")
    return ", ".join(words) or "none"


def verdict(evidence: Evidence, quantifier: str = NAMED, over: str = "", limit: str = "") -> str:
    """Return the verdict under one set of gains.

    `over`: "all" or "some" if the claim is about allowed gains. `limit`: OURS if the paper gives
    none.
    """
    hold = sentences(evidence, quantifier).values()
    if not hold:
        return NOT_TESTABLE
    if any(hold):
        return SUPPORTED if all(hold) else PARTLY
    if quantifier == EXISTENTIAL or over == "some":
        return NOT_SHOWN
    if limit == OURS:
        return NOT_AS_MEASURED
    return REFUTED


def sentences(evidence: Evidence, quantifier: str = NAMED) -> dict[str, bool]:
    """Return sentence -> whether it holds: all its checks do, or one of an existential claim."""
    checks: dict[str, list[bool]] = {}
    for item in evidence:
        if isinstance(item, Check):
            checks.setdefault(item.sentence, []).append(item.holds)
    rule = any if quantifier == EXISTENTIAL else all
    holding = {}
    for sentence, holds in checks.items():
        holding[sentence] = rule(holds)
    return holding


def combined(
    verdicts: Mapping[str, str], quantifier: str = NAMED, over: str = ""
) -> tuple[str, str]:
    """Return the verdict over all sets of gains, and a sentence on that."""
    kinds = set(verdicts.values())
    if len(kinds) == 1:
        return kinds.pop(), ""
    if quantifier == EXISTENTIAL or over == "some":
        if SUPPORTED in kinds:
            return SUPPORTED, "One example, under one set of gains, supports it."
    elif REFUTED in kinds and (quantifier == UNIVERSAL or over == "all"):
        return REFUTED, "One counter-example, under one set of gains, refutes it."
    return PARTLY, "The verdict depends on the gains."


def _by_name(evidence: Evidence) -> tuple[dict[str, Fields], dict[str, float]]:
    """Return what is measured -> the fields of its check, and -> the number beside the checks."""
    checks: dict[str, Fields] = {}
    beside: dict[str, float] = {}
    for item in evidence:
        fields = item._asdict()
        what = fields.pop("what")
        if what in checks or what in beside:
            raise ScenarioError(f"a claim measures {what!r} twice: name the two apart")
        if isinstance(item, Beside):
            beside[what] = float(item.value)
        else:
            checks[what] = fields
    return checks, beside


def judged(statement: Statement, evidence: Mapping[str, Evidence]) -> Claim:
    """Return a claim with its verdict, from set of gains -> checks and the numbers beside them."""
    limit = "" if statement.whose == OURS else statement.limit
    verdicts = {}
    for name, items in evidence.items():
        searched = statement.over if statement.rivals in ("", name) else ""
        verdicts[name] = verdict(items, statement.quantifier, searched, limit)
    if statement.rivals in verdicts:
        overall = verdicts[statement.rivals]
        rivals = f"{statement.rivals} gains of the other laws"
        sentence = f"Decided by a search over the law's gains, with {rivals}."
    else:
        overall, sentence = combined(verdicts, statement.quantifier, statement.over)
    flips = len(set(verdicts.values())) > 1
    if statement.whose == OURS:
        overall = ANSWERS[overall]
        for name, kind in verdicts.items():
            verdicts[name] = ANSWERS[kind]
    numbers = {}
    beside = {}
    for name, items in evidence.items():
        numbers[name], beside[name] = _by_name(items)
    shared = {}
    for field in dataclasses.fields(Statement):
        shared[field.name] = getattr(statement, field.name)
    shared["note"] = " ".join(filter(None, (statement.note, sentence)))
    return Claim(
        **shared, verdict=overall, numbers=numbers, beside=beside, verdicts=verdicts, flips=flips
    )
