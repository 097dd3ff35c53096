"""Chattering, predicted before it is run: the limit cycle of a scenario by harmonic balance.

A limit cycle e = a sin(omega t) solves N(a, omega) L(j omega) = 1. N is the first harmonic of what
the law returns, and L the answer of the linearised mechanism (`harmonics`), without any
integrator's error. Then the equation is solved again with the other harmonics of e, which follow
from those of u. The solution is exact if the cycle is not locked to the control samples.
`uncertainty` says how much such locking may change it.

The |N| of a law with a dead zone first rises with the amplitude, which gives two solutions. By
Loeb's criterion the inner one is unstable: a run that starts within it comes to rest, and one that
starts outside ends in the outer one. `threshold_x` is the amplitude of the inner one. Sources: A.
Gelb & W. E. Vander Velde, Multiple-Input Describing Functions, 1968; I. Boiko, Discontinuous
Control Systems, 2009; U. Perez-Ventura & L. Fridman, arXiv 1705.09711, 2017.
"""

import cmath
import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from smc_mujoco.chattering.harmonics import Loop, Wave
from smc_mujoco.common.aliases import Array, Names, Pair
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, whole
from smc_mujoco.control.component import Component, Template
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.drives import RateLimit
from smc_mujoco.mechanisms.hardware.position_servo import PositionServo
from smc_mujoco.mechanisms.named import jointed
from smc_mujoco.simulation.scenario import Scenario

MIN_FREQUENCY = 0.5  # Hz: slower oscillations do not count as chattering
# cells of the coarse grid on which cycles are sought: chosen
GRID_FREQUENCIES = 59
GRID_AMPLITUDES = 35
# parts of a coarse cell's sides: a cell of the finest grid is 11 % in amplitude, about 1.5 % in
# frequency
CUTS = 8
# of a cell's range of N L, by which N L may be outside that of the corners: chosen
CELL_MARGIN = 0.5
# samples of a period on the grid; not whole, so that they move from period to period; chosen
COARSE_SAMPLES = 60.618
MAX_OTHER_CYCLES = 3  # stable ones beside the predicted; more are artefacts of the sampling: chosen
COARSE_NOISE = 0.1  # error of the log of N L with few samples a period: chosen
CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])  # of a cell, in order
MIN_AMPLITUDE, MAX_AMPLITUDE = 1e-12, 3.0  # rad or m, of the error
# of the logs of amplitude and omega, below which two cycles are one: chosen
SAME_CYCLE_TOLERANCE = 0.02
# of these logs, from a cell to its cycle, or from that to the cycle with harmonics: chosen
MAX_SHIFT = 1.0
# of the log of N L at a cycle: the places of the samples make N jump; chosen
BALANCE_TOLERANCE = 0.01
# of half the sampling frequency: runs lock faster waves to two samples a period
MAX_NYQUIST_SHARE = 2.0 / 3.0
SMALLEST = 1e-300  # for the log of 0
MIN_GAIN_GROWTH = 3.0  # of a law that switches, from an amplitude to a thousandth of it: chosen
CYCLE_TOLERANCE = 1e-4  # of the logs of amplitude and omega of a cycle: the last step of the search
# of the logs of amplitude and omega: smaller ones see jumps of the gain by the samples; chosen
DERIVATIVE_STEP = 1e-3
ROOT_OPTIONS = {"xtol": CYCLE_TOLERANCE, "eps": DERIVATIVE_STEP}
STABILITY_STEP = 0.1  # relative, in Loeb's criterion: smaller ones see these jumps too; chosen
# Factors on the ends of ranges. With them the ranges have the truth in 95 % of random loops:
# benchmarks/chattering.py.
AMPLITUDE_FACTOR = 1.01
FREQUENCY_FACTOR = 1.01
MAX_GAIN_DRIFT = 0.05  # relative: a law whose gain drifts more gets a remark; chosen
# imaginary part of frequencies over the real one, so that resonances have a width; chosen
RESONANCE_DAMPING = 0.01
PHASE_STEP = 0.005  # of the log of omega, along the curve of phase over frequency; chosen

Balance = tuple[float, float]  # amplitude of e, rad or m, and omega, rad/s, where N L = 1
# the lowest and the highest logs of amplitude and omega, (2,) each
Cell = tuple[np.ndarray, np.ndarray]


@keyword_dataclass
class Chattering:
    """A predicted limit cycle of one channel.

    If none is predicted, its numbers are NaN; the ranges may be known.

    The two ranges are those of cycles that are locked to the samples, see `Loop.phases`. They are
    widened by factors that were calibrated by exact integration: 95 % of random loops are within
    them. The largest amplitude includes the change of s by one count of an encoder. If the balance
    has no solution but the law switches, a locked cycle is possible, and these are its ranges.
    """

    amplitude: float = math.nan  # of the sliding variable s, half its range, in its unit
    amplitude_x: float = math.nan  # of the position, rad or m
    amplitude_u: float = math.nan  # of the command, half its range, in the unit of u
    frequency: float = math.nan  # Hz
    # mean square of s', (amplitude omega)^2 / 2 with the first harmonic of s
    power: float = math.nan
    # amplitude of x, rad or m, of the largest unstable cycle within this one; 0 without one
    threshold_x: float = 0.0
    # of s over its first; if large, the prediction is rough; NaN for two samples
    third_harmonic: float = math.nan
    amplitude_range: Pair = (math.nan, math.nan)
    frequency_range: Pair = (math.nan, math.nan)  # Hz
    # amplitude of another driven channel's x over amplitude_x; if large, prediction fails
    coupling: float = math.nan
    gain: complex = complex(math.nan)  # N at the cycle
    response: complex = complex(math.nan)  # L at the cycle
    assumptions: Names = ()  # what was left out or is doubtful

    def __bool__(self) -> bool:
        return not math.isnan(self.frequency)

    def __str__(self) -> str:
        if self:
            said = (
                f"Limit cycle predicted: {self.frequency:.3g} Hz, with amplitudes "
                f"{self.amplitude:.3g} of s, {self.amplitude_x:.3g} of x and "
                f"{self.amplitude_u:.3g} of u."
            )
        else:
            said = "No limit cycle predicted."
        if self.assumptions:
            said += f" Note: {'; '.join(self.assumptions)}."
        return said

    @property
    def uncertainty(self) -> float:
        """Largest relative distance of an end of the ranges from what is predicted; inf where only
        ranges are known.
        """
        if not self:
            if math.isnan(self.amplitude_range[1]):
                return math.nan
            return math.inf
        ranges = np.array([self.amplitude_range, self.frequency_range])
        values = np.array([[self.amplitude], [self.frequency]])
        return float(np.abs(ranges / values - 1.0).max())


def chattering(
    law: Scenario | Component | Template | str, channel: int = 0, **fields: object
) -> Chattering:
    """Predict the limit cycle about rest of one driven channel.

        law = smc.law("super_twisting")
        print(smc.design.chattering(law, plant="duffing", input_delay=2e-3))

    Args:
      law: a Scenario; or a law, with the other fields of a Scenario by name.
      channel: index of a driven channel; the others are at rest.
      fields: of the Scenario, such as plant, actuator, input_delay, control_period.

    Returns:
      The stable limit cycle; its numbers are NaN, and it is false, if none is predicted. If there
      are several, the fastest, and of equally fast ones the smallest. `assumptions` says if there
      are others.

    Raises:
      ScenarioError: a law that does not compile, a channel that is not driven, or as Scenario.
    """
    if isinstance(law, Scenario) and fields:
        raise ScenarioError(f"a Scenario and {', '.join(fields)}: give one of them")
    return predict(law if isinstance(law, Scenario) else Scenario(law=law, **fields), channel)  # type: ignore[arg-type]


def predict(scenario: Scenario, channel: int = 0, ranges: bool = True) -> Chattering:
    """Return what `chattering` returns for a scenario; without the ranges of a predicted cycle it
    is faster.
    """
    jointed(scenario.plant, "chattering")
    channel = whole("channel", channel, 0, scenario.plant.driven - 1)
    loop = Loop(scenario, channel)
    stable, unstable = cycles(loop)
    assumptions = tuple(_assumptions(loop))
    if not stable:
        if switches(loop):
            return _locked_ranges(loop, assumptions)
        return Chattering(assumptions=assumptions)
    fastest = max(omega for _, omega in stable)
    close = []
    for cycle in stable:
        if cycle[1] > fastest / (1.0 + SAME_CYCLE_TOLERANCE):
            close.append(cycle)
    balance = min(close)
    if len(stable) > MAX_OTHER_CYCLES + 1:
        assumptions += ("N L is about 1 at many frequencies: do not trust the prediction",)
    elif len(stable) > 1:
        assumptions += ("other starts may end in another cycle",)
    threshold = _threshold(loop, balance, unstable)
    return _prediction(loop, balance, threshold, assumptions, ranges)


def _threshold(loop: Loop, one: Balance, unstable: Sequence[Balance]) -> float:
    """Return the amplitude of x of the largest unstable cycle within a stable one in the same turn
    of L, or 0.
    """
    smaller = []
    for balance in unstable:
        if balance[0] < one[0]:
            smaller.append(balance)
    *turns, turn = _turns(loop, [*smaller, one])
    threshold = 0.0
    for (amplitude, _), balance in zip(smaller, turns, strict=True):
        if round(balance - turn) == 0:
            threshold = max(threshold, amplitude)
    return threshold


def switches(loop: Loop) -> bool:
    """Return whether a law switches: whether its gain grows without bound towards small
    amplitudes.
    """
    omega = 0.1 * math.pi / loop.scenario.control_period
    smaller = abs(loop.gain(MIN_AMPLITUDE, omega, COARSE_SAMPLES))
    small = abs(loop.gain(1e3 * MIN_AMPLITUDE, omega, COARSE_SAMPLES))
    return smaller > MIN_GAIN_GROWTH * small


def _locked_ranges(loop: Loop, assumptions: Names) -> Chattering:
    """Return the ranges of a cycle of a law that switches, locked to the samples.

    It then switches at most half a control period later than on average: the cycle with that delay
    more is a bound.
    """
    control_period = loop.scenario.control_period
    later = loop.later(0.5 * control_period)
    stable, _ = cycles(later)
    if not stable:
        return Chattering(assumptions=assumptions)
    fastest = max(stable, key=lambda one: one[1])
    wave = later.wave(*fastest)
    assumptions += ("no solution, but a cycle locked to the samples is possible",)
    return Chattering(
        amplitude_range=(0.0, AMPLITUDE_FACTOR * wave.s + loop.s_of_one_count),
        frequency_range=(wave.omega / FREQUENCY_FACTOR / math.tau, 0.5 / control_period),
        assumptions=assumptions,
    )


def cycles(loop: Loop) -> tuple[list[Balance], list[Balance]]:
    """Return the stable and the other solutions of N L = 1; two in one finest cell may both be
    missed.
    """
    balances: list[Balance] = []
    for cells in _starts(loop):
        balance = _first_balance(loop, cells)
        if balance and all(
            np.abs(np.log(balance) - np.log(earlier)).max() > SAME_CYCLE_TOLERANCE
            for earlier in balances
        ):
            balances.append(balance)
    stable = _stable(loop, balances) or _of_two_samples(loop)
    return stable, [balance for balance in balances if balance not in stable]


def _first_balance(loop: Loop, cells: Iterable[tuple]) -> Balance | None:
    """Return the balance of the first cell that has one."""
    for cell in cells:
        if balance := _balanced(loop, *cell):
            return balance
    return None


def _starts(loop: Loop) -> Iterator[list[Cell]]:
    """Yield groups of neighbouring cells, of which one has a solution: their images under N L wind
    around 1.

    Cells in which N L may be 1 are cut into four, down to the finest grid. With few samples N is
    rough: two neighbours may wind without a solution, one to the left and the other to the right.
    """
    from scipy.ndimage import label

    fastest = MAX_NYQUIST_SHARE * math.pi / loop.scenario.control_period
    start, end = np.log([[math.tau * MIN_FREQUENCY, MIN_AMPLITUDE], [fastest, MAX_AMPLITUDE]])
    count = np.array([GRID_FREQUENCIES, GRID_AMPLITUDES])
    step = (end - start) / (CUTS * count)
    slow, low = start.tolist()
    dw, dz = step.tolist()

    @functools.cache
    def product(i: int, k: int) -> complex:
        omega = math.exp(slow + i * dw)
        amplitude = math.exp(low + k * dz)
        gain = loop.gain(amplitude, omega, COARSE_SAMPLES)
        return gain * loop.response(omega)

    def at_corners(cells: Array, side: int) -> Array:
        corners = cells[:, None] + side * CORNERS
        places = corners.reshape(-1, 2).tolist()
        products = np.array([product(i, k) for i, k in places])
        return products.reshape(-1, len(CORNERS))

    # each by the indices of its lowest omega and amplitude
    cells = CUTS * np.argwhere(np.ones(count))
    side = CUTS
    while side > 1:
        cells = cells[_may_balance(at_corners(cells, side), side * step)]
        side //= 2
        quarters = cells[:, None] + side * CORNERS
        cells = quarters.reshape(-1, 2)
    winding = np.zeros(CUTS * count)
    around = at_corners(cells, 1) - 1.0
    ahead = np.roll(around, -1, axis=1)
    angles = np.angle(ahead * around.conj())
    wound = angles.sum(axis=1) / math.tau
    winding[tuple(cells.T)] = np.round(wound)  # -1, 0 or 1 times around 1
    neighbours, groups = label(winding, np.ones((3, 3)))  # type: ignore[misc]
    for group in range(1, groups + 1):
        cells = np.argwhere(neighbours == group)
        turns = winding[tuple(cells.T)]
        for sign in (1.0, -1.0):
            if sign * turns.sum() >= 0.0:
                bounds = []
                for cell in cells[turns == sign]:
                    low = start + step * cell
                    high = start + step * (cell + 1)
                    bounds.append((low[::-1], high[::-1]))
                yield bounds


def _may_balance(products: Array, sides: Array) -> Array:
    """Return whether N L may be 1 in cells, (K,), from its values at their corners, (K, 4), with a
    margin.
    """
    magnitudes = np.maximum(np.abs(products), SMALLEST)
    sizes = np.log(magnitudes)
    spans = np.ptp(sizes, axis=1)
    margins = CELL_MARGIN * np.maximum(spans, max(sides[1], COARSE_NOISE))
    below = sizes.min(axis=1) <= margins
    above = sizes.max(axis=1) >= -margins
    near = below & above
    strongest = np.abs(products).argmax(axis=1)[:, None]
    largest = np.take_along_axis(products, strongest, axis=1)
    turned = products * largest.conj()
    relative = np.where(products == 0.0, 1.0, turned)
    phases = np.angle(largest) + np.angle(relative)
    phase_spans = np.ptp(phases, axis=1)
    margins = CELL_MARGIN * np.maximum(phase_spans, max(sides[0], COARSE_NOISE))
    lowest = phases.min(axis=1) - margins
    highest = phases.max(axis=1) + margins
    next_turn = np.ceil(lowest / math.tau) * math.tau
    return near & (next_turn <= highest)


def _balanced(loop: Loop, low: Array, high: Array) -> Balance | None:
    """Return the balance in a cell or near it, with all samples; None where N jumps across it."""
    from scipy.optimize import root

    least = low - MAX_SHIFT
    largest = high + MAX_SHIFT
    nyquist = math.pi / loop.scenario.control_period
    largest[1] = min(largest[1], math.log(nyquist))

    def excess(z: Array) -> Array:
        inside = np.clip(z, least, largest)
        amplitude, omega = np.exp(inside).tolist()
        product = cmath.log(
            loop.gain(amplitude, omega) * loop.response(omega) or math.exp(-MAX_SHIFT)
        )
        parts = np.array([product.real, product.imag])
        return parts + (inside - z)

    def solved() -> Iterator[Array]:
        yield root(excess, 0.5 * (low + high), options=ROOT_OPTIONS).x
        yield _bisected(excess, low, high)

    for z in solved():
        clipped = np.clip(z, least, largest)
        within = (z == clipped).all()
        if within and np.abs(excess(z)).max() < BALANCE_TOLERANCE:
            amplitude, omega = np.exp(z).tolist()
            return amplitude, omega
    return None


def _bisected(excess: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Return where log |N L| and arg N L are 0, in a cell or beside it: solved for amplitude and
    omega in turn.
    """
    from scipy.optimize import brentq

    z = 0.5 * (low + high)
    for part in (0, 1, 0, 1, 0):
        side = high[part] - low[part]

        def along(at: float, part: int = part) -> float:
            z[part] = at
            return float(excess(z)[part])

        ends = low[part] - side, high[part] + side
        if along(ends[0]) * along(ends[1]) > 0.0:
            break
        z[part] = brentq(along, *ends)  # type: ignore[arg-type]
    return z


def _nearest_cycle(loop: Loop, wave: Wave, shift: float) -> Wave | None:
    """Return the cycle nearest to `wave` of a law that acts `shift` rad earlier, or later if
    negative, or None.
    """
    later = loop.later(-shift / wave.omega)
    stable, _ = cycles(later)
    sign = math.copysign(1.0, shift)
    beside = []
    for cycle in stable:
        ratio = math.log(cycle[1] / wave.omega)
        if sign * ratio >= -SAME_CYCLE_TOLERANCE:
            beside.append(cycle)
    if not beside and shift > 0.0:
        beside = _of_two_samples(later)
    nearest = min(beside, key=lambda one: abs(one[1] - wave.omega), default=None)
    return later.wave(*nearest) if nearest else None


def _of_two_samples(loop: Loop) -> list[Balance]:
    """Return the stable cycles of two samples a period.

    For them N L is real, so its magnitude decides.
    """
    from scipy.optimize import brentq

    fastest = math.pi / loop.scenario.control_period
    response = loop.response(fastest).real

    def excess(z: float) -> float:
        product = loop.gain(math.exp(z), fastest).real * response
        return math.log(product) if product > 0.0 else -50.0

    places = np.linspace(math.log(MIN_AMPLITUDE), math.log(MAX_AMPLITUDE), GRID_AMPLITUDES + 1)
    balances = []
    for low, high in itertools.pairwise(places):
        if excess(low) > 0.0 >= excess(high):
            amplitude = math.exp(float(brentq(excess, low, high)))  # type: ignore[arg-type]
            balances.append((amplitude, fastest))
    return balances


def _stable(loop: Loop, balances: Sequence[Balance]) -> list[Balance]:
    """Return the cycles at which a larger oscillation decays (Loeb's criterion), but not a turn of
    L beyond a slower.

    A delay gives a row of such cycles, with a turn of phase between them, of which only the slowest
    is stable.
    """
    decaying = []
    for balance in balances:
        if _decays(loop, *balance):
            decaying.append(balance)
    decaying.sort(key=lambda balance: balance[1])
    turns = _turns(loop, decaying)
    stable = []
    for k, cycle in enumerate(decaying):
        if all(round(turns[k] - before) >= 0 for before in turns[:k]):
            stable.append(cycle)
    return stable


def _decays(loop: Loop, amplitude: float, omega: float) -> bool:
    def product(a: float, w: float) -> complex:
        gain = loop.gain(a, w)
        return cmath.log(gain * loop.response(w) or SMALLEST)

    up = product(amplitude * (1 + STABILITY_STEP), omega)
    down = product(amplitude * (1 - STABILITY_STEP), omega)
    fast = product(amplitude, omega * (1 + STABILITY_STEP))
    slow = product(amplitude, omega * (1 - STABILITY_STEP))
    across = (fast - slow).conjugate()
    return ((up - down) * across).imag < 0.0


def _turns(loop: Loop, balances: Sequence[Balance]) -> Array:
    """Return the phase of L at cycles, unwrapped over frequency, in turns."""
    omegas = [omega for _, omega in balances]
    if len(omegas) < 2:
        return np.zeros(len(omegas))
    slowest = math.log(0.9 * min(omegas))
    fastest = math.log(1.1 * max(omegas))
    between = np.exp(np.arange(slowest, fastest, PHASE_STEP))
    phases = []
    for omega in between:
        response = loop.response(omega * (1.0 - RESONANCE_DAMPING * 1j))
        phases.append(np.angle(response))
    return np.interp(omegas, between, np.unwrap(phases)) / math.tau


def _with_harmonics(loop: Loop, wave: Wave) -> Wave:
    """Return the cycle whose e has the harmonics that the mechanism lets through; the given one if
    there is none.
    """
    from scipy.optimize import root

    if math.isnan(wave.third):
        return wave

    def excess(z: Array) -> list[float]:
        gain = loop.wave(*np.exp(z)).gain
        response = loop.response(math.exp(z[1]))
        product = np.log(gain * response)
        return [product.real, product.imag]

    start = np.log([wave.amplitude, wave.omega])
    solved = root(excess, start, options=ROOT_OPTIONS)
    moved = np.abs(solved.x - start).max()
    near = solved.success and moved < MAX_SHIFT
    if near:
        return loop.wave(*np.exp(solved.x).tolist())
    return wave


def _prediction(
    loop: Loop, balance: Balance, threshold: float, assumptions: Names, ranges: bool
) -> Chattering:
    """Return a limit cycle with its numbers; `balance` is the cycle in which e is a sine."""
    sine = loop.wave(*balance)
    wave = _with_harmonics(loop, sine)
    response = loop.response(wave.omega)
    coupling = loop.coupling(wave.omega)
    if coupling:
        assumptions += ("other driven channels at rest",)
    if threshold:
        assumptions += ("x beyond threshold_x",)
    if wave.drift > MAX_GAIN_DRIFT:
        assumptions += ("the gain of the law drifts",)
    sizes = [math.nan]
    omegas = [math.nan]
    if ranges:
        after, before = loop.phases(*balance)
        later = _nearest_cycle(loop, sine, after)
        earlier = _nearest_cycle(loop, sine, before)
        sizes = []
        omegas = []
        for locked in (sine, later, earlier):
            if locked:
                sizes.append(locked.s / sine.s * wave.s)
                omegas.append(locked.omega / sine.omega * wave.omega)
        if earlier is None:
            sizes.append(0.0)
            omegas.append(math.inf)
    fastest = max(omegas) * FREQUENCY_FACTOR / math.tau
    nyquist = 0.5 / loop.scenario.control_period
    lowest = min(omegas) / FREQUENCY_FACTOR / math.tau
    return Chattering(
        amplitude=wave.s,
        amplitude_x=wave.amplitude,
        amplitude_u=wave.u,
        frequency=wave.omega / math.tau,
        power=wave.rate**2 / 2.0,
        threshold_x=threshold,
        third_harmonic=wave.third,
        amplitude_range=(
            min(sizes) / AMPLITUDE_FACTOR,
            max(sizes) * AMPLITUDE_FACTOR + loop.s_of_one_count,
        ),
        frequency_range=(lowest, min(fastest, nyquist)),
        coupling=coupling,
        gain=wave.gain,
        response=response,
        assumptions=assumptions,
    )


def _assumptions(loop: Loop) -> Iterator[str]:
    """Yield what the prediction leaves out of a scenario."""
    scenario = loop.scenario
    yield "at rest at x = 0"
    yield "no reference, disturbance or noise"
    if any(isinstance(part, RateLimit) for part in scenario.actuator):
        yield "no rate limit"
    if any(isinstance(part, PositionServo) and part.stall for part in scenario.actuator):
        yield "no forcerange"
    if any(isinstance(part, Backlash) for part in scenario.actuator):
        yield "rotor and joint free in the play"
    if scenario.friction:
        yield "no dry friction"
    if loop.s_of_one_count:
        yield "no rounding by the encoder"
