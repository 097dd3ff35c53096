"""A free body, such as the quadrotor, as a gymnasium environment.

    environment = gymnasium.make("smc_mujoco:smc/Quadrotor-v0")

The callback of `smc.run` moves the body, with its rotors and drag. An action has a number in [-1, 1] for each
actuator, from its least to its largest force, held for a control period: a rotor's thrust, not its speed. An
observation is the pose, position in m and rotation vector in rad, then the velocity, and the angular velocity in the
axes of the body; for `track` also r, r' and r''. The task and its reward are those of `tasks`, with the errors that
count: not the tilt of a body that leans to move. The info has "time", s, and "error", of the pose, (6,).
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.envs.episode import Setting, bounded
from smc_mujoco.envs.gymnasium_env import PlantEnv, Single
from smc_mujoco.envs.tasks import reward
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.hardware.part import drive_ids, exerted, free_joint
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import callback, state
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import ScenarioBatch

# isort: split
import gymnasium  # already imported by gymnasium_env


class FlightEnv(Single):
    """One free body with a task, `regulate` or `track`."""

    def __init__(
        self,
        plant: Plant | str,
        task: str = "regulate",
        changes: Mapping[str, Any] | None = None,
        render_mode: str | None = None,
    ):
        """Make a free body with one of its tasks. `changes`: Scenario field -> value, of `episode.FIELDS`."""
        setting = Setting(plant, task, changes, flies=True)
        model, name = setting.model, setting.scenario.plant.name
        drives = drive_ids(model)
        if not model.actuator_ctrllimited[drives].all():
            raise ScenarioError(f"an actuator of {name} has no ctrlrange: give each one")
        self.wrenches = model.actuator_gainprm[drives, :1] * exerted(model, free_joint(model), drives.tolist())
        self.least, self.most = model.actuator_ctrlrange[drives].T
        setting.action_shape, setting.limits = (len(drives),), np.ones(len(drives))
        self.set_up(setting, render_mode)
        self.begin(np.array(setting.scenario.x0), np.array(setting.scenario.v0))

    def begin(self, x0: np.ndarray, v0: np.ndarray) -> None:
        """Begin an episode from a pose and its velocity, (6,) each."""
        start = dataclasses.replace(self.setting.flown, x0=tuple(x0.tolist()), v0=tuple(v0.tolist()))
        with callback.installed():
            self.batch = ScenarioBatch([prepare(start)], threads=1)
        self.memory = state.view(self.batch.packed[0].numbers, int(self.batch.records["law"]["memory"][0]), (len(x0),))
        self.sample = 0

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode from a start that is drawn, or set by the options x0 and v0."""
        super().reset(seed=seed)
        self.begin(*self.setting.draw_start(self.np_random, options))
        x, v = self.pose()
        return self.setting.observe(x, v, 0), self.judged(x, v)[1]

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Take one control period. Return observation, reward, terminated, truncated and the info."""
        share = 0.5 + 0.5 * self.setting.command(action)
        wrench = (self.least + share * (self.most - self.least)) @ self.wrenches
        self.memory[:] = *rotation.turned(rotation.quaternion(*self.pose()[0][3:]), *wrench[:3]), *wrench[3:]
        self.sample += 1
        with callback.installed():
            self.batch.advance_to(self.sample * self.setting.scenario.steps)
        x, v = self.pose()
        observation, lost = self.setting.observe(x, v, self.sample), bool(self.setting.diverged(x, v))
        reward, info = (0.0, {"time": self.time, "error": np.full(len(x), np.nan)}) if lost else self.judged(x, v)
        observation = bounded(observation) if lost else observation
        return observation, reward, lost, self.sample >= self.max_samples, info

    @property
    def time(self) -> float:
        """Time of the episode, s."""
        return self.sample * self.setting.scenario.control_period

    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the pose and its velocity, (6,) each."""
        qpos, qvel = self.batch.batch.bind("qpos")[0], self.batch.batch.bind("qvel")[0]
        first, dof = self.setting.qpos[3], self.setting.qvel[0]
        turn = rotation.rotation_vector(*qpos[first : first + 4])
        return np.array([*qpos[first - 3 : first], *turn]), qvel[dof : dof + 6].copy()

    def judged(self, x: np.ndarray, v: np.ndarray) -> tuple[float, dict[str, Any]]:
        """Return reward and info of a pose and its velocity, (6,) each."""
        r = np.concatenate([self.setting.rest_x, np.zeros(6)])
        if self.setting.task.moving:
            r = self.setting.reference(self.sample)[:12]
        e, w = x - r[:6], v - r[6:]
        rotation.put_attitude_error(x, v, r[:6], r[6:], e, w)
        counted = list(self.setting.scenario.plant.judged)
        return float(reward(e[counted], w[counted])), {"time": self.time, "error": e}

    def posed(self) -> mujoco.MjData:
        """Return the data of the body's model, at its pose."""
        data = mujoco.MjData(self.setting.model)
        data.qpos[:] = self.batch.batch.bind("qpos")[0]
        return data


def environment(plant: Plant | str, *args: Any, **kwargs: Any) -> gymnasium.Env:
    """Return the environment of a plant: a FlightEnv of a free body, else a PlantEnv. Arguments are those of both."""
    return (FlightEnv if as_plant(plant).pose else PlantEnv)(plant, *args, **kwargs)
