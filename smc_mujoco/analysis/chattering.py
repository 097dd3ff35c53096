"""Chattering, predicted before it is run: the limit cycle of a scenario by harmonic balance.

    cycle = smc.chattering(scenario)
    cycle = smc.chattering("super_twisting", plant="duffing", actuator=smc.Lag(0.01))
    cycle.amplitude, cycle.frequency          # of s, in its unit, and Hz; NaN where no limit cycle is predicted

A limit cycle e = a sin(omega t) solves N(a, omega) L(j omega) = 1. N is the first harmonic of what the law returns, and
L the answer of the linearised mechanism (`harmonics`), without any integrator's error. Then the equation is solved
again with the other harmonics of e, which follow from those of u. The solution is exact if the cycle is not locked to
the control samples. `uncertainty` says how much such locking may change it. Cycles that are not stable by Loeb's
criterion are left out.
Sources: A. Gelb & W. E. Vander Velde, Multiple-Input Describing Functions, 1968; I. Boiko, Discontinuous Control
Systems, 2009; U. Perez-Ventura & L. Fridman, arXiv 1705.09711, 2017.
"""

import dataclasses
import itertools
import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from smc_mujoco.analysis.harmonics import Loop, Wave
from smc_mujoco.analysis.step_halving import StepChange
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.files import with_ending, write_json
from smc_mujoco.control.component import Component, Template
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.drives import RateLimit
from smc_mujoco.simulation.scenario import Scenario

MIN_FREQUENCY = 0.5  # Hz: slower oscillations do not count as chattering
GRID_FREQUENCIES, GRID_AMPLITUDES = 60, 36  # points of the grid on which cycles are sought: chosen
COARSE_SAMPLES = 60  # samples of a period on that grid: chosen
MIN_AMPLITUDE, MAX_AMPLITUDE = 1e-12, 3.0  # rad or m, of the error
SAME_CYCLE_TOLERANCE = 0.02  # relative difference below which two cycles are one: chosen
BRACKET_MARGIN = 1.0  # of the log of an amplitude, by which a bracket from the coarse grid is widened: chosen
MAX_NYQUIST_SHARE = 0.9  # of half the sampling frequency: faster waves beat with their images
MIN_GAIN_GROWTH = 3.0  # of a law that switches, from an amplitude to a thousandth of it: chosen
CYCLE_TOLERANCE = 1e-4  # relative, of the slowest and the fastest cycle
FREQUENCY_STEP = 0.93  # factor from one frequency to the next in the search for these
DERIVATIVE_STEP = 1e-3  # of the logs of amplitude and omega: smaller ones see jumps of the gain by the samples; chosen
STABILITY_STEP = 0.1  # relative, in Loeb's criterion: smaller ones see these jumps too; chosen
# Factors on the ends of ranges. With them the ranges have the truth in 95 % of random loops: benchmarks/chattering.py.
AMPLITUDE_FACTOR, FREQUENCY_FACTOR = 1.01, 1.01
MAX_GAIN_DRIFT = 0.05  # relative: a law whose gain drifts more gets a remark; chosen
RESONANCE_DAMPING = 0.01  # imaginary part of frequencies over the real one, so that resonances have a width; chosen
PHASE_POINTS = 2000  # of the curve of phase over frequency; chosen


@dataclasses.dataclass(frozen=True, kw_only=True)
class Chattering:
    """A predicted limit cycle of one channel. If none is predicted, its numbers are NaN; the ranges may be known.

    Attributes:
      amplitude: of the sliding variable s, half its range, in its unit.
      amplitude_x: of the position, rad or m.
      amplitude_u: of the command, half its range, in its unit: N m, N or V.
      frequency: Hz.
      power: mean square of s', (amplitude omega)^2 / 2 with the first harmonic of s. For s' = u + d it is the mean
        square of the delivered force per unit of mass.
      third_harmonic: third harmonic of s over the first; NaN for two samples in a period. If it is large, the law does
        not see a sine, and the prediction is rough.
      samples: control samples in a period.
      amplitude_range, frequency_range: smallest and largest amplitude and frequency of a cycle that is locked to the
        samples, see `Loop.phases`. They are widened by factors that were calibrated by exact integration: 95 % of
        random loops are within the ranges. The largest amplitude includes the change of s by one count of an encoder.
        If the balance has no solution but the law switches, a locked cycle is possible, and these are its ranges.
      coupling: largest amplitude of another driven channel under this channel's command, over amplitude_x; 0 for a
        single channel. If it is not small, the channels oscillate together, and the prediction for one fails.
      gain, response: N and L at the cycle, complex.
      assumptions: what was left out or is doubtful, in sentences.
    """

    amplitude: float = math.nan
    amplitude_x: float = math.nan
    amplitude_u: float = math.nan
    frequency: float = math.nan
    power: float = math.nan
    third_harmonic: float = math.nan
    samples: float = math.nan
    amplitude_range: tuple[float, float] = (math.nan, math.nan)
    frequency_range: tuple[float, float] = (math.nan, math.nan)
    coupling: float = math.nan
    gain: complex = complex(math.nan)
    response: complex = complex(math.nan)
    assumptions: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return not math.isnan(self.frequency)

    @property
    def uncertainty(self) -> float:
        """Largest relative distance of an end of the two ranges from the predicted amplitude or frequency.

        It is inf if no limit cycle is predicted but one is possible, and NaN if none is possible.
        """
        if not self:
            return math.nan if math.isnan(self.amplitude_range[1]) else math.inf
        pairs = ((self.amplitude_range, self.amplitude), (self.frequency_range, self.frequency))
        return max(abs(end / value - 1.0) for ends, value in pairs for end in ends)


def chattering(law: Scenario | Component | Template | str, channel: int = 0, **fields: object) -> Chattering:
    """Predict the limit cycle about rest of one driven channel.

    Args:
      law: a Scenario; or a law, with the other fields of a Scenario by name.
      channel: index of a driven channel; the others are at rest.
      fields: of the Scenario, such as plant, actuator, input_delay, control_period.

    Returns:
      The stable limit cycle. If there are several, the fastest, which is that of a mechanism near rest.

    Raises:
      ScenarioError: a law that does not compile, a channel that is not driven, or as Scenario.
    """
    if isinstance(law, Scenario):
        if fields:
            raise ScenarioError(f"a Scenario and {', '.join(fields)}: give one of them")
        scenario = law
    elif "plant" not in fields:
        raise ScenarioError("chattering lacks plant: give plant=...")
    else:
        scenario = Scenario(law=law, **fields)  # type: ignore[arg-type]
    return predict(scenario, channel)


def predict(scenario: Scenario, channel: int = 0, ranges: bool = True) -> Chattering:
    """Return what `chattering` returns for a scenario.

    Args:
      ranges: False to leave the ranges of a predicted cycle NaN, which takes half the time.
    """
    if isinstance(channel, bool) or not isinstance(channel, int) or not 0 <= channel < scenario.plant.driven:
        raise ScenarioError(f"channel is {shown(channel)}: give 0 to {scenario.plant.driven - 1}")
    loop = Loop(scenario, channel)
    waves = _stable_cycles(loop, cycles(loop))
    assumptions = tuple(_assumptions(loop))
    if not waves:
        return _locked_ranges(scenario, channel, assumptions) if switches(loop) else Chattering(assumptions=assumptions)
    return _prediction(loop, max(waves, key=lambda wave: wave.omega), assumptions, ranges)


def switches(loop: Loop) -> bool:
    """Return whether a law switches: whether its gain grows without bound towards small amplitudes."""
    omega = 0.1 * math.pi / loop.scenario.control_period
    small, smaller = (
        abs(loop.gain(amplitude, omega, COARSE_SAMPLES)) for amplitude in (1e3 * MIN_AMPLITUDE, MIN_AMPLITUDE)
    )
    return smaller > MIN_GAIN_GROWTH * small


def _locked_ranges(scenario: Scenario, channel: int, assumptions: tuple[str, ...]) -> Chattering:
    """Return the ranges of a cycle that is locked to the samples, of a law that switches.

    Such a law switches at most half a control period later than on average. So the cycle is not larger and not slower
    than that of the same loop with half a control period more delay.
    """
    loop = Loop(scenario, channel, 0.5 * scenario.control_period)
    waves = _stable_cycles(loop, cycles(loop))
    if not waves:
        return Chattering(assumptions=assumptions)
    wave = max(waves, key=lambda wave: wave.omega)
    assumptions += ("the balance has no solution, but the law switches: a cycle locked to the samples is possible",)
    return Chattering(
        amplitude_range=(0.0, AMPLITUDE_FACTOR * wave.s + loop.s_of_one_count),
        frequency_range=(wave.omega / FREQUENCY_FACTOR / math.tau, 0.5 / scenario.control_period),
        assumptions=assumptions,
    )


def cycles(loop: Loop) -> list[Wave]:
    """Return the solutions of N L = 1 up to half the sampling frequency, where |N| falls with the amplitude."""
    fastest = math.pi / loop.scenario.control_period
    omegas = np.geomspace(math.tau * MIN_FREQUENCY, MAX_NYQUIST_SHARE * fastest, GRID_FREQUENCIES)
    amplitudes = np.geomspace(MIN_AMPLITUDE, MAX_AMPLITUDE, GRID_AMPLITUDES)
    balanced: list[tuple[float, float]] = []
    for bracket in _brackets(loop, omegas, amplitudes):
        cycle = _balanced(loop, *bracket)
        if cycle and all(abs(cycle[0] / a - 1) + abs(cycle[1] / w - 1) > SAME_CYCLE_TOLERANCE for a, w in balanced):
            balanced.append(cycle)
    return [loop.wave(*one) for one in (balanced or _of_two_samples(loop, fastest, amplitudes))]


Bracket = tuple[tuple[float, float], tuple[float, float]]  # two omegas and two amplitudes, between which a cycle may be


def _brackets(loop: Loop, omegas: np.ndarray, amplitudes: np.ndarray) -> Iterator[Bracket]:
    """Yield brackets that may contain a cycle: along the curve |N L| = 1, the phase of N L changes its sign there."""
    branches: list[list[tuple[float, float]]] = []  # for each omega: (amplitude, phase) where |N L| = 1
    for omega in omegas:
        response = loop.response(omega)
        products = np.array([loop.gain(a, omega, COARSE_SAMPLES) * response for a in amplitudes])
        sizes = np.log(np.abs(products) + 1e-300)
        here = []
        for k in np.flatnonzero(np.diff(np.sign(sizes))):
            share = sizes[k] / (sizes[k] - sizes[k + 1])
            amplitude = math.exp(np.interp(share, [0, 1], np.log(amplitudes[k : k + 2])))
            here.append((amplitude, float(np.angle(products[k] * (1 - share) + products[k + 1] * share))))
        if not here:  # the curve ends at amplitude 0, or beyond the largest
            end = 0 if sizes[0] < 0.0 else -1
            here.append((float(amplitudes[end]), float(np.angle(products[end]))))
        branches.append(here)
    for (w0, before), (w1, after) in itertools.pairwise(zip(omegas, branches, strict=True)):
        for (a0, p0), (a1, p1) in itertools.product(before, after):
            if p0 * p1 <= 0.0 and abs(p0 - p1) < math.pi:
                yield (w0, w1), (min(a0, a1), max(a0, a1))


def _balanced(loop: Loop, omegas: tuple[float, float], amplitudes: tuple[float, float]) -> tuple[float, float] | None:
    """Return amplitude and omega of the cycle in a bracket, or None.

    The search is nested bisection, because N may jump with the places of the samples. The bracket is widened to both
    sides, because the few samples of the coarse grid shift the phase of a law that switches.
    """
    from scipy.optimize import brentq

    low, high = math.log(amplitudes[0]) - BRACKET_MARGIN, math.log(amplitudes[1]) + BRACKET_MARGIN
    first, last = np.log(omegas)

    def phase(w: float) -> float:
        return _on_curve(loop, math.exp(w), low, high)[1]

    fastest = math.log(MAX_NYQUIST_SHARE * math.pi / loop.scenario.control_period)
    first, last = 2 * first - last, min(2 * last - first, fastest)
    if phase(first) * phase(last) > 0.0:
        return None  # the coarse grid's bracket has no cycle with all samples
    omega = math.exp(float(brentq(phase, first, last, xtol=1e-8)))  # type: ignore[arg-type]
    amplitude, _ = _on_curve(loop, omega, low, high)
    return (amplitude, omega) if low < math.log(amplitude) < high else None


def _on_curve(loop: Loop, omega: float, low: float, high: float, tolerance: float = 1e-9) -> tuple[float, float]:
    """Return the amplitude at which |N L| = 1 for an omega, and the phase of N L there.

    Args:
      low, high: range of the amplitude's log. Without a solution in it, the nearer end is returned.
      tolerance: of the amplitude's log.
    """
    from scipy.optimize import brentq

    response = loop.response(omega)

    def size(z: float) -> float:
        return math.log(abs(loop.gain(math.exp(z), omega) * response) + 1e-300)

    if size(low) <= 0.0:
        z = low
    elif size(high) >= 0.0:
        z = high
    else:
        z = float(brentq(size, low, high, xtol=tolerance))  # type: ignore[arg-type]
    return math.exp(z), float(np.angle(loop.gain(math.exp(z), omega) * response))


def _shifted_cycle(loop: Loop, wave: Wave, shift: float) -> Wave:
    """Return the cycle of a law that acts later or earlier.

    The search follows the curve |N L| = 1, towards slower waves for a later law. It ends at the slowest wave that
    counts as chattering, or at a wave of two samples a period.

    Args:
      wave: the cycle of the law as it is.
      shift: rad at the cycle's omega; negative for a later law.
    """
    from scipy.optimize import brentq

    half = math.pi / loop.scenario.control_period
    slowest, fastest, z = math.tau * MIN_FREQUENCY, MAX_NYQUIST_SHARE * half, math.log(wave.amplitude)

    def excess(omega: float) -> float:
        nonlocal z
        amplitude, phase = _on_curve(loop, omega, z - BRACKET_MARGIN, z + BRACKET_MARGIN, CYCLE_TOLERANCE)
        z = math.log(amplitude)
        return phase + shift * omega / wave.omega

    omega, before, step = wave.omega, shift, FREQUENCY_STEP if shift < 0.0 else 1.0 / FREQUENCY_STEP
    if omega > fastest:  # a wave of two samples, which cannot be faster
        omega, before = fastest, excess(fastest) if shift < 0.0 else 0.0
    if before * shift <= 0.0:
        return wave
    while slowest < omega * step < fastest:
        after = excess(omega * step)
        if before * after <= 0.0 and abs(before - after) < math.pi:
            try:
                omega = float(brentq(excess, omega, omega * step, rtol=CYCLE_TOLERANCE))  # type: ignore[arg-type]
            except ValueError:  # the curve has branches, and the search has changed to another one
                omega *= step
            excess(omega)
            return loop.wave(math.exp(z), omega)
        omega, before = omega * step, after
    if step < 1.0:
        return loop.wave(math.exp(z), omega)
    amplitudes = np.geomspace(MIN_AMPLITUDE, MAX_AMPLITUDE, GRID_AMPLITUDES)
    return loop.wave(*min(_of_two_samples(loop, half, amplitudes), default=(math.exp(z), omega)))


def _of_two_samples(loop: Loop, fastest: float, amplitudes: np.ndarray) -> list[tuple[float, float]]:
    """Return amplitude and omega of the cycles of two samples. For them N L is real, so its magnitude decides."""
    from scipy.optimize import brentq

    response = loop.response(fastest).real

    def excess(z: float) -> float:
        product = loop.gain(math.exp(z), fastest).real * response
        return math.log(product) if product > 0.0 else -50.0

    places = np.log(amplitudes)
    sizes = [excess(z) for z in places]
    return [
        (math.exp(float(brentq(excess, low, high))), fastest)  # type: ignore[arg-type]
        for (low, a), (high, b) in itertools.pairwise(zip(places, sizes, strict=True))
        if a > 0.0 >= b
    ]


def _stable_cycles(loop: Loop, waves: list[Wave]) -> list[Wave]:
    """Return the stable cycles.

    A cycle is stable if a larger oscillation decays (Loeb's criterion) and the phase of L has not lost a whole turn
    since a slower cycle of that kind. A delay gives a row of such cycles, of which only the slowest is stable.
    """
    decaying = sorted((wave for wave in waves if _decays(loop, wave)), key=lambda wave: wave.omega)
    if len(decaying) < 2:
        return decaying
    omegas = np.geomspace(0.9 * decaying[0].omega, 1.1 * decaying[-1].omega, PHASE_POINTS)
    phases = np.unwrap([np.angle(loop.response(w * (1.0 - RESONANCE_DAMPING * 1j))) for w in omegas])
    turns = np.interp([wave.omega for wave in decaying], omegas, phases) / math.tau
    return [wave for k, wave in enumerate(decaying) if all(round(turns[k] - before) >= 0 for before in turns[:k])]


def _decays(loop: Loop, wave: Wave) -> bool:
    """Return whether an oscillation that is a little larger than the cycle decays."""
    if wave.omega >= math.pi / loop.scenario.control_period:
        return True  # two samples a period: the gain falls with the amplitude

    def product(amplitude: float, omega: float) -> complex:
        return complex(np.log(loop.gain(amplitude, omega) * loop.response(omega)))

    up, down = (product(wave.amplitude * (1 + d), wave.omega) for d in (STABILITY_STEP, -STABILITY_STEP))
    fast, slow = (product(wave.amplitude, wave.omega * (1 + d)) for d in (STABILITY_STEP, -STABILITY_STEP))
    return ((up - down) / (fast - slow)).imag < 0.0


def _with_harmonics(loop: Loop, wave: Wave) -> Wave:
    """Return the cycle whose e has the harmonics that the mechanism lets through; the given one if there is none."""
    from scipy.optimize import root

    if math.isnan(wave.third):
        return wave

    def excess(z: np.ndarray) -> list[float]:
        product = np.log(loop.wave(*np.exp(z)).gain * loop.response(math.exp(z[1])))
        return [product.real, product.imag]

    start = np.log([wave.amplitude, wave.omega])
    solved = root(excess, start, options={"xtol": CYCLE_TOLERANCE, "eps": DERIVATIVE_STEP})
    return loop.wave(*np.exp(solved.x)) if solved.success and np.abs(solved.x - start).max() < BRACKET_MARGIN else wave


def _prediction(loop: Loop, sine: Wave, assumptions: tuple[str, ...], ranges: bool) -> Chattering:
    """Return a limit cycle with its numbers; `sine` is the cycle in which e is a sine."""
    wave = _with_harmonics(loop, sine)
    response = loop.response(wave.omega)
    if not math.isnan(wave.third):
        passed = abs(loop.response(3.0 * wave.omega) / response)
        words = f"the mechanism answers the third harmonic with {100.0 * passed:.2g} % of its answer to the first"
        assumptions += (words,)
    coupling = loop.coupling(wave.omega)
    if coupling:
        words = f"other driven channels rest, though this command moves one of them {coupling:.2g} times as far"
        assumptions += (words,)
    if wave.drift > MAX_GAIN_DRIFT:
        assumptions += ("gains or memories of the law drift: the prediction is a snapshot",)
    sizes, omegas = [math.nan], [math.nan]
    if ranges:
        waves = [sine, *(_shifted_cycle(loop, sine, phase) for phase in loop.phases(sine.amplitude, sine.omega))]
        sizes = [one.s / sine.s * wave.s for one in waves]
        omegas = [one.omega / sine.omega * wave.omega for one in waves]
    fastest, nyquist = max(omegas) * FREQUENCY_FACTOR / math.tau, 0.5 / loop.scenario.control_period
    return Chattering(
        amplitude=wave.s,
        amplitude_x=wave.amplitude,
        amplitude_u=wave.u,
        frequency=wave.omega / math.tau,
        power=wave.rate**2 / 2.0,
        third_harmonic=wave.third,
        samples=math.tau / wave.omega / loop.scenario.control_period,
        amplitude_range=(min(sizes) / AMPLITUDE_FACTOR, max(sizes) * AMPLITUDE_FACTOR + loop.s_of_one_count),
        frequency_range=(min(omegas) / FREQUENCY_FACTOR / math.tau, min(fastest, nyquist)),
        coupling=coupling,
        gain=wave.gain,
        response=response,
        assumptions=assumptions,
    )


def _assumptions(loop: Loop) -> Iterator[str]:
    """Yield what the prediction assumes, and what a run has but the prediction leaves out."""
    scenario = loop.scenario
    yield "about rest at x = 0, without reference, disturbance and noise"
    if any(isinstance(part, RateLimit) for part in scenario.actuator):
        yield "the actuator's rate limit is not reached"
    if any(isinstance(part, Backlash) for part in scenario.actuator):
        yield "rotor and joint are free masses while the rotor crosses its play"
    if scenario.friction:
        yield "no dry friction"
    if loop.s_of_one_count:
        step = f"{loop.s_of_one_count:.2g} {scenario.plant.units[loop.channel]}/s"
        yield f"no rounding by the encoder: a count moves s by {step}, which hides smaller cycles"


def shared_assumptions(cycles: Sequence[Chattering]) -> list[str]:
    """Return the assumptions that all cycles have in common."""
    first, *others = cycles
    return [one for one in first.assumptions if all(one in other.assumptions for other in others)]


def save(
    scenarios: Sequence[Scenario],
    cycles: Sequence[Chattering],
    measured: Sequence[tuple[float, float]],
    changes: Sequence[StepChange],
    path: str | os.PathLike[str],
) -> Path:
    """Write predictions and measurements to a .json file. Return its path.

    Args:
      scenarios, cycles: the scenarios, and the predicted cycle of each.
      measured: amplitude of s in its unit and frequency in Hz, measured in a run of each scenario.
      changes: relative changes of these in a run with half the physics step.
      path: of the file.

    Raises:
      ScenarioError: the file cannot be written.
    """
    rows = [
        {"plant": one.plant.name, "law": one.law.name, "gains": dict(one.law.gains)}
        | {name: value for name, value in vars(cycle).items() if name not in ("gain", "response")}
        | {"uncertainty": cycle.uncertainty}
        | {"gain": [cycle.gain.real, cycle.gain.imag], "response": [cycle.response.real, cycle.response.imag]}
        | {"measured_amplitude": amplitude, "measured_frequency": frequency}
        | {"half_step_changes": vars(change), "marked": change.marked}
        for one, cycle, (amplitude, frequency), change in zip(scenarios, cycles, measured, changes, strict=True)
    ]
    return write_json(with_ending(path, ".json"), rows)
