"""How the claims of Seeber & Andritsch 2024 are measured."""

import itertools
import math

import numpy as np

import smc_mujoco as smc
from smc_mujoco.evidence.papers.measures import largest

L = 1.0  # N/s, bound on the slope of d
MAX_DISTURBANCE = 1.0  # N, of |d|
TRIANGLE_PERIODS = 40  # periods of the triangle before its slope flips


def margins(gains):
    """The two conditions of theorem 3.4, with |d'| <= 1."""
    return {
        "k2 > L, N/s": gains["k2"] - L,
        "k1 > sqrt(k2 + L)": gains["k1"] - math.sqrt(gains["k2"] + L),
    }


def slopes(period, duration, seed):
    """Return d with a slope of L or -L over each period, drawn by a seed, and |d| <= 1."""
    count = round(duration / period)
    values = [0.0]
    steps = np.random.default_rng(seed).choice((-1.0, 1.0), count) * L * period
    for step in steps:
        values.append(values[-1] + (step if abs(values[-1] + step) <= MAX_DISTURBANCE else -step))
    return smc.signals.TimeSeries((np.arange(count + 1) * period).tolist(), values)


def flip(period, sign):
    """Return a triangle of slopes L and -L with mean 0 over a period, that keeps one slope after
    TRIANGLE_PERIODS.
    """
    corners = (
        sign * 0.5 * L * period * (-1.0) ** np.arange(TRIANGLE_PERIODS + 1)
    )  # the last one is sign L T / 2
    last = corners[-1] + sign * L * period
    return smc.signals.TimeSeries(
        (np.arange(TRIANGLE_PERIODS + 2) * period).tolist(), [*corners.tolist(), last]
    )


def late(trace):
    """Return the largest |x| of the last half over L T^2; NaN if the run failed."""
    return largest(trace.v) / (L * trace.scenario.control_period**2)


def random_runs(runs, law):
    """Return name -> largest |x| under random slopes, for each period and seed."""
    seeds, periods = (runs.few(runs.values[name]) for name in ("seeds", "periods"))
    grid = {}
    fields = {"duration": 5.0, "v0": 0.1}
    for period, seed in itertools.product(periods, seeds):
        drawn = {"control_period": period, "disturbance": slopes(period, 5.0, seed)}
        name = f"{1e3 * period:g} ms, seed {seed}"
        grid[name] = runs.scenario(runs.plant, law, runs.conditions[0], **fields, **drawn)
    return runs.measured(grid, late)


def bounded(runs):
    """Largest |x| of the last half of 5 s over L T^2, under slopes of L and -L drawn for each
    period.
    """
    return {"largest |x| of the last half / (L T^2)": random_runs(runs, runs.laws[0])}


def flipped(runs, law, condition, sign):
    """Return the scenario of a law under a triangle whose slope goes on, from rest."""
    period = runs.scenario(runs.plant, law, condition).control_period
    fields = {"duration": (TRIANGLE_PERIODS + 1) * period, "disturbance": flip(period, sign)}
    return runs.scenario(runs.plant, law, condition, v0=0.0, **fields)


def last(trace):
    """Return |x| after the last period over L T^2."""
    return float(abs(trace.v[-1, 0])) / (L * trace.scenario.control_period**2)


def attained(runs):
    """|x| over L T^2 a period after a triangle of mean 0 over a period goes on with its slope."""
    cells = itertools.product(runs.laws, runs.conditions)
    grid = {}
    for law, condition in cells:
        grid[f"{law}, {condition}"] = flipped(runs, law, condition, 1.0)
    return {"largest |x| after the slope flips / (L T^2)": runs.measured(grid, last)}


def best_possible(runs):
    """The larger |x| over L T^2 of two runs under disturbances that a sampled law cannot tell
    apart, for seven laws.
    """
    (condition,) = runs.conditions
    cells = []
    for law in runs.laws:
        for sign in (1.0, -1.0):
            cells.append((law, sign))
    ends = []
    for trace in runs.traces(flipped(runs, law, condition, sign) for law, sign in cells):
        ends.append(last(trace))
    worse = np.reshape(ends, (-1, 2)).max(axis=1)
    return {"worse of the two |x| / (L T^2)": dict(zip(runs.laws, worse.tolist(), strict=True))}


def compared(runs):
    """Largest |x| of the last half of 5 s under random slopes, over that of the explicit and the
    older implicit law.
    """
    proper, *rivals = runs.laws
    ours = random_runs(runs, proper)
    ratios = {}
    for law in rivals:
        ratios |= {
            f"{law}, {name}": ours[name] / theirs for name, theirs in random_runs(runs, law).items()
        }
    return {"proper / other, largest |x| of the last half": ratios}


def no_windup(runs):
    """How far s goes beyond 0 from 20 m/s, over that of the law without conditioning; largest |x|
    of the last half.
    """
    d = smc.Sine(1.5, 0.6)
    ours, plain = runs.traces(
        runs.scenario(
            runs.plant, law, v0=runs.values["start"], u_max=runs.values["u_max"], disturbance=d
        )
        for law in runs.laws
    )
    beyond = []
    for trace in (ours, plain):
        beyond.append(max(-float(trace.v[:-1].min()), 0.0))
    return {
        "overshoot / that of the law without conditioning": beyond[0] / beyond[1]
        if beyond[1]
        else math.inf,
        "largest |x| of the last half / (L T^2)": late(ours),
    }
