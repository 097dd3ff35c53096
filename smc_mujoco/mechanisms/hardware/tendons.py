"""Tendons that pull at joints: the force that a law wants on its joints is shared over them.

The tensions T, N, are those with which

    |A T - u|^2 + ridge |T|^2 is least,    low <= T <= high, and low is 0 or more,

where u is the wanted force on each joint, A the moment arms at the pose of the joints, m (1 on a
slide), and ridge RIDGE times the largest sum of squares of a tendon's arms. So the force is exact
where tendons that only pull can give it, else nearest to it, and of several ways to give it the
one with the least tensions is taken. Each joint gets its row of A T.

The callback does this at every stage of a physics step: the arms follow the joints, without the
error of an encoder.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a field here)
# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numba import carray, njit

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.jit import beyond, pointer
from smc_mujoco.mechanisms.hardware.moments import Run, channel_at, state_at
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.layout import dof_ids, posed
from smc_mujoco.mechanisms.plant import Plant

RIDGE = 1e-10  # chosen: the forces err by about this share, and one set of tensions is the least
ROUNDING = 1e-12  # of the largest product in a slope: what is below is rounding
ROUNDS = 10  # for each tendon; the search of a few tendons ends after fewer than two
FREE, AT_LOW, AT_HIGH = range(3)


class Cable(NamedTuple):
    """A tendon that pulls at joints."""

    tendon: int  # its index in the model
    name: str
    low: float  # bounds on its tension, N
    high: float


@njit(error_model="numpy")
def _step(H, slope, limits, step):
    """Write the step of the tensions that no limit holds to where they are least, by Cholesky's
    factors of H, in place.
    """
    m = len(slope)
    for j in range(m):
        step[j] = slope[j] if limits[j] == FREE else 0.0
        for k in range(j + 1):
            if limits[j] != FREE or limits[k] != FREE:
                H[j, k] = 1.0 if j == k else 0.0
    for j in range(m):
        for k in range(j + 1):
            rest = H[j, k]
            for i in range(k):
                rest -= H[j, i] * H[k, i]
            H[j, k] = rest / H[k, k] if k < j else np.sqrt(rest)
    for j in range(m):
        for k in range(j):
            step[j] -= H[j, k] * step[k]
        step[j] /= H[j, j]
    for back in range(m):
        j = m - 1 - back
        for k in range(j + 1, m):
            step[j] -= H[k, j] * step[k]
        step[j] /= H[j, j]


@njit(error_model="numpy")
def _slopes(arms, wanted, ridge, tensions, slope, rounding):
    """Write how fast half the sum falls with each tension, and what of it is rounding."""
    n, m = arms.shape
    for j in range(m):
        slope[j] = -ridge * tensions[j]
        rounding[j] = ROUNDING * abs(slope[j])
    for i in range(n):
        lacking = wanted[i]
        size = abs(wanted[i])
        for j in range(m):
            lacking -= arms[i, j] * tensions[j]
            size += abs(arms[i, j] * tensions[j])
        for j in range(m):
            slope[j] += arms[i, j] * lacking
            rounding[j] += ROUNDING * abs(arms[i, j]) * size


@njit(error_model="numpy")
def _released(low, high, limits, slope, rounding):
    """Return which tension to take off its limit, -1 if the sum falls for none."""
    released = -1
    most = 0.0
    for j in range(len(slope)):
        inward = slope[j] if limits[j] == AT_LOW else -slope[j]
        held = limits[j] != FREE and low[j] < high[j]
        if held and inward > rounding[j] and inward > most:
            most, released = inward, j
    return released


@njit(error_model="numpy")
def _moved(low, high, limits, step, tensions):
    """Step the tensions that no limit holds, as far as the first limit. Return whether that is all
    the way.
    """
    part = 1.0
    met = -1
    for j in range(len(step)):
        if limits[j] == FREE and step[j] != 0.0:
            room = (high[j] if step[j] > 0.0 else low[j]) - tensions[j]
            if room / step[j] < part:
                part, met = room / step[j], j
    for j in range(len(step)):
        if limits[j] == FREE:
            tensions[j] = min(max(tensions[j] + part * step[j], low[j]), high[j])
    if met >= 0:
        limits[met] = AT_HIGH if step[met] > 0.0 else AT_LOW
        tensions[met] = high[met] if step[met] > 0.0 else low[met]
    return met < 0


@njit(error_model="numpy")
def share(arms, wanted, low, high, tensions, work):
    """Write the tensions for the wanted forces, by the method of active sets: one tension after the
    other is taken off its limit, while the sum falls. `work` has room for (m + 3, m) numbers.
    """
    m = len(tensions)
    H = work[:m]
    slope, step, limits = work[m], work[m + 1], work[m + 2]
    ridge = 0.0
    for j in range(m):
        ridge = max(ridge, RIDGE * np.sum(arms[:, j] ** 2))
        tensions[j] = low[j]
        limits[j] = AT_LOW
    least = True  # whether the tensions that no limit holds are where the sum is least
    for _ in range(ROUNDS * m):
        _slopes(arms, wanted, ridge, tensions, slope, step)
        if least:
            released = _released(low, high, limits, slope, step)
            if released < 0:
                return
            limits[released] = FREE
        for j in range(m):
            for k in range(j + 1):
                H[j, k] = np.sum(arms[:, j] * arms[:, k]) + (ridge if j == k else 0.0)
        _step(H, slope, limits, step)
        least = _moved(low, high, limits, step, tensions)


@dataclasses.dataclass(frozen=True)
class Tendons(Part):
    """The tendons that drive some channels of a plant."""

    is_drive = True

    cables: tuple[Cable, ...]
    driven: tuple[int, ...]  # the channels

    def numbers(self, run: Run) -> list[Sequence[float]]:
        """Return how many channels and tendons there are, the channels, where each moment arm is in
        ten_J, row by row of channels, -1 where there is none, and the bounds.
        """
        places = self.arm_places(run.model)
        return [(*places.shape, *self.driven, *places.ravel(), *np.ravel(self.ends))]

    def start(self, run: Run) -> list[Sequence[float]]:
        del run
        n, m = len(self.driven), len(self.cables)
        return [(0.0,) * (n * m + n + m * (m + 4))]

    @property
    def ends(self) -> Array:
        """The lowest and the highest tensions, (2, m) N."""
        return np.array([(cable.low, cable.high) for cable in self.cables]).T.copy()

    def arm_places(self, model: mujoco.MjModel) -> Array:
        """Return where the moment arm of each tendon about each of its channels is in ten_J, (n,
        m); -1 where there is none.
        """
        dofs = dof_ids(model)[list(self.driven)]
        places = np.full((len(dofs), len(self.cables)), -1)
        for j, cable in enumerate(self.cables):
            first = model.ten_J_rowadr[cable.tendon]
            for place in range(first, first + model.ten_J_rownnz[cable.tendon]):
                places[dofs == model.ten_J_colind[place], j] = place
        return places

    def shared(self, model: mujoco.MjModel, x: Array, applied: Array) -> tuple[Array, Array]:
        """Return the tensions at samples of positions and commands of all channels, (K + 1, m) N,
        and what the tendons lack of the commands, (K + 1, n) N m (N).
        """
        places = self.arm_places(model)
        commands = np.ascontiguousarray(applied[:, list(self.driven)])
        tensions = np.full((len(x), len(self.cables)), np.nan)
        lacking = np.full(commands.shape, np.nan)
        low, high = self.ends
        work = np.zeros((len(self.cables) + 3, len(self.cables)))
        for k in np.flatnonzero(np.isfinite(x).all(axis=1) & np.isfinite(commands).all(axis=1)):
            data = posed(model, x[k])
            mujoco.mj_comPos(model, data)
            mujoco.mj_tendon(model, data)
            arms = np.where(places < 0, 0.0, -data.ten_J[places])
            share(arms, commands[k], low, high, tensions[k], work)
            lacking[k] = commands[k] - arms @ tensions[k]
        return tensions, lacking

    def channels(self, plant: Plant) -> Sequence[int]:
        return (-1,)

    @staticmethod
    def act(sim, data, part):
        """Share the commands over the tendons, and give each joint what they exert on it."""
        numbers = pointer(part.function.parameters)
        n, m = int(numbers[0]), int(numbers[1])
        driven = beyond(numbers, 2)
        places = carray(beyond(driven, n), (n, m))
        ends = carray(beyond(driven, n + n * m), (2, m))
        room = pointer(part.function.memory)
        arms = carray(room, (n, m))
        commands = carray(beyond(room, n * m), (n,))
        tensions = carray(beyond(room, n * m + n), (m,))
        work = carray(beyond(room, n * m + n + m), (m + 3, m))
        for i in range(n):
            commands[i] = state_at(sim.states, int(driven[i])).delayed
            for j in range(m):
                place = int(places[i, j])
                arms[i, j] = -data.ten_J[place] if place >= 0 else 0.0
        share(arms, commands, ends[0], ends[1], tensions, work)
        for i in range(n):
            force = 0.0
            for j in range(m):
                force += arms[i, j] * tensions[j]
            data.ctrl[channel_at(sim.channels, int(driven[i])).ctrl] = force


def of_plant(plant: Plant) -> Tendons | None:
    """Return the tendons over which a plant shares forces on its joints, if it does."""
    return getattr(plant.build, "tendons", None)
