"""Traces of made-up data, the same on all processors."""

import dataclasses
from collections.abc import Iterable

import numpy as np

import smc_mujoco as smc
from helpers.reference import PLANT_DIVERGED
from smc_mujoco.simulation.trace import ARRAYS


def number(value: float) -> str:
    """Return a number with three digits, and rounding as 0."""
    return f"{round(float(value), 9) + 0.0:.3g}"


def numbers(values: Iterable) -> str:
    """Return numbers in brackets."""
    return f"({', '.join(map(number, np.ravel(np.asarray(values, float))))})"


def made(scenario: smc.Scenario) -> smc.Trace:
    """Return a trace of a scenario that was not run: decaying waves, other ones for each array and
    channel.
    """
    t = np.arange(scenario.samples + 1) * scenario.control_period
    n = scenario.plant.n
    waves = {}
    for k, name in enumerate(ARRAYS[1:]):
        waves[name] = (
            0.7**k
            * np.exp(-2.0 * t)[:, None]
            * np.cos((4.0 + k) * t[:, None] + 0.3 + 0.7 * np.arange(n))
        )
    return smc.Trace(t=t, **waves, scenario=scenario)


def failed(trace: smc.Trace, at: int, failure: str = "") -> smc.Trace:
    """Return the trace as if it had failed at sample `at`; by default the plant diverged."""
    failure = failure or f"{PLANT_DIVERGED}, at t = {trace.t[at]:g} s"
    arrays = {}
    for name in ARRAYS[1:]:
        arrays[name] = getattr(trace, name).copy()
    for array in arrays.values():
        array[at:] = np.nan
    return dataclasses.replace(trace, **arrays, diverged_at=float(trace.t[at]), failure=failure)
