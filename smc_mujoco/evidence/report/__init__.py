"""A study as one HTML file: which controller, where, how sure, and which of a paper's claims hold.

    from smc_mujoco.evidence.report import report
    report("report", quick=True)         # report/report.html, one file

The folder also keeps the data: the runs as parquet files, claims, margins and maps as JSON, films.
A second call computes only what is missing.
"""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from smc_mujoco.common.constraints import Whole, constrained

if TYPE_CHECKING:
    from smc_mujoco.evidence.report.plan import Plan


@constrained
def report(
    out: str | os.PathLike[str] = "report",
    quick: bool = False,
    seeds: Annotated[int, Whole(low=1, high=10_000)] | None = None,
    threads: int | None = None,
    progress: bool = False,
    plan: "Plan | None" = None,
    laws: Sequence[str] = (),
) -> Path:
    """Compute a study and write its report, out/report.html.

    Args:
      out: the folder; what it holds already is not computed again.
      quick: a look in five minutes: less of everything, one set of gains for the claims.
      seeds: runs of a law on each plant in each condition; by default 24, or 12 if quick.
      threads: simulations at once; None for one per available core.
      progress: whether to show a bar for each part of the work.
      plan: how much of everything, instead of `quick`.
      laws: names of further laws, beside those of the plan.

    Raises:
      ScenarioError: an impossible number of seeds or threads, a folder that cannot be written, or
        an unknown law.
      MissingPackageError: jinja2 is not installed.
    """
    from smc_mujoco.common import extras

    if why := extras.missing("report", "a report", "jinja2"):
        raise extras.MissingPackageError(why)
    from smc_mujoco.common.errors import items_of
    from smc_mujoco.evidence.report import sections
    from smc_mujoco.evidence.report.plan import FULL, QUICK, Work

    chosen = plan or (QUICK if quick else FULL)
    grid = chosen.grid
    if seeds is not None:
        grid = dataclasses.replace(grid, seeds=seeds)
    if laws:
        every = dict.fromkeys((*grid.laws, *items_of("laws", laws)))
        grid = dataclasses.replace(grid, laws=tuple(every))
    return sections.write(
        Work(
            plan=dataclasses.replace(chosen, grid=grid),
            folder=Path(out),
            threads=threads,
            progress=progress,
        )
    )
