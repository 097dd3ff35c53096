"""How the claims of paper.toml are measured: a function for each, from runs to numbers."""

import math

from scipy.optimize import brentq


def rest(runs):
    """Return the last position as a share of the position that the force balance predicts."""
    (scenario,) = runs.grid().values()
    (trace,) = runs.traces([scenario])
    p, g, push = scenario.plant.parameters, scenario.law.gains, scenario.disturbance[0].amplitude

    def balance(x):
        return p["k"] * x + g["k"] * 2.0 / math.pi * math.atan(g["c"] * x / g["phi"]) - push

    predicted = brentq(balance, 0.0, push / p["k"])
    return {"x / predicted": trace.x[-1, 0] / predicted, "predicted, m": predicted}


def calm(runs):
    """Return the variation of u as a share of the classical law's."""
    own, relay = runs.scores(runs.grid().values())
    return {"share of variation": own["tv_rate"] / relay["tv_rate"]}
