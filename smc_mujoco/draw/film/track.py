"""What one run does in a film: at each frame its pose, goal, arrows and state in words."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import states, style
from smc_mujoco.draw.decimate import windows
from smc_mujoco.draw.film import arrows, world
from smc_mujoco.mechanisms.layout import ROTOR, joint_ids
from smc_mujoco.metrics.conventions import Group
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.run import poses
from smc_mujoco.simulation.trace import Trace


class Drawn(NamedTuple):
    """The arrows of a machine at a time, s: each with its channel."""

    time: float
    arrows: Sequence[tuple[int, arrows.Arrow]]


class Motion(NamedTuple):
    """Poses of a mechanism, (times, nq), at times in s."""

    times: Array
    poses: Array

    def at(self, time: float) -> Array:
        """Return the pose at a time, (nq,): the one before."""
        return self.poses[max(int(np.searchsorted(self.times, time + 1e-9)) - 1, 0)]


class MachineTrack:
    """The part of a trace in a film whose frames end at edges[1:], s; an arm has neither arrows nor
    states.

    `framing` and `grid_states` are its arrows and states at the times `grid`, s, of the whole run,
    which set the place of all.
    """

    def __init__(
        self,
        trace: Trace,
        colour: str,
        edges: Array,
        grid: Array,
        scales: Mapping[Group, arrows.Scale],
    ):
        arms = bool(trace.scenario.plant.tip)
        self.trace = trace
        self.edges = edges
        self.colour = colour
        times = edges[1:]
        n = world.first_channels(trace.scenario).plant.n
        if arms or not scales:
            sizes = []
        else:
            sizes = arrows.scales_by_channel(trace, scales)[:n]
        self.drawn = drawn(trace, edges, sizes, colour)
        self.framing = drawn(trace, grid, sizes, colour)
        self.states = [None] * len(times)
        self.grid_states = []
        if not arms:
            hold = max(states.MIN_STATE_TIME, float(np.diff(edges).max()))
            self.states = states.timeline(trace, times, hold)
            self.grid_states = states.timeline(trace, grid, hold)
        self.motion = motion(trace, np.union1d(grid, times))
        self.x = sampled(trace, trace.x[:, :n], times)
        self.r = sampled(trace, trace.r[:, :n], times)
        gap = states.backlash_gap(trace.scenario)  # rotors lead their joints by half of it
        self.ahead = 0.5 * gap * windows(trace.t, states.flanks(trace), edges).mean[:, :n]

    def rest(self, time: float) -> Array | None:
        """Return the pose at a time, s, (nq,), for joints that have no channel."""
        return None if self.motion is None else self.motion.at(time)

    def failed(self, time: float) -> bool:
        """Return whether the run has failed by a time, s."""
        return self.trace.diverged_at is not None and time >= self.trace.diverged_at


def sampled(trace: Trace, values: Array, times: Array) -> Array:
    """Return values (K+1, n) at times, s, linear between samples; after a failure the last one."""
    return np.stack([np.interp(times, trace.t, channel) for channel in values.T], axis=1)


def drawn(trace: Trace, edges: Array, sizes: Sequence[arrows.Scale], colour: str) -> list[Drawn]:
    """Return the arrows of a machine in each frame between `edges`, s, for what acts on its
    channels.
    """
    from smc_mujoco.draw.film.flight import blows

    acting = arrows.loads(trace, edges)
    frames = []
    for k, time in enumerate(edges[1:].tolist()):
        found = []
        if trace.scenario.plant.pose and sizes:
            found = arrows.flying(acting, k, sizes[0])
        else:
            for i, size in enumerate(sizes):
                found += [(i, arrow) for arrow in arrows.arrows(acting, k, i, size, colour)]
            for body, peak in blows(trace, edges[k], time) if sizes else ():
                size = float(np.linalg.norm(peak))
                length = size / sizes[0].longest
                shade = arrows.rgba(style.DISTURBANCE)
                found.append((0, arrows.Arrow(0.0, length, shade, way=peak / size, body=body)))
        frames.append(Drawn(time, found))
    return frames


def motion(trace: Trace, times: Array) -> Motion | None:
    """Return how joints of a user's machine move that are neither channels nor rotors of drives, at
    times in s.

    None if there are none, or if that is not known.
    """
    scenario = world.first_channels(trace.scenario)
    if scenario.plant.on_stage and not any(part.loose for part in scenario.contact):
        return None
    model = models.compile_model(scenario)
    names = [model.joint(i).name for i in joint_ids(model)]
    known = len(names)
    for name in names:
        known += mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, ROTOR + name) >= 0
    moved = None if known == model.nv else poses(trace, times)
    return None if moved is None else Motion(times, moved)
