"""A quick search for gains: a quarter of the evaluations of `search`, nearly all of them coarse.

It makes the same stages in the same box, with three differences. 16 evaluations a gain are enough
then; with fewer, J was often several times that of a whole search.

1. A Latin hypercube of four times the usual size is screened in the first run alone. Its best
   third, at least three sets, is screened in all runs, and the evolution begins at the best.
2. All evaluations, those of the descent too, have one physics step a control period, and leave out
   what `search` leaves out in its first two stages.
3. The best three sets are decided as a scenario runs, under RK4 at twice its step where that fits.
"""

from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis.tuning.objective import Evaluation
from smc_mujoco.analysis.tuning.search_space import Box
from smc_mujoco.analysis.tuning.stages import (
    EVOLVED_SHARE,
    SCREENED_SHARE,
    Trials,
    descend,
    evolved,
    hypercube,
)
from smc_mujoco.common.aliases import Array

BUDGET = 16  # evaluations of a search, for each gain; the fewest that were enough
WIDER = 4  # times the usual size of the hypercube; chosen
KEPT, FEWEST = 1 / 3, 3  # of the usual size: sets that all runs screen; chosen
DECIDED = 3  # sets that are decided as a scenario runs; chosen
RULE = (
    "quick CMA-ES and COBYQA, in the logarithm of the gains: each search has its own start, seed, "
    f"noise and initial states, and {BUDGET} evaluations a gain, at one physics step a control "
    "period, and without contacts of a model that touches nothing at its start and goal. A Latin "
    "hypercube of half as many sets, within 1.5 decades about the gains' scale by dimension, "
    "further above for products of more than two rates, is screened in the first run alone, and "
    "the best of these in all. CMA-ES and COBYQA go on from there; both may leave the box by a "
    "decade. The best three sets are decided as a scenario runs, under RK4 at twice its step where "
    "that fits"
)


class OutOfTime(Exception):
    """The time of a search is over: it ends with the best sets so far."""


class SearchSpace(NamedTuple):
    """Where a search looks for gains."""

    box: Box  # from which it starts
    searched: Box  # which it does not leave
    inside: Array  # log10 gains in the box that hold the conditions of the law's theorem


def search(
    alone: Trials, every: Trials, space: SearchSpace, random: np.random.Generator, size: int
) -> int:
    """Make a search of at most `size` evaluations in `every` run, the first of which is `alone`.

    Return what the first stage cost, in evaluations.
    """
    usual = int(SCREENED_SHARE * size)
    hypercube(alone, space.box, random, WIDER * usual, space.inside)
    alone.cheap.release()
    spent = round(alone.count / len(every.cheap.cases))
    count = max(FEWEST, int(KEPT * usual))
    decided = alone.decided.values()
    promising = sorted(decided, key=_objective)[:count]
    rows = (
        np.log10([evaluation.gains for evaluation in promising])
        if promising
        else space.inside[None]
    )
    costs = every.screen(rows)
    logs = rows[np.argmin(costs)]
    share = int(EVOLVED_SHARE * size)
    logs = evolved(every, space.searched, random, logs, costs.min(), share)
    descend(every, space.searched, logs, size - every.count - spent)
    return spent


def first(every: Trials) -> list[Evaluation]:
    """Return the best sets of a search, which are to be decided."""
    return sorted(every.decided.values(), key=_objective)[:DECIDED]


def _objective(one: Evaluation) -> float:
    return one.objective
