"""How the claims of Levant 2003 are measured."""

import numpy as np

import smc_mujoco as smc
from smc_mujoco.evidence.papers.measures import END_SAMPLES, exponent, late, settled

END_SHARE = 0.1  # share of a run that counts as its end


def precision(runs):
    """Exponent of the largest |e| of the last 3000 samples as a function of the control period,
    0.25 to 2 ms.
    """
    values = runs.values
    scenarios = []
    for h in values["periods"]:
        duration = values["settled"] + END_SAMPLES * h
        fields = {"control_period": h, "physics_step": h, "duration": duration}
        for x0 in runs.few(values["starts"]):
            scenarios.append(runs.only(x0=x0, **fields))
    errors = []
    for trace in runs.traces(scenarios):
        errors.append(late(trace.x))
    return {"exponent of the largest |e| in the period": exponent(values["periods"], errors)}


def noise(runs):
    """Exponents of the largest errors of the last 3000 samples as functions of the noise's standard
    deviation eps.

    The control period is in proportion to eps^(1/3), eps = (period / 30 ms)^3, so that the noise is
    the same for every eps, relative to the speed of the loop. At one fixed period, white noise
    averages out where the loop is slow.
    """
    values = runs.values
    scenarios = []
    eps = [(h / values["pace"]) ** 3 for h in values["periods"]]
    for h, size in zip(values["periods"], eps, strict=True):
        sampled = {
            "control_period": h,
            "physics_step": h,
            "duration": values["settled"] + END_SAMPLES * h,
        }
        for seed in runs.few(values["seeds"]):
            scenarios.append(
                runs.only(x0=0.02, noise=smc.Noise(position=size), seed=seed, **sampled)
            )
    traces = runs.traces(scenarios)
    return {
        "exponent of |e| in the noise": exponent(eps, [late(trace.x) for trace in traces]),
        "exponent of |e'| in the noise": exponent(eps, [late(trace.v) for trace in traces]),
        "exponent of |e''| in the noise": exponent(
            eps, [late(trace.force + trace.d) for trace in traces]
        ),
    }


def finite_time(runs):
    """Time from which |x| stays within 1e-6 of its start, over that for 1e-3, at 0.25 ms."""
    (trace,) = runs.traces(runs.grid(physics_step=2.5e-4).values())
    start = max(map(abs, trace.scenario.resolved.x0))
    wide, narrow = (settled(trace, trace.x, band * start) for band in runs.values["bands"])
    return {"time to 1e-6 |x0| / time to 1e-3 |x0|": narrow / wide}


def end(trace):
    """Return the largest |x| at the end of a run; inf if it failed."""
    value = float(np.abs(trace.x[-int(END_SHARE * len(trace.x)) :]).max())
    return value if np.isfinite(value) else float("inf")


def output_feedback(runs):
    """Largest |x| of the last tenth of 12 s, over |x0|, on three plants unknown to the law."""
    traces = runs.traced(runs.grid())
    shares = {}
    for (plant, *_), trace in traces.items():
        shares[plant] = end(trace) / max(map(abs, trace.scenario.resolved.x0))
    return {"largest |x| of the last tenth / |x0|": shares}


def standard_chatters(runs):
    """Largest step of u of the last tenth of 12 s over 2 k, and half the range of the force behind
    the lag over k.
    """
    steps = {}
    forces = {}
    for (plant, *_), trace in runs.traced(runs.grid()).items():
        last = slice(-int(END_SHARE * len(trace.t)), -1)
        k = trace.scenario.law.gains["k"]
        steps[plant] = float(np.abs(np.diff(trace.u[last], axis=0)).max()) / (2.0 * k)
        forces[plant] = float(np.ptp(trace.force[last])) / (2.0 * k)
    return {"largest step of u / 2 k": steps, "amplitude of the force / k": forces}


def chattering(runs):
    """Largest |x| of the last tenth under the nested law over that under the classical law, behind
    the same lag.
    """
    ends = {}
    for cell, trace in runs.traced(runs.grid()).items():
        ends[cell[:2]] = end(trace)
    nested, classical = runs.laws
    shares = runs.by_plant(lambda plant: ends[plant, nested] / ends[plant, classical])
    return {"largest |x|, nested / classical": shares}
