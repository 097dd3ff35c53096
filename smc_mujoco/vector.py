"""Many copies of a plant as one gymnasium.vector.VectorEnv: all of them step in one MuJoCo Batch, on all cores.

    environments = gymnasium.make_vec("smc_mujoco:Duffing-v0", num_envs=1024)

Copy i moves as the single environment with seed + i does, to 1e-12. A copy whose episode is over starts anew in the
next step, whose action it ignores (gymnasium's AutoresetMode.NEXT_STEP).
"""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from smc_mujoco import callback
from smc_mujoco.errors import ScenarioError, shown, whole
from smc_mujoco.gym import action_space, bounded, observation_space
from smc_mujoco.plant import Plant
from smc_mujoco.setting import setting

with callback.uninstalled():  # this import compiles a model
    from mujoco.batch import Batch, SimulationError

MOST = 1_000_000  # copies: a number that is surely meant as something else


class BatchEnv(VectorEnv):
    """Copies of one plant with one task; they are not drawn.

    Attributes:
      setting: the plant with its task.
      batch: the simulations.
      samples: control samples since the episode began, (num_envs,).
      over: whose episode has ended, (num_envs,) of bool.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  # as gymnasium has it

    def __init__(
        self,
        plant: Plant | str,
        num_envs: int = 1,
        task: str = "regulate",
        changes: Mapping[str, Any] | None = None,
        threads: int | None = None,
    ):
        """Arguments as of `setting.setting`; threads: None for one per available core.

        Raises:
          ScenarioError: what `setting` raises, or num_envs or threads out of range.
        """
        self.num_envs, self.setting = whole("num_envs", num_envs, 1, MOST), setting(plant, task, changes, edit=strip)
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        threads = cores if threads is None else whole("threads", threads, 1, 1024)
        relieve(self.setting.model)
        self.single_action_space = action_space(self.setting)
        self.single_observation_space = observation_space(self.setting)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.batch = Batch(self.setting.model, self.num_envs, min(threads, self.num_envs))
        self.qpos, self.qvel, self.ctrl = (self.batch.bind(name) for name in ("qpos", "qvel", "ctrl"))
        self.randoms: list[np.random.Generator] = []
        self.samples, self.over = np.zeros(self.num_envs, int), np.zeros(self.num_envs, bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start all copies: from seed, seed + 1, ... or one seed each; options x0 and v0 hold for all of them."""
        if seed is not None or not self.randoms:
            self.randoms = [seeding.np_random(own)[0] for own in self._seeds(seed)]
        self.begin(np.ones(self.num_envs, bool), options)
        return self.setting.observe(*self.state(), self.samples), {}

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One control period of every copy, or its next start: observations, rewards, terminated, truncated, {}."""
        if not self.randoms:
            raise ScenarioError("these environments have not begun: call reset first")
        anew = self.over.copy()
        self.ctrl[:, self.setting.ctrl] = self.setting.command(actions, (self.num_envs,))
        terminated = self.advance(None if not anew.any() else np.flatnonzero(~anew).astype(np.int32))
        self.samples += 1
        if anew.any():
            self.begin(anew)
        x, v = self.state()
        observations = self.setting.observe(x, v, self.samples)
        terminated |= self.setting.lost(x, v)
        truncated = self.samples >= self.setting.scenario.samples
        with np.errstate(over="ignore", invalid="ignore"):
            rewards = np.where(terminated | anew, 0.0, self.setting.reward(x, v, self.samples))
        if terminated.any():
            observations[terminated] = bounded(observations[terminated])
        self.over = terminated | truncated
        return observations, rewards, terminated, truncated, {}

    def begin(self, which: np.ndarray, options: Mapping[str, Any] | None = None) -> None:
        """Start copies, (num_envs,) of bool, anew."""
        ids = np.flatnonzero(which)
        self.batch.reset(ids.astype(np.int32), stage=0)
        for i in ids:
            self.setting.place(self.qpos[i], self.qvel[i], *self.setting.draw(self.randoms[i], options))
        self.samples[which], self.over[which] = 0, False

    def advance(self, ids: np.ndarray | None) -> np.ndarray:
        """Step copies, None for all; in which of them MuJoCo gave up, (num_envs,) of bool."""
        gone = np.zeros(self.num_envs, bool)
        try:
            self.batch.step(ids, nstep=self.setting.scenario.steps)
        except SimulationError as error:
            gone[list(error.ids)] = True
        return gone

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities of all copies, (num_envs, n) each."""
        return self.qpos[:, self.setting.qpos], self.qvel[:, self.setting.qvel]

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        """One seed a copy."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, Sequence) and not isinstance(seed, str):
            if len(seed) != self.num_envs:
                raise ScenarioError(f"seed has {len(seed)} values for {self.num_envs} copies: give one number or all")
            return seed
        try:
            first = int(seed)
        except (TypeError, ValueError):
            raise ScenarioError(f"seed is {shown(seed)}: give a whole number from 0") from None
        return range(first, first + self.num_envs)


def strip(spec: mujoco.MjSpec) -> None:
    """Take away what is only looked at, which MuJoCo would move along in every step: a third of its time."""
    for thing in (*spec.cameras, *spec.lights, *spec.skins, *(geom for geom in spec.geoms if _fixed(geom.parent))):
        spec.delete(thing)
    spec.compiler.fusestatic = True
    # nobody reads them here: an observation is taken from the state
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR.value


def relieve(model: mujoco.MjModel) -> None:
    """Let MuJoCo skip its search for constraints where there can be none: a tenth of its time."""
    rubs = model.dof_frictionloss.any() or model.tendon_frictionloss.any()
    limited = model.jnt_limited.any() or model.tendon_limited.any()
    if not (rubs or limited or model.neq or model.npair):
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT.value


def _fixed(body: mujoco.MjsBody | None) -> bool:
    """Whether no joint moves a body."""
    return body is None or (not body.joints and _fixed(body.parent))
