"""A study's folder: part files of finished runs, and the table made from them.

A part is a parquet file, named by a hash of the runs in it. A file that is damaged, has other columns, or has scores by
other code is ignored, and its runs count as not done. The bytes of results.parquet depend only on its rows.
"""

import contextlib
import functools
import hashlib
import re
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from smc_mujoco.common import fingerprint
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import reading
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.studies import table

if TYPE_CHECKING:
    import pyarrow as pa

ROWS_PER_GROUP = 4096  # rows in memory at once while the table is written; chosen
MAX_OPEN_PARTS = 64  # parts in memory at once while the table is written; chosen
MAX_TEMPORARY_AGE = 3600.0  # s: older temporary files belong to a killed study; chosen
PART = re.compile(r"[0-9a-f]{32}\.parquet")


class Store:
    """The folder of a study. Parts are written by one thread at a time."""

    def __init__(self, out: Path):
        self.parts, self.results = out / "parts", out / "results.parquet"
        self.schema = table.schema({"scores": fingerprint.of(tuple(m.formula for m in metrics()))})
        self.where: dict[str, tuple[Path, int]] = {}  # hash of a finished run -> its part, and its row in it

    def open(self, resume: bool) -> None:
        """Make the folder and list the runs in it. Without `resume`, remove them and the table."""
        try:
            self.parts.mkdir(parents=True, exist_ok=True)
            self._tidy()
            parts = [path for path in sorted(self.parts.iterdir()) if PART.fullmatch(path.name)]
            for path in () if resume else (*parts, self.results):
                path.unlink(missing_ok=True)
        except (OSError, ValueError) as error:  # ValueError: a name with a null character
            raise ScenarioError(
                f"cannot use {self.parts}: {getattr(error, 'strerror', None) or error}; choose another folder"
            ) from error
        for path in parts if resume else ():
            if (part := self._read(path)) is not None:
                for i, name in enumerate(part["hash"].to_pylist()):
                    self.where.setdefault(name, (path, i))

    def _tidy(self) -> None:
        """Remove the temporary files of studies that were killed long ago."""
        for path in [*self.parts.glob(".*.parquet"), *self.parts.parent.glob(".results.*.parquet")]:
            with contextlib.suppress(FileNotFoundError):  # another study has just finished it
                if time.time() - path.stat().st_mtime > MAX_TEMPORARY_AGE:
                    path.unlink()

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write finished runs as a part."""
        import pyarrow as pa

        hashes = [row["hash"] for row in rows]
        path = self.parts / f"{hashlib.sha256(''.join(sorted(hashes)).encode()).hexdigest()[:32]}.parquet"
        table.write(path, self.schema, [pa.Table.from_pylist(list(rows), schema=self.schema)])
        self.where.update((name, (path, i)) for i, name in enumerate(hashes))

    def rows(self, names: Iterable[str]) -> Iterator[dict[str, Any]]:
        """Yield the rows of finished runs, part by part."""
        places: dict[Path, list[int]] = {}
        for name in names:
            path, i = self.where[name]
            places.setdefault(path, []).append(i)
        for path, indices in places.items():
            if (part := self._read(path)) is not None:
                yield from part.take(indices).to_pylist()

    def row(self, name: str) -> dict[str, Any]:
        """Return the row of a finished run in its part."""
        path, i = self.where[name]
        part = self._read(path)
        return {} if part is None else part.slice(i, 1).to_pylist()[0]

    def collect(self, hashes: Sequence[str], changes: Mapping[str, Mapping[str, Any]]) -> None:
        """Write the table of these finished runs, in this order.

        `changes` is hash -> columns that replace those of the part: scores at half the step, what a part does not tell,
        and the source of the gains, because the part may be from an earlier study whose gains had another source.
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
                    raise ScenarioError(f"part {path} was removed or broken while the study ran: start it again")
                parts.append(part.take([self.where[names[i]][1] for i in indices]))
            order = np.argsort(np.concatenate(list(places.values())))
            data = pa.concat_tables(parts).take(order).combine_chunks()
            for name in sorted({column for key in names for column in changes.get(key, ())}):
                pairs = zip(names, data[name].to_pylist(), strict=True)
                values = [changes.get(key, {}).get(name, value) for key, value in pairs]
                column = pa.array(values, data.field(name).type)
                data = data.set_column(data.column_names.index(name), data.field(name), column)
            return data

        groups = (hashes[i : i + ROWS_PER_GROUP] for i in range(0, len(hashes), ROWS_PER_GROUP))
        table.write(self.results, self.schema, map(rows, groups))

    def _read(self, path: Path) -> "pa.Table | None":
        """Return a part, or None for a file that is damaged or not a part."""
        try:
            with reading(path, "part", "start the study again") as file:
                part = table.read(file, sealed=True)
        except ScenarioError:
            return None
        complete = part.schema.equals(self.schema, check_metadata=True) and not part["hash"].null_count
        return part if complete else None
