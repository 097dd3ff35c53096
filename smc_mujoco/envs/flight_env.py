"""A free body, such as the quadrotor, as a gymnasium environment.

    environment = gymnasium.make("smc_mujoco:smc/Quadrotor-v0")

The callback of `smc.run` moves the body, with its rotors and drag. An action has a number in [-1,
1] for each actuator, from its least to its largest force, held for a control period: a rotor's
thrust, not its speed. An observation is the pose, position in m and rotation vector in rad, then
the velocity, and the angular velocity in the axes of the body; for `track` also r, r' and r''. The
task and its reward are those of `tasks`, with the errors that count: not the tilt of a body that
leans to move. The info has "time", s, and "error", of the pose, (6,).
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.envs.gymnasium_env import PlantEnv, action_space
from smc_mujoco.envs.tasks import Pair
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.hardware.part import drive_ids, exerted, free_joint
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import callback, state
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import ScenarioBatch


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
        self.wrenches = model.actuator_gainprm[drives, :1] * exerted(
            model, free_joint(model), drives.tolist()
        )
        self.least, self.most = model.actuator_ctrlrange[drives].T
        self.setting.action_shape = (len(drives),)
        self.setting.limits = np.ones(len(drives))
        self.action_space = action_space(self.setting)
        self.begin(self.data, self.np_random)

    def begin(
        self, data: mujoco.MjData, random: Any, options: Mapping[str, Any] | None = None
    ) -> None:
        """Begin an episode from a start that is drawn, or set by the options x0 and v0."""
        x0, v0 = self.setting.draw_start(random, options)
        self.start = dataclasses.replace(self.setting.flown, x0=x0, v0=v0)
        self.episodes += 1
        self.fly([])
        self.read_state(data)

    def fly(self, wrenches: list[np.ndarray]) -> None:
        """Begin at the start, and take a control period under each force and torque, (6,)."""
        self.flown: list[np.ndarray] = []
        self.sample = 0
        with callback.installed():
            self.batch = ScenarioBatch([prepare(self.start)], threads=1)
        place = int(self.batch.records["law"]["memory"][0])
        self.memory = state.view(self.batch.packed[0].numbers, place, (6,))
        for wrench in wrenches:
            self.fly_on(wrench)

    def fly_on(self, wrench: np.ndarray) -> None:
        """Take a control period under a force and a torque in the axes of the world, (6,)."""
        self.memory[:] = wrench
        self.flown.append(wrench)
        self.sample += 1
        with callback.installed():
            self.batch.advance_to(self.sample * self.setting.scenario.steps)

    def __getstate__(self) -> dict[str, Any]:
        """Return all but MuJoCo's batch, which cannot be copied: a copy flies its episode again."""
        return super().__getstate__() | {"batch": None, "memory": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.fly(self.flown)

    def advance(self, action: Any) -> None:
        """Take one control period and read the pose."""
        share = 0.5 + 0.5 * self.setting.command(action)
        wrench = (self.least + share * (self.most - self.least)) @ self.wrenches
        attitude = rotation.quaternion(*self.x[3:])
        self.fly_on(np.array([*rotation.turned(attitude, *wrench[:3]), *wrench[3:]]))
        self.read_state(self.data)

    def read_state(self, data: mujoco.MjData) -> None:
        """Read the pose and its velocity, (6,) each, and write the positions into the data that are
        drawn.
        """
        data.qpos[:], qvel = (self.batch.batch.bind(name)[0] for name in ("qpos", "qvel"))
        first = self.setting.qpos[3]
        dof = self.setting.qvel[0]
        turn = rotation.rotation_vector(*data.qpos[first : first + 4])
        self.x = np.array([*data.qpos[first - 3 : first], *turn])
        self.v = qvel[dof : dof + 6].copy()
        self.diverged = bool(self.setting.diverged(self.x, self.v))

    def errors(self) -> Pair:
        """Return the errors of the pose and of its velocity, (6,) each."""
        r = np.concatenate([self.setting.rest_x, np.zeros(6)])
        if self.setting.task.moving:
            r = self.setting.reference(self.sample)[:12]
        e = self.x - r[:6]
        w = self.v - r[6:]
        rotation.put_attitude_error(self.x, self.v, r[:6], r[6:], e, w)
        return e, w
