"""What every stage of a report needs."""

import dataclasses
from pathlib import Path

from smc_mujoco.studies.report.bars import Bars, Report
from smc_mujoco.studies.report.plan import Plan


@dataclasses.dataclass(frozen=True, kw_only=True)
class Work:
    """The plan, the folder for results, threads, and what tells of the progress."""

    plan: Plan
    folder: Path
    threads: int | None
    bars: Bars


def part(report: Report, k: int, of: int) -> Report:
    """The report of part k of several that are alike."""
    return lambda done, total: report(k + (done / total if total else 0.0), of)
