"""How a study's runs are computed: in batches, on threads of this process; `cluster` sends them to others.

    local(batches(scenarios, threads), threads, finish)

A batch is a list of scenarios of one layout, which is run, scored and kept as a whole: what a kill loses at most. An
outcome is the part of a table's row that only the run can tell: its scores and how it failed. It does not depend on the
batch in which the run was, nor on where that was computed.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from smc_mujoco import plain
from smc_mujoco.chunk import Report, contents
from smc_mujoco.compiled import NotCompilable
from smc_mujoco.errors import ScenarioError, shown
from smc_mujoco.metrics import score
from smc_mujoco.run import layout, run, stream
from smc_mujoco.scenario import Scenario
from smc_mujoco.trace import Trace

# Of a batch: `Scenario.work` a thread, 2 to 5 s of a core; in all, for what logs and scores take; runs.
STEPS, LOG_STEPS, RUNS = 500_000, 1_000_000, 1000
PLAIN = 40  # times slower than compiled laws is the plain loop, roughly
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
    groups: dict[tuple, list[Scenario]] = {}
    for s in scenarios:
        groups.setdefault((layout(s), _compiles(s)), []).append(s)
    most = min(STEPS * threads, LOG_STEPS)
    for (_, compiles), group in groups.items():
        each = max(1, group[0].work) * (1 if compiles else PLAIN * threads)
        size = max(1, min(RUNS, most // each))
        yield from (group[i : i + size] for i in range(0, len(group), size))


def _compiles(scenario: Scenario) -> bool:
    try:
        contents(scenario)
    except NotCompilable:
        return False
    return True


def simulated(batch: Batch, threads: int | None, report: Report = lambda steps: None) -> list[Trace]:
    """The traces of a batch, in its order, whose words about a failure do not depend on each other.

    Of several runs in which a law raises or returns NaN, a Batch asks Python for one's words; here each gets its own.
    """
    traces: dict[int, Trace] = dict(stream(batch, threads, report))
    for i, trace in traces.items():
        if len(batch) > 1 and trace.failure is not None and not trace.failure.startswith(plain.LEFT_THE_WORLD):
            traces[i] = run(batch[i], threads=1)
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


def checked(name: object) -> str:
    """The name of an executor, or the sentence that says what they are called."""
    if name == "local":
        return "local"
    host, _, port = str(name).removeprefix(ADDRESS).rpartition(":")
    if isinstance(name, str) and name.startswith(ADDRESS) and host and port.isdecimal() and int(port) < 2**16:
        return name
    raise ScenarioError(f"executor is {shown(name)}: give 'local' or 'dask://HOST:PORT'")
