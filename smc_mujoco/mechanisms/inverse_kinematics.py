"""Inverse kinematics: positions of joints at which a tip (a site or a body) is where it should be.

Levenberg's method with MuJoCo's Jacobians: dx = J' (J J' + mu)^-1 e, mu = |e|^2 / 100, at most 0.3
rad or m a step.
It converges quadratically where J has full rank, and stays bounded where the arm is stretched.
MuJoCo's Jacobians are exact and at hand; a package such as mink would add a solver of quadratic
programs, which this problem does not need. Joints stay within their ranges. Joints without a
channel stay in the pose in which runs start.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.mechanisms.layout import initial_pose, joint_ids
from smc_mujoco.mechanisms.plant import Plant

TOLERANCE = 1e-9  # m, of the tip
MAX_STEPS = 200  # of the iteration, for each point
MAX_MOVE = 0.3  # rad or m, of any joint in a step


def solve(
    plant: Plant, kind: str, name: str, points: np.ndarray, start: Sequence[float]
) -> np.ndarray:
    """Return the channels' positions, (N, n), with the tip, a "site" or "body" of this name, at
    points, (N, 3), m.

    Each search starts where the last ended.
    """
    model = plant.load()
    data = mujoco.MjData(model)
    data.qpos[:] = initial_pose(model)
    numbers = {}
    for i in range(model.nsite if kind == "site" else model.nbody):
        element_name = getattr(model, kind)(i).name
        if element_name:
            numbers[element_name] = i
    tip = find(f"{kind} of {plant.name}", name, numbers)
    if kind == "site":
        places = data.site_xpos
        jacobian = mujoco.mj_jacSite
    else:
        places = data.xpos
        jacobian = mujoco.mj_jacBody
    ids = joint_ids(model)
    moves = np.zeros((3, model.nv))
    limited = model.jnt_limited[ids].astype(bool)
    low = np.where(limited, model.jnt_range[ids, 0], -np.inf)
    high = np.where(limited, model.jnt_range[ids, 1], np.inf)
    x = np.array(start, float)
    path = []
    away = np.zeros(3)
    for i, point in enumerate(points):
        for _ in range(MAX_STEPS):
            data.qpos[model.jnt_qposadr[ids]] = x
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            away = point - places[tip]
            size = float(away @ away)
            if size < TOLERANCE**2:
                break
            jacobian(model, data, moves, None, tip)
            J = moves[:, model.jnt_dofadr[ids]]
            damping = (0.01 * size + 1e-14) * np.eye(3)
            move = J.T @ np.linalg.solve(J @ J.T + damping, away)
            longest = np.abs(move).max() + 1e-300
            move *= min(1.0, MAX_MOVE / float(longest))
            x = np.clip(x + move, low, high)
        else:
            coordinates = ", ".join(f"{value:.4g}" for value in point)
            raise ScenarioError(
                f"the tip of {plant.name} does not reach ({coordinates}) m, "
                f"point {i} of {len(points)} on its path: it "
                f"stays {np.linalg.norm(away):.3g} m away; give points within reach, or another x0"
            )
        path.append(x)
    return np.array(path)
