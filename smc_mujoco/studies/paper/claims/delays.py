"""The largest input delay that a law bears on a plant, under the audit's own runs, mutants included.

    largest(runs, PLANTS, LAWS)["duffing", "classical"]    # s

What is borne, and the search, are those of `margins`: a run bears a delay if its ultimate bound is at most 5 % of |x0|,
which holds the envelope below its start as well; the delays of `bearing` are tried from the shortest to the first that
is not borne, and the gap is halved down to one control period.
"""

import math
from collections.abc import Iterable, Sequence

from smc_mujoco.analysis import linear_theory
from smc_mujoco.analysis.margin_kinds import BEARS, DELAYS
from smc_mujoco.control.law import law as find_law
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.studies.paper.claims.compare import OURS
from smc_mujoco.studies.paper.claims.evidence import Runs, scale
from smc_mujoco.studies.paper.scenarios import CONTROL_PERIOD

TRIED = [round(delay / CONTROL_PERIOD) for delay in DELAYS]  # control periods
COARSE = 8  # control periods between which a quick search ends, chosen; it tries none shorter, with a quick integrator

Pair = tuple[str, str]


def largest(runs: Runs, plants: Sequence[str], laws: Sequence[str], within: float = BEARS) -> dict[Pair, float]:
    """(plant, law) -> the largest delay borne, s: 0 where none is, the last of DELAYS where all that were tried are.

    Args:
      within: of |x0|, below which the ultimate bound is to be.
    """
    pairs = [(plant, law) for plant in plants for law in laws]
    low = dict.fromkeys(pairs, 0)
    high: dict[Pair, int] = {}
    tried = dict.fromkeys(pairs, 0)
    apart = COARSE if runs.quick else 1
    while tried:
        for pair, held in zip(tried, _borne(runs, tried.items(), within), strict=True):
            if held:
                low[pair] = tried[pair]
            else:
                high[pair] = tried[pair]
        tried = {pair: at for pair in pairs if (at := _next(low[pair], high.get(pair), apart))}
    return {pair: low[pair] * CONTROL_PERIOD for pair in pairs}


def _next(low: int, high: int | None, apart: int) -> int:
    """The delay to try next, control periods; 0 where the search is over."""
    if high is None:
        return next((at for at in TRIED if at > low and at >= apart), 0)
    return round((low + high) / 2) if high - low > apart else 0


def _borne(runs: Runs, tried: Iterable[tuple[Pair, int]], within: float) -> list[bool]:
    """Whether each delay, in control periods, is borne."""
    integrator = "implicitfast" if runs.quick else "RK4"
    scenarios = [runs.scenario(*pair, input_delay=at * CONTROL_PERIOD, integrator=integrator) for pair, at in tried]
    found = runs.scores(scenarios)
    return [s["ultimate_bound"] <= within * scale(c) for s, c in zip(found, scenarios, strict=True)]


def critical(runs: Runs, plant: str) -> float:
    """Linear theory's critical delay of the paper's law as it runs, s; NaN for a mutant: there is no theory of it."""
    law = runs.law(plant, OURS)
    if law.function is not find_law(OURS).function or min(law.gains["lam"], law.gains["k1"]) <= 0.0:
        return math.nan
    return linear_theory.critical_delay(find_plant(plant), law.gains["lam"], law.gains["k1"], CONTROL_PERIOD)
