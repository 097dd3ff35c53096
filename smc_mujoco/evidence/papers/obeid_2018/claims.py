"""How the claims of Obeid et al. 2018 are measured."""

import numpy as np

import smc_mujoco as smc
from smc_mujoco.evidence.papers.measures import settled

MAX_STEP_RATIO = 1.9  # h (k_max + D) / eps: at 2 a step from one end of the set reaches the other
QUICK_PERIOD, FORCE = 5e-4, 13.0  # s, of a quick audit; N, the largest d with what a spring adds


def margins(gains):
    """What the sampling leaves of the largest disturbance, N: 2 sqrt(eps/h) - 1 - D."""
    return {"D < 2 sqrt(eps/h) - 1, N": 2.0 * (gains["eps"] / QUICK_PERIOD) ** 0.5 - 1.0 - FORCE}


def sampled(runs):
    """Return the fields of a quick audit's runs, which are sampled more coarsely if the claim says how."""
    return {"control_period": runs.values["quick_period"]} if runs.quick and "quick_period" in runs.values else {}


def half(signal):
    """Return the largest magnitude of a signal in the last half of its run; NaN if the run failed."""
    return float(np.abs(signal[len(signal) // 2 : -1]).max())


def stays(runs):
    """Largest |s| of the last half of 8 s over eps, under d = D sin 2t with D = 0.5, 2 and 10 N."""
    shares = {
        f"{plant}, {condition}": half(trace.s) / trace.scenario.law.gains["eps"]
        for (plant, _, condition), trace in runs.traced(runs.grid(**sampled(runs))).items()
    }
    return {"largest |s| of the last half / eps": shares}


def limit(runs):
    """Largest |s| of the last half over eps, under d = D sin 2t with D below and above 2 sqrt(eps/h) - 1."""
    (plant,), (law,), periods = runs.plants, runs.laws, runs.values["periods"]
    eps, sides = runs.law(plant, law).gains["eps"], dict(zip(("below", "above"), runs.values["shares"], strict=True))
    measured = {}
    for side, share in sides.items():
        grid = {}
        for h in periods:
            size = share * (2.0 * (eps / h) ** 0.5 - 1.0)
            adapted, d = runs.law(plant, law, k_max=MAX_STEP_RATIO * eps / h - size), smc.Sine(size, 2.0)
            name = f"{1e3 * h:g} ms, D = {size:.3g} N"
            grid[name] = runs.scenario(plant, law, law=adapted, control_period=h, disturbance=d)
        shares = {name: half(trace.s) / eps for name, trace in runs.traced(grid).items()}
        measured[f"{side}: largest |s| of the last half / eps"] = shares
    return measured


def predefined(runs):
    """Largest |s| of the last half of 8 s over eps = 0.3, 0.1 and 0.03, under d = 2 sin 2t."""
    (plant,), (law,), (condition,), widths = runs.plants, runs.laws, runs.conditions, runs.values["widths"]
    grid = {
        eps: runs.scenario(plant, law, condition, law=runs.law(plant, law, eps=eps), **sampled(runs)) for eps in widths
    }
    shares = {f"eps = {eps:g}": half(trace.s) / eps for eps, trace in runs.traced(grid).items()}
    return {"largest |s| of the last half / eps": shares}


def converges(runs):
    """Time from which |s| < eps in 8 s, from s0 = 0.5, 5 and 50 m/s, under d = 2 sin 2t."""
    (plant,), (law,), (condition,), starts = runs.plants, runs.laws, runs.conditions, runs.values["starts"]
    grid = {start: runs.scenario(plant, law, condition, v0=start, **sampled(runs)) for start in starts}
    times = {
        f"from {start:g} m/s": settled(trace, trace.s, trace.scenario.law.gains["eps"])
        for start, trace in runs.traced(grid).items()
    }
    return {"time from which |s| < eps, s": times}


def not_overestimated(runs):
    """Largest |u|, which is the gain K as u = -K sgn s, of the last half of 8 s, over the largest |d|."""
    traces = runs.traced(runs.grid(**sampled(runs)))
    ratios = {condition: half(trace.u) / half(trace.d) for (_, _, condition), trace in traces.items()}
    return {"largest gain of the last half / largest |d|": ratios}


def falls(runs):
    """|u|, which is the gain K, at 4 s, in a pulse of 5 N from 1 to 5 s, and its largest value after 6 s."""
    (trace,) = runs.traces(runs.grid(**sampled(runs)).values())
    inside, after = np.searchsorted(trace.t, (4.0, 6.0))
    gain, force = float(abs(trace.u[inside, 0])), float(abs(trace.d[inside, 0]))
    rest = float(np.abs(trace.u[after:-1]).max())
    return {"gain a second after the pulse / gain in it": rest / gain if gain else np.nan} | {
        "gain in the pulse / |d|": gain / force
    }


def within(runs):
    """Largest |s| of the last half of 8 s over eps D / (1 + D), under d = D sin 2t with D = 0.5, 2 and 10 N."""
    ratios = {}
    for (_, _, condition), trace in runs.traced(runs.grid(**sampled(runs))).items():
        bound = half(trace.d)
        ratios[condition] = half(trace.s) / (trace.scenario.law.gains["eps"] * bound / (1.0 + bound))
    return {"largest |s| of the last half / (eps D / (1 + D))": ratios}
