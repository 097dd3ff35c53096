"""Episodes of environments, and the runs that they are to be: what the tests of agents share."""

from types import ModuleType

import numpy as np
import pytest

import smc_mujoco as smc
from helpers.runs import JOINTED
from smc_mujoco.envs import tasks
from smc_mujoco.envs.episode import FIELDS, Setting

EVERY = [(plant, task) for plant in smc.plants() for task in tasks.tasks(plant)]


def one_of_each(turn: int) -> list[tuple[str, str]]:
    """Half of the plants, the other half with the next turn, with one task each, another one with
    each turn.
    """
    tasked = {plant: tasks.tasks(plant) for plant in JOINTED}
    return [
        (plant, tasks_of_plant[(i + turn) % len(tasks_of_plant)])
        for i, (plant, tasks_of_plant) in enumerate(tasked.items())
        if i % 2 == turn % 2
    ]


SHORT = {"duration": 0.05}
LAW = smc.law("observer_free", lam=6.0, k1=3.076)


def start(plant, task):
    """A start within the task's own, as x0."""
    return Setting(plant, task).draw_start(np.random.default_rng(7))[0]


def dm_control_suite() -> ModuleType:
    """The module dm_control_env; where dm_control is missing, or does not fit this MuJoCo, what
    asks is skipped.
    """
    try:
        from smc_mujoco.envs import dm_control_env

        dm_control_env.load("duffing")
    except ImportError as error:
        pytest.skip(str(error), allow_module_level=True)
    return dm_control_env


def driven_by_dm(environment, act):
    """x, v, u of every sample of an episode."""
    limit = np.array(environment.task.setting.scenario.limits)
    timestep = environment.reset()
    states = []
    while True:
        u = act(timestep)
        states.append(
            [*timestep.observation["position"], *timestep.observation["velocity"], *(u * limit)]
        )
        if timestep.last():
            return np.array(states)
        timestep = environment.step(u)


def driven_by_gym(environment, act):
    """The same of a gymnasium environment."""
    n = environment.setting.scenario.plant.n
    limit = np.array(environment.setting.scenario.limits)
    observation, _ = environment.reset(seed=0)
    states = []
    over = False
    while True:
        u = act(observation)
        # a float64 that `step` does not round
        assert environment.action_space.contains(u.astype(np.float32))
        assert environment.observation_space.contains(observation)
        states.append([*observation[: 2 * n], *(u * limit)])
        if over:
            return np.array(states)
        observation, _, terminated, truncated, _ = environment.step(u)
        over = terminated or truncated


def columns(trace):
    """x, v, u of every sample of a run."""
    return np.hstack((trace.x, trace.v, trace.u[:, : trace.scenario.plant.driven]))


def run_of(found, law, fields=None):
    """The scenario of a setting under a law."""
    own = {}
    for name in (*FIELDS, "plant"):
        own[name] = getattr(found.scenario, name)
    own |= {"x0": found.low}  # the tests fix it
    return smc.Scenario(**own, law=law, **(fields or {}))


def flat(timestep):
    """An observation as one array, as gymnasium has it."""
    return np.concatenate([*timestep.observation.values()])
