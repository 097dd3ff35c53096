"""What one run does in a film: at each frame its pose, goal, arrows and state in words."""

from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import states
from smc_mujoco.draw.decimate import windows
from smc_mujoco.draw.film import arrows, world
from smc_mujoco.draw.film.pace import FilmClock
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.layout import ROTOR, joint_ids, moving_joints
from smc_mujoco.metrics.conventions import ChannelGroup
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.run import poses
from smc_mujoco.simulation.trace import Trace

HALF_STILL = 0.5 / 240.0  # s around a peak, of its arrow: a frame of eightfold slow motion
SAID_TIMES = 1000  # of a run, at which it is asked whether something is said of it; chosen


class Motion(NamedTuple):
    """Poses of a mechanism, (times, nq), at times in s."""

    times: Array
    poses: Array

    def at(self, time: float) -> Array:
        """Return the pose at a time, (nq,): the one before."""
        sample = int(np.searchsorted(self.times, time + 1e-9)) - 1
        return self.poses[max(sample, 0)]


class MachineTrack:
    """A trace at the frames of a film's clock; an arm has no arrows but those of its tip, and a
    network none.

    `missed`, (frames, 3) m, is the way from a machine whose place is measured to where its
    reference wants it; (frames, 0) of others. `framing` are its arrows at the times `grid`, s, of
    the whole run, which set the place of all, and `speaks` is whether something is said of it in
    the run.
    """

    def __init__(
        self,
        trace: Trace,
        colour: str,
        clock: FilmClock,
        grid: Array,
        scales: Mapping[ChannelGroup, arrows.Scale],
    ):
        self.trace = trace
        self.colour = colour
        self.edges = edges = clock.edges
        self.holds = states.HOLD_TIME * clock.speeds
        times = clock.times
        n = world.first_channels(trace.scenario).plant.n
        self.motion = motion(trace, np.union1d(grid, times))
        sizes = []
        plant = trace.scenario.plant
        if scales and not plant.tip and not arrows.is_network(plant):
            sizes = arrows.scales_by_channel(scales)[:n]
        self.drawn = arrows.frames(trace, edges, self.holds, sizes, colour)
        self.framing = arrows.frames(trace, grid, np.zeros(len(grid)), sizes, colour)
        self.states = states.timeline(trace, times, clock.played)
        sampled_times = trace.t[:: 1 + len(trace.t) // SAID_TIMES]
        self.speaks = any(states.timeline(trace, sampled_times, clock.played))
        for k, state in enumerate(self.states):
            if state and state.peak is not None:
                around = state.peak + HALF_STILL * np.array([-1.0, 1.0])
                (then,) = arrows.frames(trace, around, np.zeros(1), sizes, colour)
                shade = arrows.rgba(state.colour, state.opacity)
                self.drawn[k] = arrows.held(self.drawn[k], then, shade)
        self.x = sampled(trace, trace.x[:, :n], times)
        self.r = sampled(trace, trace.r[:, :n], times)
        place = states.place_channels(trace.scenario.plant)
        self.missed = np.nan_to_num(self.r - self.x)[:, place]
        self.ahead = leads(trace, times, edges)[:, :n]

    def rest(self, time: float) -> Array | None:
        """Return the pose at a time, s, (nq,), for joints that have no channel."""
        return None if self.motion is None else self.motion.at(time)

    def failed(self, time: float) -> bool:
        """Return whether the run has failed by a time, s."""
        return self.trace.diverged_at is not None and time >= self.trace.diverged_at


def leads(trace: Trace, times: Array, edges: Array) -> Array:
    """Return how far each rotor is ahead of its joint in the frames at times in s, (times, n): half
    of a play, or what a spring is bent by, which a trace lacks.
    """
    if any(isinstance(part, ElasticJoint) for part in trace.scenario.actuator):
        model = models.mechanism(trace.scenario).model
        joints, shafts = model.jnt_qposadr[moving_joints(model)]
        moved = poses(trace, times)
        return moved[:, shafts] - moved[:, joints]
    gap = states.backlash_gap(trace.scenario)
    return 0.5 * gap * windows(trace.t, states.flanks(trace), edges).mean


def sampled(trace: Trace, values: Array, times: Array) -> Array:
    """Return values (K+1, n) at times, s, linear between samples; after a failure the last one."""
    return np.stack([np.interp(times, trace.t, channel) for channel in values.T], axis=1)


def motion(trace: Trace, times: Array) -> Motion | None:
    """Return how joints of a user's machine move that are neither channels nor rotors of drives, at
    times in s.

    None if there are none, or if that is not known.
    """
    scenario = world.first_channels(trace.scenario)
    if scenario.plant.on_stage and not any(part.loose for part in scenario.contact):
        return None
    model = models.mechanism(scenario).model
    ids = joint_ids(model)
    joint_count = len(ids)
    for i in ids:
        rotor = ROTOR + model.joint(i).name
        joint_count += mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, rotor) >= 0
    moved = None if joint_count == model.nv else poses(trace, times)
    return None if moved is None else Motion(times, moved)
