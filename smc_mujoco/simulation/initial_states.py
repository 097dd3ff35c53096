"""Initial states of the runs of a grid, one for each seed.

    smc.starts(spread=0.2)                             # within 20 % of the plant's x0, the default of a grid
    smc.starts(x0=0.0, by=0.3)                         # within 0.3 rad (or m) of 0

A seed gives every law and every condition the same start. Seed 0 is x0 itself. Seed s starts channel i from

    x_i = x0_i (1 + spread z_i) + by z_i,    z_i uniform in [-1, 1], drawn from (s, i)

A run with contacts must start clear of its obstacles. There -|z_i| replaces z_i, which moves the start inwards, and
pendulums that may touch each other ("bobs") start in order from left to right.
"""

import dataclasses
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, items_of, number, users_stacklevel
from smc_mujoco.simulation.scenario import Scenario

SPREAD = 0.2  # of x0, to either side; chosen
GRID_SEEDS = 2**52  # number of a grid's seeds; tuning takes larger ones
START_CURE = "say where its runs begin, with starts=smc.starts(x0=0.5) or --x0 0.5"  # where a plant starts at 0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Starts:
    """Where runs begin, by seed. The fields are the arguments of `starts`."""

    x0: tuple[float, ...] | None = None
    spread: float = SPREAD
    by: float = 0.0

    def largest(self, scenario: Scenario) -> float:
        """Return the largest |x| of any channel at the middle of the starts, or `by` if all are 0, rad or m."""
        middle = scenario.resolved.x0 if self.x0 is None else self.x0
        return max(abs(x) for x in middle) or self.by

    def check_condition(self, name: str, fields: Mapping[str, Any]) -> None:
        """Raise ScenarioError if both the starts and the fields of a condition set x0."""
        if self.x0 is not None and "x0" in fields:
            raise ScenarioError(f"condition {name!r} and the starts, or --x0, both set x0: give one of them")

    def place(self, scenario: Scenario, seed: int) -> Scenario:
        """Return a scenario with a seed, from the start that belongs to the seed."""
        if self.x0 is not None:
            scenario = dataclasses.replace(scenario, x0=self.x0)
        if seed == 0:
            return dataclasses.replace(scenario, seed=0)
        kind = scenario.contact.kind
        z = [np.random.default_rng([seed, i]).uniform(-1.0, 1.0) for i in range(scenario.plant.n)]
        z = z if kind == "none" else [-abs(factor) for factor in z]
        x0 = [
            x * (1.0 + self.spread * factor) + (self.by if x >= 0.0 else -self.by) * factor
            for x, factor in zip(scenario.resolved.x0, z, strict=True)
        ]
        return dataclasses.replace(scenario, seed=seed, x0=sorted(x0) if kind == "bobs" else x0)


def starts(x0: float | Sequence[float] | None = None, spread: float = SPREAD, by: float = 0.0) -> Starts:
    """Return where the runs of a grid begin, by seed.

    Args:
      x0: the middle of all starts, rad or m: one number for all channels, or one for each. Default: the plant's x0.
      spread: how far starts lie to either side of the middle, as a fraction of it, 0 or more.
      by: how much farther they lie, rad or m, 0 or more; for a plant that rests at 0.

    Raises:
      ScenarioError: a number out of its range.

    Warns:
      ScenarioWarning: a spread of more than 1, which may be percent.
    """
    if number("spread", spread, low=0.0) > 1.0:
        warnings.warn(
            f"spread is {spread:g}, which moves starts by {spread:g} times x0: if it is {spread:g} %, give "
            f"{spread / 100:g}",
            ScenarioWarning,
            users_stacklevel(),
        )
    items = items_of("x0", x0) if isinstance(x0, Sequence) and not isinstance(x0, str) else [x0]
    middle = None if x0 is None else tuple(number("x0", item) for item in items)
    return Starts(x0=middle, spread=spread, by=number("by", by, low=0.0))
