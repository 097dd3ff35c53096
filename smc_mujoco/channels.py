"""The channels of a compiled model: where each actuated degree of freedom lies in mjData."""

import mujoco
import numpy as np

from smc_mujoco.errors import ScenarioError

# Columns of the channel table: addresses into qpos, qvel, sensordata (twice), ctrl and xfrc_applied, and the sign with
# which a generalised force d enters there.
QPOS, QVEL, X_SENSOR, V_SENSOR, CTRL, XFRC, SIGN = range(7)
_SENSORS = {X_SENSOR: mujoco.mjtSensor.mjSENS_JOINTPOS, V_SENSOR: mujoco.mjtSensor.mjSENS_JOINTVEL}


def channels(model: mujoco.MjModel) -> np.ndarray:
    """The channel table, (nu, 7) int64: one row per actuator, in the model's order.

    A disturbance d acts on the body that carries the joint, as a force along a slide's axis or a torque about a
    hinge's, so that its generalised force is d.

    Raises:
      ScenarioError: an actuator that drives no hinge or slide with gear 1, that lacks a position or velocity sensor, or
        whose joint's axis lies along no world axis.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    table = np.empty((model.nu, 7), np.int64)
    for i in range(model.nu):
        name, joint = model.actuator(i).name, int(model.actuator_trnid[i, 0])
        if model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_JOINT or model.actuator_gear[i, 0] != 1.0:
            raise ScenarioError(f"actuator {name!r} does not drive a joint with gear 1: give it one")
        hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        if not hinge and model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_SLIDE:
            raise ScenarioError(f"actuator {name!r} drives no hinge or slide joint: give it one")
        axis = data.xaxis[joint].round(12)
        if np.count_nonzero(axis) != 1:
            raise ScenarioError(f"the joint of actuator {name!r} has axis {axis}: align it with a world axis")
        component = int(np.argmax(np.abs(axis)))
        table[i, [QPOS, QVEL, CTRL]] = model.jnt_qposadr[joint], model.jnt_dofadr[joint], i
        table[i, XFRC] = 6 * model.jnt_bodyid[joint] + component + 3 * hinge
        table[i, SIGN] = np.sign(axis[component])
        for column, kind in _SENSORS.items():
            found = np.flatnonzero((model.sensor_type == kind) & (model.sensor_objid == joint))
            if not len(found):
                raise ScenarioError(f"the joint of actuator {name!r} has no {kind.name[7:].lower()} sensor: add one")
            table[i, column] = model.sensor_adr[found[0]]
    return table
