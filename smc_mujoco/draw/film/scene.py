"""The model of a film: one machine a trace, side by side, without their surroundings, and a camera that suits them.

Machines are the scenarios' own mechanisms with all that they touch. They stand `plant.lane` apart, or further if they
are wider. The camera looks in the direction of the plant's own camera `look`. A user's own model gets one.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.common import mjcb
from smc_mujoco.draw.film import camera
from smc_mujoco.mechanisms.hardware.part import joint_ids
from smc_mujoco.mechanisms.plant import model_path
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation.scenario import Scenario

MAX_CHANNELS = 6  # of a network: more would be hidden by the next machine
AISLE = 0.05  # m between machines, chosen
TENDON_GROUPS = 3  # groups of tendons that MuJoCo draws by default
QUALITY = {"offsamples": 4, "shadowsize": 1024, "numslices": 20, "numstacks": 10, "numquads": 1}  # looks and speed
LOOK = "look"
FRONT = (1.0, 0.0, 0.0, 0.0, 0.2, 1.0)  # right and up of a camera before an own model, a little above it
ABOVE = (1.0, 0.0, 0.0, 0.0, 1.0, 0.35)  # of one above, for joints with vertical axes
FIXED, PLANE = mujoco.mjtCamLight.mjCAMLIGHT_FIXED.value, mujoco.mjtGeom.mjGEOM_PLANE


def compose(scenarios: Sequence[Scenario], size: tuple[int, int]) -> mujoco.MjModel:
    """Return one model with machine k's names prefixed m<k>/, and a camera `film` for pictures of `size` px."""
    spec = mujoco.MjSpec.from_file(str(model_path("common/theme.xml")))
    for name, value in QUALITY.items():
        setattr(spec.visual.quality, name, value)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    step = lane(scenarios)
    for k, scenario in enumerate(scenarios):
        place = step * (k - (len(scenarios) - 1) / 2)
        if scenario.plant.direct:
            place = place + np.array([0.0, 0.0, depth(assembly.model([scenario]))])
            spec.attach(own_machine(scenario, spec), frame=spec.worldbody.add_frame(pos=place), prefix=f"m{k}/")
            continue
        machine = assembly.spec([scenario])
        strip(machine, machine.geom("floor"), machine.material("floor"), *machine.textures)
        if k == 0:
            spec.option, spec.compiler = machine.option, machine.compiler
        spec.worldbody.add_frame(pos=place).attach_body(machine.body("machine"), f"m{k}/", "")
    spec.material("floor").emission = 0.13  # nearly the white of the page below
    spec.worldbody.add_camera(name="film", fovy=camera.FOVY)
    width = np.linalg.norm(step) * len(scenarios)
    spec.stat.center, spec.stat.extent, spec.stat.meansize = (0.0, 0.0, 0.5), 0.6 * width + 1.5, 0.1
    return mjcb.compiled(spec)


def strip(machine: mujoco.MjSpec, *surroundings) -> None:
    """Delete what a picture does not need, as it is posed and not simulated, and the machine's surroundings."""
    acting = [*machine.pairs, *machine.sensors, *machine.actuators, *machine.keys]
    for item in [*acting, *machine.lights, *surroundings]:
        machine.delete(item)


def own_machine(scenario: Scenario, film: mujoco.MjSpec) -> mujoco.MjSpec:
    """Return a user's mechanism with a camera `look`, without its surroundings, with the film's settings."""
    spec = assembly.spec([scenario])
    for each in [each for each in spec.cameras if each.name == LOOK]:
        spec.delete(each)
    right, up = np.reshape(view(assembly.model([scenario])), (2, 3))
    back = np.cross(right, up) / np.linalg.norm(np.cross(right, up))
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.column_stack([right, np.cross(back, right), back]).ravel())
    spec.worldbody.add_camera(name=LOOK, quat=quat)
    spec.option = film.option  # MuJoCo warns of settings that differ
    for name in ("global_", "quality", "headlight", "map", "scale", "rgba"):
        ours, theirs = getattr(spec.visual, name), getattr(film.visual, name)
        for field in [field for field in dir(ours) if not field.startswith("_")]:
            setattr(ours, field, getattr(theirs, field))
    planes = [geom for geom in spec.geoms if geom.type == PLANE]
    skies = [texture for texture in spec.textures if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX]
    strip(spec, *spec.equalities, *spec.texts, *planes, *skies)
    return spec


def view(model: mujoco.MjModel) -> tuple[float, ...]:
    """Return right and up, (6,), of an own model's first fixed camera, or of one that sees its joints turn."""
    for i in range(model.ncam):
        if model.cam_bodyid[i] == 0 and model.cam_mode[i] == FIXED:
            right, up, _ = model.cam_mat0[i].reshape(3, 3).T
            return (*map(float, right), *map(float, up))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    turning = [i for i in joint_ids(model) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE]
    return ABOVE if turning and abs(data.xaxis[turning[0], 2]) > 0.9 else FRONT


def depth(model: mujoco.MjModel) -> float:
    """Return how far a model reaches below z = 0, m, planes left out."""
    data = mujoco.MjData(model)
    forward(model, data)
    return max(0.0, -float(boxes(model, data)[model.geom_type != PLANE][..., 2].min(initial=0.0)))


def lane(scenarios: Sequence[Scenario]) -> np.ndarray:
    """Return the step from one machine to the next, (3,) m: the plant's lane, turned across the picture if it is close.

    It is longer for realistic machines that would intersect.
    """
    plant = scenarios[0].plant
    if plant.direct:
        return plant.lane[0] * np.array(view(assembly.model(scenarios[:1]))[:3])
    look = assembly.spec(scenarios[:1]).camera(LOOK)
    step, across = np.array(plant.lane), np.array(look.alt.xyaxes[:3])
    length, across = np.linalg.norm(step), across / np.linalg.norm(across)
    step = length * across if abs(step @ across) > 0.5 * length else step
    if not any(scenario.realistic for scenario in scenarios):
        return step
    things = [fixed_boxes(assembly.model([scenario])) for scenario in scenarios]
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


def forward(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Compute where everything is at data.qpos."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    if (model.tendon_group < TENDON_GROUPS).any():
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)


def boxes(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the corners of each geom's box, (geoms, 8, 3) m."""
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    local = model.geom_aabb[:, None, :3] + signs * model.geom_aabb[:, None, 3:]
    return np.einsum("gij,gcj->gci", data.geom_xmat.reshape(-1, 3, 3), local) + data.geom_xpos[:, None]


def fixed_boxes(model: mujoco.MjModel) -> np.ndarray:
    """Return the corners of each geom that does not move, planes left out, (geoms, 8, 3) m."""
    data = mujoco.MjData(model)
    forward(model, data)
    return boxes(model, data)[(model.body_weldid[model.geom_bodyid] == 0) & (model.geom_type != PLANE)]


def first_channels(scenario: Scenario) -> Scenario:
    """Return the scenario with the channels that a film shows."""
    plant = scenario.plant
    if plant.n <= MAX_CHANNELS or plant.direct:
        return scenario
    plant = dataclasses.replace(plant, n=MAX_CHANNELS, x0=plant.x0[:MAX_CHANNELS])
    x0, v0 = (values[:MAX_CHANNELS] for values in (scenario.resolved.x0, scenario.resolved.v0))
    return dataclasses.replace(scenario, plant=plant, x0=x0, v0=v0)


def rail(scenario: Scenario, model: mujoco.MjModel) -> float:
    """Return the length of the rail, m: of what does not move, along x; inf for pendulums and own models."""
    if scenario.plant.unit == "rad" or scenario.plant.direct:
        return np.inf
    return float(2 * np.abs(fixed_boxes(model)[..., 0]).max())
