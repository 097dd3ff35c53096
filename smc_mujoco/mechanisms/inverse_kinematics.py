"""Inverse kinematics: positions of joints at which a tip, a site or body, is where it should be.

Levenberg's method with MuJoCo's Jacobians: dx = J' (J J' + mu)^-1 e, mu = |e|^2 / 100, at most 0.3 rad or m a step.
It converges quadratically where J has full rank, and stays bounded where the arm is stretched. MuJoCo's Jacobians are
exact and at hand; a package such as mink would add a solver of quadratic programs, which this problem does not need.
Joints stay within their ranges. Joints without a channel stay in the pose in which runs start.
"""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, find, number
from smc_mujoco.mechanisms.hardware.part import initial_pose
from smc_mujoco.mechanisms.plant import Plant

TOLERANCE = 1e-9  # m and rad, of the tip
MAX_STEPS = 200  # to a point
MAX_MOVE = 0.3  # rad or m, of a step


@dataclasses.dataclass
class Tip:
    """A site or body of a plant and the joints that move it."""

    plant: Plant
    joints: Sequence[str]
    site: str | None
    body: str | None
    orientation: Sequence[float] | None = None

    def __post_init__(self):
        self.model = self.plant.load()
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = initial_pose(self.model)
        kind, name = ("site", self.site) if self.site is not None else ("body", self.body)
        count = self.model.nsite if kind == "site" else self.model.nbody
        names = [getattr(self.model, kind)(i).name for i in range(count)]
        self.id = find(f"{kind} of {self.plant.name}", name, {known: i for i, known in enumerate(names) if known})
        ids = [self.model.joint(joint).id for joint in self.joints]
        self.qpos, self.dofs = self.model.jnt_qposadr[ids], self.model.jnt_dofadr[ids]
        limited = self.model.jnt_limited[ids].astype(bool)
        self.low = np.where(limited, self.model.jnt_range[ids, 0], -np.inf)
        self.high = np.where(limited, self.model.jnt_range[ids, 1], np.inf)
        if self.orientation is not None:
            turn = np.array([number("orientation", part) for part in self.orientation])
            if turn.shape != (4,) or not np.linalg.norm(turn):
                raise ScenarioError(f"orientation is {self.orientation}: give a quaternion (w, x, y, z)")
            self.turn = turn / np.linalg.norm(turn)

    def place(self, x: np.ndarray) -> np.ndarray:
        """Return the tip's position at joint positions x, (n,)."""
        self.data.qpos[self.qpos] = x
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        return (self.data.site_xpos if self.site is not None else self.data.xpos)[self.id].copy()

    def error(self, x: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the way to a point, m, and the orientation, rad, (3,) or (6,), and the Jacobian, (3 or 6, n)."""
        away = point - self.place(x)
        moves, turns = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        jacobian = mujoco.mj_jacSite if self.site is not None else mujoco.mj_jacBody
        jacobian(self.model, self.data, moves, turns, self.id)
        if self.orientation is None:
            return away, moves[:, self.dofs]
        now, twist = np.empty(4), np.empty(3)
        frame = self.data.site_xmat if self.site is not None else self.data.xmat
        mujoco.mju_mat2Quat(now, frame[self.id])
        mujoco.mju_subQuat(twist, self.turn, now)  # in the tip's frame
        away = np.concatenate([away, frame[self.id].reshape(3, 3) @ twist])
        return away, np.concatenate([moves, turns])[:, self.dofs]


def solve(tip: Tip, points: np.ndarray, start: Sequence[float]) -> np.ndarray:
    """Return joint positions, (N, n), with the tip at points, (N, 3), m. Each search starts where the last ended."""
    x, path, away = np.array(start, float), [], np.zeros(3)
    for i, point in enumerate(points):
        for _ in range(MAX_STEPS):
            away, J = tip.error(x, point)
            size = float(away @ away)
            if size < TOLERANCE**2:
                break
            move = J.T @ np.linalg.solve(J @ J.T + (0.01 * size + 1e-14) * np.eye(len(away)), away)
            move *= min(1.0, MAX_MOVE / float(np.abs(move).max() + 1e-300))
            x = np.clip(x + move, tip.low, tip.high)
        else:
            there = ", ".join(f"{value:.4g}" for value in point)
            sizes = zip(np.split(away, [3]) if len(away) > 3 else [away], ("m", "rad"), strict=False)
            distances = " and ".join(f"{np.linalg.norm(part):.3g} {unit}" for part, unit in sizes)
            raise ScenarioError(
                f"the tip of {tip.plant.name} does not reach ({there}) m, point {i} of {len(points)} on its path: it "
                f"stays {distances} away; give points within reach, or another x0"
            )
        path.append(x)
    return np.array(path)
