"""The report's answer in sentences: which law leads where, where no winner is known, where the paper's law loses.

Everything here is counted from `Findings.scores`.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from smc_mujoco.analysis.paired_runs import SETTLES
from smc_mujoco.analysis.relevant_difference import ROUNDING
from smc_mujoco.common.text import every, joined
from smc_mujoco.evidence.audit.verdict import totals
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.scores import Place, Score
from smc_mujoco.studies.adviser import MIN_SETTLED
from smc_mujoco.studies.worst_case import WorstCase, WorstCases

if TYPE_CHECKING:
    from smc_mujoco.evidence.report.stages import Findings

MAX_NAMED_LAWS = 3  # laws in a sentence

Cells = dict[tuple[str, str, str], list[Score]]  # (plant, condition, metric) -> a score for each law


class Standing(NamedTuple):
    """How often a law leads among `of` cells: `best` counts ties with the best, `alone` counts wins.

    `lost`: in how many another law is better.
    """

    law: str
    best: int
    alone: int
    lost: int
    of: int


class Pick(NamedTuple):
    """The law to take for a metric on a plant, or on all plants, over the conditions.

    `law`: "" where all laws are level. `median`: of the conditions' medians, NaN over all plants. `wins`, `losses`: as
    of a `Place`. `level`: the other laws that lose no more cells.
    """

    law: str
    median: float
    wins: int
    losses: int
    of: int
    level: tuple[str, ...]

    @property
    def sure(self) -> str:
        """How sure the choice is, in words."""
        if not self.law:
            return f"all {len(self.level)} laws level in {'each of ' * (self.of > 1)}{self.of}"
        if self.wins == self.of:
            return "wins" + f" in {every(self.of)}" * (self.of > 1)
        unbeaten = f"unbeaten in {self.of - self.losses or 'none'} of {self.of}"
        return f"{unbeaten}, wins in {self.wins}" if self.wins else unbeaten


class Loss(NamedTuple):
    """A cell in which another law is better than the paper's.

    `median`, `rival`: medians of the paper's law and of the best law. `times`: their ratio; where the rival's is less
    than the least difference that counts, the ratio to that difference, a lower bound (`rounded`). `settles`: whether
    the best law settles there: a law that hardly acts may be calm, and never arrive.
    """

    metric: str
    plant: str
    condition: str
    median: float
    rival: float
    law: str
    times: float
    rounded: bool
    settles: bool


def cells(scores: Sequence[Score]) -> Cells:
    """Return the scores of each comparison."""
    by_cell: Cells = {}
    for score in scores:
        by_cell.setdefault((score.plant, score.condition, score.metric), []).append(score)
    return by_cell


def leaders(by_cell: Cells, plant: str, condition: str, metric: str) -> list[str]:
    """Return the laws that are best, or level with the best; none where no law has a finite median."""
    best = [s for s in by_cell.get((plant, condition, metric), ()) if s.best]
    return [s.law for s in best] if any(math.isfinite(s.median) for s in best) else []


def winner(by_cell: Cells, plant: str, condition: str, metric: str) -> str | None:
    """Return the law that wins, as on a board, if there is one."""
    return next((score.law for score in by_cell.get((plant, condition, metric), ()) if score.wins), None)


def settles(by_cell: Cells, plant: str, condition: str, law: str) -> bool:
    """Return whether a law settles in the median of a cell; True where that was not measured."""
    return all(s.median < math.inf for s in by_cell.get((plant, condition, "settling_time"), ()) if s.law == law)


def standings(findings: "Findings", metric: str) -> list[Standing]:
    """Return how often each law leads, and how often another law is better, most wins first."""
    by_cell = {key: scores for key, scores in cells(findings.scores).items() if key[2] == metric}
    best = Counter(law for key in by_cell for law in leaders(by_cell, *key))
    alone = Counter(winner(by_cell, *key) for key in by_cell)
    lost = Counter(s.law for scores in by_cell.values() for s in scores if s.beaten)
    rows = [Standing(law, best[law], alone[law], lost[law], len(by_cell)) for law in findings.laws]
    return sorted(rows, key=lambda row: (-row.alone, row.lost, -row.best))


def everywhere(findings: "Findings", metric: str) -> dict[str, list[str]]:
    """Return law -> the conditions in which it wins on every plant, of those with two plants or more."""
    by_cell = cells(findings.scores)
    conditions: dict[str, list[str]] = {}
    for condition in findings.conditions:
        winners = [winner(by_cell, *key) for key in by_cell if key[1:] == (condition, metric)]
        if len(winners) > 1 and winners[0] and len(set(winners)) == 1:
            conditions.setdefault(winners[0], []).append(words.condition(condition))
    return conditions


def undecided(by_cell: Cells, metrics: Sequence[str]) -> tuple[int, int]:
    """Return how many comparisons have no winner, and how many comparisons there are."""
    winners = [winner(by_cell, *key) for key in by_cell if key[2] in metrics]
    return winners.count(None), len(winners)


def losses(by_cell: Cells, metrics: Sequence[str]) -> list[Loss]:
    """Return the cells in which another law is better than the paper's, worst first."""
    lost: list[Loss] = []
    for (plant, condition, metric), scores in by_cell.items():
        score = next((s for s in scores if s.law == words.PAPER_LAW), None)
        if metric not in metrics or score is None or not score.beaten:
            continue
        best = min((s for s in scores if s.best), key=lambda s: s.median, default=None)
        if best is not None and math.isfinite(best.median):
            resolution = max(best.floor, ROUNDING)
            times, rounded = score.median / max(best.median, resolution), best.median < resolution
            arrives = settles(by_cell, plant, condition, best.law)
            lost.append(Loss(metric, plant, condition, score.median, best.median, best.law, times, rounded, arrives))
    return sorted(lost, key=lambda loss: -loss.times)


def overall(findings: "Findings", metric: str) -> list[Place]:
    """Return the laws' places over all runs, best first."""
    rows = [place for place in findings.places if place.metric == metric and not place.plant]
    return sorted(rows, key=lambda place: (place.failed, place.mean))


def pick(findings: "Findings", metric: str, plant: str = "") -> Pick | None:
    """Return the law that is beaten in the fewest conditions; "" for all plants.

    Of several such laws it is the one with the fewest runs that fail, then by mean rank. If no law is beaten anywhere,
    none is named. Laws that settle in less than half as many runs as the law that settles in the most are left out: a
    law that does nothing is calm. None for a metric without numbers.
    """
    here = [place for place in findings.places if place.plant == plant]
    settled = {place.law: place.median for place in here if place.metric == SETTLES}
    enough = MIN_SETTLED * max(settled.values(), default=0.0)
    rows = [place for place in here if place.metric == metric and settled.get(place.law, 1.0) >= enough]
    if not rows:
        return None
    best = min(rows, key=lambda row: (row.losses, row.failed, row.mean))
    level = tuple(row.law for row in sorted(rows, key=lambda row: row.mean) if row.losses == best.losses)
    if len(rows) > 1 and not any(row.wins or row.losses for row in rows):
        return Pick("", math.nan, 0, 0, best.of, level)
    others = tuple(law for law in level if law != best.law)
    return Pick(best.law, best.median, best.wins, best.losses, best.of, others)


def attacked(findings: "Findings") -> dict[str, WorstCases]:
    """Return plant -> the worst cases found there, the least bad law first."""
    plants = dict.fromkeys(case.nominal.plant.name for case in findings.worst)
    return {plant: WorstCases(case for case in findings.worst if case.nominal.plant.name == plant) for plant in plants}


# sentences


def robust(attacked: Mapping[str, WorstCases]) -> str:
    """Return which law has the smallest error in the worst case on each plant, and where it is not first by median."""
    first = [rows[0] for rows in attacked.values()]
    lowest = [min(rows, key=lambda case: case.median) for rows in attacked.values()]
    others = [case for case in lowest if case not in first]
    text = f"smallest rms error found (in brackets its median): {'; '.join(map(_both, first))}."
    return text + f" First by the median alone: {'; '.join(map(_both, others))}." * bool(others)


def _both(case: WorstCase) -> str:
    """Return law, plant, worst found and median."""
    median = f"{case.shown(case.median)} {case.unit * (case.median < math.inf)}".strip()
    law, plant = words.law(case.nominal.law.name), words.plant(case.nominal.plant.name)
    return f"{law} on {plant} {case.words} ({median})"


def verdict(findings: "Findings", metrics: Sequence[str]) -> str:
    """Return the paper's verdict in one line: how its law does, and how many of its claims hold."""
    of_paper = [row for metric in metrics for row in standings(findings, metric) if row.law == words.PAPER_LAW]
    parts = []
    if of_paper:
        of, lost, alone = (sum(getattr(row, name) for row in of_paper) for name in ("of", "lost", "alone"))
        parts.append(f"its observer-free law is beaten in {lost} of {of} comparisons and wins in {alone or 'none'}")
    if counts := totals(findings.claims):
        verdicts = joined(f"{n} {'are' if n != 1 else 'is'} {said}" for said, n in counts.items())
        parts.append(f"of its {sum(counts.values())} checked claims, {verdicts}")
    return f"The paper: {'; '.join(parts)}." if parts else ""


def first(findings: "Findings", metrics: Sequence[str]) -> str:
    """Return whether there is one best law."""
    standing = [standings(findings, metric) for metric in metrics]
    winners = [{row.law for row in rows if row.alone == row.of} for rows in standing]
    unbeaten = [{row.law for row in rows if row.best == row.of} for rows in standing]
    if winner := set.intersection(*winners) if winners else set():
        return f"{words.law(winner.pop())} wins in every respect compared here, on every plant in every condition."
    if common := set.intersection(*unbeaten) if unbeaten else set():
        if len(common) == len(findings.laws):
            return "No law can be called the best: in every respect compared here, all laws are level."
        names = joined([words.law(law) for law in sorted(common)])
        return f"No law can be called the best; none is better than {names} anywhere, in any respect compared here."
    return "No law is the best in every respect, nor in every condition: it depends on what is asked, and where."


def leads(findings: "Findings", metric: str) -> str:
    """Return who leads on a metric: in every cell, else on every plant, else in how many cells."""
    standing, what = standings(findings, metric), words.metric(metric)
    top = standing[0]
    if top.alone == top.of:
        return f"{words.law(top.law)} wins on {what} in every one of {top.of} cells."
    if not top.alone:
        level = [words.law(row.law) for row in standing if row.best == row.of]
        unbeaten = f"; none is better than {joined(level)} in any" if 0 < len(level) <= MAX_NAMED_LAWS else ""
        return f"no winner on {what} in any of {top.of} cells{unbeaten}."
    plants = [
        f"{words.law(law)} wins on every plant under {joined(names)}"
        for law, names in everywhere(findings, metric).items()
    ]
    by_cell = cells(findings.scores)
    unsettled = Counter(
        law
        for key in by_cell
        if key[2] == metric and (law := winner(by_cell, *key)) and not settles(by_cell, *key[:2], law)
    )
    wins = [
        f"{words.law(row.law)} wins in {row.alone}"
        + f" (never settling in {unsettled[row.law]} of them)" * bool(unsettled[row.law])
        + f" and loses in {row.lost or 'none'}"
        for row in standing[:MAX_NAMED_LAWS]
        if row.alone
    ]
    nobody = top.of - sum(row.alone for row in standing)
    return (
        f"no law wins on {what} in {every(top.of)} cells. "
        f"{'; '.join(plants) + '. ' if plants else ''}{'; '.join(wins)}; "
        f"in {nobody or 'none'} no law wins."
    )


def rest(findings: "Findings", metrics: Sequence[str]) -> list[str]:
    """Return the other sentences: how sure it is, and who settles."""
    return list(filter(None, [_sure(findings, metrics), _settled(findings)]))


def _sure(findings: "Findings", metrics: Sequence[str]) -> str:
    """Return how many comparisons have no winner, and what their samples are."""
    open, of = undecided(cells(findings.scores), metrics)
    compared = len({(s.plant, s.condition) for s in findings.scores})
    repeated = len({(s.plant, s.condition) for s in findings.scores if s.runs < s.seeds})
    samples = list(dict.fromkeys(s.sample for s in findings.scores if s.runs == s.seeds)) or ["distinct runs only"]
    return (
        f"In {open} of {of} comparisons no single winner can be declared; each has {samples[0]}, and the tests of a "
        f"metric are corrected for all {compared} cells."
        + f" In {repeated} of the cells seeds change nothing, or not each: equal runs count once."
        * bool(repeated)
    )


def _settled(findings: "Findings") -> str:
    """Return what share of runs settles, and how many failed; a run that does not settle may still be calm."""
    share = {place.law: place.median for place in overall(findings, "settles")}
    if not share:
        return ""
    worst, best = min(share, key=share.__getitem__), max(share, key=share.__getitem__)
    text = "Every run settles" if share[worst] == 1 else f"{100 * share[worst]:.0f}\u00a0% of every law’s runs settle"
    if f"{share[worst]:.2f}" != f"{share[best]:.2f}":
        text = f"{words.law(worst)} settles least often, in {100 * share[worst]:.0f} % of its runs; a run that does "
        text += "not settle may still be calm"
    return f"{text}. {findings.about.failed or 'None'} of {findings.about.runs} runs failed."
