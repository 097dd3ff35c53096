"""A law as an agent of an environment.

    act = smc.agent(smc.law("observer_free", lam=6.0, k1=3.076), environment)
    timestep = environment.step(act(timestep))           # dm_env; of gymnasium: act(observation)

A law sees what it would see in `smc.run`, and its episode is the trace of that run: the code of the reference loop asks
it.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, attribute, shown
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import Estimator
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import Surface
from smc_mujoco.envs.core import Episode
from smc_mujoco.simulation import reference
from smc_mujoco.simulation.callback import installed
from smc_mujoco.simulation.guarded import Failure


def agent(
    law: Law | Template | str,
    environment: Any,
    *,
    model: str | None = None,
    surface: Surface | Template | str | None = None,
    velocity: Estimator | Template | str | None = None,
) -> "Agent":
    """Return a law as an agent: a callable observation -> action, which starts afresh with each episode.

    Args:
      law: a Law or the name of one.
      environment: of `suite.load`, or a gymnasium one, wrapped or not; not a vectorised one.
      model, surface, velocity: as of a Scenario.

    Raises:
      ScenarioError: another environment, or what a Scenario refuses. The agent raises it where its law fails.
    """
    source = _episode(environment)
    scenario = dataclasses.replace(
        source.setting.scenario,
        law=law,  # pyright: ignore[reportArgumentType]
        model=model,
        surface=surface,  # pyright: ignore[reportArgumentType]
        velocity=velocity,  # pyright: ignore[reportArgumentType]
    )
    with installed():
        return Agent(source, reference.Loop(scenario))


class Agent:
    """A law that acts in an environment.

    Attributes:
      source: the environment's episode, which knows the time.
      loop: the reference loop of the scenario with the law in it, of which only the controller is used.
    """

    def __init__(self, source: Episode, loop: reference.Loop):
        self.source, self.loop = source, loop

    def __call__(self, observation: Any) -> np.ndarray:
        """Return the action for an observation: of dm_env a TimeStep or its mapping, of gymnasium an array."""
        loop, k, n = self.loop, self.source.sample, self.loop.scenario.plant.n
        if k == 0:
            self.forget()
        x, v = _positions_and_velocities(observation, n)
        loop.data.sensordata[loop.channels["x_sensor"]] = x
        loop.data.sensordata[loop.channels["v_sensor"]] = v
        try:
            with np.errstate(all="ignore"):
                u, loop.s = loop.decide(*loop.measure(loop.data, k), k)
        except Failure as failure:
            raise ScenarioError(f"{failure}, at t = {k * loop.scenario.control_period:.6g} s") from failure
        return u[: loop.scenario.plant.driven] / loop.scenario.limits

    def forget(self) -> None:
        """Set all memories to zero, and the last commands, which the nominal model of coupled channels uses."""
        loop = self.loop
        for memory in (*loop.memory, *loop.surface_memory, *loop.estimator_memory, loop.latest):
            memory[:] = 0.0


def _episode(environment: Any) -> Episode:
    """Return the part of an environment that knows its setting and counts its samples."""
    for owner in (attribute(environment, "task"), attribute(environment, "unwrapped")):
        if isinstance(owner, Episode):
            return owner
    cure = "give one of smc_mujoco.suite, or a single one of smc_mujoco.gym"
    raise ScenarioError(f"environment is {shown(environment)}: {cure}")


def _positions_and_velocities(observation: Any, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return x and v, (n,) each."""
    found = getattr(observation, "observation", observation)
    if isinstance(found, Mapping) and "position" in found:
        return found["position"], found["velocity"]
    if isinstance(found, Mapping):
        found = found.get("observations")
    if not isinstance(found, np.ndarray) or found.ndim != 1 or len(found) < 2 * n:
        raise ScenarioError(f"observation is {shown(observation)}: give what the environment returned, unchanged")
    return found[:n], found[n : 2 * n]
