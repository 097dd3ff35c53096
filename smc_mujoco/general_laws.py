"""Every law that can be ranked: those of the catalogue that are for any plant whose joints are all driven."""

from collections.abc import Sequence

from smc_mujoco import gains as sets
from smc_mujoco.errors import ScenarioError
from smc_mujoco.law import catalogue


def general_laws(plants: Sequence[str], gains: str) -> list[str]:
    """The general laws that have gains in a set on each of these plants, by name.

    A general law is for every plant. Left out are `none`, and the same law computed otherwise: it would be level with
    the law itself wherever that wins.

    Raises:
      ScenarioError: an unknown set, or one without gains for any law on these plants.
    """
    names = [name for name, law in catalogue().items() if not law.plants and name not in ("none", *sets.FORMS)]
    found, why = [], None
    for name in names:
        try:
            for plant in plants:
                sets.law(plant, name, gains)
        except ScenarioError as error:
            why = error
        else:
            found.append(name)
    if not found and why:
        raise why
    return found
