"""What claims about simulations share: scores of several laws on several plants, and how two of them compare.

got = scores(runs, PLANTS, LAWS)                       # (plant, law) -> metric -> value; one batch
got["duffing", "classical"]["settling_time"]
deviation(trace, nominal)                              # largest |x - x'|, as a share of |x0|
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from smc_mujoco.analysis.differences import OF_SCALE, OF_VALUE
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.paper.claims.evidence import Check, Runs, Scores, check, ratio, scale
from smc_mujoco.studies.paper.scenarios import LAWS, PLANTS

OURS = LAWS[0]  # the paper's law
RIVALS = LAWS[1:]  # classical, adaptive, and the paper's HOSMC
HOSMC = LAWS[3]
UNCLAMPED = "super_twisting_unclamped"  # as published; in the first gains its integral is clamped
NETWORKS = tuple(plant for plant in PLANTS if plant.endswith("network"))  # the paper does not say which way up

Table = dict[tuple[str, str], Scores]


def scores(runs: Runs, plants: Sequence[str], laws: Sequence[str], condition: str = "nominal") -> Table:
    """(plant, law) -> scores, in one batch."""
    pairs = [(plant, law) for plant in plants for law in laws]
    found = runs.scores([runs.scenario(plant, law, condition) for plant, law in pairs])
    return dict(zip(pairs, found, strict=True))


def bound(runs: Runs, plant: str) -> float:
    """lambda, the bound on u of the paper's law, N or N m; of a mutant its magnitude."""
    return abs(runs.law(plant, OURS).gains["lam"])


def given(runs: Runs, plant: str) -> float:
    """min(lambda, u_max), the bound on u that is really there, N or N m."""
    return min(bound(runs, plant), runs.scenario(plant, OURS).u_max)


def larger_than(value: float, of: float = 0.0) -> float:
    """What is larger than a value by the least relevant difference: 3 % of the larger one, and 0.5 % of a scale."""
    return max(value / (1.0 - OF_VALUE), value + OF_SCALE * of)


def overshoot(got: Scores) -> float:
    """Overshoot of a run that settles, %; inf of one that does not: it went beyond, or never came."""
    return got["overshoot"] if math.isfinite(got["settling_time"]) else math.inf


def slower(plant: str, law: str, got: Mapping[tuple[str, str], Scores]) -> Check:
    """Whether a law settles later than the paper's by a relevant difference; where neither settles, none is slower."""
    times = [got[plant, name]["settling_time"] for name in (law, OURS)]
    return check(f"{plant}: settling time of {law}, over that of {OURS}", ratio(*times), ">", larger_than(1.0))


def alike(plant: str, law: str, other: str, got: Mapping[tuple[str, str], Scores], within: float) -> Check:
    """Whether two laws settle within a share of the other's time."""
    apart = abs(ratio(got[plant, law]["settling_time"], got[plant, other]["settling_time"]) - 1.0)
    return check(f"{plant}: settling time of {law} apart from {other}'s, share of that", apart, "<=", within)


def deviation(trace: Trace, other: Trace) -> float:
    """Largest |x - x'| of two traces over all channels, as a share of |x0|; inf where one of them failed."""
    apart = float(np.abs(trace.x - other.x).max())
    return math.inf if math.isnan(apart) else apart / scale(other.scenario)
