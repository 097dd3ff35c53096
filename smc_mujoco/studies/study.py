"""The study: a grid of runs, computed so that nothing is lost, to a table of scores.

    scenarios = smc.grid(["duffing"], ["observer_free", "classical"], ["noise", "coulomb"], seeds=20)
    table = smc.study(scenarios, "study")          # study/results.parquet; killed, it continues where it was
    print(table.select(law="classical").column("ultimate_bound"))

Runs are told apart by all that decides their outcome: the scenario, the code of its law, signals and other parts of
yours, and the versions of the packages. A run that is there is not run again; one whose law was edited is.
"""

import dataclasses
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError, find, printable, shown
from smc_mujoco.common.progress import Counter, counter
from smc_mujoco.control.gain_sets import LAWS
from smc_mujoco.simulation.run import cores
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies import cluster, keep, run_key
from smc_mujoco.studies import executor as executors
from smc_mujoco.studies.executor import Batch, Outcome
from smc_mujoco.studies.paper import scenarios as paper
from smc_mujoco.studies.store import Store
from smc_mujoco.studies.table import Table

key, condition = run_key.key, run_key.condition


@dataclasses.dataclass(frozen=True, kw_only=True)
class Extent:
    """What a study spans, see `grid`."""

    plants: tuple[str, ...] = paper.PLANTS
    laws: tuple[str, ...] = LAWS
    conditions: tuple[str, ...]
    seeds: int
    duration: float = paper.DURATION


# Of the paper's conditions one of a kind; of a real machine's, friction, drive, gear, sensor and obstacles.
IDEAL = ("nominal", "noise", "sine", "constant", "delay_10ms", "heavy", "jump_mild")
REAL = ("coulomb", "dc_motor", "backlash", "encoder", "contact")
FULL = Extent(conditions=IDEAL + REAL, seeds=20)
QUICK = Extent(
    plants=("inverted_pendulum", "van_der_pol", "duffing"),
    conditions=("nominal", "noise", "coulomb"),
    seeds=16,
    duration=3.0,
)  # the fewest seeds with which a winner is named, see `ranking`; half a minute on 2 cores


def study(
    scenarios: Iterable[Scenario],
    out: str | os.PathLike,
    resume: bool = True,
    executor: str | Executor = "local",
    threads: int | None = None,
    progress: bool = False,
    traces: str = "none",
) -> Table:
    """Run scenarios, score them, and write their table, out/results.parquet: a row each, in order, equal ones once.

    Finished runs are kept in out/parts, some seconds of work a file. A study that was killed, or found the disk full,
    and is started again with the same arguments goes on from there and ends with the same file, bit for bit.

    Args:
      out: the folder; it may hold the parts of other studies.
      resume: False forgets what the folder holds.
      executor: "local", "dask://HOST:PORT" for the workers of that scheduler, or any concurrent.futures.Executor, whose
        workers run a simulation each; it stays open.
      threads: simulations at once, if local; None for one per available core.
      progress: whether to show a progress bar.
      traces: which to save in out/traces: "none", "all", or for every plant and condition the "worst": a run that
        failed, else one that never settles, else any, with the largest ultimate bound.

    Raises:
      ScenarioError: what cannot be run, a folder that cannot be written, workers that are not there or die; what was
        finished stays.
    """
    if not isinstance(out, str | os.PathLike):
        raise ScenarioError(f"out is {shown(out)}: give the path of a folder")
    where = executors.checked(executor)
    find("choice of traces", traces, dict.fromkeys(keep.CHOICES))
    threads = cores(threads)
    store = Store(Path(out))
    named = _named(scenarios)
    store.open(resume)
    missing = [scenario for name, scenario in named.items() if name not in store.where]
    if progress and len(missing) < len(named):
        print(f"{len(named) - len(missing)} of {len(named)} runs are in {printable(str(store.parts))}", file=sys.stderr)
    with counter(len(missing), sum(s.work for s in missing), progress) as counts:
        if where == "local":
            folder = keep.folder(out) if traces == "all" else None
            _compute(missing, store, threads, counts, folder)
        else:
            _send(missing, store, where, counts)
    store.collect(list(named))
    table = dataclasses.replace(Table.read(store.results), known=named)
    keep.save(table, traces, keep.folder(out), threads, progress)
    return table


def _named(scenarios: Iterable[Scenario]) -> dict[str, Scenario]:
    """Hash -> scenario, in order; of equal ones the first."""
    found: dict[str, Scenario] = {}
    several = isinstance(scenarios, Iterable) and not isinstance(scenarios, str | bytes | Mapping)
    for scenario in scenarios if several else ():  # one by one, as they may be without end
        if not isinstance(scenario, Scenario):
            raise ScenarioError(f"cannot study {shown(scenario)}: give scenarios, such as those of smc.grid")
        found.setdefault(key(scenario), scenario)
    if not found:
        raise ScenarioError(f"scenarios is {shown(scenarios)}: give several, such as a list")
    return found


def _compute(scenarios: list[Scenario], store: Store, threads: int, counts: Counter, folder: Path | None) -> None:
    """Run scenarios here."""

    def finish(batch: Batch, traces: Sequence[Trace]) -> None:
        if folder:
            for scenario, trace in zip(batch, traces, strict=True):
                trace.save(keep.path(folder, run_key.row(scenario)))
        store.add([_row(s, executors.outcome(trace)) for s, trace in zip(batch, traces, strict=True)])
        counts.finished(len(batch))

    executors.local(executors.batches(scenarios, threads), threads, finish, counts.stepped)


def _send(scenarios: list[Scenario], store: Store, where: str | Executor, counts: Counter) -> None:
    """Have others run scenarios."""

    def finish(batch: Batch, outcomes: Sequence[Outcome]) -> None:
        store.add([_row(s, outcome) for s, outcome in zip(batch, outcomes, strict=True)])
        counts.stepped(sum(s.work for s in batch))
        counts.finished(len(batch))

    with cluster.connected(where) if isinstance(where, str) else nullcontext(where) as pool:
        executors.remote(executors.batches(scenarios, 1), pool, finish)


def _row(scenario: Scenario, outcome: Outcome) -> dict:
    return run_key.row(scenario) | outcome
