"""Replays: whether a trace's commands are what its law computes from its measurements, and from nothing else.

    found = smc.replay(trace)
    found.same, found.why

Two fresh processes do it. The first has no code of the law. It repeats the run with the recorded commands, which gives
the law's measurements; every control period must end where the recorded one ends. The second has the law and these
measurements, and no plant; its commands must be the recorded ones. So a law that reads the plant's true state or the
time of day, that counts its calls, or that writes to the plant has another trace. A law could still hand over its
commands by a file or a connection: no process is a sandbox.
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
from smc_mujoco.studies.parcel import packed

ROUNDING = 1e-9  # relative to the largest value: of a state after a control period, and of a command
MODELLED = 0.01  # rms of a command, relative to the largest: the last bit of a nominal model may turn a switch over
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
    """What the process without the law gets: the run without its law, and what was recorded."""

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
    """Return what `replay` returns, for several traces in one go."""
    results = [_refused(trace) for trace in traces]
    sent = [i for i, known in enumerate(results) if known is None]
    tasks = [(_recording(traces[i]), packed(traces[i].scenario.law)) for i in sent]
    if tasks:
        for i, result in zip(sent, _elsewhere("compared", tasks), strict=True):
            results[i] = Replay(*result)
    return [one or Replay(None) for one in results]


def _refused(trace: Trace) -> Replay | None:
    """Return why a trace cannot be replayed, or None."""
    if any(part.function is None for part in trace.scenario.law.parts):
        return Replay(None, "its law is not available here")
    return Replay(None, "it failed at the start") if len(trace.t) < 2 or np.isnan(trace.u[1]).any() else None


def _recording(trace: Trace) -> Recording:
    """Return a trace without its law's code: a law of the same kind that is never called stands for it."""
    s = trace.scenario
    silent = Component(
        kind="law", name="recorded", gains={}, memory=1, function=_silent, joint=s.law.joint,
        requires_model=s.law.requires_model, relative_degree=s.law.relative_degree,
    )  # fmt: skip
    return Recording(dataclasses.replace(s, law=silent), trace.x, trace.v, trace.u, trace.s)


def _silent(y: Any, gains: Any, memory: Any) -> tuple[float, float]:
    return 0.0, 0.0


def _elsewhere(task: str, arguments: object) -> Any:
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
    """Answer on standard output what the parent process wants to know."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the user's code prints is no answer
    function = {"compared": compared, "commanded": commanded}[sys.argv[1]]
    pickle.dump(function(pickle.load(sys.stdin.buffer)), answer)
    answer.flush()


# in the process without the law


def compared(tasks: Sequence[tuple[Recording, bytes]]) -> list[tuple[bool, str]]:
    """Return for every recording whether it is what the packed law does, and what differs first."""
    runs = [Playback(recording) for recording, _ in tasks]
    for run in runs:
        run.play()
    commanded = _elsewhere("commanded", [(law, run.measured) for run, (_, law) in zip(runs, tasks, strict=True)])
    return [run.verdict(commands) for run, commands in zip(runs, commanded, strict=True)]


class Playback(reference.Loop):
    """A run with recorded commands, without a law.

    Attributes:
      recorded: the run.
      measured: (channel, measurement) of every call of the law; of a law of many joints the channel is -1.
      samples_of: the sample of each.
      strayed: the first time, s, to which the plant did not get as recorded; None: it got everywhere.
    """

    def __init__(self, recorded: Recording):
        with installed():
            super().__init__(recorded.scenario, mechanism(recorded.scenario))
        self.recorded, self.law = recorded, _Recorded(self)
        self.measured: list[tuple[int, Any]] = []
        self.samples_of: list[int] = []
        self.strayed: float | None = None
        there = np.flatnonzero(np.isnan(recorded.x).any(axis=1) | np.isnan(recorded.u).any(axis=1))
        self.end = int(there[0]) if len(there) else len(recorded.x)  # the first sample that is not there

    def play(self) -> None:
        """Do all steps."""
        with installed(self.control), np.errstate(all="ignore"):
            for step in range(min(self.end * self.scenario.steps, self.total + 1)):
                self.step(step)

    def step(self, step: int) -> None:
        """Do a physics step; one that begins a sample begins in the recorded state."""
        k, within = divmod(step, self.scenario.steps)
        if within == 0 and k:
            for values, recorded, at in (
                (self.data.qpos, self.recorded.x, self.channels["qpos"]),
                (self.data.qvel, self.recorded.v, self.channels["qvel"]),
            ):
                error = np.abs(values[at] - recorded[k]).max()
                if not error <= ROUNDING * max(np.nanmax(np.abs(recorded)), 1e-3) and self.strayed is None:
                    self.strayed = k * self.scenario.control_period
                values[at] = recorded[k]
        super().step(step)

    def bounded(self, i: int, u: float, s: float) -> float:
        """Return the recorded command of channel i."""
        self.latest[i] = self.recorded.u[len(self.commands) - 1, i]
        return self.latest[i]

    def verdict(self, commands: Sequence[Any]) -> tuple[bool, str]:
        """Return whether the recorded commands are these, after feedforward and bounds, and what differs first."""
        if self.strayed is not None:
            return False, f"the plant does not move as recorded under these commands, at t = {self.strayed:g} s"
        scale, total, first = max(float(np.nanmax(np.abs(self.recorded.u))), 1e-300), 0.0, None
        for k, (i, y), command in zip(self.samples_of, self.measured, commands, strict=True):
            feedforward = self.scenario.feedforward
            added = 0.0 if feedforward is None else reference.evaluate(feedforward, y.t)[0]
            at = slice(None) if i < 0 else slice(i, i + 1)
            u = np.clip(
                np.atleast_1d(np.nan if command is None else command) + added, -self.limits[at], self.limits[at]
            )
            error = float(np.abs(u - self.recorded.u[k, : len(self.limits)][at]).max()) / scale
            total += error**2 if error > ROUNDING else 0.0
            first = k if first is None and not error <= ROUNDING else first
        rms = (total / max(len(commands), 1)) ** 0.5
        if first is None or (self.scenario.model == "nominal" and rms <= MODELLED):
            return True, ""
        t = first * self.scenario.control_period
        return False, f"the law computes other commands from its measurements alone, from t = {t:g} s on"


class _Recorded:
    """What stands for the law in a Playback: it notes the measurements."""

    name = "recorded"

    def __init__(self, run: Playback):
        self.run = run

    def __call__(self, i: int, y: Any) -> tuple[float, float]:
        """Return u and s of channel i."""
        k = len(self.run.commands) - 1
        self.run.measured.append((i, y))
        self.run.samples_of.append(k)
        return float(self.run.recorded.u[k, i]), float(self.run.recorded.s[k, i])

    def together(self, y: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return u and s of all channels."""
        self(0, y)
        self.run.measured[-1] = -1, y
        k = self.run.samples_of[-1]
        return self.run.recorded.u[k], self.run.recorded.s[k]


# in the process without the plant


def commanded(tasks: Sequence[tuple[bytes, list[tuple[int, Any]]]]) -> list[list[Any]]:
    """Return the u that each law, packed, returns for its measurements in their order; None where it raises.

    Each law has been called for all of them before, in the other order of tasks, so that one which keeps a state
    elsewhere than in its memory gives others.
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
                commands.append(function.together(y)[0] if i < 0 else function(i, y)[0])
            except reference.Failure:
                commands.append(None)
    return commands
