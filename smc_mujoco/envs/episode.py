"""A plant with a task, compiled, and an episode of it: the base of dm_env, gymnasium and batched
environments.

The physics are those of `smc.run`: its callback simulates the same parts. An action is the command
u of each driven channel, divided by the channel's limit and held for one control period; it
saturates outside [-1, 1]. The limit is u_max, or that of the channel's own motor. An environment
has no law, no noise, delay or encoder, and no disturbances or jumps. With contacts an episode
begins from the first drawn start that is clear of them.
"""

import contextlib
import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, ArrayPair
from smc_mujoco.common.errors import ScenarioError, find, shown, unknown
from smc_mujoco.control.law import FREE_BODY, law_function
from smc_mujoco.envs.tasks import (
    FLIGHT_TASKS,
    TASKS,
    Task,
    rest_position,
    reward,
    start_range,
    tasks,
)
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant, check_ranges
from smc_mujoco.simulation import callback, coerce, state
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.controller import MAX_STATE
from smc_mujoco.simulation.model import channels
from smc_mujoco.simulation.prepare import Prepared, pack
from smc_mujoco.simulation.python_functions import Failure, evaluate
from smc_mujoco.simulation.scenario import Resolved, Scenario
from smc_mujoco.simulation.signals import PerChannel

MAX_DRAWS = 100  # of a start that is clear of contacts
FIELDS = (  # of a Scenario, that an environment accepts
    "duration",
    "control_period",
    "physics_step",
    "integrator",
    "u_max",
    "x0",
    "v0",
    "reference",
    "mismatch",
    "friction",
    "contact",
    "mechanism",
    "actuator",
)


@law_function(joint=True, plants=(FREE_BODY,), memory=1)
def commanded(y, gains, memory):
    """The command that an agent has put into the memory, and s = 0."""
    return memory[:, 0].copy(), np.zeros(len(memory))


@law_function(memory=1)
def commanded_by_channel(y, gains, memory):
    """The same of one channel."""
    return memory[0], 0.0


class Setting:
    """A plant with a task, compiled. Every environment has one."""

    def __init__(
        self,
        plant: Plant | str,
        task: str = "regulate",
        changes: Mapping[str, Any] | None = None,
        edit: Callable[[mujoco.MjSpec], None] = lambda spec: None,
        flies: bool = False,
    ):
        """Compile a plant for one of its tasks. `changes`: Scenario field -> value, of FIELDS.

        `edit` changes the mechanism before it is compiled, and must not change the motion. A plant
        that `flies` is a free body.
        """
        plant = as_plant(plant)
        self.task = _task(task, plant, flies)
        changes = _checked({} if changes is None else changes, task)
        # the run that equals an episode
        fields = {"plant": plant, "law": "none"} | self.task.fields(plant) | changes
        self.scenario = Scenario(**fields).resolved
        # whether MuJoCo alone does not simulate it
        self.uses_callback = flies or bool(self.scenario.acting)
        self.commanded = dataclasses.replace(
            self.scenario, law=commanded() if flies else commanded_by_channel()
        ).resolved
        if math.inf in self.scenario.limits:
            raise ScenarioError(
                "u_max is inf: give a finite one, because actions are fractions of it"
            )
        # bounds of the initial positions, (n,) each
        self.low, self.high = start_range(self.task, plant)
        if changes.get("x0") is not None:
            self.low = self.high = np.array(self.scenario.x0)
        self._compile(edit)
        # the largest commands, (driven,), and the actuators' inputs per unit of them
        self.limits = np.array(self.scenario.limits)
        self.scale = np.array(self.scenario.drive_train.scales)
        # the channels that the task treats differently, (n,) of bool
        self.selected = self.task.selected(plant)
        self.rest_x = rest_position(plant)  # from where positions count in errors, (n,)
        # the channels that the reward counts: not the tilt of a body that leans to move
        self.counted: Any = list(plant.scored_channels) if flies else slice(None)
        samples = self.scenario.samples + 1 if self.task.moving else 1
        self.references = _references(self.scenario, samples)
        width = self.references.shape[1]
        self.observation_size = 2 * plant.n
        if self.task.moving:
            self.observation_size += width
        self.action_shape = (plant.driven,)
        # from where the references count: the rest of each that has one, then zeros
        self.rest_r = np.zeros(width)
        if plant.rest:
            self.rest_r[: width // 3] = self.rest_x[: width // 3]

    def _compile(self, edit: Callable[[mujoco.MjSpec], None]) -> None:
        """Compile the mechanism, and look up where its channels are."""
        spec = models.spec(self.scenario)
        edit(spec)
        base = models.compiled_model(spec, self.scenario, models.USERDATA)
        self.model = models.with_values(base, self.scenario)
        self.activations = models.initial_activations(self.model, self.scenario)
        table = channels(self.model)
        self.mechanism = models.Mechanism(base, table)
        self.qpos = table["qpos"]  # addresses of the channels, (n,)
        self.qvel = table["qvel"]
        self.joints = models.moving_joints(self.model)
        # addresses of the driven channels' actuators, (driven,)
        self.ctrl = table["ctrl"][: self.scenario.plant.driven]

    def command(self, action: Any, copies: tuple[int, ...] = ()) -> Array:
        """Return the commands of an action, (*copies, driven): its saturated values times the
        limits.
        """
        shape = copies + self.action_shape
        try:
            a = np.asarray(action, float)
        except (TypeError, ValueError, OverflowError):
            a = np.array(np.nan)
        if a.shape != shape or not np.isfinite(a).all():
            raise ScenarioError(f"action is {shown(action)}: give finite numbers, of shape {shape}")
        return self.limits * np.minimum(np.maximum(a, -1.0), 1.0)

    def stepping(self) -> contextlib.AbstractContextManager:
        """Return the context in which MuJoCo steps: with the callback, if it is called."""
        return callback.installed() if self.uses_callback else contextlib.nullcontext()

    def draw_start(self, random: Any, options: Mapping[str, Any] | None = None) -> ArrayPair:
        """Return a start, x and v, (n,) each: drawn from a numpy generator, or set by the options
        x0 and v0.
        """
        x = random.uniform(self.low, self.high)
        if self.scenario.contact and "x0" not in (options or {}):
            for _ in range(MAX_DRAWS):
                with contextlib.suppress(ScenarioError):
                    self.check_start(x)
                    break
                x = random.uniform(self.low, self.high)
        v = np.array(self.scenario.v0)
        for name, value in (options or {}).items():
            if name not in ("x0", "v0"):
                raise unknown("option of an episode", name, ("x0", "v0"))
            state = np.array(coerce.state(name, value, self.scenario))
            if name == "v0":
                v = state
            else:
                plant = self.scenario.plant
                check_ranges(plant.name, plant.ranges, state, plant.units)
                x = state
        if self.scenario.contact:
            self.check_start(x)
        return x, v

    def check_start(self, x: Array) -> None:
        """Raise ScenarioError for positions in an obstacle, or beyond one."""
        begun = dataclasses.replace(self.scenario, x0=tuple(x.tolist()))
        models.check_path(self.model, begun)

    def reference(self, k: Any) -> Array:
        """Return all r, r' and r'' at sample k, (..., 3 m), as a copy."""
        return np.take(self.references, k, axis=0, mode="clip")

    def observe(self, x: Array, v: Array, k: Any) -> Array:
        """Return the observation at sample k, (..., size): x, v, and the reference if the task has
        one.
        """
        parts = [x, v]
        if self.task.moving:
            parts.append(self.reference(k))
        return np.concatenate(parts, axis=-1)

    def errors(self, x: Array, v: Array, k: Any) -> ArrayPair:
        """Return the errors e and w of the task for x, v (..., n) at sample k, (..., n) each."""
        moved = x - self.rest_x
        goal = self.reference(k) - self.rest_r
        return self.task.errors(moved, v, goal, self.selected)

    def diverged(self, x: Array, v: Array) -> Any:
        """Return whether x, v (..., n) are beyond the largest state of a run, or NaN."""
        largest = np.maximum(np.abs(x), np.abs(v)).max(axis=-1)
        return ~(largest < MAX_STATE)


class Records:
    """What the callback keeps of the episodes of a setting, one for each copy."""

    def __init__(self, setting: Setting, copies: int):
        self.setting = setting
        self.records = np.zeros(copies, state.SIMULATION)
        width = max(setting.commanded.law.memory, 1) * setting.scenario.plant.n
        self.commands = np.zeros((copies, width))  # of the laws
        self.kept: list[Any] = [None] * copies

    def begin(self, i: int, x: Array, v: Array) -> tuple[float, float]:
        """Begin an episode of copy i at x and v, (n,) each, and return its userdata."""
        started = object.__new__(Resolved)
        start = {"x0": tuple(x.tolist()), "v0": tuple(v.tolist())}
        vars(started).update(vars(self.setting.commanded) | start)
        prepared = Prepared(started, "", self.setting.mechanism, None)
        log = np.zeros((started.samples + 1, started.plant.n), state.LOG)
        self.records[i], packed = pack(prepared, log)
        self.kept[i] = prepared, log, packed
        self.commands[i] = 0.0
        self.records[i]["law"]["memory"] = state.address(self.commands[i : i + 1])
        return callback.MAGIC, state.address(self.records[i : i + 1])

    def check(self) -> None:
        """Raise ScenarioError if a part failed, or a copy was stepped beyond its end."""
        codes = self.records["failure"]
        for i in np.flatnonzero(codes):
            if codes[i] == state.INTERRUPTED:
                raise ScenarioError("the episode has ended: call reset")
            if codes[i] != state.DIVERGED:
                parts = [type(part).__name__ for part, _ in self.setting.scenario.acting]
                where = f"in channel {self.records['seen']['i'][i]}"
                raise ScenarioError(
                    f"{' or '.join(parts)} raised an exception, or returned no number, {where}: "
                    "smc.run says which"
                )


class Episode:
    """An episode of one simulation: the base of a gymnasium environment and of a task for
    dm_control.
    """

    def __init__(self, setting: Setting):
        self.setting = setting
        self.episodes = 0
        self.diverged = False
        self.sample = 0  # control samples since the episode began
        self.commands_given: list[Array] = []  # the commands of an episode with the callback
        self.x = self.v = np.zeros(setting.scenario.plant.n)

    def begin(
        self, data: mujoco.MjData, random: Any, options: Mapping[str, Any] | None = None
    ) -> None:
        """Begin an episode from a start that is drawn, or set by the options x0 and v0."""
        self.start = self.setting.draw_start(random, options)
        self.episodes += 1
        self.begin_at_start(data)

    def begin_at_start(self, data: mujoco.MjData) -> None:
        """Begin an episode from `start`."""
        setting = self.setting
        mujoco.mj_resetData(setting.model, data)
        data.warning.number[:] = 1  # MuJoCo tells only the first: `diverged` says it
        data.qpos[:], data.qvel[:] = models.started(
            setting.model, setting.joints, setting.scenario, *self.start
        )
        if setting.uses_callback:
            self.callback_records = Records(setting, 1)
            data.userdata[:] = self.callback_records.begin(0, *self.start)
        data.act[:] = setting.activations
        self.commands_given = []
        self.sample = 0
        self.read_state(data)

    def apply_command(self, data: mujoco.MjData, command: Array) -> None:
        """Give the drives a command, (driven,)."""
        if self.setting.uses_callback:
            self.commands_given.append(command)
            self.callback_records.commands[0, : len(command)] = command
        else:
            data.ctrl[self.setting.ctrl] = self.setting.scale * command

    def read_state(self, data: mujoco.MjData) -> None:
        """Read the state."""
        if self.setting.uses_callback:
            self.callback_records.check()
        self.x = data.qpos[self.setting.qpos]
        self.v = data.qvel[self.setting.qvel]
        self.diverged = bool(self.setting.diverged(self.x, self.v))

    def reward_and_info(self) -> tuple[float, dict[str, Any]]:
        """Return the reward of the state, in [0, 1], and the info of gymnasium; 0 and NaN after a
        divergence.
        """
        time = self.sample * self.setting.scenario.control_period
        if self.diverged:
            return 0.0, {"time": time, "error": np.full(len(self.x), np.nan)}
        e, w = self.errors()
        counted = self.setting.counted
        return float(reward(e[counted], w[counted])), {"time": time, "error": e}

    def errors(self) -> ArrayPair:
        """Return the errors e and w of the task, (n,) each."""
        return self.setting.errors(self.x, self.v, self.sample)


def bounded(observation: Array) -> Array:
    """Return the last observation of an episode that diverged, limited to the observation space."""
    return np.clip(np.nan_to_num(observation, nan=MAX_STATE), -MAX_STATE, MAX_STATE)


def _task(name: Any, plant: Plant, flies: bool) -> Task:
    """Return the task of a name. Raise ScenarioError if the plant does not have it."""
    task = find("task", name, TASKS)
    names = FLIGHT_TASKS if flies else tasks(plant)
    if plant.pose and not flies:
        raise ScenarioError(
            f"{plant.name} is a free body: make its environment by gymnasium.make, and copies "
            "by make_vec(..., vectorization_mode='sync')"
        )
    if flies and not plant.pose:
        raise ScenarioError(f"{plant.name} is no free body: make its environment by gymnasium.make")
    if not isinstance(name, str) or name not in names:
        raise ScenarioError(
            f"task {shown(name)} is not for {plant.name}: choose from {', '.join(names)}"
        )
    return task


def _checked(changes: Mapping[str, Any], task: str) -> dict[str, Any]:
    if not isinstance(changes, Mapping):
        raise ScenarioError(f"changes is {shown(changes)}: give Scenario fields with their values")
    for name in changes:
        if name not in FIELDS:
            raise unknown("field of an environment", name, FIELDS)
    if "reference" in changes and not TASKS[task].moving:
        raise ScenarioError(
            f"reference is {shown(changes['reference'])}, and {task!r} follows none: take 'track'"
        )
    return dict(changes)


def _references(scenario: Resolved, samples: int) -> Array:
    """Return r, r' and r'' at every sample, (K + 1, 3 m), of m references: one, or one for each
    driven channel.
    """
    if samples == 1:  # the task has none
        return np.zeros((1, 3))
    times = (np.arange(samples) * scenario.control_period).tolist()
    by_channel = isinstance(scenario.reference, PerChannel) or scenario.plant.rest
    columns = []
    for signal in scenario.references[: scenario.plant.driven if by_channel else 1]:
        try:
            values = np.array([evaluate(signal, t) for t in times])
        except Failure as failure:
            raise ScenarioError(f"reference {failure}: give another") from None
        if not (finite := np.isfinite(values).all(axis=1)).all():
            moment = f"t = {times[np.argmin(finite)]:.6g} s"
            raise ScenarioError(
                f"reference {shown(signal)} is not a finite number at {moment}: give another"
            )
        columns.append(values)
    return np.stack(columns, axis=2).reshape(samples, -1)
