"""What an adversary may try: forces and errors of measurement that are known to be bad.

Forces are over their bound, one number for each control sample, within -1 .. 1. The error of a linear loop is a convex
function of the force, so the worst force jumps between its bounds, as most of these do.
"""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from smc_mujoco.simulation.signals import Relay
from smc_mujoco.simulation.trace import Trace

RELAY_SIGNALS = {"sign of s": "s", "sign of e": "error", "sign of e'": "rate"}  # strategy -> signal that a relay sees
PHASE_LEADS = (-1.2, -0.6, 0.6, 1.2)  # rad, of weighted sums of e' and e before e'; chosen
SWITCH_TIMES = (0.25, 0.5, 0.75)  # of a force that switches once, as shares of a run; chosen
EARLY_SWITCH_TIMES = (1 / 32, 1 / 16, 1 / 8)  # the same while the loop still moves from its start; chosen
FREQUENCY_RATIOS = (0.5, 0.8, 1.0, 1.25, 2.0)  # frequencies of waves over that of the loop; chosen
MAX_FREQUENCY_SHARE = 0.1  # of the control frequency: a faster oscillation of the loop is chattering; chosen


def constants(samples: int) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the constant forces of both signs."""
    for sign in (1.0, -1.0):
        yield "constant", np.full(samples + 1, sign)


def single_switches(samples: int) -> Iterator[tuple[str, np.ndarray]]:
    """Yield forces that change their sign once: in the first swing, or when an integral has settled."""
    for share, sign in itertools.product((*SWITCH_TIMES, *EARLY_SWITCH_TIMES), (1.0, -1.0)):
        yield "one switch", np.where(np.arange(samples + 1) < share * samples, sign, -sign)


def relays(amplitude: float, slope: float) -> Iterator[tuple[str, Relay]]:
    """Yield disturbances that switch with the sign of s, of e and of e'; amplitude and slope are those of `Relay`."""
    for kind, signal in RELAY_SIGNALS.items():
        for sign in (1.0, -1.0):
            yield kind, Relay(sign * amplitude, **{signal: 1.0}, slope=slope)


def weighted_sums(trace: Trace, amplitude: float, slope: float) -> Iterator[tuple[str, Relay]]:
    """Yield disturbances that switch with the sign of a weighted sum of e' and e, or of e' and s.

    The weights make both signals equally large in a run.
    """
    sizes = {name: float(np.nan_to_num(part).std()) or 1.0 for name, part in relay_signals(trace).items()}
    for lead in PHASE_LEADS:
        weights = {"rate": math.cos(lead) / sizes["rate"], "error": math.sin(lead) / sizes["error"]}
        yield "sign of e' and e", Relay(amplitude, **weights, slope=slope)
    yield "sign of e' and s", Relay(amplitude, rate=1.0 / sizes["rate"], s=1.0 / sizes["s"], slope=slope)


def relay_signals(trace: Trace) -> dict[str, np.ndarray]:
    """Return what a relay sees of channel 0 at the control samples: "s", "rate" and "error", (samples + 1,) each."""
    r = trace.r[:, 0]
    dr = np.diff(r, prepend=r[:1]) / trace.scenario.control_period
    return {"s": trace.s[:, 0], "rate": trace.v[:, 0] - dr, "error": trace.x[:, 0] - r}


def recorded_force(trace: Trace, relay: Relay, before: np.ndarray) -> np.ndarray:
    """Return the force of a relay over its bound during a run, (samples + 1,). After a failure it keeps its value.

    Args:
      before: the force until the relay starts, (samples + 1,); (0,) for a relay that starts at 0.
    """
    parts = relay_signals(trace)
    aim = relay.s * parts["s"] + relay.rate * parts["rate"] + relay.error * parts["error"]
    goals = np.where(np.nan_to_num(aim) > 0.0, relay.amplitude, -relay.amplitude)
    if relay.slope:
        force = 0.0
        for i, goal in enumerate(goals.tolist()):
            force += min(max(goal - force, -relay.slope), relay.slope)
            goals[i] = force
    goals /= abs(relay.amplitude)
    return np.where(trace.t < relay.start, before, goals) if relay.start else goals


def loop_frequency(trace: Trace) -> float:
    """Return the frequency at which a loop swings under a relay of e', Hz."""
    late = np.nan_to_num(trace.x[:, 0] - trace.r[:, 0])[len(trace.t) // 4 :]
    swings = max(1.0, np.count_nonzero(np.diff(late > late.mean())) / 2.0)
    return min(swings / (0.75 * float(trace.t[-1])), MAX_FREQUENCY_SHARE / trace.scenario.control_period)


def measurement_errors(trace: Trace, times: int, hold: int) -> Iterator[tuple[str, np.ndarray]]:
    """Yield errors of position and velocity, (2, times), each for `hold` samples: constant, and as a loop swings."""
    for signs in itertools.product((1.0, -1.0), repeat=2):
        yield "constant error", np.repeat(np.reshape(signs, (2, 1)), times, axis=1)
    for part in relay_signals(trace).values():
        signs = np.where(np.nan_to_num(part[: times * hold : hold]) > 0.0, 1.0, -1.0)
        for sign in (1.0, -1.0):
            yield "error that switches", sign * np.array([signs, signs])


def waves(trace: Trace) -> Iterator[tuple[str, np.ndarray]]:
    """Yield square waves and sines about the frequency at which a loop swings under a relay of e'."""
    phase = 2.0 * math.pi * loop_frequency(trace) * trace.t
    for pitch in FREQUENCY_RATIOS:
        yield "square wave", np.where(np.sin(pitch * phase) >= 0.0, 1.0, -1.0)
    for shift in (0.0, 0.5 * math.pi):
        yield "sine", np.sin(phase + shift)
