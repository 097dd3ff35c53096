"""Advice: the finalists of a comparison of laws, and the answer in sentences; see `adviser`.

Every sentence is made from the numbers of the comparison, so it changes when they do.
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence

from smc_mujoco.analysis.bootstrap import Interval
from smc_mujoco.analysis.ranking import Comparison, Rank
from smc_mujoco.common.text import number
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.metrics.conventions import Metric
from smc_mujoco.studies.table import Table

NAMED = 6  # names of laws that the screening left out
NEEDS: Mapping[str, Metric] = {metric.need: metric for metric in metrics() if metric.need}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Choice:
    """A finalist.

    Attributes:
      law: with its gains for the plant.
      source: where the gains are from, in words.
      rank: its mean rank over the blocks, and its place with an interval.
      settles: share of its runs that settle.
      fit: whether it settles often enough to be advised.
      medians: need -> median over the conditions, with its interval.
      unbeaten: need -> in how many conditions no finalist is better.
    """

    law: Component
    source: str
    rank: Rank
    settles: float
    fit: bool
    medians: Mapping[str, Interval]
    unbeaten: Mapping[str, int]


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Advice:
    """Which law to use on a plant, and how sure that is; `print` shows it, as a notebook does.

    Attributes:
      plant: the plant.
      conditions: names of the conditions.
      needs: names of what was compared, such as "fast".
      wanted: properties that every law here has, in words.
      choices: the finalists, the advised one first.
      others: names of the laws that the screening left out, in its order.
      comparison: of the finalists; its blocks are those of `blocks`.
      table: the finalists' runs.
    """

    plant: Plant
    conditions: tuple[str, ...]
    needs: tuple[str, ...]
    wanted: tuple[str, ...]
    choices: tuple[Choice, ...]
    others: tuple[str, ...]
    comparison: Comparison
    table: Table

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

    @property
    def level(self) -> list[str]:
        """The finalists that cannot be told from the advised law in any block, and settle as it does."""
        first, *others = self.choices
        names = [choice.law.name for choice in others if choice.fit == first.fit]
        return [name for name in names if not self.wins(first.law.name, name) and not self.wins(name, first.law.name)]

    # the table

    @property
    def title(self) -> str:
        """The question in words."""
        wanted = f", by laws that {_joined(self.wanted)}" if self.wanted else ""
        return f"{self.plant.name} under {_joined(self.conditions)}: {_joined(self.needs)}{wanted}"

    @property
    def heads(self) -> list[str]:
        """The headings of the table."""
        units = [f"{need}: {NEEDS[need].label}, {NEEDS[need].unit_for(self.plant.unit)}" for need in self.needs]
        return ["law", "place", "settles", *units]

    @property
    def rows(self) -> list[list[str]]:
        """The cells of the table, a row for each finalist; * where no finalist is better in any condition."""
        rows = []
        for choice in self.choices:
            place = f"{choice.rank.place:g}" if choice.fit else "–"
            if choice.fit and not math.isnan(choice.rank.low):
                place += f" ({_range(choice.rank.low, choice.rank.high)})"
            cells = [
                _interval(choice.medians[need])
                + " *" * (len(self.choices) > 1 and choice.unbeaten[need] == len(self.conditions))
                for need in self.needs
            ]
            rows.append([choice.law.name, place, f"{100 * choice.settles:.0f} %", *cells])
        return rows

    @property
    def key(self) -> str:
        """The meaning of the table's signs."""
        seeds = int(self.comparison.seeds.max())
        text = (
            f"place by mean rank, and medians of {len(self.conditions)} condition{'s' * (len(self.conditions) > 1)}, "
        )
        text += f"with 95 % intervals over {seeds} seeds. *: no finalist is better in any condition."
        return text + " –: settles too seldom to be advised." * any(not choice.fit for choice in self.choices)

    # the answer

    @property
    def answer(self) -> list[str]:
        """The advice in sentences: what to use and why, the second choice, how sure that is."""
        return list(filter(None, [self._use(), self._second(), self._sure(), self._left_out()]))

    def _use(self) -> str:
        first, others = self.choices[0], self.choices[1:]
        law = f"{first.law} ({first.source})"
        settles = f"It settles in {100 * first.settles:.0f} % of its runs."
        if not first.settles:
            cure = "give longer runs, a stronger actuator, more suitable laws or easier conditions"
            return f"No law can be advised, because none settles in any run: {cure}. The best mean rank has {law}."
        if not others:
            return f"Use {law}, because it is the only law here that suits. {settles}"
        if len(self.level) == len(others):
            number = f"all {len(self.choices)} finalists" if len(others) > 1 else "both laws"
            return (
                f"No law can be called the best: {number} are level in every comparison. Use the one that you know; "
                f"{law} has the best mean rank. {settles}"
            )
        return f"Use {law}, because {self._why(first)}. {settles}"

    def _why(self, first: Choice) -> str:
        """Return on which needs no finalist is better, and how often one is on the others."""
        count, reasons = len(self.conditions), []
        if best := [need for need in self.needs if first.unbeaten[need] == count]:
            reasons.append(f"no finalist is better on {_joined(best)}")
        for need in self.needs:
            if (lost := count - first.unbeaten[need]) > 0:
                where = "" if count == 1 else f" in {lost} of {count} conditions"
                reasons.append(f"on {need} another is better{where}")
        return f"it has the best mean rank: {', '.join(reasons)}"

    def _second(self) -> str:
        if len(self.choices) < 2:
            return ""
        first, second = self.choices[:2]
        ahead, behind = self.wins(second.law.name, first.law.name), self.wins(first.law.name, second.law.name)
        parts = [f"better {self._on(ahead)}"] * bool(ahead) + [f"worse {self._on(behind)}"] * bool(behind)
        how = "; ".join(parts) or "level with the first in every comparison"
        if not second.fit:
            how = "it settles too seldom to be advised"
        return f"Second choice: {second.law} ({second.source}); {how}."

    def _sure(self) -> str:
        if len(self.choices) < 2:
            return "How sure: nothing could be compared with it."
        first, second = (choice.law.name for choice in self.choices[:2])
        won, lost, of = len(self.wins(first, second)), len(self.wins(second, first)), len(self.blocks)
        level = of - won - lost
        parts = [f"against the second it wins {won}, loses {lost} and is level in {level} of {of} comparisons"]
        rank = self.choices[0].rank
        if not math.isnan(rank.low):
            parts.append(f"its place is {_range(rank.low, rank.high)} of {len(self.choices)} with 95 % confidence")
        better: dict[str, list[str]] = {}
        for choice in self.choices[1:]:
            if blocks := self.wins(choice.law.name, first):
                better.setdefault(self._on(blocks), []).append(choice.law.name)
        parts += [f"better than it {where}: {_joined(names)}" for where, names in better.items()]
        if self.level:
            parts.append(f"not to be told from it: {_joined(self.level)}")
        if (runs := int(self.comparison.runs.max())) < int(self.comparison.seeds.max()):
            parts.append(f"of two laws there are {runs} distinct runs at most, since seeds change little here")
        return f"How sure: {'; '.join(parts)}. This holds for these gains, over starts and noise."

    def _left_out(self) -> str:
        if not self.others:
            return ""
        names, more = self.others[:NAMED], ", ..." * (len(self.others) > NAMED)
        return f"A screening left out {len(self.others)} other laws, best first: {', '.join(names)}{more}"

    def _on(self, blocks: Sequence[tuple[str, str]]) -> str:
        """Return blocks in words, such as "on calm under noise and sine"."""
        by_need: dict[str, list[str]] = {}
        for need, condition in blocks:
            by_need.setdefault(need, []).append(condition)
        whole = [need for need, its in by_need.items() if len(its) == len(self.conditions)]
        parts = [f"on {_joined(whole)}"] if whole else []
        parts += [f"on {need} under {_joined(its)}" for need, its in by_need.items() if need not in whole]
        return ", ".join(parts)

    def __str__(self) -> str:
        cells = [self.heads, *self.rows]
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)) for row in cells]
        return "\n".join([self.title, *(line.rstrip() for line in lines), self.key, "", *self.answer])

    def __repr__(self) -> str:
        return f"Advice({self.plant.name}: {self.law})"

    def _repr_html_(self) -> str:
        from html import escape

        head = "".join(f"<th>{escape(text)}</th>" for text in self.heads)
        body = "".join("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in self.rows)
        answer = "".join(f"<p>{escape(text)}</p>" for text in (self.key, *self.answer))
        return f"<p><b>{escape(self.title)}</b></p><table><tr>{head}</tr>{body}</table>{answer}"


def _interval(interval: Interval) -> str:
    """Return a median with its interval, where that has a width."""
    middle, low, high = (number(value) for value in interval[:3])
    return middle if math.isnan(interval.low) or low == middle == high else f"{middle} ({low} to {high})"


def _range(low: float, high: float) -> str:
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _joined(parts: Iterable[str]) -> str:
    """Return "a, b and c"."""
    *most, last = parts
    return f"{', '.join(most)} and {last}" if most else last
