"""A setting: a plant with a task, ready to be simulated; the same for dm_env, gymnasium and batches.

The physics are those of `smc.run`: an action is the command u of a control sample, held for one control period, as a
part of its channel's limit, which is u_max or what the channel's own motor gives: in [-1, 1], beyond which it
saturates. Only the law is left out, and what a Scenario puts between plant and law: noise, delay, encoder; and
disturbances, contacts and jumps.
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, find, shown, unknown
from smc_mujoco.envs.tasks import TASKS, Pair, Task, reward, starts, tasks
from smc_mujoco.mechanisms.custom.channels import within
from smc_mujoco.mechanisms.hardware.part import ROTOR, joint_ids
from smc_mujoco.mechanisms.plant import Plant, ready
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation.channels import channels
from smc_mujoco.simulation.controller import MAX_CONTROL, MAX_STATE
from smc_mujoco.simulation.guarded import Failure, signalled
from smc_mujoco.simulation.scenario import Scenario

FIELDS = (  # of a Scenario that an environment takes
    "duration", "control_period", "physics_step", "integrator", "u_max", "x0", "v0", "reference", "mismatch",
    "friction", "mechanism", "actuator",
)  # fmt: skip


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Setting:
    """What environments of every kind share.

    Attributes:
      task: what is asked.
      scenario: the run that an episode is, with the law `none`.
      model: its compiled model.
      qpos, qvel: where its n channels lie, (n,) each; `ctrl` where the driven ones are commanded.
      rotors: channels with a rotor of their own, and where it lies in qpos and qvel, (3, m).
      which: the channels that the task singles out, (n,) of bool.
      low, high: bounds of the starts, (n,) each.
      references: r, r', r'' at every sample, (K + 1, 3); one row of zeros for a task that follows none.
    """

    task: Task
    scenario: Scenario
    model: mujoco.MjModel
    qpos: np.ndarray
    qvel: np.ndarray
    ctrl: np.ndarray
    rotors: np.ndarray
    which: np.ndarray
    low: np.ndarray
    high: np.ndarray
    references: np.ndarray

    @functools.cached_property
    def scale(self) -> float:
        """What the model's actuators take per unit of u."""
        return math.prod(part.scale for part in self.scenario.actuator)

    @functools.cached_property
    def most(self) -> np.ndarray:
        """What the model's actuators take at most, (driven,)."""
        return self.scale * np.array(self.scenario.limits)

    @functools.cached_property
    def size(self) -> int:
        """Numbers in an observation: positions, velocities, and for a moving task r, r', r''."""
        return 2 * self.scenario.plant.n + 3 * self.task.moving

    @functools.cached_property
    def shape(self) -> tuple[int]:
        """Of an action."""
        return (self.scenario.plant.driven,)

    @functools.cached_property
    def rest(self) -> Pair:
        """qpos (nq,) and qvel (nv,) of a run's start, in which an episode's x and v are put."""
        return assembly.start(self.model, self.scenario)

    def command(self, action: Any, copies: tuple[int, ...] = ()) -> np.ndarray:
        """What ctrl becomes under an action: each channel's limit times it, saturated, in the actuators' unit.

        Raises:
          ScenarioError: an action of another shape, or with what is no finite number.
        """
        try:
            a = np.asarray(action, float)
        except (TypeError, ValueError):
            a = np.array(np.nan)
        if a.shape != copies + self.shape or not math.isfinite(np.vdot(a, a)):
            shape = copies + self.shape
            raise ScenarioError(f"action is {_culprit(action, a, shape)}: give finite numbers, of shape {shape}")
        return self.most * np.minimum(np.maximum(a, -1.0), 1.0)

    def stretches(self, ctrl: np.ndarray, command: np.ndarray, first: np.ndarray) -> Iterator[int]:
        """Put a command through a control period: write ctrl, and yield for how many physics steps it holds.

        Args:
          ctrl: of one simulation, (nu,), or of several, (..., nu).
          command: what `command` returned, (..., driven).
          first: the output of the first of two drives at the period's begin, which becomes that at its end; as command.
        """
        tandem, steps = self.scenario.tandem, self.scenario.steps
        if tandem is None:
            ctrl[..., self.ctrl] = command
            yield steps
            return
        for _ in range(steps):
            ctrl[..., self.ctrl], first[:] = tandem(command, first)
            yield 1

    def draw(self, random: Any, options: Mapping[str, Any] | None = None) -> Pair:
        """A start: x and v, (n,) each, from a numpy generator of either kind, or as options x0 and v0 say.

        Raises:
          ScenarioError: another option, not n finite numbers, or an x0 outside a joint's range.
        """
        x, v = random.uniform(self.low, self.high), np.array(self.scenario.v0)
        if not isinstance(options, Mapping | None):
            raise ScenarioError(f"options is {shown(options)}: give a mapping, such as {{'x0': 1.0}}")
        for name, value in (options or {}).items():
            if name not in ("x0", "v0"):
                raise unknown("option of an episode", name, ("x0", "v0"))
            found = np.array(coerce.state(name, value, self.scenario.plant.n))
            if name == "x0":
                within(self.scenario.plant.name, self.scenario.plant.ranges, found)
            x, v = (found, v) if name == "x0" else (x, found)
        return x, v

    def place(self, qpos: np.ndarray, qvel: np.ndarray, x: np.ndarray, v: np.ndarray) -> None:
        """Write a start into qpos (nq,) and qvel (nv,)."""
        qpos[:], qvel[:] = self.rest
        qpos[self.qpos], qvel[self.qvel] = x, v
        channel, at_q, at_v = self.rotors
        qpos[at_q], qvel[at_v] = x[channel], v[channel]

    def reference(self, k: Any) -> np.ndarray:
        """r, r', r'' at sample k, (..., 3)."""
        return np.take(self.references, k, axis=0, mode="clip")  # a copy: who observes may write into it

    def observe(self, x: np.ndarray, v: np.ndarray, k: Any) -> np.ndarray:
        """The observation at sample k: x, v, and for a moving task the reference, (..., size)."""
        return np.concatenate((x, v, self.reference(k)) if self.task.moving else (x, v), axis=-1)

    def reward(self, x: np.ndarray, v: np.ndarray, k: Any) -> Any:
        """The reward of being at x, v (..., n) at sample k."""
        return reward(*self.task.errors(x, v, self.reference(k), self.which))

    def lost(self, x: np.ndarray, v: np.ndarray) -> Any:
        """Whether x, v (..., n) are outside the finite world, where an episode ends without reward."""
        return ~(np.vecdot(x, x) + np.vecdot(v, v) < MAX_STATE**2)


def bounded(observation: np.ndarray) -> np.ndarray:
    """An observation from outside the finite world, the last of its episode, as numbers that end there."""
    return np.clip(
        np.nan_to_num(observation, nan=MAX_STATE, posinf=MAX_STATE, neginf=-MAX_STATE), -MAX_STATE, MAX_STATE
    )


def _culprit(action: Any, a: np.ndarray, shape: tuple[int, ...]) -> str:
    """A refused action in words: of many copies the first one that is not finite."""
    if a.shape != shape or a.ndim < 2:
        return shown(action)
    i = int(np.argmin(np.abs(a).max(axis=-1) < MAX_CONTROL))
    return f"{shown(a[i].tolist())} for copy {i}"


def setting(
    plant: Plant | str,
    task: str = "regulate",
    changes: Mapping[str, Any] | None = None,
    edit: Callable[[mujoco.MjSpec], None] = lambda spec: None,
) -> Setting:
    """A plant with a task.

    Args:
      plant: a Plant or the name of one.
      task: one of `tasks(plant)`.
      changes: Scenario field -> value, of FIELDS, such as {"control_period": 0.01, "u_max": 3.0}.
      edit: what is done to the mechanism before it is compiled, and does not change how it moves.

    Raises:
      ScenarioError: a plant, task or field that there is not, a task that is not for the plant, a value out of range.
    """
    plant = find_plant(plant) if isinstance(plant, str) else plant
    found, offered = find("task", task, TASKS), tasks(plant)
    if task not in offered:
        raise ScenarioError(f"task {task!r} is not for {plant.name}: choose from {', '.join(offered)}")
    changes = _checked({} if changes is None else changes, task)
    scenario = Scenario(**({"plant": plant, "law": "none"} | found.fields(plant) | changes))
    if math.inf in scenario.limits:
        raise ScenarioError("u_max is inf: give a finite one, so that an agent knows what it may ask")
    fixed = np.array(scenario.x0)
    return _built(scenario, found, starts(found, plant) if changes.get("x0") is None else (fixed, fixed), edit)


def _checked(changes: Mapping[str, Any], task: str) -> dict[str, Any]:
    """Changes as a dict, or ScenarioError."""
    if not isinstance(changes, Mapping):
        raise ScenarioError(f"changes is {shown(changes)}: give Scenario fields with their values")
    for name in changes:
        if name not in FIELDS:
            raise unknown("field of an environment", name, FIELDS)
    if "reference" in changes and not TASKS[task].moving:
        raise ScenarioError(f"reference is {shown(changes['reference'])}, but task {task!r} follows none: take 'track'")
    return dict(changes)


def _built(scenario: Scenario, task: Task, spread: Pair, edit: Callable[[mujoco.MjSpec], None]) -> Setting:
    """The Setting of a scenario and its task, compiled."""
    model = _compiled(scenario, edit)
    table = channels(model)
    rotors = []
    for i, joint in enumerate(joint_ids(model)):
        rotor = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, ROTOR + model.joint(joint).name)
        if rotor >= 0:
            rotors.append((i, model.jnt_qposadr[rotor], model.jnt_dofadr[rotor]))
    times = np.arange(scenario.samples + 1 if task.moving else 1) * scenario.control_period
    try:
        references = np.array([signalled(scenario.reference, float(t)) for t in times])
    except Failure as failure:
        raise ScenarioError(f"reference {failure}: give another") from None
    if not (finite := np.isfinite(references).all(axis=1)).all():
        at = f"t = {times[np.argmin(finite)]:.6g} s"
        raise ScenarioError(f"reference {shown(scenario.reference)} is no finite number at {at}: give another")
    return Setting(
        task=task,
        scenario=scenario,
        model=model,
        qpos=table["qpos"],
        qvel=table["qvel"],
        ctrl=table["ctrl"][: scenario.plant.driven],
        rotors=np.array(rotors, int).reshape(-1, 3).T,
        which=task.which(scenario.plant),
        low=spread[0],
        high=spread[1],
        references=references,
    )


def _compiled(scenario: Scenario, edit: Callable[[mujoco.MjSpec], None]) -> mujoco.MjModel:
    """What `assembly.model` makes of a scenario, edited, with its numbers."""
    spec = assembly.spec([scenario])
    edit(spec)
    made = ready(spec, 0)
    made.opt.timestep = scenario.physics_step
    made.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{scenario.integrator.upper()}")
    return assembly.numbered(made, scenario)
