"""How the claims of Huber, Acary, Brogliato & Plestan 2014 are measured."""

import numpy as np

from smc_mujoco.control.law import command, law_function
from smc_mujoco.evidence.papers.measures import two_signs


@law_function(gains={"G": 10.0, "beta": 0.3}, positive=("G", "beta"), memory=1, relative_degree=2)
def implicit_twisting(y, gains, memory):
    """Twisting with both signs at the end of the period: v = -a S1 - b S2, a = G (1 + beta dt/2), b
    = G beta.

    S1 is in sgn(e+ + dt/2 e'+) and S2 in sgn(e'+), with e'+ = e' + dt v and e+ = e + dt (e' +
    e'+)/2, v the acceleration of the error.
    """
    a = gains.G * (1.0 + gains.beta * y.dt / 2.0)
    b = gains.G * gains.beta
    return command(y, two_signs(-(y.e + 1.5 * y.dt * y.de) / y.dt**2, a, -y.de / y.dt, b)), y.e


def quarter(signal):
    """Return the last quarter of a signal."""
    return signal[-(len(signal) // 4) : -1]


def rests(runs):
    """Largest |x| and |u| of the last quarter of 12 s at control periods of 5 to 100 ms, without a
    disturbance.
    """
    ends = {"x": {}, "u": {}}
    for h in runs.values["periods"]:
        (trace,) = runs.traces([runs.only(control_period=h)])
        for signal, by_period in ends.items():
            by_period[f"{1e3 * h:g} ms"] = np.abs(quarter(getattr(trace, signal))).max()
    return {
        "largest |x| of the last quarter, m": ends["x"],
        "largest |u| of the last quarter, N": ends["u"],
    }


def ratios(runs, scenarios, names):
    """Return measure -> {name: implicit over explicit} for pairs of scenarios."""
    measures = {
        "largest |e|": lambda trace: np.abs(quarter(trace.x - trace.r)).max(),
        "variation of u": lambda trace: np.abs(np.diff(quarter(trace.u), axis=0)).sum(),
        "mean square of e": lambda trace: np.mean(quarter(trace.x - trace.r) ** 2),
    }
    traces = runs.traces(scenarios)
    shares = {}
    for what, measure in measures.items():
        pairs = zip(map(measure, traces[::2]), map(measure, traces[1::2]), strict=True)
        by_name = {}
        for name, (implicit, explicit) in zip(names, pairs, strict=True):
            by_name[name] = float(implicit / explicit)
        shares[f"{what} of the last quarter, implicit / explicit"] = by_name
    return shares


def compared(runs):
    """Error e and command u of the last quarter of 12 s at 10 ms, implicit over explicit, equal
    gains and model.
    """
    return ratios(runs, runs.grid().values(), runs.plants)


def at_every_period(runs):
    """Error e and command u of the last quarter of 12 s at 1 to 50 ms, implicit over explicit."""
    periods = runs.values["periods"]
    scenarios = []
    for h in periods:
        for scenario in runs.grid(control_period=h).values():
            scenarios.append(scenario)
    return ratios(runs, scenarios, [f"{1e3 * h:g} ms" for h in periods])
