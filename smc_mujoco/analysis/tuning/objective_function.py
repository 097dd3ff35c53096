"""J of a law on a plant as a function of its gains, for an optimiser of your own.

    objective = smc.design.objective("duffing", "super_twisting")
    objective([3.0, 4.4, 2.5])  # J, s^2

It is what `tune` minimises, in the same runs.
"""

import math
from collections.abc import Iterable
from typing import Annotated

from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.evaluator import Evaluator
from smc_mujoco.analysis.tuning.objective import MAX_SEARCHES, OBJECTIVES, Objective
from smc_mujoco.analysis.tuning.search import TuningTask, task_of
from smc_mujoco.common.aliases import Pair
from smc_mujoco.common.constraints import Whole, constrained
from smc_mujoco.common.errors import ScenarioError, find, items_of, number
from smc_mujoco.control.component import Component, Template
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import coerce


class ObjectiveFunction:
    """J of a law on a plant as a function of its gains, as `objective` makes it.

    Attributes:
      bounds: gain -> lowest and highest value from which `tune` starts; it may leave them by a
        decade.
      units: gain -> its unit, such as "N m s/rad"; "1" for a number without a unit.
      evaluations: how many sets of gains have been run.
    """

    def __init__(self, task: TuningTask, search: int):
        self._task = task
        cases = task.cases(search)
        self._evaluator = Evaluator(task.goal, cases, tuple(task.box), task.threads)
        self.bounds: dict[str, Pair] = dict(task.box)
        self.units = search_space.unit_texts(task.law, tuple(task.box), cases[0])
        self.evaluations = 0

    def __repr__(self) -> str:
        names = ", ".join(self.bounds)
        return f"objective({self._task.plant.name}, {self._task.law.name}: {names})"

    def __call__(self, gains: Iterable[float]) -> float:
        """Return J of a set of gains, s^2.

        It is inf for gains that miss the conditions of the law's theorem.

        Args:
          gains: one number above 0 for each of `bounds`, in their order.

        Raises:
          ScenarioError: another number of gains, or one that is not above 0.
        """
        values = self._values(gains)
        if not self._task.holds(values):
            return math.inf
        self.evaluations += 1
        [evaluation] = self._evaluator([values])
        return evaluation.objective

    def law(self, gains: Iterable[float]) -> Component:
        """Return the law with a set of gains, to run it, or to compare it with others."""
        values = self._values(gains)
        by_name = dict(zip(self.bounds, values, strict=True))
        return self._task.law(**by_name)

    def _values(self, gains: Iterable[float]) -> tuple[float, ...]:
        """Return gains as numbers, or refuse them."""
        values = tuple(number("gains", value, above=0.0) for value in items_of("gains", gains))
        if len(values) != len(self.bounds):
            raise ScenarioError(
                f"gains has {len(values)} numbers: give {len(self.bounds)}, "
                f"for {', '.join(self.bounds)}"
            )
        return values


@constrained
def objective(
    plant: Plant | str,
    law: Component | Template | str,
    objective: Objective | str = "balanced",
    search: Annotated[int, Whole(low=0, high=MAX_SEARCHES - 1)] = 0,
    threads: int | None = None,
    outside_theorem: bool = False,
) -> ObjectiveFunction:
    """Return J, which `tune` minimises, as a function of a law's gains.

        objective = smc.design.objective("duffing", "super_twisting")
        lower, upper = zip(*objective.bounds.values())
        print(objective([3.0, 4.4, 2.5]))  # J, s^2

    Gains are best searched by their logarithm, as `tune` does. Each call simulates every condition
    once with MuJoCo.

    Args:
      plant, law: names, or your own plant and law.
      objective: an Objective, "balanced", or "tracking", as for `tune`.
      search: which search of `tune(seed=0)` has the same initial states and noise.
      threads: as in `run`.
      outside_theorem: whether gains may miss the conditions of the law's theorem. Without it, their
        J is inf.

    Returns:
      A callable. It takes a sequence of gains in the order of its `bounds`, and returns J in s^2.
      `bounds` is a dict, gain -> lowest and highest value, which `tune` may leave by a decade;
      `law(gains)` is the law with these gains.

    Raises:
      ScenarioError: a law without gains to search, a gain of unknown unit whose default is not
        positive, or a plant without scales.
    """
    if isinstance(objective, Objective):
        goal = objective
    else:
        goal = find("objective", objective, OBJECTIVES)
    task = task_of(plant, coerce.coerced_law(law), goal, 1, 0, threads, outside_theorem)
    return ObjectiveFunction(task, search)
