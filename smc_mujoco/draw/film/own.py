"""A user's own model as a machine of a film: without its floor, lights and sky, under a camera that suits it."""

from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.mechanisms.hardware.part import joint_ids
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation.scenario import Scenario

LOOK = "look"
MOST = 4.0  # times as large as what moves: a larger thing that stands still may leave the picture, chosen
FRONT = (1.0, 0.0, 0.0, 0.0, 0.2, 1.0)  # right and up of a camera before the machine, a little above it
ABOVE = (1.0, 0.0, 0.0, 0.0, 1.0, 0.35)  # of one above, for what turns about vertical axes
FIXED, PLANE = mujoco.mjtCamLight.mjCAMLIGHT_FIXED.value, mujoco.mjtGeom.mjGEOM_PLANE


def machine(scenario: Scenario, film: mujoco.MjSpec) -> mujoco.MjSpec:
    """The scenario's mechanism with a camera `look`, nothing of its surroundings, and the film's settings."""
    spec, model = assembly.spec([scenario]), assembly.model([scenario])
    for camera in [camera for camera in spec.cameras if camera.name == LOOK]:
        spec.delete(camera)
    spec.worldbody.add_camera(name=LOOK, quat=turn(model))
    planes = [geom for geom in spec.geoms if geom.type == PLANE]
    skies = [texture for texture in spec.textures if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX]
    spec.option = film.option  # MuJoCo warns of what differs
    for name in ("global_", "quality", "headlight", "map", "scale", "rgba"):
        ours, theirs = getattr(spec.visual, name), getattr(film.visual, name)
        for field in [field for field in dir(ours) if not field.startswith("_")]:
            setattr(ours, field, getattr(theirs, field))
    acting = [*spec.pairs, *spec.sensors, *spec.actuators, *spec.keys, *spec.equalities]
    for item in [*acting, *spec.texts, *spec.lights, *planes, *skies]:
        spec.delete(item)
    return spec


def turn(model: mujoco.MjModel) -> np.ndarray:
    """The quaternion, (4,), of the camera of `view`."""
    right, up = np.reshape(view(model), (2, 3))
    back = np.cross(right, up)
    back /= np.linalg.norm(back)
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.column_stack([right, np.cross(back, right), back]).ravel())
    return quat


def view(model: mujoco.MjModel) -> tuple[float, ...]:
    """Right and up, (6,), of the model's first camera that stands still, or of one that sees its joints turn."""
    for camera in range(model.ncam):
        if model.cam_bodyid[camera] == 0 and model.cam_mode[camera] == FIXED:
            right, up, _ = model.cam_mat0[camera].reshape(3, 3).T
            return (*map(float, right), *map(float, up))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    turning = [i for i in joint_ids(model) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE]
    return ABOVE if turning and abs(data.xaxis[turning[0], 2]) > 0.9 else FRONT


def low(model: mujoco.MjModel, corners: np.ndarray) -> float:
    """How far, m, the model reaches below z = 0, but for planes; `corners` (geoms, 8, 3)."""
    solid = model.geom_type != PLANE
    return max(0.0, -float(corners[solid][..., 2].min(initial=0.0)))


def owners(model: mujoco.MjModel, singles: Sequence[mujoco.MjModel]) -> list[str]:
    """Of each geom of the film's scene, m<k> of the machine k on whose bodies it is: the last bodies, in order."""
    counts = [single.nbody - 1 for single in singles]
    machines = np.repeat(np.arange(len(singles)), counts)
    of_body = np.concatenate([np.full(model.nbody - len(machines), -1), machines])
    return [f"m{k}" for k in of_body[model.geom_bodyid]]
