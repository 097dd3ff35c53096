"""Limits that a search keeps: gains that break one cost more than any that do not.

    smc.tune("duffing", "pid", needs="overshoot<10")

A limit is judged in the runs in which it is the law's to keep, see `quiet_until`. Searches keep
four fifths of it, so that runs with other starts keep all of it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError, one_line, shown
from smc_mujoco.common.text import real
from smc_mujoco.metrics.fold import LAST_PART
from smc_mujoco.simulation.doubts import constant_goal
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.scenario_checks import event_times
from smc_mujoco.simulation.signals import Constant

# s^2, of a run that breaks a limit, times the share by which; above J of runs that do not, and
# below that of a run that fails
LIMIT_COST = 1e6
NO_OVERSHOOT = 2.0  # %, the settling band: what "no-overshoot" allows; chosen
CALM = 0.01  # of the bound on u: what u swings at rest under "calm"; chosen
SEARCHED_SHARE = 0.8  # of a limit, which searches keep; chosen
OVERSHOOT, SWING = "overshoot", "swing of u at rest"
NEEDS = {"no-overshoot": (OVERSHOOT, NO_OVERSHOOT), "calm": (SWING, 100.0 * CALM)}


@frozen_data
class RunLimit:
    """The largest value that runs may have of the overshoot, % of the way to the goal, or of the
    swing of u at rest, % of the bound on u.
    """

    what: str  # OVERSHOOT or SWING
    most: float

    def __str__(self) -> str:
        return f"{self.what} < {self.most:g} %"

    def value(self, case: Scenario, x: Array, u: Array) -> float:
        """Return the value of a run, given x (K + 1, n) and u (K + 1, m); NaN where the run does
        not tell.
        """
        if self.what == SWING:
            return 100.0 * swing(case, u).share
        return overshoot(case, x)

    def cost(self, case: Scenario, x: Array, u: Array) -> float:
        """Return what a run costs that breaks the limit, s^2, else 0."""
        excess = self.value(case, x, u) / self.most - 1.0
        return LIMIT_COST * (1.0 + min(excess, 100.0)) if excess > 0.0 else 0.0

    @property
    def for_search(self) -> "RunLimit":
        """The limit that a search keeps."""
        return RunLimit(self.what, SEARCHED_SHARE * self.most)


class Swing(NamedTuple):
    """How u swings in the last fifth of a run: of the channel that swings most, over its bound."""

    size: float  # peak to peak, in the unit of u; NaN where the run does not tell
    frequency: float  # Hz
    share: float  # of the bound on u
    channel: int


def limits_in(needs: str | Sequence[str]) -> tuple[RunLimit, ...]:
    """Return the limits among needs, such as "no-overshoot", "overshoot<10" (in %) or "calm".

    Raises:
      ScenarioError: an overshoot without a positive number.
    """
    texts = needs.split(",") if isinstance(needs, str) else needs
    limits = []
    for text in texts:
        name, less, number = str(text).partition("<")
        if name.strip() == OVERSHOOT:
            limits.append(RunLimit(OVERSHOOT, _percent(text, less, number)))
        elif name.strip() in NEEDS and not less:
            limits.append(RunLimit(*NEEDS[name.strip()]))
    return tuple(limits)


def only_limits(needs: str | Sequence[str]) -> tuple[RunLimit, ...]:
    """Return the limits that needs are. Raise ScenarioError for another need."""
    texts = needs.split(",") if isinstance(needs, str) else needs
    for text in texts:
        if not limits_in([text]):
            raise ScenarioError(
                f"needs has {shown(text)}, which is no limit: give no-overshoot, overshoot<10 "
                "(in %) or calm"
            )
    return limits_in(texts)


def _percent(text: object, less: str, number: str) -> float:
    """Return the number of a limit in %."""
    try:
        most = real(number.strip().rstrip("%"))
    except ValueError:
        most = math.nan
    if not less or not 0.0 < most < math.inf:
        raise ScenarioError(
            f"need {one_line(str(text))!r} has no positive number: give overshoot<10, in % of the "
            "way to the goal"
        )
    return most


def quiet_until(case: Scenario) -> float:
    """Return until when nothing but the law moves a run, s: until an event, or 0 where a reference
    moves, or noise or a disturbance that varies acts from the start.
    """
    noise = case.noise
    if constant_goal(case) is None or noise.position or noise.velocity or any(noise.errors):
        return 0.0
    ends = [case.duration, *event_times(case.jump, case.fault).values()]
    for disturbance in case.disturbance:
        if not isinstance(disturbance, Constant):
            ends.append(getattr(disturbance, "time", 0.0))
    return min(ends)


def shows_limits(cases: Sequence[Scenario]) -> bool:
    """Return whether a run tells whether limits are kept.

    Raises:
      ScenarioError: a free body, of which no overshoot is defined.
    """
    if cases[0].plant.pose:
        raise ScenarioError(
            f"{cases[0].plant.name} is a free body, and limits are of joints: leave out needs"
        )
    return any(map(quiet_until, cases))


def overshoot(case: Scenario, x: Array) -> float:
    """Return how far beyond its goal a channel goes before the first event, % of the longest way of
    a channel; NaN where the run does not tell.
    """
    goal = constant_goal(case)
    count = math.ceil(quiet_until(case) / case.control_period)
    if goal is None or not count or case.plant.pose:
        return math.nan
    e = x[:count] - np.array(goal[: x.shape[1]])
    way = np.abs(e[0]).max()
    if not way:
        return math.nan
    beyond = -np.sign(e[0]) * e
    return float(100.0 * max(0.0, beyond.max()) / way)


def swing(case: Scenario, u: Array) -> Swing:
    """Return how u swings at the end of a run in which nothing moves any more."""
    start = int((1.0 - LAST_PART) * (len(u) - 1))
    late = u[start:]
    if not quiet_until(case) or not len(late):
        return Swing(math.nan, math.nan, math.nan, 0)
    sizes = np.ptp(late, axis=0)
    shares = sizes / np.array(case.limits)[: len(sizes)]
    channel = int(np.argmax(shares))
    wave = late[:, channel] - late[:, channel].mean()
    crossings = np.count_nonzero(np.diff(np.signbit(wave)))
    seconds = max(1, len(late) - 1) * case.control_period
    return Swing(
        float(sizes[channel]), crossings / (2.0 * seconds), float(shares[channel]), channel
    )
