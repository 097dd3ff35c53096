"""Scenarios to traces: grouped by model layout, one Batch a chunk, chunks bounded in memory.

A group shares the plant, its size and the kinds of its parts (but not their numbers), the integrator, the physics step
and the number of steps; parameters, friction levels, laws, gains, signals, delays and seeds mix freely within it. What
does not compile takes the plain loop. The results do not depend on the number of threads, on the grouping, or on what
else runs.
"""

import contextlib
import ctypes
import os
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from typing import overload

import mujoco

from smc_mujoco.common.errors import ScenarioError, shown, users_frame, whole
from smc_mujoco.common.jit import NotCompilable
from smc_mujoco.common.progress import bar
from smc_mujoco.simulation import callback, model, reference
from smc_mujoco.simulation.batch import Chunk, Report, contents
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Recorded
from smc_mujoco.simulation.state import LOGS
from smc_mujoco.simulation.trace import Trace

CHUNK_BYTES = 256 * 2**20  # of logs and rows that one Batch holds
DATA_BYTES, CHANNEL_BYTES = 176 * 2**10, 2 * 2**10  # of an mjData, measured: what it takes, and a channel more
MANY = 64  # runs of a chunk that leave more memory than it takes time to give it back; chosen
READING_BYTES = 67  # of a late sensor's history, measured: a channel and reading, in mjData and in the Batch


class PlainLoopWarning(UserWarning):
    """A law or signal does not compile and runs in the plain loop, several times slower and on one core."""


@overload
def run(scenarios: Scenario, threads: int | None = None, progress: bool = False) -> Trace: ...
@overload
def run(scenarios: Iterable[Scenario], threads: int | None = None, progress: bool = False) -> list[Trace]: ...
def run(
    scenarios: Scenario | Iterable[Scenario], threads: int | None = None, progress: bool = False
) -> Trace | list[Trace]:
    """Run one scenario or many.

    Args:
      scenarios: a Scenario, or any number of them.
      threads: how many simulations at once; None for one per available core.
      progress: whether to show a progress bar.

    Returns:
      The Trace, or a list of them in the order of the scenarios. A run that fails - its law raises or returns NaN, or
      the plant leaves the finite world - ends in a Trace whose `diverged_at` and `failure` say so; the others go on.

    Raises:
      ScenarioError: not a Scenario, or threads below 1.

    MuJoCo's callbacks are global to the process: while a run lasts, no other one is called, and a run during which
    somebody sets the control callback is a failure.
    """
    many = [scenarios] if isinstance(scenarios, Scenario) else _listed(scenarios)
    found: list[Trace | None] = [None] * len(many)
    work = sum(s.work for s in many if isinstance(s, Scenario))
    with bar(f"{len(many)} run{'s' * (len(many) != 1)}", work, shown=progress) as drawn:
        for index, trace in stream(many, threads, drawn.advance):
            found[index] = trace
    traces = [trace for trace in found if trace is not None]
    return traces[0] if isinstance(scenarios, Scenario) else traces


def stream(
    scenarios: Iterable[Scenario], threads: int | None = None, report: Report = lambda steps: None
) -> Iterator[tuple[int, Trace]]:
    """Pairs (index, Trace), each as soon as its chunk is done; at no time is more than one chunk held here."""
    scenarios = _listed(scenarios)
    threads = cores(threads)
    groups: dict[tuple, list[int]] = {}
    slow: list[int] = []
    for index, scenario in enumerate(scenarios):
        try:
            contents(scenario)  # compiles
            groups.setdefault(layout(scenario), []).append(index)
        except NotCompilable as error:
            warnings.warn(f"{error}; the run takes the plain loop", PlainLoopWarning, users_frame())
            slow.append(index)
    for indices in [*groups.values(), *([index] for index in slow)]:
        model.check_starts([scenarios[i] for i in indices])
    for indices in groups.values():
        for chunk in _chunks(scenarios, indices, threads):
            with callback.installed(), memory_for([scenarios[i] for i in chunk]):
                traces = Chunk([scenarios[i] for i in chunk], threads).run(report)
            if len(chunk) >= MANY:
                give_back()
            yield from zip(chunk, traces, strict=True)
    for index in slow:
        with memory_for([scenarios[index]]):
            trace = reference.run(scenarios[index])
        yield index, trace
        report(scenarios[index].work)


def _check(scenario: object) -> None:
    """Raise ScenarioError for what is no scenario, or one whose functions a file could not bring back."""
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"cannot run {shown(scenario)}: give a smc.Scenario")
    for part in (scenario.law, scenario.surface, scenario.velocity):
        if part is not None and part.function is None:
            raise ScenarioError(f"{part.kind} {part.name!r} came from a file without its code: give the {part.kind}")
    for signal in (scenario.reference, *scenario.disturbance):
        if isinstance(signal, Recorded):
            raise ScenarioError(f"signal {signal.kind!r} came from a file without its code: give the signal")


@contextlib.contextmanager
def memory_for(scenarios: Sequence[Scenario]) -> Iterator[None]:
    """Say in one sentence that memory ran out for runs."""
    try:
        yield
    except (MemoryError, ValueError, mujoco.FatalError) as error:  # MuJoCo has all three, by the place
        if not (isinstance(error, MemoryError) or "allocate memory" in str(error)):
            raise
        count, needed = len(scenarios), sum(map(_bytes, scenarios)) / 2**20
        raise ScenarioError(
            f"no memory for {count} run{'s' * (count > 1)} at once, about {needed:.0f} MiB beside the traces kept so "
            "far: give a shorter duration, a longer control period or fewer channels, or take traces from smc.stream"
        ) from None


def give_back() -> None:
    """Give freed memory back to the system, where the C library is glibc.

    What stays between freed mjData is 45 to 100 kB a run.
    """
    if trim := getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None:
        trim(0)


def layout(s: Scenario) -> tuple:
    """What the simulations of a Batch must have in common."""
    return model.structure(s), s.integrator, s.physics_step, s.control_period, s.samples


def _chunks(scenarios: Sequence[Scenario], indices: Sequence[int], threads: int) -> Iterator[list[int]]:
    """Indices in chunks of at most CHUNK_BYTES, though at least one a thread."""
    chunk: list[int] = []
    held = 0
    late = max(READING_BYTES * s.plant.n * s.readings for s in (scenarios[i] for i in indices))  # all get the longest
    for index in indices:
        size = _bytes(scenarios[index]) + late
        if len(chunk) >= threads and held + size > CHUNK_BYTES:
            yield chunk
            chunk, held = [], 0
        chunk.append(index)
        held += size
    if chunk:
        yield chunk


def _bytes(s: Scenario) -> int:
    """What a simulation takes: its log, its mjData, and twice its row (packed, and in the Batch) with the state."""
    surface = 0 if s.surface is None else s.surface.memory
    memories = s.law.memory + surface + s.velocity.memory + sum(d.memory for d in s.disturbance)
    row = 200 + s.plant.n * (memories + s.input_delay / s.control_period + 40)
    return int(8 * (LOGS * (s.samples + 1) * s.plant.n + 2 * row) + DATA_BYTES + CHANNEL_BYTES * s.plant.n)


def _listed(scenarios: object) -> list[Scenario]:
    if isinstance(scenarios, str) or not isinstance(scenarios, Iterable):
        raise ScenarioError(f"cannot run {shown(scenarios)}: give a smc.Scenario or several")
    found = []
    for scenario in scenarios:  # one by one, as they may be without end
        _check(scenario)
        found.append(scenario)
    return found


def cores(threads: int | None = None) -> int:
    """How many simulations at once: `threads`, or else one for each core that this process may use.

    Raises:
      ScenarioError: no whole number from 1 to 1024.
    """
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return whole("threads", threads, 1, 1024)
