"""How much a report computes, and how its finished results are cached.

A report that was killed and is started again computes nothing twice: every result has a file in the report's folder.
"""

import contextlib
import dataclasses
import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

from smc_mujoco.analysis.ranking import SEEDS
from smc_mujoco.analysis.tuning import result
from smc_mujoco.common import fingerprint, progress
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.studies.paper import scenarios
from smc_mujoco.studies.study import FULL as GRID
from smc_mujoco.studies.study import QUICK as QUICK_GRID

GAINS = "tuned"  # of everything but the claims, which are judged under every set

T = TypeVar("T")
Item = TypeVar("Item")
Report = Callable[[float, float], None]  # told the work done and the whole


# how much


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """How much of everything.

    Attributes:
      quick: whether margins and claims are to be quick.
      plants, laws, conditions, seeds, duration: of the grid; s. Fewer than 16 seeds name no winner, see `ranking`.
      kinds: of margins, found for all plants and laws.
      compared: those of them that are found under every set of gains.
      basins: plants whose regions of attraction are mapped: on 2 cores a map of 1000 states takes 12 s.
      basin_laws: under which laws.
      points: of a map, across and up.
      region: the longest run of a map, s.
      claims: ids of claims to judge; None for all.
      scenes: (plant, condition) of the traces and films.
      filmed: how many of the scenes are filmed.
      scene_laws: side by side in them.
      scene: s, of traces and films.
    """

    quick: bool
    plants: tuple[str, ...] = scenarios.PLANTS
    laws: tuple[str, ...] = sets.LAWS
    conditions: tuple[str, ...] = tuple(GRID.conditions)
    seeds: int = SEEDS  # the fewest that name a winner
    duration: float = scenarios.DURATION
    kinds: tuple[str, ...] = ("delay", "disturbance", "friction", "mass", "noise")
    compared: tuple[str, ...] = ("disturbance",)
    basins: tuple[str, ...] = ("inverted_pendulum", "van_der_pol", "duffing")
    basin_laws: tuple[str, ...] = scenarios.LAWS
    points: tuple[int, int] = (32, 32)
    region: float = scenarios.DURATION
    claims: tuple[str, ...] | None = None
    scenes: tuple[tuple[str, str], ...] = tuple((plant, "nominal") for plant in scenarios.PLANTS)
    filmed: int = len(scenarios.PLANTS)
    scene_laws: tuple[str, ...] = scenarios.LAWS
    scene: float = 5.0


FULL = Plan(quick=False)
QUICK = Plan(
    quick=True,
    plants=QUICK_GRID.plants,
    conditions=QUICK_GRID.conditions,
    seeds=QUICK_GRID.seeds,
    duration=QUICK_GRID.duration,
    kinds=("delay", "disturbance"),
    compared=(),
    basins=("inverted_pendulum",),
    points=(16, 16),
    scenes=tuple((plant, "nominal") for plant in QUICK_GRID.plants),
    filmed=1,
)


# progress and cache


class Bars:
    """What a report says on the terminal: a bar for each stage, then a line with its time; or nothing.

    `spent`: stage -> s.
    """

    def __init__(self, shown: bool):
        self.shown = shown
        self.spent: dict[str, float] = {}

    @contextlib.contextmanager
    def stage(self, name: str, what: str = "", bar: bool = True) -> Iterator[Report]:
        """Time a stage, and show its bar unless `bar` says that it has one of its own."""
        start = time.monotonic()
        with progress.bar(f"{name}  {what}", shown=bar and self.shown) as drawn:
            yield drawn.reached
        self.spent[name] = time.monotonic() - start
        if self.shown:
            print(f"{name:11} {what:16} {self.spent[name]:6.0f} s", flush=True)


def cached(
    path: Path, depends: object, make: Callable[[], T], save: Callable[[T, Path], object], load: Callable[[Path], T]
) -> T:
    """Return what `make` gives, from its file if there is one.

    The file's name ends in a hash of what the result depends on: `depends`, the package's code, models and gains, and
    the versions of the packages below. Files of other hashes are removed when a new one is written.

    Args:
      path: of the file; before its ending the hash is put.
      depends: what the result depends on beside the code, JSON-able.
    """
    text = json.dumps([depends, fingerprint.package(), result.versions()], sort_keys=True, default=str)
    own = path.with_stem(f"{path.stem}-{hashlib.sha256(text.encode()).hexdigest()[:12]}")
    if own.exists():
        with contextlib.suppress(Exception):  # whatever damaged bytes raise: it is computed again
            return load(own)
    found = make()
    for old in path.parent.glob(f"{path.stem}-{'?' * 12}.*"):
        old.unlink()
    save(found, own)
    return load(own)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Work:
    """What every stage needs: the plan, the folder for results, threads, and the bars."""

    plan: Plan
    folder: Path
    threads: int | None
    bars: Bars

    def each(self, stage: str, unit: str, items: Sequence[Item], compute: Callable[[Item, Report], T]) -> list[T]:
        """Compute something for every item of a stage; `compute` reports on its item alone."""
        found = []
        with self.bars.stage(stage, f"{len(items)} {unit}") as report:
            for k, item in enumerate(items):
                found.append(
                    compute(item, lambda done, total, k=k: report(k + (done / total if total else 0.0), len(items)))
                )
                report(k + 1, len(items))
        return found


def counted(report: Report, total: float) -> Callable[[int], None]:
    """Return a report that is told how much more is done."""
    done = 0

    def told(more: int) -> None:
        nonlocal done
        done += more
        report(done, total)

    return told
