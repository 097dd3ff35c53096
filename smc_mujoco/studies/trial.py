"""A trial: what `compare` and `adviser` compare laws on, and the folder of its results."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from smc_mujoco.control.component import Component, Template
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.grid import Starts, all_combinations
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies.fair_gains import Candidate, fair_gains
from smc_mujoco.studies.study import study
from smc_mujoco.studies.table import Table

if TYPE_CHECKING:
    from smc_mujoco.analysis.worst_case.uncertainty import Uncertainty
    from smc_mujoco.studies.worst_case import WorstCase


class Trial(NamedTuple):
    """What laws are compared on. `duration` is that of a run, s; `threads` and `progress` are as in `run`."""

    plants: Sequence[Plant]
    conditions: Sequence[Condition]
    duration: float
    starts: Starts | None
    folder: Path
    threads: int | None
    progress: bool

    def gains(
        self, laws: Mapping[str, Sequence[Component | Template]], budget: int, **options: Any
    ) -> dict[str, list[Candidate]]:
        """Return plant -> its laws with gains by one rule, see `fair_gains` for the options."""
        given = self.folder / "gains", budget, self.starts, self.threads, self.progress
        return {plant.name: fair_gains(plant, laws[plant.name], *given, **options) for plant in self.plants}

    def run(self, candidates: Mapping[str, Sequence[Candidate]], seeds: int, **options: Any) -> Table:
        """Run the laws of each plant in each condition from the seeds 0, 1, ..., with the options of `study`."""
        grid = self.plants, lambda plant: candidates[plant.name], self.conditions, range(seeds)
        runs = all_combinations(*grid, self.duration, self.starts)
        return study(runs, self.folder, replay=True, threads=self.threads, progress=self.progress, **options)

    def attack(
        self, name: str, scenario: Scenario, within: "Uncertainty | None", budget: int | None = None
    ) -> "WorstCase":
        """Return the worst case of a scenario, which the folder keeps under a name."""
        from smc_mujoco.studies.worst_case import cached_worst_case

        file = self.folder / "worst" / f"{name}.json"
        return cached_worst_case(file, scenario, within, budget, self.threads, self.progress)
