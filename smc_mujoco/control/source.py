"""Where the gains of a law come from, and the search behind them.

    smc.law("classical").source                            # default
    smc.law("classical", k=3).source                       # yours
    smc.tune("duffing", "classical").law.source            # tuned here (CMA-ES and COBYQA, 12 searches, ...)

A source belongs to one set of gains. A law whose gains are replaced has the source "yours".
"""

import dataclasses
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from smc_mujoco.common.errors import find
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.text import joined

NONE = "none"
DEFAULT = "default"
TUNED = "tuned here"
SHIPPED = "shipped"
STUDY = "study"
YOURS = "yours"
KINDS = {
    NONE: "the law has no gains",
    DEFAULT: "the defaults of the law's own file",
    TUNED: "result of a search that the user ran",
    SHIPPED: "those of the package for this plant",
    STUDY: "those of a published study",
    YOURS: "given by the user",
}

MAX_SPREAD = 1.0  # larger ones are told as a multiple


def spread_in_words(searches: int, spread: float, fewest: int = 0) -> str:
    """Return how far J of searches differ: "12 searches, J up to 4.1 % above the least"; "3 to 12
    ..." of some laws.
    """
    number = f"{fewest} to {searches}" * (fewest not in (0, searches)) or f"{searches}"
    if number == "1":
        return "1 search"
    if spread < MAX_SPREAD:
        above = f"{100.0 * spread:.2g} % above"
    else:
        above = f"{1.0 + spread:.2g} times"
    return f"{number} searches, J up to {above} the least"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Search:
    """The searches for gains behind a law."""

    rule: str  # how they search, in words; its name stands before the first comma, colon or bracket
    evaluations: int  # number of sets of gains that they tried, together
    searches: int = 1  # their number; each shares nothing with the others
    # by how much the largest J that one of them ended with exceeds the least, as a share of it
    spread: float = 0.0
    about_defaults: bool = (
        False  # whether they were drawn about the law's defaults, because a gain has no unit
    )

    @property
    def name(self) -> str:
        """The name of the rule."""
        return (
            re.split("[(,:;]", self.rule)[0].rstrip() + " about the defaults" * self.about_defaults
        )

    def __str__(self) -> str:
        return f"{self.name}, {self.evaluations} evaluations, {spread_in_words(self.searches, self.spread)}"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Source:
    """Where a set of gains comes from."""

    kind: str = NONE  # one of KINDS
    gains: Mapping[str, Any] = dataclasses.field(default=frozen({}), repr=False)  # the set
    search: Search | None = None  # the search that the gains are the result of

    def __post_init__(self):
        find("source of gains", self.kind, KINDS)

    def __str__(self) -> str:
        if self.search:
            return f"{self.kind} ({self.search})"
        return self.kind

    def with_gains(self, gains: Mapping[str, Any]) -> "Source":
        """Return this source for another set of gains."""
        return dataclasses.replace(self, gains=gains)

    def about(self) -> dict[str, Any]:
        """Return the kind and the search as plain data. The gains are with the law."""
        return {"kind": self.kind, "search": self.search and dataclasses.asdict(self.search)}


def restore(data: Mapping[str, Any]) -> Source:
    """Return the source that `Source.about` wrote, without its gains."""
    return Source(kind=data["kind"], search=data["search"] and Search(**data["search"]))


def combined(sources: Sequence[Source]) -> Source:
    """Return the source of gains of several sources: the first if all are equal, else the user."""
    if len({(source.kind, source.search) for source in sources}) == 1:
        return sources[0]
    return Source(kind=YOURS)


def kinds(sources: Iterable[Source]) -> str:
    """Return the kinds of sources, each once, such as "shipped" or "shipped, default"."""
    return ", ".join(dict.fromkeys(source.kind for source in sources))


def in_words(sources: Mapping[str, Iterable[Source]]) -> str:
    """Return where the gains of laws come from: "gains: shipped (...)", or "gains: a and b default,
    c yours".

    `sources` maps a law to the sources of its gains; laws without gains are left out.
    """
    with_gains = {
        law: [source for source in all_ if source.kind != NONE] for law, all_ in sources.items()
    }
    words = {law: kinds(of_law) for law, of_law in with_gains.items()}
    for kind in dict.fromkeys(words.values()):
        of_kind = [law for law in words if words[law] == kind]
        searches = {}
        for law in of_kind:
            searches[law] = [source.search for source in with_gains[law] if source.search]
        if any(searches.values()):
            words |= {law: f"{kind} ({_search_text(searches)})" for law in of_kind if searches[law]}
    return by_words(words)


def _search_text(searches: Mapping[str, Sequence[Search]]) -> str:
    """Return the searches of several laws in words."""
    every = []
    for of_law in searches.values():
        for search in of_law:
            every.append(search)
    evaluations = sorted({search.evaluations for search in every})
    counts = [search.searches for search in every]
    text = f"{' or '.join(dict.fromkeys(search.name for search in every))}, "
    text += (
        f"{' to '.join(map(str, dict.fromkeys([evaluations[0], evaluations[-1]])))} evaluations, "
    )
    return text + spread_in_words(max(counts), max(search.spread for search in every), min(counts))


def untuned_laws(words: Mapping[str, str]) -> list[str]:
    """Return a list of one sentence on laws with default gains that are compared with tuned ones,
    else [].

    `words` maps a law to where its gains come from, see `kinds`.
    """
    default = [law for law, kind in words.items() if DEFAULT in kind.split(", ")]
    tuned = [law for law, kind in words.items() if kind in (TUNED, SHIPPED)]
    if not default or not tuned:
        return []
    if len(default) == 1:
        have = "has its default gains"
        them = "it"
    else:
        have = "have their default gains"
        them = "them"
    are = "is" if len(tuned) == 1 else "are"
    return [
        f"{joined(default)} {have}, {joined(tuned)} {are} tuned: tune {them} too (smc-mujoco tune)"
    ]


def by_words(words: Mapping[str, str]) -> str:
    """Return law -> where its gains come from as one text, see `in_words`; "" stands for a law
    without gains.
    """
    laws: dict[str, list[str]] = {}
    for law, kind in words.items():
        if kind not in ("", NONE):
            laws.setdefault(kind, []).append(law)
    if len(laws) < 2:
        return "".join(f"gains: {kind}" for kind in laws)
    return f"gains: {', '.join(f'{joined(names)} {kind}' for kind, names in laws.items())}"
