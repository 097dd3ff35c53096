"""What a report computes: how much of everything, in full or quick."""

import dataclasses

from smc_mujoco.analysis.ranking import SEEDS
from smc_mujoco.control import gain_sets as gains
from smc_mujoco.studies.paper import scenarios
from smc_mujoco.studies.study import FULL as GRID
from smc_mujoco.studies.study import QUICK as LOOK

GAINS = "tuned"  # with which everything but the claims is run, which look at every set


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
    laws: tuple[str, ...] = gains.LAWS
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
    plants=LOOK.plants,
    conditions=LOOK.conditions,
    seeds=LOOK.seeds,
    duration=LOOK.duration,
    kinds=("delay", "disturbance"),
    compared=(),
    basins=("inverted_pendulum",),
    points=(16, 16),
    scenes=tuple((plant, "nominal") for plant in LOOK.plants),
    filmed=1,
)
