"""A free body, such as the quadrotor, as a gymnasium environment.

    environment = gymnasium.make("smc_mujoco:smc/Quadrotor-v0")

The callback of `smc.run` moves the body, with its rotors and drag. An action has a number in [-1,
1] for each actuator, from its least to its largest force, held for a control period: a rotor's
thrust, not its speed. An observation is the pose, position in m and rotation vector in rad, then
the velocity, and the angular velocity in the axes of the body; for `track` also r, r' and r''. The
task and its reward are those of `tasks`, with the errors that count: not the tilt of a body that
leans to move. The info has "time", s, and "error", of the pose, (6,).
"""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.aliases import ArrayPair
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.envs.gymnasium_env import PlantEnv, action_space
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.layout import drive_ids, free_joint, unit_wrenches
from smc_mujoco.mechanisms.plant import Plant


class FlightEnv(PlantEnv):
    """One free body with a task, `regulate` or `track`."""

    flies = True

    def __init__(
        self,
        plant: Plant | str,
        task: str = "regulate",
        changes: Mapping[str, Any] | None = None,
        render_mode: str | None = None,
    ):
        """Make a free body with one of its tasks.

        `changes`: Scenario field -> value, of `episode.FIELDS`.
        """
        super().__init__(plant, task, changes, render_mode)
        model = self.setting.model
        scenario = self.setting.scenario
        drives = drive_ids(model)
        if not model.actuator_ctrllimited[drives].all():
            raise ScenarioError(
                f"an actuator of {scenario.plant.name} has no ctrlrange: give each one"
            )
        self.wrenches = model.actuator_gainprm[drives, :1] * unit_wrenches(
            model, free_joint(model), drives.tolist()
        )
        self.least, self.most = model.actuator_ctrlrange[drives].T
        self.setting.action_shape = (len(drives),)
        self.setting.limits = np.ones(len(drives))
        self.action_space = action_space(self.setting)
        self.begin(self.data, self.np_random)

    def advance(self, action: Any) -> None:
        """Take one control period and read the pose."""
        share = 0.5 + 0.5 * self.setting.command(action)
        wrench = (self.least + share * (self.most - self.least)) @ self.wrenches
        attitude = rotation.quaternion(*self.x[3:])
        self.take(np.array([*rotation.turned(attitude, *wrench[:3]), *wrench[3:]]))

    def read_state(self, data: mujoco.MjData) -> None:
        """Read the pose and its velocity, (6,) each."""
        self.callback_records.check()
        first = self.setting.qpos[3]
        dof = self.setting.qvel[0]
        turn = rotation.rotation_vector(*data.qpos[first : first + 4])
        self.x = np.array([*data.qpos[first - 3 : first], *turn])
        self.v = data.qvel[dof : dof + 6].copy()
        self.diverged = bool(self.setting.diverged(self.x, self.v))

    def errors(self) -> ArrayPair:
        """Return the errors of the pose and of its velocity, (6,) each."""
        r = np.concatenate([self.setting.rest_x, np.zeros(6)])
        if self.setting.task.moving:
            r = self.setting.reference(self.sample)[:12]
        e = self.x - r[:6]
        w = self.v - r[6:]
        rotation.put_attitude_error(self.x, self.v, r[:6], r[6:], e, w)
        return e, w
