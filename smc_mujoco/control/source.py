"""Where the gains of a law come from, and the search behind them.

    smc.law("classical").source                            # default
    smc.law("classical", k=3).source                       # given
    smc.tune("duffing", "classical").law.source            # tuned here (CMA-ES and COBYQA, ...)

A source belongs to one set of gains. A law whose gains are replaced has the source "given".
"""

import dataclasses
import re
from collections.abc import Iterable, Mapping, Sequence

from smc_mujoco.common.aliases import Data, Fields
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import find
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.text import joined

NONE = "none"
DEFAULT = "default"
TUNED = "tuned here"
SHIPPED = "shipped"
STUDY = "study"
GIVEN = "given"
MARK = " (outside its theorem)"  # of gains that miss a condition of their law's theorem
KINDS = {
    NONE: "the law has no gains",
    DEFAULT: "the defaults of the law's own file",
    TUNED: "result of a search that the user ran",
    SHIPPED: "those of the package for this plant",
    STUDY: "those of a published study",
    GIVEN: "given by the user",
}
OLD_WORDS = {"yours": GIVEN}  # in older files


def spread_in_words(searches: int, spread: float) -> str:
    """Return how far the searches are apart, such as "12 searches, whose final J values differ by
    up to 4.1 %".
    """
    if searches == 1:
        return "1 search"
    return f"{searches} searches, whose final J values differ by up to {_apart(spread)}"


def _apart(spread: float) -> str:
    return f"{100.0 * spread:.2g} %" if spread < 1.0 else f"{1.0 + spread:.2g} times"


@keyword_dataclass
class GainSearch:
    """The searches for gains behind a law."""

    rule: str  # how they search, in words; its name stands before the first comma, colon or bracket
    evaluations: int  # number of sets of gains that they tried, together
    searches: int = 1  # their number; each shares nothing with the others
    # by how much the largest J that one of them ended with exceeds the least, as a share of it
    spread: float = 0.0
    # whether they were drawn about the law's defaults, because a gain has no unit
    about_defaults: bool = False

    @property
    def name(self) -> str:
        """The name of the rule."""
        name = re.split("[(,:;]", self.rule)[0].rstrip()
        if self.about_defaults:
            return f"{name} about the defaults"
        return name

    @property
    def apart(self) -> str:
        """How far J of the searches differ, such as "4.1 %"; "" for one search."""
        return _apart(self.spread) if self.searches > 1 else ""

    def __str__(self) -> str:
        spread = spread_in_words(self.searches, self.spread)
        return f"{self.name}, {self.evaluations} evaluations, {spread}"


@keyword_dataclass
class Source:
    """Where a set of gains comes from."""

    kind: str = NONE  # one of KINDS
    gains: Data = dataclasses.field(default=frozen({}), repr=False)  # the set
    search: GainSearch | None = None  # the search that the gains are the result of
    outside: bool = False  # whether the gains miss a condition of their law's theorem

    def __post_init__(self):
        find("source of gains", self.kind, KINDS)

    def __str__(self) -> str:
        if self.search:
            return f"{self.words} ({self.search})"
        return self.words

    @property
    def words(self) -> str:
        """The kind, with the mark of gains outside their law's theorem."""
        if self.outside:
            return self.kind + MARK
        return self.kind

    def with_gains(self, gains: Data) -> "Source":
        """Return this source for another set of gains."""
        return dataclasses.replace(self, gains=gains, outside=False)

    def about(self) -> Fields:
        """Return it as plain data. The gains are with the law."""
        return {"kind": self.words, "search": self.search and dataclasses.asdict(self.search)}


def restored_source(data: Data) -> Source:
    """Return the source that `Source.about` wrote, without its gains."""
    kind: str = data["kind"].removesuffix(MARK)
    search = data["search"] and GainSearch(**data["search"])
    outside = kind != data["kind"]
    return Source(kind=OLD_WORDS.get(kind, kind), search=search, outside=outside)


def combined(sources: Sequence[Source]) -> Source:
    """Return the source of gains of several sources: the first if all are equal, else the user."""
    if len({(source.kind, source.search) for source in sources}) == 1:
        return sources[0]
    return Source(kind=GIVEN)


def kinds(sources: Iterable[Source]) -> str:
    """Return the kinds of sources, each once, such as "shipped" or "shipped, default"."""
    return ", ".join(dict.fromkeys(source.words for source in sources))


def in_words(sources: Mapping[str, Iterable[Source]]) -> str:
    """Return where the gains of laws come from, see `by_words`; of one law with its search.

    `sources` maps a law to the sources of its gains; laws without gains are left out.
    """
    words = {}
    for law, of_law in sources.items():
        if len(sources) == 1:
            words[law] = ", ".join(dict.fromkeys(map(str, of_law)))
        else:
            words[law] = kinds(of_law)
    return by_words(words)


def by_words(words: Mapping[str, str]) -> str:
    """Return "gains: shipped", or "gains: default for a and b, given for c", from law -> source.

    A law without gains has the source "" or "none", and is left out.
    """
    laws: dict[str, list[str]] = {}
    for law, kind in words.items():
        if kind not in ("", NONE):
            laws.setdefault(kind, []).append(law)
    if len(laws) < 2:
        return "".join(f"gains: {kind}" for kind in laws)
    parts = []
    for kind, names in laws.items():
        parts.append(f"{kind} for {joined(names)}")
    return f"gains: {', '.join(parts)}"
