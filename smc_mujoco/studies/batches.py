"""Computation of a study's runs, in batches, on threads here or by the workers of an Executor.

A batch is a list of prepared scenarios of one layout. It is run, scored and stored as a whole, so a
killed study loses at most two: one is stored while the next one runs. The results depend neither on
the batch nor on the machine.
"""

import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import to_json
from smc_mujoco.metrics.catalogue import arrived, score, trends
from smc_mujoco.metrics.touching import touched
from smc_mujoco.simulation import run_key, workers
from smc_mujoco.simulation.prepare import Prepared, prepare
from smc_mujoco.simulation.run import Report, stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

# of a batch, see `Scenario.work`: 4 to 10 s of a core. It does not depend on the number of threads,
# so that a study writes the same parts with any
MAX_WORK = 1_000_000
MAX_RUNS = 1000  # of a batch

ResultColumns = dict[str, Any]
Batch = Sequence[Prepared]


def result_columns(trace: Trace) -> ResultColumns:
    """Return the scores of a run, without those that are NaN, or how it failed."""
    failed: ResultColumns = {"diverged_at": trace.diverged_at, "failure": trace.failure}
    if trace.failure is not None:
        return failed
    try:
        scored = {}
        for name, value in score(trace).items():
            if not math.isnan(value):
                scored[name] = value
        ends = {"trends": to_json(trends(trace)), "arrived": arrived(trace)}
        return failed | scored | ends | {"touched": touched(trace)}
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


def compute_elsewhere(
    batches: Sequence[Batch],
    executor: Executor,
    plants: run_key.Hashes,
    finish: Callable[[Batch, Sequence[ResultColumns]], None],
    report: Report = lambda steps: None,
) -> None:
    """Have the workers of an Executor run batches. They send back result columns, not traces."""
    calls = []
    for batch in batches:
        scenarios = []
        keys = []
        for prepared in batch:
            scenarios.append(prepared.scenario)
            keys.append(run_key.run_key(prepared.scenario, plants=plants))
        calls.append((scenarios, keys))
    for i, columns in workers.called(executor, scored, calls):
        finish(batches[i], columns)
        report(sum(scenario.work for scenario in calls[i][0]))


def scored(scenarios: Sequence[Scenario], keys: Sequence[str]) -> list[ResultColumns]:
    """Return the result columns of scenarios, on a worker, on one thread.

    Raises:
      ScenarioError: the key of a scenario is another one here, because its law is.
    """
    plants: run_key.Hashes = {}
    for scenario, key in zip(scenarios, keys, strict=True):
        if run_key.run_key(scenario, plants=plants) != key:
            raise ScenarioError(
                f"a worker has other code for {scenario.law}: install the same there as here"
            )
    return [result_columns(trace) for trace in run_batch(scenarios, 1)]


def compute(
    batches: Iterable[Batch],
    threads: int,
    finish: Callable[[Batch, Sequence[Trace]], None],
    report: Report = lambda steps: None,
) -> None:
    """Run batches one after the other; a thread scores and writes each while the next one runs."""
    with ThreadPoolExecutor(1) as pool:
        last: Future[None] | None = None
        for batch in batches:
            traces = run_batch(batch, threads, report)
            if last is not None:
                last.result()  # two batches are in memory, no more
            last = pool.submit(finish, batch, traces)
        if last is not None:
            last.result()
