"""Where the gains of a law come from, and the search behind them.

    smc.law("classical").source                            # default
    smc.law("classical", k=3).source                       # yours
    smc.tune("duffing", "classical").law.source            # tuned here (CMA-ES and COBYQA from several starts, ...)

A source is of one set of gains. A law whose gains are replaced has the source "yours", so no law keeps a wrong one.
"""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from smc_mujoco.common.errors import find
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.text import joined

NONE, DEFAULT, TUNED, SHIPPED, STUDY, YOURS = "none", "default", "tuned here", "shipped", "study", "yours"
KINDS = {  # kind -> what it means
    NONE: "the law has no gains",
    DEFAULT: "the defaults of the law's own file",
    TUNED: "found by a search that the user ran",
    SHIPPED: "those of the package for this plant",
    STUDY: "those of a published study",
    YOURS: "given by the user",
}

ENDED = {True: "converged", False: "not converged", None: "convergence not tested"}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Search:
    """The search that found gains.

    Attributes:
      rule: how it searches, in words; its name stands before the first comma, colon or bracket.
      evaluations: number of sets of gains that it tried.
      converged: whether its starts agree, see `analysis.tuning`; None if it made too few to tell.
      about_defaults: whether it drew its starts about the law's defaults, as a gain has no unit.
    """

    rule: str
    evaluations: int
    converged: bool | None = None
    about_defaults: bool = False

    @property
    def name(self) -> str:
        """The name of the rule."""
        name = self.rule
        for mark in ("(", ",", ":", ";"):
            name = name.partition(mark)[0].rstrip()
        return name + " about the defaults" * self.about_defaults

    @property
    def ended(self) -> str:
        """Whether the search has converged, in words."""
        return ENDED[self.converged]

    def __str__(self) -> str:
        return f"{self.name}, {self.evaluations} evaluations, {self.ended}"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Source:
    """Where a set of gains comes from.

    Attributes:
      kind: a key of KINDS.
      gains: the set.
      search: the search that found the gains; None if no search did.
    """

    kind: str = NONE
    gains: Mapping[str, Any] = dataclasses.field(default=frozen({}), repr=False)
    search: Search | None = None

    def __post_init__(self):
        find("source of gains", self.kind, KINDS)

    def __str__(self) -> str:
        return f"{self.kind} ({self.search})" if self.search else self.kind

    def of(self, gains: Mapping[str, Any]) -> "Source":
        """Return the same source of another set of gains."""
        return dataclasses.replace(self, gains=gains)

    def about(self) -> dict[str, Any]:
        """Return the kind and the search as plain data. The gains are with the law."""
        return {"kind": self.kind, "search": self.search and dataclasses.asdict(self.search)}


def restored(data: Mapping[str, Any]) -> Source:
    """Return the source that `Source.about` wrote, without its gains."""
    return Source(kind=data["kind"], search=data["search"] and Search(**data["search"]))


def combined(sources: Sequence[Source]) -> Source:
    """Return the source of gains that are from several sources: theirs if it is the same, else the user's choice."""
    first = sources[0]
    alike = all((one.kind, one.search) == (first.kind, first.search) for one in sources)
    return first if alike else Source(kind=YOURS)


def kinds(sources: Iterable[Source]) -> str:
    """Return the kinds of sources, each once, such as "shipped" or "shipped, default"."""
    return ", ".join(dict.fromkeys(source.kind for source in sources))


def in_words(sources: Mapping[str, Iterable[Source]], short: bool = False) -> str:
    """Return where the gains of laws come from: "gains: shipped (...)", or "gains: a and b default, c yours".

    Args:
      sources: law -> the sources of its gains; one that has no gains is left out.
      short: whether to leave out the searches.
    """
    known = {law: [source for source in its if source.kind != NONE] for law, its in sources.items()}
    words = {law: kinds(its) for law, its in known.items()}
    if short:
        return by_words(words)
    searches: dict[str, dict[str, list[Search]]] = {}
    for law, its in known.items():
        if some := [source.search for source in its if source.search]:
            searches.setdefault(words[law], {})[law] = some
    return by_words(
        {law: f"{its} ({_searched(searches[its])})" if its in searches else its for law, its in words.items()}
    )


def _searched(searches: Mapping[str, Sequence[Search]]) -> str:
    """Return the searches of several laws in words, with the laws whose search did not converge."""
    every = [search for its in searches.values() for search in its]
    counts = sorted({search.evaluations for search in every})
    words = [" or ".join(dict.fromkeys(search.name for search in every))]
    words.append(f"{' to '.join(map(str, dict.fromkeys([counts[0], counts[-1]])))} evaluations")
    ends: dict[str, list[str]] = {}
    for law, its in searches.items():
        for end in dict.fromkeys(search.ended for search in its):
            ends.setdefault(end, []).append(law)
    if len(ends) == 1:
        return ", ".join([*words, *ends])
    return ", ".join([*words, *(f"{end}: {joined(laws)}" for end, laws in ends.items() if end != ENDED[True])])


def unequal(words: Mapping[str, str]) -> list[str]:
    """Return a sentence on laws with default gains that stand beside tuned ones; [] if there are none.

    Args:
      words: law -> where its gains come from, see `kinds`.
    """
    default = [law for law, its in words.items() if DEFAULT in its.split(", ")]
    tuned = [law for law, its in words.items() if its in (TUNED, SHIPPED)]
    if not default or not tuned:
        return []
    have, them = ("has its default gains", "it") if len(default) == 1 else ("have their default gains", "them")
    are = "is" if len(tuned) == 1 else "are"
    return [f"{joined(default)} {have}, {joined(tuned)} {are} tuned: tune {them} too (smc-mujoco tune)"]


def by_words(words: Mapping[str, str]) -> str:
    """Return law -> where its gains come from as one text, see `in_words`; "" stands for a law without gains."""
    laws: dict[str, list[str]] = {}
    for law, its in words.items():
        if its not in ("", NONE):
            laws.setdefault(its, []).append(law)
    if len(laws) < 2:
        return "".join(f"gains: {words}" for words in laws)
    return f"gains: {', '.join(f'{joined(names)} {words}' for words, names in laws.items())}"
