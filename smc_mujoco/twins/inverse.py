"""Inverse dynamics: the torques that a measured motion takes."""

import mujoco
import numpy as np
from scipy.signal import savgol_filter

from smc_mujoco.mechanisms.hardware.part import dof_ids, joint_ids
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.twins.records import Columns, Record, step_of

SAMPLES, ORDER = 21, 3  # of the cubic about each sample; chosen: 42 ms at 500 Hz
STRIDE = 5  # samples of which one is compared, as neighbours share a cubic; chosen


def smoothed(data: Record, names: tuple[str, ...]) -> Record:
    """Return every STRIDE-th sample of columns, by the cubic through the samples about it."""
    return {name: np.asarray(savgol_filter(data[name], SAMPLES, ORDER))[::STRIDE] for name in names}


def torques(plant: Plant, data: Record, columns: Columns) -> Record:
    """Return the torque of each joint at every STRIDE-th sample, by MuJoCo's inverse dynamics of a measured motion."""
    model = plant.load()
    held, joints, dofs = mujoco.MjData(model), joint_ids(model), dof_ids(model)
    step = step_of(data, columns)
    x = np.column_stack(list(smoothed(data, columns.x).values()))
    v = np.column_stack(list(smoothed(data, columns.v).values()))
    a = np.column_stack(
        [np.asarray(savgol_filter(data[name], SAMPLES, ORDER, deriv=1, delta=step))[::STRIDE] for name in columns.v]
    )
    found = np.empty_like(x)
    at = model.jnt_qposadr[joints]
    for k in range(len(x)):
        held.qpos[at], held.qvel[dofs], held.qacc[dofs] = x[k], v[k], a[k]
        mujoco.mj_inverse(model, held)
        found[k] = held.qfrc_inverse[dofs]
    return {name: found[:, i] for i, name in enumerate(columns.torque)}
