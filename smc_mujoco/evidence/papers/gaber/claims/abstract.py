"""What the abstract claims: observer-free, without chattering, bounded, robust, scalable."""

import math

import numpy as np

from smc_mujoco.control.estimator import estimator
from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.audit.verdict import Beside, Check, ratio
from smc_mujoco.evidence.papers.gaber.claims.common import OURS, comes_to_rest
from smc_mujoco.mechanisms.plant import plant as find_plant

FILTERS = {f"filter of {ms} ms": estimator("filtered_difference", tau=ms * 1e-3) for ms in (5, 20)}
QUICK_IDEAL = 3  # conditions
QUICK_DISTURBED = ("noise", "sine", "heavy")
QUICK_LARGEST = 50  # pendulums
SHORT = 3.0  # s, of a network's run: several times what the networks of the study take to settle


def observer_free(runs: Runs) -> list[Check]:
    """Claim 1: observer-free."""
    scores = runs.scores(
        runs.scenario(plant, OURS, *runs.conditions, velocity=velocity)
        for plant in runs.plants
        for velocity in ("measured", *FILTERS.values())
    )
    times = np.reshape([each["settling_time"] for each in scores], (len(runs.plants), -1))
    return [  # NaN if neither settles: noise may keep both out of the band
        runs.check(
            "settling time",
            f"{plant}, {name}: |settling time / with true xdot - 1|",
            abs(ratio(time, true) - 1.0),
            sentence=name,
        )
        for plant, (true, *filtered) in zip(runs.plants, times.tolist(), strict=True)
        for name, time in zip(FILTERS, filtered, strict=True)
    ]


def reduces_chattering(runs: Runs) -> list[Check]:
    """Claim 3: reduces chattering."""
    rates = {plant: [runs.score(plant, law)["tv_rate"] for law in (OURS, "classical")] for plant in runs.plants}
    return [runs.check("TV rate", f"{plant}: TV rate / classical's", ratio(*rates[plant])) for plant in runs.plants]


def bounded(runs: Runs) -> list[Check | Beside]:
    """Claim 4: bounded control."""
    names = runs.conditions[:QUICK_IDEAL] if runs.quick else runs.conditions
    grid = [runs.scenario(plant, OURS, name) for plant in runs.plants for name in names]
    grid += [runs.scenario(plant, OURS, u_max=math.inf) for plant in runs.plants]
    scores = runs.scores(grid)
    largest = max(ratio(each["max_u"], run.law.gains["lam"]) for run, each in zip(grid, scores, strict=True))
    every = [ratio(run.scores["max_u"], run.gains["lam"]) for run in runs.results() if run.law == OURS]
    return [
        runs.check("max |u|", "max |u| / lambda, five plants in the ideal conditions, and without a bound", largest),
        runs.check("max |u|", "max |u| / lambda, every run of this law", max(every, default=largest)),
        Beside("runs of this law", float(len(every))),
    ]


def robust(runs: Runs) -> list[Check]:
    """Claim 5: robust to noise, disturbance, parameter variation."""
    names = QUICK_DISTURBED if runs.quick else runs.conditions
    return comes_to_rest(
        runs, {f"{plant}, {name}": runs.scenario(plant, OURS, name) for plant in runs.plants for name in names}
    )


def scalable(runs: Runs) -> list[Check]:
    """Claim 7: scalable."""
    sizes, checks = [n for n in runs.values["sizes"] if n <= QUICK_LARGEST or not runs.quick], []
    for plant in runs.plants:
        networks = [find_plant(plant, n=n) for n in sizes]
        grid = [runs.scenario(plant, OURS, plant=one, duration=SHORT, integrator="implicitfast") for one in networks]
        least, *times = (scores["settling_time"] for scores in runs.scores(grid))
        checks += [
            runs.check("settling time", f"{plant}, N = {n}: settling time / that of N = 2", ratio(time, least))
            for n, time in zip(sizes[1:], times, strict=True)
        ]
    return checks
