"""What the paper's simulations of the Van der Pol oscillator show under noise and disturbance, of x and of u.

Noise is the study's, 0.01 m on x and 0.05 m/s on v; the disturbance is the paper's, d = 0.2 sin(5t) N.
"""

import numpy as np

from smc_mujoco.metrics.catalogue import HIGH, conventions
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.paper.claims.audit import claim
from smc_mujoco.studies.paper.claims.runs import OURS, RIVALS, UNCLAMPED, Runs, actual_bound, deviation, scale, scores
from smc_mujoco.studies.paper.claims.verdict import Beside, Check, about, check, ratio
from smc_mujoco.studies.paper.scenarios import LAWS

PLANT = "van_der_pol"


@claim(
    "45",
    "Van der Pol with noise: stable, small fluctuations",
    where="robustness under disturbances",
    measured="ultimate bound with noise on x and v",
    holds_if="< 5 % of |x0|",
)
def small_fluctuations(runs: Runs) -> list[Check]:
    """Largest |x| in the last 20 % of the run over |x0|."""
    last = runs.score(PLANT, OURS, "noise")["ultimate_bound"]
    return [
        check(f"{PLANT}: ultimate bound with noise, over |x0|", last / scale(runs.scenario(PLANT, OURS)), "<", 0.05)
    ]


@claim(
    "46",
    "Van der Pol with d: nearly identical, strong rejection",
    where="robustness under disturbances",
    measured="largest |x - x_nominal| under d = 0.2 sin(5t); ultimate bound under it against each rival's",
    holds_if="< 5 % of |x0|; residual not larger than any rival's",
)
def nearly_identical(runs: Runs) -> list[Check | Beside]:
    """Deviation from the nominal run over |x0|; the residual, largest |x| in the last 20 %, against each rival's."""
    disturbed, nominal = runs.traces([runs.scenario(PLANT, OURS, condition) for condition in ("sine", "nominal")])
    laws = (*LAWS, UNCLAMPED)
    residual = {law: s["ultimate_bound"] for (_, law), s in scores(runs, [PLANT], laws, "sine").items()}
    return [
        *about(
            "nearly identical",
            check(f"{PLANT}: deviation from nominal under d, over |x0|", deviation(disturbed, nominal), "<", 0.05),
        ),
        *about(
            "strong rejection",
            *(
                check(f"{PLANT}: residual under d of {OURS} against that of {law}, m", residual[OURS], "<=", of_law)
                for law, of_law in residual.items()
                if law in RIVALS
            ),
        ),
        Beside(f"{PLANT}: residual under d of {UNCLAMPED}, m", residual[UNCLAMPED]),
    ]


@claim(
    "48",
    "u under noise: smooth, small fluctuations",
    where="control signal analysis",
    measured="Van der Pol with noise, last 20 % of the run: standard deviation of u, its largest step from sample to "
    "sample, share of its variance above 50 Hz",
    holds_if="std < 10 % of min(lambda, u_max), step < 10 % of that, share < 50 %",
    note="Over the whole run the swing from the start, not noise, is most of u's variance; so all three are of the "
    "last 20 %.",
)
def smooth_under_noise(runs: Runs) -> list[Check | Beside]:
    """How u of the paper's law fluctuates about rest; see `fluctuation`."""
    (trace,) = runs.traces([runs.scenario(PLANT, OURS, "noise")])
    std, step, share = fluctuation(trace)
    most, over = actual_bound(runs, PLANT), "over min(lambda, u_max)"
    return [
        check(f"{PLANT}: standard deviation of u with noise, {over}", ratio(std, most), "<", 0.1, "small fluctuations"),
        check(f"{PLANT}: largest step of u with noise, {over}", ratio(step, most), "<", 0.1, "smooth"),
        check(f"{PLANT}: share of u above {HIGH:g} Hz with noise", share, "<", 0.5, "smooth"),
        Beside(
            f"{PLANT}: share of u above {HIGH:g} Hz with noise, over the whole run",
            runs.score(PLANT, OURS, "noise")["hf_share"],
        ),
    ]


@claim(
    "49",
    "u under d: continuous, bounded",
    where="control signal analysis",
    measured="Van der Pol under d = 0.2 sin(5t): largest change of u per sample of 1 ms",
    holds_if="< 2 % of min(lambda, u_max)",
)
def continuous(runs: Runs) -> list[Check]:
    """Largest step of u over min(lambda, u_max)."""
    step = ratio(runs.score(PLANT, OURS, "sine")["max_step"], actual_bound(runs, PLANT))
    return [check(f"{PLANT}: largest step of u under d, over min(lambda, u_max)", step, "<", 0.02)]


def fluctuation(trace: Trace) -> tuple[float, float, float]:
    """Return standard deviation, largest step and share of variance above 50 Hz of u in the last part, worst channel.

    The share is from the discrete Fourier transform, no window; a failed run gives inf, a constant u 0.
    """
    u = trace.u[conventions.last(trace)]
    if not np.isfinite(u).all():
        return np.inf, np.inf, np.inf
    std, step = float(u.std(axis=0).max()), float(np.abs(np.diff(u, axis=0)).max())
    power = (np.abs(np.fft.rfft(u - u.mean(axis=0), axis=0)) ** 2).max(axis=1)
    frequency = np.fft.rfftfreq(len(u), trace.scenario.control_period)
    share = float(power[frequency > HIGH].sum() / power.sum()) if power.any() else 0.0
    return std, step, share
