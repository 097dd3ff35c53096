"""How the claims of Obeid et al. 2018 are measured."""

import numpy as np

import smc_mujoco as smc
from smc_mujoco.evidence.papers.measures import largest, settled

MAX_STEP_RATIO = 1.9  # h (k_max + D) / eps: at 2 a step from one end of the set reaches the other
QUICK_PERIOD, FORCE = 5e-4, 13.0  # s, of a quick audit; N, the largest d with what a spring adds


def margins(gains):
    """How far the largest disturbance D is below what the sampling allows, N: 2 sqrt(eps/h) - 1 -
    D.
    """
    return {"D < 2 sqrt(eps/h) - 1, N": 2.0 * (gains["eps"] / QUICK_PERIOD) ** 0.5 - 1.0 - FORCE}


def sampled(runs):
    """Return the fields of a quick audit's runs, which are sampled more coarsely if the claim says
    how.
    """
    if runs.quick and "quick_period" in runs.values:
        return {"control_period": runs.values["quick_period"]}
    return {}


def by_condition(runs, measure):
    """Return condition -> what is measured on its run."""
    measured = runs.measured(runs.grid(**sampled(runs)), measure)
    return {condition: value for (_, _, condition), value in measured.items()}


def stays(runs):
    """Largest |s| of the last half of 8 s over eps, under d = D sin 2t with D = 0.5, 2 and 10 N."""
    shares = {}
    for (plant, _, condition), trace in runs.traced(runs.grid(**sampled(runs))).items():
        shares[f"{plant}, {condition}"] = largest(trace.s) / trace.scenario.law.gains["eps"]
    return {"largest |s| of the last half / eps": shares}


def limit(runs):
    """Largest |s| of the last half over eps, under d = D sin 2t with D below and above 2
    sqrt(eps/h) - 1.
    """
    (plant,), (law,), measured = runs.plants, runs.laws, {}
    eps = runs.law(plant, law).gains["eps"]
    for side, share in zip(("below", "above"), runs.values["shares"], strict=True):
        grid = {}
        for h in runs.values["periods"]:
            size = share * (2.0 * (eps / h) ** 0.5 - 1.0)
            adapted = runs.law(plant, law, k_max=MAX_STEP_RATIO * eps / h - size)
            d = smc.Sine(size, 2.0)
            name = f"{1e3 * h:g} ms, D = {size:.3g} N"
            grid[name] = runs.scenario(plant, law, law=adapted, control_period=h, disturbance=d)
        measured[f"{side}: largest |s| of the last half / eps"] = runs.measured(
            grid, lambda trace: largest(trace.s) / eps
        )
    return measured


def predefined(runs):
    """Largest |s| of the last half of 8 s over eps = 0.3, 0.1 and 0.03, under d = 2 sin 2t."""
    laws = {}
    for eps in runs.values["widths"]:
        laws[f"eps = {eps:g}"] = runs.law(runs.plant, *runs.laws, eps=eps)
    grid = {}
    for name, law in laws.items():
        grid[name] = runs.only(law=law, **sampled(runs))
    shares = runs.measured(grid, lambda trace: largest(trace.s) / trace.scenario.law.gains["eps"])
    return {"largest |s| of the last half / eps": shares}


def converges(runs):
    """Time from which |s| < eps in 8 s, from s0 = 0.5, 5 and 50 m/s, under d = 2 sin 2t."""
    grid = {}
    for start in runs.values["starts"]:
        grid[f"from {start:g} m/s"] = runs.only(v0=start, **sampled(runs))
    times = runs.measured(
        grid, lambda trace: settled(trace, trace.s, trace.scenario.law.gains["eps"])
    )
    return {"time from which |s| < eps, s": times}


def not_overestimated(runs):
    """Largest |u|, which is the gain K as u = -K sgn s, of the last half of 8 s, over the largest
    |d|.
    """
    ratios = by_condition(runs, lambda trace: largest(trace.u) / largest(trace.d))
    return {"largest gain of the last half / largest |d|": ratios}


def falls(runs):
    """|u|, which is the gain K, at 4 s, in a pulse of 5 N from 1 to 5 s, and its largest value
    after 6 s.
    """
    (trace,) = runs.traces(runs.grid(**sampled(runs)).values())
    inside, after = np.searchsorted(trace.t, (4.0, 6.0))
    gain = float(abs(trace.u[inside, 0]))
    force = float(abs(trace.d[inside, 0]))
    rest = float(np.abs(trace.u[after:-1]).max())
    return {"gain a second after the pulse / gain in it": rest / gain if gain else np.nan} | {
        "gain in the pulse / |d|": gain / force
    }


def within(runs):
    """Largest |s| of the last half of 8 s over eps D / (1 + D), under d = D sin 2t with D = 0.5, 2
    and 10 N.
    """

    def share(trace):
        bound = largest(trace.d)
        return largest(trace.s) / (trace.scenario.law.gains["eps"] * bound / (1.0 + bound))

    return {"largest |s| of the last half / (eps D / (1 + D))": by_condition(runs, share)}
