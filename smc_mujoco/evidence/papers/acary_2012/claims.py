"""How the claims of Acary, Brogliato & Orlov 2012 are measured, on the last half of 10 s."""

import numpy as np

from smc_mujoco.control.law import law_function, sgn
from smc_mujoco.evidence.papers.measures import settled

GAINS = {"a": 1.0, "alpha": 2.0, "start": 0.5}


@law_function(gains=GAINS, positive=("a", "alpha"), memory=1)
def implicit_observer(y, gains, memory):
    """Two signs at the end of the period: u = -a S1 - alpha S2 of s and s - z, where z' = -a S1 starts at `start`."""
    a, alpha = gains.a * y.dt, gains.alpha * y.dt
    second = min(max((y.de - gains.start - memory[0]) / alpha, -1.0), 1.0)
    first = min(max((y.de - alpha * second) / a, -1.0), 1.0)
    memory[0] -= a * first
    return -gains.a * first - gains.alpha * second, y.de


@law_function(gains=GAINS, positive=("a", "alpha"), memory=1)
def explicit_observer(y, gains, memory):
    """The same with both signs at the start of the period."""
    first, second = sgn(y.de), sgn(y.de - gains.start - memory[0])
    memory[0] -= y.dt * gains.a * first
    return -gains.a * first - gains.alpha * second, y.de


def half(signal):
    """Return the last half of a signal."""
    return signal[len(signal) // 2 : -1]


def largest(signal):
    """Return the largest magnitude in the last half."""
    return float(np.abs(half(signal)).max())


def variation_of(signal):
    """Return the total variation in the last half."""
    return float(np.abs(np.diff(half(signal), axis=0)).sum())


def each(runs, measure):
    """Return condition -> measure of its trace."""
    grid = runs.grid()
    return {cell[2]: measure(trace) for cell, trace in zip(grid, runs.traces(grid.values()), strict=True)}


def variation(runs):
    """Total variation of u over that of d."""
    return {"variation of u / variation of d": each(runs, lambda one: variation_of(one.u) / variation_of(one.d))}


def rejection(runs):
    """Largest |s| over what the disturbance adds to s in a control period."""
    share = each(runs, lambda one: largest(one.v) / (one.scenario.control_period * largest(one.d)))
    return {"largest |s| / (h largest |d|)": share}


def multiplier(runs):
    """Largest |u + d| over what d changes in a control period, h D omega."""

    def late(trace):
        (d,) = trace.scenario.disturbance
        return largest(trace.u + trace.d) / (trace.scenario.control_period * d.amplitude * d.omega)

    return {"largest |u + d| / (h largest |d'|)": each(runs, late)}


def reaching(runs):
    """Time from which |s| stays within twice what the disturbance adds to it in a control period."""
    time = each(runs, lambda one: settled(one, one.v, 2.0 * one.scenario.control_period * largest(one.d)))
    return {"time to |s| <= 2 h largest |d|, s": time}


def explicit(runs):
    """Total variation of u, and the largest |s|, implicit over explicit."""
    grid = runs.grid()
    traces = {
        (law, condition): trace for (_, law, condition), trace in zip(grid, runs.traces(grid.values()), strict=True)
    }
    pairs = {one: [traces[law, one] for law in runs.laws] for one in runs.conditions}
    return {
        "variation of u, implicit / explicit": {
            k: variation_of(a.u) / variation_of(b.u) for k, (a, b) in pairs.items()
        },
        "largest |s|, implicit / explicit": {k: largest(a.v) / largest(b.v) for k, (a, b) in pairs.items()},
    }
