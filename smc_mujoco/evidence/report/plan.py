"""How much a report computes, and the folder that keeps what was computed."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from smc_mujoco.common.cache import cached
from smc_mujoco.common.progress import Report, bar
from smc_mujoco.evidence.accuracy.accuracy import DEFAULT_SEEDS, PERIODS
from smc_mujoco.evidence.papers.gaber import scenarios
from smc_mujoco.evidence.report import flight
from smc_mujoco.studies.study import FULL as GRID
from smc_mujoco.studies.study import QUICK as QUICK_GRID
from smc_mujoco.studies.study import Extent

GAINS = "tuned"  # the set of gains of everything but the claims, which have their own

T = TypeVar("T")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """How much of everything."""

    quick: bool  # whether margins and claims are quick
    grid: Extent  # of the comparison
    worst: bool  # whether each law's worst case is searched too
    claims: tuple[str, ...] | None = None  # ids of the claims to judge; None for all
    kinds: tuple[str, ...] = ("delay", "disturbance", "friction", "mass", "noise")  # of margins
    regions: tuple[str, ...] = ("inverted_pendulum", "van_der_pol", "duffing")  # plants with maps
    points: tuple[int, int] = (32, 32)  # of a map, across and up
    accurate: tuple[str, ...] = ("duffing",)  # plants on which accuracy is measured
    periods: tuple[float, ...] = PERIODS  # control periods of these measurements, s
    accuracy_starts: int = DEFAULT_SEEDS  # initial states of these measurements
    rigs: tuple[str, ...] = ("qube_servo", "simple_pendulum_ak80")
    flights: tuple[str, ...] = ("nominal", *flight.CONDITIONS)
    flight_seeds: int = GRID.seeds
    scenes: tuple[str, ...] = scenarios.PLANTS  # plants whose runs are shown
    filmed: int = len(scenarios.PLANTS)  # how many of these are filmed
    scene: float = 5.0  # duration of traces and films, s


FULL = Plan(quick=False, grid=GRID, worst=True)
QUICK = Plan(
    quick=True,
    grid=dataclasses.replace(QUICK_GRID, seeds=12),
    worst=False,
    kinds=("delay", "disturbance"),
    regions=("inverted_pendulum",),
    points=(16, 16),
    periods=(4e-3, 3e-3, 2e-3, 1.5e-3, 1e-3),
    accuracy_starts=1,
    rigs=("qube_servo",),
    flights=("nominal", "steady wind of 3 m/s", "a rotor loses 20 %"),
    flight_seeds=12,
    scenes=QUICK_GRID.plants,
    filmed=1,
)


@dataclasses.dataclass(frozen=True, kw_only=True)
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
