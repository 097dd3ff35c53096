"""The laws that can be ranked on some plants: every general law that has gains for them."""

from collections.abc import Sequence

from smc_mujoco import gains as sets
from smc_mujoco.errors import ScenarioError
from smc_mujoco.plant import Plant


def general_laws(plants: Sequence[str | Plant], gains: str) -> list[str]:
    """The general laws that have gains in a set on each of these plants, the report's own first.

    Raises:
      ScenarioError: an unknown set, or one without gains for any law on these plants.
    """
    found, why = [], None
    for name in sets.general():
        try:
            for plant in plants:
                sets.law(plant.name if isinstance(plant, Plant) else plant, name, gains)
        except ScenarioError as error:
            why = error
        else:
            found.append(name)
    if not found and why:
        raise why
    return found
