"""Many copies of a plant as one gymnasium.vector.VectorEnv: all of them step in one MuJoCo Batch,
on all cores.

    environments = gymnasium.make_vec("smc_mujoco:smc/Duffing-v0", num_envs=1024)

Copy i moves like the single environment with seed + i, to 1e-12. After the end of an episode a copy
begins the next one in the next step, which ignores the action, as gymnasium's own vector
environments do (AutoresetMode.NEXT_STEP).
"""

from collections.abc import Sequence
from typing import Annotated, Any

import mujoco
import numpy as np

from smc_mujoco.common import mjcb
from smc_mujoco.common.constraints import Whole, constrained
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.envs.episode import Records, Setting, bounded
from smc_mujoco.envs.gymnasium_env import action_space, observation_space
from smc_mujoco.envs.tasks import reward
from smc_mujoco.mechanisms.custom.model_constraints import smooth
from smc_mujoco.mechanisms.plant import DIRECT_TEXT, Plant
from smc_mujoco.simulation.model import started, without_scenery
from smc_mujoco.simulation.run import cores  # also imports mujoco.batch without a callback

# isort: split
from gymnasium.utils import seeding  # already imported by gymnasium_env
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from mujoco.batch import Batch, SimulationError  # already imported with simulation.run

from smc_mujoco.common.aliases import Array, ArrayPair, Data, Fields

MAX_COPIES = 1_000_000  # a larger number is a mistake


class BatchEnv(VectorEnv):
    """Copies of one plant with one task; they are not rendered."""

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  # as gymnasium has it

    @constrained
    def __init__(
        self,
        plant: Plant | str,
        num_envs: Annotated[int, Whole(low=1, high=MAX_COPIES)] = 1,
        task: str = "regulate",
        changes: Data | None = None,
        threads: int | None = None,
        max_episode_steps: Annotated[int, Whole(low=1, high=10**15)] | None = None,
        render_mode: None = None,
    ):
        """Make copies of a plant with one of its tasks.

        `changes`: Scenario field -> value, of `episode.FIELDS`.

        `threads`: None for one per available core. `max_episode_steps`: control samples after which
        an episode is truncated, if the duration is not shorter. `render_mode`: None, because copies
        are not rendered.
        """
        if render_mode is not None:
            raise ScenarioError(
                f"render_mode is {shown(render_mode)}: copies are not drawn, make one environment"
            )
        self.num_envs = num_envs
        self.setting = Setting(plant, task, changes, edit=remove_scenery)
        if smooth(self.setting.model) and not self.setting.model.nflex:
            # no constraints: a tenth of MuJoCo's time
            self.setting.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT.value
        self.max_samples = self.setting.scenario.samples
        if max_episode_steps is not None:
            self.max_samples = min(self.max_samples, max_episode_steps)
        self.single_action_space = action_space(self.setting)
        self.single_observation_space = observation_space(self.setting)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        # persistent: the callback reads the forces of a copy's last step
        self.batch = Batch(
            self.setting.model,
            self.num_envs,
            min(cores(threads), self.num_envs),
            persistent=self.setting.uses_callback,
        )
        self.qpos = self.batch.bind("qpos")
        self.qvel = self.batch.bind("qvel")
        self.ctrl = self.batch.bind("ctrl")
        self.userdata = self.batch.bind("userdata")
        self.callback_records = Records(self.setting, self.num_envs)
        self.randoms: list[np.random.Generator] = []
        # control samples since each episode began, and the copies whose episode has ended
        self.samples = np.zeros(self.num_envs, int)
        self.ended = np.zeros(self.num_envs, bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Data | None = None,
    ) -> tuple[Array, Fields]:
        """Begin new episodes, from seed, seed + 1, ... or a list of seeds.

        Options x0 and v0 hold for all copies.
        """
        seeds: Sequence[int | None] = [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            seeds = range(seed, seed + self.num_envs)
        elif seed is not None:
            seeds = seed
        if len(seeds) != self.num_envs:
            raise ScenarioError(
                f"seed has {len(seeds)} values: give {self.num_envs}, or one number"
            )
        if not self.randoms:
            self.randoms = [seeding.np_random()[0] for _ in seeds]
        for i, number in enumerate(seeds):
            if number is not None:
                self.randoms[i] = seeding.np_random(number)[0]
        self.begin(np.ones(self.num_envs, bool), options)
        x, v = self.state()
        e, _ = self.setting.errors(x, v, self.samples)
        return self.setting.observe(x, v, self.samples), self.infos(e)

    def step(self, actions: Any) -> tuple[Array, Array, Array, Array, Fields]:
        """Take one control period in every copy; copies at the end of an episode begin the next
        one.
        """
        if not self.randoms:
            raise ScenarioError("no episode has begun: call reset first")
        restarts = self.ended.copy()
        commands = self.setting.command(actions, (self.num_envs,))
        terminated = self.advance(np.flatnonzero(~restarts).astype(np.int32), commands)
        self.samples += 1
        if restarts.any():
            self.begin(restarts)
            terminated[restarts] = False
        x, v = self.state()
        terminated |= self.setting.diverged(x, v)
        truncated = self.samples >= self.max_samples
        with np.errstate(over="ignore", invalid="ignore"):
            e, w = self.setting.errors(x, v, self.samples)
            rewards = np.where(terminated | restarts, 0.0, reward(e, w))
        e[terminated] = np.nan
        observations = self.setting.observe(x, v, self.samples)
        observations[terminated] = bounded(observations[terminated])
        self.ended = terminated | truncated
        return observations, rewards, terminated, truncated, self.infos(e)

    def begin(self, mask: Array, options: Data | None = None) -> None:
        """Begin new episodes of the copies where `mask`, (num_envs,) of bool, is true."""
        ids = np.flatnonzero(mask)
        with mjcb.installed(None):
            self.batch.reset(ids.astype(np.int32), stage=0)
        if self.setting.model.na:
            self.batch.bind("act")[ids] = self.setting.activations
        for i in ids.tolist():
            start = self.setting.draw_start(self.randoms[i], options)
            setting = self.setting
            self.qpos[i], self.qvel[i] = started(
                setting.model, setting.joints, setting.scenario, *start
            )
            if self.setting.uses_callback:
                self.userdata[i] = self.callback_records.begin(i, *start)
        self.samples[mask] = 0
        self.ended[mask] = False

    def advance(self, ids: Array, commands: Array) -> Array:
        """Take one control period in the copies `ids`.

        Return those that failed, (num_envs,) of bool.
        """
        setting = self.setting
        failed = np.zeros(self.num_envs, bool)
        self.callback_records.commands[:, : commands.shape[1]] = commands
        if not setting.uses_callback:
            self.ctrl[:, setting.ctrl] = setting.scale * commands
        try:
            # a Batch refuses Python callbacks, which runs of other threads may have set
            with setting.stepping() if setting.uses_callback else mjcb.installed(None):
                self.batch.step(ids, nstep=setting.scenario.steps)
        except SimulationError as error:
            failed[list(error.ids)] = True
        self.callback_records.check()
        return failed

    def infos(self, e: Array) -> Fields:
        """Return the infos of `Episode.reward_and_info` as gymnasium joins them; e is (num_envs,
        n).
        """
        times = self.samples * self.setting.scenario.control_period
        present = np.ones(self.num_envs, bool)
        return {"time": times, "_time": present, "error": e, "_error": present.copy()}

    def state(self) -> ArrayPair:
        """Return positions and velocities of all copies, (num_envs, n) each."""
        return self.qpos[:, self.setting.qpos], self.qvel[:, self.setting.qvel]


def remove_scenery(spec: mujoco.MjSpec) -> None:
    """Delete scenery, merge fixed bodies and disable sensors, which take a third of MuJoCo's time.

    A user's model keeps its scenery and bodies, because a fixed part may be a floor, or carry a
    tendon.
    """
    if not any(text.name == DIRECT_TEXT for text in spec.texts):
        without_scenery(spec)
        spec.compiler.fusestatic = True
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR.value
