"""How much a report computes, and its progress."""

import contextlib
import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

from smc_mujoco.analysis.ranking import RELEVANT
from smc_mujoco.common import progress
from smc_mujoco.common.cache import cached
from smc_mujoco.evidence.accuracy.accuracy import DEFAULT_SEEDS, PERIODS
from smc_mujoco.evidence.papers.gaber import scenarios
from smc_mujoco.studies.study import FULL as GRID
from smc_mujoco.studies.study import QUICK as QUICK_GRID
from smc_mujoco.studies.study import Extent

GAINS = "tuned"  # the set of gains of everything but the claims, which are judged under every set

T = TypeVar("T")
Item = TypeVar("Item")
Report = Callable[[float, float], None]  # called with the work done and the whole


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan(Extent):
    """How much of everything: the extent of the grid, and the rest."""

    quick: bool  # whether margins and claims are quick
    laws: tuple[str, ...] = GRID.laws
    conditions: tuple[str, ...] = GRID.conditions
    seeds: int = GRID.seeds
    relevant: float = RELEVANT  # the least relevant difference, see `leaderboard`
    kinds: tuple[str, ...] = (
        "delay",
        "disturbance",
        "friction",
        "mass",
        "noise",
    )  # of margins, for all plants, laws
    attacked: tuple[str, ...] = (
        scenarios.PLANTS
    )  # plants on which the worst case of each law is searched
    attacks: int | None = (
        None  # runs of its search; None for 10 s of processor time a law and plant
    )
    compared: tuple[str, ...] = (
        "disturbance",
    )  # kinds of margins that are searched under every set of gains
    # With maps of their regions of attraction: on 2 cores a map of 1000 states takes 12 s.
    basins: tuple[str, ...] = ("inverted_pendulum", "van_der_pol", "duffing")
    basin_laws: tuple[str, ...] = scenarios.LAWS
    points: tuple[int, int] = (32, 32)  # of a map, across and up
    region: float = scenarios.DURATION  # the longest run of a map, s
    claims: tuple[str, ...] | None = None  # ids of the claims to judge; None for all
    scenes: tuple[tuple[str, str], ...] = tuple(
        (plant, "nominal") for plant in scenarios.PLANTS
    )  # traces and films
    filmed: int = len(scenarios.PLANTS)  # how many of the scenes are filmed
    scene_laws: tuple[str, ...] = scenarios.LAWS  # side by side in a scene
    scene: float = 5.0  # duration of traces and films, s
    rigs: tuple[str, ...] = (
        "qube_servo",
        "simple_pendulum_ak80",
    )  # whose laws are compared on all parameter sets
    accurate: tuple[str, ...] = ("duffing",)  # plants on which accuracy is measured without noise
    flights: tuple[str, ...] | None = (
        None  # conditions in which laws of flight are compared; None for all
    )
    flight_seeds: int = GRID.seeds
    periods: tuple[float, ...] = PERIODS  # control periods of these measurements, s
    accuracy_starts: int = DEFAULT_SEEDS  # number of initial states of these measurements


FULL = Plan(quick=False)
QUICK = Plan(
    **vars(QUICK_GRID),
    quick=True,
    kinds=("delay", "disturbance"),
    attacked=("duffing",),
    attacks=20,
    compared=(),
    basins=("inverted_pendulum",),
    points=(16, 16),
    scenes=tuple((plant, "nominal") for plant in QUICK_GRID.plants),
    filmed=1,
    rigs=("qube_servo",),
    flights=(
        "nominal",
        "steady wind of 3 m/s",
        "payload of 19 %",
        "a rotor loses 20 %",
        "figure of eight in 4 s",
    ),
    flight_seeds=12,
    periods=(4e-3, 3e-3, 2e-3, 1.5e-3, 1e-3),
    accuracy_starts=1,
)


class Bars:
    """Progress on the terminal: a bar for each stage, then a line with its time; or nothing."""

    def __init__(self, shown: bool):
        self.shown = shown
        self.spent: dict[str, float] = {}  # stage -> s

    @contextlib.contextmanager
    def stage(
        self, name: str, what: str = "", whole: float | None = None, bar: bool = True
    ) -> Iterator[progress.Bar]:
        """Time a stage, and show its bar; without one if `bar` is False, for work that shows its
        own.
        """
        start = time.monotonic()
        with progress.bar(f"{name}  {what}", whole, shown=bar and self.shown) as drawn:
            yield drawn
        self.spent[name] = time.monotonic() - start
        if self.shown:
            print(f"{name:11} {what:16} {self.spent[name]:6.0f} s", flush=True)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Work:
    """What every stage needs: the plan, the folder for results, threads, and the bars."""

    plan: Plan
    folder: Path
    threads: int | None
    bars: Bars

    def each(
        self, stage: str, unit: str, items: Sequence[Item], compute: Callable[[Item, Report], T]
    ) -> list[T]:
        """Return compute(item, report) for each item of a stage; `report` takes the progress within
        that item.
        """
        results = []
        with self.bars.stage(stage, f"{len(items)} {unit}") as bar:
            for k, item in enumerate(items):
                results.append(
                    compute(
                        item,
                        lambda done, total, k=k: bar.reached(k + done / (total or 1), len(items)),
                    )
                )
                bar.reached(k + 1, len(items))
        return results

    def kept(
        self,
        stage: str,
        unit: str,
        items: Sequence[tuple[str, ...]],
        depends: object,
        make: Callable[..., T],
        save: Callable[[T, Path], object],
        load: Callable[[Path], T],
    ) -> list[T]:
        """Return make(*item, report) for each item of a stage, kept in the file STAGE-ITEM.json,
        see `cached`.
        """

        def compute(item: tuple[str, ...], report: Report) -> T:
            path = self.folder / f"{'-'.join((stage, *item))}.json"
            return cached(path, depends, lambda: make(*item, report), save, load)

        return self.each(stage, unit, items, compute)
