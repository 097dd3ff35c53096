"""The scene of a film: one machine a trace, side by side, under one camera that sees them all.

Machines come from `plant.spec()` and stand `plant.lane` apart. The camera looks as the plant's own camera `look` does,
from the nearest place that keeps every machine, wherever its trace takes it, inside the room that the page leaves.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco import style
from smc_mujoco.envelope import samples
from smc_mujoco.plant import Plant, model_path
from smc_mujoco.trace import Trace

SHOWN = 6  # channels of a network that a film shows: more would hide behind the next machine
FOVY = 9.0  # degrees, chosen: a long lens, so that no machine looks larger than its neighbours
REACH = {"hinge": 0.85, "slide": 0.16}  # longest arrow: of the pendulum's length, of the rail's length
POSES = 24  # poses of each trace that must be in the picture
QUALITY = {"offsamples": 4, "shadowsize": 1024, "numslices": 32, "numstacks": 16, "numquads": 1}


class Room(NamedTuple):
    """The part of the picture that machines may fill, px from the top left."""

    left: float
    top: float
    right: float
    bottom: float


class Arrow(NamedTuple):
    """An arrow at channel i of machine k, from `low` to `high` of the longest (-1 .. 1)."""

    k: int
    i: int
    low: float
    high: float
    rgba: tuple[float, float, float, float]
    step: float  # places above the channel's own, in arrow widths
    size: float = 1.0  # of its length and width
    head: bool = True


class Stage:
    """The compiled scene and its renderer; close it when done.

    Attributes:
      shown: channels drawn of each machine.
      boxes: where each machine is in the picture, (machines, 4) px: left, top, right, bottom.
    """

    def __init__(self, traces: Sequence[Trace], colours: Sequence[str], size: tuple[int, int], room: Room):
        plants = [trace.scenario.plant for trace in traces]
        self.shown = [min(plant.n, SHOWN) for plant in plants]
        self.size = size
        self.model = compose(plants, self.shown)
        self.data = mujoco.MjData(self.model)
        for k, (trace, colour) in enumerate(zip(traces, colours, strict=True)):
            self.dress(k, trace)
            self.paint(k, colour)
        self.joints = [
            [
                self.model.actuator_trnid[self.model.actuator(f"m{k}/{name}").id, 0]
                for name in actuators(plant, n)
            ]
            for k, (plant, n) in enumerate(zip(plants, self.shown, strict=True))
        ]
        self.limit = travel(plants[0])
        corners = self.corners(traces)
        self.aim(np.concatenate(corners), room)
        self.boxes = np.array([self.box(points) for points in corners])
        self.renderer = mujoco.Renderer(self.model, size[1], size[0])

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *_: object) -> None:
        self.renderer.close()

    def dress(self, k: int, trace: Trace) -> None:
        """Give machine k the shape of the true plant, e.g. a longer rod."""
        plant, n = trace.scenario.plant, self.shown[k]
        single = small(plant, n).load(trace.scenario.factors(0))
        for geom in range(single.ngeom):
            name = single.geom(geom).name
            if name and name != "floor":
                copy = self.model.geom(f"m{k}/{name}")
                copy.pos, copy.size = single.geom_pos[geom], single.geom_size[geom]

    def paint(self, k: int, colour: str) -> None:
        """Colour the accent of machine k."""
        self.model.mat(f"m{k}/accent").rgba[:3] = np.array(style.rgb(colour)) / 255

    def pose(self, k: int, x: np.ndarray) -> None:
        """Put machine k's channels at x, (shown,) rad or m."""
        for joint, value in zip(self.joints[k], np.clip(x, -self.limit, self.limit), strict=True):
            self.data.qpos[self.model.jnt_qposadr[joint]] = value

    def settle(self) -> None:
        """Work out where everything is after `pose`."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def render(self, arrows: Sequence[Arrow] = ()) -> np.ndarray:
        """The picture, (height, width, 3) uint8."""
        self.settle()
        self.renderer.update_scene(self.data, camera="film")
        for arrow in arrows:
            self.draw(arrow)
        return self.renderer.render()

    def draw(self, arrow: Arrow) -> None:
        """Add an arrow to the scene of this frame."""
        scene, joint = self.renderer.scene, self.joints[arrow.k][arrow.i]
        if scene.ngeom >= scene.maxgeom or abs(arrow.high - arrow.low) < 0.02:
            return
        model, data = self.model, self.data
        body = model.jnt_bodyid[joint]
        tip, axis = self.handle(body), data.xaxis[joint]
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
            arm = data.geom_xpos[tip] - data.xanchor[joint]
            along = np.cross(axis, arm)
            reach, up = REACH["hinge"] * np.linalg.norm(arm), arm / np.linalg.norm(arm)
            along = along / np.linalg.norm(along)
            width = 0.16 * model.geom_rbound[tip] + 0.012
            start = data.geom_xpos[tip] + (model.geom_rbound[tip] + 1.6 * width) * up
        else:
            along, reach, up = axis, REACH["slide"] * 2 * self.limit, np.array([0.0, 0.0, 1.0])
            width = 0.035
            start = data.geom_xpos[tip] + (model.geom_size[tip, 2] + 2.2 * width) * up
        start, width, reach = start + 2.6 * width * arrow.step * up, arrow.size * width, arrow.size * reach
        geom = scene.geoms[scene.ngeom]
        kind = mujoco.mjtGeom.mjGEOM_ARROW if arrow.head else mujoco.mjtGeom.mjGEOM_CAPSULE
        mujoco.mjv_initGeom(
            geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), np.array(arrow.rgba, np.float32)
        )
        ends = start + reach * arrow.low * along, start + reach * arrow.high * along
        mujoco.mjv_connector(geom, kind, width if arrow.head else 0.55 * width, *ends)
        geom.specular = 0.0
        scene.ngeom += 1

    def handle(self, body: int) -> int:
        """The geom of a moving body that carries its arrows: the first in the accent's material."""
        geoms = range(
            self.model.body_geomadr[body], self.model.body_geomadr[body] + self.model.body_geomnum[body]
        )
        accent = [g for g in geoms if self.model.mat(self.model.geom_matid[g]).name.endswith("accent")]
        return accent[0]

    def corners(self, traces: Sequence[Trace]) -> list[np.ndarray]:
        """For each machine, the corners of its geoms' boxes over the poses of its trace, (points, 3) m."""
        model, data = self.model, self.data
        signs = np.array(list(itertools.product((-1, 1), repeat=3)))
        owner = [model.body(model.body_rootid[body]).name.partition("/")[0] for body in model.geom_bodyid]
        found: list[list[np.ndarray]] = [[] for _ in traces]
        for part in np.linspace(0.0, 1.0, POSES) ** 2:  # most of the motion is early
            for k, trace in enumerate(traces):
                self.pose(k, trace.x[round(part * (samples(trace) - 1)), : self.shown[k]])
            self.settle()
            local = model.geom_aabb[:, None, :3] + signs * model.geom_aabb[:, None, 3:]
            frame = data.geom_xmat.reshape(-1, 3, 3)
            world = np.einsum("gij,gcj->gci", frame, local) + data.geom_xpos[:, None]
            for k in range(len(traces)):
                found[k].append(world[[name == f"m{k}" for name in owner]].reshape(-1, 3))
        return [np.concatenate(points) for points in found]

    def aim(self, points: np.ndarray, room: Room) -> None:
        """Move the camera `film` to the nearest place from which all points are seen within the room.

        Along each picture axis, with (p, z) the points in the camera's turned frame and a..b the room's tangents,
        a (z + D) <= p - c <= b (z + D) bounds the place c from both sides; the distance D is the least that leaves one.
        """
        model, camera = self.model, self.model.camera("film").id
        turn = self.data.cam_xmat[model.camera("m0/look").id].reshape(3, 3)
        across, up, z = points @ turn[:, 0], points @ turn[:, 1], -points @ turn[:, 2]
        tangent = np.tan(np.radians(FOVY) / 2) / (self.size[1] / 2)  # of one px
        middle = np.array(self.size) / 2
        sides = [
            (across, (room.left - middle[0]) * tangent, (room.right - middle[0]) * tangent),
            (up, (middle[1] - room.bottom) * tangent, (middle[1] - room.top) * tangent),
        ]
        ends = [(np.max(p - b * z), np.min(p - a * z), a, b) for p, a, b in sides]
        distance = max((least - most) / (b - a) for least, most, a, b in ends)
        place = [(least - b * distance + most - a * distance) / 2 for least, most, a, b in ends]
        model.cam_pos[camera] = turn @ np.array([*place, distance])
        mujoco.mju_mat2Quat(model.cam_quat[camera], turn.ravel())
        self.settle()

    def box(self, points: np.ndarray) -> tuple[float, float, float, float]:
        """The box in the picture, px, around points (m, 3)."""
        camera = self.model.camera("film").id
        seen = (points - self.data.cam_xpos[camera]) @ self.data.cam_xmat[camera].reshape(3, 3)
        px = seen[:, :2] / -seen[:, 2:] / np.tan(np.radians(FOVY) / 2) * (self.size[1] / 2) * (1, -1)
        px += np.array(self.size) / 2
        return *px.min(axis=0), *px.max(axis=0)


def small(plant: Plant, n: int) -> Plant:
    """The plant with its first n channels."""
    import dataclasses

    return dataclasses.replace(plant, n=n, x0=plant.x0[:n])


def actuators(plant: Plant, n: int) -> list[str]:
    """The names of the first n channels' actuators."""
    return [actuator.name for actuator in plant.build(n).actuators]


def travel(plant: Plant) -> float:
    """How far from 0 a channel is drawn: to the end of its rail; a pendulum turns freely."""
    if plant.unit == "rad":
        return np.inf
    return float(abs(plant.spec().geom("left_post").pos[0]))


def lane(plant: Plant) -> np.ndarray:
    """From one machine to the next, m: the plant's lane; turned to lie across the picture where it nearly does."""
    step, across = np.array(plant.lane), np.array(plant.spec().camera("look").alt.xyaxes[:3])
    length, across = np.linalg.norm(step), across / np.linalg.norm(across)
    return length * across if abs(step @ across) > 0.7 * length else step


def compose(plants: Sequence[Plant], shown: Sequence[int]) -> mujoco.MjModel:
    """One scene with machine k's names prefixed m<k>/, and a camera named film."""
    spec = mujoco.MjSpec.from_file(str(model_path("common/theme.xml")))
    for name, value in QUALITY.items():
        setattr(spec.visual.quality, name, value)
    middle = (len(plants) - 1) / 2
    for k, (plant, n) in enumerate(zip(plants, shown, strict=True)):
        machine = plant.build(n)
        machine.delete(machine.geom("floor"))
        for item in [*machine.lights, *machine.keys, *machine.textures, machine.material("floor")]:
            machine.delete(item)
        if k == 0:
            spec.option, spec.compiler = machine.option, machine.compiler
        place = spec.worldbody.add_frame(pos=lane(plant) * (k - middle))
        place.attach_body(machine.body("machine"), f"m{k}/", "")
    spec.material("floor").emission = 0.13  # nearly the white of the page below
    spec.worldbody.add_camera(name="film", fovy=FOVY)
    width = np.linalg.norm(plants[0].lane) * len(plants)
    spec.stat.center, spec.stat.extent, spec.stat.meansize = (0.0, 0.0, 0.5), 0.6 * width + 1.5, 0.1
    return spec.compile()
