"""What one run does in a film: at each frame its pose, its goal, its arrows and its state in words."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.draw import states
from smc_mujoco.draw.decimate import windows
from smc_mujoco.draw.film import arrows, scene
from smc_mujoco.mechanisms.hardware.part import ROTOR, joint_ids
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

    times: np.ndarray
    poses: np.ndarray

    def at(self, time: float) -> np.ndarray:
        """Return the pose at a time, (nq,): the one before."""
        return self.poses[max(int(np.searchsorted(self.times, time + 1e-9)) - 1, 0)]


class Act:
    """The part of a trace in a film whose frames end at edges[1:], s; an arm has neither arrows nor
    states.

    `framing` and `told` are its arrows and states at the times `grid`, s, of the whole run, which
    set the place of all.
    """

    def __init__(
        self,
        trace: Trace,
        colour: str,
        edges: np.ndarray,
        grid: np.ndarray,
        scales: Mapping[Group, arrows.Scale],
        arms: bool,
    ):
        self.trace = trace
        self.colour = colour
        times = edges[1:]
        n = scene.first_channels(trace.scenario).plant.n
        if arms:
            sizes = []
        else:
            sizes = arrows.scales_by_channel(trace, scales)[:n]
        self.drawn, self.framing = (drawn(trace, some, sizes, colour) for some in (edges, grid))
        hold = max(states.MIN_STATE_TIME, float(np.diff(edges).max()))
        self.states, self.told = (
            [None] * len(some) if arms else states.timeline(trace, some, hold)
            for some in (times, grid)
        )
        self.motion = motion(trace, np.union1d(grid, times))
        shown = (
            trace.x.T[:n],
            trace.r.T[:n],
        )  # linear between samples; after a failure the last finite one
        self.x, self.r = (
            np.stack([np.interp(times, trace.t, each) for each in its], axis=1) for its in shown
        )
        self.ahead = rotors(trace, edges)[:, :n]

    def failed(self, time: float) -> bool:
        """Return whether the run has failed by a time, s."""
        return self.trace.diverged_at is not None and time >= self.trace.diverged_at


def drawn(
    trace: Trace, edges: np.ndarray, sizes: Sequence[arrows.Scale], colour: str
) -> list[Drawn]:
    """Return the arrows of a machine in each frame between `edges`, s, for what acts on its
    channels.
    """
    acting = arrows.loads(trace, edges)
    if trace.scenario.plant.pose and sizes:
        return [
            Drawn(float(time), arrows.flying(acting, k, sizes[0], colour))
            for k, time in enumerate(edges[1:])
        ]
    return [
        Drawn(
            float(time),
            [
                (i, a)
                for i, size in enumerate(sizes)
                for a in arrows.arrows(acting, k, i, size, colour)
            ],
        )
        for k, time in enumerate(edges[1:])
    ]


def motion(trace: Trace, times: np.ndarray) -> Motion | None:
    """Return how joints of a user's machine move that are neither channels nor rotors of drives, at
    times in s.

    None if there are none, or if that is not known.
    """
    scenario = scene.first_channels(trace.scenario)
    if scenario.plant.on_stage:
        return None
    model = models.compile_model(scenario)
    names = [model.joint(i).name for i in joint_ids(model)]
    rotors = []
    for name in names:
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, ROTOR + name) >= 0:
            rotors.append(name)
    if len(names) + len(rotors) != model.nq:
        moved = poses(trace, times)
    else:
        moved = None
    return None if moved is None else Motion(times, moved)


def rotors(trace: Trace, edges: np.ndarray) -> np.ndarray:
    """Return the mean lead of the rotors over their joints, (edges - 1, n), rad or m, from the
    flank that pushes.
    """
    return (
        0.5
        * states.backlash_gap(trace.scenario)
        * windows(trace.t, states.flanks(trace), edges).mean
    )
