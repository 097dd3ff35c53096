"""What may be asked of a law: that a metric of its runs is small, or that the worst which an adversary finds is."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.bootstrap import Interval, median_of
from smc_mujoco.analysis.paired_runs import Group, Scores
from smc_mujoco.analysis.ranking import Rank, samples_of
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE, metrics
from smc_mujoco.metrics.conventions import Metric
from smc_mujoco.studies.board_tables import spread
from smc_mujoco.studies.table import Table
from smc_mujoco.studies.worst_case import METRIC, WorstCase

ROBUST = "robust"
TIES = {"no-overshoot": "overshoot", "frugal": "energy of u"}  # what orders laws that tie, least first, in words


class Runs(NamedTuple):
    """Runs of laws on one plant, and law -> what an adversary found in each condition if "robust" is asked, else {}."""

    table: Table
    group: Group
    worst: Mapping[str, Sequence[WorstCase]]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Choice:
    """A finalist.

    Attributes:
      law: with its gains for the plant.
      remark: what is to be said of the gains besides their source.
      rank: its mean rank over the blocks, and its place; NaN if it is not compared.
      settles: share of its runs that settle.
      reliable: whether it settles in nearly all runs of every condition.
      fit: whether it settles often enough to be advised.
      medians: need -> median over the conditions, with its interval; of "robust" the largest over the conditions.
      worst: what an adversary found in each condition, for the need "robust"; else empty.
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
        """The worst of them."""
        return max(self.worst, key=lambda one: one.value)

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
        return median_of(scores.values[law], samples=samples_of(scores.sets[law]))

    def below(self, choice: Choice) -> str:
        """Return what a table shows below the median of a finalist: its interval, if that has a width."""
        median = choice.medians[self.metric.need]
        return spread(median, self.metric.name) * (median.low < median.high)

    def remark(self, choices: Sequence[Choice]) -> str:
        """Return what an answer says of the need besides, the first of the choices being advised."""
        return ""


class Robust(Need):
    """The metric of the worst run that an adversary finds: one value of a law in a condition, compared without a test.

    The median over the conditions is here the largest value.
    """

    tested = False

    def scores(self, runs: Runs) -> Scores:
        """Return what was found, (conditions, 1) of each law."""
        values = {law: np.array([[one.value] for one in its]) for law, its in runs.worst.items()}
        alike = dict.fromkeys(values, np.zeros((len(runs.group.blocks), 1), np.int64))
        return Scores([*range(len(runs.group.blocks))], values, alike, alike)

    def median(self, scores: Scores, law: str) -> Interval:
        """Return the largest value over the conditions."""
        return Interval(float(scores.values[law].max()), math.nan, math.nan, 1)

    def below(self, choice: Choice) -> str:
        """Return the median of the random members of the class."""
        one = choice.worst_found
        return f"median {one.shown(one.median)}"

    def remark(self, choices: Sequence[Choice]) -> str:
        """Return what the adversary did, and which law the median of its random runs puts first."""
        one, fit = choices[0].worst_found, [choice for choice in choices if choice.fit] or choices
        least = min(fit, key=lambda choice: choice.worst_found.median)
        text = (
            f"Robust is by the worst found in {one.tried} runs of each law in each condition, half of them random, "
            f"within {one.class_words}, with its best set of gains from the first start; there may be worse."
        )
        if least is choices[0]:
            return text
        found = least.worst_found
        first = f"The median of the random runs would put {least.law.name} first, with {found.with_unit(found.median)}"
        return f"{text} {first}: its worst found is {found.words}."


NEEDS: Mapping[str, Need] = {metric.need: Need(metric) for metric in metrics() if metric.need}
_worst = CATALOGUE[METRIC]
NEEDS |= {ROBUST: Robust(dataclasses.replace(_worst, need=ROBUST, label=f"worst found {_worst.label}"))}


def ties(plant: Plant) -> list[Metric]:
    """Return the metrics that order laws which tie on a plant."""
    of = [NEEDS[need].metric for need in TIES]
    return [metric for metric in of if not metric.refusal(plant)]
