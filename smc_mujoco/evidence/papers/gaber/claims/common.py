"""What several claims of the paper share: names of its laws, and checks that more than one of them makes."""

import math
from collections.abc import Mapping

import numpy as np

from smc_mujoco.analysis.differences import RELEVANT
from smc_mujoco.control.variants import with_gains
from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.audit.verdict import Check, ratio
from smc_mujoco.evidence.papers.gaber.scenarios import LAWS
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

OURS = LAWS[0]  # the paper's law
RIVALS = LAWS[1:]  # classical, adaptive, and the paper's HOSMC
HOSMC = LAWS[3]
UNCLAMPED = "super_twisting_unclamped"  # as published; in the first gains its integral is clamped
CONDITIONED = "conditioned_super_twisting"  # not the paper's: without the wind-up of the plain one
OF_SCALE = 0.005  # share of a scale; chosen
LONG, PERIOD = 40.0, 5e-3  # s; s, of control and physics: runs near rest, where the smooth law asks no more


def scale(scenario: Scenario) -> float:
    """Return the largest |x0|, of which percentages are; the scale of a run that is to come to rest at 0."""
    return max(map(abs, scenario.resolved.x0)) or 1.0


def long_run(runs: Runs, plant: str, lam: float, position: float, rate: float = 0.0) -> Scenario:
    """Return a run of 40 s with another lambda, from position times x0 with every channel at rate times |x0| per s."""
    x0 = find_plant(plant).x0
    return runs.scenario(
        plant,
        OURS,
        law=with_gains(runs.law(plant, OURS), lam=lam),
        x0=[position * x for x in x0],
        v0=rate * max(map(abs, x0)),
        duration=LONG,
        control_period=PERIOD,
        physics_step=PERIOD,
    )


def command_bound(runs: Runs, plant: str) -> float:
    """Return min(lambda, u_max), the bound on the u of the paper's law, N or N m; of a mutant with its |lambda|."""
    return min(abs(runs.law(plant, OURS).gains["lam"]), runs.scenario(plant, OURS).resolved.u_max)


def comes_to_rest(runs: Runs, grid: Mapping[str, Scenario]) -> list[Check]:
    """Check the ultimate bound of every named scenario, over |x0|."""
    return [
        runs.check("ultimate bound", f"{name}: ultimate bound / |x0|", scores["ultimate_bound"] / scale(scenario))
        for (name, scenario), scores in zip(grid.items(), runs.scores(grid.values()), strict=True)
    ]


def larger_than(value: float, of: float = 0.0) -> float:
    """Return the least value that is relevantly larger: by 3 % of the larger one, and by 0.5 % of a scale."""
    return max(value / (1.0 - RELEVANT), value + OF_SCALE * of)


def overshoot(runs: Runs, plant: str, law: str) -> float:
    """Return the overshoot of the nominal run, %; inf if it does not settle."""
    scores = runs.score(plant, law)
    return scores["overshoot"] if math.isfinite(scores["settling_time"]) else math.inf


def slower(runs: Runs, plant: str, law: str) -> Check:
    """Check that a law settles later than the paper's by a relevant difference; if neither settles, none does."""
    times = [runs.score(plant, name)["settling_time"] for name in (law, OURS)]
    what = f"{plant}: settling time of {law}, over that of {OURS}"
    return runs.check("settling time", what, ratio(*times), larger_than(1.0))


def alike(runs: Runs, plant: str, law: str, other: str) -> Check:
    """Check how far a law's settling time is from the other's, as a share of that."""
    times = [runs.score(plant, name)["settling_time"] for name in (law, other)]
    what = f"{plant}: settling time of {law} apart from {other}'s, share of that"
    return runs.check("settling time, apart", what, abs(ratio(*times) - 1.0))


def deviation(trace: Trace, other: Trace) -> float:
    """Return the largest |x - x'| of two traces over all channels, as a share of |x0|; inf if one failed."""
    apart = float(np.abs(trace.x - other.x).max())
    return math.inf if math.isnan(apart) else apart / scale(other.scenario)
