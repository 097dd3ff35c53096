"""Calls on the workers of an Executor: other processes of this machine, or other machines.

    with ProcessPoolExecutor() as pool:
        for i, result in called(pool, function, [(scenario,), (another,)]):
            ...

Every worker needs the same versions of Python and of the packages as this process, which is checked
before anything is loaded there. A law, signal or part in a module is sent by its name, so the
module must be importable there. One in a script, in a notebook or in another function is sent by
value, which needs cloudpickle. If a worker dies, dask calls another one; four deaths over one call
end the work. Other executors end it at the first.
"""

import contextlib
import copyreg
import functools
import io
import pickle
import platform
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent import futures
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from smc_mujoco.common import fingerprint
from smc_mujoco.common.constraints import Constraint
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, one_line, shown
from smc_mujoco.common.extras import extra
from smc_mujoco.common.version import versions
from smc_mujoco.control.component import Component

if TYPE_CHECKING:
    from distributed import Client  # pyright: ignore[reportMissingImports]

Result = TypeVar("Result")
MAX_SENT = 1000  # calls with the workers at once; chosen
ADDRESS = re.compile(r"(dask|tcp|tls)://[^:/]+:\d{1,5}")  # of a dask scheduler
TIMEOUT = 10.0  # s, for a scheduler; chosen
FIRST_WORKER = 60.0  # s, for the first worker, which imports much on a busy machine; chosen
# Modules that differ from process to process. Pickle names a function by its module, and a worker
# has another `__main__` than the script that was started.
SCRIPTS = ("__main__", "__mp_main__")
AGAIN = "start it and the same call again to continue"


def called(
    executor: Executor, function: Callable[..., Result], calls: Iterable[tuple]
) -> Iterator[tuple[int, Result]]:
    """Yield the number and the result of each call, in the order in which they end.

    Args:
      executor: an Executor, such as `opened` yields. It stays open.
      function: of a module of this package.
      calls: the positional arguments of each call. At most MAX_SENT are with the workers at once.

    Raises:
      ScenarioError: the executor stops, a worker has other software, or something cannot be sent.
        What the function raises is raised here, after the results that have arrived.
    """
    sent: dict[Future[Result], int] = {}
    here = software()
    try:
        for i, arguments in enumerate(calls):
            if len(sent) >= MAX_SENT:
                yield from _ended(sent)
            sent[_submitted(executor, packed((function, arguments)), here)] = i
        while sent:
            yield from _ended(sent)
    except (BrokenExecutor, CancelledError) as error:
        why = one_line(str(error)).rstrip(".") or "its tasks were cancelled"
        raise ScenarioError(f"the executor has stopped ({why}): {AGAIN}") from None
    except ImportError as error:  # of this module, by the executor itself
        raise ScenarioError(_version_mismatch(str(error))) from None
    finally:
        for future in sent:
            future.cancel()


def _submitted(executor: Executor, call: bytes, here: dict[str, str]) -> Future:
    try:
        return executor.submit(_on_worker, call, here)
    except RuntimeError as error:  # it was shut down, or its workers died
        raise BrokenExecutor(*error.args) from error


def _ended(sent: dict[Future[Result], int]) -> Iterator[tuple[int, Result]]:
    """Wait for calls to end and yield them, those that failed last."""
    done = futures.wait(sent, return_when=futures.FIRST_COMPLETED).done
    for future in sorted(done, key=_failed):
        yield sent.pop(future), future.result()


def _failed(future: Future) -> bool:
    return future.cancelled() or future.exception() is not None


def _on_worker(call: bytes, sender: dict[str, str]) -> Any:
    """Make a call, on a worker."""
    if (here := software()) != sender:
        differing = []
        for name, version in sender.items():
            if here.get(name) != version:
                differing.append(f"{name} {here.get(name)}")
        raise ScenarioError(_version_mismatch(", ".join(differing)))
    try:
        function, arguments = pickle.loads(call)
    except (ImportError, AttributeError) as error:
        raise ScenarioError(_version_mismatch(one_line(str(error)))) from None
    return function(*arguments)


def _version_mismatch(what: str) -> str:
    return (
        f"a worker has other software than this process ({what}): install there what is installed "
        "here, and your own modules"
    )


@functools.cache
def software() -> dict[str, str]:
    """Return name -> version of what the numbers of a run depend on, besides the user's code."""
    python = ".".join(platform.python_version_tuple()[:2])
    code = fingerprint.package()[:8]
    return {"Python": python, **versions(), "code": code}


@keyword_dataclass
class ExecutorAddress(Constraint):
    """An Executor, a dask Client, or the address of a dask scheduler."""

    def __call__(self, what: str, value: Any) -> Any:
        if isinstance(value, Executor) or _dask_client(value) is not None:
            return value
        if isinstance(value, str) and ADDRESS.fullmatch(value):
            return value
        raise ScenarioError(
            f"{what} is {shown(value)}: give a concurrent.futures.Executor, a dask Client or "
            "'dask://HOST:PORT' (tls://HOST:PORT with certificates)"
        )


Workers = Annotated["Executor | Client | str", ExecutorAddress()]  # where calls are made


@contextlib.contextmanager
def opened(where: Any) -> Iterator[Executor]:
    """Yield an Executor: the one given, or one for a dask Client or for a scheduler's address."""
    if (client := _dask_client(where)) is not None:
        yield _Dask(client)
    elif isinstance(where, str):
        with _client(where) as client:
            yield _Dask(client)
    else:
        yield where


def _dask_client(thing: Any) -> "Client | None":
    """Return the dask Client that a thing is or belongs to, if any."""
    distributed = sys.modules.get("distributed")
    if distributed is None:
        return None
    if isinstance(thing, distributed.Client):
        return thing
    if isinstance(thing, distributed.cfexecutor.ClientExecutor):
        return thing._client
    return None


@contextlib.contextmanager
def _client(address: str) -> "Iterator[Client]":
    """Yield a client of the dask scheduler at an address."""
    with extra("cluster", f"executor {address!r}"):
        from distributed import Client  # pyright: ignore[reportMissingImports]
        from distributed.security import Security  # pyright: ignore[reportMissingImports]
    url = re.sub("^dask:", "tcp:", address)
    security = None
    if url.startswith("tls:"):
        security = Security(require_encryption=True)
        if security.get_connection_args("client").get("ssl_context") is None:
            raise ScenarioError(
                f"dask at {address} wants certificates: name them in dask's configuration, "
                "distributed.comm.tls, on every machine"
            )
    try:
        client = Client(url, timeout=TIMEOUT, set_as_default=False, security=security)
    except OSError as error:  # a timeout is one
        raise ScenarioError(
            f"no dask at {address} ({one_line(str(error))}): start `dask scheduler` and "
            "`dask worker` there"
        ) from None
    with client:
        with contextlib.suppress(TimeoutError):
            client.wait_for_workers(1, timeout=FIRST_WORKER)
        if not client.ncores():
            raise ScenarioError(
                f"dask at {address} has no workers: start `dask worker` with its address"
            )
        yield client


class _Dask(Executor):
    """The workers of a dask client. Its own `get_executor()` waits for ever if the scheduler
    dies.
    """

    def __init__(self, client: Any):
        self.client = client

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have one of the workers call fn(*args, **kwargs)."""
        future: Future[Any] = Future()
        task = self.client.submit(fn, *args, pure=False, **kwargs)

        def ended(done: Any) -> None:
            if not future.set_running_or_notify_cancel():  # nobody waits for it any more
                return
            try:
                future.set_result(done.result())
            except CancelledError:
                future.set_exception(BrokenExecutor("dask is no longer there"))
            except BaseException as error:  # any: somebody waits for this future
                future.set_exception(_translated(error))

        task.add_done_callback(ended)
        return future


def _translated(error: BaseException) -> BaseException:
    """Return dask's own errors as those that every Executor has."""
    from distributed.comm import CommClosedError  # pyright: ignore[reportMissingImports]
    from distributed.scheduler import KilledWorker  # pyright: ignore[reportMissingImports]

    if isinstance(error, CommClosedError):  # its scheduler ended while a result was on its way
        return BrokenExecutor("dask is no longer there")
    if isinstance(error, KilledWorker):
        return BrokenExecutor(f"{error} The workers' logs may say why")
    if isinstance(error, RuntimeError) and isinstance(error.__cause__, ImportError):
        return error.__cause__  # it could not load this module on a worker
    return error


def packed(thing: object) -> bytes:
    """Return a thing as bytes for `pickle.loads` in any process that has this package, and
    cloudpickle if it is needed.
    """
    try:
        data = pickle.dumps(thing)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        return _by_value(thing, one_line(str(error)))
    if any(name.encode() in data for name in SCRIPTS):
        return _by_value(thing, "it is in a script")
    return data


def _by_value(thing: object, why: str) -> bytes:
    """Return a thing as bytes, with the code of scripts and of functions in functions."""
    cannot = "a law, signal or part cannot be sent to another process"
    try:
        import cloudpickle  # pyright: ignore[reportMissingImports]
    except ImportError:
        cure = "put it into a module, or pip install cloudpickle"
        raise ScenarioError(f"{cannot} ({why}): {cure}") from None

    class Pickler(cloudpickle.Pickler):
        """A pickler that writes a script's component by its fields, not by its name."""

        def reducer_override(self, obj: Any) -> Any:
            if isinstance(obj, Component) and getattr(obj.function, "__module__", "") in SCRIPTS:
                return copyreg.__newobj__, (Component,), vars(obj)  # pyright: ignore[reportAttributeAccessIssue]
            return super().reducer_override(obj)

    buffer = io.BytesIO()
    try:
        Pickler(buffer).dump(thing)
    except Exception as error:  # whatever an object's own methods raise
        raise ScenarioError(
            f"{cannot} ({one_line(str(error))}): use plain functions and numbers"
        ) from None
    return buffer.getvalue()
