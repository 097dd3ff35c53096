"""The traces of a study that are saved as files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.common.files import slug
from smc_mujoco.common.progress import counter
from smc_mujoco.simulation.run import stream
from smc_mujoco.studies.executors import batches
from smc_mujoco.studies.table import Table

CHOICES = ("none", "worst", "all")


def path(folder: Path, row: Mapping[str, Any]) -> Path:
    """Return the file of a row's trace."""
    names = "-".join(slug(row[column]) for column in ("plant", "condition", "law"))
    return folder / f"{names}-{row['seed']}-{row['hash'][:8]}.npz"


def worst(table: Table) -> list[int]:
    """Return the row of the worst run of every plant and condition: failed, unsettled, then by bound or overshoot."""
    failed, bounds = table.column("failure") != np.array(None), table.column("ultimate_bound")
    ends = np.where(np.isnan(bounds), table.column("overshoot"), bounds)
    unsettled = table.column("settling_time") == np.inf
    badness = list(zip(failed, unsettled & ~failed, np.where(failed, 0.0, ends), strict=True))
    rows: dict[tuple, int] = {}
    for i, cell in enumerate(zip(table.column("plant"), table.column("condition"), strict=True)):
        if badness[i] > badness[rows.setdefault(cell, i)]:
            rows[cell] = i
    return list(rows.values())


def save(table: Table, choice: str, folder: Path, threads: int, progress: bool) -> None:
    """Repeat the chosen runs that have no file yet, and save their traces."""
    chosen = {"none": [], "worst": worst(table), "all": range(len(table))}[choice]
    files = {}
    for i in chosen:
        (row,) = table.data.slice(i, 1).to_pylist()
        if not (file := path(folder, row)).exists():
            files[table.scenario(i)] = file
    with counter(len(files), sum(s.work for s in files), progress) as stepped:
        for batch in batches(files, threads):
            for i, trace in stream(batch, threads, stepped):
                trace.save(files[batch[i].scenario])
