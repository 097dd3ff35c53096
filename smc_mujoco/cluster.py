"""A study's runs computed by the workers of a dask cluster, through joblib: `pip install 'smc-mujoco[cluster]'`.

    dask scheduler                                         # prints its address
    dask worker tcp://HOST:PORT                            # on every machine, with the same versions as here
    smc-mujoco bench --executor dask://HOST:PORT

Workers send back rows, not traces. A batch whose worker dies is run by another; four deaths over one batch end the
study, which can be started again.
"""

import contextlib
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

from smc_mujoco import record
from smc_mujoco.errors import ScenarioError, shown
from smc_mujoco.executor import ADDRESS, Batch, Outcome, outcome, simulated

UNDER_WAY = 1000  # tasks sent and not finished, that workers may share; chosen
WAIT = 10.0  # s, for a scheduler, and for its first worker; chosen


def remote(batches: Iterable[Batch], address: str, finish: Callable[[Batch, Sequence[Outcome]], None]) -> None:
    """Have the workers of a dask scheduler run batches; a batch whose worker dies is run by another.

    Args:
      address: dask://HOST:PORT.
      finish: told each batch with its outcomes, as they come.

    Raises:
      ScenarioError: no package for it, no scheduler there, no workers, or workers with other versions than here.
    """
    import joblib

    sent: dict[int, Batch] = {}

    def tasks() -> Iterator[Any]:
        for number, batch in enumerate(batches):
            sent[number] = batch
            yield joblib.delayed(work)(number, _packed(batch), record.describe(batch[0])["versions"])

    with _connected(address) as backend, joblib.parallel_config(backend=backend):
        options: dict[str, Any] = {"batch_size": 1, "pre_dispatch": UNDER_WAY, "return_as": "generator_unordered"}
        results: Any = joblib.Parallel(n_jobs=-1, **options)(tasks())
        for number, outcomes in results:
            finish(sent.pop(number), outcomes)


def _packed(batch: Batch) -> bytes:
    """The batch as bytes: a worker that could not read a message itself would die of it."""
    s = batch[0]
    for thing in (s.law.function, s.velocity.function, s.surface and s.surface.function, *map(type, s.disturbance)):
        if getattr(thing, "__module__", "") == "__main__":
            raise ScenarioError(
                f"{shown(thing)} is of the script that runs: put it in a module that workers can import"
            )
    try:
        return pickle.dumps(batch)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ScenarioError(f"cannot send {s.law} to workers ({error}): define it at the top of a module") from None


def work(number: int, packed: bytes, versions: Mapping[str, str]) -> tuple[int, list[Outcome]]:
    """What a worker does: run and score batch `number`, with as many threads as it was given."""
    from distributed import get_worker

    worker, batch = get_worker(), pickle.loads(packed)
    if (here := record.describe(batch[0])["versions"]) != versions:
        raise ScenarioError(f"worker {worker.address} has {_text(here)}, not {_text(versions)}: install the same there")
    return number, [outcome(trace) for trace in simulated(batch, worker.state.nthreads)]


def _text(versions: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in versions.items())


@contextlib.contextmanager
def _connected(address: str) -> Iterator[Any]:
    """A joblib backend of the scheduler; what goes wrong there, as a sentence."""
    try:
        from distributed import Client
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise ScenarioError(
            f"executor {address!r} needs the package distributed: pip install 'smc-mujoco[cluster]'"
        ) from None
    try:
        with Client(f"tcp://{address.removeprefix(ADDRESS)}", timeout=WAIT, set_as_default=False) as client:
            _ready(client, address)
            yield _backend(client)
    except ImportError as error:
        raise ScenarioError(f"a worker at {address} says {error}: put your laws where it can import them") from None
    except KilledWorker as error:
        raise ScenarioError(f"{error}: read the workers' logs, and start the study again to go on") from None
    except OSError as error:  # a timeout is one
        raise ScenarioError(f"no dask at {address} ({error}): start `dask scheduler` and `dask worker` there") from None


def _ready(client: Any, address: str) -> None:
    """Raise ScenarioError where nobody is there to work, or somebody cannot."""

    def lacking() -> str:  # goes to the workers by its code, where this module may not be
        try:
            import smc_mujoco.executor  # noqa: F401
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


def _backend(client: Any) -> Any:
    """Joblib's dask backend, mended in two places."""
    from joblib._dask import DaskDistributedBackend

    class Backend(DaskDistributedBackend):
        def effective_n_jobs(self, n_jobs: int) -> int:
            return max(2, super().effective_n_jobs(n_jobs))  # at 1 joblib would leave the work to this process

        def submit(self, func: Any, callback: Any = None) -> Any:
            def failed(
                future: Future[Any],
            ) -> None:  # of a task that a worker could not even begin joblib would never hear
                if error := future.exception():
                    callback(error)

            future = super().submit(func, callback)
            future.add_done_callback(failed)
            return future

        def retrieve_result_callback(self, out: Any) -> Any:
            if isinstance(out, BaseException):
                raise out
            return super().retrieve_result_callback(out)

    return Backend(client=client)
