"""Where the channels of a mechanism are in its model: their joints, actuators and degrees of
freedom.

Names: an actuator `passive:<joint>` belongs to a part and takes no command. `rotor:<joint>` is the
joint that a channel's actuator drives, if it is not the channel's joint itself.
"""

import functools
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.plant import Plant

PASSIVE = "passive:"
ROTOR = "rotor:"
LEAD = "lead:"  # a tendon of length rotor - joint
POSE = "smc:pose"  # site at the origin of a free body whose pose is the channels
OWN = "smc:"  # begins the names of bodies that obstacles add
BASE = "smc:base"  # such a site where the pose is only measured, beside driven joints
START = "smc:start"  # keyframe with the initial positions of joints without a channel

# A pose: the position in the axes of the world, m, and the rotation vector of the attitude, rad,
# see rotation.py
PLACES = "x", "y", "z", "rx", "ry", "rz"


def drive_actuators(spec: mujoco.MjSpec) -> list[mujoco.MjsActuator]:
    """Return the actuators that take commands, one for each driven channel."""
    return [actuator for actuator in spec.actuators if not actuator.name.startswith(PASSIVE)]


def joints(spec: mujoco.MjSpec) -> list[mujoco.MjsJoint]:
    """Return the channels' joints: first the driven ones, then those that are only measured."""
    if (site := spec.site(POSE)) is not None:
        return [site.parent.joints[0]] * len(PLACES)
    channel_joints = [
        spec.joint(actuator.target.removeprefix(ROTOR)) for actuator in drive_actuators(spec)
    ]
    names = [joint.name for joint in channel_joints]
    for sensor in spec.sensors:
        joint = sensor.objname.removeprefix(ROTOR)
        if sensor.type == mujoco.mjtSensor.mjSENS_JOINTPOS and joint not in names:
            channel_joints.append(spec.joint(joint))
        elif sensor.name == f"{BASE}:x":
            channel_joints += [spec.site(BASE).parent.joints[0]] * len(PLACES)
    return channel_joints


def drive_ids(model: mujoco.MjModel) -> np.ndarray:
    """Return the indices of the actuators that take commands, (driven,)."""
    ids = []
    for i in range(model.nactuator):
        if not model.actuator(i).name.startswith(PASSIVE):
            ids.append(i)
    return np.array(ids, int)


def free_joint(model: mujoco.MjModel) -> int:
    """Return the index of the free joint whose pose is the channels; -1 if each channel has a joint
    of its own.
    """
    return _moved_by(model, POSE)


def base_joint(model: mujoco.MjModel) -> int:
    """Return the index of the free joint whose pose is measured beside driven joints; -1 without
    one.
    """
    return _moved_by(model, BASE)


def _moved_by(model: mujoco.MjModel, site: str) -> int:
    """Return the index of the joint of a site's body; -1 if there is no such site."""
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, site)
    if index < 0:
        return -1
    return int(model.body_jntadr[model.site_bodyid[index]])


def unit_wrenches(model: mujoco.MjModel, joint: int, drives: Sequence[int]) -> np.ndarray:
    """Return force and torque on a free joint, in the body's axes, for each actuator's unit of
    force, (drives, 6).
    """
    data = mujoco.MjData(model)
    place = model.jnt_qposadr[joint]
    dof = model.jnt_dofadr[joint]
    data.qpos[place : place + 7] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    mujoco.mj_forward(model, data)
    moments = np.zeros((model.nout, model.nv))
    rows = (data.moment_rownnz, data.moment_rowadr, data.moment_colind)
    mujoco.mju_sparse2dense(moments, data.actuator_moment, *rows)
    return moments[model.actuator_outadr[drives], dof : dof + 6]


def driven_ids(model: mujoco.MjModel) -> np.ndarray:
    """Return the indices of the driven channels' joints, (driven,)."""
    if (free := free_joint(model)) >= 0:
        return np.full(len(PLACES), free)
    names = [model.joint(model.actuator_trnid[i, 0]).name for i in drive_ids(model)]
    return np.array([model.joint(name.removeprefix(ROTOR)).id for name in names], int)


def joint_ids(model: mujoco.MjModel) -> np.ndarray:
    """Return the indices of the channels' joints, (n,): first the driven ones, then those that are
    only measured. A free joint has six channels.
    """
    joints = driven_ids(model).tolist()
    if free_joint(model) >= 0:
        return np.array(joints, int)
    base = base_joint(model)
    rotors = model.actuator_trnid[drive_ids(model), 0].tolist()
    for i in range(model.nsensor):
        if model.sensor_type[i] == mujoco.mjtSensor.mjSENS_JOINTPOS:
            if model.sensor_objid[i] not in (*joints, *rotors):
                joints.append(model.sensor_objid[i])
        elif base >= 0 and model.sensor(i).name == f"{BASE}:x":
            joints += [base] * len(PLACES)
    return np.array(joints, int)


def driven_names(plant: Plant) -> tuple[str, ...]:
    """Return the names of the joints that have an actuator, (driven,)."""
    return channel_names(plant)[: plant.driven]


@functools.lru_cache(maxsize=32)
def loaded(plant: Plant) -> mujoco.MjModel:
    """Return the model of a plant without parts. It is shared, so copy it before a change."""
    return plant.load()


@functools.lru_cache(maxsize=32)
def channel_names(plant: Plant) -> tuple[str, ...]:
    """Return a name for each channel, (n,): that of its joint, or for a pose such as body_x or
    base_rz.
    """
    model = loaded(plant)
    names = [model.joint(int(joint)).name for joint in joint_ids(model)]
    if plant.pose:
        return tuple(f"{name}_{place}" for name, place in zip(names, PLACES, strict=True))
    if plant.base >= 0:
        names[plant.base : plant.base + len(PLACES)] = [f"base_{place}" for place in PLACES]
    return tuple(names)


@functools.lru_cache(maxsize=32)
def all_joints(plant: Plant) -> tuple[str, ...]:
    """Return the names of all hinges and slides of a plant, first those of its channels."""
    model = loaded(plant)
    names = []
    for joint in range(model.njnt):
        if model.jnt_type[joint] >= mujoco.mjtJoint.mjJNT_SLIDE.value:  # or a hinge
            names.append(model.joint(joint).name)
    first = [name for name in channel_names(plant) if name in names]
    ordered = dict.fromkeys((*first, *names))
    return tuple(filter(None, ordered))


@functools.lru_cache(maxsize=32)
def moves_alone(plant: Plant) -> bool:
    """Return whether each joint of a plant has its own equation: constant inertia, a motor, and no
    constraint.

    Springs and dampers may join the joints, because their forces are smooth.
    """
    model = loaded(plant)
    motors = np.all(model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED) and np.all(
        model.actuator_gainprm[:, 0] == 1
    )
    motors &= np.all(model.actuator_biastype == mujoco.mjtBias.mjBIAS_NONE)
    motors &= np.all(model.actuator_dyntype == mujoco.mjtDyn.mjDYN_NONE)
    # u is within the motors' ranges
    motors &= model.nactuator == plant.driven and not np.any(model.jnt_actgravcomp)
    alone = (
        model.nv == model.njnt == plant.n
        and np.all(model.dof_parentid < 0)
        and not np.any(model.tendon_armature)
    )
    return bool(plant.smooth and alone and motors)


def column_ends(plant: Plant) -> tuple[str, ...]:
    """Return what follows x, v, u, ... in the name of each channel's column: "", or 0, 1, ..., or
    _shoulder, ...
    """
    if plant.n == 1:
        return ("",)
    if plant.direct:
        return tuple(f"_{name}" for name in channel_names(plant))
    return tuple(map(str, range(plant.n)))


def dof_ids(model: mujoco.MjModel) -> np.ndarray:
    """Return the indices of the channels' degrees of freedom, (n,)."""
    joints = joint_ids(model)
    dofs = model.jnt_dofadr[joints]
    pose = max(free_joint(model), base_joint(model))
    if pose >= 0:
        dofs[joints == pose] += np.arange(len(PLACES))
    return dofs


def initial_pose(compiled: mujoco.MjModel) -> np.ndarray:
    """Return the pose from which joints without a channel start, (nq,): the model's start keyframe,
    or else qpos0.
    """
    key = mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_KEY, START)
    return (compiled.qpos0 if key < 0 else compiled.key_qpos[key]).copy()


def moving_joints(model: mujoco.MjModel) -> np.ndarray:
    """Return the joints of the channels and those that their actuators drive, rotors or the same
    joints, (2, n).
    """
    if free_joint(model) >= 0:
        return np.array([joint_ids(model)] * 2)
    joints = joint_ids(model)
    driven = model.actuator_trnid[drive_ids(model), 0]
    return np.array([joints, [*driven, *joints[len(driven) :]]])


def state_with(
    model: mujoco.MjModel, joints: np.ndarray, x: Any, v: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Return qpos and qvel with `moving_joints` at the channels' x and v, and other joints as in
    `initial_pose`.
    """
    qpos = initial_pose(model)
    qvel = np.zeros(model.nv)
    pose = max(free_joint(model), base_joint(model))
    if pose >= 0:
        of_pose = np.atleast_2d(joints)[0] == pose
        x = np.asarray(x)
        v = np.broadcast_to(v, x.shape)
        first = model.jnt_qposadr[pose]
        dof = model.jnt_dofadr[pose]
        place = x[of_pose]
        turn = rotation.quaternion(*place[3:])
        qpos[first : first + 7] = [*place[:3], *turn]
        qvel[dof : dof + 6] = v[of_pose]
        joints = joints[..., ~of_pose]
        x = x[~of_pose]
        v = v[~of_pose]
    qpos[model.jnt_qposadr[joints]] = x
    qvel[model.jnt_dofadr[joints]] = v
    return qpos, qvel


def posed(model: mujoco.MjModel, x: Any) -> mujoco.MjData:
    """Return the data of a model with its channels at x, (n,) rad or m, at rest."""
    data = mujoco.MjData(model)
    state = state_with(model, moving_joints(model), x, 0.0)
    data.qpos[:] = state[0]
    mujoco.mj_kinematics(model, data)
    return data
