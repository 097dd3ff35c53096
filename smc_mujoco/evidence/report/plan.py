"""How much a report computes, and the folder that keeps what was computed."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from smc_mujoco.common.aliases import Names
from smc_mujoco.common.cache import cached
from smc_mujoco.common.data import named_data
from smc_mujoco.common.progress import Report, bar
from smc_mujoco.simulation import gaber_study
from smc_mujoco.studies.study import FULL as GRID
from smc_mujoco.studies.study import QUICK as QUICK_GRID
from smc_mujoco.studies.study import Extent

GAINS = "tuned"  # the set of gains of everything but the claims, which have their own

T = TypeVar("T")


@named_data
class Plan:
    """How much of everything."""

    quick: bool  # whether margins and claims are quick
    grid: Extent  # of the comparison
    worst: bool  # whether each law's worst case is searched too
    claims: Names | None = None  # ids of the claims to judge; None for all
    kinds: Names = ("delay", "disturbance", "friction", "mass", "noise")  # of margins
    scenes: Names = gaber_study.PLANTS  # plants whose runs are shown
    filmed: int = len(gaber_study.PLANTS)  # how many of these are filmed
    scene: float = 5.0  # duration of traces and films, s


FULL = Plan(quick=False, grid=GRID, worst=True)
QUICK = Plan(
    quick=True,
    grid=dataclasses.replace(QUICK_GRID, seeds=12),
    worst=False,
    kinds=("delay", "disturbance"),
    scenes=QUICK_GRID.plants,
    filmed=1,
)


@named_data
class Work:
    """What every section needs: the plan, the folder for results, and threads."""

    plan: Plan
    folder: Path
    threads: int | None
    progress: bool

    def kept(
        self,
        name: str,
        depends: object,
        make: Callable[[Report], T],
        save: Callable[[T, Path], object],
        load: Callable[[Path], T],
    ) -> T:
        """Return make(report), kept in the folder under a file's name, see `cached`."""
        path = self.folder / name
        with bar(path.stem, shown=self.progress) as shown:
            return cached(path, depends, lambda: make(shown.reached), save, load)
