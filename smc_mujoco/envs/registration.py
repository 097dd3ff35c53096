"""Ids of the plants in gymnasium: "smc/CartPole-v0", and "Duffing-v0" where gymnasium has no environment of that name.

gymnasium has no plugins: `gymnasium.make("smc_mujoco:Duffing-v0")` imports this package and then looks the id up. So
importing this package registers the ids if gymnasium has been imported; otherwise a later import of the package does
(see `smc_mujoco.__init__`). The package does not import gymnasium itself, which is optional and slow to import. This
module imports no plant: it reads the names of the plants from their files.
"""

import pkgutil
import sys
from pathlib import Path

LIBRARY = "gymnasium"
SPACE = "smc"  # namespace of all plants


def register_if_imported() -> bool:
    """Register the ids if gymnasium has been imported; return whether it has."""
    if getattr(sys.modules.get(LIBRARY), "envs", None) is None:  # set once gymnasium has registered its own ids
        return False
    register()
    return True


def register() -> None:
    """Register the ids of all plants that gymnasium does not have yet."""
    from gymnasium.envs import registration as theirs

    taken = {spec.name for spec in theirs.registry.values() if str(spec.entry_point).startswith(f"{LIBRARY}.")}
    for plant in plants():
        for name in (f"{SPACE}/{camel(plant)}-v0", *([] if camel(plant) in taken else [f"{camel(plant)}-v0"])):
            if name not in theirs.registry:
                theirs.register(
                    id=name,
                    entry_point="smc_mujoco.envs.gymnasium_env:PlantEnv",
                    vector_entry_point="smc_mujoco.envs.vector_env:BatchEnv",
                    kwargs={"plant": plant},
                )


def plants() -> list[str]:
    """Return the names of the plants, other packages' included, without importing one."""
    from smc_mujoco.common.catalogue import points

    own = [module.name for module in pkgutil.iter_modules([str(Path(__file__).parents[1] / "mechanisms" / "plants")])]
    return list(dict.fromkeys([*own, *(point.name for point in points("smc_mujoco.plants"))]))


def camel(name: str) -> str:
    """Return a name in camel case: van_der_pol -> VanDerPol."""
    return "".join(word.capitalize() for word in name.split("_"))
