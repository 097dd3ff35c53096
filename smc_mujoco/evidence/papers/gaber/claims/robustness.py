"""What the paper's simulations of the Van der Pol oscillator show under noise and disturbance, of x and of u.

Noise is the study's, 0.01 m on x and 0.05 m/s on v; the disturbance is the paper's, d = 0.2 sin(5t) N.
"""

import numpy as np

from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.audit.verdict import Beside, Check, ratio
from smc_mujoco.evidence.papers.gaber.claims.common import OURS, RIVALS, UNCLAMPED, command_bound, deviation, scale
from smc_mujoco.metrics.catalogue import HIGH_PASS, conventions
from smc_mujoco.simulation.trace import Trace

PLANT = "van_der_pol"


def small_fluctuations(runs: Runs) -> list[Check]:
    """Claim 45: Van der Pol with noise: stable, small fluctuations."""
    bound = runs.score(runs.plant, OURS, "noise")["ultimate_bound"] / scale(runs.scenario(runs.plant, OURS))
    return [runs.check("ultimate bound", f"{runs.plant}: ultimate bound with noise, over |x0|", bound)]


def nearly_identical(runs: Runs) -> list[Check | Beside]:
    """Claim 46: Van der Pol with d: nearly identical, strong rejection."""
    disturbed, nominal = runs.traces([runs.scenario(runs.plant, OURS, condition) for condition in ("sine", "nominal")])
    residual = {law: runs.score(runs.plant, law, "sine")["ultimate_bound"] for law in (OURS, *RIVALS, UNCLAMPED)}
    what = f"{runs.plant}: residual under d of"
    return [
        runs.check(
            "deviation", f"{runs.plant}: deviation from nominal under d, over |x0|", deviation(disturbed, nominal)
        ),
        *(
            runs.check("residual", f"{what} {OURS} against that of {law}, m", residual[OURS], residual[law])
            for law in RIVALS
        ),
        Beside(f"{what} {UNCLAMPED}, m", residual[UNCLAMPED]),
    ]


def smooth_under_noise(runs: Runs) -> list[Check | Beside]:
    """Claim 48: u under noise: smooth, small fluctuations."""
    plant = runs.plant
    (trace,) = runs.traces([runs.scenario(plant, OURS, "noise")])
    std, step, share = fluctuation(trace)
    most, over = command_bound(runs, runs.plant), "over min(lambda, u_max)"
    whole = runs.score(plant, OURS, "noise")["hf_share"]
    return [
        runs.check("standard deviation", f"{plant}: standard deviation of u with noise, {over}", ratio(std, most)),
        runs.check("step", f"{plant}: largest step of u with noise, {over}", ratio(step, most)),
        runs.check("share", f"{plant}: share of u above {HIGH_PASS:g} Hz with noise", share),
        Beside(f"{plant}: share of u above {HIGH_PASS:g} Hz with noise, over the whole run", whole),
    ]


def continuous(runs: Runs) -> list[Check]:
    """Claim 49: u under d: continuous, bounded."""
    step = ratio(runs.score(runs.plant, OURS, "sine")["max_step"], command_bound(runs, runs.plant))
    return [runs.check("step", f"{runs.plant}: largest step of u under d, over min(lambda, u_max)", step)]


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
    share = float(power[frequency > HIGH_PASS].sum() / power.sum()) if power.any() else 0.0
    return std, step, share
