"""The table of a study: a parquet file with a row per run, from which every run can be repeated.

    table = smc.Table.read("study/results.parquet")
    best = table.select(plant="duffing", condition=["noise", "coulomb"]).column("ultimate_bound")
    table.scenario(0), table.trace(0)    # the scenario of a row, and its trace, by a run

Columns:

- the run: `hash`, `plant`, `law`, `gains` as JSON, `condition`, `seed`, and
  `duration` in s;
- where its gains come from: `source`, a kind of `control.source`, and `search` as JSON, null if
  there was no search;
- every metric of `smc.score`: null if the run failed or the metric does not apply, inf for "never";
- how the run failed: `diverged_at` in s, and `failure`; `arrived`, see `metrics.catalogue`;
- `touched`: whether the machine touched anything at a sample, null without a contact or if the run
  failed;
- what `leaderboard` charges: `half_step`, the scores of the same run at half the physics step, as
  JSON, null where it was not repeated; `trends`, the ratios of the metrics of the last part to
  those before it, see `ranking`, as JSON;

- the data to repeat it, as JSON: `versions` and `scenario`.
"""

import dataclasses
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from smc_mujoco.common.aliases import AnyPath, Fields
from smc_mujoco.common.errors import (
    ScenarioError,
    find,
    items_of,
    printable,
    shown,
    warn_once,
    words,
)
from smc_mujoco.common.extras import package
from smc_mujoco.common.files import (
    CHANGED,
    MAX_RATIO,
    MAX_UNPACKED,
    from_json,
    reading,
    replacing,
    to_json,
)
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import counted, span
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation import scenario_json
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

if TYPE_CHECKING:
    import pandas  # pyright: ignore[reportMissingImports]
    import pyarrow as pa

# Column -> its type. RUN_COLUMNS stand before the metrics, RESULT_COLUMNS after them.
RUN_COLUMNS = dict.fromkeys(
    ("hash", "plant", "law", "gains", "source", "search", "condition"), "string"
)
RUN_COLUMNS |= {"seed": "int64", "duration": "float64"}
RESULT_COLUMNS = {
    "diverged_at": "float64",
    "failure": "string",
    "half_step": "string",
    "trends": "string",
}
RESULT_COLUMNS |= {"arrived": "bool", "touched": "bool"}
RESULT_COLUMNS |= {"versions": "string", "scenario": "string"}
PREVIEW = ("settling_time", "ultimate_bound", "itae", "tv_rate")
CASE = ("plant", "law", "condition")  # whose runs `print` sums up in a row
MAX_CASES = 20  # that `print` shows; chosen
DIGEST = b"digest"  # key in a file's metadata


def schema(metadata: Mapping[str, str]) -> "pa.Schema":
    """Return the schema of a study's files."""
    import pyarrow as pa

    kinds = {
        "bool": pa.bool_(),
        "string": pa.string(),
        "int64": pa.int64(),
        "float64": pa.float64(),
    }
    columns = RUN_COLUMNS | dict.fromkeys(CATALOGUE, "float64") | RESULT_COLUMNS
    fields = {}
    for name, kind in columns.items():
        fields[name] = kinds[kind]
    return pa.schema(fields, metadata=dict(metadata))


def content(rows: "pa.Table") -> bytes:
    """Return names and values of rows as bytes, in which null differs from NaN."""
    from pyarrow import types

    parts = [to_json([rows.column_names, len(rows)]).encode()]
    for column in rows.columns:
        if types.is_floating(column.type) or types.is_integer(column.type):
            parts += [column.is_null().to_numpy().tobytes(), column.to_numpy().tobytes()]
        else:
            parts.append(json.dumps(column.to_pylist()).encode())
    return b"".join(parts)


def write_table(path: Path, schema: "pa.Schema", groups: "Iterable[pa.Table]") -> None:
    """Write a parquet file with a row group for each table, and a digest of all rows in its
    metadata.

    The digest is needed because parquet's checksums cover neither the headers of pages nor the
    footer.
    """
    import pyarrow.parquet as pq

    digest = hashlib.sha256()
    with (
        replacing(path) as file,
        file.open("wb") as sink,
        pq.ParquetWriter(sink, schema, compression="zstd", write_page_checksum=True) as writer,
    ):
        for rows in groups:
            writer.write_table(rows)
            digest.update(content(rows))
        writer.add_key_value_metadata({DIGEST: digest.hexdigest()})


def _median(metric: str, values: np.ndarray) -> Cell:
    """Return the median of a metric with its range, of values (N,) that are NaN where a run has
    none.
    """
    numbers = values[~np.isnan(values)]
    missing = len(values) - len(numbers)
    alarm = f"{missing} of {len(values)} have none" if missing else ""
    if not len(numbers):
        return Cell("", alarm=alarm)
    text = CATALOGUE[metric].text
    middle = float(np.median(numbers))
    ends = span(text(float(numbers.min())), text(float(numbers.max())))
    return Cell(text(middle), ends, alarm=alarm)


def read_table(path: Path, sealed: bool = False) -> "pa.Table":
    """Return the rows of `write_table`; if `sealed`, refuse a file without a digest, such as
    another program's.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    # opened here: pyarrow cannot open a path that is not UTF-8
    with path.open("rb") as source, pq.ParquetFile(source, page_checksum_verification=True) as file:
        size = 0
        for i in range(file.num_row_groups):
            size += file.metadata.row_group(i).total_byte_size
        if size > max(MAX_UNPACKED, MAX_RATIO * Path(path).stat().st_size):
            raise ScenarioError(
                f"it unpacks to {size / 1e6:,.0f} MB, and {MAX_UNPACKED / 1e6:,.0f} MB are allowed"
            )
        groups = []
        for i in range(file.num_row_groups):
            groups.append(file.read_row_group(i))
        if groups:
            rows = pa.concat_tables(groups)
        else:
            rows = file.read()
        metadata = dict(file.metadata.metadata or {})
    written = metadata.pop(DIGEST, None)
    digest = hashlib.sha256()
    for group in groups:
        digest.update(content(group))
    if written != digest.hexdigest().encode() and (sealed or written is not None):
        raise ScenarioError(CHANGED)
    if written is None:
        warn_once(
            f"another program wrote {printable(str(path))}, so nothing shows whether its numbers "
            "are those of the runs: read the file that the study wrote"
        )
    metadata.pop(b"ARROW:schema", None)
    return rows.replace_schema_metadata(metadata)


def _with_types(rows: "pa.Table") -> "pa.Table":
    """Return rows with the types of `schema`: another program may write numbers as text."""
    expected = schema({})
    for i, name in enumerate(rows.column_names):
        if rows.column_names.count(name) > 1:
            raise ScenarioError(f"it has column {name!r} twice")
        if name in expected.names and rows.schema.types[i] != (field := expected.field(name)).type:
            rows = rows.set_column(i, field, rows.column(i).cast(field.type))
    return rows


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """Runs and their scores.

    Attributes:
      data: the pyarrow Table.
      known: hash -> Scenario, for your own laws and signals, whose code is not in the file.
    """

    data: "pa.Table"
    scenarios_by_key: Mapping[str, Scenario] = dataclasses.field(default_factory=dict, repr=False)

    @classmethod
    def read(cls, path: AnyPath) -> "Table":
        """Return the table in a parquet file that a study wrote, or in the study's folder.

        Raises:
          ScenarioError: no such file, not a table of a study, or one that has changed since it was
            written.
        """
        if isinstance(path, str | os.PathLike) and os.path.isdir(path):
            path = Path(path) / "results.parquet"
        with reading(path, "table", "give the results.parquet of a study that has ended") as file:
            data = read_table(file)
            for name in (*RUN_COLUMNS, *RESULT_COLUMNS):
                if name not in data.column_names:
                    raise ScenarioError(f"it has no column {name!r}")
            data = _with_types(data)
        return cls(data=data)

    def __len__(self) -> int:
        return self.data.num_rows

    def __iter__(self) -> Iterator[Fields]:
        """Yield each row as column -> value, as pandas.DataFrame(table) reads it."""
        return iter(self.rows())

    def __repr__(self) -> str:
        counts = []
        for name in CASE:
            counts.append(counted(len(set(self.column(name).tolist())), name))
        checked = (self.data.schema.metadata or {}).get(b"checked", b"").decode()
        return f"Table({len(self)} runs: {', '.join(counts)}{checked and '; '}{checked})"

    def __str__(self) -> str:
        if not len(self):
            return repr(self)
        return f"{self!r}\n{self._summary()}"

    def _summary(self) -> Tabular:
        """Return the median and the range of each metric, a row for each plant, law and condition:
        all metrics of a table of scores, and those of the preview of a study's.
        """
        values = {}
        for name in self.data.column_names:
            if name in CATALOGUE and (name in PREVIEW or "scenario" not in self.data.column_names):
                values[name] = self.column(name)
        rows_of: dict[tuple[str, ...], list[int]] = {}
        for i, case in enumerate(zip(*map(self.column, CASE), strict=True)):
            rows_of.setdefault(case, []).append(i)
        cases = list(rows_of)[:MAX_CASES]
        cells = []
        for case in cases:
            row: list[Cell | str] = [name or "" for name in case]
            for name, column in values.items():
                row.append(_median(name, column[rows_of[case]]))
            cells.append(row)
        notes = []
        if len(rows_of) < len(self):
            notes.append("Medians; below each the least and the largest value.")
        failed = self.column("failure") if "failure" in self.data.column_names else []
        if failures := [text for text in failed if text]:
            notes.append(f"{len(failures)} of {len(self)} runs failed, first: {failures[0]}.")
        if rest := len(rows_of) - len(cases):
            notes.append(f"And {rest} more: Table.select.")
        return Tabular(headings=[*CASE, *values], rows=cells, notes=notes, name_columns=len(CASE))

    def _repr_html_(self) -> str:
        return dataclasses.replace(self._summary(), title=repr(self))._repr_html_()

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Return the rows as a stream of Arrow's C interface, as polars reads it."""
        return self.data.__arrow_c_stream__(requested_schema)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return the rows as a pandas DataFrame.

        Raises:
          MissingPackageError: pandas is not installed.
        """
        with package("pandas", "Table.to_pandas"):
            return self.data.to_pandas()

    def rows(self) -> list[Fields]:
        """Return a dict for each row, column -> value: None for null, math.inf for "never", and
        JSON columns as text.
        """
        return self.data.to_pylist()

    def column(self, name: str) -> np.ndarray:
        """Return a column, (rows,): numbers with NaN for null, or texts with None."""
        find("column of the table", name, dict.fromkeys(self.data.column_names))
        return self.data[name].to_numpy()

    def select(
        self,
        plant: str | Sequence[str] | None = None,
        law: str | Sequence[str] | None = None,
        condition: str | Sequence[str] | None = None,
    ) -> "Table":
        """Return the rows with this plant, law and condition, each a name, several, or None for
        all.
        """
        import pyarrow as pa
        import pyarrow.compute as pc

        data = self.data
        for name, values in (("plant", plant), ("law", law), ("condition", condition)):
            if values is not None:
                is_list = isinstance(values, Iterable) and not isinstance(values, str)
                if is_list:
                    names = items_of(name, values)
                else:
                    names = [values]
                present = dict.fromkeys(self.column(name).tolist())
                for value in names:
                    find(f"{name} of this table", value, present)
                data = data.filter(pc.field(name).isin(pa.array(names, pa.string())))
        return dataclasses.replace(self, data=data)

    def scenario(self, i: int) -> Scenario:
        """Return the scenario of row i."""
        if not isinstance(i, int | np.integer) or not -len(self) <= i < len(self):
            raise ScenarioError(f"the table has no row {shown(i)}: it has {len(self)}, from 0 on")
        if "scenario" not in self.data.column_names:
            raise ScenarioError("this table has scores alone: take row i of the scenarios it is of")
        row = self.data.slice(int(i) % len(self), 1)
        if scenario := self.scenarios_by_key.get(row["hash"][0].as_py()):
            return scenario
        search = row["search"][0].as_py()
        try:
            about = from_json(row["scenario"][0].as_py())
            about["source"] = {
                "kind": row["source"][0].as_py(),
                "search": search and from_json(search),
            }
            return scenario_json.restore(about)
        except ScenarioError:  # with its cure
            raise
        except Exception as error:
            raise ScenarioError(
                f"row {i} of the table holds no scenario ({words(error)}): read the file that the "
                "study wrote"
            ) from None

    def trace(self, i: int) -> Trace:
        """Run row i again and return its trace.

        With the same versions it is equal to the last bit.
        """
        return run(self.scenario(i))
