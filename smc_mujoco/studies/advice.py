"""Advice: the laws that were compared for the needs of a user, as a table and as an answer in
sentences.

A need, such as "fast", is a metric to keep small, in runs or in the worst case. Every sentence is
made from the numbers of the comparison, so it changes when they do.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from smc_mujoco.analysis.bootstrap import LEVEL, Interval
from smc_mujoco.analysis.paired_runs import failures
from smc_mujoco.analysis.ranking import Comparison, Rank, min_p
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.common.text import capital, counted, every, joined
from smc_mujoco.control.component import Component
from smc_mujoco.control.source import in_words
from smc_mujoco.draw.style import law_colour
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE, metrics
from smc_mujoco.metrics.conventions import Metric
from smc_mujoco.studies.board import ahead_in_words, first_of, relevance, size_in_words, spread
from smc_mujoco.studies.table import Table
from smc_mujoco.studies.worst_case import METRIC, WorstCase

ROBUST = "robust"
TIES = ("no-overshoot", "frugal")  # needs that decide the order of tied laws
MAX_ROWS = 12  # laws in the table; chosen


NEEDS: Mapping[str, Metric] = {metric.need: metric for metric in metrics() if metric.need}
NEEDS |= {
    ROBUST: dataclasses.replace(
        CATALOGUE[METRIC], need=ROBUST, label=f"worst found {CATALOGUE[METRIC].label}"
    )
}


def ties(plant: Plant) -> list[Metric]:
    """Return the metrics that decide the order of tied laws on a plant."""
    return [NEEDS[need] for need in TIES if not NEEDS[need].refusal(plant)]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Choice:
    """A law that was compared."""

    law: Component  # with its gains for the plant
    remark: str  # on the gains, besides their source
    rank: Rank  # NaN if it is not compared
    settles: float  # share of its runs
    reliable: bool  # whether it settles in nearly all runs of every condition
    fit: bool  # whether it settles often enough to be advised
    medians: Mapping[
        str, Interval
    ]  # need -> median over the conditions; of "robust" the largest over the conditions
    worst: tuple[WorstCase, ...] = ()  # in each condition, for "robust"

    @property
    def worst_found(self) -> WorstCase:
        """The worst case of all conditions."""
        return max(self.worst, key=lambda case: case.value)

    @property
    def gains(self) -> str:
        """Where the gains come from, in words."""
        remarks = filter(None, (self.remark,))
        return "; ".join([f"gains: {self.law.source}", *remarks])

    def below(self, need: str) -> str:
        """Return the text below a median in a table: its interval, if it has a width; of "robust"
        the random median.
        """
        if need == ROBUST:
            return f"median {self.worst_found.shown(self.worst_found.median)}"
        median = self.medians[need]
        return spread(median, NEEDS[need].name) * (median.low < median.high)


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Advice(Tables):
    """Which law to use on a plant, and how sure that is; `print` shows it, as a notebook does."""

    plant: Plant
    conditions: tuple[str, ...]  # their names
    needs: tuple[str, ...]  # names of the compared ones, such as "fast"
    wanted: tuple[str, ...]  # properties that every law has, in words
    choices: tuple[Choice, ...]  # best first
    # of the laws that are fit, or of all if none is; its blocks are those of `blocks`
    comparison: Comparison
    table: Table  # the runs
    effort: str = ""  # unit of u; "" for that of a force, or where conditions differ
    untuned: tuple[str, ...] = ()  # the laws with default gains, over which no other law is advised

    @property
    def law(self) -> Component:
        """The advised law, with its gains."""
        return self.choices[0].law

    @property
    def second(self) -> Component | None:
        """The second choice, with its gains; None if only one law suits."""
        if len(self.choices) > 1:
            return self.choices[1].law
        return None

    @property
    def barred(self) -> list[str]:
        """The rivals with default gains over which the first of the `choices` is not advised."""
        return [name for name in self.untuned if name != self.law.name]

    @property
    def blocks(self) -> list[tuple[str, str]]:
        """The need and the condition of each block of the comparison."""
        return [(need, condition) for need in self.needs for condition in self.conditions]

    @property
    def compared(self) -> list[str]:
        """The laws that are compared, best first."""
        return [
            choice.law.name for choice in self.choices if choice.law.name in self.comparison.laws
        ]

    def wins(self, law: str, rival: str) -> list[tuple[str, str]]:
        """Return the need and the condition of each block in which a law is better than a rival."""
        a, b = (self.comparison.laws.index(name) for name in (law, rival))
        return [
            block
            for block, better in zip(self.blocks, self.comparison.better[:, a, b], strict=True)
            if better
        ]

    def dominates(self, law: str) -> list[str]:
        """Return the laws that this one dominates: it is better than each in some block, and worse
        in none.
        """
        rivals = (name for name in self.compared if name != law)
        return [name for name in rivals if self.wins(law, name) and not self.wins(name, law)]

    @property
    def level(self) -> list[str]:
        """The laws that are neither better nor worse than the advised law in any block."""
        first, *others = self.compared
        return [
            name for name in others if not self.wins(first, name) and not self.wins(name, first)
        ]

    @property
    def tied(self) -> list[str]:
        """The laws that are level with the advised law in every block, see `Comparison.level`."""
        laws = self.comparison.laws
        first = self.compared[0]
        return [
            name
            for name in self.compared[1:]
            if self.comparison.tied[laws.index(first), laws.index(name)]
        ]

    @property
    def all_level(self) -> bool:
        """Whether there are several laws, none better or worse than the advised law."""
        return 1 < len(self.compared) == len(self.level) + 1

    def __repr__(self) -> str:
        return f"Advice({self.plant.name}: {'no law' if self.barred else self.law})"

    # the table

    @property
    def tables(self) -> list[Tabular]:
        """One table with a row for each of the first laws, above the answer; marked where no law is
        better.
        """
        metrics = [NEEDS[need] for need in self.needs]
        units = []
        for m in metrics:
            units.append(f"{m.need}: {m.label} ({m.unit_for(self.plant.unit, self.effort)})")
        rows = []
        for choice in self.choices[:MAX_ROWS]:
            law = Cell(choice.law.name, colour=law_colour(choice.law.name))
            place = f"{choice.rank.place:g}" if choice.fit else "–"
            settles = f"{100 * choice.settles:.0f} %"
            rows.append([law, place, settles, *(self._cell(choice, need) for need in self.needs)])
        notes = [
            line for note in (self.key, *failures(self.table), *self.answer) for line in (note, "")
        ][:-1]
        if self.wanted:
            wanted = f", by laws that {joined(self.wanted)}"
        else:
            wanted = ""
        title = f"{self.plant.name} under {joined(self.conditions)}: {joined(self.needs)}{wanted}"
        return [
            Tabular(
                headings=["law", "place", "settles", *units], rows=rows, title=title, notes=notes
            )
        ]

    def _cell(self, choice: Choice, need: str) -> Cell:
        """Return a median, marked if no law is better in any condition and no run fails."""
        name = choice.law.name
        rivalled = len(self.compared) > 1 and name in self.compared
        doubted = rivalled and self._any(
            self.comparison.undecided | self.comparison.beaten, name, need
        )
        return Cell(
            NEEDS[need].text(choice.medians[need].median),
            choice.below(need),
            rivalled and not doubted,
        )

    def _any(self, flags: np.ndarray, law: str, need: str) -> bool:
        """Return whether flags of the comparison, (laws, blocks), are true of a law in some block
        of a need.
        """
        row = flags[self.comparison.laws.index(law)].tolist()
        return any(
            value for (compared, _), value in zip(self.blocks, row, strict=True) if compared == need
        )

    @property
    def key(self) -> str:
        """The meaning of the table's signs."""
        shown = self.choices[:MAX_ROWS]
        more = [choice.law.name for choice in self.choices[MAX_ROWS:]]
        over = f" over {len(self.conditions)} conditions" * (len(self.conditions) > 1)
        medians = f" Medians{over}, with {100 * LEVEL:g} % intervals over {self.samples}." * (
            not self._untested
        )
        text = "Places: by failed runs, then mean rank, behind laws that dominate (better somewhere, worse nowhere)."
        text += medians + f" {counted(len(more), 'more law')}: {first_of(more)}." * bool(more)
        text += " *: no law is better in any condition, every run has a value, and there are enough samples to tell."
        bare = any(not choice.below(need) for choice in shown for need in self.needs)
        text += (
            " Where there is no interval, its ends are equal, or one end is a run without a value."
            * bare
        )
        if self._shared and len(self._shared) < len(self.comparison.laws):
            text += f" Sets of gains, which are the sample of a law that has several: {first_of(self._shared)}."
        if sources := in_words({choice.law.name: [choice.law.source] for choice in shown}):
            text += f" {capital(sources)}."
        text += " –: the law settles too seldom to be advised." * any(
            not choice.fit for choice in shown
        )
        metrics = [NEEDS[need].name for need, _ in self.blocks]
        floors = zip(metrics, self.comparison.floors.tolist(), strict=True)
        relevant = relevance(self.comparison.relevant, floors, self.plant.unit)
        return f"{text} Ahead means by more than the least relevant difference, {relevant}."

    @property
    def samples(self) -> str:
        """The largest sample of two laws in words: "24 runs", or "3 sets of gains" where runs share
        them.
        """
        samples = self.comparison.samples
        sets = self.comparison.sets.max(axis=1)
        block, a, b = np.unravel_index(int(samples.argmax()), samples.shape)
        if len(sets) > 1:
            count = int(samples[block, a, b])
        else:
            count = int(self.comparison.seeds.max())
        if max(sets[a], sets[b]) > 1:
            return f"{counted(count, 'set')} of gains"
        return counted(count, "run")

    @property
    def _shared(self) -> list[str]:
        """The laws whose runs share several sets of gains, with their number, such as "classical
        3".
        """
        seeds = self.comparison.seeds.max()
        counts = self.comparison.sets.max(axis=1).tolist()
        named = zip(self.comparison.laws, counts, strict=True)
        return [f"{law} {count}" for law, count in named if 1 < count < seeds]

    @property
    def _untested(self) -> bool:
        """Whether all laws are compared by their worst cases, without a test."""
        return bool(self.comparison.untested.all())

    @property
    def _too_few(self) -> bool:
        """Whether no comparison can tell two laws apart, with the samples that there are."""
        smallest_p = 2 * min_p(int(self.comparison.samples.max()))
        return not self.comparison.untested.any() and smallest_p > (1 - LEVEL) / len(self.blocks)

    # the answer

    @property
    def answer(self) -> list[str]:
        """The advice in sentences: the law and why, the second choice, how sure it is; or why no
        law is advised.
        """
        if ROBUST in self.needs:
            robust = self._robust()
        else:
            robust = ""
        parts = [self._use(), self._because(), robust, self._second(), self._sure()]
        if self.barred:
            why = f"No law is advised over {first_of(self.barred)}, with default gains"
            parts = [f"{why}: tune them, or ask for it with defaults=True (--defaults).", robust]
        return list(filter(None, parts))

    def _use(self) -> str:
        first = self.choices[0]
        longer = f"longer runs than {self.table.scenario(0).duration:g} s"
        cure = f"give {longer}, a stronger actuator, more suitable laws or easier conditions"
        if not first.settles or not first.fit:
            if not first.settles:
                why = "none settles in any run"
            else:
                why = "none settles often enough in every condition"
            return f"No law can be advised, because {why}: {cure}."
        if not first.reliable:
            share = f"{100 * first.settles:.0f} % of its runs"
            return f"No law is reliable here: {first.law.name} settles in {share}; {cure}."
        if self.all_level and self._too_few:
            comparisons = counted(len(self.blocks), "comparison")
            cure = "give more seeds (--seeds), and leave out quick (--quick)"
            return f"No law can be called the best with {self.samples}, too few for {comparisons}: {cure}."
        if self.all_level:
            laws = f"{every(len(self.compared))} laws"
            if self._untested:
                where = "in the worst that was found"
            else:
                where = f"in every comparison of {self.samples}"
            return f"No law can be called the best: {laws} are level {where}. Use the one that you know."
        return f"Use {first.law} ({first.gains})."

    def _because(self) -> str:
        first = self.choices[0]
        count = len(self.compared)
        if not first.reliable or not first.fit:
            return ""
        if self.all_level:
            share = min(choice.settles for choice in self.choices if choice.fit)
            return f"Each settles in {'at least ' * (share < 1)}{100 * share:.0f} % of its runs."
        rivals = [choice for choice in self.choices[1:] if choice.fit]
        equals = [choice.law.name for choice in rivals if choice.rank.mean == first.rank.mean]
        ahead = [choice.law.name for choice in rivals if choice.rank.mean < first.rank.mean]
        tied = [name for name in ahead if name in self.tied]
        why = f"it has the best mean rank of {count} laws"
        if equals:
            why += f", as {'has' if len(equals) == 1 else 'have'} {first_of(equals)}"
        if ahead:
            why = "it has the best mean rank of those that none dominates, being better somewhere and worse nowhere"
        if tied:
            why = f"it ties with {first_of(tied)}, of better mean rank, and {self._rule}"
        if count == 1:
            if len(self.choices) == 1:
                why = "it is the only law here that suits"
            else:
                why = "it alone settles often enough"
        parts = [f"Because {why}. It settles in {100 * first.settles:.0f} % of its runs."]
        if count > 1:
            parts += [self._standing(first, need) for need in self.needs]
        else:
            parts += []
        return " ".join(parts)

    @property
    def _rule(self) -> str:
        """The rule for the order of tied laws, in words."""
        return f"laws that tie stand in the order of {', then of '.join(m.label for m in ties(self.plant))}, less first"

    def _standing(self, choice: Choice, need: str) -> str:
        """Return the median of a law on a need, and who is better."""
        name = choice.law.name
        value = f"{NEEDS[need].label} {self._number(choice, need)}"
        rivals = {}
        for rival in self.compared:
            rivals[rival] = [block for block in self.wins(rival, name) if block[0] == need]
        better = [rival + self._where(blocks) for rival, blocks in rivals.items() if blocks]
        said = "no law is better" + ", as far as so few samples tell" * self._any(
            self.comparison.undecided, name, need
        )
        if better:
            said = f"better {'is' if len(better) == 1 else 'are'} {first_of(better)}"
        return f"{capital(need)}: {value}; {said}."

    def _robust(self) -> str:
        """Return what the adversary did, and which law the median of its random runs puts first, if
        another.
        """
        worst = self.choices[0].worst_found
        fit = [choice for choice in self.choices if choice.fit] or self.choices
        lowest = min(fit, key=lambda choice: choice.worst_found.median)
        text = (
            f"Robust is by the worst found in {worst.tried} runs of each law in each condition, half of them random, "
            f"within {worst.class_words}, with its best set of gains from the first start; there may be worse."
        )
        if lowest is self.choices[0]:
            return text
        other = lowest.worst_found
        first = f"The median of the random runs would put {lowest.law.name} first, with {other.with_unit(other.median)}"
        return f"{text} {first}: its worst found is {other.words}."

    def _second(self) -> str:
        if len(self.choices) < 2 or self.all_level or not self.choices[0].reliable:
            return ""
        first, second = self.choices[:2]
        named = f"Second choice: {second.law} ({second.gains})"
        if not second.fit:
            return f"{named}; it settles too seldom to be advised."
        ahead = self.wins(second.law.name, first.law.name)
        behind = self.wins(first.law.name, second.law.name)
        parts = [f"better {self._on(ahead)}"] * bool(ahead) + [f"worse {self._on(behind)}"] * bool(
            behind
        )
        return f"{named}; {'; '.join(parts) or 'level with the first in every comparison'}."

    def _sure(self) -> str:
        if len(self.compared) < 2:
            return "Not sure: there was no second law."
        first, *others = self.compared
        if self._too_few:
            return f"How sure: not at all, with {self.samples}."
        beaten = [name for name in others if name in self.dominates(first)]
        mixed = [name for name in others if self.wins(name, first)]
        unsure = [name for name in self.level if name not in self.tied]
        it = first if self.all_level else "it"  # no law is advised where all are level
        parts = [
            f"it dominates {first_of(beaten)}: better somewhere, worse nowhere" if beaten else "",
            f"{it} ties with {first_of(self.tied)}; {self._rule}" if self.tied else "",
            f"{it} is not to be told from {first_of(unsure)}" if unsure else "",
            f"it loses some comparisons to {first_of(mixed)}, so the choice depends on what counts"
            if mixed
            else "",
            self._against(others[0]),
        ]
        sure = f"How sure: {'; '.join(filter(None, parts))}. {self._holds}"
        if self._untested or self.all_level or len(beaten) == len(others):
            return sure
        chance = "with other starts and noise, or among other laws, a law that it does not dominate may be first"
        return f"{sure} The order is not tested: {chance}."

    def _against(self, rival: str) -> str:
        """Return how the first law compares with a rival on each need, in the condition that is
        worst for the first.
        """
        first = self.compared[0]
        parts = []
        a, b = (self.comparison.laws.index(name) for name in (first, rival))
        for need in self.needs:
            blocks = [k for k, block in enumerate(self.blocks) if block[0] == need]
            if need == ROBUST:
                values = []
                for choice in self.choices:
                    if choice.law.name in (first, rival):
                        values.append(self._number(choice, need))
                parts.append(f"{need} {' to '.join(values)}")
                continue
            worst = max(blocks, key=lambda k: self.comparison.p[k, a, b])
            effect = self.comparison.effect(worst, first, rival, winner=False)
            where = f" under {self.blocks[worst][1]}, where it does worst," * (len(blocks) > 1)
            if math.isfinite(effect.value):
                parts.append(f"{need}{where} {size_in_words(effect)}, {ahead_in_words(effect)}")
        if parts:
            return f"{first} against {rival}: {'; '.join(parts)}"
        return ""

    @property
    def _holds(self) -> str:
        """What the answer holds for, in words."""
        if self._untested:
            return "There is no test, as the worst found is one value of a law and no sample."
        several = self.comparison.sets.max(axis=1) > 1
        single = [
            law
            for law, many in zip(self.comparison.laws, several.tolist(), strict=True)
            if not many
        ]
        gains = f"over sets of gains{f', for these gains of {first_of(single)}' * bool(single)}"
        if ROBUST in self.needs:
            these = "Except for robust, these"
        else:
            these = "These"
        return f"{these} comparisons hold {gains if several.any() else 'for these gains'}, over starts and noise."

    def _number(self, choice: Choice, need: str) -> str:
        """Return a median with its unit."""
        metric = NEEDS[need]
        median = choice.medians[need].median
        if math.isfinite(median):
            unit = f" {metric.unit_for(self.plant.unit, self.effort)}"
        else:
            unit = ""
        return metric.text(median) + unit

    def _where(self, blocks: Sequence[tuple[str, str]]) -> str:
        """Return the conditions of blocks of one need in words, "" for all of them."""
        if len(blocks) == len(self.conditions):
            return ""
        return f" under {joined([condition for _, condition in blocks])}"

    def _on(self, blocks: Sequence[tuple[str, str]]) -> str:
        """Return blocks in words, such as "on fast, on calm under noise and sine"."""
        by_need = {need: [block for block in blocks if block[0] == need] for need in self.needs}
        return ", ".join(f"on {need}{self._where(its)}" for need, its in by_need.items() if its)
