"""A study: many runs, stored as they finish, and a table of their scores.

A run is identified by everything that determines its result: the scenario, the code of its law, of
its signals and of your other parts, and the versions of the packages. A run with a result in the
folder is repeated only if this code has changed.

Finished runs are in parts, parquet files named by a hash of the runs in them. A file that is
damaged, has other columns, or has scores by other code is ignored, and its runs count as not done.
The bytes of results.parquet depend only on its rows.
"""

import contextlib
import dataclasses
import functools
import hashlib
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from smc_mujoco.analysis.step_halving import halved, repeats_every_run
from smc_mujoco.common import fingerprint
from smc_mujoco.common.aliases import AnyPath, Data, Fields, Names, ProgressTo
from smc_mujoco.common.constraints import FilePath, Progress, constrained
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, printable, shown
from smc_mujoco.common.files import reading, to_json
from smc_mujoco.common.progress import counter
from smc_mujoco.control.gain_sets import COMPARED
from smc_mujoco.control.law import checked_name
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation import run_key
from smc_mujoco.simulation.conditions import DURATION, PLANTS
from smc_mujoco.simulation.run import cores
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.simulation.workers import Workers, opened
from smc_mujoco.studies import batches
from smc_mujoco.studies import table as tables
from smc_mujoco.studies.batches import Batch
from smc_mujoco.studies.table import Table

if TYPE_CHECKING:
    import pyarrow as pa


# One condition of each kind. IDEAL: the paper's. REAL: friction, drive, gear, sensor and obstacles.
IDEAL = ("nominal", "noise", "sine", "constant", "delay_10ms", "heavy", "jump_mild")
REAL = ("coulomb", "dc_motor", "backlash", "encoder", "contact")
# one seed in so many is repeated at half the step, where no constraint acts under RK4; chosen
REPEATED_SEEDS = 4
ROWS_PER_GROUP = 4096  # rows in memory at once while the table is written; chosen
MAX_OPEN_PARTS = 64  # parts in memory at once while the table is written; chosen
PART = re.compile(r"[0-9a-f]{32}\.parquet")


class Store:
    """The folder of a study. Parts are written by one thread at a time."""

    def __init__(self, out: Path):
        self.parts = out / "parts"
        self.results = out / "results.parquet"
        formulas = tuple(metric.formula for metric in CATALOGUE.values())
        self.schema = tables.schema({"scores": fingerprint.of(formulas)})
        self.where: dict[
            str, tuple[Path, int]
        ] = {}  # hash of a finished run -> its part, and its row in it

    def open(self, resume: bool) -> None:
        """Make the folder and list the runs in it. Without `resume`, remove them and the table."""
        try:
            self.parts.mkdir(parents=True, exist_ok=True)
            parts = []
            for path in sorted(self.parts.iterdir()):
                if PART.fullmatch(path.name):
                    parts.append(path)
            for path in () if resume else (*parts, self.results):
                path.unlink(missing_ok=True)
        except (OSError, ValueError) as error:  # ValueError: a name with a null character
            raise ScenarioError(
                f"cannot use {self.parts}: {getattr(error, 'strerror', None) or error}; choose "
                "another folder"
            ) from error
        for path in parts if resume else ():
            if (part := self._read(path)) is not None:
                for i, name in enumerate(part["hash"].to_pylist()):
                    self.where.setdefault(name, (path, i))

    def add(self, rows: Sequence[Data]) -> None:
        """Write finished runs as a part."""
        import pyarrow as pa

        hashes = [row["hash"] for row in rows]
        path = (
            self.parts
            / f"{hashlib.sha256(''.join(sorted(hashes)).encode()).hexdigest()[:32]}.parquet"
        )
        table = pa.Table.from_pylist(list(rows), schema=self.schema)
        tables.write_table(path, self.schema, [table])
        for i, name in enumerate(hashes):
            self.where[name] = path, i

    def rows(self, names: Iterable[str]) -> Iterator[Fields]:
        """Yield the rows of finished runs, part by part."""
        places: dict[Path, list[int]] = {}
        for name in names:
            path, i = self.where[name]
            places.setdefault(path, []).append(i)
        for path, indices in places.items():
            if (part := self._read(path)) is not None:
                yield from part.take(indices).to_pylist()

    def collect(self, hashes: Sequence[str], changes: Callable[[str], Data]) -> None:
        """Write the table of these finished runs, in this order.

        `changes` gives for a hash the columns that replace those of the part: scores at half the
        step, what a part does not tell, and what may be called otherwise in the earlier study that
        the part is from.
        """
        import pyarrow as pa

        read = functools.lru_cache(maxsize=MAX_OPEN_PARTS)(self._read)

        def rows(names: Sequence[str]) -> "pa.Table":
            places: dict[Path, list[int]] = {}  # part -> indices of the names in it
            for i, name in enumerate(names):
                places.setdefault(self.where[name][0], []).append(i)
            parts = []
            for path, indices in places.items():
                if (part := read(path)) is None:
                    raise ScenarioError(
                        f"part {path} was removed or broken while the study ran: start it again"
                    )
                places_in_part = [self.where[names[i]][1] for i in indices]
                parts.append(part.take(places_in_part))
            order = np.argsort(np.concatenate(list(places.values())))
            data = pa.concat_tables(parts).take(order).combine_chunks()
            replaced = [changes(key) for key in names]
            for name in sorted(set().union(*replaced)):
                pairs = zip(replaced, data[name].to_pylist(), strict=True)
                values = [columns.get(name, value) for columns, value in pairs]
                column = pa.array(values, data.field(name).type)
                data = data.set_column(data.column_names.index(name), data.field(name), column)
            return data

        groups = (hashes[i : i + ROWS_PER_GROUP] for i in range(0, len(hashes), ROWS_PER_GROUP))
        tables.write_table(self.results, self.schema, map(rows, groups))

    def _read(self, path: Path) -> "pa.Table | None":
        """Return a part, or None for a file that is damaged or not a part."""
        try:
            with reading(path, "part", "start the study again") as file:
                part = tables.read_table(file, sealed=True)
        except ScenarioError:
            return None
        complete = (
            part.schema.equals(self.schema, check_metadata=True) and not part["hash"].null_count
        )
        return part if complete else None


@keyword_dataclass
class Extent:
    """The grid of a study; its fields are arguments of `grid`."""

    plants: Names = PLANTS
    laws: Names = COMPARED
    conditions: Names
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


@constrained
def study(
    scenarios: Iterable[Scenario],
    out: Annotated[AnyPath, FilePath()],
    resume: bool = True,
    threads: int | None = None,
    progress: Progress = False,
    half_steps: bool = False,
    executor: Workers | None = None,
) -> Table:
    """Run and score scenarios; write a table with a row for each to out/results.parquet, and return
    it.

        table = smc.study(smc.grid("duffing", ["pid", "adrc"], seeds=4, duration=1.0), "study")
        print(table)

    Scenarios that `dataclasses.replace` changed have lost their condition's name: give it again, as
    in `scenario.named("random")`. Rows are in the order of the scenarios; equal scenarios have one
    row. Finished runs are stored in out/parts, some seconds of work in each file. If a study was
    killed, or filled the disk, start it again with the same arguments: it continues, and ends with
    the same file, bit for bit.

    Args:
      scenarios: any number of Scenarios, such as those of `smc.grid`.
      out: folder of the study; it may contain the parts of other studies.
      resume: whether to keep the finished runs in the folder; False removes them first.
      threads: number of simulations at a time; None for one per available core.
      progress: whether to show a progress bar, or a function that is called with a text and the
        share that is done.
      half_steps: whether to repeat runs at half the physics step, so that `leaderboard` names no
        winner that the step decides: all of them where constraints may act or the integrator is not
        RK4, elsewhere one seed in four.
      executor: where the runs are computed in place of threads of this process: an Executor of
        `concurrent.futures`, a dask Client, or a dask scheduler's address, "dask://HOST:PORT". The
        table has the same bytes.

    Returns:
      The Table of `smc.Table.read`: a row a scenario, in their order.

    Raises:
      ScenarioError: scenarios that cannot be run, a folder that cannot be written, or an executor
        that stops. Finished runs stay.
    """
    threads = cores(threads)
    store = Store(Path(out))
    plants: run_key.Hashes = {}
    by_key = _by_key(_checked(scenarios), store, resume, plants)
    repeated = _repeated(by_key, plants) if half_steps else {}
    by_name = dict(by_key)
    for name, scenario in repeated.values():
        if name not in by_key:
            by_name[name] = scenario
    missing = {name: scenario for name, scenario in by_name.items() if name not in store.where}
    if progress and (done := len(by_name) - len(missing)):
        remark = " (runs, and repeats at half the physics step)" if repeated else ""
        folder = printable(str(store.parts))
        print(f"{done} of {len(by_name)} simulations{remark} are in {folder}", file=sys.stderr)
    _compute(missing, store, plants, threads, progress, executor)
    half_steps_of = _half_step_scores(repeated, store)

    def changes(name: str) -> Data:
        columns: dict[str, Any] = dict(run_key.run_labels(by_key[name]))
        if name in half_steps_of:
            columns["half_step"] = half_steps_of[name]
        return columns

    store.collect(list(by_key), changes)
    return dataclasses.replace(Table.read(store.results), scenarios_by_key=by_key)


def _by_key(
    scenarios: Iterator[Scenario], store: Store, resume: bool, plants: run_key.Hashes
) -> dict[str, Scenario]:
    """Return hash -> scenario, and open the store."""
    by_key: dict[str, Scenario] = {}
    for scenario in scenarios:
        by_key.setdefault(run_key.run_key(scenario, plants=plants), scenario)
    store.open(resume)
    return by_key


def _compute(
    missing: Mapping[str, Scenario],
    store: Store,
    plants: run_key.Hashes,
    threads: int,
    progress: ProgressTo,
    executor: Any,
) -> None:
    """Compute runs, given by key, and store their rows as they finish."""
    # made before any run: a law may change its globals
    first = {}
    for key, scenario in missing.items():
        first[id(scenario)] = {"hash": key}

    def finish(batch: Batch, columns: Sequence[batches.ResultColumns]) -> None:
        rows = []
        for prepared, results in zip(batch, columns, strict=True):
            row = run_key.row(prepared.scenario, plants) | first[id(prepared.scenario)]
            rows.append(row | results)
        store.add(rows)

    def score(batch: Batch, finished: Sequence[Trace]) -> None:
        finish(batch, list(map(batches.result_columns, finished)))

    work = batches.batches(missing.values())
    with counter(len(missing), sum(s.work for s in missing.values()), progress) as stepped:
        if executor is None:
            batches.compute(work, threads, score, stepped)
        else:
            with opened(executor) as pool:
                batches.compute_elsewhere(list(work), pool, plants, finish, stepped)


def _repeated(
    runs: Mapping[str, Scenario], plants: run_key.Hashes
) -> dict[str, tuple[str, Scenario]]:
    """Return hash -> hash and scenario of the same run at half the physics step, for the runs that
    are repeated.
    """
    again = {}
    for name, scenario in runs.items():
        if repeats_every_run(scenario) or scenario.seed % REPEATED_SEEDS == 0:
            with contextlib.suppress(ScenarioError):  # its step cannot be halved
                half = halved(scenario).named(scenario.condition)
                again[name] = run_key.run_key(half, plants=plants), half
    return again


def _half_step_scores(repeated: Mapping[str, tuple[str, Scenario]], store: Store) -> dict[str, str]:
    """Return hash -> the scores of the repeated run as JSON; {} for one that failed."""
    scores = {}
    for row in store.rows({half for half, _ in repeated.values()}):
        values = {}
        for name in ("arrived", *CATALOGUE):
            if row[name] is not None:
                values[name] = row[name]
        scores[row["hash"]] = to_json(values)
    halved = {}
    for name, (half, _) in repeated.items():
        if half in scores:
            halved[name] = scores[half]
    return halved


def _checked(scenarios: Any) -> Iterator[Scenario]:
    """Check and yield scenarios one by one: a generator with a wrong item may be endless."""
    empty = True
    is_list = isinstance(scenarios, Iterable) and not isinstance(scenarios, str | bytes | Mapping)
    for scenario in scenarios if is_list else ():
        if not isinstance(scenario, Scenario):
            raise ScenarioError(
                f"cannot study {shown(scenario)}: give scenarios, such as those of smc.grid"
            )
        checked_name(scenario.law)
        yield scenario
        empty = False
    if empty:
        raise ScenarioError(f"scenarios is {shown(scenarios)}: give several, such as a list")
