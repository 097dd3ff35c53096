"""How the claims of Seeber & Reichhartinger 2020 are measured."""

import itertools
import math

import numpy as np

from smc_mujoco.evidence.papers.measures import settled

BAND = 1e-3  # m/s
SLOPE = 0.9  # N/s, of the disturbance 1.5 sin 0.6 t


def margins(gains):
    """The two conditions of the law."""
    return {
        "k2 > L, N/s": gains["k2"] - SLOPE,
        "k1 > sqrt(k2 + L)": gains["k1"] - math.sqrt(gains["k2"] + SLOPE),
    }


def winds_up(runs):
    """How far s goes beyond 0 from s0 = 5, 10 and 20 m/s with |u| <= 2 N, over min(U^2 / (2 k2), (U
    / k1)^2).

    Without a disturbance. That bound holds where the integrator stays within -U .. U. Undefined
    where s does not reach 0 at all.
    """
    starts = runs.few(runs.values["starts"], slice(1, 2))
    grid = {}
    for start in starts:
        grid[f"from {start:g} m/s"] = runs.only(v0=start)
    gains = runs.law(runs.plant, *runs.laws).gains
    bound = runs.only().u_max
    most = min(bound**2 / (2.0 * gains["k2"]), (bound / gains["k1"]) ** 2)
    beyond = runs.measured(
        grid, lambda trace: -float(trace.v.min()) / most if trace.v.min() <= 0.0 else math.nan
    )
    return {"overshoot of s / bound of a law that does not wind up": beyond}


def reaches(runs):
    """Largest |s| of the last quarter of 40 s under d = 1.5 sin 0.6 t, |u| <= 2 N, from three
    starts.
    """
    cells = runs.few(list(itertools.product(runs.plants, runs.values["starts"])))
    grid = {}
    for plant, start in cells:
        grid[f"{plant}, from {start:g} m/s"] = runs.on(plant).only(v0=start)
    ends = runs.measured(grid, lambda trace: float(np.abs(trace.v[-(len(trace.t) // 4) :]).max()))
    return {"largest |s| of the last quarter, m/s": ends}


def time(runs):
    """Time from which |s| stays within 1 mm/s, from 10 and 50 m/s with |u| <= 2 N and without d,
    over |s0| / U.
    """
    (plant,), starts = runs.plants, runs.few(runs.values["starts"])
    scenarios = []
    for law in runs.laws:
        for start in starts:
            scenarios.append(runs.scenario(plant, law, v0=start))
    times = np.reshape(
        [settled(trace, trace.v, BAND) for trace in runs.traces(scenarios)], (2, len(starts))
    )
    names = [f"from {start:g} m/s" for start in starts]
    shortest = np.array(starts) / scenarios[0].u_max
    return {
        "time to |s| <= 1 mm/s / |s0| / U, conditioned": dict(
            zip(names, times[0] / shortest, strict=True)
        ),
        "time, plain / conditioned": dict(zip(names, times[1] / times[0], strict=True)),
    }


def same(runs):
    """Largest difference of s between the two laws with equal gains, under d, |u| <= 50 N."""
    (condition,) = runs.conditions
    traces = runs.traced(runs.grid())

    def difference(plant):
        first, second = (traces[plant, law, condition].v for law in runs.laws)
        return float(np.abs(first - second).max())

    return {"largest difference of s, m/s": runs.by_plant(difference)}
