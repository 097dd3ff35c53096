"""Plants as gymnasium environments.

    environment = gymnasium.make("smc_mujoco:smc/Duffing-v0", task="track")

An observation is one array of positions and velocities, and for `track` also r, r', r''. An action
is the command of the driven channels, divided by their limits. An episode is truncated at the
scenario's duration, and terminated if the plant diverges. The
info has "time", s since the start, and "error", the e of the task in each channel. Tasks and
rewards: `help("smc_mujoco.envs.tasks")`. `smc.envs.vector` has many copies of a plant in one batch.
"""

from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common import gl
from smc_mujoco.common.aliases import Array, Data, Fields
from smc_mujoco.common.constraints import OneOf
from smc_mujoco.common.extras import extra
from smc_mujoco.envs import registration
from smc_mujoco.envs.episode import Episode, Setting, bounded
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.controller import MAX_STATE

with extra("rl", "smc_mujoco.envs.gymnasium_env"):
    import gymnasium
    from gymnasium import spaces

registration.register()  # also if only this module is imported


def action_space(setting: Setting) -> spaces.Box:
    """Return the space of actions, of float32, as learners want it; `step` takes float64 too, and
    rounds nothing.
    """
    return spaces.Box(-1.0, 1.0, setting.action_shape, np.float32)


def observation_space(setting: Setting) -> spaces.Box:
    """Return the space of observations: up to the largest state of a run."""
    return spaces.Box(-MAX_STATE, MAX_STATE, (setting.observation_size,), np.float64)


class PlantEnv(Episode, gymnasium.Env):
    """One plant with a task. It has the attributes of an Episode too.

    Args:
      plant, task: a plant or its name, and "regulate" or another of `smc.envs.tasks`.
      changes: fields of the scenario, such as {"control_period": 0.01, "u_max": 4.0}, see
        `__init__`.
      render_mode: "rgb_array" for pictures by `render`, or None.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 1000}  # noqa: RUF012  # as gymnasium has it
    flies = False  # whether it is for free bodies

    def __init__(
        self,
        plant: Plant | str,
        task: str = "regulate",
        changes: Data | None = None,
        render_mode: str | None = None,
    ):
        """Make a plant with one of its tasks.

        `changes`: Scenario field -> value. The fields are duration, control_period, physics_step,
        integrator, u_max, x0, v0, reference, mismatch, friction, contact, mechanism and actuator.
        An environment has no input_delay, noise, sensor or disturbance.
        """
        super().__init__(Setting(plant, task, changes, flies=self.flies))
        if render_mode is not None:
            OneOf(names=["rgb_array"])("render_mode", render_mode)
        scenario = self.setting.scenario
        self.render_mode = render_mode
        self.max_samples = scenario.samples
        self.metadata = self.metadata | {"render_fps": max(1, round(1.0 / scenario.control_period))}
        self.action_space = action_space(self.setting)
        self.observation_space = observation_space(self.setting)
        self.renderer: mujoco.Renderer | None = None
        self.data = mujoco.MjData(self.setting.model)

    def reset(
        self, *, seed: int | None = None, options: Data | None = None
    ) -> tuple[Array, Fields]:
        """Begin an episode from a start that is drawn, or set by the options x0 and v0."""
        super().reset(seed=seed)
        self.begin(self.data, self.np_random, options)
        return self.setting.observe(self.x, self.v, 0), self.reward_and_info()[1]

    def step(self, action: Any) -> tuple[Array, float, bool, bool, Fields]:
        """Take one control period.

        Return observation, reward, terminated, truncated and the info.
        """
        self.advance(action)
        observation = self.setting.observe(self.x, self.v, self.sample)
        if self.diverged:
            observation = bounded(observation)
        reward, info = self.reward_and_info()
        return observation, reward, self.diverged, self.sample >= self.max_samples, info

    def advance(self, action: Any) -> None:
        """Take one control period and read the state."""
        self.take(self.setting.command(action))

    def take(self, command: Array) -> None:
        """Take one control period under a command and read the state."""
        self.apply_command(self.data, command)
        with self.setting.stepping():
            mujoco.mj_step(self.setting.model, self.data, self.setting.scenario.steps)
        self.sample += 1
        self.read_state(self.data)

    def render(self) -> Array | None:
        """Return a picture from the plant's camera, (height, width, 3), with render_mode
        "rgb_array", else None.
        """
        if self.render_mode is None:
            return None
        if (renderer := self.renderer) is None:
            renderer = self.renderer = gl.renderer(self.setting.model)
        mujoco.mj_forward(self.setting.model, self.data)
        renderer.update_scene(self.data, camera=0 if self.setting.model.ncam else -1)
        return renderer.render()

    def close(self) -> None:
        """Close the renderer."""
        if self.renderer is not None:
            self.renderer.close()
            self.renderer = None

    def __getstate__(self) -> Fields:
        """Return all but the renderer and what the callback keeps, for copies and other processes.

        A copy of an episode with the callback repeats it.
        """
        state = self.__dict__ | {"renderer": None}
        if self.setting.uses_callback:
            state |= {"runs": None, "data": None}
        return state

    def __setstate__(self, state: Fields) -> None:
        vars(self).update(state)
        if self.setting.uses_callback:
            self.data = mujoco.MjData(self.setting.model)
            commands = self.commands_given
            if self.episodes or commands:
                self.begin_at_start(self.data)
            for command in commands:
                self.take(command)
