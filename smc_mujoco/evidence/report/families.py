"""Sliding mode against its rivals: which family of laws is first, by how much, and how sure that
is.

In each family the law is chosen by half of the runs and scored in the other half, and the reverse,
so the larger family has no advantage. A lead is the ratio of two families' scores, run by run; runs
that share a set of gains count once.
"""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.ranking import interval, linked

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table

FAMILIES = {
    "switching": (
        *(
            "classical",
            "adaptive",
            "super_twisting",
            "conditioned_super_twisting",
            "implicit_first_order",
        ),
        *("twisting", "terminal"),
    ),
    "smoothed": (
        "observer_free",
        "boundary_layer",
    ),  # the same surface, and a steep slope in place of the sign
    "rivals": ("pid", "extended_state", "adrc", "pd_observer", "lqi", "mpc", "loop_shaping"),
}
METRIC, ERROR = "itae", 0.025  # of the map; beyond each end of an interval


class Lead(NamedTuple):
    """The lead of the first family over the second in a cell, a plant in a condition."""

    plant: str
    condition: str
    first: str  # family
    second: str
    times: float  # the second's score over the first's
    low: float
    high: float
    laws: tuple[str, ...]  # of the first family: of both halves of the runs

    @property
    def sure(self) -> bool:
        """Whether the interval leaves no doubt of which of the two is better."""
        return self.low > 1.0


def told(values: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Return a family's score in each run, of the law that the other half of the runs chose, and
    both laws.

    `values`: (laws, runs).
    """
    scores = np.empty(values.shape[1])
    best = []
    for half in (0, 1):
        best.append(int(np.median(values[:, 1 - half :: 2], axis=1).argmin()))
        scores[half::2] = values[best[-1], half::2]
    return scores, best


def lead(
    scores: Mapping[str, np.ndarray],
    sets: Mapping[str, np.ndarray],
    floor: float,
    families: Mapping[str, Sequence[str]] = FAMILIES,
) -> Lead | None:
    """Return the lead in a cell; None with fewer than two families, or two runs.

    Scores: law -> (runs,).
    """
    members = {family: [law for law in laws if law in scores] for family, laws in families.items()}
    members = {family: laws for family, laws in members.items() if laws}
    if len(members) < 2 or len(next(iter(scores.values()))) < 2:
        return None
    by_family = {
        family: told(np.maximum([scores[law] for law in laws], floor))
        for family, laws in members.items()
    }
    first, second = sorted(by_family, key=lambda family: float(np.median(by_family[family][0])))[:2]
    with np.errstate(invalid="ignore"):
        ratios = np.log(by_family[second][0]) - np.log(by_family[first][0])  # NaN where both fail
    labels = linked(*sets.values()) or tuple(range(len(ratios)))
    with np.errstate(invalid="ignore"):
        samples = [ratios[np.equal(labels, label)].mean() for label in dict.fromkeys(labels)]
    times, low, high = map(math.exp, interval(np.array(samples), ERROR))
    laws = tuple(dict.fromkeys(members[first][i] for i in by_family[first][1]))
    return Lead("", "", first, second, times, low, high, laws)


def leads(
    table: "Table", metric: str = METRIC, families: Mapping[str, Sequence[str]] = FAMILIES
) -> tuple[Lead, ...]:
    """Return the lead in every cell of a study's table that has one; families: name -> names of
    laws.
    """
    found = []
    by_row = paired_runs.by_row(table, metric)
    for group in paired_runs.groups(table, by=("plant", "condition")):
        ((plant, condition),) = group.blocks
        (ran,) = paired_runs.scenarios(table, group)
        if not (its := group.scores(by_row)).values:
            continue
        there = ~np.isnan(np.array([row[0] for row in its.values.values()])).any(axis=0)
        values, sets = (
            {law: row[0][there] for law, row in of.items()} for of in (its.values, its.sets)
        )
        if one := lead(values, sets, paired_runs.floor(ran, metric), families):
            found.append(one._replace(plant=plant, condition=condition))
    return tuple(found)


def counted(cells: Sequence[Lead]) -> dict[str, int]:
    """Return in how many cells each family is surely first, and in how many, under "", none is."""
    found = dict.fromkeys((*FAMILIES, ""), 0)
    for one in cells:
        found[one.first if one.sure else ""] += 1
    return found
