"""Tasks for agents: the goal, the initial states of episodes, and the reward.

    reward = T(rms(e)) (4 + T(rms(w) / 5)) / 5,    T(a) = 10^(-a^2)

in [0, 1], where rms is taken over the channels. T is dm_control's tolerance about 0 with margin 1
(Tassa et al., DeepMind Control Suite, 2018), and the form is that of its cart-pole. The margins, 1
(rad or m) for e and 5 (per second) for w, are chosen.

    task          e                                          w             |x| at the start
    regulate      x                                          x'            up to the plant's x0
    track         x - r in driven channels, x in others      x' - r', x'   up to the plant's x0
    swing_up      1 - cos x of toppling hinges, x of others  x'            within 0.1 rad of hanging
    synchronise   x - mean of the channels                   x' - its mean up to the largest x0

Of an arm such as `panda`, whose rest is a pose, x and the spread of starts count from this pose,
and r is a reference for each joint. An arm is neither swung up nor synchronised. If joints have
ranges, starts also lie within these. Your own model with its x0 at the goal has in place of x0 the
start beside the goal that `smc.starts` describes.
"""

import dataclasses
import functools
import math
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, ArrayPair, Fields
from smc_mujoco.mechanisms.custom.scales import usual_start
from smc_mujoco.mechanisms.layout import joint_ids
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant, Values
from smc_mujoco.simulation.signals import Signal, Sine

LN10 = math.log(10.0)
RATE_MARGIN = 5.0  # rad/s or m/s, the margin of w: chosen
SWING_UP_SPREAD = 0.1  # rad, largest distance from hanging at the start of a swing-up: chosen
# u_max of a swing-up, of the torque that holds the pendulum level: chosen, too weak for one push
SWING_UP_TORQUE = 0.5
TRACK_REFERENCE = Sine(amplitude=0.5, omega=1.0)  # rad or m, the default of `track`: chosen
AMPLITUDE_SHARE = (
    0.5  # of the way to the end of a joint's range: bounds the default reference of an arm; chosen
)


@dataclasses.dataclass(frozen=True)
class OffsetSine(Signal):
    """r(t) = middle + amplitude sin(omega t); omega in rad/s."""

    middle: float
    amplitude: float
    omega: float

    @staticmethod
    def value(t, p):
        r = p.amplitude * math.sin(p.omega * t)
        angle = p.omega * t
        return p.middle + r, p.amplitude * p.omega * math.cos(angle), -p.omega * p.omega * r


class Task:
    """The goal of an agent. This base class is `regulate`: bring every channel to 0."""

    moving = False  # whether there is a moving reference, which is then part of the observation

    def applies_to(self, plant: Plant) -> bool:
        """Return whether a plant has this task."""
        return True

    def fields(self, plant: Plant) -> Fields:
        """Return the Scenario fields for which the task has its own default."""
        return {}

    def selected(self, plant: Plant) -> Array:
        """Return the channels that `errors` treats differently from the rest, (n,) of bool."""
        return np.ones(plant.n, bool)

    def spread(self, plant: Plant) -> ArrayPair:
        """Return the lowest and the highest start of the channels from rest, (n,) each, ignoring
        joints' ranges.
        """
        reach = np.abs(usual_start(plant) - rest_position(plant))
        return -reach, reach

    def errors(self, x: Array, v: Array, r: Array, selected: Array) -> ArrayPair:
        """Return e and w for x and v, (..., n) each; `r` has the references r, r' and r'', (..., 3
        m), m of each.
        """
        return x, v


class Track(Task):
    """Follow a reference with the driven channels."""

    moving = True

    def fields(self, plant: Plant) -> Fields:
        """Return the reference: for an arm one for each joint, about its rest."""
        if not plant.rest:
            return {"reference": TRACK_REFERENCE}
        low, high = _ranges(plant)
        room = AMPLITUDE_SHARE * np.minimum(high - plant.rest, plant.rest - low)
        amplitudes = np.minimum(room, TRACK_REFERENCE.amplitude)
        amplitudes[~np.isin(np.arange(plant.n), plant.scored_channels)] = 0.0
        references = []
        for middle, amplitude in zip(plant.rest, amplitudes[: plant.driven].tolist(), strict=False):
            references.append(OffsetSine(middle, amplitude, TRACK_REFERENCE.omega))
        return {"reference": references}

    def selected(self, plant: Plant) -> Array:
        """Return the channels with an actuator."""
        return np.arange(plant.n) < plant.driven

    def errors(self, x: Array, v: Array, r: Array, selected: Array) -> ArrayPair:
        """Return the distance of the driven channels from their references, and the state of the
        others.
        """
        m = r.shape[-1] // 3
        e = np.array(x)
        w = np.array(v)
        e[..., selected] -= r[..., :m]
        w[..., selected] -= r[..., m : 2 * m]
        return e, w


class SwingUp(Task):
    """Bring hanging pendulums and poles upright."""

    def applies_to(self, plant: Plant) -> bool:
        """Return whether every toppling channel can hang, and u_max has one unit."""
        down, (low, high) = toppling(plant), _ranges(plant)
        hangs = (low[down] <= math.pi) & (high[down] >= math.pi)
        one_unit = plant.free or {"rad"}.issuperset(plant.units)
        return bool(down.any() and hangs.all() and one_unit)

    def fields(self, plant: Plant) -> Fields:
        """Return a torque too weak to push the heaviest pendulum up at once; a cart keeps its own
        limit.
        """
        if plant.free:
            return {}
        down = toppling(plant)
        p = Values(**plant.parameters)
        level = math.pi / 2 * down
        pulls = []
        for i in np.flatnonzero(down):
            f, g = plant.nominal(level, 0.0 * level, int(i), p)
            pulls.append(abs(f / g))
        return {"u_max": SWING_UP_TORQUE * max(pulls)}

    def selected(self, plant: Plant) -> Array:
        """Return the channels that topple."""
        return toppling(plant)

    def spread(self, plant: Plant) -> ArrayPair:
        """Return starts about hanging."""
        down = toppling(plant)
        return (math.pi - SWING_UP_SPREAD) * down, (math.pi + SWING_UP_SPREAD) * down

    def errors(self, x: Array, v: Array, r: Array, selected: Array) -> ArrayPair:
        """Return the distance of toppling channels from upright, and the state of others."""
        return np.where(selected, 1.0 - np.cos(x), x), v


class Synchronise(Task):
    """Bring the channels of a network together."""

    def applies_to(self, plant: Plant) -> bool:
        """Return whether the plant is a network."""
        return plant.network and not plant.rest

    def spread(self, plant: Plant) -> ArrayPair:
        """Return the same range for every channel."""
        reach = np.full(plant.n, max(np.abs(plant.x0)))
        return -reach, reach

    def errors(self, x: Array, v: Array, r: Array, selected: Array) -> ArrayPair:
        """Return the distance of the channels from their mean."""
        mean_x = np.mean(x, axis=-1, keepdims=True)
        mean_v = np.mean(v, axis=-1, keepdims=True)
        return x - mean_x, v - mean_v


TASKS = {"regulate": Task(), "track": Track(), "swing_up": SwingUp(), "synchronise": Synchronise()}


FLIGHT_TASKS = ["regulate", "track"]  # of free bodies


def reward(e: Array, w: Array) -> Any:
    """Return the reward for errors e and w, (..., n) each."""
    rate = -LN10 / e.shape[-1]
    return np.exp(rate * np.vecdot(e, e)) * (
        0.8 + 0.2 * np.exp(rate / RATE_MARGIN**2 * np.vecdot(w, w))
    )


def tasks(plant: Plant | str) -> list[str]:
    """Return the names of the tasks that a plant has; none of a free body."""
    plant = as_plant(plant)
    names = []
    for name, task in TASKS.items():
        if task.applies_to(plant) and not plant.pose:
            names.append(name)
    return names


def start_range(task: Task, plant: Plant) -> ArrayPair:
    """Return the lowest and the highest start of a plant's channels, (n,) each, within its joints'
    ranges.
    """
    lowest, highest = _ranges(plant)
    low, high = task.spread(plant)
    middle = rest_position(plant)
    lowest_start = np.clip(middle + low, lowest, highest)
    highest_start = np.clip(middle + high, lowest, highest)
    return lowest_start, highest_start


def rest_position(plant: Plant) -> Array:
    """Return the positions from which errors and spreads count, (n,): the plant's rest, or 0."""
    return np.array(plant.rest or (0.0,) * plant.n)


def _ranges(plant: Plant) -> ArrayPair:
    """Return the lowest and the highest positions of the joints, (n,) each."""
    if not plant.ranges:
        return np.full(plant.n, -math.inf), np.full(plant.n, math.inf)
    ranges = np.array([bounds[1:] for bounds in plant.ranges])
    return ranges[:, 0], ranges[:, 1]


@functools.lru_cache(maxsize=64)
def toppling(plant: Plant) -> Array:
    """Return the channels that fall when they lean, (n,) of bool: hinges for which x = 0 is
    unstable.
    """
    model = plant.load()
    hinged = model.jnt_type[joint_ids(model)] == mujoco.mjtJoint.mjJNT_HINGE
    lean = 0.1 * hinged
    parameters = Values(**plant.parameters)
    f = [plant.nominal(lean, 0.0 * lean, i, parameters)[0] for i in range(plant.n)]
    return hinged & (np.array(f) > 0.0)
