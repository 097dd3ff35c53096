"""Replays: whether a trace's commands are what its law computes from its measurements, and from nothing else.

    result = smc.replay(trace)
    result.same, result.why

A replay takes two fresh processes. The first has no code of the law. It repeats the run with the recorded commands,
which gives the law's measurements. Every control period must end in the recorded state. The second process has the law
and these measurements, and no plant. Its commands must be the recorded ones.

So a law is recognised that reads the plant's true state or the time of day, counts its calls, or writes to the plant. A
law could still pass its commands through a file or a connection: no process is a sandbox.
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
from smc_mujoco.simulation import reference
from smc_mujoco.simulation.callback import installed
from smc_mujoco.simulation.model import mechanism
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.pickling import packed

ROUNDING = 1e-9  # difference of a state after a control period, or of a command, relative to the largest value
MODEL_RMS = 0.01  # rms difference of commands, relative to the largest: a nominal model's last bit may flip a switch
TIMEOUT = 600.0  # s, for all traces of a call; chosen


class Replay(NamedTuple):
    """The result for a trace.

    Attributes:
      same: whether the commands were computed again; None if the trace cannot be replayed.
      why: what differs and when, or why it cannot be replayed; "" if it is the same.
    """

    same: bool | None
    why: str = ""


class Recording(NamedTuple):
    """The input of the process without the law: the run without its law, and the recorded signals."""

    scenario: Scenario
    x: np.ndarray
    v: np.ndarray
    u: np.ndarray
    s: np.ndarray


def replay(trace: Trace) -> Replay:
    """Compute a trace's commands again from its measurements, in a fresh process.

    It takes some seconds, most of them to start two processes.

    Raises:
      ScenarioError: the law cannot be sent to a process.
    """
    return replays([trace])[0]


def replays(traces: Sequence[Trace]) -> list[Replay]:
    """Return the `replay` of each trace, all with one pair of processes."""
    results = [Replay(None, _obstacle(trace)) for trace in traces]
    sent = [i for i, result in enumerate(results) if not result.why]
    tasks = [(_recording(traces[i]), packed(traces[i].scenario.law)) for i in sent]
    if tasks:
        for i, result in zip(sent, _in_fresh_process("verify", tasks), strict=True):
            results[i] = Replay(*result)
    return results


def _obstacle(trace: Trace) -> str:
    """Return why a trace cannot be replayed, "" if it can."""
    if any(part.function is None for part in trace.scenario.law.parts):
        return "its law is not available here"
    return "it failed at the start" if len(trace.t) < 2 or np.isnan(trace.u[1]).any() else ""


def _recording(trace: Trace) -> Recording:
    """Return a trace without its law's code. A law of the same kind, which is never called, stands for it."""
    s = trace.scenario
    placeholder = Component(
        kind="law", name="recorded", gains={}, memory=1, function=_never_called, joint=s.law.joint,
        requires_model=s.law.requires_model, relative_degree=s.law.relative_degree,
    )  # fmt: skip
    return Recording(dataclasses.replace(s, law=placeholder), trace.x, trace.v, trace.u, trace.s)


def _never_called(y: Any, gains: Any, memory: Any) -> tuple[float, float]:
    return 0.0, 0.0


def _in_fresh_process(task: str, arguments: object) -> Any:
    """Return the result of a function of this file, computed in a fresh process.

    Raises:
      ScenarioError: the process failed.
    """
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    code = "from smc_mujoco.studies.replay import serve; serve()"
    try:
        done = subprocess.run(
            [sys.executable, "-c", code, task], input=pickle.dumps(arguments), capture_output=True, timeout=TIMEOUT,
            env=environment, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise ScenarioError(f"a replay took more than {TIMEOUT:g} s: replay fewer traces at a time") from None
    if done.returncode:
        why = one_line(done.stderr.decode(errors="replace").strip().rpartition("\n")[2])
        raise ScenarioError(f"a replay failed in its process ({why}): put your laws in a module, and try again")
    return pickle.loads(done.stdout)


def serve() -> None:
    """Call the function that the parent process names, and write its result to standard output."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # so that nothing else is written there, by the user's code
    function = {"verify": verify, "commands_of": commands_of}[sys.argv[1]]
    pickle.dump(function(pickle.load(sys.stdin.buffer)), answer)
    answer.flush()


# in the process without the law


def verify(tasks: Sequence[tuple[Recording, bytes]]) -> list[tuple[bool, str]]:
    """Return for every recording whether its commands are those of the packed law, and what differs first."""
    runs = [Playback(recording) for recording, _ in tasks]
    for run in runs:
        run.play()
    laws = [(law, run.measured) for run, (_, law) in zip(runs, tasks, strict=True)]
    return [run.verdict(commands) for run, commands in zip(runs, _in_fresh_process("commands_of", laws), strict=True)]


class Playback(reference.Loop):
    """A run with recorded commands, without a law.

    Attributes:
      recorded: the run.
      measured: (channel, measurement) of every call of the law; of a law of many joints the channel is -1.
      call_samples: the sample of each call.
      mismatch_time: the first time, s, at which the state is not the recorded one; None if it always is.
      end: number of recorded samples without NaN.
    """

    def __init__(self, recorded: Recording):
        with installed():
            super().__init__(recorded.scenario, mechanism(recorded.scenario))
        self.recorded, self.law = recorded, _RecordedLaw(self)
        self.measured: list[tuple[int, Any]] = []
        self.call_samples: list[int] = []
        self.mismatch_time: float | None = None
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

    def bounded_command(self, i: int, u: float, s: float) -> float:
        """Return the recorded command of channel i."""
        self.last_u[i] = self.recorded.u[len(self.commands) - 1, i]
        return self.last_u[i]

    def verdict(self, commands: Sequence[Any]) -> tuple[bool, str]:
        """Return whether these commands, with feedforward and bounds, are the recorded ones, and what differs first."""
        if self.mismatch_time is not None:
            return False, f"the plant does not move as recorded under these commands, at t = {self.mismatch_time:g} s"
        scale, total, first = max(float(np.nanmax(np.abs(self.recorded.u))), 1e-300), 0.0, None
        for k, (i, y), command in zip(self.call_samples, self.measured, commands, strict=True):
            feedforward = self.scenario.feedforward
            added = 0.0 if feedforward is None else reference.evaluate(feedforward, y.t)[0]
            at = slice(None) if i < 0 else slice(i, i + 1)
            law_u = np.atleast_1d(np.nan if command is None else command)
            u = np.clip(law_u + added, -self.limits[at], self.limits[at])
            error = float(np.abs(u - self.recorded.u[k, : len(self.limits)][at]).max()) / scale
            total += error**2 if error > ROUNDING else 0.0
            first = k if first is None and not error <= ROUNDING else first
        rms = (total / max(len(commands), 1)) ** 0.5
        if first is None or (self.scenario.model == "nominal" and rms <= MODEL_RMS):
            return True, ""
        t = first * self.scenario.control_period
        return False, f"the law computes other commands from its measurements alone, from t = {t:g} s on"


class _RecordedLaw:
    """The law of a Playback: it records its measurements and returns the recorded commands."""

    name = "recorded"

    def __init__(self, run: Playback):
        self.run = run

    def __call__(self, i: int, y: Any) -> tuple[float, float]:
        """Return u and s of channel i."""
        k = len(self.run.commands) - 1
        self.run.measured.append((i, y))
        self.run.call_samples.append(k)
        return float(self.run.recorded.u[k, i]), float(self.run.recorded.s[k, i])

    def call_joint(self, y: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return u and s of all channels."""
        self(0, y)
        self.run.measured[-1] = -1, y
        k = self.run.call_samples[-1]
        return self.run.recorded.u[k], self.run.recorded.s[k]


# in the process without the plant


def commands_of(tasks: Sequence[tuple[bytes, list[tuple[int, Any]]]]) -> list[list[Any]]:
    """Return the u of each packed law for its measurements, in their order; None where the law raises.

    All laws are called twice, first in the reverse order of the tasks. So a law that keeps a state outside its memory
    returns other commands.
    """
    loaded = [(pickle.loads(law), measured) for law, measured in tasks]
    for law, measured in reversed(loaded):
        _commands(law, measured)
    return [_commands(law, measured) for law, measured in loaded]


def _commands(law: Component, measured: Sequence[tuple[int, Any]]) -> list[Any]:
    commands = []
    joints = max((len(y.x) if i < 0 else i + 1 for i, y in measured), default=1)
    function = reference.PythonComponent(law, joints)
    with np.errstate(all="ignore"):
        for i, y in measured:
            try:
                commands.append(function.call_joint(y)[0] if i < 0 else function(i, y)[0])
            except reference.Failure:
                commands.append(None)
    return commands
