"""How a study's runs are computed: in batches, on threads of this process, or by the workers of an Executor.

    local(batches(scenarios, threads), threads, finish)
    remote(batches(scenarios, 1), ProcessPoolExecutor(8), finish)

A batch is a list of scenarios of one layout, which is run, scored and kept as a whole: what a kill loses at most. An
outcome is the part of a table's row that only the run can tell: its scores and how it failed. It does not depend on the
batch in which the run was, nor on where that was computed.
"""

import pickle
import platform
import sys
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from typing import Any

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.metrics.catalogue import score
from smc_mujoco.simulation.batch import Report
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies import run_key

# Of a batch: `Scenario.work` a thread, 2 to 5 s of a core; in all, for what logs and scores take; runs.
STEPS, LOG_STEPS, RUNS = 500_000, 1_000_000, 1000
PLAIN = 40  # times slower than compiled laws is the plain loop, roughly
UNDER_WAY = 1000  # batches sent and not finished, that workers may share; chosen
ADDRESS = "dask://"

Outcome = dict[str, Any]
Batch = Sequence[Scenario]
Finish = Callable[[Batch, Sequence[Trace]], None]


def outcome(trace: Trace) -> Outcome:
    """The scores of a run, or how it failed."""
    failed: Outcome = {"diverged_at": trace.diverged_at, "failure": trace.failure}
    if trace.failure is not None:
        return failed
    try:
        return failed | score(trace)
    except ScenarioError as error:  # not finite, though nothing failed
        return failed | {"failure": str(error)}


def batches(scenarios: Iterable[Scenario], threads: int) -> Iterator[list[Scenario]]:
    """The scenarios, sorted into batches of one layout, each several seconds of work."""
    groups: dict[Hashable, list[Scenario]] = {}
    slow: dict[Hashable, bool] = {}
    for s in scenarios:
        prepared = prepare(s)
        key = prepared.key, bool(prepared.why_not)
        groups.setdefault(key, []).append(s)
        slow[key] = bool(prepared.why_not)
    most = min(STEPS * threads, LOG_STEPS)
    for key, group in groups.items():
        each = max(1, group[0].work) * (PLAIN * threads if slow[key] else 1)
        size = max(1, min(RUNS, most // each))
        yield from (group[i : i + size] for i in range(0, len(group), size))


def simulated(batch: Batch, threads: int | None, report: Report = lambda steps: None) -> list[Trace]:
    """The traces of a batch, in its order."""
    traces = dict(stream(batch, threads, report))
    return [traces[i] for i in range(len(batch))]


def local(batches: Iterable[Batch], threads: int | None, finish: Finish, report: Report = lambda steps: None) -> None:
    """Run batches one after the other; a thread scores and writes each while the next one runs.

    Args:
      finish: told each batch with its traces, one batch at a time.
      report: told the steps just simulated.
    """
    with ThreadPoolExecutor(1) as pool:
        last: Future[None] | None = None
        for batch in batches:
            traces = simulated(batch, threads, report)
            if last is not None:
                last.result()  # two batches are in memory, no more
            last = pool.submit(finish, batch, traces)
        if last is not None:
            last.result()


def remote(batches: Iterable[Batch], pool: Executor, finish: Callable[[Batch, Sequence[Outcome]], None]) -> None:
    """Have the workers of an Executor run batches. They send back outcomes, not traces.

    Args:
      pool: any concurrent.futures.Executor. It stays open.
      finish: told each batch with its outcomes, as they come.

    Raises:
      ScenarioError: the workers died, cannot load what they are to run, or have other code than this process.
    """
    sent: dict[Future[list[Outcome]], Batch] = {}

    def collect(most: int) -> None:
        """Finish batches until at most `most` are under way."""
        while len(sent) > most:
            done = wait(sent, return_when=FIRST_COMPLETED).done
            for future in sorted(done, key=_failed):  # before one raises, the others are kept
                finish(sent.pop(future), future.result())

    try:
        for batch in batches:
            collect(UNDER_WAY - 1)
            keys = [run_key.key(s) for s in batch]
            try:
                sent[pool.submit(work, _packed(batch), keys)] = batch
            except RuntimeError as error:  # it was shut down, or its workers died
                raise BrokenExecutor(*error.args) from error
        collect(0)
    except (BrokenExecutor, CancelledError) as error:
        why = " ".join(str(error).split()).rstrip(".") or "its tasks were cancelled"
        raise ScenarioError(f"the executor has stopped ({why}): start it and the study again to go on") from None
    except ImportError as error:
        raise ScenarioError(f"a worker says {error}: install smc-mujoco there, the same version as here") from None
    finally:
        for future in sent:
            future.cancel()


def _failed(future: Future) -> bool:
    return future.cancelled() or future.exception() is not None


def _packed(batch: Batch) -> bytes:
    """The batch as bytes: a worker that could not read a message itself would die of it."""
    try:
        return pickle.dumps(batch)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ScenarioError(
            f"cannot send {batch[0].law} to workers ({error}): define it at the top of a module"
        ) from None


def work(packed: bytes, keys: Sequence[str]) -> list[Outcome]:
    """What a worker does: run and score a batch.

    Args:
      packed: the batch, pickled.
      keys: of its scenarios, where they were sent from; see `identity.key`.

    Raises:
      ScenarioError: the worker cannot load the batch, or other code or versions give its scenarios other keys here.
    """
    try:
        batch: Batch = pickle.loads(packed)
    except (ImportError, AttributeError) as error:
        raise ScenarioError(f"a worker says {error}: put your laws in a module that workers can import") from None
    for scenario, sent in zip(batch, keys, strict=True):
        if run_key.key(scenario) != sent:
            versions = {"Python": platform.python_version()} | run_key.described(scenario)["versions"]
            here = ", ".join(f"{name} {version}" for name, version in versions.items())
            raise ScenarioError(f"a worker has other code for {scenario.law} ({here}): install the same there as here")
    return [outcome(trace) for trace in simulated(batch, _threads())]


def _threads() -> int:
    """As many as a dask worker was given; else one, for an Executor has a worker a core."""
    if (distributed := sys.modules.get("distributed")) is None:
        return 1
    try:
        return distributed.get_worker().state.nthreads
    except ValueError:  # this is no worker of dask's
        return 1


def checked(given: object) -> str | Executor:
    """The executor, or its name, if it is one; else the sentence that says what they are called."""
    if isinstance(given, Executor):
        return given
    if isinstance(given, str):
        host, _, port = given.removeprefix(ADDRESS).rpartition(":")
        remote = given.startswith(ADDRESS) and host and port.isdecimal() and int(port) < 2**16
        if remote or given == "local":
            return given
    raise ScenarioError(
        f"executor is {shown(given)}: give 'local', 'dask://HOST:PORT' or a concurrent.futures.Executor"
    )
