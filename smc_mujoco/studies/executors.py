"""Computation of a study's runs: in batches, on threads of this process or by the workers of an
Executor.

A batch is a list of prepared scenarios of one layout. It is run, scored and stored as a whole, so a
killed study loses at most one. The results depend neither on the batch nor on the machine. If a
worker dies, another one runs its batch. If four die with the same batch, the study ends, and can be
started again.
"""

import contextlib
import copyreg
import io
import math
import pickle
import platform
import re
import sys
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent import futures
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from typing import TYPE_CHECKING, Any

from smc_mujoco.common.errors import ScenarioError, one_line, shown
from smc_mujoco.common.extras import extra
from smc_mujoco.common.files import to_json
from smc_mujoco.control.component import Component
from smc_mujoco.metrics.catalogue import score, trends
from smc_mujoco.simulation import serialise
from smc_mujoco.simulation.prepare import Prepared, prepare
from smc_mujoco.simulation.run import Report, stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies import run_key

# of a batch, see `Scenario.work`: 4 to 10 s of a core. It does not depend on the number of threads,
# so that a study writes the same parts with any
MAX_WORK = 1_000_000
MAX_RUNS = 1000  # of a batch
MAX_BATCHES_SENT = 1000  # to workers, and not finished; chosen
ADDRESS = re.compile(r"(dask|tcp)://[^:]+:\d{1,5}")  # of a dask scheduler
TIMEOUT = 10.0  # s, for a scheduler, and for its first worker; chosen

if TYPE_CHECKING:
    from distributed import Client

    Workers = str | Executor | Client  # where a study is computed, see `as_executor`

ResultColumns = dict[str, Any]
Batch = Sequence[Prepared]


def result_columns(trace: Trace) -> ResultColumns:
    """Return the scores of a run, without those that are NaN, or how it failed."""
    failed: ResultColumns = {"diverged_at": trace.diverged_at, "failure": trace.failure}
    if trace.failure is not None:
        return failed
    try:
        known = {name: value for name, value in score(trace).items() if not math.isnan(value)}
        return failed | known | {"trends": to_json(trends(trace))}
    except ScenarioError as error:  # not finite, though nothing failed
        return failed | {"failure": str(error)}


def batches(scenarios: Iterable[Scenario]) -> Iterator[list[Prepared]]:
    """Yield prepared scenarios in batches of one layout, each several seconds of work."""
    groups: dict[Hashable, list[Prepared]] = {}
    for prepared in map(prepare, scenarios):
        groups.setdefault(prepared.key, []).append(prepared)
    for group in groups.values():
        size = min(max(1, MAX_WORK // group[0].scenario.work), MAX_RUNS)
        for first in range(0, len(group), size):
            yield group[first : first + size]


def run_batch(
    batch: Sequence[Scenario | Prepared], threads: int, report: Report = lambda steps: None
) -> list[Trace]:
    """Return the traces of a batch, in its order."""
    traces = dict(stream(batch, threads, report))
    return [traces[i] for i in range(len(batch))]


def compute_here(
    batches: Iterable[Batch],
    threads: int,
    finish: Callable[[Batch, Sequence[Trace]], None],
    report: Report = lambda steps: None,
) -> None:
    """Run batches one after the other; a thread scores and writes each while the next one runs."""
    with futures.ThreadPoolExecutor(1) as pool:
        last: Future[None] | None = None
        for batch in batches:
            traces = run_batch(batch, threads, report)
            if last is not None:
                last.result()  # two batches are in memory, no more
            last = pool.submit(finish, batch, traces)
        if last is not None:
            last.result()


def compute_elsewhere(
    batches: Iterable[Batch],
    pool: Executor,
    finish: Callable[[Batch, Sequence[ResultColumns]], None],
    report: Report = lambda steps: None,
) -> None:
    """Have the workers of an Executor run batches. They send back result columns, not traces."""
    sent: dict[Future[list[ResultColumns]], Batch] = {}
    plants: run_key.Hashes = {}

    def collect(remaining: int) -> None:
        """Finish batches until at most `remaining` are left with the workers."""
        while len(sent) > remaining:
            done = futures.wait(sent, return_when=futures.FIRST_COMPLETED).done
            # failed batches come last, so that the others are stored before an error ends the study
            for future in sorted(
                done, key=lambda future: future.cancelled() or future.exception() is not None
            ):
                batch = sent.pop(future)
                finish(batch, future.result())
                report(sum(prepared.scenario.work for prepared in batch))

    try:
        for batch in batches:
            collect(MAX_BATCHES_SENT - 1)
            scenarios = [prepared.scenario for prepared in batch]
            task = packed(scenarios), [run_key.key(s, plants=plants) for s in scenarios]
            try:
                sent[pool.submit(run_on_worker, *task)] = batch
            except RuntimeError as error:  # it was shut down, or its workers died
                raise BrokenExecutor(*error.args) from error
        collect(0)
    except (BrokenExecutor, CancelledError) as error:
        why = " ".join(str(error).split()).rstrip(".") or "its tasks were cancelled"
        raise ScenarioError(
            f"the executor has stopped ({why}): start it and the study again to continue"
        ) from None
    except ImportError as error:
        raise ScenarioError(
            f"a worker says {error}: install there what is installed here"
        ) from None
    finally:
        for future in sent:
            future.cancel()


def run_on_worker(packed: bytes, keys: Sequence[str]) -> list[ResultColumns]:
    """Run and score scenarios, on a worker."""
    try:
        scenarios: list[Scenario] = pickle.loads(packed)
    except AttributeError as error:
        raise ImportError(str(error)) from None
    plants: run_key.Hashes = {}
    for scenario, sent in zip(scenarios, keys, strict=True):
        if run_key.key(scenario, plants=plants) != sent:
            here = {"Python": platform.python_version(), **serialise.describe(scenario)["versions"]}
            raise ScenarioError(
                f"a worker has other code for {scenario.law} ({here}): install the same there as "
                "here"
            )
    return [result_columns(trace) for trace in run_batch(scenarios, _threads())]


def _threads() -> int:
    """Return the number of threads of a dask worker; 1 elsewhere, because other executors have a
    worker per core.
    """
    if (distributed := sys.modules.get("distributed")) is None:
        return 1
    try:
        return distributed.get_worker().state.nthreads
    except ValueError:  # not a worker of dask
        return 1


def as_executor(executor: object) -> str | Executor:
    """Return "local", an ADDRESS, or an Executor, which a dask Client becomes."""
    dask = sys.modules.get("distributed")
    if dask is not None and isinstance(executor, dask.Client):
        return _DaskExecutor(executor)
    if isinstance(executor, Executor):
        return executor
    if isinstance(executor, str) and (executor == "local" or ADDRESS.fullmatch(executor)):
        return executor
    raise ScenarioError(
        f"executor is {shown(executor)}: give 'local', 'dask://HOST:PORT', a dask Client or a "
        "concurrent.futures.Executor"
    )


@contextlib.contextmanager
def opened(executor: str | Executor) -> Iterator[Executor]:
    """Yield a given Executor, or one for the dask scheduler at an address."""
    if isinstance(executor, Executor):
        yield executor
        return
    with extra("cluster", f"executor {executor!r}"):
        from distributed import Client
        from distributed.scheduler import KilledWorker
    address = f"tcp://{executor.partition('://')[2]}"
    try:
        with Client(address, timeout=TIMEOUT, set_as_default=False) as client:
            with contextlib.suppress(TimeoutError):
                client.wait_for_workers(1, timeout=TIMEOUT)
            if not client.ncores():
                raise ScenarioError(
                    f"dask at {executor} has no workers: start `dask worker` with its address"
                )
            yield _DaskExecutor(client)
    except KilledWorker as error:
        raise ScenarioError(
            f"{error}: read the workers' logs, and start the study again to continue"
        ) from None
    except OSError as error:  # a timeout is one
        raise ScenarioError(
            f"no dask at {executor} ({error}): start `dask scheduler` and `dask worker` there"
        ) from None


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
            except BaseException as error:  # any: the study waits for this future
                future.set_exception(error)

        self.client.submit(fn, *args, pure=False, **kwargs).add_done_callback(copy)
        return future


# scenarios and laws as bytes for another process, with the code that it cannot import

# Pickle names a function by its module. A script or notebook is the module `__main__`, but a worker
# has another `__main__`. A law in a function or an executed file has no module at all. cloudpickle
# sends their code by value.
SCRIPTS = ("__main__", "__mp_main__")  # modules that differ from process to process


def packed(thing: Any) -> bytes:
    """Return a thing as bytes for `pickle.loads` in any process that has this package, and
    cloudpickle if needed.
    """
    try:
        data = pickle.dumps(thing)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        return _by_value(thing, one_line(str(error)))
    if any(name.encode() in data for name in SCRIPTS):
        return _by_value(thing, "it is in a script")
    return data


def _by_value(thing: Any, why: str) -> bytes:
    """Return a thing with the code of scripts and of functions in functions."""
    try:
        import cloudpickle
    except ImportError:
        cure = "put it into a module, or pip install cloudpickle"
        raise ScenarioError(
            f"a law, signal or part cannot be sent to another process ({why}): {cure}"
        ) from None

    class Pickler(cloudpickle.Pickler):
        """Pickler that writes a script's component by its fields, not by its name."""

        def reducer_override(self, obj: Any) -> Any:
            if isinstance(obj, Component) and getattr(obj.function, "__module__", "") in SCRIPTS:
                return copyreg.__newobj__, (Component,), vars(obj)  # type: ignore[attr-defined]
            return super().reducer_override(obj)

    buffer = io.BytesIO()
    try:
        Pickler(buffer).dump(thing)
    except Exception as error:  # whatever an object's own methods raise
        raise ScenarioError(
            f"a law, signal or part cannot be sent to another process ({one_line(str(error))}): "
            "use plain functions and numbers"
        ) from None
    return buffer.getvalue()
