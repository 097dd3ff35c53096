"""How the claims of Acary, Brogliato & Orlov 2012 are measured, on the last half of the runs.

On the block x'' = u + d the laws of first order control its velocity. Laws of second order see
position and velocity; that with the observer sees the position alone.
"""

import math

import numpy as np

from smc_mujoco.control.law import law_function, sgn
from smc_mujoco.evidence.papers.measures import exponent, half, largest, settled, two_signs

GAINS = {"a": 1.0, "alpha": 2.0, "start": 0.5}


@law_function(gains=GAINS, positive=("a", "alpha"), memory=1)
def implicit_observer(y, gains, memory):
    """Two signs at the end of the period: u = -a S1 - alpha S2 of s and s - z, where z' = -a S1
    starts at `start`.
    """
    a = gains.a * y.dt
    alpha = gains.alpha * y.dt
    second = min(max((y.de - gains.start - memory[0]) / alpha, -1.0), 1.0)
    first = min(max((y.de - alpha * second) / a, -1.0), 1.0)
    memory[0] -= a * first
    return -gains.a * first - gains.alpha * second, y.de


@law_function(gains=GAINS, positive=("a", "alpha"), memory=1)
def explicit_observer(y, gains, memory):
    """The same with both signs at the start of the period."""
    first = sgn(y.de)
    second = sgn(y.de - gains.start - memory[0])
    memory[0] -= y.dt * gains.a * first
    return -gains.a * first - gains.alpha * second, y.de


@law_function(
    gains={"ke": 5.0, "ks": 5.0, "kx": 1.5, "Mx": 1.0, "Mv": 2.0},
    positive=("ke", "ks", "kx", "Mx", "Mv"),
    memory=2,
    relative_degree=2,
)
def with_model(y, gains, memory):
    """Eq. 44: u = -w - kx x' - Mx S2 of s_x = x' + kx x, and a model z'' = u + w, w = ke e' + ks
    s_e + Mv S1.

    e = x - z, s_e = e' + ke e. Both signs are at the end of the period. The model starts at rest in
    0.
    """
    h = y.dt
    e = y.e - memory[0]
    de = y.de - memory[1]
    linear = gains.ke * de + gains.ks * (de + gains.ke * e)
    free = (de - h * linear) + gains.ke * e / (1.0 + h * gains.ke)
    w = linear + gains.Mv * min(max(free / (h * gains.Mv), -1.0), 1.0)
    ahead = (y.de - h * (w + gains.kx * y.de)) + gains.kx * y.e / (1.0 + h * gains.kx)
    u = -w - gains.kx * y.de - gains.Mx * min(max(ahead / (h * gains.Mx), -1.0), 1.0)
    memory[1] += h * (u + w)
    memory[0] += h * memory[1]
    return u, y.de + gains.kx * y.e


@law_function(gains={"mu": 1.0, "nu": 2.0}, positive=("mu", "nu"), relative_degree=2)
def implicit_twisting_50(y, gains, memory):
    """Eq. 50: u = -mu sgn(y+) - nu sgn(x+), where y+ = y + h u and x+ = x + h y+."""
    return two_signs(-y.de / y.dt, gains.mu, -(y.e + y.dt * y.de) / y.dt**2, gains.nu), y.e


@law_function(
    gains={"mu": 1.0, "nu": 2.0, "k1": 5.0, "k2": 5.0, "k3": 5.0, "k4": 5.0},
    positive=("mu", "nu", "k1", "k2", "k3", "k4"),
    memory=3,
    relative_degree=2,
)
def observed_twisting_60(y, gains, memory):
    """Eq. 60: the twisting of eq. 50 with the velocity of a super-twisting observer, its sign at
    the end of the period.

    The observer's error e solves e (1 + h k2 + h^2 k4) + h k1 [e]^(1/2) + h^2 k3 sgn(e) = b, where
    b is the error of the position predicted a period ahead, which the law shows in place of s.
    Estimates start at 1 and 1.
    """
    h = y.dt
    position, velocity = 1.0 + memory[0], 1.0 + memory[1]  # predicted for this sample
    b = y.e - position
    sign = b / (h * h * gains.k3)
    error = 0.0
    if abs(sign) > 1.0:
        sign = sgn(b)
        lead = 1.0 + h * gains.k2 + h * h * gains.k4
        half = 0.5 * h * gains.k1
        root = (math.sqrt(half * half + lead * (abs(b) - h * h * gains.k3)) - half) / lead
        error = sign * root * root
    estimate = velocity + h * (gains.k3 * sign + gains.k4 * error)
    u = two_signs(-estimate / h, gains.mu, -(y.e + h * estimate) / h**2, gains.nu)
    memory[1] = estimate + h * u - 1.0
    memory[0] = (y.e - error) + h * (1.0 + memory[1]) - 1.0
    return u, b


def variation_of(signal):
    """Return the total variation in the last half."""
    return float(np.abs(np.diff(half(signal), axis=0)).sum())


def means(trace):
    """Return the mean of d over the period that begins at each sample, N, (samples, 1)."""
    (d,) = trace.scenario.disturbance
    h = trace.scenario.control_period
    angle = d.omega * trace.t
    return (d.amplitude * (np.cos(angle) - np.cos(angle + d.omega * h)) / (d.omega * h))[:, None]


def by_condition(runs, measure):
    """Return condition -> measure of its trace; with the law's name if there are several."""
    measured = runs.measured(runs.grid(), measure)
    values = {}
    for (_, law, condition), value in measured.items():
        values[condition if len(runs.laws) == 1 else f"{law}, {condition}"] = value
    return values


def amplitude(trace):
    """Return the amplitude of the disturbance, N."""
    return trace.scenario.disturbance[0].amplitude


def inside(runs):
    """Largest |u| over a, and the total variation of u without a disturbance."""
    shares = by_condition(runs, lambda trace: largest(trace.u) / trace.scenario.law.gains["a"])
    (rest,) = runs.traces([runs.scenario(runs.plant, runs.laws[0])])
    return {"largest |u| / a": shares, "variation of u without d, N": variation_of(rest.u)}


def rejection(runs):
    """Largest |x| over what the disturbance adds to x in a control period."""
    share = by_condition(
        runs, lambda run: largest(run.v) / (run.scenario.control_period * amplitude(run))
    )
    return {"largest |x| / (h largest |d|)": share}


def multiplier(runs):
    """Largest |u + mean of d over the period before|, over the largest |d|."""
    ratios = by_condition(
        runs, lambda run: largest((run.u[1:] + means(run)[:-1])[:-1]) / amplitude(run)
    )
    return {"largest |u + mean d of the period before| / largest |d|": ratios}


def variation(runs):
    """Total variation of u over that of the mean of d over a period."""
    ratios = by_condition(runs, lambda trace: variation_of(trace.u) / variation_of(means(trace)))
    return {"variation of u / variation of the mean of d": ratios}


def reaching(runs):
    """Time from which |x| <= h rho, over the paper's bound h k0 = |x0| / (a - rho), rho the
    amplitude of d.
    """

    def share(trace):
        rho = amplitude(trace)
        bound = abs(trace.scenario.resolved.v0[0]) / (trace.scenario.law.gains["k"] - rho)
        return settled(trace, trace.v[:-1], 1.01 * trace.scenario.control_period * rho) / bound

    return {"time to |x| <= h largest |d|, over h k0": by_condition(runs, share)}


def explicit(runs):
    """Total variation of u, and the largest |x|, implicit over explicit."""
    traces = runs.traced(runs.grid())
    ratios = {}
    measures = {
        "variation of u, implicit / explicit": lambda trace: variation_of(trace.u),
        "largest |x|, implicit / explicit": lambda trace: largest(trace.v),
    }
    for name, measure in measures.items():
        ratios[name] = {}
        for condition in runs.conditions:
            implicit, explicit = (measure(traces[runs.plant, law, condition]) for law in runs.laws)
            ratios[name][condition] = implicit / explicit
    return ratios


def at_periods(runs, condition, count=None):
    """Return period -> trace of the claim's law at the first periods, with one step of the plant a
    period.
    """
    grid = {}
    for h in runs.values["periods"][:count]:
        step = {"control_period": h, "physics_step": h}
        grid[h] = runs.scenario(runs.plant, runs.laws[0], condition, **step)
    return runs.traced(grid)


def with_a_model(runs):
    """Exponents of the largest |s_x| and |x| of the last half in the period, 3 ms to 0.1 s."""
    traces = at_periods(runs, runs.conditions[0])
    s = [largest(trace.s) for trace in traces.values()]
    x = []
    for trace in traces.values():
        x.append(largest(trace.x))
    return {
        "exponent of the largest |s_x| in h": exponent([*traces], s),
        "exponent of the largest |x| in h": exponent([*traces], x),
    }


def twisting(runs):
    """Largest |x - h^2 d of the step before| of the last half, over h^2 times the largest |d|."""
    errors = {}
    for condition in runs.conditions:
        for h, trace in at_periods(runs, condition).items():
            gap = trace.x[1:] - h**2 * trace.d[:-1]
            errors[f"{condition}, {h:g} s"] = largest(gap) / (h**2 * amplitude(trace))
    return {"largest |x - h^2 d| / (h^2 largest |d|)": errors}


def rests(runs):
    """Largest |x| and |u| of the last half without a disturbance, at 10 and 100 ms."""
    traces = at_periods(runs, "nominal")
    return {
        "largest |x| at the end, m": {f"{h:g} s": largest(trace.x) for h, trace in traces.items()},
        "largest |u| at the end, N": {f"{h:g} s": largest(trace.u) for h, trace in traces.items()},
    }


def observed(runs):
    """Exponent of the largest error of the predicted position of the last half in the control
    period.
    """
    traces = at_periods(runs, runs.conditions[0], -1 if runs.quick else None)
    errors = {}
    for h, trace in traces.items():
        errors[h] = largest(trace.s)
    return {
        "exponent of the largest |e1| in h": exponent([*errors], errors.values()),
        "largest |e1|, m": {f"{h:g} s": error for h, error in errors.items()},
    }


def converges(runs):
    """Largest |x| of the last tenth of 120 s over h^2 times the largest |d|, from several starts at
    h = 0.1 s.
    """

    def share(trace):
        last = float(np.abs(trace.x[-len(trace.x) // 10 : -1]).max())
        return last / (trace.scenario.control_period**2 * amplitude(trace))

    shares = {}
    for start, speed in runs.few(runs.values["starts"], slice(2)):
        measured = runs.measured(runs.grid(x0=start, v0=speed, physics_step=0.1), share)
        for (*_, condition), value in measured.items():
            shares[f"{condition}, from {start:g} m at {speed:g} m/s"] = value
    return {"largest |x| of the last tenth / (h^2 largest |d|)": shares}
