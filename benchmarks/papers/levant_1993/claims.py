"""How the claims of Levant 1993 are measured."""

import numpy as np

from smc_mujoco.evidence.papers.measures import END_SAMPLES, exponent, late, late_step, settled

FORCE = 2.0  # N: d, and what the plants add to it within 0.6 of the origin
SLOPE = 6.0  # N/s, slope of that force


def classical_margins(gains):
    """What the switching gain exceeds, N, with s' = u + d + c v and |v| up to 0.5."""
    return {"k > D + c |v|, N": gains["k"] - FORCE - 0.5 * gains["c"]}


def twisting_margins(gains):
    """The two conditions of twisting for e'' = g (u + d), N."""
    r1 = gains["r1"]
    r2 = gains["r2"]
    return {
        "(r1 + r2) - D > (r1 - r2) + D, N": 2.0 * (r2 - FORCE),
        "r1 - r2 > D, N": r1 - r2 - FORCE,
    }


def super_twisting_margins(gains):
    """The two conditions of super-twisting for s' = g (u + d), g >= 1 and |d'| <= L."""
    return {
        "k2 > L, N/s": gains["k2"] - SLOPE,
        "k1 > sqrt(k2 + L)": gains["k1"] - (gains["k2"] + SLOPE) ** 0.5,
    }


def sweep(runs):
    """Return plant -> traces, each start at each control period, in the order of the periods."""
    starts = runs.values.get("starts", [0.5])
    values = runs.values
    plants = runs.few(runs.plants)
    scenarios = []
    for plant in plants:
        for h in values["periods"]:
            for x0 in runs.few(starts):
                scenarios.append(
                    runs.on(plant).only(
                        x0=x0, control_period=h, duration=values["settled"] + END_SAMPLES * h
                    )
                )
    traces = np.array(runs.traces(scenarios), dtype=object).reshape(len(plants), -1)
    return dict(zip(plants, traces, strict=True))


def exponents(runs, measure):
    """Return plant -> exponent of a measure as a function of the control period."""
    exponent_by_plant = {}
    for plant, traces in sweep(runs).items():
        exponent_by_plant[plant] = exponent(runs.values["periods"], map(measure, traces))
    return exponent_by_plant


def accuracy_of_s(runs):
    """Exponent of the largest |s| of the last 3000 samples as a function of the control period, 0.5
    to 4 ms.
    """
    return {"exponent of the largest |s| in the period": exponents(runs, lambda run: late(run.s))}


def continuity(runs):
    """Exponent of the largest step of u from sample to sample, of the last 3000, as a function of
    the period.
    """
    return {
        "exponent of the largest step of u in the period": exponents(
            runs, lambda run: late_step(run.u)
        )
    }


def switching(runs):
    """Largest step of u of the last 3000 samples, as a share of 2k, at control periods of 1 and 4
    ms.
    """
    (law,), steps = runs.laws, {}
    for plant, traces in sweep(runs).items():
        k = runs.law(plant, law).gains["k"]
        for period, trace in zip(runs.values["periods"], traces, strict=True):
            steps[f"{plant}, {period:g} s"] = late_step(trace.u) / (2.0 * k)
    return {"largest step of u / 2k": steps}


def finite_time(runs):
    """Time from which |x| stays within 1e-5 of its start, over that for 1e-2, sampled at 50 us."""
    wide, narrow = runs.values["bands"]
    ratios = {}
    for (plant, *_), trace in runs.traced(runs.grid()).items():
        (start,) = map(abs, trace.scenario.resolved.x0)
        ratios[plant] = settled(trace, trace.x, narrow * start) / settled(
            trace, trace.x, wide * start
        )
    return {"time to 1e-5 |x0| / time to 1e-2 |x0|": ratios}
