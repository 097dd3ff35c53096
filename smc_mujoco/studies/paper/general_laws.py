"""The laws that can be ranked on some plants: every general law that has gains for them."""

from collections.abc import Sequence

from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.mechanisms.plant import Plant


def general_laws(plants: Sequence[str | Plant], gains: str) -> list[str]:
    """The general laws that have gains in a set on each of these plants, the report's own first.

    Raises:
      ScenarioError: an unknown set, or one without gains for any law on these plants.
    """
    found, why = [], None
    for name in general():
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


def general() -> tuple[str, ...]:
    """Every law that can be a rival on some plant: those of `gain_sets.LAWS`, then all others by name."""
    return *sets.LAWS, *sorted(search_space.SCALES.keys() - sets.UNTUNED - set(sets.LAWS))
