"""Replays: whether a trace's commands are what its law computes from its measurements, and from nothing else.

    result = smc.replay(trace)
    result.same, result.why

A replay takes two fresh processes. The first has no code of the law, its surface or its estimator. It repeats the run
with the recorded commands, which gives the sensor's readings. Every control period must end in the recorded state. The
second process has that code and the readings, but no motion, noise or disturbance. Its u and s must be the recorded
ones.

This exposes a law or an estimator that reads the plant's true state, a number of the run's noise or the time to a
fraction of a second, counts its calls, or writes to the plant. It could still pass its commands through a file or a
connection, because a process is no sandbox.
"""

import dataclasses
import os
import pickle
import subprocess
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.errors import ScenarioError, one_line
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading, estimator
from smc_mujoco.simulation import reference
from smc_mujoco.simulation.callback import installed
from smc_mujoco.simulation.model import mechanism
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.pickling import packed

ROUNDING = 1e-9  # tolerance of a state after a control period, and of u and s, relative to the largest value
# Tolerance of the rms of u and s with a compiled nominal model, whose last bit may flip a switch; relative as above.
MODEL_RMS = 0.01
TIMEOUTS = {"verify": 1800.0, "commands_of": 300.0}  # s, of each process; chosen
# What a law may know of its scenario.
KNOWN_FIELDS = ("plant", "law", "model", "surface", "control_period", "u_max", "reference", "feedforward", "velocity")


class Replay(NamedTuple):
    """The result for a trace."""

    same: bool | None  # whether the commands were computed again; None if the trace cannot be replayed
    why: str = ""  # what differs and when, or why it cannot be replayed; "" if it is the same


class Recording(NamedTuple):
    """The input of the process without the law: the run without its law, and the recorded signals."""

    scenario: Scenario
    exact: bool  # whether a replay computes u and s to the last bit
    x: np.ndarray  # (samples, n), as the next three
    v: np.ndarray
    u: np.ndarray
    s: np.ndarray


class Readings(NamedTuple):
    """The sensor's position and velocity of each channel at a sample k, at time t, s; (n,) each."""

    k: int
    t: float
    x: np.ndarray
    v: np.ndarray


def replay(trace: Trace) -> Replay:
    """Compute a trace's commands again from its measurements, in a fresh process.

    It takes some seconds, most of them to start two processes.

    Raises:
      ScenarioError: the replay takes too long, or fails in its process.
    """
    return replays([trace])[0]


def replays(traces: Sequence[Trace]) -> list[Replay]:
    """Return the `replay` of each trace, all with one pair of processes."""
    results, tasks = list[Replay](), dict[int, tuple[bytes, bytes]]()
    for i, trace in enumerate(traces):
        results.append(Replay(None, _obstacle(trace)))
        if not results[i].why:
            try:
                tasks[i] = packed(_recording(trace)), packed(_known(trace.scenario))
            except ScenarioError as error:
                results[i] = Replay(None, str(error))
    if tasks:
        for i, result in zip(tasks, _in_fresh_process("verify", list(tasks.values())), strict=True):
            results[i] = Replay(*result)
    return results


def _obstacle(trace: Trace) -> str:
    """Return why a trace cannot be replayed, "" if it can."""
    if any(part.function is None for part in trace.scenario.law.parts):
        return "its law is not available here"
    return "it failed at the start" if len(trace.t) < 2 or np.isnan(trace.u[1]).any() else ""


def _recording(trace: Trace) -> Recording:
    """Return a trace without the code of law, surface and estimator. A law of the same kind returns 0 instead."""
    s = trace.scenario
    placeholder = Component(
        kind="law",
        name="recorded",
        gains={},
        memory=1,
        function=_at_rest,
        joint=s.law.joint,
        requires_model=s.law.requires_model,
        relative_degree=s.law.relative_degree,
    )
    bare = dataclasses.replace(s, law=placeholder, surface=None, velocity=estimator("measured"))
    exact = s.resolved.model == "none" or bool(prepare(s).why_not)
    return Recording(bare, exact, trace.x, trace.v, trace.u, trace.s)


def _at_rest(y: Any, gains: Any, memory: Any) -> tuple[Any, Any]:
    return 0.0 * y.x, 0.0 * y.x


def _known(scenario: Scenario) -> Scenario:
    """Return a scenario that has only what its law may know: no noise, disturbance, other machine or initial state."""
    resolved = scenario.resolved
    return Scenario.recorded(actuator=scenario.actuator, **{name: getattr(resolved, name) for name in KNOWN_FIELDS})


def _in_fresh_process(task: str, arguments: object) -> Any:
    """Return the result of a function of this file, computed in a fresh process."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    code = "from smc_mujoco.studies.replay import serve; serve()"
    try:
        done = subprocess.run(
            [sys.executable, "-c", code, task],
            input=pickle.dumps(arguments),
            capture_output=True,
            timeout=TIMEOUTS[task],
            env=environment,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise ScenarioError(f"a replay took more than {TIMEOUTS[task]:g} s: replay fewer traces at a time") from None
    if done.returncode:
        why = one_line(done.stderr.decode(errors="replace").strip().rpartition("\n")[2])
        raise ScenarioError(f"a replay failed in its process ({why}): put your laws in a module, and try again")
    return pickle.loads(done.stdout)


def serve() -> None:
    """Call the function that the parent process names, and write its result to standard output."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # so that the user's code cannot write there
    function = {"verify": verify, "commands_of": commands_of}[sys.argv[1]]
    pickle.dump(function(pickle.load(sys.stdin.buffer)), answer)
    answer.flush()


# in the process without the law


def verify(tasks: Sequence[tuple[bytes, bytes]]) -> list[tuple[bool | None, str]]:
    """Return for every packed recording whether its u and s are those of the packed law, and what differs first."""
    runs = [Playback(pickle.loads(recording)) for recording, _ in tasks]
    for run in runs:
        run.play()
    laws = [(law, run.readings) for run, (_, law) in zip(runs, tasks, strict=True)]
    return [run.verdict(computed) for run, computed in zip(runs, _computed(laws), strict=True)]


def _computed(laws: list[tuple[bytes, list[Readings]]]) -> list[np.ndarray | str | None]:
    """Return what `commands_of` returns for all laws, None for a law that ends its process or never returns."""
    try:
        return _in_fresh_process("commands_of", laws)
    except ScenarioError:
        return [None] if len(laws) == 1 else [_computed([law])[0] for law in laws]


class Playback(reference.Loop):
    """A run with recorded commands, without a law."""

    def __init__(self, recorded: Recording):
        with installed():
            super().__init__(recorded.scenario, mechanism(recorded.scenario))
        self.recorded = recorded
        self.readings: list[Readings] = []  # of every call of the law
        self.mismatch_time: float | None = None  # s, first time at which the state is not the recorded one
        missing = np.flatnonzero(np.isnan(recorded.x).any(axis=1) | np.isnan(recorded.u).any(axis=1))
        self.end = int(missing[0]) if len(missing) else len(recorded.x)

    def play(self) -> None:
        """Take all physics steps."""
        with installed(self.control), np.errstate(all="ignore"):
            for step in range(min(self.end * self.scenario.steps, self.total + 1)):
                self.step(step)

    def step(self, step: int) -> None:
        """Take a physics step. Each control period begins in the recorded state, which is compared."""
        k, within = divmod(step, self.scenario.steps)
        if within == 0 and k:
            for values, recorded, at in (
                (self.data.qpos, self.recorded.x, self.channels["qpos"]),
                (self.data.qvel, self.recorded.v, self.channels["qvel"]),
            ):
                error = np.abs(values[at] - recorded[k]).max()
                if not error <= ROUNDING * max(np.nanmax(np.abs(recorded)), 1e-3) and self.mismatch_time is None:
                    self.mismatch_time = k * self.scenario.control_period
                values[at] = recorded[k]
        super().step(step)

    def update_law(self, x: np.ndarray, v: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the recorded u and s, (n,) each, and keep the readings."""
        k = len(self.commands) - 1
        self.readings.append(Readings(k, t, x.copy(), v.copy()))
        super().update_law(x, v, t)  # for the references
        self.last_u = self.recorded.u[k].copy()
        return self.recorded.u[k], self.recorded.s[k]

    def verdict(self, computed: np.ndarray | str | None) -> tuple[bool | None, str]:
        """Return whether computed u and s, (calls, 2, n), are the recorded ones, and what differs; None: no answer."""
        if self.mismatch_time is not None:
            return False, f"the plant does not move as recorded under these commands, at t = {self.mismatch_time:g} s"
        if computed is None:
            return False, "the law ends the process in which it is replayed, or takes too long there"
        if isinstance(computed, str):
            return None, computed
        samples = [reading.k for reading in self.readings]
        for j, (name, recorded) in enumerate({"commands": self.recorded.u, "values of s": self.recorded.s}.items()):
            largest = max(float(np.nanmax(np.abs(recorded))), 1e-300)
            error = np.abs(computed[:, j] - recorded[samples]).max(axis=1) / largest
            wrong = ~(error <= ROUNDING)
            if wrong.any() and (self.recorded.exact or not np.sqrt(np.mean(error**2)) <= MODEL_RMS):
                t = samples[int(wrong.argmax())] * self.scenario.control_period
                return False, f"the law computes other {name} from its measurements alone, from t = {t:g} s on"
        return True, ""


# in the process without the plant


def commands_of(tasks: Sequence[tuple[bytes, list[Readings]]]) -> list[np.ndarray | str]:
    """Return u and s of each packed law for its readings, (calls, 2, n); a text for one that cannot be loaded.

    Each law gets all its readings twice, the first time with the tasks in reverse order. A law that keeps a state
    outside its memory then returns other commands.
    """
    known = [(_loaded(law), readings) for law, readings in tasks]
    for law, readings in reversed(known):
        _commands(law, readings)
    return [_commands(law, readings) for law, readings in known]


def _loaded(law: bytes) -> Scenario | str:
    """Return a packed scenario, or why it cannot be loaded."""
    try:
        return pickle.loads(law)
    except Exception as error:  # whatever importing the user's modules raises
        return f"its law cannot be loaded in another process ({one_line(f'{type(error).__name__}: {error}')})"


def _commands(scenario: Scenario | str, readings: Sequence[Readings]) -> np.ndarray | str:
    """Return what the law of a scenario computes, NaN where it raises. The plant does not move."""
    if isinstance(scenario, str):
        return scenario
    with installed():
        loop = reference.Loop(scenario, mechanism(scenario))
    period, commands = scenario.control_period, np.full((len(readings), 2, scenario.plant.n), np.nan)
    with np.errstate(all="ignore"):
        for j, (_, t, x, v) in enumerate(readings):
            rates = v.copy()
            try:
                for i in range(len(v)):
                    rates[i], loop.a[i] = loop.estimator(i, Reading(period, float(x[i]), float(v[i])))
                commands[j] = loop.update_law(x, rates, t)
            except reference.Failure:
                continue
    return commands
