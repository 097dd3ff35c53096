"""Advice, the result of `adviser`: the laws of a comparison, as a table and as an answer in sentences.

Every sentence is made from the numbers of the comparison, so it changes when they do.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from smc_mujoco.analysis.bootstrap import LEVEL
from smc_mujoco.analysis.paired_runs import failures
from smc_mujoco.analysis.ranking import Comparison, min_p
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.common.text import capital, counted, every, joined
from smc_mujoco.control.component import Component
from smc_mujoco.control.law import catalogue
from smc_mujoco.control.source import in_words
from smc_mujoco.draw.style import law_colour
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.studies.board import relevance, size_in_words
from smc_mujoco.studies.needs import NEEDS, TIES, Choice, ties
from smc_mujoco.studies.table import Table

MAX_ROWS = 12  # laws in the table; chosen
MAX_NAMES = 6  # of laws in a sentence; chosen


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Advice(Tables):
    """Which law to use on a plant, and how sure that is; `print` shows it, as a notebook does.

    Attributes:
      plant: the plant.
      conditions: names of the conditions.
      needs: names of the compared needs, such as "fast".
      wanted: properties that every law has, in words.
      choices: the laws, best first.
      comparison: of the laws that are fit, or of all if none is; its blocks are those of `blocks`.
      table: their runs.
      effort: unit of u, "N m", "N" or "V"; "" for that of a force, or where conditions differ.
      untuned: names of the laws with default gains, over which no other law is advised.
    """

    plant: Plant
    conditions: tuple[str, ...]
    needs: tuple[str, ...]
    wanted: tuple[str, ...]
    choices: tuple[Choice, ...]
    comparison: Comparison
    table: Table
    effort: str = ""
    untuned: tuple[str, ...] = ()

    @property
    def barred(self) -> list[str]:
        """The rivals with default gains over which the first of the `choices` is not advised."""
        return [name for name in self.untuned if name != self.choices[0].law.name]

    @property
    def law(self) -> Component:
        """The advised law, with its gains."""
        return self.choices[0].law

    @property
    def second(self) -> Component | None:
        """The second choice, with its gains; None if only one law suits."""
        return self.choices[1].law if len(self.choices) > 1 else None

    @property
    def blocks(self) -> list[tuple[str, str]]:
        """The need and the condition of each block of the comparison."""
        return [(need, condition) for need in self.needs for condition in self.conditions]

    def wins(self, law: str, rival: str) -> list[tuple[str, str]]:
        """Return the need and the condition of each block in which a law is better than a rival."""
        a, b = (self.comparison.laws.index(name) for name in (law, rival))
        return [block for block, better in zip(self.blocks, self.comparison.better[:, a, b], strict=True) if better]

    def better(self, law: str, need: str) -> dict[str, list[str]]:
        """Return law -> the conditions in which it is better than a law on a need; most conditions first."""
        by_rival = {}
        for rival in self.compared:
            if conditions := [condition for other, condition in self.wins(rival, law) if other == need]:
                by_rival[rival] = conditions
        return dict(sorted(by_rival.items(), key=lambda item: -len(item[1])))

    def _any(self, flags: np.ndarray, law: str, need: str) -> bool:
        """Return whether flags of the comparison, (laws, blocks), are true of a law in some block of a need."""
        row = flags[self.comparison.laws.index(law)].tolist()
        return any(value for (compared, _), value in zip(self.blocks, row, strict=True) if compared == need)

    def dominated(self, law: str) -> list[str]:
        """Return the laws that are better than a law in some block, and worse in none."""
        rivals = (name for name in self.compared if name != law)
        return [name for name in rivals if self.wins(name, law) and not self.wins(law, name)]

    @property
    def compared(self) -> list[str]:
        """The laws that are compared, best first."""
        return [choice.law.name for choice in self.choices if choice.law.name in self.comparison.laws]

    @property
    def level(self) -> list[str]:
        """The laws that cannot be told from the advised law in any block."""
        first, *others = self.compared
        return [name for name in others if not self.wins(first, name) and not self.wins(name, first)]

    @property
    def all_level(self) -> bool:
        """Whether there are several laws, none better or worse than the advised law."""
        return 1 < len(self.compared) == len(self.level) + 1

    @property
    def code(self) -> str:
        """The advised law as Python, "" if none is advised or it is not in the catalogue under its name."""
        if not self.choices[0].reliable or not self.choices[0].fit or self.all_level or self.barred:
            return ""
        known = catalogue().get(self.law.name)
        return f"smc.{self.law!r}" if known is not None and known.function is self.law.function else ""

    @property
    def tied(self) -> list[str]:
        """The laws that are level with the advised law, and whose medians do not differ relevantly from its."""
        laws, first = self.comparison.laws, self.compared[0]
        return [name for name in self.compared[1:] if self.comparison.tied[laws.index(first), laws.index(name)]]

    @property
    def rule(self) -> str:
        """The order of laws that tie, in words."""
        words = [words for need, words in TIES.items() if NEEDS[need].metric in ties(self.plant)]
        return f"laws that tie stand in the order of {', then of '.join(words)}, less first"

    # the table

    @property
    def title(self) -> str:
        """The question in words."""
        wanted = f", by laws that {joined(self.wanted)}" if self.wanted else ""
        return f"{self.plant.name} under {joined(self.conditions)}: {joined(self.needs)}{wanted}"

    @property
    def tables(self) -> list[Tabular]:
        """One table with a row for each of the first laws, above the answer; marked where no law is better."""
        metrics = [NEEDS[need].metric for need in self.needs]
        units = [f"{m.need}: {m.label} ({m.unit_for(self.plant.unit, self.effort)})" for m in metrics]
        rows = []
        for choice in self._shown:
            law = Cell(choice.law.name, colour=law_colour(choice.law.name))
            place, settles = f"{choice.rank.place:g}" if choice.fit else "–", f"{100 * choice.settles:.0f} %"
            rows.append([law, place, settles, *(self._cell(choice, need) for need in self.needs)])
        answer = [*self.answer, *([f"In Python: {self.code}"] if self.code else [])]
        notes = [line for sentence in (self.key, *failures(self.table), *answer) for line in (sentence, "")][:-1]
        return [Tabular(headings=["law", "place", "settles", *units], rows=rows, title=self.title, notes=notes)]

    @property
    def _shown(self) -> tuple[Choice, ...]:
        """The laws that have a row in the table."""
        return self.choices[:MAX_ROWS]

    def _cell(self, choice: Choice, need: str) -> Cell:
        """Return a median, marked if no law is better in any condition and no run fails."""
        name, entry = choice.law.name, NEEDS[need]
        rivalled = len(self.compared) > 1 and name in self.compared
        doubted = rivalled and self._any(self.comparison.undecided | self.comparison.beaten, name, need)
        return Cell(entry.metric.text(choice.medians[need].median), entry.below(choice), rivalled and not doubted)

    @property
    def key(self) -> str:
        """The meaning of the table's signs."""
        of = f" of {len(self.conditions)} conditions" if len(self.conditions) > 1 else ""
        medians = f", and medians{of}, with 95 % intervals over {self.samples}" * (not self._untested)
        text = f"place by failed runs, then by mean rank{medians}. "
        if more := [choice.law.name for choice in self.choices[MAX_ROWS:]]:
            text += f"{counted(len(more), 'more law')}: {_first_of(more)}. "
        text += f"*: no law is better{' in any condition' if of else ''}, and every run has a value."
        bare = any(not NEEDS[need].below(choice) for choice in self._shown for need in self.needs)
        text += " No interval: its ends are equal, or one is a run without a value." * bare
        if self.comparison.undecided.any():
            text += " A law is not marked where samples are too few to tell."
        if sources := in_words({choice.law.name: [choice.law.source] for choice in self._shown}):
            text += f" {capital(sources)}."
        if any(self.dominated(name) for name in self.compared):
            text += " A law stands behind those that dominate it: better somewhere, worse nowhere."
        if self._shared and len(self._shared) < len(self.comparison.laws):
            text += f" Sets of gains, which are the sample of a law that has several: {_first_of(self._shared)}."
        text += " –: settles too seldom to be advised." * any(not choice.fit for choice in self._shown)
        metrics = [NEEDS[need].metric.name for need, _ in self.blocks]
        floors = zip(metrics, self.comparison.floors.tolist(), strict=True)
        relevant = relevance(self.comparison.relevant, floors, self.plant.unit)
        return f"{text} Ahead: by more than the least relevant difference, {relevant}."

    @property
    def samples(self) -> str:
        """The largest sample of two laws in words: "24 runs", or "3 sets of gains" where runs share them."""
        samples, sets = self.comparison.samples, self.comparison.sets.max(axis=1)
        block, a, b = np.unravel_index(int(samples.argmax()), samples.shape)
        count = int(samples[block, a, b]) if len(sets) > 1 else int(self.comparison.seeds.max())
        return f"{counted(count, 'set')} of gains" if max(sets[a], sets[b]) > 1 else counted(count, "run")

    @property
    def _shared(self) -> list[str]:
        """The laws whose runs share several sets of gains."""
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
        """The advice in sentences: the law and why, laws for single needs, the second choice, how sure it is."""
        remarks = [NEEDS[need].remark(self.choices) for need in self.needs]
        advice = [self._use(), self._because(), *remarks, *self._instead(), self._second(), self._sure()]
        parts = [self._refusal(), *remarks] if self.barred else advice
        return list(filter(None, parts))

    def _refusal(self) -> str:
        """Return why no law is advised over rivals with default gains."""
        its, it = ("its", "it") if len(self.barred) == 1 else ("their", "them")
        why = f"No law is advised over {_first_of(self.barred)}, whose gains are {its} defaults"
        return f"{why}: tune {it}, or ask for it with defaults=True (--defaults)."

    def _use(self) -> str:
        first = self.choices[0]
        longer = f"longer runs than {self.table.scenario(0).duration:g} s"
        cure = f"give {longer}, a stronger actuator, more suitable laws or easier conditions"
        if not first.settles or not first.fit:
            why = "none settles in any run" if not first.settles else "none settles often enough in every condition"
            return f"No law can be advised, because {why}: {cure}."
        if not first.reliable:
            runs = f"{100 * first.settles:.0f} % of its runs"
            among = f"the first of {len(self.compared)}" if len(self.compared) > 1 else "the only one compared"
            return f"No law is reliable here: {first.law.name}, {among}, settles in {runs}; {cure}."
        if self.all_level and self._too_few:
            comparisons = counted(len(self.blocks), "comparison")
            return f"No law can be called the best with {self.samples}: too few for {comparisons}."
        if self.all_level:
            laws = f"{every(len(self.compared))} laws"
            where = "in the worst that was found" if self._untested else f"in every comparison of {self.samples}"
            return f"No law can be called the best: {laws} are level {where}. Use the one that you know."
        return f"Use {first.law} ({first.gains})."

    def _because(self) -> str:
        first, count = self.choices[0], len(self.compared)
        if not first.reliable or not first.fit:
            return ""
        if self.all_level:
            share = min(choice.settles for choice in self.choices if choice.fit)
            return f"Each settles in {'at least ' * (share < 1)}{100 * share:.0f} % of its runs."
        leads = first.rank.mean == min(choice.rank.mean for choice in self.choices if choice.fit)
        equals = [c.law.name for c in self.choices[1:] if c.fit and c.rank.mean == first.rank.mean]
        why = f"it has the best mean rank of {count} laws"
        why += f", as {'has' if len(equals) == 1 else 'have'} {_first_of(equals)}" if equals else ""
        if not leads:
            why = "it has the best mean rank of those that none dominates, being better somewhere and worse nowhere"
        ahead = [c.law.name for c in self.choices[1:] if c.law.name in self.tied and c.rank.mean < first.rank.mean]
        if ahead:
            why = f"it ties with {_first_of(ahead)}, of better mean rank, and {self.rule}"
        if count == 1:
            alone = "is the only law here that suits" if len(self.choices) == 1 else "alone settles often enough"
            why = f"it {alone}"
        parts = [f"Because {why}. It settles in {100 * first.settles:.0f} % of its runs."]
        parts += [self._standing(first, need) for need in self.needs] if count > 1 else []
        return " ".join(parts)

    def _standing(self, choice: Choice, need: str) -> str:
        """Return the median of a law on a need, and who is better."""
        value, better = self._value(choice, need), self.better(choice.law.name, need)
        if not better:
            few = ", as far as so few samples tell" * self._any(self.comparison.undecided, choice.law.name, need)
            return f"{capital(need)}: {value}; no law is better{few}."
        by_where: dict[str, list[str]] = {}
        for name, conditions in better.items():
            by_where.setdefault(self._where(conditions), []).append(name)
        rivals = [f"{_first_of(names)}{where}" for where, names in by_where.items()]
        return f"{capital(need)}: {value}; better {'is' if len(better) == 1 else 'are'} {'; '.join(rivals)}."

    def _instead(self) -> list[str]:
        """Return for each need the law that is better than the advised law, if there is one, and what it costs."""
        first, sentences = self.choices[0], []
        if len(self.needs) == 1 or not first.fit or not first.reliable or self.all_level:
            return []
        known = {choice.law.name: choice for choice in self.choices}
        for need in self.needs:
            better = {  # also over all conditions, not only in some
                law: where
                for law, where in self.better(first.law.name, need).items()
                if known[law].medians[need].median < first.medians[need].median
            }
            if not better:
                continue
            name = min(better, key=lambda law: (-len(better[law]), known[law].medians[need].median))
            other = known[name]
            costs = [
                cost
                for cost in self.needs
                if self.better(name, cost).get(first.law.name)
                and other.medians[cost].median > first.medians[cost].median
            ]
            changes = [f"{self._value(other, n)} instead of {self._number(first, n)}" for n in (need, *costs)]
            text = f"If only {need} counts: {other.law}, with {changes[0]}"
            sentences.append(text + f"; it costs {joined(changes[1:])}." if costs else text + ".")
        return sentences

    def _second(self) -> str:
        if len(self.choices) < 2 or self.all_level or not self.choices[0].reliable:
            return ""
        first, second = self.choices[:2]
        named = f"Second choice: {second.law} ({second.gains})"
        if not second.fit:
            return f"{named}; it settles too seldom to be advised."
        ahead, behind = self.wins(second.law.name, first.law.name), self.wins(first.law.name, second.law.name)
        parts = [f"better {self._on(ahead)}"] * bool(ahead) + [f"worse {self._on(behind)}"] * bool(behind)
        return f"{named}; {'; '.join(parts) or 'level with the first in every comparison'}."

    def _sure(self) -> str:
        if len(self.compared) < 2:
            return "Not sure: there was no second law."
        first, *others = self.compared
        if self._too_few:
            return f"How sure: not at all, with {self.samples}."
        if self.all_level:
            return f"How sure: {self._against(others[0])}. {self._holds}"
        beaten = [name for name in others if first in self.dominated(name)]
        mixed = [name for name in others if self.wins(name, first)]
        unsure = [name for name in self.level if name not in self.tied]
        parts = [
            f"it dominates {_first_of(beaten)}: better somewhere, worse nowhere" if beaten else "",
            f"it ties with {_first_of(self.tied)}; {self.rule}" if self.tied else "",
            f"not to be told from {_first_of(unsure)}" if unsure else "",
            f"a matter of what counts against {_first_of(mixed)}, better here and worse there" if mixed else "",
            self._against(others[0]),
        ]
        return f"How sure: {'; '.join(filter(None, parts))}. {self._holds} {self._luck}".strip()

    def _against(self, rival: str) -> str:
        """Return how the first law compares with a rival on each need, in the condition that is worst for the first."""
        first = self.compared[0]
        a, b = (self.comparison.laws.index(name) for name in (first, rival))
        parts = []
        for need in self.needs:
            blocks = [k for k, block in enumerate(self.blocks) if block[0] == need]
            if self.comparison.untested[blocks].all():
                values = [self._number(choice, need) for choice in self.choices if choice.law.name in (first, rival)]
                parts.append(f"{need} {' to '.join(values)}")
                continue
            worst = max(blocks, key=lambda k: self.comparison.p[k, a, b])
            effect = self.comparison.effect(worst, first, rival, winner=False)
            where = f" under {self.blocks[worst][1]}, where it does worst," * (len(blocks) > 1)
            if math.isfinite(effect.value):
                samples = "sets of gains" if effect.sets else "runs"
                ahead = f"ahead with {effect.ahead} of {effect.samples} {samples}"
                unit = NEEDS[need].metric.unit_for(self.plant.unit, self.effort)
                parts.append(f"{need}{where} {size_in_words(effect, unit)}, {ahead}")
        return f"{first} against {rival}: {'; '.join(parts)}" if parts else ""

    @property
    def _holds(self) -> str:
        """What the answer holds for, in words."""
        if self._untested:
            return "There is no test, as the worst found is one value of a law and no sample."
        several = self.comparison.sets.max(axis=1) > 1
        gains = "over sets of gains" if several.all() else "for these gains"
        if several.any() and not several.all():
            single = [law for law, many in zip(self.comparison.laws, several.tolist(), strict=True) if not many]
            gains = f"over sets of gains, but for these gains of {_first_of(single)}"
        others = [need for need in self.needs if not NEEDS[need].tested]
        these = f"Except for {joined(others)}, these" if others else "These"
        return f"{these} comparisons hold {gains}, over starts and noise."

    @property
    def _luck(self) -> str:
        """Which laws might be first by chance, in words; "" if none."""
        first, *others = self.compared
        rivals = any(first not in self.dominated(name) for name in others)
        if self._untested or not rivals:
            return ""
        chance = "with other starts and noise, or among other laws, a law that it does not dominate may be first"
        return f"The order is not tested: {chance}."

    def _value(self, choice: Choice, need: str) -> str:
        """Return a median in words, such as "settling time 0.92 s"."""
        return f"{NEEDS[need].metric.label} {self._number(choice, need)}"

    def _number(self, choice: Choice, need: str) -> str:
        """Return a median with its unit."""
        metric, median = NEEDS[need].metric, choice.medians[need].median
        unit = f" {metric.unit_for(self.plant.unit, self.effort)}" if math.isfinite(median) else ""
        return metric.text(median) + unit

    def _where(self, conditions: Sequence[str]) -> str:
        return "" if len(conditions) == len(self.conditions) else f" under {joined(conditions)}"

    def _on(self, blocks: Sequence[tuple[str, str]]) -> str:
        """Return blocks in words, such as "on calm under noise and sine"."""
        by_need: dict[str, list[str]] = {}
        for need, condition in blocks:
            by_need.setdefault(need, []).append(condition)
        everywhere = [need for need, conditions in by_need.items() if len(conditions) == len(self.conditions)]
        parts = [f"on {joined(everywhere)}"] if everywhere else []
        parts += [f"on {need} under {joined(where)}" for need, where in by_need.items() if need not in everywhere]
        return ", ".join(parts)

    def __repr__(self) -> str:
        return f"Advice({self.plant.name}: {'no law' if self.barred else self.law})"


def _first_of(names: Sequence[str]) -> str:
    """Return names in a row; if they are many, the first ones and how many more there are."""
    more = len(names) - MAX_NAMES
    return joined([*names[:MAX_NAMES], f"{more} more"]) if more > 1 else joined(names)
