"""A study as one HTML file: which controller, where, how sure, and which of the paper's claims
hold.

    from smc_mujoco.evidence.report import report
    report("report", quick=True)                   # report/report.html, which needs no other file and no network

The folder also keeps the data: study/results.parquet, claims, margins and region maps as JSON,
films as WebM. A second call computes only what is missing.
"""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from smc_mujoco.analysis.ranking import Relevant
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
    records: str | os.PathLike[str] | None = None,
    laws: Sequence[str] = (),
    relevant: Relevant | None = None,
) -> Path:
    """Compute a study and write its report, out/report.html.

    Args:
      out: the folder; what it holds already is not computed again.
      quick: a look in five minutes: less of everything, one set of gains for the claims.
      seeds: number of seeds of each cell of the grid; by default 24.
      threads: simulations at once; None for one per available core.
      progress: whether to show a bar for each stage.
      plan: how much of everything, instead of `quick`.
      records: a folder with records of rigs, CSV or npz files, which their twins repeat; see
        docs/rigs.md.
      laws: names of further laws, beside those of the plan; each needs tuned gains on every plant
        of the plan.
      relevant: the least relevant difference, as a share of the larger value, see `leaderboard`; by
        default 0.03.

    Raises:
      ScenarioError: an impossible number of seeds or threads, a folder that cannot be written,
        records of no known rig, or a further law that is unknown or has no tuned gains.
      MissingPackageError: jinja2 is not installed.
    """
    from smc_mujoco.common import extras

    if why := extras.missing("report", "a report", "jinja2"):
        raise extras.MissingPackageError(why)
    from smc_mujoco.common.errors import items_of
    from smc_mujoco.common.files import replacing
    from smc_mujoco.evidence.report import page, stages
    from smc_mujoco.evidence.report.plan import FULL, QUICK, Bars

    plan = plan or (QUICK if quick else FULL)
    if seeds is not None:
        plan = dataclasses.replace(plan, seeds=seeds)
    if relevant is not None:
        plan = dataclasses.replace(plan, relevant=relevant)
    if laws:
        plan = dataclasses.replace(
            plan, laws=tuple(dict.fromkeys((*plan.laws, *items_of("laws", laws))))
        )
    folder = Path(out)
    html = page.page(
        stages.find(
            plan, folder, threads, Bars(progress), None if records is None else Path(records)
        )
    )
    with replacing(folder / "report.html") as part:
        part.write_text(html, encoding="utf-8")
    return folder / "report.html"
