"""Searches that claims share: the smallest lambda with which a start near the origin dies out."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.paper.claims.evidence import Runs
from smc_mujoco.studies.paper.claims.variants import with_gains
from smc_mujoco.studies.paper.scenarios import PLANTS, U_MAX

OURS = "observer_free"
LEAST = 1e-3  # N m s or N s: the lambda that stands for "any lambda > 0"
INNER, ROUNDS, QUICK_ROUNDS = 8, 3, 2  # 8 values at once divide a range by 9: three times, and it is known to 1.2 %
SMALL, LONG, PERIOD = 1e-3, 40.0, 5e-3  # of x0; s; s, of control and physics: the smooth law near rest asks no more


def smallest_stable(runs: Runs) -> dict[str, float]:
    """Plant -> the smallest lambda found stable between LEAST and U_MAX; LEAST if that is, inf if U_MAX is not."""
    ends = dying(runs, dict.fromkeys(PLANTS, (LEAST, U_MAX)))
    low, high = dict.fromkeys(PLANTS, LEAST), dict.fromkeys(PLANTS, U_MAX)
    for _ in range(QUICK_ROUNDS if runs.quick else ROUNDS):
        tried = {plant: np.geomspace(low[plant], high[plant], INNER + 2).tolist() for plant in PLANTS}
        inner = dying(runs, {plant: lams[1:-1] for plant, lams in tried.items()})
        for plant, lams in tried.items():
            last = max((i for i, stable in enumerate([False, *inner[plant]]) if not stable), default=0)
            low[plant], high[plant] = lams[last], lams[last + 1]
    return {
        plant: LEAST if smallest else high[plant] if largest else math.inf
        for plant, (smallest, largest) in ends.items()
    }


def dying(runs: Runs, lams: Mapping[str, Sequence[float]]) -> dict[str, list[bool]]:
    """Plant -> whether a small start dies out, for each lambda; k1 is the set's."""
    grid = [
        runs.scenario(
            plant,
            OURS,
            law=with_gains(runs.law(plant, OURS), lam=lam),
            x0=[SMALL * x for x in find_plant(plant).x0],
            duration=LONG,
            control_period=PERIOD,
            physics_step=PERIOD,
        )
        for plant, some in lams.items()
        for lam in some
    ]
    found = iter(runs.traces(grid))
    return {plant: [dies_out(next(found)) for _ in some] for plant, some in lams.items()}


def dies_out(trace: Trace) -> bool:
    """Whether the largest |x| of the last fifth is below that of the second, in which fast modes are over.

    And below the start: what falls into another well comes to rest there.
    """
    fifth = len(trace.t) // 5
    size = np.abs(trace.x).max(axis=1)
    return bool(size[-fifth:].max() < min(size[fifth : 2 * fifth].max(), size[0]))  # NaN, of a failed run, is not
