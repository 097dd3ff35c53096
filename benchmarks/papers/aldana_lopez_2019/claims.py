"""How the claims of Aldana-Lopez et al. 2019 are measured."""

import math

from smc_mujoco.control.law import law_function
from smc_mujoco.evidence.papers.measures import settled

BAND = 1e-6  # m/s: s = 0 counts as reached while |s| is within it
SWITCHING_BAND = 1e-3  # m/s, the same with a switching gain k, which chatters by k dt
FAR_START, MAX_SHARE_BEYOND = 5000.0, 0.02  # m/s, stands for infinity; share of the time beyond it
MIN_KP = 0.3  # least k p: below it a sample of 10 us takes s across the band
RUN_BOUNDS = 1.5  # duration of a run over the least bound


@law_function(
    gains={"A": 2.0, "B": 2.0, "p": 0.5, "q": 1.5, "k": 1.0},
    positive=("A", "B", "p", "q", "k"),
    relative_degree=1,
)
def general_fixed_time(y, gains, memory):
    """The general system: u = -(A |s|^p + B |s|^q)^k sgn s, s the velocity."""
    size = abs(y.de)
    pull = (gains.A * size**gains.p + gains.B * size**gains.q) ** gains.k
    return (-pull if y.de > 0.0 else pull if y.de < 0.0 else 0.0), y.de


def gamma(gains):
    """Return the least bound of the general system, s."""
    A, B, p, q, k = (gains[name] for name in "ABpqk")
    m = (1.0 - k * p) / (q - p)
    n = (k * q - 1.0) / (q - p)
    return math.gamma(m) * math.gamma(n) * (A / B) ** m / (A**k * math.gamma(k) * (q - p))


def general_margins(gains):
    """The conditions of the formula, and what a start at 5000 m/s and samples of 10 us ask for."""
    A, B, p, q, k = (gains[name] for name in "ABpqk")
    conditions = {"k p < 1": 1.0 - k * p, "k q > 1": k * q - 1.0}
    if min(conditions.values()) <= 0.0:
        return conditions
    beyond = FAR_START ** (1.0 - k * q) / (B**k * (k * q - 1.0)) / gamma(gains)
    steep = (A * FAR_START**p + B * FAR_START**q) ** k * 1e-5 / FAR_START
    return conditions | {
        "time beyond the start < 2 %": MAX_SHARE_BEYOND - beyond,
        "k p >= 0.3, for the band": k * p - MIN_KP,
        "first step < 1 % of the start": 0.01 - steep,
    }


def least_bound(law):
    """Return the supremum of the settling times over all starts, s."""
    k1, k2, a, b = (law.gains[name] for name in ("k1", "k2", "a", "b"))
    m = (1.0 - a) / (b - a)
    n = (b - 1.0) / (b - a)
    return math.gamma(m) * math.gamma(n) * (k1 / k2) ** m / (k1 * (b - a))


def classical_bound(law):
    """Return Polyakov's bound, s."""
    k1, k2, a, b = (law.gains[name] for name in ("k1", "k2", "a", "b"))
    return 1.0 / (k1 * (1.0 - a)) + 1.0 / (k2 * (b - 1.0))


def times(runs, cells, band=BAND):
    """Return name -> settling time of s, from name -> plant, law and start."""
    scenarios = {}
    for name, (plant, law, v0) in cells.items():
        scenarios[name] = runs.scenario(
            plant,
            law.name,
            *runs.conditions,
            law=law,
            v0=v0,
            duration=RUN_BOUNDS * least_bound(law),
        )
    return runs.measured(scenarios, lambda trace: settled(trace, trace.s, band))


def from_far(runs):
    """Time from which |s| stays within 1e-6 m/s, from 5000 m/s, over the least bound and over the
    classical one.
    """
    law = runs.law(runs.plant, *runs.laws)
    (time,) = times(runs, {"": (runs.plant, law, runs.values["start"])}).values()
    bounds = {"least": least_bound(law), "classical": classical_bound(law)}
    return {f"time from far / {name} bound": time / bound for name, bound in bounds.items()}


def from_anywhere(runs):
    """Time from which |s| stays within 1e-6 m/s, from 0.1 to 100 m/s on three plants, over the
    least bound.
    """
    cells = {}
    for plant in runs.few(runs.plants):
        law = runs.law(plant, *runs.laws)
        for start in runs.values["starts"]:
            cells[f"{plant}, from {start:g} m/s"] = (plant, law, start)
    bound = least_bound(runs.law(runs.plant, *runs.laws))
    return {"time / least bound": {name: time / bound for name, time in times(runs, cells).items()}}


def predefined(runs):
    """Time from which |s| stays within 1e-6 m/s, from 5000 m/s, over the time Tc that the gains
    were scaled for.
    """
    law = runs.law(runs.plant, *runs.laws)
    cells = {}
    for tc in runs.few(runs.values["times"]):
        gains = {}
        for gain in ("k1", "k2"):
            gains[gain] = least_bound(law) / tc * law.gains[gain]
        cells[tc] = runs.plant, runs.law(runs.plant, *runs.laws, **gains), runs.values["start"]
    shares = {f"{tc:g} s": time / tc for tc, time in times(runs, cells).items()}
    return {"time from far / time asked for": shares}


def disturbed(runs):
    """Time from which |s| stays within 1 mm/s under d = 0.5 sin 5t, with k = 0.6, over the least
    bound.
    """
    law = runs.law(runs.plant, *runs.laws, k=runs.values["k"])
    cells = {}
    for start in runs.values["starts"]:
        cells[f"from {start:g} m/s"] = (runs.plant, law, start)
    measured = times(runs, cells, SWITCHING_BAND)
    return {
        "time / least bound": {name: time / least_bound(law) for name, time in measured.items()}
    }


def general(runs):
    """Time from which |s| stays within 1e-6 m/s, from 5000 m/s, over gamma."""
    law = runs.law(runs.plant, *runs.laws)
    run = runs.scenario(
        runs.plant,
        law.name,
        law=law,
        v0=runs.values["start"],
        duration=RUN_BOUNDS * gamma(law.gains),
    )
    (trace,) = runs.traces([run])
    return {"time from far / gamma": settled(trace, trace.s, BAND) / gamma(law.gains)}
