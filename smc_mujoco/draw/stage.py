"""The scene of a film: one machine a trace, side by side, under one camera that sees them all.

Machines come from `plant.spec()` and stand `plant.lane` apart. The camera looks as the plant's own camera `look` does,
from the nearest place that keeps every machine, wherever its trace takes it, inside the room that the page leaves.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.draw import arrows, camera, style
from smc_mujoco.plant import Plant, model_path
from smc_mujoco.scenario import Scenario
from smc_mujoco.trace import Trace

SHOWN = 6  # channels of a network that a film shows: more would hide behind the next machine
POSES = 24  # poses of each trace that must be in the picture
QUALITY = {"offsamples": 4, "shadowsize": 1024, "numslices": 24, "numstacks": 14, "numquads": 1}  # looks and speed


class Stage:
    """The compiled scene and its renderer: a context, which closes the renderer.

    Attributes:
      shown: how many channels of each machine are drawn.
      boxes: where each machine is in the picture, (machines, 4) px: left, top, right, bottom.
    """

    def __init__(self, traces: Sequence[Trace], colours: Sequence[str], size: tuple[int, int], room: camera.Room):
        plants = [small(trace.scenario.plant) for trace in traces]
        self.shown = [plant.n for plant in plants]
        self.model = compose(plants, size)
        self.data = mujoco.MjData(self.model)
        self.rail = rail(plants[0])
        self.joints = [
            [self.model.actuator(f"m{k}/{u.name}").trnid[0] for u in plant.spec().actuators]
            for k, plant in enumerate(plants)
        ]
        self.units = [self.rail if np.isfinite(self.rail) else arrows.CHAIN if plant.n > 1 else 1.0 for plant in plants]
        self.shapes = [shapes(plant, trace.scenario) for plant, trace in zip(plants, traces, strict=True)]
        self.dressed = [-1] * len(plants)
        for k, colour in enumerate(colours):
            self.dress(k, 0.0)
            self.paint(k, colour)
        corners = self.corners(traces)
        turn = self.data.cam("m0/look").xmat.reshape(3, 3)
        place = camera.fit(np.concatenate(corners), turn, size, room)
        film = self.model.camera("film")
        film.pos = place
        mujoco.mju_mat2Quat(self.model.cam_quat[film.id], turn.ravel())
        seen = [camera.project(points, turn, place, size) for points in corners]
        self.boxes = np.array([[*points.min(axis=0), *points.max(axis=0)] for points in seen])
        self.renderer = mujoco.Renderer(self.model, size[1], size[0])

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *_: object) -> None:
        self.renderer.close()

    def dress(self, k: int, time: float) -> None:
        """Give machine k the shape that it has at a time, s: its rod may be longer than the plant's, and may change."""
        now = sum(time >= start for start, _ in self.shapes[k]) - 1
        if now == self.dressed[k]:
            return
        self.dressed[k], (_, single) = now, self.shapes[k][now]
        for geom in range(single.ngeom):
            name = single.geom(geom).name
            if name and name != "floor":
                copy = self.model.geom(f"m{k}/{name}")
                copy.pos, copy.size = single.geom_pos[geom], single.geom_size[geom]

    def paint(self, k: int, colour: str) -> None:
        """Colour the accent of machine k."""
        self.model.mat(f"m{k}/accent").rgba[:3] = np.array(style.rgb(colour)) / 255

    def pose(self, k: int, x: np.ndarray) -> None:
        """Put machine k's channels at x, (shown,) rad or m; a cart stays on its rail."""
        for joint, value in zip(self.joints[k], np.clip(x, -self.rail / 2, self.rail / 2), strict=True):
            self.data.qpos[self.model.jnt_qposadr[joint]] = value

    def render(self, drawn: Sequence[tuple[int, int, arrows.Arrow]] = ()) -> np.ndarray:
        """The picture, (height, width, 3) uint8, with arrows given as (machine, channel, arrow)."""
        settle(self.model, self.data)
        self.renderer.update_scene(self.data, camera="film")
        for k, i, arrow in drawn:
            arrows.draw(self.renderer.scene, self.model, self.data, self.joints[k][i], self.units[k], arrow)
        return self.renderer.render()

    def corners(self, traces: Sequence[Trace]) -> list[np.ndarray]:
        """For each machine, the corners of its geoms' boxes over the poses of its trace, (points, 3) m."""
        model = self.model
        owner = [model.body(model.body_rootid[body]).name.partition("/")[0] for body in model.geom_bodyid]
        mine = [np.array([name == f"m{k}" for name in owner]) for k in range(len(traces))]
        found = []
        for part in np.linspace(0.0, 1.0, POSES) ** 2:  # most of the motion is early
            for k, trace in enumerate(traces):
                sample = round(part * (len(trace.t) - 1))
                self.dress(k, float(trace.t[sample]))
                self.pose(k, trace.x[sample, : self.shown[k]])
            settle(model, self.data)
            world = boxes(model, self.data)
            found.append([world[own].reshape(-1, 3) for own in mine])
        return [np.concatenate(poses) for poses in zip(*found, strict=True)]


def settle(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Work out where everything is at data.qpos."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)


def boxes(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """The corners of each geom's box, (geoms, 8, 3) m."""
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    local = model.geom_aabb[:, None, :3] + signs * model.geom_aabb[:, None, 3:]
    return np.einsum("gij,gcj->gci", data.geom_xmat.reshape(-1, 3, 3), local) + data.geom_xpos[:, None]


def shapes(plant: Plant, scenario: Scenario) -> list[tuple[float, mujoco.MjModel]]:
    """The plant as it is from each time on, s: as the run starts, and after its jump."""
    steps = [0] if scenario.jump is None else [0, scenario.jump_step]
    return [(step * scenario.physics_step, plant.load(scenario.factors(step))) for step in steps]


def small(plant: Plant) -> Plant:
    """The plant with the channels that are shown."""
    n = min(plant.n, SHOWN)
    return dataclasses.replace(plant, n=n, x0=plant.x0[:n])


def rail(plant: Plant) -> float:
    """Length of the rail, m: of what does not move, along x. A pendulum has none: inf."""
    if plant.unit == "rad":
        return np.inf
    model = plant.load()
    data = mujoco.MjData(model)
    settle(model, data)
    still = (model.body_weldid[model.geom_bodyid] == 0) & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    return float(2 * np.abs(boxes(model, data)[still][..., 0]).max())


def lane(plant: Plant) -> np.ndarray:
    """From one machine to the next, m: the plant's lane, laid across the picture where it nearly lies so."""
    step, across = np.array(plant.lane), np.array(plant.spec().camera("look").alt.xyaxes[:3])
    length, across = np.linalg.norm(step), across / np.linalg.norm(across)
    return length * across if abs(step @ across) > 0.7 * length else step


def compose(plants: Sequence[Plant], size: tuple[int, int]) -> mujoco.MjModel:
    """One scene with machine k's names prefixed m<k>/, and a camera named film for pictures of `size` px."""
    spec = mujoco.MjSpec.from_file(str(model_path("common/theme.xml")))
    for name, value in QUALITY.items():
        setattr(spec.visual.quality, name, value)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    for k, plant in enumerate(plants):
        machine = plant.spec()
        for item in [
            machine.geom("floor"),
            machine.material("floor"),
            *machine.lights,
            *machine.keys,
            *machine.textures,
        ]:
            machine.delete(item)
        if k == 0:
            spec.option, spec.compiler = machine.option, machine.compiler
        place = spec.worldbody.add_frame(pos=lane(plant) * (k - (len(plants) - 1) / 2))
        place.attach_body(machine.body("machine"), f"m{k}/", "")
    spec.material("floor").emission = 0.13  # nearly the white of the page below
    spec.worldbody.add_camera(name="film", fovy=camera.FOVY)
    width = np.linalg.norm(plants[0].lane) * len(plants)
    spec.stat.center, spec.stat.extent, spec.stat.meansize = (0.0, 0.0, 0.5), 0.6 * width + 1.5, 0.1
    return spec.compile()
