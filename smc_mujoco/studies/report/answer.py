"""The report's answer in sentences: which law leads where, where no winner is known, where the paper's law loses.

Everything here is counted from `Findings.scores`; no sentence is there that the numbers do not make.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from smc_mujoco.analysis.differences import ROUNDING
from smc_mujoco.studies.report import words
from smc_mujoco.studies.report.findings import Findings, Place, Score

PAPER = "observer_free"  # the law that the suite was built to test
NAMED = 3  # laws in a sentence
VERDICTS = ("supported", "partly supported", "refuted", "not testable")


class Standing(NamedTuple):
    """How often a law leads among `of` cells: `best` counts ties with the best, `alone` counts wins.

    `lost`: in how many another law is better.
    """

    law: str
    best: int
    alone: int
    lost: int
    of: int


class Loss(NamedTuple):
    """A cell in which another law is better than the paper's: medians, and its own over that of the best law.

    `times` is a lower bound where the best is less than what rounding leaves of zero, see `rounded`. `settles` says
    whether the best law settles there: who hardly acts may be calm, and never arrives.
    """

    metric: str
    plant: str
    condition: str
    own: float
    rival: float
    law: str
    times: float
    settles: bool

    @property
    def rounded(self) -> bool:
        """Whether the best is zero but for rounding."""
        return self.rival < ROUNDING


class Open(NamedTuple):
    """How many of `of` comparisons name no winner."""

    open: int
    of: int


Cells = dict[tuple[str, str, str], list[Score]]  # (plant, condition, metric) -> a score a law


def cells(scores: Sequence[Score]) -> Cells:
    """Return the scores of each comparison."""
    found: Cells = {}
    for score in scores:
        found.setdefault((score.plant, score.condition, score.metric), []).append(score)
    return found


def leaders(found: Cells, plant: str, condition: str, metric: str) -> list[str]:
    """Return the laws that are best, or level with the best; none where no law has a finite median."""
    best = [s for s in found.get((plant, condition, metric), ()) if s.best]
    return [s.law for s in best] if any(math.isfinite(s.median) for s in best) else []


def winner(found: Cells, plant: str, condition: str, metric: str) -> str | None:
    """The law that wins, as on a board: it alone leads, among several."""
    leading = leaders(found, plant, condition, metric)
    return leading[0] if len(leading) == 1 < len(found[plant, condition, metric]) else None


def standings(findings: Findings, found: Cells, metric: str) -> list[Standing]:
    """Return how often each law leads, and how often it is behind, most wins first."""
    best = {key: leaders(found, *key) for key in found if key[2] == metric}
    behind = {key: [s.law for s in found[key] if not s.best] for key in best}
    rows = [
        Standing(
            law,
            sum(law in b for b in best.values()),
            sum(winner(found, *key) == law for key in best),
            sum(law in b for b in behind.values()),
            len(best),
        )
        for law in findings.laws
    ]
    return sorted(rows, key=lambda row: (-row.alone, row.lost, -row.best))


def everywhere(found: Cells, metric: str) -> dict[str, list[str]]:
    """Return law -> the conditions under which it wins on every plant, where there are at least two."""
    winners: dict[str, list[str | None]] = {}
    for key in (key for key in found if key[2] == metric):
        winners.setdefault(key[1], []).append(winner(found, *key))
    told: dict[str, list[str]] = {}
    for condition, by_plant in winners.items():
        if len(by_plant) > 1 and by_plant[0] and set(by_plant) == {by_plant[0]}:
            told.setdefault(by_plant[0], []).append(words.condition(condition))
    return told


def undecided(found: Cells, metrics: Sequence[str]) -> Open:
    """Return how many comparisons end without one winner."""
    winners = [winner(found, *key) for key in found if key[2] in metrics]
    return Open(winners.count(None), len(winners))


def repeated(found: Cells) -> int:
    """Return in how many cells some seeds repeat the run of another seed."""
    return len({(plant, condition) for (plant, condition, _), s in found.items() if s[0].runs < s[0].seeds})


def losses(found: Cells, metrics: Sequence[str], law: str = PAPER) -> list[Loss]:
    """Return the cells in which another law is better than this one, worst first."""
    lost: list[Loss] = []
    for (plant, condition, metric), scores in found.items():
        own = next((s for s in scores if s.law == law), None)
        if metric not in metrics or own is None or own.best:
            continue
        best = min((s for s in scores if s.best), key=lambda s: s.median, default=None)
        if best is not None and math.isfinite(best.median):
            times = own.median / max(best.median, ROUNDING)
            times_to_settle = {s.law: s.median for s in found.get((plant, condition, "settling_time"), ())}
            settles = times_to_settle.get(best.law) != math.inf
            lost.append(Loss(metric, plant, condition, own.median, best.median, best.law, times, settles))
    return sorted(lost, key=lambda loss: -loss.times)


def counts(findings: Findings) -> dict[str, int]:
    """Return verdict -> how many claims have it."""
    return {name: sum(claim.verdict == name for claim in findings.claims) for name in VERDICTS}


def overall(findings: Findings, metric: str) -> list[Place]:
    """Return the laws' places over all runs, best first."""
    return sorted((p for p in findings.places if p.metric == metric and not p.plant), key=lambda p: p.mean)


class Sentence(NamedTuple):
    """A sentence of the answer, and what it is about: "" for all."""

    about: str
    text: str


def paragraph(findings: Findings, metrics: Sequence[str] = words.HEADLINE) -> list[Sentence]:
    """Return the answer, sentence by sentence."""
    found = cells(findings.scores)
    standing = {metric: standings(findings, found, metric) for metric in metrics}
    leads = [Sentence(words.ASKS[m].capitalize(), _leads(m, standing[m], everywhere(found, m))) for m in metrics]
    rest = [
        _sure(undecided(found, metrics), findings.about.seeds, repeated(found)),
        *_settled(findings),
        *_paper(standing, losses(found, metrics)),
        *_claims(findings),
    ]
    return [Sentence("", _first(standing)), *leads, *(Sentence("", text) for text in rest)]


def _first(standing: dict[str, list[Standing]]) -> str:
    winners = [{row.law for row in rows if row.alone == row.of} for rows in standing.values()]
    unbeaten = [{row.law for row in rows if not row.lost} for rows in standing.values()]
    if winner := set.intersection(*winners) if winners else set():
        return f"{words.law(winner.pop())} wins in every respect compared here, on every plant in every condition."
    if common := set.intersection(*unbeaten) if unbeaten else set():
        names = _joined([words.law(law) for law in sorted(common)])
        return f"No law can be called the best; none is better than {names} anywhere, in any respect compared here."
    return "No law is the best in every respect, nor in every condition: it depends on what is asked, and where."


def _leads(metric: str, standing: Sequence[Standing], conditions: dict[str, list[str]]) -> str:
    """Return who leads on a metric: in every cell, else on every plant, else in how many cells."""
    what, top = words.metric(metric), standing[0]
    if top.alone == top.of:
        return f"{words.law(top.law)} wins on {what} in every one of {top.of} cells."
    told = [
        f"{words.law(row.law)} wins in {row.alone} and loses in {row.lost or 'none'}"
        for row in standing[:NAMED]
        if row.alone
    ]
    if not told:
        level = [words.law(row.law) for row in standing if not row.lost]
        never = f"; none is better than {_joined(level)} in any" if 0 < len(level) <= NAMED else ""
        return f"no winner on {what} in any of {top.of} cells{never}."
    plants = [f"{words.law(law)} wins on every plant under {_joined(names)}" for law, names in conditions.items()]
    nobody = top.of - sum(row.alone for row in standing)
    return (
        f"no law wins on {what} in all {top.of} cells. {'; '.join(plants) + '. ' if plants else ''}{'; '.join(told)}; "
        f"in {nobody or 'none'} nobody wins."
    )


def _sure(found: Open, seeds: int, repeats: int) -> str:
    told = (
        f"In {found.open} of {found.of} comparisons no single winner can be declared; each has {seeds} seeds, and the "
        "tests are corrected for all comparisons of a metric on a plant."
    )
    return told + (
        f" In {repeats} of the cells seeds change nothing, or not each: equal runs count once." if repeats else ""
    )


def _settled(findings: Findings) -> list[str]:
    """Return what share of runs settles, and how many failed; a run that does not settle may still be calm."""
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
