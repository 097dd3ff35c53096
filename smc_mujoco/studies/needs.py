"""Needs: what a law should be, such as "fast". A need is a metric to keep small, in runs or in the worst case."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.bootstrap import Interval, median_of
from smc_mujoco.analysis.paired_runs import Group, Scores
from smc_mujoco.analysis.ranking import Rank, linked
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE, metrics
from smc_mujoco.metrics.conventions import Metric
from smc_mujoco.studies.board import spread
from smc_mujoco.studies.table import Table
from smc_mujoco.studies.worst_case import METRIC, WorstCase

ROBUST = "robust"
TIES = {"no-overshoot": "overshoot", "frugal": "energy of u"}  # need -> its metric in words, in the order of ties


class Runs(NamedTuple):
    """Runs of laws on one plant. `worst` is for the need "robust": law -> its worst case in each condition; else {}."""

    table: Table
    group: Group
    worst: Mapping[str, Sequence[WorstCase]]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Choice:
    """A law that was compared.

    Attributes:
      law: with its gains for the plant.
      remark: what there is to say of the gains besides their source.
      rank: its mean rank over the blocks, and its place; NaN if it is not compared.
      settles: share of its runs that settle.
      reliable: whether it settles in nearly all runs of every condition.
      fit: whether it settles often enough to be advised.
      medians: need -> median over the conditions, with its interval; of "robust" the largest over the conditions.
      worst: its worst case in each condition, for the need "robust"; else empty.
    """

    law: Component
    remark: str
    rank: Rank
    settles: float
    reliable: bool
    fit: bool
    medians: Mapping[str, Interval]
    worst: tuple[WorstCase, ...] = ()

    @property
    def worst_found(self) -> WorstCase:
        """The worst case of all conditions."""
        return max(self.worst, key=lambda case: case.value)

    @property
    def gains(self) -> str:
        """Where the gains come from, in words."""
        return f"gains: {self.law.source}" + f"; {self.remark}" * bool(self.remark)


@dataclasses.dataclass(frozen=True)
class Need:
    """A metric that is to be small in the runs of a law.

    Attributes:
      metric: the metric.
      tested: whether laws are compared by a test over runs, see `ranking`.
    """

    metric: Metric
    tested: ClassVar[bool] = True

    def scores(self, runs: Runs) -> Scores:
        """Return the scores of the laws."""
        return runs.group.scores(paired_runs.values(runs.table, self.metric.name))

    def median(self, scores: Scores, law: str) -> Interval:
        """Return a law's median over the conditions."""
        return median_of(scores.values[law], linked(*scores.sets[law]))

    def below(self, choice: Choice) -> str:
        """Return the text below the median of a law in a table: its interval, if that has a width."""
        median = choice.medians[self.metric.need]
        return spread(median, self.metric.name) * (median.low < median.high)

    def remark(self, choices: Sequence[Choice]) -> str:
        """Return an additional sentence of the answer. The first of the choices is advised."""
        return ""


class Robust(Need):
    """The metric of the worst case: one value of a law in a condition, so laws are compared without a test.

    Its median over the conditions is their largest value.
    """

    tested = False

    def scores(self, runs: Runs) -> Scores:
        """Return the value of each law, (conditions, 1)."""
        values = {law: np.array([[case.value] for case in cases]) for law, cases in runs.worst.items()}
        zeros = dict.fromkeys(values, np.zeros((len(runs.group.blocks), 1), np.int64))
        return Scores([*range(len(runs.group.blocks))], values, zeros, zeros)

    def median(self, scores: Scores, law: str) -> Interval:
        """Return the largest value over the conditions."""
        return Interval(float(scores.values[law].max()), math.nan, math.nan, 1)

    def below(self, choice: Choice) -> str:
        """Return the median of the random members of the class."""
        worst = choice.worst_found
        return f"median {worst.shown(worst.median)}"

    def remark(self, choices: Sequence[Choice]) -> str:
        """Return what the adversary did, and which law the median of its random runs puts first."""
        advised, fit = choices[0].worst_found, [choice for choice in choices if choice.fit] or choices
        lowest = min(fit, key=lambda choice: choice.worst_found.median)
        text = (
            f"Robust is by the worst found in {advised.tried} runs of each law in each condition, half of them random, "
            f"within {advised.class_words}, with its best set of gains from the first start; there may be worse."
        )
        if lowest is choices[0]:
            return text
        other = lowest.worst_found
        first = f"The median of the random runs would put {lowest.law.name} first, with {other.with_unit(other.median)}"
        return f"{text} {first}: its worst found is {other.words}."


NEEDS: Mapping[str, Need] = {metric.need: Need(metric) for metric in metrics() if metric.need}
NEEDS |= {
    ROBUST: Robust(dataclasses.replace(CATALOGUE[METRIC], need=ROBUST, label=f"worst found {CATALOGUE[METRIC].label}"))
}


def ties(plant: Plant) -> list[Metric]:
    """Return the metrics that order laws which tie on a plant."""
    return [NEEDS[need].metric for need in TIES if not NEEDS[need].metric.refusal(plant)]
