"""From scenarios to traces, in batches of bounded memory.

A group shares the plant, its size and the kinds of its parts (but not their numbers), the integrator, the physics step
and the number of steps. Its scenarios may differ in parameters, friction levels, laws, gains, signals, delays and
seeds. Functions that do not compile run in the reference loop. The results do not depend on the number of threads, the
grouping or the other runs.
"""

import contextlib
import ctypes
import os
import sys
import warnings
from collections.abc import Hashable, Iterable, Iterator, Sequence
from typing import overload

import mujoco

from smc_mujoco.common.errors import ScenarioError, users_stacklevel, whole
from smc_mujoco.common.progress import bar
from smc_mujoco.simulation import callback, reference
from smc_mujoco.simulation.batch import Report, ScenarioBatch
from smc_mujoco.simulation.prepare import Prepared, prepare
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

BATCH_BYTES = 256 * 2**20  # of logs and records in one Batch
MIN_TRIM_RUNS = 64  # runs of a batch; its memory is returned to the system only if it had as many; chosen


class PlainLoopWarning(UserWarning):
    """A warning: a law or signal does not compile and runs in the reference loop, several times slower, on one core."""


@overload
def run(scenarios: Scenario, threads: int | None = None, progress: bool = False) -> Trace: ...
@overload
def run(
    scenarios: Iterable[Scenario | Prepared], threads: int | None = None, progress: bool = False
) -> list[Trace]: ...
def run(
    scenarios: Scenario | Iterable[Scenario | Prepared], threads: int | None = None, progress: bool = False
) -> Trace | list[Trace]:
    """Run one scenario or many.

    Args:
      scenarios: a Scenario, or any number of them.
      threads: how many simulations at once; None for one per available core.
      progress: whether to show a progress bar.

    Returns:
      The Trace, or a list of them in the order of the scenarios. A run fails if its law raises or returns NaN, or if
      the plant diverges. Its Trace says so in `diverged_at` and `failure`; the other runs continue.

    Raises:
      ScenarioError: not a Scenario, or threads below 1.

    MuJoCo's callbacks are global to the process. During a run no other callback is called, and a run fails if somebody
    sets the control callback meanwhile.
    """
    prepared = list(map(prepare, [scenarios] if isinstance(scenarios, Scenario) else scenarios))
    work, count = sum(item.scenario.work for item in prepared), len(prepared)
    with bar(f"{count} run{'s' * (count != 1)}", work, shown=progress) as progress_bar:
        traces = dict(stream(prepared, threads, progress_bar.advance))
    return traces[0] if isinstance(scenarios, Scenario) else [traces[i] for i in range(count)]


def stream(
    scenarios: Iterable[Scenario | Prepared], threads: int | None = None, report: Report = lambda steps: None
) -> Iterator[tuple[int, Trace]]:
    """Yield pairs (index, Trace) as soon as their batch is done. At most one batch is in memory."""
    threads = cores(threads)
    groups: dict[Hashable, list[tuple[int, Prepared]]] = {}
    uncompiled: list[tuple[int, Prepared]] = []
    for index, prepared in enumerate(map(prepare, scenarios)):
        if prepared.why_not:
            warnings.warn(f"{prepared.why_not}; the run takes the reference loop", PlainLoopWarning, users_stacklevel())
            uncompiled.append((index, prepared))
        else:
            groups.setdefault(prepared.key, []).append((index, prepared))
    for group in groups.values():
        for batch in _batches(group, threads):
            items = [prepared for _, prepared in batch]
            with callback.installed(), memory_for(items):
                traces = ScenarioBatch(items, threads).run(report)
            if len(batch) >= MIN_TRIM_RUNS:
                return_freed_memory()
            yield from zip((index for index, _ in batch), traces, strict=True)
    for index, prepared in uncompiled:
        with memory_for([prepared]):
            trace = reference.simulate(prepared.scenario, prepared.mechanism)
        yield index, trace
        report(prepared.scenario.work)


@contextlib.contextmanager
def memory_for(prepared: Sequence[Prepared]) -> Iterator[None]:
    """Turn a MemoryError into one sentence about the runs."""
    try:
        yield
    except (MemoryError, ValueError, mujoco.FatalError) as error:  # MuJoCo raises any of the three
        if not (isinstance(error, MemoryError) or "allocate memory" in str(error)):
            raise
        count, needed = len(prepared), sum(item.bytes for item in prepared) / 2**20
        raise ScenarioError(
            f"no memory for {count} run{'s' * (count > 1)} at once, about {needed:.0f} MiB beside the traces kept so "
            "far: give a shorter duration, a longer control period or fewer channels, or take traces from smc.stream"
        ) from None


def return_freed_memory() -> None:
    """Return freed memory to the system, if the C library is glibc; 45 to 100 kB a run stay allocated without it."""
    if trim := getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None:
        trim(0)


def _batches(group: Sequence[tuple[int, Prepared]], threads: int) -> Iterator[list[tuple[int, Prepared]]]:
    """Yield a group in batches of at most BATCH_BYTES, but of at least one run for each thread."""
    batch: list[tuple[int, Prepared]] = []
    size = 0
    for index, prepared in group:
        needed = prepared.bytes
        if len(batch) >= threads and size + needed > BATCH_BYTES:
            yield batch
            batch, size = [], 0
        batch.append((index, prepared))
        size += needed
    if batch:
        yield batch


def cores(threads: int | None = None) -> int:
    """Return how many simulations to step at once: `threads`, or one for each core that this process may use."""
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return whole("threads", threads, 1, 1024)
