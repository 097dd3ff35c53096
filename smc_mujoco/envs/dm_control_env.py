"""Plants as dm_env environments, through dm_control's control.Environment:

`pip install 'smc-mujoco[dm]'`.

    environment = suite.load("duffing", "regulate", task_kwargs={"random": 0})
    timestep = environment.reset()
    while not timestep.last():
        timestep = environment.step(agent(timestep))

An action is the command of the driven channels, divided by their limits. Observations are
{"position": x, "velocity": v}, (n,) each, with unwrapped angles, and for `track` also "reference":
r, r', r''. The module `tasks` describes tasks and rewards. dm_control's viewer shows an
environment: viewer.launch(environment).
"""

import contextlib
import functools
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.extras import MissingPackageError, cure, extra
from smc_mujoco.envs.episode import Episode, Setting, bounded
from smc_mujoco.envs.tasks import tasks
from smc_mujoco.mechanisms.plant import Plant, plants

with extra("dm", "smc_mujoco.envs.dm_control_env"):
    from dm_control.mujoco import Physics
    from dm_control.mujoco.wrapper import MjModel
    from dm_control.rl import control
    from dm_env import specs

# Names of dm_control's suite -> names here.
TASK_KWARGS = {"random": "random", "time_limit": "duration"}
ENVIRONMENT_KWARGS = {"flat_observation": "flat_observation", "control_timestep": "control_period"}


class PlantPhysics(Physics):
    """dm_control's physics, without its exception for a plant that diverges."""

    step_counts: Iterable[int] = ()  # from `Episode.apply_action`

    def step(self, nstep: int = 1) -> None:
        """Take physics steps.

        Those of an action are taken one by one if `DriveStep` simulates a drive.
        """
        step_counts, self.step_counts = self.step_counts, ()
        for steps in step_counts:
            super().step(steps)
            nstep -= steps
        if nstep > 0:  # a user may step without a command
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
        physics.step_counts = self.apply_action(physics.data.ptr, action)

    def after_step(self, physics: Physics) -> None:
        """Count the sample and read the state."""
        self.sample += 1
        self.read_state(physics.data.ptr)

    def action_spec(self, physics: Physics) -> specs.BoundedArray:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the spec of an action: commands of the driven channels, divided by their limits."""
        return specs.BoundedArray(
            self.setting.action_shape, float, minimum=-1.0, maximum=1.0, name="u"
        )

    def get_observation(self, physics: Physics) -> OrderedDict[str, np.ndarray]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return positions and velocities, and the reference if the task has one."""
        if self.diverged:
            x = bounded(self.x)
            v = bounded(self.v)
        else:
            x = self.x
            v = self.v
        observation = OrderedDict(position=x, velocity=v)
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
    task_kwargs: Mapping[str, Any] | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
    *,
    random: int | np.random.RandomState | np.random.Generator | None = None,
    changes: Mapping[str, Any] | None = None,
    flat_observation: bool = False,
) -> control.Environment:
    """Return a plant with a task as a dm_env environment.

    Args:
      domain: a Plant or the name of one.
      task: one of `smc_mujoco.envs.tasks.tasks(domain)`.
      task_kwargs: arguments of dm_control's suite: random, and time_limit in s, which is the field
        duration.
      environment_kwargs: arguments of dm_control's suite: flat_observation, and control_timestep in
        s, which is the field control_period. These and task_kwargs take precedence over the
        arguments below.
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
    values = _renamed("task_kwargs", task_kwargs, TASK_KWARGS)
    values |= _renamed("environment_kwargs", environment_kwargs, ENVIRONMENT_KWARGS)
    random = values.pop("random", random)
    flat_observation = values.pop("flat_observation", flat_observation)
    if values and isinstance(changes, Mapping | None):
        changes = {**(changes or {}), **values}
    setting = Setting(domain, task, changes)
    if not isinstance(random, np.random.RandomState | np.random.Generator):
        try:
            random = np.random.default_rng(random)
        except (TypeError, ValueError):
            choices = "a seed, a whole number from 0, or a generator"
            raise ScenarioError(f"random is {shown(random)}: give {choices}") from None
    scenario = setting.scenario
    return control.Environment(
        _physics(setting.model),
        PlantTask(setting, random),
        time_limit=(scenario.samples - 0.5)
        * scenario.control_period,  # half a sample less: sums of floats miss it
        n_sub_steps=scenario.steps,
        flat_observation=flat_observation,
        # observations need positions and velocities only, which are already current
        legacy_step=False,
    )


@functools.cache
def __getattr__(name: str) -> object:
    """Return ALL_TASKS, pairs of every plant and each of its tasks.

    It is made on demand, since it loads all models.
    """
    if name == "ALL_TASKS":
        return tuple((plant, task) for plant in plants() for task in tasks(plant))
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _renamed(what: str, values: Any, names: Mapping[str, str]) -> dict[str, Any]:
    """Return values with the names of dm_control's suite replaced by the names here."""
    if not isinstance(values, Mapping | None):
        raise ScenarioError(f"{what} is {shown(values)}: give a mapping of {', '.join(names)}")
    return {find(f"name in {what}", name, names): value for name, value in (values or {}).items()}


def _physics(model: mujoco.MjModel) -> PlantPhysics:
    try:
        return PlantPhysics.from_model(MjModel(model))
    except AttributeError as error:  # dm_control looks for every field that it knows
        here = f"dm_control {version('dm-control')} does not know MuJoCo {mujoco.__version__}"
        raise MissingPackageError(
            f"{here} ({error}): {cure('dm')}, which brings two that fit"
        ) from error
