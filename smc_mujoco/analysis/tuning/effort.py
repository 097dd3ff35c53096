"""How much a search for gains may try, by which rule, and where it is made."""

from typing import NamedTuple

from smc_mujoco.analysis.tuning.objective import BUDGET, SEARCHES
from smc_mujoco.simulation.workers import Workers


class Search(NamedTuple):
    """How the gains of every law are searched."""

    searches: int = SEARCHES  # independent ones, each of which ends with a set of gains
    budget: int = BUDGET  # sets of gains that a search tries at most, for each gain
    # whether by `quick_search`, under the conditions asked for and with noise, on plants for which
    # the package has no gains of the laws
    quick: bool = False
    device: str = "cpu"  # on which the fast engine searches
    executor: Workers | None = None  # where searches and runs are made
