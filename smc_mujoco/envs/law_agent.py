"""A law as an agent of an environment.

    act = smc.envs.agent(smc.law("observer_free", lam=6.0, k1=3.076), environment)
    timestep = environment.step(act(timestep))           # dm_env; of gymnasium: act(observation)

The callback of `smc.run` measures what the environment observes and calls the law, and the episode
equals the trace of that run.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import Estimator
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import Surface
from smc_mujoco.envs.episode import Episode
from smc_mujoco.simulation import callback, python_functions, state
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import ScenarioBatch
from smc_mujoco.simulation.scenario import Scenario


def agent(
    law: Law | Template | str,
    environment: Any,
    *,
    model: str | None = None,
    surface: Surface | Template | str | None = None,
    velocity: Estimator | Template | str | None = None,
) -> Callable[[Any], Array]:
    """Return a law as an agent: a callable observation -> action, whose memory is cleared with each
    episode.

    Args:
      law, model, surface, velocity: as in a Scenario.
      environment: from `suite.load`, or a single gymnasium environment, wrapped or not.

    Returns:
      A callable: an observation -> an action, (channels,).

    Raises:
      ScenarioError: another environment, or values that a Scenario refuses. The agent raises it if
        its law fails.
    """
    episode = _episode(environment)
    scenario = dataclasses.replace(
        episode.setting.scenario,
        law=law,  # pyright: ignore[reportArgumentType]
        model=model,
        surface=surface,  # pyright: ignore[reportArgumentType]
        velocity=velocity,  # pyright: ignore[reportArgumentType]
    )
    return LawAgent(episode, scenario)


class LawAgent:
    """A law as an agent, as `agent` returns it."""

    def __init__(self, episode: Episode, scenario: Scenario):
        self.episode = episode
        self.scenario = scenario
        self.prepared = prepare(scenario)
        self.call = callback.callback().ctypes
        self.last_episode = 0  # number of the episode in which it acted last

    def __call__(self, observation: Any) -> Array:
        """Return the action for an observation: a TimeStep or mapping of dm_env, or an array of
        gymnasium.
        """
        k = self.episode.sample
        if k == 0 or self.last_episode != self.episode.episodes:
            self.last_episode = self.episode.episodes
            with callback.installed():
                self.batch = ScenarioBatch([self.prepared], threads=1)
        scenario = self.scenario
        batch = self.batch
        data = batch.scratch
        places = self.prepared.mechanism.channels
        x, v = _positions_and_velocities(observation, scenario.plant.n)
        data.sensordata[places["x_sensor"]] = x
        data.sensordata[places["v_sensor"]] = v
        data.userdata[:] = callback.MAGIC, state.address(batch.records)
        k = min(k, scenario.samples)
        batch.records["calls"] = k * scenario.steps * scenario.stages
        with python_functions.hearing_ctrl_c(batch.packed[0].python):
            self.call(batch.model._address, data._address)
        if code := int(batch.records["failure"][0]):
            t = k * scenario.control_period
            raise ScenarioError(f"{batch.failure(0, code)}, at t = {t:.6g} s")
        return batch.logs[0]["u"][k, : scenario.plant.driven] / scenario.limits


def _episode(environment: Any) -> Episode:
    for owner in (getattr(environment, "task", None), getattr(environment, "unwrapped", None)):
        if isinstance(owner, Episode) and not getattr(owner, "flies", False):
            return owner
    cure = "give one of smc_mujoco.envs.suite, or a single one of smc_mujoco.envs.gym"
    raise ScenarioError(f"environment is {shown(environment)}: {cure}")


def _positions_and_velocities(observation: Any, n: int) -> tuple[Array, Array]:
    """Return x and v, (n,) each."""
    values = getattr(observation, "observation", observation)
    if isinstance(values, Mapping) and "position" in values:
        return values["position"], values["velocity"]
    if isinstance(values, Mapping):
        values = values.get("observations")
    if not isinstance(values, np.ndarray) or values.ndim != 1 or len(values) < 2 * n:
        raise ScenarioError(
            f"observation is {shown(observation)}: give what the environment returned, unchanged"
        )
    return values[:n], values[n : 2 * n]
