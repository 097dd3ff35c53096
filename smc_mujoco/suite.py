"""Plants as dm_env environments, through dm_control's control.Environment.

    environment = suite.load("duffing", "regulate", random=0)
    timestep = environment.reset()
    while not timestep.last():
        timestep = environment.step(agent(timestep))

An action is the command of the driven channels, in parts of their limits. Observations are {"position": x,
"velocity": v}, (n,) each, angles unwrapped, and for `track` "reference": r, r', r''; tasks and rewards stand in
`tasks`. They open in dm_control's viewer: viewer.launch(environment).
"""

import contextlib
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from dm_control.mujoco import Physics
from dm_control.mujoco.wrapper import MjModel
from dm_control.rl import control
from dm_env import specs

from smc_mujoco.errors import ScenarioError, shown
from smc_mujoco.plant import Plant
from smc_mujoco.setting import Setting, bounded, setting


class PlantPhysics(Physics):
    """dm_control's physics, in which a plant that leaves the finite world ends its episode and raises nothing."""

    @contextlib.contextmanager
    def check_invalid_state(self) -> Iterator[None]:
        """Leave it to `PlantTask.over`."""
        yield


class PlantTask(control.Task):
    """A task of `tasks` for dm_control.

    Attributes:
      setting: the plant with its task.
      random: the numpy generator of the starts.
      sample: control samples since the episode began.
    """

    def __init__(self, setting: Setting, random: Any):
        self.setting, self.random, self.sample = setting, random, 0
        self.x = self.v = np.zeros(setting.scenario.plant.n)
        self.over = False

    def initialize_episode(self, physics: Physics) -> None:
        """Draw a start."""
        data = physics.data.ptr
        self.setting.place(data.qpos, data.qvel, *self.setting.draw(self.random))
        self.sample = 0
        self._look(physics)

    def before_step(self, action: Any, physics: Physics) -> None:
        """Give the command to the actuators."""
        physics.data.ptr.ctrl[self.setting.ctrl] = self.setting.command(action)

    def after_step(self, physics: Physics) -> None:
        """Count the sample."""
        self.sample += 1
        self._look(physics)

    def _look(self, physics: Physics) -> None:
        data = physics.data.ptr
        self.x, self.v = data.qpos[self.setting.qpos], data.qvel[self.setting.qvel]
        self.over = bool(self.setting.lost(self.x, self.v))

    def action_spec(self, physics: Physics) -> specs.BoundedArray:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Commands of the driven channels, in parts of their limits."""
        return specs.BoundedArray(self.setting.shape, float, minimum=-1.0, maximum=1.0, name="u")

    def get_observation(self, physics: Physics) -> OrderedDict[str, np.ndarray]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Positions and velocities, and what is to be followed."""
        x, v = (bounded(self.x), bounded(self.v)) if self.over else (self.x, self.v)
        found = OrderedDict(position=x, velocity=v)
        if self.setting.task.moving:
            found["reference"] = self.setting.reference(self.sample)
        return found

    def get_reward(self, physics: Physics) -> float:  # pyright: ignore[reportIncompatibleMethodOverride]
        """In [0, 1]; 0 outside the finite world."""
        return 0.0 if self.over else float(self.setting.reward(self.x, self.v, self.sample))

    def get_termination(self, physics: Physics) -> float | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """0 where the plant has left the finite world: nothing is to be had any more."""
        return 0.0 if self.over else None


def load(
    domain: Plant | str,
    task: str = "regulate",
    *,
    random: int | np.random.RandomState | np.random.Generator | None = None,
    changes: Mapping[str, Any] | None = None,
    flat_observation: bool = False,
) -> control.Environment:
    """A plant with a task as a dm_env environment.

    Args:
      domain: a Plant or the name of one.
      task: one of `smc_mujoco.tasks.tasks(domain)`.
      random: a seed or a numpy generator, of the starts; None for another start every time.
      changes: Scenario field -> value, such as {"duration": 5.0, "control_period": 0.01, "u_max": 3.0}.
      flat_observation: whether an observation is one array, {"observations": ...}, as dm_control's suite offers.

    Raises:
      ScenarioError: a plant, task or field that there is not, a task that is not for the plant, a value out of range.
    """
    found = setting(domain, task, changes)
    if not isinstance(random, np.random.RandomState | np.random.Generator):
        random = _generator(random)
    scenario = found.scenario
    return control.Environment(
        PlantPhysics.from_model(MjModel(found.model)),
        PlantTask(found, random),
        time_limit=(scenario.samples - 0.5) * scenario.control_period,  # half a sample less: sums of floats miss it
        n_sub_steps=scenario.steps,
        flat_observation=flat_observation,
        legacy_step=False,  # x and v are the state's own, and need no second look at it
    )


def _generator(seed: object) -> np.random.Generator:
    try:
        return np.random.default_rng(seed)  # pyright: ignore[reportArgumentType, reportCallIssue]
    except (TypeError, ValueError):
        raise ScenarioError(f"random is {shown(seed)}: give a seed, a whole number from 0, or a generator") from None
