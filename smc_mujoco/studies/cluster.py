"""The workers of a dask cluster as an Executor: `pip install 'smc-mujoco[cluster]'`.

    dask scheduler                                         # prints its address
    dask worker tcp://HOST:PORT                            # on every machine, with the same versions as here
    smc-mujoco bench --executor dask://HOST:PORT

A batch whose worker dies is run by another; four deaths over one batch end the study, which can be started again.
"""

import contextlib
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from typing import Any

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.extras import extra
from smc_mujoco.studies.executor import ADDRESS

WAIT = 10.0  # s, for a scheduler, and for its first worker; chosen


class _Workers(Executor):
    """The workers as an Executor.

    `Client.get_executor()` is one, too, but waits for ever for a result that was on its way when the scheduler died.
    """

    def __init__(self, client: Any):
        self.client = client

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """A call of fn(*args, **kwargs) by one of the workers."""
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


@contextlib.contextmanager
def connected(address: str) -> Iterator[Executor]:
    """An Executor of a dask scheduler's workers.

    Args:
      address: dask://HOST:PORT.

    Raises:
      ScenarioError: no package for it, no scheduler there, no workers, or workers that die of what they run.
    """
    with extra("cluster", f"executor {address!r}"):
        from distributed import Client
        from distributed.scheduler import KilledWorker
    log = logging.getLogger("distributed.client")  # what goes wrong is told as one sentence, not also as its traceback
    before = log.level
    try:
        log.setLevel(logging.CRITICAL)
        with Client(f"tcp://{address.removeprefix(ADDRESS)}", timeout=WAIT, set_as_default=False) as client:
            _ready(client, address)
            yield _Workers(client)
    except KilledWorker as error:
        raise ScenarioError(f"{error}: read the workers' logs, and start the study again to go on") from None
    except OSError as error:  # a timeout is one
        raise ScenarioError(f"no dask at {address} ({error}): start `dask scheduler` and `dask worker` there") from None
    finally:
        log.setLevel(before)


def _ready(client: Any, address: str) -> None:
    """Raise ScenarioError where nobody is there to work, or somebody cannot."""

    def lacking() -> str:  # goes to the workers by its code, where this module may not be
        try:
            import smc_mujoco.studies.executor  # noqa: F401
        except ImportError as error:
            return str(error)
        return ""

    with contextlib.suppress(TimeoutError):
        client.wait_for_workers(1, timeout=WAIT)
    if not client.ncores():
        raise ScenarioError(f"dask at {address} has no workers: start `dask worker` with its address")
    for worker, said in client.run(lacking).items():
        if said:
            raise ScenarioError(f"worker {worker} says {said}: install smc-mujoco there, the same version as here")
