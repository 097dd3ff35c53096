"""The table of an entry's runs: a parquet file with a row a run and a row group a problem, which is
read by itself.

Columns: `problem`, `instance`, the measures of `Problem.measures`, and the time of each target, s,
NaN for never. The same runs give the same bytes.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.problems.problem import MEASURES, Problem, problem
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies import table as tables

if TYPE_CHECKING:
    import pyarrow as pa

VALUES = "failed", "accuracy", "itae", "settling", "calm"
LEVELS = 5  # targets of a measure
COLUMNS: list[str] = list(VALUES)
for measure in MEASURES:
    COLUMNS.extend(f"{measure}_{level}" for level in range(1, LEVELS + 1))
Row = dict[str, Any]


def instance_rows(
    one: Problem, scenarios: Sequence[Scenario], instances: Sequence[int]
) -> tuple[list[Row], list[str]]:
    """Run the scenarios of a problem's instances. Return their rows, and how runs failed."""
    table: list[Row] = [{} for _ in scenarios]
    failures = []
    for i, trace in stream(scenarios):
        table[i] = {"problem": one.id, "instance": instances[i]} | one.measures(trace)
        if table[i]["failed"]:
            why = trace.failure or f"it diverged at {trace.diverged_at:.3g} s"
            failures.append(f"{one.id}#{instances[i]:02d}: {why}")
    return table, failures


def write_rows(path: Path, groups: Iterable[list[Row]]) -> None:
    """Write the rows of each problem as they come."""
    import pyarrow as pa

    fields = {"problem": pa.string(), "instance": pa.int64()}
    schema = pa.schema(fields | dict.fromkeys(COLUMNS, pa.float64()))
    never = dict.fromkeys(COLUMNS, math.nan)

    def parts() -> Iterator[pa.Table]:
        for group in groups:
            yield pa.Table.from_pylist([never | row for row in group], schema=schema)

    tables.write_table(path, schema, parts())


class EntryRuns:
    """A table of runs, read a problem at a time."""

    def __init__(self, path: Path):
        import pyarrow.parquet as pq

        self.path = path
        self.file = pq.ParquetFile(path)
        self.groups = {self._problem(i): i for i in range(self.file.num_row_groups)}

    def _problem(self, group: int) -> str:
        """Return the problem of a row group, from its statistics."""
        statistics = self.file.metadata.row_group(group).column(0).statistics
        return "" if statistics is None else statistics.min

    def __len__(self) -> int:
        return self.file.metadata.num_rows

    def check(self, problems: Sequence[str], instances: int) -> None:
        """Raise ScenarioError unless the table has every problem's instances and all columns."""
        for name in ("instance", *COLUMNS):
            if name not in self.file.schema_arrow.names:
                raise ScenarioError(f"it has no column {name!r}")
        for name in problems:
            count = 0
            if name in self.groups:
                count = self.file.metadata.row_group(self.groups[name]).num_rows
            if count != instances:
                raise ScenarioError(f"it has {count} runs of {name}, not {instances}")

    def columns(self, name: str) -> Mapping[str, np.ndarray]:
        """Return the columns of a problem's runs, (instances,) each, in order of the instances."""
        data: pa.Table = self.file.read_row_group(self.groups[name]).sort_by("instance")
        arrays = {}
        for column in ("instance", *COLUMNS):
            arrays[column] = data[column].to_numpy()
        return arrays

    def medians(self) -> dict[str, dict[str, float]]:
        """Return problem -> measure -> median over its instances.

        The variation of u, `calm`, counts as infinite in a run that does not keep the easiest
        accuracy, as who does nothing is calm.
        """
        return {name: self._medians(name) for name in self.groups}

    def _medians(self, name: str) -> dict[str, float]:
        """Return measure -> median over a problem's instances."""
        columns = dict(self.columns(name))
        if count := len(problem(name).targets.get("accuracy", ())):
            never = np.isnan(columns[f"accuracy_{count}"])
            columns["calm"] = np.where(never, np.inf, columns["calm"])
        return {value: float(np.median(columns[value])) for value in VALUES}
