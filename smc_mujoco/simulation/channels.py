"""Channels: the indices in mjData of each degree of freedom that a law sees."""

import mujoco
import numpy as np
from numba import njit

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import record_at
from smc_mujoco.mechanisms.hardware.part import PASSIVE, drive_ids, joint_ids
from smc_mujoco.mechanisms.plant import DIRECT_TEXT

# Indices of a channel in arrays of mjData, -1 if there is none:
#   qpos, qvel, ctrl: in the arrays of these names; x_sensor and v_sensor: in sensordata; force: in actuator_force
#   shaft: in qvel, of what the actuator drives: the joint, or its rotor
#   xfrc: of the body's force along the joint, in xfrc_applied; `sign` is 1 or -1, the sign with which d enters there
#   horizontal: of the body's horizontal force, in xfrc_applied; for a hinge along the axis `axis` of the world, 0 or 1
#   hinge_body: of the body of a hinge, in xipos; anchor: of a hinge, in xanchor and xaxis
#   friction_force: of a friction's actuator, in actuator_force; friction_ctrl: in ctrl, if the callback computes it
#   qfrc: in qfrc_applied, of users' models, whose disturbances act on joints
CHANNEL = np.dtype(
    [
        (name, "i8")
        for name in (
            "qpos", "qvel", "x_sensor", "v_sensor", "ctrl", "force", "shaft", "xfrc", "sign", "horizontal", "axis",
            "hinge_body", "anchor", "friction_force", "friction_ctrl", "qfrc",
        )
    ]
)  # fmt: skip
channel_at = record_at(CHANNEL)  # how compiled code reads channel i of an array at an address

_SENSORS = {"x_sensor": mujoco.mjtSensor.mjSENS_JOINTPOS, "v_sensor": mujoco.mjtSensor.mjSENS_JOINTVEL}


@njit(error_model="numpy", inline="always")
def lever(channel, xipos, xanchor, xaxis):
    """Return the torque of a horizontal force of 1 N about a hinge, m: axis . (arm x force). All are flat arrays."""
    j, k = channel.axis + 1, (channel.axis + 2) % 3
    arm_j = xipos[channel.hinge_body + j] - xanchor[channel.anchor + j]
    arm_k = xipos[channel.hinge_body + k] - xanchor[channel.anchor + k]
    return xaxis[channel.anchor + j] * arm_k - xaxis[channel.anchor + k] * arm_j


def channels(model: mujoco.MjModel) -> np.ndarray:
    """Return the channels, (n,) CHANNEL: one for each actuator that takes commands, then one for each other joint.

    A disturbance d acts on the body of the joint, as a force along the axis of a slide or a torque about the axis of a
    hinge, so that its generalised force is d. A horizontal force acts on the body's centre of mass.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for i in drive_ids(model):
        if model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_JOINT or model.actuator_gear[i, 0] != 1.0:
            raise ScenarioError(f"actuator {model.actuator(i).name!r} does not drive a joint with gear 1: give it one")
    joints, drives = joint_ids(model).tolist(), drive_ids(model).tolist()
    drives += [-1] * (len(joints) - len(drives))
    rows = [_channel(model, data, drive, joint) for drive, joint in zip(drives, joints, strict=True)]
    return np.array([tuple(one[name] for name in CHANNEL.names or ()) for one in rows], CHANNEL)


def _channel(model: mujoco.MjModel, data: mujoco.MjData, drive: int, joint: int) -> dict[str, int]:
    """Return the fields of a CHANNEL; `drive` is -1 for a joint without an actuator."""
    body = int(model.jnt_bodyid[joint])
    name = f"actuator {model.actuator(drive).name!r}" if drive >= 0 else f"sensor of joint {model.joint(joint).name!r}"
    hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
    if not hinge and model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_SLIDE:
        raise ScenarioError(f"{name} is not on a hinge or slide joint: give it one")
    direct = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, DIRECT_TEXT) >= 0
    axis = np.array([0.0, 0.0, 1.0]) if direct else data.xaxis[joint].round(12)  # a direct channel may have any axis
    if np.count_nonzero(axis) != 1:
        raise ScenarioError(f"the joint of {name} has axis {axis}: align it with a world axis")
    component = int(np.argmax(np.abs(axis)))
    friction = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, PASSIVE + model.joint(joint).name)
    computed = friction >= 0 and model.actuator_ctrlnum[friction] > 0  # a friction by a formula
    xfrc, sign = 6 * body + component + 3 * hinge, int(np.sign(axis[component]))
    indices = {
        "qpos": model.jnt_qposadr[joint],
        "qvel": model.jnt_dofadr[joint],
        "ctrl": model.actuator_ctrladr[drive] if drive >= 0 else -1,
        "force": model.actuator_outadr[drive] if drive >= 0 else -1,
        "shaft": model.jnt_dofadr[model.actuator_trnid[drive, 0]] if drive >= 0 else -1,
        "xfrc": xfrc,
        "sign": sign,
        "horizontal": xfrc,
        "axis": 0,
        "hinge_body": -1,
        "anchor": -1,
        "friction_force": -1 if friction < 0 else model.actuator_outadr[friction],
        "friction_ctrl": model.actuator_ctrladr[friction] if computed else -1,
        "qfrc": model.jnt_dofadr[joint] if direct else -1,
    }
    if hinge:
        across = int(component == 0)  # a horizontal axis across that of the hinge
        indices |= {"horizontal": 6 * body + across, "axis": across, "hinge_body": 3 * body, "anchor": 3 * joint}
    for field, kind in _SENSORS.items():
        sensors = np.flatnonzero((model.sensor_type == kind) & (model.sensor_objid == joint))
        if not len(sensors):
            raise ScenarioError(f"the joint of {name} has no {kind.name[7:].lower()} sensor: add one")
        indices[field] = model.sensor_adr[sensors[0]]
    return indices
