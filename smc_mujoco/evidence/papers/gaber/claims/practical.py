"""What the paper says of practice: cheap tanh, saturation, exponential convergence, parameter jumps, delays.

All on the five plants of the study.
"""

import math
from dataclasses import replace

import numpy as np

from smc_mujoco.analysis.margins import TOLERATED_ERROR
from smc_mujoco.control.component import Component
from smc_mujoco.control.law import catalogue, command, law_function, sliding
from smc_mujoco.control.variants import with_gains
from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.audit.verdict import Beside, Check, ratio
from smc_mujoco.evidence.papers.gaber.claims.common import OURS, RIVALS, UNCLAMPED, deviation, scale
from smc_mujoco.evidence.papers.gaber.claims.searches import critical_delay, largest_delays
from smc_mujoco.evidence.papers.gaber.scenarios import LAWS
from smc_mujoco.metrics import conventions
from smc_mujoco.metrics.catalogue import settling_time
from smc_mujoco.simulation.trace import Trace

NEAR, FAR = 0.01, (1.0, 2.0)  # of x0, chosen: where tanh is its argument; where the study starts, and beyond
MIN_BOUND = 1e-9  # N m or N: an actuator's bound if lambda is 0
SERIES, FIXED = "observer_free_series", "observer_free_q15"


@law_function(gains={"lam": 6.0, "k1": 2.5}, positive=("lam",))
def observer_free_series(y, gains, memory):
    """u = -lam P(s), P = s - s^3/3 + 2 s^5/15 - 17 s^7/315: the Taylor series of tanh to order 7 as it stands."""
    s, eq = sliding(y, gains.k1)
    z = s * s
    return command(y, eq - gains.lam * s * (1.0 - z * (1.0 / 3.0 - z * (2.0 / 15.0 - z * 17.0 / 315.0)))), s


# Ways to compute tanh: law's name -> its gains beside lam and k1.
CHEAP: dict[str, dict[str, float]] = {
    "observer_free_table": {"size": 64.0},  # 65 entries
    "observer_free_taylor": {"terms": 4.0},  # to order 7, its argument reduced
    SERIES: {},
    "observer_free_single": {},
    FIXED: {},
}


def cheap_tanh(runs: Runs) -> list[Check | Beside]:
    """Claim 55: tanh by lookup table or Taylor series on a microcontroller."""
    evidence: list[Check | Beside] = []
    for plant in runs.plants:
        nominal = runs.scenario(plant, OURS)
        kinds = [replace(nominal, law=_cheap(runs, name, nominal.law)) for name in CHEAP]
        reference, *traces = runs.traces([nominal, *kinds])
        for name, trace in zip(CHEAP, traces, strict=True):
            time = math.inf if trace.failure else settling_time(trace)
            both = [
                runs.check(
                    "deviation", f"{plant}, {name}: deviation, over |x0|", deviation(trace, reference), sentence=name
                ),
                runs.check("settling time", f"{plant}, {name}: settling time, s", time, nominal.duration, name),
            ]
            evidence += [Beside(one.what, one.value) for one in both] if name == FIXED else both
    return evidence


def _cheap(runs: Runs, name: str, exact: Component) -> Component:
    """Return the law `name` with lam and k1 of the exact law, or its mutant where the audit has one."""
    template = observer_free_series if name == SERIES else catalogue()[name]
    gains = {gain: exact.gains[gain] for gain in ("lam", "k1")} | CHEAP[name]
    if name == FIXED:  # a word must hold lambda: its range is the next power of 2
        gains["u_range"] = max(template.defaults["u_range"], 2.0 ** math.frexp(gains["lam"])[1])
    return runs.mutated(with_gains(template(), **gains))


def saturation_avoided(runs: Runs) -> list[Check]:
    """Claim 56: actuator saturation inherently avoided."""
    checks = []
    for plant in runs.plants:
        half = max(abs(runs.law(plant, OURS).gains["lam"]) / 2.0, MIN_BOUND)
        traces = runs.traces([runs.scenario(plant, OURS, u_max=limit) for limit in (half, math.inf)])
        what = f"{plant}: deviation at u_max = lambda / 2, over |x0|"
        checks.append(runs.check("deviation", what, deviation(*traces)))
    return checks


def exponential(runs: Runs) -> list[Check]:
    """Claim 57: exponential convergence."""
    checks = []
    for plant in runs.plants:
        start = runs.scenario(plant, OURS).resolved.x0
        away = [runs.scenario(plant, OURS, x0=tuple(times * x for x in start)) for times in (NEAR, *FAR)]
        near, *rates = map(decay_rate, runs.traces(away))
        for times, rate in zip(FAR, rates, strict=True):
            what = f"{plant}: decay rate from {times:g} x0 apart from that near 0, share of that"
            checks.append(runs.check("decay rate", what, abs(ratio(rate, near) - 1.0)))
    return checks


def decay_rate(trace: Trace) -> float:
    """Return the rate c, 1/s, of the least-squares fit exp(a - c t) to the envelope of the worst channel.

    The envelope at t is the largest |x| from t on; fitted from the start until it is 2 % of |x0|; NaN if it never is.
    """
    worst = np.abs(trace.x).max(axis=1)
    envelope = np.maximum.accumulate(worst[::-1])[::-1]
    inside = np.flatnonzero(envelope <= conventions.BAND * scale(trace.scenario))
    if inside.size == 0:  # as where it holds NaN
        return math.nan
    upto = slice(0, max(int(inside[0]), 2))
    return -float(np.polyfit(trace.t[upto], np.log(envelope[upto]), 1)[0])


def jumps(runs: Runs) -> list[Check | Beside]:
    """Claim 59: abrupt parameter jump: may not converge, stability preserved."""
    checks, bounds = [], []
    for plant in runs.plants:
        for condition in runs.conditions:
            kind = condition.removeprefix("jump_")
            (trace,) = runs.traces([runs.scenario(plant, OURS, condition)])
            jump = trace.scenario.jump
            assert jump is not None  # the condition has one
            peak, bound = (
                float(np.nan_to_num(np.abs(trace.x[part]).max(), nan=math.inf)) / scale(trace.scenario)
                for part in (trace.t >= jump.time, conventions.last(trace))
            )
            checks.append(runs.check("largest |x|", f"{plant}: largest |x| after a {kind} jump, over |x0|", peak))
            bounds.append(bound)
    return [*checks, Beside("largest ultimate bound after a jump, over |x0|", max(bounds))]


def delay_tolerant(runs: Runs) -> list[Check | Beside]:
    """Claim 61: classical SMC is delay-sensitive, the paper's is not."""
    longest, below = (
        largest_delays(runs, runs.plants, (*LAWS, UNCLAMPED), within) for within in (TOLERATED_ERROR, 1.0)
    )
    evidence: list[Check | Beside] = []
    for plant in runs.plants:
        ours, theory = longest[plant, OURS], critical_delay(runs, plant)
        evidence += [
            *(
                runs.check(
                    "largest delay", f"{plant}: largest delay against that of {law}, s", ours, longest[plant, law]
                )
                for law in RIVALS
            ),
            *(
                Beside(f"{plant}: largest delay with which {law} ends below its start, s", below[plant, law])
                for law in LAWS
            ),
            Beside(f"{plant}: largest delay of {UNCLAMPED}, s", longest[plant, UNCLAMPED]),
            Beside(f"{plant}: critical delay of the paper's law by linear theory, s", theory),
        ]
    return evidence
