"""Gains from a wanted amplitude: the largest gains whose chattering, at the upper end of its range,
stays below it.

All gains of a law follow from two numbers, its size q and its speed w. For the same mass, positions
become q times as large, times 1/w as large, and forces q w^2 times as large. A gain with the unit
F^a X^b T^c is multiplied by

    (q w^2)^a q^b w^-c.

So k1 and k2 of super-twisting are in the proportion of its theorem, k1 ~ sqrt(q), k2 ~ q. On a
linear mechanism the limit cycle of a law that is q times as large is q times as large, and has the
same frequency. A law that contains a number with a unit, such as the width 1 of tanh(s), has no
such symmetry. So the size is searched.
"""

import dataclasses
import functools
import math
import warnings
from collections.abc import Callable, Mapping

import numpy as np

from smc_mujoco.analysis import margins
from smc_mujoco.analysis.chattering import Chattering, predict
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.common.constraints import Positive, constrained
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, users_stacklevel
from smc_mujoco.common.progress import bar
from smc_mujoco.control import source
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.units import FORCE
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.conditions import DURATION
from smc_mujoco.simulation.scenario import Scenario

MAX_SIZE_RATIO = 1e3  # of a size to that of the original gains, and its inverse
SIZE_STEP = 2.0  # factor from one size to the next until the wanted one lies between two
RULE = "largest gains of a predicted amplitude or frequency"
SIZE_TOLERANCE = 1e-3  # relative: the search ends when the size is known so well
SPEEDS = tuple(10.0 ** (0.1 * k) for k in range(-10, 11))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Design:
    """Gains that were chosen by predicted chattering."""

    law: Component
    chattering: Chattering
    # largest constant one in runs of 10 s, see `smc.margins`; NaN if not even 0 is tolerated
    disturbance: float
    size: float  # q, relative to the given gains
    speed: float  # w, relative to the given gains


@constrained
def gains_for(
    law: Component | Template | str,
    plant: Plant | str,
    amplitude: Positive | None = None,
    frequency: Positive | None = None,
    channel: int = 0,
    **fields: object,
) -> Design:
    """Return the largest gains whose chattering stays below an amplitude, a frequency or both.

    The amplitude decides the size of the law, to 0.1 %: the largest at which `amplitude_range` ends
    below it, the cycle is no faster than the frequency, and no force among the gains exceeds u_max.
    A frequency also decides the speed, of 21 from a tenth to ten times that of the given gains: the
    one with the largest forces. Speeds whose cycle is too fast at size 1 do not count, and one
    between the 21 may allow more.

    Args:
      law: a law or its name. Its gains give the proportions.
      plant: a plant or its name.
      amplitude: largest amplitude of s, in its unit, at the upper end of its range.
      frequency: highest predicted frequency of the limit cycle, Hz. Default: the speed of the law
        stays.
      channel: index of a driven channel.
      fields: other fields of the Scenario, such as actuator, input_delay, control_period, u_max.

    Warns:
      ScenarioWarning: the law with these gains does not hold the plant.

    Raises:
      ScenarioError: neither amplitude nor frequency, a gain of unknown unit, no gains in the range
        of the search chatter so little, or those of the wanted amplitude oscillate faster than
        wanted.
    """
    base = Scenario(law=law, plant=plant, **fields)  # type: ignore[arg-type]
    if amplitude is None and frequency is None:
        raise ScenarioError(
            "gains_for needs a wanted amplitude, a frequency or both: give amplitude=1e-3"
        )
    if not base.law.uniform:
        raise ScenarioError(
            f"gains_for needs gains that all channels share, not {base.law}: give one number for "
            "each gain"
        )
    predictions = 0
    with bar(f"gains of {base.law.name} on {base.plant.name}") as progress_bar:

        def scaled(size: float, speed: float) -> Scenario:
            return dataclasses.replace(base, law=_scaled(base.law, size, speed))

        def cycle(size: float, speed: float) -> Chattering:
            nonlocal predictions
            progress_bar.advance(1.0)
            predictions += 1
            return predict(scaled(size, speed), channel)

        headroom = _force_headroom(base)
        speeds = {1.0: math.inf}
        if frequency is not None:
            speeds = _forces(lambda w: cycle(1.0, w), amplitude, frequency, headroom)
        size = 1.0
        speed = next(iter(speeds))
        if amplitude is not None:
            size, speed = _largest(
                cycle, speeds, amplitude, math.inf if frequency is None else frequency, headroom
            )
        chosen = scaled(size, speed)
        predicted = predict(chosen, channel)
        (tolerated,) = margins.margins_of(
            [dataclasses.replace(chosen, duration=DURATION)], ["disturbance"]
        )
    if math.isnan(tolerated.value):
        warnings.warn(
            f"{base.law.name} with these gains does not hold {base.plant.name}, even without "
            "a disturbance",
            ScenarioWarning,
            users_stacklevel(),
        )
    law = chosen.law.sourced(source.TUNED, source.Search(rule=RULE, evaluations=predictions))
    return Design(
        law=law, chattering=predicted, disturbance=tolerated.value, size=size, speed=speed
    )


def _forces(
    cycle: Callable[[float], Chattering], amplitude: float | None, frequency: float, headroom: float
) -> dict[float, float]:
    """Return speed -> the forces that it allows, largest first, of SPEEDS whose frequency is at
    most the wanted one.

    The frequency is that of size 1, and is not monotone in the speed. A speed without a limit cycle
    counts only below the first speed with one: above it, the law has become too fast for the
    actuator.
    """
    speeds = [speed for speed in SPEEDS if speed**2 <= headroom * (1.0 + SIZE_TOLERANCE)]
    if not speeds:
        raise ScenarioError(
            f"forces among the gains are {1.0 / headroom:.3g} times what u_max allows: give "
            "smaller gains, or a larger u_max"
        )
    cycles = {speed: cycle(speed) for speed in speeds}
    first = min((speed for speed, one in cycles.items() if one), default=math.inf)
    slow = {
        speed: one
        for speed, one in cycles.items()
        if one.frequency <= frequency or (not one and speed < first)
    }
    if not slow:
        lowest = min(one.frequency for one in cycles.values() if one)
        raise ScenarioError(
            f"frequency is {frequency:g}, and the law oscillates at {lowest:.3g} Hz at least: give "
            "a larger one"
        )

    def force(speed: float) -> float:
        size = 1.0
        if amplitude is not None:
            size = MAX_SIZE_RATIO
            if slow[speed]:
                size = min(amplitude / slow[speed].amplitude_range[1], size)
        return min(size * speed**2, headroom)

    ordered = sorted(slow, key=lambda speed: (force(speed), speed), reverse=True)
    return {speed: force(speed) for speed in ordered}


def _largest(
    cycle: Callable[[float, float], Chattering],
    speeds: Mapping[float, float],
    amplitude: float,
    frequency: float,
    headroom: float,
) -> tuple[float, float]:
    """Return the size and the speed with the largest forces within both bounds, given speeds as
    `_forces` does.

    The forces of a speed are known only with its size, so speeds are tried while they may allow
    larger ones.
    """
    best = (0.0, 0.0)
    largest = 0.0
    refusals = []

    def within(size: float, speed: float) -> float:
        one = cycle(size, speed)
        if one.frequency > frequency:
            return math.inf
        return one.amplitude_range[1]

    for speed, allowed in speeds.items():
        if allowed <= largest:
            break
        try:
            size = _largest_size(
                functools.partial(within, speed=speed), amplitude, headroom / speed**2
            )
        except ScenarioError as error:
            refusals.append(error)
            continue
        if size * speed**2 > largest:
            best = (size, speed)
            largest = size * speed**2
    if not largest:
        raise refusals[0]
    return best


def _scaled(law: Component, size: float, speed: float) -> Component:
    scales = {"F": size * speed**2, "X": size, "T": 1.0 / speed}
    gains = {}
    for name, gain in law.gains.items():
        gains[name] = gain * search_space.unit_size(law, name, scales)
    return dataclasses.replace(law, gains=gains)


def _force_headroom(base: Scenario) -> float:
    """Return the factor by which the forces among the gains can grow, until the first reaches the
    actuator's limit.
    """
    law = base.law
    plant = base.plant
    u_max = min(base.limits)
    rest = np.zeros(plant.n)
    p = plant.values({})
    with_model = base.resolved.model != "none"
    accelerations = (u * abs(plant.nominal(rest, rest, i, p)[1]) for i, u in enumerate(base.limits))
    force = min(accelerations) if with_model else u_max
    limits = {name: force for name in law.gains if search_space.unit(law, name) == FORCE}
    # the force k / b of a gain k that is divided by b
    declared = law.template.gains if law.template else {}
    for name, gain in declared.items():
        if gain.over is not None:
            limits[name] = u_max * law.gains[gain.over]
    sizes = []
    for name, gain in law.gains.items():
        if name in limits and 0.0 < abs(gain) < math.inf:
            sizes.append(limits[name] / abs(gain))
    return min(sizes, default=math.inf)


def _largest_size(predicted: Callable[[float], float], wanted: float, limit: float) -> float:
    """Return the largest size up to `limit` with at most the wanted amplitude; a lost cycle counts
    as too large.
    """
    limit = min(limit, MAX_SIZE_RATIO)
    low = 0.0
    high = math.inf
    oscillates = False

    def amplitude_at(size: float) -> float:
        nonlocal low, high, oscillates
        amplitude = predicted(size)
        if amplitude > wanted or (oscillates and math.isnan(amplitude)):
            high = size
        else:
            low = size
            oscillates = not math.isnan(amplitude)
        return amplitude

    amplitude = amplitude_at(min(1.0, limit))
    guess = min(1.0, limit) * wanted / amplitude
    for size in (guess, guess * (1.0 + SIZE_TOLERANCE)):
        if low < size < min(high, limit * (1.0 + SIZE_TOLERANCE)):
            amplitude_at(min(size, limit))
    while not low:
        if high < 1.0 / MAX_SIZE_RATIO:
            raise ScenarioError(
                f"even gains {MAX_SIZE_RATIO:g} times smaller oscillate by more than {wanted:g} or "
                "too fast: give a larger amplitude or frequency"
            )
        amplitude_at(high / SIZE_STEP)
    while low < limit and high == math.inf:
        amplitude_at(min(low * SIZE_STEP, limit))
    while min(high, limit) > low * (1.0 + SIZE_TOLERANCE):
        amplitude_at(math.sqrt(low * high))
    return low
