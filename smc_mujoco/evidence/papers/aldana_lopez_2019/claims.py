"""How the claims of Aldana-Lopez et al. 2019 are measured."""

import math

from smc_mujoco.evidence.papers.measures import settled

BAND = 1e-6  # m/s, of |s|: it counts as reached
SWITCHING = 1e-3  # m/s, the band with a switching gain, which chatters in k dt
LONGER = 1.5  # least bounds that a run lasts


def least_bound(law):
    """Return the supremum of the settling times over all starts, s."""
    k1, k2, a, b = (law.gains[name] for name in ("k1", "k2", "a", "b"))
    m, n = (1.0 - a) / (b - a), (b - 1.0) / (b - a)
    return math.gamma(m) * math.gamma(n) * (k1 / k2) ** m / (k1 * (b - a))


def classical_bound(law):
    """Return Polyakov's bound, s."""
    k1, k2, a, b = (law.gains[name] for name in ("k1", "k2", "a", "b"))
    return 1.0 / (k1 * (1.0 - a)) + 1.0 / (k2 * (b - 1.0))


def times(runs, laws, starts, band=BAND):
    """Return the settling times of s in runs of each law from each start, in that order."""
    scenarios = [
        runs.scenario(plant, law.name, *runs.conditions, law=law, v0=v0, duration=LONGER * least_bound(law))
        for plant, law in laws
        for v0 in starts
    ]
    return [settled(trace, trace.s, band) for trace in runs.traces(scenarios)]


def from_far(runs):
    """Time from which |s| stays within 1e-6 m/s, from 5000 m/s, over the least bound and over the classical one."""
    (plant,), (name,) = runs.plants, runs.laws
    law = runs.law(plant, name)
    (time,) = times(runs, [(plant, law)], [runs.values["start"]])
    return {"time from far / least bound": time / least_bound(law)} | {
        "time from far / classical bound": time / classical_bound(law)
    }


def from_anywhere(runs):
    """Time from which |s| stays within 1e-6 m/s, from 0.1 to 100 m/s on three plants, over the least bound."""
    (name,), starts = runs.laws, runs.values["starts"]
    laws = [(plant, runs.law(plant, name)) for plant in runs.plants[: 1 if runs.quick else None]]
    names = [f"{plant}, from {start:g} m/s" for plant, _ in laws for start in starts]
    found = zip(names, times(runs, laws, starts), strict=True)
    return {"time / least bound": {name: time / least_bound(laws[0][1]) for name, time in found}}


def predefined(runs):
    """Time from which |s| stays within 1e-6 m/s, from 5000 m/s, over the time Tc that the gains were scaled for."""
    (plant,), (name,), wanted = runs.plants, runs.laws, runs.values["times"][: 1 if runs.quick else None]
    law = runs.law(plant, name)
    scaled = []
    for tc in wanted:
        share = least_bound(law) / tc
        gains = {"k1": share * law.gains["k1"], "k2": share * law.gains["k2"]}
        scaled.append((plant, runs.law(plant, name, **gains)))
    found = times(runs, scaled, [runs.values["start"]])
    return {"time from far / time asked for": {f"{tc:g} s": time / tc for tc, time in zip(wanted, found, strict=True)}}


def disturbed(runs):
    """Time from which |s| stays within 1 mm/s under d = 0.5 sin 5t, with k = 0.6, over the least bound."""
    (plant,), (name,), starts = runs.plants, runs.laws, runs.values["starts"]
    law = runs.law(plant, name, k=runs.values["k"])
    found = times(runs, [(plant, law)], starts, SWITCHING)
    names = [f"from {start:g} m/s" for start in starts]
    return {"time / least bound": {one: time / least_bound(law) for one, time in zip(names, found, strict=True)}}
