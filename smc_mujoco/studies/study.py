"""A study: many runs, stored as they finish, and a table of their scores.

A run is identified by everything that determines its result: the scenario, the code of its law, of its signals and of
your other parts, and the versions of the packages. A run with a result in the folder is repeated only if this code has
changed.
"""

import contextlib
import dataclasses
import hashlib
import json
import os
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.analysis.step_halving import halved, repeats_all
from smc_mujoco.common.errors import ScenarioError, find, printable, shown
from smc_mujoco.common.files import slug, to_json, write_json
from smc_mujoco.common.progress import counter
from smc_mujoco.common.text import counted
from smc_mujoco.control.gain_sets import LAWS
from smc_mujoco.control.law import checked_name
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.simulation.conditions import DURATION, PLANTS
from smc_mujoco.simulation.run import PlainLoopWarning, cores, run, stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies import executors, run_key
from smc_mujoco.studies import noise_key as noise
from smc_mujoco.studies.executors import Batch, ResultColumns
from smc_mujoco.studies.replay import replays
from smc_mujoco.studies.store import Store
from smc_mujoco.studies.table import Table

# One condition of each kind. IDEAL: the paper's. REAL: friction, drive, gear, sensor and obstacles.
IDEAL = ("nominal", "noise", "sine", "constant", "delay_10ms", "heavy", "jump_mild")
REAL = ("coulomb", "dc_motor", "backlash", "encoder", "contact")
TRACES = ("none", "worst", "all")  # choices of traces to save
REPEATED_SEEDS = 4  # one seed in so many is repeated at half the step, where no constraint acts under RK4; chosen
REPLAYS = "replays.json"  # file in a study's folder
OTHER_SCORES = "run again, it has other scores: the law keeps a state of its own, or reads a clock"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Extent:
    """The grid of a study; its fields are arguments of `grid`."""

    plants: tuple[str, ...] = PLANTS
    laws: tuple[str, ...] = LAWS
    conditions: tuple[str, ...]
    seeds: int
    duration: float = DURATION


FULL = Extent(conditions=IDEAL + REAL, seeds=24)
# It takes a minute on 2 cores.
QUICK = Extent(
    plants=("inverted_pendulum", "van_der_pol", "duffing"),
    conditions=("nominal", "noise", "coulomb"),
    seeds=24,
    duration=3.0,
)


def study(
    scenarios: Iterable[Scenario],
    out: str | os.PathLike[str],
    resume: bool = True,
    executor: "executors.Workers" = "local",
    threads: int | None = None,
    progress: bool = False,
    traces: str = "none",
    noise_key: int | str = 0,
    replay: bool = False,
    half_steps: bool = False,
) -> Table:
    """Run and score scenarios; write a table with a row for each to out/results.parquet, and return it.

    Rows are in the order of the scenarios; equal scenarios have one row. Finished runs are stored in out/parts, some
    seconds of work in each file. If a study was killed, or filled the disk, start it again with the same arguments: it
    continues, and ends with the same file, bit for bit.

    Args:
      scenarios: any number of Scenarios, such as those of `smc.grid`.
      out: folder of the study; it may contain the parts of other studies.
      resume: whether to keep the finished runs in the folder; False removes them first.
      executor: "local", "dask://HOST:PORT" (or "tcp://HOST:PORT") for the workers of that scheduler, a dask Client, or
        any concurrent.futures.Executor, whose workers run one simulation each. The study does not close it.
      threads: number of simulations at a time, if local; None for one per available core.
      progress: whether to show a progress bar.
      traces: traces to save in out/traces: "none", "all", or "worst", one for every plant and condition: of a failed
        run, else of one that never settles, else of the one with the largest ultimate bound.
      noise_key: key of all runs, see `Scenario`. "drawn": a new random key, or the folder's if the study goes on, so
        that no law can know its noise.
      replay: whether to replay one run of each of your laws on each plant in each condition, see `smc.replay`. A run
        whose commands do not follow from its measurements counts as failed.
      half_steps: whether to repeat runs at half the physics step, so that `leaderboard` names no winner that the step
        decides: all of them where constraints may act or the integrator is not RK4, elsewhere one seed in four.

    Raises:
      ScenarioError: scenarios that cannot be run, a folder that cannot be written, or workers that are missing or die.
        Finished runs stay.
    """
    if not isinstance(out, str | os.PathLike):
        raise ScenarioError(f"out is {shown(out)}: give the path of a folder")
    where = executors.as_executor(executor)
    find("choice of traces", traces, dict.fromkeys(TRACES))
    threads = cores(threads)
    store, folder = Store(Path(out)), Path(out) / "traces"
    plants: run_key.Hashes = {}
    by_key: dict[str, Scenario] = {}
    for scenario in noise.keyed(_checked(scenarios), noise_key, Path(out), resume):
        by_key.setdefault(run_key.key(scenario, plants=plants), scenario)
    store.open(resume)
    repeated = _repeated(by_key, plants) if half_steps else {}
    every = by_key | {name: scenario for name, scenario in repeated.values() if name not in by_key}
    missing = {name: scenario for name, scenario in every.items() if name not in store.where}
    if progress and (done := len(every) - len(missing)):
        print(f"{done} of {len(every)} runs are in {printable(str(store.parts))}", file=sys.stderr)
    _compute(missing, store, plants, where, threads, progress, folder if traces == "all" else None)
    changes = {name: run_key.source(scenario) for name, scenario in by_key.items()}
    for name, scores in _half_step_scores(repeated, store).items():
        changes[name] = changes[name] | {"half_step": scores}
    if replay:
        for name, columns in _replayed(by_key, store, Path(out), threads, progress).items():
            changes[name] = changes[name] | columns
    store.collect(list(by_key), changes)
    table = dataclasses.replace(Table.read(store.results), known=by_key)
    _save_traces(table, traces, folder, threads, progress)
    return table


def _compute(
    missing: Mapping[str, Scenario],
    store: Store,
    plants: run_key.Hashes,
    where: str | Executor,
    threads: int,
    progress: bool,
    traces: Path | None,
) -> None:
    """Compute runs, given by key, store their rows as they finish, and save the traces of local ones in a folder."""
    keys = {id(scenario): key for key, scenario in missing.items()}  # made before any run: a law may change its globals

    def finish(batch: Batch, results: Sequence[ResultColumns]) -> None:
        scenarios = [prepared.scenario for prepared in batch]
        known = [run_key.row(scenario, plants) | {"hash": keys[id(scenario)]} for scenario in scenarios]
        store.add([row | result for row, result in zip(known, results, strict=True)])

    def finish_here(batch: Batch, finished: Sequence[Trace]) -> None:
        if traces:
            for trace in finished:
                trace.save(trace_file(traces, run_key.row(trace.scenario, plants)))
        finish(batch, [executors.result_columns(trace) for trace in finished])

    with counter(len(missing), sum(s.work for s in missing.values()), progress) as stepped:
        if where == "local":
            executors.compute_here(executors.batches(missing.values(), threads), threads, finish_here, stepped)
        else:
            with executors.opened(where) as pool:
                executors.compute_elsewhere(executors.batches(missing.values(), 1), pool, finish, stepped)


def _repeated(runs: Mapping[str, Scenario], plants: run_key.Hashes) -> dict[str, tuple[str, Scenario]]:
    """Return hash -> hash and scenario of the same run at half the physics step, for the runs that are repeated."""
    again = {}
    for name, scenario in runs.items():
        if repeats_all(scenario) or scenario.seed % REPEATED_SEEDS == 0:
            with contextlib.suppress(ScenarioError):  # its step cannot be halved
                half = halved(scenario).named(scenario.condition)
                again[name] = run_key.key(half, plants=plants), half
    return again


def _half_step_scores(repeated: Mapping[str, tuple[str, Scenario]], store: Store) -> dict[str, str]:
    """Return hash -> the scores of the repeated run as JSON; {} for one that failed."""
    names = [metric.name for metric in metrics()]
    scores = {
        row["hash"]: to_json({name: row[name] for name in names if row[name] is not None})
        for row in store.rows({half for half, _ in repeated.values()})
    }
    return {name: scores[half] for name, (half, _) in repeated.items() if half in scores}


def _checked(scenarios: Any) -> Iterator[Scenario]:
    """Check and yield scenarios one by one: a generator with a wrong item may be endless."""
    empty, several = True, isinstance(scenarios, Iterable) and not isinstance(scenarios, str | bytes | Mapping)
    for scenario in scenarios if several else ():
        if not isinstance(scenario, Scenario):
            raise ScenarioError(f"cannot study {shown(scenario)}: give scenarios, such as those of smc.grid")
        checked_name(scenario.law)
        yield scenario
        empty = False
    if empty:
        raise ScenarioError(f"scenarios is {shown(scenarios)}: give several, such as a list")


# replays: one run of each of the user's laws on each plant in each condition, which no law can foresee


def _replayed(
    runs: Mapping[str, Scenario], store: Store, folder: Path, threads: int | None, progress: bool
) -> dict[str, dict[str, Any]]:
    """Replay chosen runs whose result is not in the folder. Return hash -> the columns that their replays change."""
    chosen, known = _to_replay(runs), _stored_results(folder / REPLAYS)
    if missing := [name for name in chosen if name not in known]:
        if progress:
            print(f"replaying {counted(len(missing), 'run')} of your laws", file=sys.stderr)
        try:
            known |= _replay_results({name: runs[name] for name in missing}, store, threads)
            write_json(folder / REPLAYS, known)
        except ScenarioError as error:
            print(f"not replayed: {error}", file=sys.stderr)
    nothing = dict.fromkeys((*(metric.name for metric in metrics()), "diverged_at"))
    return {
        name: {"replayed": True} if known[name] == "" else {**nothing, "replayed": False, "failure": known[name]}
        for name in chosen
        if known.get(name) is not None
    }


def _to_replay(runs: Mapping[str, Scenario]) -> list[str]:
    """Return the hash of one run for each of the user's laws, on each plant in each condition.

    The choice is the hash whose own hash is smallest. It depends on the noise key, so no law can foresee it.
    """
    groups: dict[tuple, list[str]] = {}
    for name, scenario in runs.items():
        if noise.has_user_code(scenario):
            group = scenario.law.name, scenario.plant.name, run_key.condition(scenario)
            groups.setdefault(group, []).append(name)
    return [min(names, key=lambda name: hashlib.sha256(name.encode()).digest()) for names in groups.values()]


def _stored_results(file: Path) -> dict[str, str | None]:
    """Return results of replays from a file: hash -> what differs, "" for nothing, None if it cannot be replayed."""
    try:
        known = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def _replay_results(runs: Mapping[str, Scenario], store: Store, threads: int | None) -> dict[str, str | None]:
    """Run and replay runs. Return hash -> what differs, as `_stored_results` does."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlainLoopWarning)  # the study itself has warned
        traces = run(list(runs.values()), threads=threads)
    results: dict[str, str | None] = {}
    for name, trace, replay in zip(runs, traces, replays(traces), strict=True):
        row = store.row(name)
        if replay.same is None and trace.failure is None:
            print(f"not replayed: {trace.scenario.law.name}, {replay.why}", file=sys.stderr)
        if any(row.get(column) != value for column, value in executors.result_columns(trace).items()):
            results[name] = OTHER_SCORES
        else:
            results[name] = None if replay.same is None else replay.why
    return results


# saved traces


def trace_file(folder: Path, row: Mapping[str, Any]) -> Path:
    """Return the file of a row's trace."""
    names = "-".join(slug(row[column]) for column in ("plant", "condition", "law"))
    return folder / f"{names}-{row['seed']}-{row['hash'][:8]}.npz"


def worst_rows(table: Table) -> list[int]:
    """Return row indices of the worst runs by plant and condition: failed, unsettled, then by bound or overshoot."""
    failed, bounds = table.column("failure") != np.array(None), table.column("ultimate_bound")
    ends = np.where(np.isnan(bounds), table.column("overshoot"), bounds)
    unsettled = table.column("settling_time") == np.inf
    badness = list(zip(failed, unsettled & ~failed, np.where(failed, 0.0, ends), strict=True))
    rows: dict[tuple, int] = {}
    for i, cell in enumerate(zip(table.column("plant"), table.column("condition"), strict=True)):
        if badness[i] > badness[rows.setdefault(cell, i)]:
            rows[cell] = i
    return list(rows.values())


def _save_traces(table: Table, choice: str, folder: Path, threads: int, progress: bool) -> None:
    """Repeat the chosen runs that have no file yet, and save their traces."""
    chosen = {"none": [], "worst": worst_rows(table), "all": range(len(table))}[choice]
    files = {}
    for i in chosen:
        (row,) = table.data.slice(i, 1).to_pylist()
        if not (file := trace_file(folder, row)).exists():
            files[table.scenario(i)] = file
    with counter(len(files), sum(s.work for s in files), progress) as stepped:
        for batch in executors.batches(files, threads):
            for i, trace in stream(batch, threads, stepped):
                trace.save(files[batch[i].scenario])
