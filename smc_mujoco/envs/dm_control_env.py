"""Plants as dm_env environments, through dm_control's control.Environment:

`pip install 'smc-mujoco[dm]'`.

    environment = suite.load("duffing", "regulate", random=0)
    timestep = environment.reset()
    while not timestep.last():
        timestep = environment.step(agent(timestep))

An action is the command of the driven channels, divided by their limits. Observations are
{"position": x, "velocity": v}, (n,) each, with unwrapped angles, and for `track` also "reference":
r, r', r''. The module `tasks` describes tasks and rewards. dm_control's viewer shows an
environment: viewer.launch(environment).
"""

import contextlib
import os
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import version
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.extras import MissingPackageError, cure, extra
from smc_mujoco.common.gl import choice
from smc_mujoco.envs.episode import Episode, Setting, bounded
from smc_mujoco.mechanisms.plant import Plant

# dm_control would try a window first, which needs a display
if choice()[1] in ("egl", "osmesa"):
    os.environ.setdefault("MUJOCO_GL", choice()[1])

with extra("dm", "smc_mujoco.envs.dm_control_env"):
    from dm_control.mujoco import Physics
    from dm_control.mujoco.wrapper import MjModel
    from dm_control.rl import control
    from dm_env import specs


class PlantPhysics(Physics):
    """dm_control's physics, without its exception for a plant that diverges."""

    stepping: Callable[[], contextlib.AbstractContextManager] = contextlib.nullcontext

    def step(self, nstep: int = 1) -> None:
        """Take physics steps, with the callback if it is called."""
        with self.stepping():
            super().step(nstep)

    @contextlib.contextmanager
    def check_invalid_state(self) -> Iterator[None]:
        """Check nothing, because `PlantTask.diverged` does."""
        yield


class PlantTask(Episode, control.Task):
    """A task of `tasks` for dm_control: an Episode with `random`, the numpy generator of its
    starts.
    """

    def __init__(self, setting: Setting, random: Any):
        super().__init__(setting)
        self.random = random

    def initialize_episode(self, physics: Physics) -> None:
        """Draw a start."""
        self.begin(physics.data.ptr, self.random)

    def before_step(self, action: Any, physics: PlantPhysics) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Apply the action."""
        self.apply_command(physics.data.ptr, self.setting.command(action))

    def after_step(self, physics: Physics) -> None:
        """Count the sample and read the state."""
        self.sample += 1
        self.read_state(physics.data.ptr)

    def action_spec(self, physics: Physics) -> specs.BoundedArray:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the spec of an action: commands of the driven channels over their limits."""
        return specs.BoundedArray(
            self.setting.action_shape, float, minimum=-1.0, maximum=1.0, name="u"
        )

    def get_observation(self, physics: Physics) -> OrderedDict[str, np.ndarray]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return positions and velocities, and the reference if the task has one."""
        observation = OrderedDict(position=self.x, velocity=self.v)
        if self.diverged:
            observation = OrderedDict(position=bounded(self.x), velocity=bounded(self.v))
        if self.setting.task.moving:
            observation["reference"] = self.setting.reference(self.sample)
        return observation

    def get_reward(self, physics: Physics) -> float:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the reward of the state."""
        return self.reward_and_info()[0]

    def get_termination(self, physics: Physics) -> float | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the discount 0, which ends the episode, if the plant has diverged."""
        return 0.0 if self.diverged else None


def load(
    domain: Plant | str,
    task: str = "regulate",
    *,
    random: int | np.random.RandomState | np.random.Generator | None = None,
    changes: Mapping[str, Any] | None = None,
    flat_observation: bool = False,
) -> control.Environment:
    """Return a plant with a task as a dm_env environment.

    Args:
      domain: a Plant or the name of one.
      task: one of `smc_mujoco.envs.tasks.tasks(domain)`.
      random: a seed or a numpy generator for the starts; None for different starts every time.
      changes: Scenario field -> value, such as {"duration": 5.0, "control_period": 0.01, "u_max":
        3.0}.
      flat_observation: whether an observation is one array, {"observations": ...}, as in
        dm_control's suite.

    Raises:
      ScenarioError: an unknown plant, task or field, a task that is not for the plant, a value out
        of range.
      MissingPackageError: dm_control does not fit the MuJoCo that is installed.
    """
    setting = Setting(domain, task, changes)
    if not isinstance(random, np.random.RandomState | np.random.Generator):
        random = np.random.default_rng(random)
    scenario = setting.scenario
    return control.Environment(
        _physics(setting),
        PlantTask(setting, random),
        # half a sample less: sums of floats miss it
        time_limit=(scenario.samples - 0.5) * scenario.control_period,
        n_sub_steps=scenario.steps,
        flat_observation=flat_observation,
        # observations need positions and velocities only, which are already current
        legacy_step=False,
    )


def _physics(setting: Setting) -> PlantPhysics:
    try:
        physics = PlantPhysics.from_model(MjModel(setting.model))
        physics.stepping = setting.stepping
        return physics
    except AttributeError as error:  # dm_control looks for every field that it knows
        here = f"dm_control {version('dm-control')} does not know MuJoCo {mujoco.__version__}"
        raise MissingPackageError(
            f"{here} ({error}): {cure('dm')}, which brings two that fit"
        ) from error
