"""Plants as dm_env environments, through dm_control's control.Environment: `pip install 'smc-mujoco[dm]'`.

    environment = suite.load("duffing", "regulate", task_kwargs={"random": 0})
    timestep = environment.reset()
    while not timestep.last():
        timestep = environment.step(agent(timestep))

An action is the command of the driven channels, in parts of their limits. Observations are {"position": x,
"velocity": v}, (n,) each, angles unwrapped, and for `track` "reference": r, r', r''; tasks and rewards stand in
`tasks`. They open in dm_control's viewer: viewer.launch(environment).
"""

import contextlib
import functools
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version
from typing import Any

import mujoco
import numpy as np
from dm_env import specs

from smc_mujoco.common.errors import ScenarioError, shown, unknown
from smc_mujoco.common.extras import MissingPackageError, cure, extra
from smc_mujoco.envs.core import Episode, Setting, bounded
from smc_mujoco.envs.tasks import tasks
from smc_mujoco.mechanisms.plant import Plant, plants

with extra("dm", "smc_mujoco.envs.dm_control_env"):
    from dm_control.mujoco import Physics
    from dm_control.mujoco.wrapper import MjModel
    from dm_control.rl import control

TASK_KWARGS = {"random": "random", "time_limit": "duration"}  # of dm_control's suite: what it is called here
ENVIRONMENT_KWARGS = {"flat_observation": "flat_observation", "control_timestep": "control_period"}


class PlantPhysics(Physics):
    """dm_control's physics, where a plant that leaves the finite world raises nothing.

    Attributes:
      stretches: numbers of the coming physics steps, of `Setting.stretches`.
    """

    stretches: Iterable[int] = ()

    def step(self, nstep: int = 1) -> None:
        """Take physics steps, in stretches where a command goes through two drives."""
        stretches, self.stretches = self.stretches, ()
        for steps in stretches:
            super().step(steps)
            nstep -= steps
        if nstep > 0:  # a user may step without a command
            super().step(nstep)

    @contextlib.contextmanager
    def check_invalid_state(self) -> Iterator[None]:
        """Check nothing: `PlantTask.over` does it."""
        yield


class PlantTask(Episode, control.Task):
    """A task of `tasks` for dm_control. Attributes are those of an Episode, and:

    Attributes:
      random: the numpy generator of the starts.
    """

    def __init__(self, setting: Setting, random: Any):
        super().__init__(setting)
        self.random = random

    def initialize_episode(self, physics: Physics) -> None:
        """Draw a start."""
        self.begin(physics.data.ptr, self.random)

    def before_step(self, action: Any, physics: PlantPhysics) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Give the command to the actuators."""
        physics.stretches = self.stretches(physics.data.ptr, action)

    def after_step(self, physics: Physics) -> None:
        """Count the sample and read the state."""
        self.sample += 1
        self.look(physics.data.ptr)

    def action_spec(self, physics: Physics) -> specs.BoundedArray:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the spec of commands of the driven channels, in parts of their limits."""
        return specs.BoundedArray(self.setting.shape, float, minimum=-1.0, maximum=1.0, name="u")

    def get_observation(self, physics: Physics) -> OrderedDict[str, np.ndarray]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return positions and velocities, and for a moving task the reference."""
        x, v = (bounded(self.x), bounded(self.v)) if self.over else (self.x, self.v)
        found = OrderedDict(position=x, velocity=v)
        if self.setting.task.moving:
            found["reference"] = self.setting.reference(self.sample)
        return found

    def get_reward(self, physics: Physics) -> float:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the reward of the state."""
        return self.reward()

    def get_termination(self, physics: Physics) -> float | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the discount 0 where the plant has left the finite world, which ends the episode."""
        return 0.0 if self.over else None


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
      task_kwargs: of dm_control's suite: random, and time_limit, in s, which is the field duration.
      environment_kwargs: of dm_control's suite: flat_observation, and control_timestep, in s, which is the field
        control_period. Both hold over the arguments below.
      random: a seed or a numpy generator, of the starts; None for another start every time.
      changes: Scenario field -> value, such as {"duration": 5.0, "control_period": 0.01, "u_max": 3.0}.
      flat_observation: whether an observation is one array, {"observations": ...}, as dm_control's suite offers.

    Raises:
      ScenarioError: a plant, task or field that there is not, a task that is not for the plant, a value out of range.
      MissingPackageError: dm_control does not fit the MuJoCo that is installed.
    """
    named = _named("task_kwargs", task_kwargs, TASK_KWARGS)
    named |= _named("environment_kwargs", environment_kwargs, ENVIRONMENT_KWARGS)
    random = named.pop("random", random)
    flat_observation = named.pop("flat_observation", flat_observation)
    if named and isinstance(changes, Mapping | None):
        changes = {**(changes or {}), **named}
    found = Setting(domain, task, changes)
    if not isinstance(random, np.random.RandomState | np.random.Generator):
        random = _generator(random)
    scenario = found.scenario
    return control.Environment(
        _physics(found.model),
        PlantTask(found, random),
        time_limit=(scenario.samples - 0.5) * scenario.control_period,  # half a sample less: sums of floats miss it
        n_sub_steps=scenario.steps,
        flat_observation=flat_observation,
        legacy_step=False,  # x and v are the state's own, and need no second look at it
    )


@functools.cache
def _all_tasks() -> tuple[tuple[str, str], ...]:
    return tuple((plant, task) for plant in plants() for task in tasks(plant))


def __getattr__(name: str) -> object:
    """Return ALL_TASKS, every plant with each of its tasks. It loads the plants' models, so it is made on demand."""
    if name == "ALL_TASKS":
        return _all_tasks()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _named(what: str, given: object, known: Mapping[str, str]) -> dict[str, Any]:
    """Return arguments named as in dm_control's suite under our names."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ScenarioError(f"{what} is {shown(given)}: give a mapping of {', '.join(known)}")
    for name in given:
        if name not in known:
            raise unknown(f"name in {what}", name, known)
    return {known[name]: value for name, value in given.items()}


def _physics(model: mujoco.MjModel) -> PlantPhysics:
    try:
        return PlantPhysics.from_model(MjModel(model))
    except AttributeError as error:  # dm_control looks for every field that it knows
        here = f"dm_control {version('dm-control')} does not know MuJoCo {mujoco.__version__}"
        raise MissingPackageError(f"{here} ({error}): {cure('dm')}, which brings two that fit") from error


def _generator(seed: object) -> np.random.Generator:
    try:
        return np.random.default_rng(seed)  # pyright: ignore[reportArgumentType, reportCallIssue]
    except (TypeError, ValueError):
        raise ScenarioError(f"random is {shown(seed)}: give a seed, a whole number from 0, or a generator") from None
