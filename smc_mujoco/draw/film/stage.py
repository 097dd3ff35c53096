"""The stage of a film: poses and renders the machines of all traces under one camera that sees them all.

The camera stands at the nearest place from which every machine stays inside the room that the page leaves, wherever
its trace takes it.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.draw import style
from smc_mujoco.draw.film import arrows, camera, scene
from smc_mujoco.draw.film.canvas import Canvas
from smc_mujoco.draw.states import shapes
from smc_mujoco.mechanisms.hardware.part import ROTOR, joints
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation.trace import Trace

SLIDE, CAPSULE = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtGeom.mjGEOM_CAPSULE
POSES = 24  # poses of each trace that must be in the picture
MAX_FIXED = 4.0  # size of a fixed thing, in sizes of what moves: larger ones may leave the picture; chosen


class Stage:
    """The compiled scene and its renderer: a context, which closes the renderer.

    Attributes:
      shown: number of channels of each machine that are drawn.
      boxes: place of each machine in the picture, (machines, 4) px: left, top, right, bottom.
      canvas: draws the pictures.
    """

    def __init__(self, traces: Sequence[Trace], colours: Sequence[str], size: tuple[int, int], room: camera.Room):
        scenarios = [scene.first_channels(trace.scenario) for trace in traces]
        self.shown, self.own = [scenario.plant.n for scenario in scenarios], scenarios[0].plant.direct
        self.model = scene.compose(scenarios, size)
        self.data = mujoco.MjData(self.model)
        self.shapes = [shapes(scenario) for scenario in scenarios]
        self.rails = [scene.rail(one, parts[0].model) for one, parts in zip(scenarios, self.shapes, strict=True)]
        names = [[joint.name for joint in joints(assembly.spec([scenario]))] for scenario in scenarios]
        self.joints = [[self.model.joint(f"m{k}/{name}").id for name in each] for k, each in enumerate(names)]
        self.rotors = [[self.qpos_address(f"m{k}/{ROTOR}{name}") for name in each] for k, each in enumerate(names)]
        self.shape, self.colours, self.changed = [-1] * len(scenarios), [""] * len(scenarios), True
        for k, colour in enumerate(colours):
            self.set_shape(k, 0.0)
            self.set_colour(k, colour)
        corners = self.corners(traces)
        turn = self.data.cam("m0/look").xmat.reshape(3, 3).copy()
        place = camera.fit(np.concatenate(corners), turn, size, room)
        slides = [self.model.jnt_type[each] == SLIDE for each in self.joints]
        machines = zip(scenarios, self.joints, slides, self.rails, strict=True)
        self.mounts = [arrows.mounts(*machine, turn[:, 2]) for machine in machines]
        film = self.model.camera("film")
        film.pos = place
        mujoco.mju_mat2Quat(self.model.cam_quat[film.id], turn.ravel())
        seen = [camera.project(points, turn, place, size) for points in corners]
        self.boxes = np.array([[*points.min(axis=0), *points.max(axis=0)] for points in seen])
        scene.forward(self.model, self.data)
        self.canvas = Canvas(self.model, self.data, size)

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *_: object) -> None:
        self.canvas.close()

    def set_shape(self, k: int, time: float) -> None:
        """Give machine k its shape at a time, s: a scenario's rod may be longer than the plant's, and may change."""
        now = sum(time >= shape.time for shape in self.shapes[k]) - 1
        if now == self.shape[k]:
            return
        self.shape[k], single = now, self.shapes[k][now].model
        for geom in range(single.ngeom):
            name = single.geom(geom).name
            if name and name != "floor" and not self.own:
                copy = self.model.geom(f"m{k}/{name}")
                if copy.type[0] == CAPSULE:  # its box is that of the compiled size
                    self.model.geom_aabb[copy.id, 5] += single.geom_size[geom, 1] - copy.size[1]
                copy.pos, copy.size = single.geom_pos[geom], single.geom_size[geom]
        self.changed = True

    def set_colour(self, k: int, colour: str) -> None:
        """Colour the accent of machine k."""
        if not self.own and self.colours[k] != colour:
            self.model.mat(f"m{k}/accent").rgba[:3] = np.array(style.rgb(colour)) / 255
            self.colours[k], self.changed = colour, True

    def qpos_address(self, name: str) -> int | None:
        """Return the index of a joint in qpos; None if there is no joint of that name."""
        joint = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, name)
        return None if joint < 0 else int(self.model.jnt_qposadr[joint])

    def pose(self, k: int, x: np.ndarray, ahead: np.ndarray | None = None) -> None:
        """Put machine k's channels at x, (shown,) rad or m; a cart stays on its rail.

        Args:
          ahead: lead of the rotors over their joints, (shown,) rad or m; default: none.
        """
        slides = self.model.jnt_type[self.joints[k]] == SLIDE
        x = np.where(slides, np.clip(x, -self.rails[k] / 2, self.rails[k] / 2), x)
        self.data.qpos[self.model.jnt_qposadr[self.joints[k]]] = x
        for rotor, value in zip(self.rotors[k], x if ahead is None else x + ahead, strict=True):
            if rotor is not None:
                self.data.qpos[rotor] = value

    def render(self, drawn: Sequence[tuple[int, int, arrows.Arrow]] = ()) -> np.ndarray:
        """Return the picture, (height, width, 3) uint8, with arrows given as (machine, channel, arrow); read-only."""
        scene.forward(self.model, self.data)

        def add(shown: mujoco.MjvScene) -> None:
            for k, i, arrow in drawn:
                arrows.draw(shown, self.model, self.data, self.mounts[k][i], arrow)

        anew, self.changed = self.changed, False
        return self.canvas.draw(add, anew)

    def corners(self, traces: Sequence[Trace]) -> list[np.ndarray]:
        """Return for each machine the corners of its geoms' boxes over the poses of its trace, (points, 3) m.

        Of an own model also those of what stands still, as a rail does, unless it is far larger than what moves.
        """
        mine = self.geoms()
        found = []
        for part in np.linspace(0.0, 1.0, POSES) ** 2:  # most of the motion is early
            for k, trace in enumerate(traces):
                sample = round(part * (len(trace.t) - 1))
                self.set_shape(k, float(trace.t[sample]))
                self.pose(k, trace.x[sample, : self.shown[k]])
            scene.forward(self.model, self.data)
            world = scene.boxes(self.model, self.data)
            found.append([world[each].reshape(-1, 3) for each in mine])
        moved = [np.concatenate(poses) for poses in zip(*found, strict=True)]
        for k, points in enumerate(moved if self.own else ()):
            fixed = scene.fixed_boxes(self.shapes[k][0].model) + self.data.cam(f"m{k}/look").xpos
            near = np.ptp(fixed, axis=1).max(axis=1) < MAX_FIXED * np.ptp(points, axis=0).max()
            moved[k] = np.concatenate([points, fixed[near].reshape(-1, 3)])
        return moved

    def geoms(self) -> list[np.ndarray]:
        """Return which geoms belong to the bodies of each machine, planes left out: a mask (geoms,) a machine."""
        model = self.model
        if self.own:  # its bodies are the last, in order
            counts = [parts[0].model.nbody - 1 for parts in self.shapes]
            machines = np.repeat(np.arange(len(counts)), counts)
            owner = np.concatenate([np.full(model.nbody - len(machines), -1), machines])[model.geom_bodyid]
        else:
            roots = [model.body(root).name.partition("/")[0] for root in model.body_rootid[model.geom_bodyid]]
            owner = np.array([int(name[1:]) if name[1:].isdigit() else -1 for name in roots])
        return [(owner == k) & (model.geom_type != scene.PLANE) for k in range(len(self.shapes))]
