"""How the claims of paper.toml are measured: a function for each, from runs to numbers.

A function returns measure -> number, or measure -> {case: number}. Its measures that have a
threshold in paper.toml are
checked, the others stand beside. `runs` makes each run once, and has:

    runs.plants, runs.laws, runs.conditions, runs.values   # what the claim names
    runs.grid(**changes)                         # (plant, law, condition) -> scenario, of all
    runs.scenario(plant, law, condition, **changes)
    runs.scores(scenarios), runs.traces(scenarios)         # in order; a score is metric -> number
    runs.law(plant, name, **gains), runs.quick
"""

import numpy as np

END_SHARE = 0.2  # share of a run that counts as its end


def rejects(runs):
    """Return the ultimate bound of every run, as a share of the largest |x0|."""
    grid = runs.grid()
    shares = {}
    for ((plant, *_), scenario), scores in zip(
        grid.items(), runs.scores(grid.values()), strict=True
    ):
        shares[plant] = scores["ultimate_bound"] / max(map(abs, scenario.resolved.x0))
    return {"ultimate bound / |x0|": shares}


def second_order(runs):
    """Return the slope of log |s| over log of the control period, and |s| at each period."""
    periods = runs.values["periods"]
    (plant,), (law,), (condition,) = runs.plants, runs.laws, runs.conditions
    traces = runs.traces(
        runs.scenario(plant, law, condition, control_period=period) for period in periods
    )
    largest = [float(np.abs(trace.s[-int(END_SHARE * len(trace.s)) :]).max()) for trace in traces]
    exponent = np.polyfit(np.log(periods), np.log(largest), 1)[0]
    return {"exponent": exponent, "largest |s|": dict(zip(map(str, periods), largest, strict=True))}
