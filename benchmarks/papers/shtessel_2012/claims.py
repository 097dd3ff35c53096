"""How the claims of Shtessel, Taleb & Plestan 2012 are measured."""

import numpy as np
from numba import njit

from smc_mujoco.control.law import law_function
from smc_mujoco.control.laws.adaptive_super_twisting import adaptive_super_twisting
from smc_mujoco.evidence.papers.measures import exponent, settled

adapted = njit(adaptive_super_twisting.function)
BAND_IN_LAYERS = 5.0  # layers mu that count as the order of mu


@law_function(
    gains={"rate": 5.0, "eps": 0.5, "mu": 0.02, "least": 0.5, "k0": 0.5, "c": 0.0},
    positive=("rate", "eps", "mu", "least"),
    memory=2,
)
def shown(y, gains, memory):
    """The library's adaptive super-twisting, with its gain K in place of the sliding variable."""
    K = gains.k0 + memory[1]
    u, _ = adapted(y, gains, memory)
    return u, K


def third(signal):
    """Return the last third of a signal."""
    return signal[-(len(signal) // 3) : -1]


def layer(runs):
    """Largest |s| of the last third of 30 s over mu, under d = D sin t with D = 0.5, 5 and 20 N."""
    mu = runs.law(runs.plant, *runs.laws).gains["mu"]
    shares = runs.measured(runs.grid(), lambda trace: float(np.abs(third(trace.v)).max()) / mu)
    return {
        "largest |s| of the last third / mu": {cell[2]: share for cell, share in shares.items()}
    }


def established(runs):
    """Time from which |s| stays within 5 mu in 30 s, from s0 = 0.1 to 100 m/s, d = 5 sin t."""
    grid = {}
    for start in runs.values["starts"]:
        grid[f"from {start:g} m/s"] = runs.only(v0=start)
    band = BAND_IN_LAYERS * runs.law(runs.plant, *runs.laws).gains["mu"]
    return {
        "time from which |s| <= 5 mu, s": runs.measured(
            grid, lambda trace: settled(trace, trace.v, band)
        )
    }


def narrower(runs):
    """Exponent of the largest |s| of the last third of 30 s as a function of mu, 1 to 4 cm/s, under
    d = 5 sin t.
    """
    layers = runs.values["layers"]
    traces = runs.traces(runs.only(law=runs.law(runs.plant, *runs.laws, mu=mu)) for mu in layers)
    return {
        "exponent of the largest |s| in mu": exponent(
            layers, [np.abs(third(trace.v)).max() for trace in traces]
        )
    }


def not_overestimated(runs):
    """Mean gain K of the last third of 30 s without d, and under D sin t with D = 0.5 and 20 N."""

    def mean(trace):
        if np.isfinite(trace.v).all():
            return float(np.mean(third(trace.s)))
        return np.nan

    traces = runs.traces(runs.grid().values())
    nothing, small, large = map(mean, traces)
    least = traces[0].scenario.law.gains["least"]
    return {
        "mean gain of the last third without d / least": nothing / least,
        "mean gain, small / large d": small / large,
    }


def calmer(runs):
    """Total variation of u of the last third of 30 s under d = 0.5 sin t, over that of
    super-twisting with L = 20.
    """

    def variation(trace):
        return float(np.abs(np.diff(third(trace.u), axis=0)).sum())

    adaptive, fixed = runs.traces(runs.grid().values())
    mu = adaptive.scenario.law.gains["mu"]
    return {
        "variation of u, adaptive / fixed": variation(adaptive) / variation(fixed),
        "largest |s| of the last third / mu": float(np.abs(third(adaptive.v)).max()) / mu,
    }
