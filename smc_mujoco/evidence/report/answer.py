"""The report's answer in sentences: which law leads where, where no winner is known, where the
paper's law loses.

Everything here is counted from `Findings.scores`.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from smc_mujoco.analysis.paired_runs import SETTLES
from smc_mujoco.common.text import every, joined
from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable
from smc_mujoco.evidence.accuracy.scaling import ORDER_BAND
from smc_mujoco.evidence.audit.verdict import totals
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.families import FAMILIES, METRIC, Lead, counted
from smc_mujoco.evidence.report.scores import Score
from smc_mujoco.studies.adviser import MIN_SETTLED
from smc_mujoco.studies.worst_case import WorstCase, WorstCases

if TYPE_CHECKING:
    from smc_mujoco.evidence.report.stages import Findings

Cells = dict[
    tuple[str, str, str], list[Score]
]  # (plant, condition, metric) -> a score for each law


class Pick(NamedTuple):
    """The law to take for a metric on a plant, over the conditions."""

    law: str  # "" where no law is beaten
    median: float  # of the conditions' medians
    wins: int  # conditions
    # conditions in which another law is better, it has runs that fail, or samples are too few to
    # tell
    losses: int
    conditions: int
    others: tuple[str, ...]  # the other laws that lose no more of them
    level: bool = (
        False  # whether all laws are level, which more than that none is beaten, in every condition
    )

    @property
    def sure(self) -> str:
        """How sure the choice is, in words."""
        if not self.law:
            how = "level" if self.level else "unbeaten"
            return f"all {len(self.others)} laws {how} in {'each of ' * (self.conditions > 1)}{self.conditions}"
        if self.wins == self.conditions:
            return "wins" + f" in {every(self.conditions)}" * (self.conditions > 1)
        unbeaten = f"unbeaten in {self.conditions - self.losses or 'none'} of {self.conditions}"
        if self.wins:
            return f"{unbeaten}, wins in {self.wins}"
        return unbeaten


class Loss(NamedTuple):
    """A cell in which another law is better than the paper's."""

    metric: str
    plant: str
    condition: str
    median: float  # of the paper's law
    rival: float  # median of the best law
    law: str  # the best one
    # Ratio of the medians; where the rival's is below the least difference that counts, the ratio
    # to that difference.
    times: float
    rounded: bool  # whether the rival's is below it, so that `times` is a lower bound
    # whether the best law settles there: a law that hardly acts may be calm, and never arrive
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
    if any(math.isfinite(s.median) for s in best):
        return [s.law for s in best]
    return []


def nobody(by_cell: Cells, plant: str, condition: str, metric: str) -> str:
    """Return why a cell has no leaders, in words."""
    if all(s.failed or math.isinf(s.median) for s in by_cell.get((plant, condition, metric), ())):
        return "every law has runs that fail, or never gets there"
    return "each is beaten, fails, or has too few runs to tell"


def settles(by_cell: Cells, plant: str, condition: str, law: str) -> bool:
    """Return whether a law settles in the median of a cell; True where that was not measured."""
    return all(
        s.median < math.inf
        for s in by_cell.get((plant, condition, "settling_time"), ())
        if s.law == law
    )


def undecided(by_cell: Cells, metrics: Sequence[str]) -> tuple[int, int]:
    """Return how many comparisons have no winner, and how many comparisons there are."""
    won = []
    for key, scores in by_cell.items():
        if key[2] in metrics:
            won.append(any(score.wins for score in scores))
    return won.count(False), len(won)


def losses(by_cell: Cells, metrics: Sequence[str]) -> list[Loss]:
    """Return the cells in which another law is better than the paper's, worst first."""
    lost: list[Loss] = []
    for (plant, condition, metric), scores in by_cell.items():
        score = next((s for s in scores if s.law == words.PAPER_LAW), None)
        if metric not in metrics or score is None or not score.beaten:
            continue
        best = min((s for s in scores if s.best), key=lambda s: s.median, default=None)
        if best is not None and math.isfinite(best.median):
            least = max(best.median, best.floor)
            times = score.median / least if least else math.inf
            rounded = best.median < best.floor
            arrives = settles(by_cell, plant, condition, best.law)
            lost.append(
                Loss(
                    metric,
                    plant,
                    condition,
                    score.median,
                    best.median,
                    best.law,
                    times,
                    rounded,
                    arrives,
                )
            )
    return sorted(lost, key=lambda loss: -loss.times)


def pick(findings: "Findings", metric: str, plant: str) -> Pick | None:
    """Return the law that is unbeaten in the most conditions.

    Of several such laws it is the one with the fewest runs that fail, then by mean rank. If no law
    is beaten anywhere, none is named. Laws that settle in less than half as many runs as the law
    that settles in the most are left out: a law that does nothing is calm. None for a metric
    without numbers.
    """
    boards = {board.metric: board for board in findings.boards if board.group["plant"] == plant}
    if SETTLES in boards:
        settled = {entry.law: entry.interval.median for entry in boards[SETTLES].entries}
    else:
        settled = {}
    enough = MIN_SETTLED * max(settled.values(), default=0.0)
    if (board := boards.get(metric)) is None:
        return None
    entries = {entry.law: entry for entry in board.entries if settled.get(entry.law, 1.0) >= enough}
    wins = {law: len(board.wins(law)) for law in entries}
    losses = {law: sum(law not in block.best for block in board.blocks) for law in entries}
    best = min(entries, key=lambda law: (losses[law], entries[law].failed, entries[law].rank.mean))
    others = [
        law
        for law in sorted(entries, key=lambda law: entries[law].rank.mean)
        if losses[law] == losses[best]
    ]
    conditions = len(board.blocks)
    if len(entries) > 1 and not any((*wins.values(), *losses.values())):
        return Pick(
            "",
            math.nan,
            0,
            0,
            conditions,
            tuple(others),
            all(block.level for block in board.blocks),
        )
    others.remove(best)
    return Pick(
        best, entries[best].interval.median, wins[best], losses[best], conditions, tuple(others)
    )


def attacked(findings: "Findings") -> dict[str, WorstCases]:
    """Return plant -> the worst cases found there, the least bad law first."""
    plants = dict.fromkeys(case.nominal.plant.name for case in findings.worst)
    return {
        plant: WorstCases(case for case in findings.worst if case.nominal.plant.name == plant)
        for plant in plants
    }


# sentences


def robust(attacked: Mapping[str, WorstCases]) -> str:
    """Return which law has the smallest worst-case error on each plant, and which has the smallest
    median if others.
    """
    first = [rows[0] for rows in attacked.values()]
    lowest = [min(rows, key=lambda case: case.median) for rows in attacked.values()]
    others = [case for case in lowest if case not in first]
    text = f"smallest rms error found (in brackets its median): {'; '.join(map(_both, first))}."
    return text + f" First by the median alone: {'; '.join(map(_both, others))}." * bool(others)


def _both(case: WorstCase) -> str:
    """Return law, plant, worst found and median."""
    median = f"{case.shown(case.median)} {case.unit * (case.median < math.inf)}".strip()
    law = words.law(case.nominal.law.name)
    plant = words.plant(case.nominal.plant.name)
    return f"{law} on {plant} {case.words} ({median})"


def verdict(findings: "Findings", metrics: Sequence[str]) -> str:
    """Return the paper's verdict in one line: how its law does, and how many of its claims hold."""
    own = [s for s in findings.scores if s.law == words.PAPER_LAW and s.metric in metrics]
    lost = len(losses(cells(findings.scores), metrics))
    wins = sum(s.wins for s in own) or "none"
    parts = []
    if own:
        unclear = sum(not s.best and not s.beaten for s in own)
        also = f", and has too few samples to tell in {unclear}" * bool(unclear)
        parts.append(
            f"its observer-free law is beaten in {lost} of {len(own)} comparisons and wins in {wins}{also}"
        )
    if counts := totals(findings.claims):
        verdicts = joined(f"{n} {'are' if n != 1 else 'is'} {said}" for said, n in counts.items())
        sets = set()
        for claim in findings.claims:
            for name in claim.verdicts:
                sets.add(name)
        if len(sets) == 1:
            gains = "one set of gains"
        else:
            gains = f"{len(sets)} sets of gains"
        less = f" audited quickly under {gains}," * findings.about.plan.quick
        parts.append(f"of its {sum(counts.values())} checked claims,{less} {verdicts}")
    if parts:
        return f"The paper: {'; '.join(parts)}."
    return ""


def first(findings: "Findings", metrics: Sequence[str]) -> str:
    """Return whether there is one best law."""
    by_cell = {key: scores for key, scores in cells(findings.scores).items() if key[2] in metrics}
    best = Counter(law for key in by_cell for law in leaders(by_cell, *key))
    wins = Counter(score.law for scores in by_cell.values() for score in scores if score.wins)
    if winners := [law for law in findings.laws if by_cell and wins[law] == len(by_cell)]:
        return f"{words.law(winners[0])} wins in every respect compared here, on every plant in every condition."
    if unbeaten := [law for law in sorted(findings.laws) if by_cell and best[law] == len(by_cell)]:
        if len(unbeaten) == len(findings.laws):
            return "No law can be called the best: in no respect compared here is one shown to be better than another."
        names = joined(map(words.law, unbeaten))
        return f"No law can be called the best; none is shown to be better than {names} in any respect, anywhere."
    if len(wins) > 1:
        return "No law is the best in every respect, nor in every condition: it depends on what is asked, and where."
    return "No law is shown to be the best in every respect and condition."


def families(leads: Sequence[Lead]) -> str:
    """Return in how many cells each family of laws is first."""
    counts = counted(leads)
    shares = [
        f"{words.FAMILY[name]} in {counts[name] or 'none'}"
        for name in sorted(FAMILIES, key=lambda f: -counts[f])
    ]
    where = f"First in {words.metric(METRIC)}, in {len(leads)} plants and conditions"
    return f"{where}: {joined(shares)}; in {counts[''] or 'none'} it is open."


def sure(findings: "Findings", metrics: Sequence[str]) -> str:
    """Return how many comparisons have no winner, and what their samples are."""
    open, of = undecided(cells(findings.scores), metrics)
    compared = len({(s.plant, s.condition) for s in findings.scores})
    repeated = len({(s.plant, s.condition) for s in findings.scores if s.runs < s.seeds})
    samples = list(dict.fromkeys(s.sample for s in findings.scores if s.runs == s.seeds)) or [
        "distinct runs only"
    ]
    text = f"In {open} of {of} comparisons no single winner can be declared; each has {samples[0]}, and the tests of a "
    text += f"metric are corrected for all {compared} cells."
    return (
        text
        + f" In {repeated} of the cells seeds change nothing, or not each: equal runs count once."
        * bool(repeated)
    )


def orders(table: AccuracyTable) -> Iterator[str]:
    """Yield a sentence for each plant and condition: how many laws have the promised order."""
    for title, rows in table.groups.items():
        promised = [row.s for row in rows if row.s.theory is not None]
        kept = sum(order.as_promised for order in promised)
        plant, _, condition = title.partition(", ")
        of = f"{kept} of {len(promised)} laws"
        yield f"{words.plant(plant)}, {condition}: the order of s is within {ORDER_BAND:g} of theory’s for {of}."
