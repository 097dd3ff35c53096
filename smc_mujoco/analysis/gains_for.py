"""Gains from a wanted amplitude: the largest gains whose chattering stays below it, at the upper end of its range.

    design = smc.gains_for("super_twisting", "duffing", amplitude=1e-3, actuator=smc.Lag(0.01))
    design.law, design.chattering.frequency, design.disturbance

All gains of a law follow from two numbers, its size q and its speed w. For the same mass, positions become q times as
large, times 1/w as large, and forces q w^2 times as large. A gain with the unit F^a X^b T^c is multiplied by

    (q w^2)^a q^b w^-c.

Super-twisting has so k1 and k2 in the proportion of its theorem, k1 ~ sqrt(q), k2 ~ q. On a linear mechanism the limit
cycle of a law that is q times as large is q times as large and has the same frequency. A law that contains a number
with a unit, such as the width 1 of tanh(s), has no such symmetry, so that the size is searched.
"""

import dataclasses
import math
import warnings
from collections.abc import Callable

import numpy as np

from smc_mujoco.analysis import margins
from smc_mujoco.analysis.chattering import Chattering, chattering, predict
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, number, users_frame
from smc_mujoco.common.progress import bar
from smc_mujoco.control import source
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.units import FORCE
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.conditions import DURATION
from smc_mujoco.simulation.scenario import Scenario

RANGE = 1e3  # of size: at most so many times the law's own, and at least the inverse
STEP = 2.0  # from one size to the next until the wanted one lies between
RULE = "largest gains of a predicted amplitude or frequency"
CLOSE = 1e-3  # relative: the search ends when the size is known so well
SPEEDS = tuple(10.0 ** (0.1 * k) for k in range(-10, 11))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Design:
    """Gains that were chosen by predicted chattering.

    Attributes:
      law: the law with these gains.
      chattering: predicted for it.
      disturbance: the largest constant force that it tolerates, N m or N, in runs of 10 s: see `smc.margins`. NaN if it
        does not hold the plant even without one.
      size, speed: q and w, over the gains that were given.
    """

    law: Component
    chattering: Chattering
    disturbance: float
    size: float
    speed: float


def gains_for(
    law: Component | Template | str,
    plant: Plant | str,
    amplitude: float | None = None,
    frequency: float | None = None,
    channel: int = 0,
    **fields: object,
) -> Design:
    """Return the largest gains whose chattering stays below an amplitude, a frequency or both.

    The amplitude decides the size of the law: the upper end of `amplitude_range` is the wanted one. A frequency decides
    its speed, too: the one of 21 speeds, from a tenth of its own to ten times that, that allows the largest forces.
    Forces among the gains stay at most u_max.

    Args:
      law: a law or its name. Its gains give the proportions.
      plant: a plant or its name.
      amplitude: largest amplitude of s, in its unit, at the upper end of its range.
      frequency: highest predicted frequency of the limit cycle, Hz. Default: the speed of the law stays.
      channel: index of a driven channel.
      fields: other fields of the Scenario, such as actuator, input_delay, control_period, u_max.

    Warns:
      ScenarioWarning: the law with these gains does not hold the plant.

    Raises:
      ScenarioError: neither amplitude nor frequency, a gain of unknown unit, or no gains in the range of the search
        chatter so little.
    """
    return design(Scenario(law=law, plant=plant, **fields), amplitude, frequency, channel)  # type: ignore[arg-type]


def design(base: Scenario, amplitude: float | None, frequency: float | None = None, channel: int = 0) -> Design:
    """Return the largest gains for the law of a scenario. Arguments and errors are those of `gains_for`."""
    if amplitude is None and frequency is None:
        raise ScenarioError("gains_for needs a wanted amplitude, a frequency or both: give amplitude=1e-3")
    if not base.law.uniform:
        raise ScenarioError(
            f"gains_for needs gains that all channels share, not {base.law}: give one number for each gain"
        )
    for name, value in (("amplitude", amplitude), ("frequency", frequency)):
        if value is not None:
            number(name, value, above=0.0)
    tried: list[tuple[float, float]] = []
    with bar(f"gains of {base.law.name} on {base.plant.name}") as drawn:

        def scaled(size: float, speed: float) -> Scenario:
            return dataclasses.replace(base, law=_scaled(base.law, size, speed))

        def cycle(size: float, speed: float) -> Chattering:
            drawn.advance(1.0)
            tried.append((size, speed))
            return predict(scaled(size, speed), channel)

        strength = _strength(base)
        speed = 1.0 if frequency is None else _speed(lambda w: cycle(1.0, w), amplitude, frequency, strength)
        size = 1.0
        if amplitude is not None:
            size = _largest(lambda q: cycle(q, speed).amplitude_range[1], amplitude, strength / speed**2)
        chosen = scaled(size, speed)
        predicted = chattering(chosen, channel)
        if frequency is not None and predicted.frequency > frequency:
            raise ScenarioError(
                f"{base.law.name} of amplitude {amplitude:g} oscillates at {predicted.frequency:.3g} Hz, above the "
                f"wanted {frequency:g}: give a larger frequency, or another amplitude"
            )
        (tolerated,) = margins.of([dataclasses.replace(chosen, duration=DURATION)], ["disturbance"])
    if math.isnan(tolerated.value):
        warnings.warn(
            f"{base.law.name} with these gains does not hold {base.plant.name}, even without a disturbance",
            ScenarioWarning,
            users_frame(),
        )
    law = chosen.law.sourced(source.TUNED, source.Search(rule=RULE, evaluations=len(tried), converged=True))
    return Design(law=law, chattering=predicted, disturbance=tolerated.value, size=size, speed=speed)


def _speed(cycle: Callable[[float], Chattering], amplitude: float | None, frequency: float, strength: float) -> float:
    """Return the speed that allows the largest forces, of SPEEDS whose predicted frequency is at most the wanted one.

    The frequency is taken for size 1. It does not depend on the size on a linear mechanism, and is not monotone in the
    speed. If a limit cycle is lost on the way up, the law has become too fast for the actuator: such speeds are out.
    """
    speeds = [speed for speed in SPEEDS if speed**2 <= strength * (1.0 + CLOSE)]
    if not speeds:
        raise ScenarioError(
            f"forces among the gains are {1.0 / strength:.3g} times what u_max allows, and the search makes them "
            f"at most {SPEEDS[0] ** -2:g} times smaller: give smaller gains, or a larger u_max"
        )
    cycles = {speed: cycle(speed) for speed in speeds}
    first = min((speed for speed, one in cycles.items() if one), default=math.inf)
    slow = {speed: one for speed, one in cycles.items() if one.frequency <= frequency or (not one and speed < first)}
    if not slow:
        least = min(one.frequency for one in cycles.values() if one)
        raise ScenarioError(
            f"frequency is {frequency:g}, and the law oscillates at {least:.3g} Hz at least, at whatever speed: "
            "give a larger one"
        )

    def force(speed: float) -> float:
        allowed = math.inf if amplitude is None or not slow[speed] else amplitude / slow[speed].amplitude_range[1]
        size = 1.0 if amplitude is None else min(allowed, RANGE)
        return min(size * speed**2, strength)

    return max(slow, key=lambda speed: (force(speed), speed))


def _scaled(law: Component, size: float, speed: float) -> Component:
    """Return the law with its size and its speed multiplied; gains that tuning holds stay."""
    scales = {"F": size * speed**2, "X": size, "T": 1.0 / speed}
    gains = {name: gain * search_space.size(law, name, scales) for name, gain in law.gains.items()}
    return dataclasses.replace(law, gains=gains)


def _strength(base: Scenario) -> float:
    """Return the factor by which the forces among the gains can grow, until the first reaches the actuator's limit."""
    law, plant, u_max = base.law, base.plant, min(base.limits)
    rest, p, with_model = np.zeros(plant.n), plant.values({}), base.resolved.model == "nominal"
    accelerations = (u * abs(plant.nominal(rest, rest, i, p)[1]) for i, u in enumerate(base.limits))
    force = min(accelerations) if with_model else u_max
    limits = {name: force for name in law.gains if search_space.unit(law, name) == FORCE}
    limits |= search_space.largest(law, {}, u_max)
    sizes = [
        limits[name] / abs(gain) for name, gain in law.gains.items() if name in limits and 0.0 < abs(gain) < math.inf
    ]
    return min(sizes, default=math.inf)


def _largest(predicted: Callable[[float], float], wanted: float, limit: float) -> float:
    """Return the largest scale up to `limit` whose predicted amplitude is at most the wanted one.

    The search begins at the law's own gains and moves in steps until the amplitude, NaN for no limit cycle, crosses the
    wanted one. If a limit cycle is lost on the way up, the law has become too large for the actuator, and that counts
    as crossing. The amplitude is in proportion to the scale for most laws, so that the first guess is often right.
    """
    limit = min(limit, RANGE)
    low, high, oscillates = 0.0, math.inf, False

    def tried(scale: float) -> float:
        nonlocal low, high, oscillates
        amplitude = predicted(scale)
        if amplitude > wanted or (oscillates and math.isnan(amplitude)):
            high = scale
        else:
            low, oscillates = scale, not math.isnan(amplitude)
        return amplitude

    amplitude = tried(min(1.0, limit))
    guess = min(1.0, limit) * wanted / amplitude
    for scale in (guess, guess * (1.0 + CLOSE)):
        if low < scale < min(high, limit * (1.0 + CLOSE)):
            tried(min(scale, limit))
    while not low:
        if high < 1.0 / RANGE:
            raise ScenarioError(
                f"amplitude is {wanted:g}, and that of gains {RANGE:g} times smaller is {amplitude:.3g}: give more"
            )
        amplitude = tried(high / STEP)
    while low < limit and high == math.inf:
        tried(min(low * STEP, limit))
    while min(high, limit) > low * (1.0 + CLOSE):
        tried(math.sqrt(low * high))
    return low
