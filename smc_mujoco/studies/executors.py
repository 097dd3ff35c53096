"""How a study's runs are computed: in batches, on threads of this process or by the workers of an Executor.

    compute_here(batches(scenarios, threads), threads, finish)
    compute_elsewhere(batches(scenarios, 1), ProcessPoolExecutor(8), finish)

A batch is a list of scenarios of one layout. It is run, scored and stored as a whole, so a kill loses at most one.
An outcome is the part of a table's row that only the run can tell: its scores and how it failed. It depends neither on
the batch nor on the place where the run was computed.

A cluster takes `pip install 'smc-mujoco[cluster]'` on every machine, with the same versions, and

    dask scheduler                                         # prints its address
    dask worker tcp://HOST:PORT                            # on every machine
    smc-mujoco bench --executor dask://HOST:PORT

A batch whose worker dies is run by another one. Four deaths over one batch end the study, which can be started again.
"""

import contextlib
import logging
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
from smc_mujoco.common.extras import extra
from smc_mujoco.metrics.catalogue import score
from smc_mujoco.simulation.batch import Report
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies import run_key

# Size of a batch: `Scenario.work` per thread, 2 to 5 s of a core; in all, for the memory of logs and scores; runs.
STEPS, LOG_STEPS, RUNS = 500_000, 1_000_000, 1000
LOOP_SLOWDOWN = 40  # of the reference loop against compiled laws, roughly
UNDER_WAY = 1000  # batches sent and not finished, that workers may share; chosen
ADDRESS = "dask://"
WAIT = 10.0  # s, for a scheduler, and for its first worker; chosen

Outcome = dict[str, Any]
Batch = Sequence[Scenario]
Finish = Callable[[Batch, Sequence[Trace]], None]


def outcome(trace: Trace) -> Outcome:
    """Return the scores of a run, or how it failed."""
    failed: Outcome = {"diverged_at": trace.diverged_at, "failure": trace.failure}
    if trace.failure is not None:
        return failed
    try:
        return failed | score(trace)
    except ScenarioError as error:  # not finite, though nothing failed
        return failed | {"failure": str(error)}


def batches(scenarios: Iterable[Scenario], threads: int) -> Iterator[list[Scenario]]:
    """Sort scenarios into batches of one layout, each several seconds of work."""
    groups: dict[Hashable, list[Scenario]] = {}
    slow: dict[Hashable, bool] = {}
    for s in scenarios:
        prepared = prepare(s)
        key = prepared.key, bool(prepared.why_not)
        groups.setdefault(key, []).append(s)
        slow[key] = bool(prepared.why_not)
    most = min(STEPS * threads, LOG_STEPS)
    for key, group in groups.items():
        each = max(1, group[0].work) * (LOOP_SLOWDOWN * threads if slow[key] else 1)
        size = max(1, min(RUNS, most // each))
        yield from (group[i : i + size] for i in range(0, len(group), size))


def simulated(batch: Batch, threads: int | None, report: Report = lambda steps: None) -> list[Trace]:
    """Return the traces of a batch, in its order."""
    traces = dict(stream(batch, threads, report))
    return [traces[i] for i in range(len(batch))]


def compute_here(
    batches: Iterable[Batch], threads: int | None, finish: Finish, report: Report = lambda steps: None
) -> None:
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


def compute_elsewhere(
    batches: Iterable[Batch], pool: Executor, finish: Callable[[Batch, Sequence[Outcome]], None]
) -> None:
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
            for future in sorted(done, key=_failed):  # before one raises, the others are stored
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
    """Return the batch as bytes: a worker that could not read a message itself would die of it."""
    try:
        return pickle.dumps(batch)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ScenarioError(
            f"cannot send {batch[0].law} to workers ({error}): define it at the top of a module"
        ) from None


def work(packed: bytes, keys: Sequence[str]) -> list[Outcome]:
    """Run and score a batch, on a worker.

    Args:
      packed: the batch, pickled.
      keys: keys of its scenarios in the process that sent them; see `run_key.key`.

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
    """Return the threads of a dask worker; else one, for other executors have a worker per core."""
    if (distributed := sys.modules.get("distributed")) is None:
        return 1
    try:
        return distributed.get_worker().state.nthreads
    except ValueError:  # this is no worker of dask's
        return 1


def checked(executor: object) -> str | Executor:
    """Return "local", an address or an Executor as it is; refuse anything else."""
    if isinstance(executor, Executor):
        return executor
    if isinstance(executor, str):
        host, _, port = executor.removeprefix(ADDRESS).rpartition(":")
        remote = executor.startswith(ADDRESS) and host and port.isdecimal() and int(port) < 2**16
        if remote or executor == "local":
            return executor
    raise ScenarioError(
        f"executor is {shown(executor)}: give 'local', 'dask://HOST:PORT' or a concurrent.futures.Executor"
    )


@contextlib.contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Open an Executor of a dask scheduler's workers.

    Args:
      address: dask://HOST:PORT.

    Raises:
      ScenarioError: no package for it, no scheduler there, no workers, or workers that die of what they run.
    """
    with extra("cluster", f"executor {address!r}"):
        from distributed import Client
        from distributed.scheduler import KilledWorker
    log = logging.getLogger("distributed.client")  # an error is one sentence here, not also a traceback
    before = log.level
    try:
        log.setLevel(logging.CRITICAL)
        with Client(f"tcp://{address.removeprefix(ADDRESS)}", timeout=WAIT, set_as_default=False) as client:
            with contextlib.suppress(TimeoutError):
                client.wait_for_workers(1, timeout=WAIT)
            if not client.ncores():
                raise ScenarioError(f"dask at {address} has no workers: start `dask worker` with its address")
            yield _DaskExecutor(client)
    except KilledWorker as error:
        raise ScenarioError(f"{error}: read the workers' logs, and start the study again to go on") from None
    except OSError as error:  # a timeout is one
        raise ScenarioError(f"no dask at {address} ({error}): start `dask scheduler` and `dask worker` there") from None
    finally:
        log.setLevel(before)


class _DaskExecutor(Executor):
    """A dask client's workers. `Client.get_executor()` waits for ever for a result if the scheduler dies meanwhile."""

    def __init__(self, client: Any):
        self.client = client

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have one of the workers call fn(*args, **kwargs)."""
        found: Future[Any] = Future()

        def told(done: Any) -> None:
            if not found.set_running_or_notify_cancel():  # nobody waits for it any more
                return
            try:
                found.set_result(done.result())
            except CancelledError:
                found.set_exception(BrokenExecutor("dask is no longer there"))
            except BaseException as error:  # whatever it is, somebody waits for it
                found.set_exception(error)

        self.client.submit(fn, *args, pure=False, **kwargs).add_done_callback(told)
        return found
