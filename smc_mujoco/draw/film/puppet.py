"""A machine as a film moves it: from the positions of its channels to the pose of its whole
mechanism.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.draw.film import arrows, scene
from smc_mujoco.draw.film.act import Drawn, Motion
from smc_mujoco.draw.states import shapes
from smc_mujoco.mechanisms.hardware.part import ROTOR, joint_ids
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

SLIDE = mujoco.mjtJoint.mjJNT_SLIDE
FREE = mujoco.mjtJoint.mjJNT_FREE
POSES = 96  # poses of a trace that must be in the picture
MAX_FIXED_SIZE = (
    4.0  # of what moves: larger fixed things of a user's model may leave the picture; chosen
)
NEAR_SHARE = (
    0.3  # how far beside what moves fixed things must be in the picture, in its sizes; chosen
)
STAND_SHARE = 0.8  # height of a stand that must be in the picture, in sizes of what moves; chosen


def moved_bodies(model: mujoco.MjModel, joints: Sequence[int] | np.ndarray) -> list[int]:
    """Return the bodies that joints move, in order: their own and all that hang on these."""
    moved = set(model.jnt_bodyid[np.asarray(joints, int)].tolist())
    for body in range(1, model.nbody):
        if model.body_parentid[body] in moved:
            moved.add(body)
    return sorted(moved)


class Puppet:
    """The machine of one scenario, with the channels that a film shows."""

    def __init__(self, scenario: Scenario):
        self.scenario = scene.first_channels(scenario)
        self.shapes = shapes(self.scenario)  # at the start of the run, and after its jump
        for shape in self.shapes if self.scenario.plant.on_stage else ():
            scene.restyle(shape.model)
        model = self.shapes[0].model
        ids = joint_ids(model)
        rotors = []
        for i in ids:
            rotors.append(
                mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, ROTOR + model.joint(i).name)
            )
        self.slides = model.jnt_type[ids] == SLIDE
        self.rail = np.inf  # m, length along x of what does not move, on which a cart stays
        if (
            self.scenario.plant.on_stage
            and self.scenario.plant.unit != "rad"
            and not self.scenario.plant.pose
        ):
            self.rail = float(2 * np.abs(scene.fixed_boxes(model)[..., 0]).max())
        self._ids = ids
        self._joints = model.jnt_qposadr[ids]
        self._rotors = [
            (k, model.jnt_qposadr[rotor]) for k, rotor in enumerate(rotors) if rotor >= 0
        ]
        self.links = moved_bodies(model, ids)
        off_stage = not self.scenario.plant.on_stage
        self.free = model.jnt_qposadr[model.jnt_type == FREE]
        self.place = np.zeros(3)  # m, of the machine in the film, to which `qpos` moves free bodies
        self.ids = ids.tolist()
        self.mounts = list[arrows.Mount]()
        self.lowered = 0.0
        if off_stage:
            self._start = models.initial_state(model, self.scenario)[0]
        else:
            self._start = model.qpos0

    @property
    def shown(self) -> int:
        """The number of channels that are shown."""
        return self.scenario.plant.n

    def qpos(
        self, x: np.ndarray, ahead: np.ndarray | None = None, rest: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the pose, (nq,), with the channels at x, (shown,) rad or m; a cart stays on its
        rail.

        `ahead` is the lead of the rotors over their joints, (shown,) rad or m. Joints without a
        channel are taken from the pose `rest`, (nq,), by default that of the start.
        """
        pose = (self._start if rest is None else rest).copy()
        x = np.where(self.slides, np.clip(x, -self.rail / 2, self.rail / 2), x)
        if self.scenario.plant.pose:
            pose = models.state_with(self.shapes[0].model, self._ids, x, 0.0)[0]
        else:
            pose[self._joints] = x
        for k, place in self._rotors:
            if ahead is None:
                pose[place] = x[k]
            else:
                pose[place] = x[k] + ahead[k]
        for first in self.free.tolist():
            pose[first : first + 3] += self.place
        return pose

    def reach(
        self,
        trace: Trace,
        motion: Motion | None = None,
        drawn: Sequence[Drawn] = (),
        cut: bool = False,
    ) -> np.ndarray:
        """Return what must be in the picture, (points, 3) m from the machine's place.

        These are the corners of the boxes of all that the channels move, over the poses of its
        trace and its reference, and the arrows `drawn` at `mounts`. Of other things only the part
        close to these counts, such as the upper half of a stand; with `cut`, rails and columns end
        there. Joints without a channel move as in `motion`, or stay where they start.
        """
        data = [mujoco.MjData(shape.model) for shape in self.shapes]
        model = self.shapes[0].model
        moved = []
        others = []
        world = np.empty((0, 8, 3))
        plane = model.geom_type == scene.PLANE
        fixed = model.body_weldid[model.geom_bodyid] == 0
        links = np.isin(model.geom_bodyid, self.links) & ~plane
        if not links.any():
            cure = "give its bodies geoms, or its links <visual>"
            raise ScenarioError(
                f"nothing that moves on {trace.scenario.plant.name} has a shape to be filmed: {cure}"
            )
        for part in np.linspace(0.0, 1.0, POSES) ** 2:  # most of the motion is early
            sample = round(part * (len(trace.t) - 1))
            time = float(trace.t[sample])
            now = self.shape(time)
            rest = None if motion is None else motion.at(time)
            goal = trace.r[sample, : self.shown]
            for x in ([goal] if np.isfinite(goal).all() else []) + [trace.x[sample, : self.shown]]:
                data[now].qpos[:] = self.qpos(x, rest=rest)
                scene.forward(self.shapes[now].model, data[now])
                world = scene.boxes(self.shapes[now].model, data[now])
                moved.append(world[links].reshape(-1, 3))
            others.append(world[~links & ~plane & ~fixed])
        points = np.concatenate(
            [*moved, *self.lines(trace, motion, drawn, np.ptp(np.concatenate(moved), axis=0))]
        )
        groups = model.geom_group.copy()
        if cut and len(points):
            axes = data[0].xaxis[self.ids][self.slides]
            its = [shape.model for shape in self.shapes]
            self.lowered = scene.cut(its, points, axes, self.scenario.plant.on_stage)
            scene.forward(model, data[0])
        world = scene.boxes(model, data[0])  # fixed things
        fixed &= ~plane & (model.geom_group == groups)
        near = np.concatenate([*others, world[fixed]])
        still = np.repeat([False, True], [len(near) - fixed.sum(), fixed.sum()])
        if not len(points):
            return near.reshape(-1, 3)
        low = points.min(axis=0)
        high = points.max(axis=0)
        size = (high - low).max()
        if not self.scenario.plant.on_stage:
            close = np.ptp(near, axis=1).max(axis=1) < MAX_FIXED_SIZE * size
            close &= (
                (near < high + MAX_FIXED_SIZE * size) & (near > low - MAX_FIXED_SIZE * size)
            ).all(axis=(1, 2))
            near, still = near[close], still[close]
            near[still, :, :2] = near[still, :, :2].clip(
                low[:2] - NEAR_SHARE * size, high[:2] + NEAR_SHARE * size
            )
        near[still, :, 2] = near[still, :, 2].clip(
            low[2] - STAND_SHARE * size, high[2] + STAND_SHARE * size
        )
        return np.concatenate([points, near.reshape(-1, 3)])

    def lines(
        self, trace: Trace, motion: Motion | None, drawn: Sequence[Drawn], sides: np.ndarray
    ) -> list[np.ndarray]:
        """Return the lines of arrows on a machine, (m, 3) m each; bent ones suit the `sides` of
        what moves, m.
        """
        radius = arrows.BENT_SIZE * float(sides.max(initial=0.0))
        lines = []
        self.mounts = [mount._replace(radius=min(mount.radius, radius)) for mount in self.mounts]
        data = [mujoco.MjData(shape.model) for shape in self.shapes]
        for time, some in drawn:
            now = self.shape(time)
            sample = min(int(np.searchsorted(trace.t, time - 1e-9)), len(trace.t) - 1)
            rest = None if motion is None else motion.at(time)
            data[now].qpos[:] = self.qpos(trace.x[sample, : self.shown], rest=rest)
            scene.forward(self.shapes[now].model, data[now])
            found = (
                arrows.path(self.shapes[now].model, data[now], self.mounts[i], arrow)
                for i, arrow in some
            )
            lines += [line for line, _ in filter(None, found)]
        return lines

    def shape(self, time: float) -> int:
        """Return the index of the shape at a time, s."""
        return sum(time >= shape.time for shape in self.shapes) - 1
