"""Ids of the plants in gymnasium: "smc/CartPole-v0", and "Duffing-v0" where gymnasium has no
environment of that name.

gymnasium has no plugins, and its function `register_envs` does nothing. So importing this package
registers the ids if gymnasium has been imported; otherwise importing gymnasium does. The package
does not import gymnasium itself, which is optional and slow to import. This module imports no
plant: it reads the names of the plants from their files.
"""

import pkgutil
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

LIBRARY = "gymnasium"
NAMESPACE = "smc"  # of all plants


def register_when_imported() -> None:
    """Register the ids at once if gymnasium has been imported, else as soon as it is."""
    # set once gymnasium has registered its own ids
    if getattr(sys.modules.get(LIBRARY), "envs", None) is not None:
        register()
    else:
        # finders of other packages; an earlier import of this module may have left its own
        finders = [finder for finder in sys.meta_path if type(finder).__module__ != __name__]
        sys.meta_path[:] = [Importer(), *finders]


class Importer:
    """The finder of gymnasium alone. It registers the ids after gymnasium's first import."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> Any:
        """Return the spec of gymnasium, with a loader that also registers the ids; None for other
        packages.
        """
        if name != LIBRARY:
            return None
        spec = None
        for finder in list(sys.meta_path):
            if finder is not self and (spec := finder.find_spec(name, path, target)):
                break
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def load(module: ModuleType) -> None:
                execute(module)
                sys.meta_path.remove(self)
                register()

            spec.loader.exec_module = load
        return spec


def register() -> None:
    """Register the ids of all plants that gymnasium does not have yet."""
    from gymnasium.envs import registration as theirs

    taken = set()
    for spec in theirs.registry.values():
        if str(spec.entry_point).startswith(f"{LIBRARY}."):
            taken.add(spec.name)
    for plant in plants():
        names = [f"{NAMESPACE}/{camel(plant)}-v0"]
        if camel(plant) not in taken:
            names.append(f"{camel(plant)}-v0")
        for name in names:
            if name not in theirs.registry:
                theirs.register(
                    id=name,
                    entry_point="smc_mujoco.envs.entry_points:environment",
                    vector_entry_point="smc_mujoco.envs.entry_points:environments",
                    kwargs={"plant": plant},
                )


def plants() -> list[str]:
    """Return the names of the plants, other packages' included, without importing one."""
    from smc_mujoco.common.registry import points

    folder = Path(__file__).parents[1] / "mechanisms" / "plants"
    names = []
    for named in (*pkgutil.iter_modules([str(folder)]), *points("smc_mujoco.plants")):
        names.append(named.name)
    return list(dict.fromkeys(names))


def camel(name: str) -> str:
    """Return a name in camel case: van_der_pol -> VanDerPol."""
    return "".join(word.capitalize() for word in name.split("_"))
