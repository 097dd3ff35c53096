"""Searches that claims share: the largest delay that a law tolerates, the smallest stabilising lambda.

    largest_delays(runs, PLANTS, LAWS)["duffing", "classical"]    # s

Delays: a run tolerates a delay if its ultimate bound is at most 5 % of |x0|. The search is that of `margins`, down to
one control period. Its runs are the audit's own, so that mutants of laws are searched as well.

Lambda: a start near the origin is to die out. A range is divided by eight values at once, three times.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from smc_mujoco.analysis import linear_theory
from smc_mujoco.analysis.margins import DELAYS, TOLERATED_ERROR, Search, find_boundaries
from smc_mujoco.control.law import law as find_law
from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.papers.gaber.claims.common import OURS, long_run, scale
from smc_mujoco.evidence.papers.gaber.scenarios import CONTROL_PERIOD, U_MAX
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.trace import Trace

COARSE = 8  # control periods between which a quick search ends, chosen; it tries none shorter, with a quick integrator

MIN_LAMBDA = 1e-3  # N m s or N s: the lambda that stands for "any lambda > 0"
INNER, ROUNDS, QUICK_ROUNDS = 8, 3, 2  # 8 values at once divide a range by 9: three times, and it is known to 1.2 %
SMALL = 1e-3  # of x0

Pair = tuple[str, str]


def largest_delays(
    runs: Runs, plants: Sequence[str], laws: Sequence[str], within: float = TOLERATED_ERROR
) -> dict[Pair, float]:
    """Return (plant, law) -> the largest delay tolerated, s: 0 if none is, the last of DELAYS if all are.

    A law that does not come to rest without delay tolerates none.

    Args:
      within: of |x0|, below which the ultimate bound is to be.
    """
    apart, integrator = (COARSE, "implicitfast") if runs.quick else (1, "RK4")
    levels = [0, *(periods for delay in DELAYS if (periods := round(delay / CONTROL_PERIOD)) >= apart)]

    def tolerated(tried: Sequence[tuple[Pair, float]]) -> list[bool]:
        scenarios = [
            runs.scenario(*pair, input_delay=periods * CONTROL_PERIOD, integrator=integrator) for pair, periods in tried
        ]
        scores = runs.scores(scenarios)
        return [s["ultimate_bound"] <= within * scale(c) for s, c in zip(scores, scenarios, strict=True)]

    searches = {
        (plant, law): Search(levels=levels, resolution=lambda low: apart, rounded=round, low=-1)
        for plant in plants
        for law in laws
    }
    find_boundaries(searches, tolerated)
    return {pair: max(search.low, 0) * CONTROL_PERIOD for pair, search in searches.items()}


def critical_delay(runs: Runs, plant: str) -> float:
    """Return linear theory's critical delay of the paper's law, s; NaN for a mutant, which has no theory."""
    law = runs.law(plant, OURS)
    if law.function is not find_law(OURS).function or min(law.gains["lam"], law.gains["k1"]) <= 0.0:
        return math.nan
    return linear_theory.critical_delay(find_plant(plant), law.gains["lam"], law.gains["k1"], CONTROL_PERIOD)


def smallest_stable(runs: Runs) -> dict[str, float]:
    """Return plant -> the smallest lambda found stable between MIN_LAMBDA and U_MAX; inf if U_MAX is not."""
    ends = dying(runs, dict.fromkeys(runs.plants, (MIN_LAMBDA, U_MAX)))
    low, high = dict.fromkeys(runs.plants, MIN_LAMBDA), dict.fromkeys(runs.plants, U_MAX)
    for _ in range(QUICK_ROUNDS if runs.quick else ROUNDS):
        tried = {plant: np.geomspace(low[plant], high[plant], INNER + 2).tolist() for plant in runs.plants}
        inner = dying(runs, {plant: lams[1:-1] for plant, lams in tried.items()})
        for plant, lams in tried.items():
            last = max((i for i, stable in enumerate([False, *inner[plant]]) if not stable), default=0)
            low[plant], high[plant] = lams[last], lams[last + 1]
    return {
        plant: MIN_LAMBDA if smallest else high[plant] if largest else math.inf
        for plant, (smallest, largest) in ends.items()
    }


def dying(runs: Runs, lams: Mapping[str, Sequence[float]]) -> dict[str, list[bool]]:
    """Return plant -> whether a small start dies out, for each lambda; k1 is the set's."""
    grid = [long_run(runs, plant, lam, SMALL) for plant, some in lams.items() for lam in some]
    traces = iter(runs.traces(grid))
    return {plant: [dies_out(next(traces)) for _ in some] for plant, some in lams.items()}


def dies_out(trace: Trace) -> bool:
    """Return whether a run ends smaller than it was: its last fifth against its second one, and against its start.

    Fast modes are over in the second fifth. The start counts since a run may come to rest in another well.
    """
    fifth = len(trace.t) // 5
    size = np.abs(trace.x).max(axis=1)
    return bool(size[-fifth:].max() < min(size[fifth : 2 * fifth].max(), size[0]))  # NaN, of a failed run, is not
