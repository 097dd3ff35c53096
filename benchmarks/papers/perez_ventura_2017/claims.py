"""How the claims of Perez-Ventura & Fridman 2017 are measured.

ATC is the actuator's time constant.
"""

import math

import numpy as np

import smc_mujoco as smc
from smc_mujoco.evidence.papers.measures import cycle, exponent

FIRST_HARMONIC = (
    2.0 * math.gamma(1.25) / (math.sqrt(math.pi) * math.gamma(1.75))
)  # c, of [sin]^(1/2)
RELAY_GAIN_RATIO = 1.1  # M over the bound of the disturbance
SAMPLES_PER_ATC = 50  # samples in one ATC
QUICK_LAGS = slice(1, None)  # the ATCs of a quick audit


def super_twisting_margins(gains):
    """The two conditions of super-twisting for |d'| <= 1."""
    return {
        "k2 > L": gains["k2"] - 1.0,
        "k1 > sqrt(k2 + L)": gains["k1"] - math.sqrt(gains["k2"] + 1.0),
    }


def behind(runs, law, lag, **changes):
    """Return the scenario of a law behind two lags, long enough for its cycle."""
    fields = {"duration": 2.0 + 60.0 * lag, "control_period": lag / SAMPLES_PER_ATC}
    return runs.scenario(
        runs.plant, law.name, law=law, actuator=(smc.Lag(lag), smc.Lag(lag)), **(fields | changes)
    )


def super_twisting(runs, slope):
    """Return super-twisting with the gains of |d'| <= 1, scaled to |d'| <= slope."""
    gains = runs.law(runs.plant, "super_twisting").gains
    return runs.law(
        runs.plant, "super_twisting", k1=gains["k1"] * math.sqrt(slope), k2=gains["k2"] * slope
    )


def relay(runs, bound):
    """Return the classical law for |d| <= bound."""
    return runs.law(runs.plant, "classical", k=RELAY_GAIN_RATIO * bound)


def predicted(k1, k2, lag):
    """Return amplitude and frequency, Hz, of super-twisting by harmonic balance."""
    a = FIRST_HARMONIC * k1
    b = 16.0 * k2 / math.pi
    return lag**2 * (a * a + b) ** 2 / (4.0 * a * a), a / (lag * math.sqrt(a * a + b)) / math.tau


def compared(runs, law, expected):
    """Return measured amplitude and frequency over those expected of a lag, and the exponent of the
    amplitude.
    """
    lags = runs.few(runs.values["lags"], QUICK_LAGS)
    cycles = runs.measured({lag: behind(runs, law, lag) for lag in lags}, cycle)
    amplitudes = {}
    frequencies = {}
    for lag, measured in cycles.items():
        name = f"{1e3 * lag:g} ms"
        amplitudes[name], frequencies[name] = np.divide(measured, expected(lag)).tolist()
    return {
        "amplitude / predicted": amplitudes,
        "frequency / predicted": frequencies,
        "exponent of the amplitude in the ATC": exponent(lags, np.array([*cycles.values()])[:, 0]),
    }


def relay_cycle(runs):
    """Amplitude and frequency of s at ATCs of 1 to 10 ms, over 2 M mu / pi and 1 / (2 pi mu)."""
    law = runs.law(runs.plant, "classical")
    return compared(
        runs, law, lambda lag: (2.0 * law.gains["k"] * lag / math.pi, 1.0 / (math.tau * lag))
    )


def twisting_cycle(runs):
    """Amplitude and frequency of s at ATCs of 1 to 10 ms, over the prediction."""
    law = runs.law(runs.plant, "super_twisting")
    return compared(runs, law, lambda lag: predicted(law.gains["k1"], law.gains["k2"], lag))


def size_and_power(trace):
    """Return half the range of s, and the mean square of s', in the last half of a run; inf if it
    failed.
    """
    s = trace.s[len(trace.t) // 2 :, 0]
    if not np.isfinite(s).all():
        return math.inf, math.inf
    return float(np.ptp(s)) / 2.0, float(np.mean((np.diff(s) / trace.scenario.control_period) ** 2))


def ratios(runs, which, cases):
    """Return size and power under one law over those under another; cases: name -> both laws, a lag
    and changes.
    """
    grid = []
    for laws, lag, changes in cases.values():
        for law in laws:
            grid.append(behind(runs, law, lag, **changes))
    measured = []
    for trace in runs.traces(grid):
        measured.append(size_and_power(trace))
    sizes, powers = np.divide(measured[::2], measured[1::2]).T
    by_measure = {"amplitude": sizes, "power": powers}
    return {
        f"{what}, {which}": dict(zip(cases, shares, strict=True))
        for what, shares in by_measure.items()
    }


def some_disturbance(runs):
    """Half the range of s, and the mean square of s', under d = D sin(omega t) with omega = 1 / (2
    ATC).

    STA has the gains for L = D omega, as its theory asks for; bounds D of 0.5 and 2, ATCs of 1 and
    10 ms.
    """
    cases = {}
    for bound in runs.values["bounds"]:
        for lag in runs.few(runs.values["lags"], QUICK_LAGS):
            omega = runs.values["pace"] / lag
            laws = (relay(runs, bound), super_twisting(runs, bound * omega))
            d = smc.Sine(bound, omega)
            cases[f"|d| <= {bound:g} N, {1e3 * lag:g} ms"] = laws, lag, {"disturbance": d}
    return ratios(runs, "FOSMC / STA", cases)


def small_lags(runs):
    """Half the range of s, and the mean square of s', under d = sin t, L = 1, at ATCs of 1 to 10
    ms.
    """
    bound = runs.values["bound"]
    lags = runs.few(runs.values["lags"], QUICK_LAGS)
    laws = (super_twisting(runs, bound), relay(runs, bound))
    changes = {"disturbance": smc.Sine(bound, 1.0)}
    return ratios(
        runs,
        "STA / FOSMC",
        {f"{1e3 * lag:g} ms": (laws, lag, changes | {"duration": 8.0}) for lag in lags},
    )


def crossover(runs):
    """Amplitudes of s at the ATC where the two predictions are equal, at half and at twice of it,
    without d.
    """
    bound = runs.values["bound"]
    slope = runs.values["slope"]
    twisting = super_twisting(runs, slope)
    sign = relay(runs, bound)
    equal = (2.0 * RELAY_GAIN_RATIO * bound / math.pi) / predicted(
        1.5 * math.sqrt(slope), 1.1 * slope, 1.0
    )[0]
    lags = [equal, equal / 2.0, equal * 2.0]
    scenarios = []
    for lag in lags:
        for law in (twisting, sign):
            scenarios.append(behind(runs, law, lag, duration=2.0 + 150.0 * lag))
    amplitudes = []
    for trace in runs.traces(scenarios):
        amplitudes.append(cycle(trace)[0])
    names = ("at the crossover", "at half of it", "at twice of it")
    ratios = np.divide(amplitudes[::2], amplitudes[1::2])
    crossing = {"ATC at the crossover, s": equal}
    for name, ratio in zip(names, ratios, strict=True):
        crossing[f"amplitude, STA / FOSMC, {name}"] = ratio
    return crossing


def redesigned(runs):
    """Amplitude of s at k1 = sqrt(16 k2 / pi) / c, and at half and twice of that, at an ATC of 5
    ms.
    """
    k2 = runs.values["k2"]
    best = math.sqrt(16.0 * k2 / math.pi) / FIRST_HARMONIC
    laws = []
    for factor in (1.0, 0.5, 2.0):
        laws.append(runs.law(runs.plant, "super_twisting", k1=factor * best, k2=k2))
    scenarios = []
    for law in laws:
        scenarios.append(behind(runs, law, runs.values["lag"]))
    as_designed, half, twice = (cycle(trace)[0] for trace in runs.traces(scenarios))
    return {
        "amplitude with half of k1 / least": half / as_designed,
        "amplitude with twice k1 / least": twice / as_designed,
    }
