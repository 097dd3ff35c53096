"""The channels of a compiled model: where each actuated degree of freedom lies in mjData."""

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.part import PASSIVE, drive_ids, joint_ids
from smc_mujoco.mechanisms.plant import DIRECTLY

# Columns of the channel table: addresses into qpos, qvel, sensordata (twice), ctrl and actuator_force; address into
# xfrc_applied of a generalised force d and the sign with which it enters there; the same of a horizontal force on the
# body, the components of xipos and xanchor between which its lever arm lies (-1 for a slide), and the address into
# actuator_force of a friction (-1 without one); and where disturbances act on the joint itself, as in own models, the
# address into qfrc_applied (else -1). CTRL and FORCE are -1 where the channel has no actuator.
QPOS, QVEL, X_SENSOR, V_SENSOR, CTRL, FORCE, XFRC, SIGN, PUSH, PUSH_SIGN, TIP, ANCHOR, FRICTION, DIRECT = range(14)
COLUMNS = 14
_SENSORS = {X_SENSOR: mujoco.mjtSensor.mjSENS_JOINTPOS, V_SENSOR: mujoco.mjtSensor.mjSENS_JOINTVEL}
# Axis of a hinge -> direction of the horizontal force, component of its lever arm, sign of arm x force about the axis.
_LEVERS = {0: (1, 2, -1), 1: (0, 2, 1), 2: (0, 1, -1)}


def channels(model: mujoco.MjModel) -> np.ndarray:
    """The channel table, (n, 14) int64: a row per actuator that takes commands, then one per joint only measured.

    A disturbance d acts on the body that carries the joint, as a force along a slide's axis or a torque about a
    hinge's, so that its generalised force is d; a horizontal one acts on its centre of mass.

    Raises:
      ScenarioError: an actuator that drives no hinge or slide with gear 1, that lacks a position or velocity sensor, or
        whose joint's axis lies along no world axis, which own models alone may have.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for i in drive_ids(model):
        if model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_JOINT or model.actuator_gear[i, 0] != 1.0:
            raise ScenarioError(f"actuator {model.actuator(i).name!r} does not drive a joint with gear 1: give it one")
    every, drives = joint_ids(model).tolist(), drive_ids(model).tolist()
    drives += [-1] * (len(every) - len(drives))
    rows = [_row(model, data, drive, joint) for drive, joint in zip(drives, every, strict=True)]
    return np.array(rows, np.int64)


def _row(model: mujoco.MjModel, data: mujoco.MjData, drive: int, joint: int) -> list[int]:
    body = int(model.jnt_bodyid[joint])
    name = f"actuator {model.actuator(drive).name!r}" if drive >= 0 else f"sensor of joint {model.joint(joint).name!r}"
    hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
    if not hinge and model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_SLIDE:
        raise ScenarioError(f"{name} is on no hinge or slide joint: give it one")
    direct = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, DIRECTLY) >= 0
    axis = np.array([0.0, 0.0, 1.0]) if direct else data.xaxis[joint].round(12)  # direct ones take any
    if np.count_nonzero(axis) != 1:
        raise ScenarioError(f"the joint of {name} has axis {axis}: align it with a world axis")
    component = int(np.argmax(np.abs(axis)))
    row = [0] * COLUMNS
    row[QPOS], row[QVEL] = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    row[CTRL] = model.actuator_ctrladr[drive] if drive >= 0 else -1
    row[FORCE] = model.actuator_outadr[drive] if drive >= 0 else -1
    row[XFRC], row[SIGN] = 6 * body + component + 3 * hinge, int(np.sign(axis[component]))
    row[PUSH], row[PUSH_SIGN], row[TIP], row[ANCHOR] = row[XFRC], row[SIGN], -1, -1
    if hinge:
        direction, arm, sign = _LEVERS[component]
        row[PUSH], row[PUSH_SIGN] = 6 * body + direction, sign * row[SIGN]
        row[TIP], row[ANCHOR] = 3 * body + arm, 3 * joint + arm
    row[DIRECT] = model.jnt_dofadr[joint] if direct else -1
    friction = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, PASSIVE + model.joint(joint).name)
    row[FRICTION] = -1 if friction < 0 else model.actuator_outadr[friction]
    for column, kind in _SENSORS.items():
        found = np.flatnonzero((model.sensor_type == kind) & (model.sensor_objid == joint))
        if not len(found):
            raise ScenarioError(f"the joint of {name} has no {kind.name[7:].lower()} sensor: add one")
        row[column] = model.sensor_adr[found[0]]
    return row
