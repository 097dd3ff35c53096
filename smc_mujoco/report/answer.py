"""What the scores amount to: who leads where, where nobody can be told to, where the paper's law loses, in words.

Everything here is counted from `Findings.scores`; no sentence is there that the numbers do not make.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from smc_mujoco.differences import ROUNDING
from smc_mujoco.report import words
from smc_mujoco.report.findings import Findings, Place, Score

PAPER = "observer_free"  # the law that the suite was built to test
VERDICTS = ("supported", "partly supported", "refuted", "not testable")


class Standing(NamedTuple):
    """In how many of `of` cells a law is best or level with the best, and in how many it is so alone."""

    law: str
    best: int
    alone: int
    of: int


class Loss(NamedTuple):
    """A comparison that the paper's law loses by more than the noise: medians, and its own over the best.

    `times` is a lower bound where the best is less than what rounding leaves of zero, see `rounded`.
    """

    metric: str
    plant: str
    condition: str
    own: float
    rival: float
    law: str
    times: float

    @property
    def rounded(self) -> bool:
        """Whether the best is zero but for rounding."""
        return self.rival < ROUNDING


class Open(NamedTuple):
    """How many of the comparisons name no winner."""

    open: int
    of: int


Cells = dict[tuple[str, str, str], list[Score]]  # (plant, condition, metric) -> a score a law


def cells(scores: Sequence[Score]) -> Cells:
    """The scores of each comparison."""
    found: Cells = {}
    for score in scores:
        found.setdefault((score.plant, score.condition, score.metric), []).append(score)
    return found


def leaders(found: Cells, plant: str, condition: str, metric: str) -> list[str]:
    """The laws that are best, or level with the best; none where none gets there at all."""
    return [s.law for s in found.get((plant, condition, metric), ()) if s.best and math.isfinite(s.median)]


def standings(findings: Findings, found: Cells, metric: str) -> list[Standing]:
    """How often each law leads, by that."""
    best = [leaders(found, *key) for key in found if key[2] == metric]
    rows = [
        Standing(law, sum(law in b for b in best), sum(b == [law] for b in best), len(best)) for law in findings.laws
    ]
    return sorted(rows, key=lambda row: (-row.best, -row.alone))


def undecided(found: Cells, metrics: Sequence[str]) -> Open:
    """How many comparisons end without one winner."""
    best = [leaders(found, *key) for key in found if key[2] in metrics]
    return Open(sum(len(b) != 1 for b in best), len(best))


def losses(found: Cells, metrics: Sequence[str], law: str = PAPER) -> list[Loss]:
    """Where a law is beaten by more than the noise, worst first."""
    lost: list[Loss] = []
    for (plant, condition, metric), scores in found.items():
        own = next((s for s in scores if s.law == law), None)
        if metric not in metrics or own is None or own.best:
            continue
        best = min((s for s in scores if s.best), key=lambda s: s.median, default=None)
        if best is not None and math.isfinite(best.median):
            times = own.median / max(best.median, ROUNDING)
            lost.append(Loss(metric, plant, condition, own.median, best.median, best.law, times))
    return sorted(lost, key=lambda loss: -loss.times)


def counts(findings: Findings) -> dict[str, int]:
    """Verdict -> how many claims have it."""
    return {name: sum(claim.verdict == name for claim in findings.claims) for name in VERDICTS}


def overall(findings: Findings, metric: str) -> list[Place]:
    """The laws' places over all runs, best first."""
    return sorted((p for p in findings.places if p.metric == metric and not p.plant), key=lambda p: p.mean)


class Sentence(NamedTuple):
    """Of the answer: what it is about, "" for all, and what it says."""

    about: str
    text: str


def paragraph(findings: Findings, metrics: Sequence[str] = words.HEADLINE) -> list[Sentence]:
    """The answer, sentence by sentence."""
    found = cells(findings.scores)
    standing = {metric: standings(findings, found, metric) for metric in metrics}
    places = {metric: overall(findings, metric) for metric in metrics}
    leads = [Sentence(words.ASKS[m].capitalize(), _leads(m, places[m], standing[m])) for m in metrics]
    rest = [
        _sure(undecided(found, metrics), findings.about.seeds),
        *_settled(findings),
        *_paper(standing, losses(found, metrics)),
        *_claims(findings),
    ]
    return [Sentence("", _first(places)), *leads, *(Sentence("", text) for text in rest)]


def _first(places: dict[str, list[Place]]) -> str:
    tops = {metric: _may(rows) for metric, rows in places.items()}
    common = set.intersection(*map(set, tops.values())) if tops else set()
    if common and all(len(top) == 1 for top in tops.values()):
        return f"{words.law(common.pop())} leads in every respect compared here, though not in every cell."
    if common:
        names = _joined([words.law(law) for law in sorted(common)])
        return f"No law can be called the best: {names} may be in every respect compared here, and so may others."
    return "No law is the best in every respect: it depends on what is asked."


def _may(rows: Sequence[Place]) -> list[str]:
    """The laws that may be the best."""
    return [row.law for row in rows if row.best]


def _leads(metric: str, places: Sequence[Place], standing: Sequence[Standing]) -> str:
    """One sentence on one metric over all runs."""
    may, what = _may(places), words.metric(metric)
    count = {row.law: row for row in standing}
    if len(may) == 1 and len(places) > 1:
        row = count[may[0]]
        return (
            f"{words.law(may[0])} wins on {what} over all runs; it is ahead or level in {row.best} of {row.of} cells."
        )
    names = _joined([words.law(law) for law in may])
    why = places[0].why or ("each loses to another" if not may else "")
    told = f"no winner on {what} over all runs, " + (why or f"{names} cannot be told apart")
    top = standing[0]
    return f"{told}; most often ahead or level is {words.law(top.law)}, in {top.best} of {top.of} cells."


def _sure(found: Open, seeds: int) -> str:
    return (
        f"In {found.open} of {found.of} comparisons, of {seeds} seeds each and each tested by itself, no single winner "
        "can be declared."
    )


def _settled(findings: Findings) -> list[str]:
    """What share of runs settles, for who does not may be calm all the same, and how many runs failed."""
    share = {place.law: place.median for place in overall(findings, "settles")}
    if not share:
        return []
    least, most = min(share, key=share.__getitem__), max(share, key=share.__getitem__)
    told = "Every run settles" if share[least] == 1 else f"{100 * share[least]:.0f}\u00a0% of every law’s runs settle"
    if f"{share[least]:.2f}" != f"{share[most]:.2f}":
        told = f"Of {words.law(least)}’s runs {100 * share[least]:.0f} % settle, the fewest; one that does "
        told += "not may be calm all the same"
    about = findings.about
    return [f"{told}. {about.failed or 'None'} of {about.runs} runs failed."]


def _paper(standing: dict[str, list[Standing]], lost: Sequence[Loss]) -> list[str]:
    own = {metric: next((row for row in rows if row.law == PAPER), None) for metric, rows in standing.items()}
    shown = [f"{row.best} on {words.metric(metric)}" for metric, row in own.items() if row]
    if not shown:
        return []
    of = next(row.of for row in own.values() if row)
    beaten = f"; it is beaten in {len(lost)} comparisons, listed below, in half of them by a factor of " if lost else ""
    beaten += f"{words.number(lost[(len(lost) - 1) // 2].times)} or more" if lost else ""
    return [
        f"The paper’s observer-free law leads, or is level with what leads, in {_joined(shown)}, "
        f"of {of} cells each{beaten}."
    ]


def _claims(findings: Findings) -> list[str]:
    if not findings.claims:
        return []
    told = counts(findings)
    parts = [f"{n} {'are' if n != 1 else 'is'} {name}" for name, n in told.items() if n]
    flips = sum(claim.flips for claim in findings.claims)
    tail = f"; {flips} of these verdicts depend on the gains" if flips else ""
    return [f"Of {len(findings.claims)} claims of the paper that were checked, {_joined(parts)}{tail}."]


def _joined(parts: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1]])) if parts else ""
