"""The scene of a film: one machine a trace, side by side, under one camera that sees them all.

Machines are the scenarios' own mechanisms, with all that they touch, and stand `plant.lane` apart, or further where
they are wider. The camera looks as the plant's own camera `look` does, from the nearest place that keeps every machine,
wherever its trace takes it, inside the room that the page leaves.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.common import gl, mjcb
from smc_mujoco.draw import style
from smc_mujoco.draw.film import arrows, camera, own
from smc_mujoco.draw.states import shapes
from smc_mujoco.mechanisms.hardware.part import ROTOR, joints
from smc_mujoco.mechanisms.plant import model_path
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

SHOWN = 6  # channels of a network that a film shows: more would hide behind the next machine
AISLE = 0.05  # m between machines, chosen
SEEN = 2  # the last group of tendons that MuJoCo draws by default
SLIDE = mujoco.mjtJoint.mjJNT_SLIDE
POSES = 24  # poses of each trace that must be in the picture
QUALITY = {"offsamples": 4, "shadowsize": 1024, "numslices": 24, "numstacks": 14, "numquads": 1}  # looks and speed


class Stage:
    """The compiled scene and its renderer: a context, which closes the renderer.

    Attributes:
      shown: how many channels of each machine are drawn.
      boxes: where each machine is in the picture, (machines, 4) px: left, top, right, bottom.
    """

    def __init__(self, traces: Sequence[Trace], colours: Sequence[str], size: tuple[int, int], room: camera.Room):
        scenarios = [small(trace.scenario) for trace in traces]
        self.shown, self.own = [scenario.plant.n for scenario in scenarios], scenarios[0].plant.direct
        self.model = compose(scenarios, size)
        self.data = mujoco.MjData(self.model)
        self.shapes = [shapes(scenario) for scenario in scenarios]
        self.rails = [rail(scenario, parts[0].model) for scenario, parts in zip(scenarios, self.shapes, strict=True)]
        names = [[joint.name for joint in joints(assembly.spec([scenario]))] for scenario in scenarios]
        self.joints = [[self.model.joint(f"m{k}/{name}").id for name in each] for k, each in enumerate(names)]
        self.rotors = [[self.place(f"m{k}/{ROTOR}{name}") for name in each] for k, each in enumerate(names)]
        self.dressed = [-1] * len(scenarios)
        for k, colour in enumerate(colours):
            self.dress(k, 0.0)
            self.paint(k, colour)
        corners = self.corners(traces)
        turn = self.data.cam("m0/look").xmat.reshape(3, 3)
        place = camera.fit(np.concatenate(corners), turn, size, room)
        slides = [self.model.jnt_type[each] == SLIDE for each in self.joints]
        each = zip(scenarios, self.joints, slides, self.rails, strict=True)
        self.grips = [arrows.grips(*machine, turn[:, 2]) for machine in each]
        film = self.model.camera("film")
        film.pos = place
        mujoco.mju_mat2Quat(self.model.cam_quat[film.id], turn.ravel())
        seen = [camera.project(points, turn, place, size) for points in corners]
        self.boxes = np.array([[*points.min(axis=0), *points.max(axis=0)] for points in seen])
        self.renderer = gl.renderer(self.model, size[1], size[0])

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *_: object) -> None:
        self.renderer.close()

    def dress(self, k: int, time: float) -> None:
        """Give machine k the shape that it has at a time, s: its rod may be longer than the plant's, and may change."""
        now = sum(time >= shape.time for shape in self.shapes[k]) - 1
        if now == self.dressed[k]:
            return
        self.dressed[k], single = now, self.shapes[k][now].model
        for geom in range(single.ngeom):
            name = single.geom(geom).name
            if name and name != "floor" and not self.own:
                copy = self.model.geom(f"m{k}/{name}")
                copy.pos, copy.size = single.geom_pos[geom], single.geom_size[geom]

    def paint(self, k: int, colour: str) -> None:
        """Colour the accent of machine k."""
        if not self.own:
            self.model.mat(f"m{k}/accent").rgba[:3] = np.array(style.rgb(colour)) / 255

    def place(self, name: str) -> int | None:
        """Where a joint of that name lies in qpos; None if there is none."""
        joint = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, name)
        return None if joint < 0 else int(self.model.jnt_qposadr[joint])

    def pose(self, k: int, x: np.ndarray, ahead: np.ndarray | None = None) -> None:
        """Put machine k's channels at x, (shown,) rad or m; a cart stays on its rail.

        Args:
          ahead: how far their rotors are ahead of them, (shown,) rad or m; default: not at all.
        """
        slides = self.model.jnt_type[self.joints[k]] == SLIDE
        x = np.where(slides, np.clip(x, -self.rails[k] / 2, self.rails[k] / 2), x)
        self.data.qpos[self.model.jnt_qposadr[self.joints[k]]] = x
        for rotor, value in zip(self.rotors[k], x if ahead is None else x + ahead, strict=True):
            if rotor is not None:
                self.data.qpos[rotor] = value

    def render(self, drawn: Sequence[tuple[int, int, arrows.Arrow]] = ()) -> np.ndarray:
        """The picture, (height, width, 3) uint8, with arrows given as (machine, channel, arrow)."""
        settle(self.model, self.data)
        self.renderer.update_scene(self.data, camera="film")
        for k, i, arrow in drawn:
            arrows.draw(self.renderer.scene, self.model, self.data, self.grips[k][i], arrow)
        return self.renderer.render()

    def corners(self, traces: Sequence[Trace]) -> list[np.ndarray]:
        """For each machine, the corners of its geoms' boxes over the poses of its trace, (points, 3) m."""
        model = self.model
        owner = [model.body(model.body_rootid[body]).name.partition("/")[0] for body in model.geom_bodyid]
        if self.own:
            owner = own.owners(model, [parts[0].model for parts in self.shapes])
        solid = model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
        mine = [np.array([name == f"m{k}" for name in owner]) & solid for k in range(len(traces))]
        found = []
        for part in np.linspace(0.0, 1.0, POSES) ** 2:  # most of the motion is early
            for k, trace in enumerate(traces):
                sample = round(part * (len(trace.t) - 1))
                self.dress(k, float(trace.t[sample]))
                self.pose(k, trace.x[sample, : self.shown[k]])
            settle(model, self.data)
            world = boxes(model, self.data)
            found.append([world[own].reshape(-1, 3) for own in mine])
        moved = [np.concatenate(poses) for poses in zip(*found, strict=True)]
        return [self.beside(k, points) for k, points in enumerate(moved)] if self.own else moved

    def beside(self, k: int, points: np.ndarray) -> np.ndarray:
        """The points and those of what stands still of an own model, as a rail does; not of what is far larger."""
        fixed = still(self.shapes[k][0].model) + self.data.cam(f"m{k}/look").xpos
        near = np.ptp(fixed, axis=1).max(axis=1) < own.MOST * np.ptp(points, axis=0).max()
        return np.concatenate([points, fixed[near].reshape(-1, 3)])


def settle(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Work out where everything is at data.qpos."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    if (model.tendon_group <= SEEN).any():
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)


def boxes(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """The corners of each geom's box, (geoms, 8, 3) m."""
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    local = model.geom_aabb[:, None, :3] + signs * model.geom_aabb[:, None, 3:]
    return np.einsum("gij,gcj->gci", data.geom_xmat.reshape(-1, 3, 3), local) + data.geom_xpos[:, None]


def small(scenario: Scenario) -> Scenario:
    """The scenario with the channels that are shown."""
    plant = scenario.plant
    if plant.n <= SHOWN or plant.direct:
        return scenario
    cut = dataclasses.replace(plant, n=SHOWN, x0=plant.x0[:SHOWN])
    return dataclasses.replace(scenario, plant=cut, x0=scenario.x0[:SHOWN], v0=scenario.v0[:SHOWN])


def rail(scenario: Scenario, model: mujoco.MjModel) -> float:
    """Length of the rail, m: of what does not move, along x. Pendulums and own models have none: inf."""
    none = scenario.plant.unit == "rad" or scenario.plant.direct
    return np.inf if none else float(2 * np.abs(still(model)[..., 0]).max())


def still(model: mujoco.MjModel) -> np.ndarray:
    """The corners of each thing that does not move, but for planes, (things, 8, 3) m."""
    data = mujoco.MjData(model)
    settle(model, data)
    shown = (model.body_weldid[model.geom_bodyid] == 0) & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    return boxes(model, data)[shown]


def lane(scenarios: Sequence[Scenario]) -> np.ndarray:
    """From one machine to the next, m: the plant's lane, laid across the picture where it nearly lies so.

    Longer where machines that are more than their plant's equation would stand in each other's way.
    """
    plant = scenarios[0].plant
    if plant.direct:
        right = np.array(own.view(assembly.model(scenarios[:1]))[:3])
        return plant.lane[0] * right
    look = assembly.spec(scenarios[:1]).camera("look")
    step, across = np.array(plant.lane), np.array(look.alt.xyaxes[:3])
    length, across = np.linalg.norm(step), across / np.linalg.norm(across)
    step = length * across if abs(step @ across) > 0.5 * length else step
    if not any(scenario.realistic for scenario in scenarios):
        return step
    things = [still(assembly.model([scenario])) for scenario in scenarios]
    low, high = [corners.min(axis=1)[:, :2] for corners in things], [corners.max(axis=1)[:, :2] for corners in things]
    for stretch in np.arange(1.0, 20.0, 0.05):
        gaps = []
        for j, k in itertools.combinations(range(len(things)), 2):
            by = (k - j) * stretch * step[:2]
            apart = np.maximum(low[k][:, None] + by - high[j], low[j] - high[k][:, None] - by)
            gaps.append(apart.max(axis=2).min())
        if min(gaps, default=AISLE) >= AISLE:
            return stretch * step
    return step


def compose(scenarios: Sequence[Scenario], size: tuple[int, int]) -> mujoco.MjModel:
    """One scene with machine k's names prefixed m<k>/, and a camera named film for pictures of `size` px."""
    spec = mujoco.MjSpec.from_file(str(model_path("common/theme.xml")))
    for name, value in QUALITY.items():
        setattr(spec.visual.quality, name, value)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    step = lane(scenarios)
    for k, scenario in enumerate(scenarios):
        at = step * (k - (len(scenarios) - 1) / 2)
        if scenario.plant.direct:
            single = assembly.model([scenario])
            data = mujoco.MjData(single)
            settle(single, data)
            place = spec.worldbody.add_frame(pos=at + np.array([0.0, 0.0, own.low(single, boxes(single, data))]))
            spec.attach(own.machine(scenario, spec), frame=place, prefix=f"m{k}/")
            continue
        machine = bare(assembly.spec([scenario]))
        if k == 0:
            spec.option, spec.compiler = machine.option, machine.compiler
        place = spec.worldbody.add_frame(pos=at)
        place.attach_body(machine.body("machine"), f"m{k}/", "")
    spec.material("floor").emission = 0.13  # nearly the white of the page below
    spec.worldbody.add_camera(name="film", fovy=camera.FOVY)
    width = np.linalg.norm(step) * len(scenarios)
    spec.stat.center, spec.stat.extent, spec.stat.meansize = (0.0, 0.0, 0.5), 0.6 * width + 1.5, 0.1
    return mjcb.compiled(spec)


def bare(machine: mujoco.MjSpec) -> mujoco.MjSpec:
    """The mechanism without its surroundings, and without what only acts: pictures are posed, not simulated."""
    for item in [
        *machine.pairs,
        *machine.sensors,
        *machine.actuators,
        machine.geom("floor"),
        machine.material("floor"),
        *machine.lights,
        *machine.keys,
        *machine.textures,
    ]:
        machine.delete(item)
    return machine
