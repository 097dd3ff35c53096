"""Tasks for agents: what is asked of a plant, where episodes start, and what is rewarded.

    reward = T(rms(e)) (4 + T(rms(w) / 5)) / 5,    T(a) = 10^(-a^2)

in [0, 1], rms over the channels. T is dm_control's tolerance about 0 with margin 1 (Tassa et al., DeepMind Control
Suite, 2018), and the form is its cart-pole's; the margins, 1 (rad or m) for e and 5 (per second) for w, are chosen.

    task          e                                          w                  an episode starts with |x| up to
    regulate      x                                          x'                 the plant's x0
    track         x - r in driven channels, x in others      x' - r', x'        the plant's x0
    swing_up      1 - cos x of toppling hinges, x of others  x'                 hanging within 0.1 rad, 0 in others
    synchronise   x - the channels' mean                     x' - its mean      the largest of the plant's x0

and within the ranges that the joints of a model of yours have.
"""

import dataclasses
import functools
import math
import operator
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.mechanisms.hardware.part import joint_ids
from smc_mujoco.mechanisms.plant import Plant, Values
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.signals import Sine

LN10 = math.log(10.0)
CALM = 5.0  # rad/s or m/s, the margin of w: chosen
ASIDE = 0.1  # rad, how far from hanging a swing-up begins: chosen
WEAK = 0.5  # u_max of a swing-up, in torques that hold the pendulum level: chosen, so that one push is not enough
WAY = Sine(amplitude=0.5, omega=1.0)  # rad or m, what `track` follows unless told: chosen

Pair = tuple[np.ndarray, np.ndarray]


def _all(plant: Plant) -> np.ndarray:
    return np.ones(plant.n, bool)


def _none(plant: Plant) -> dict[str, Any]:
    return {}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Task:
    """What an agent is to do; of functions with names, so that pickle knows them.

    Attributes:
      fits: whether a plant has this task.
      spread: plant -> the lowest and the highest start of its channels, (n,) each, whatever their ranges.
      errors: (x, v, r, which) -> e and w; x and v are (..., n), r the reference and its derivatives, (..., 3).
      which: plant -> the channels that the task singles out, (n,) of bool.
      fields: plant -> Scenario fields that it sets unless told.
      moving: whether it follows a reference, which is then part of the observation.
    """

    fits: Callable[[Plant], bool]
    spread: Callable[[Plant], Pair]
    errors: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], Pair]
    which: Callable[[Plant], np.ndarray] = _all
    fields: Callable[[Plant], dict[str, Any]] = _none
    moving: bool = False


def reward(e: np.ndarray, w: np.ndarray) -> Any:
    """The reward for errors e and w, (..., n) each."""
    rate = -LN10 / e.shape[-1]
    return np.exp(rate * np.vecdot(e, e)) * (0.8 + 0.2 * np.exp(rate / CALM**2 * np.vecdot(w, w)))


def tasks(plant: Plant | str) -> list[str]:
    """Names of the tasks that a plant has."""
    kind = find_plant(plant) if isinstance(plant, str) else plant
    if not isinstance(kind, Plant):
        raise ScenarioError(f"plant is {shown(plant)}: give smc.plant(...) or one of the names smc.plants() lists")
    return [name for name, task in TASKS.items() if task.fits(kind)]


def starts(task: Task, plant: Plant) -> Pair:
    """The lowest and the highest start of a plant's channels, (n,) each, within its joints' ranges."""
    low, high = task.spread(plant)
    least, most = _ranges(plant)
    return np.clip(low, least, most), np.clip(high, least, most)


def _ranges(plant: Plant) -> Pair:
    """The least and the largest positions that the joints have, (n,) each."""
    found = np.array([(low, high) for _, low, high in plant.ranges] or [(-math.inf, math.inf)] * plant.n)
    return found[:, 0], found[:, 1]


@functools.lru_cache(maxsize=64)
def toppling(plant: Plant) -> np.ndarray:
    """Which channels fall further when they lean: hinges for which x = 0 is unstable, (n,) of bool."""
    model = plant.load()
    hinged = model.jnt_type[joint_ids(model)] == mujoco.mjtJoint.mjJNT_HINGE
    lean = 0.1 * hinged
    f = [plant.nominal(lean, 0.0 * lean, i, Values(**plant.parameters))[0] for i in range(plant.n)]
    return hinged & (np.array(f) > 0.0)


def driven(plant: Plant) -> np.ndarray:
    """Which channels have an actuator, (n,) of bool."""
    return np.arange(plant.n) < plant.driven


def _any(plant: Plant) -> bool:
    return True


def _topples(plant: Plant) -> bool:
    """Whether it has what can hang and be swung up, and be driven weakly: one u_max has one unit."""
    down, (least, most) = toppling(plant), _ranges(plant)
    hangs = (least[down] <= math.pi) & (most[down] >= math.pi)
    one = plant.free or {"rad"}.issuperset(plant.units)
    return bool(down.any() and hangs.all() and one)


def _way(plant: Plant) -> dict[str, Any]:
    return {"reference": WAY}


def _within_start(plant: Plant) -> Pair:
    most = np.abs(plant.x0)
    return -most, most


def _hanging(plant: Plant) -> Pair:
    down = toppling(plant)
    return (math.pi - ASIDE) * down, (math.pi + ASIDE) * down


def _apart(plant: Plant) -> Pair:
    most = np.full(plant.n, max(np.abs(plant.x0)))
    return -most, most


def _weak(plant: Plant) -> dict[str, Any]:
    """Torques too weak to push the heaviest pendulum up at once; a cart keeps its force, its pole has no torque."""
    if plant.free:
        return {}
    down, p = toppling(plant), Values(**plant.parameters)
    level = math.pi / 2 * down
    pulls = (plant.nominal(level, 0.0 * level, int(i), p) for i in np.flatnonzero(down))
    return {"u_max": WEAK * max(abs(f / g) for f, g in pulls)}


def _regulate(x: np.ndarray, v: np.ndarray, r: np.ndarray, which: np.ndarray) -> Pair:
    return x, v


def _track(x: np.ndarray, v: np.ndarray, r: np.ndarray, which: np.ndarray) -> Pair:
    return x - r[..., :1] * which, v - r[..., 1:2] * which


def _swing_up(x: np.ndarray, v: np.ndarray, r: np.ndarray, which: np.ndarray) -> Pair:
    return np.where(which, 1.0 - np.cos(x), x), v


def _synchronise(x: np.ndarray, v: np.ndarray, r: np.ndarray, which: np.ndarray) -> Pair:
    return x - np.mean(x, axis=-1, keepdims=True), v - np.mean(v, axis=-1, keepdims=True)


TASKS = {
    "regulate": Task(fits=_any, spread=_within_start, errors=_regulate),
    "track": Task(fits=_any, spread=_within_start, errors=_track, which=driven, fields=_way, moving=True),
    "swing_up": Task(fits=_topples, spread=_hanging, errors=_swing_up, which=toppling, fields=_weak),
    "synchronise": Task(fits=operator.attrgetter("network"), spread=_apart, errors=_synchronise),
}
