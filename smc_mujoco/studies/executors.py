"""Computation of a study's runs: in batches, on threads of this process or by the workers of an Executor.

    compute_here(batches(scenarios, threads), threads, finish)
    compute_elsewhere(batches(scenarios, 1), ProcessPoolExecutor(8), finish)

A batch is a list of prepared scenarios of one layout. It is run, scored and stored as a whole, so a killed study loses
at most one. An outcome is the part of a table's row that follows from the run: its scores, or how it failed. It depends
neither on the batch nor on the machine that computed it.

A cluster takes `pip install 'smc-mujoco[cluster]'` on every machine, with the same versions, and

    dask scheduler                                         # prints its address
    dask worker tcp://HOST:PORT                            # on every machine
    smc-mujoco compare --executor dask://HOST:PORT

A batch whose worker dies is run by another one. Four deaths over one batch end the study, which can be started again.
"""

import contextlib
import logging
import math
import pickle
import platform
import sys
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent import futures
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from typing import TYPE_CHECKING, Any

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.extras import extra
from smc_mujoco.metrics.catalogue import score
from smc_mujoco.simulation.batch import Report
from smc_mujoco.simulation.prepare import Prepared, prepare
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies import run_key
from smc_mujoco.studies.parcel import packed

# Limits of a batch: `Scenario.work` per thread, 2 to 5 s of a core; work in all, which bounds the memory; runs.
STEPS, LOG_STEPS, RUNS = 500_000, 1_000_000, 1000
LOOP_SLOWDOWN = 40  # of the reference loop against compiled laws, roughly
UNDER_WAY = 1000  # most batches sent to workers and not finished; chosen
ADDRESS, DASKS_OWN = "dask://", "tcp://"  # two ways to write the address of a scheduler
LOGGERS = "distributed", "distributed.client", "tornado.application"  # those of dask that set their own level
WAIT = 10.0  # s, for a scheduler, and for its first worker; chosen

if TYPE_CHECKING:
    from distributed import Client

    Workers = str | Executor | Client  # where a study is computed, see `checked`

Outcome = dict[str, Any]
Batch = Sequence[Prepared]


def outcome(trace: Trace) -> Outcome:
    """Return the scores of a run, without those that are NaN, or how it failed."""
    failed: Outcome = {"diverged_at": trace.diverged_at, "failure": trace.failure}
    if trace.failure is not None:
        return failed
    try:
        return failed | {name: value for name, value in score(trace).items() if not math.isnan(value)}
    except ScenarioError as error:  # not finite, though nothing failed
        return failed | {"failure": str(error)}


def batches(scenarios: Iterable[Scenario], threads: int) -> Iterator[list[Prepared]]:
    """Sort scenarios into batches of one layout, each several seconds of work."""
    groups: dict[Hashable, list[Prepared]] = {}
    for prepared in map(prepare, scenarios):
        groups.setdefault((prepared.key, bool(prepared.why_not)), []).append(prepared)
    for group in groups.values():
        work = max(1, group[0].scenario.work) * (LOOP_SLOWDOWN * threads if group[0].why_not else 1)
        size = max(1, min(RUNS, min(STEPS * threads, LOG_STEPS) // work))
        yield from (group[i : i + size] for i in range(0, len(group), size))


def simulated(batch: Sequence[Scenario | Prepared], threads: int, report: Report = lambda steps: None) -> list[Trace]:
    """Return the traces of a batch, in its order."""
    traces = dict(stream(batch, threads, report))
    return [traces[i] for i in range(len(batch))]


def compute_here(
    batches: Iterable[Batch],
    threads: int,
    finish: Callable[[Batch, Sequence[Trace]], None],
    report: Report = lambda steps: None,
) -> None:
    """Run batches one after the other; a thread scores and writes each while the next one runs.

    Args:
      finish: called with each batch and its traces, one batch at a time.
      report: called with the number of steps just simulated.
    """
    with futures.ThreadPoolExecutor(1) as pool:
        last: Future[None] | None = None
        for batch in batches:
            traces = simulated(batch, threads, report)
            if last is not None:
                last.result()  # two batches are in memory, no more
            last = pool.submit(finish, batch, traces)
        if last is not None:
            last.result()


def compute_elsewhere(
    batches: Iterable[Batch],
    pool: Executor,
    finish: Callable[[Batch, Sequence[Outcome]], None],
    report: Report = lambda steps: None,
) -> None:
    """Have the workers of an Executor run batches. They send back outcomes, not traces.

    Args:
      pool: any concurrent.futures.Executor. It stays open.
      finish: called with each batch and its outcomes, as they come.
      report: called with the number of steps of each batch.

    Raises:
      ScenarioError: the workers died, cannot load the scenarios, or have other code than this process.
    """
    sent: dict[Future[list[Outcome]], Batch] = {}
    plants: run_key.Hashes = {}

    def collect(under_way: int) -> None:
        """Finish batches until at most so many are under way."""
        while len(sent) > under_way:
            done = futures.wait(sent, return_when=futures.FIRST_COMPLETED).done
            # those that failed come last, so that the others are stored before an error ends the study
            for future in sorted(done, key=lambda one: one.cancelled() or one.exception() is not None):
                batch = sent.pop(future)
                finish(batch, future.result())
                report(sum(one.scenario.work for one in batch))

    try:
        for batch in batches:
            collect(UNDER_WAY - 1)
            scenarios = [one.scenario for one in batch]
            task = packed(scenarios), [run_key.key(s, plants=plants) for s in scenarios]
            try:
                sent[pool.submit(work, *task)] = batch
            except RuntimeError as error:  # it was shut down, or its workers died
                raise BrokenExecutor(*error.args) from error
        collect(0)
    except (BrokenExecutor, CancelledError) as error:
        why = " ".join(str(error).split()).rstrip(".") or "its tasks were cancelled"
        raise ScenarioError(f"the executor has stopped ({why}): start it and the study again to continue") from None
    except ImportError as error:
        raise ScenarioError(f"a worker says {error}: install smc-mujoco there, the same version as here") from None
    finally:
        for future in sent:
            future.cancel()


def work(packed: bytes, keys: Sequence[str]) -> list[Outcome]:
    """Run and score scenarios, on a worker.

    Args:
      packed: the scenarios, pickled.
      keys: their keys in the process that sent them; see `run_key.key`.

    Raises:
      ScenarioError: the worker cannot load the scenarios, or other code or versions give them other keys here.
    """
    try:
        scenarios: list[Scenario] = pickle.loads(packed)
    except (ImportError, AttributeError) as error:
        raise ScenarioError(f"a worker says {error}: install there what your laws import") from None
    plants: run_key.Hashes = {}
    for scenario, sent in zip(scenarios, keys, strict=True):
        if run_key.key(scenario, plants=plants) != sent:
            versions = {"Python": platform.python_version()} | run_key.described(scenario)["versions"]
            here = ", ".join(f"{name} {version}" for name, version in versions.items())
            raise ScenarioError(f"a worker has other code for {scenario.law} ({here}): install the same there as here")
    return [outcome(trace) for trace in simulated(scenarios, _threads())]


def _threads() -> int:
    """Return the threads of a dask worker; else 1, as other executors have a worker per core."""
    if (distributed := sys.modules.get("distributed")) is None:
        return 1
    try:
        return distributed.get_worker().state.nthreads
    except ValueError:  # not a worker of dask
        return 1


def checked(executor: object) -> str | Executor:
    """Return "local", an address that begins with ADDRESS, or an Executor, also for a dask Client."""
    dask = sys.modules.get("distributed")
    if dask is not None and isinstance(executor, dask.Client):
        return _DaskExecutor(executor)
    if isinstance(executor, Executor):
        return executor
    if isinstance(executor, str):
        address = executor.replace(DASKS_OWN, ADDRESS, 1)
        host, _, port = address.removeprefix(ADDRESS).rpartition(":")
        remote = address.startswith(ADDRESS) and host and port.isdecimal() and int(port) < 2**16
        if remote or executor == "local":
            return address
    raise ScenarioError(
        f"executor is {shown(executor)}: give 'local', 'dask://HOST:PORT', a dask Client or a "
        "concurrent.futures.Executor"
    )


@contextlib.contextmanager
def opened(executor: str | Executor) -> Iterator[Executor]:
    """Return an Executor as it is, or open one of a dask scheduler's workers.

    Args:
      executor: an Executor, which stays open, or dask://HOST:PORT.

    Raises:
      ScenarioError: dask is not installed, there is no scheduler or worker, or the workers crash.
    """
    if isinstance(executor, Executor):
        yield executor
        return
    with extra("cluster", f"executor {executor!r}"):
        from distributed import Client
        from distributed.scheduler import KilledWorker
    logs = [logging.getLogger(name) for name in LOGGERS]  # an error is one sentence here, not also a traceback
    before = [log.level for log in logs]
    try:
        for log in logs:
            log.setLevel(logging.CRITICAL)
        with Client(f"tcp://{executor.removeprefix(ADDRESS)}", timeout=WAIT, set_as_default=False) as client:
            with contextlib.suppress(TimeoutError):
                client.wait_for_workers(1, timeout=WAIT)
            if not client.ncores():
                raise ScenarioError(f"dask at {executor} has no workers: start `dask worker` with its address")
            yield _DaskExecutor(client)
    except KilledWorker as error:
        raise ScenarioError(f"{error}: read the workers' logs, and start the study again to continue") from None
    except OSError as error:  # a timeout is one
        raise ScenarioError(
            f"no dask at {executor} ({error}): start `dask scheduler` and `dask worker` there"
        ) from None
    finally:
        for log, level in zip(logs, before, strict=True):
            log.setLevel(level)


class _DaskExecutor(Executor):
    """A dask client's workers. `Client.get_executor()` waits forever if the scheduler dies."""

    def __init__(self, client: Any):
        self.client = client

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have one of the workers call fn(*args, **kwargs)."""
        future: Future[Any] = Future()

        def copy(done: Any) -> None:
            if not future.set_running_or_notify_cancel():  # the study has ended meanwhile
                return
            try:
                future.set_result(done.result())
            except CancelledError:
                future.set_exception(BrokenExecutor("dask is no longer there"))
            except BaseException as error:  # of any kind: the study waits for it
                future.set_exception(error)

        self.client.submit(fn, *args, pure=False, **kwargs).add_done_callback(copy)
        return future
