"""The plants' ids in gymnasium: "smc/CartPole-v0", and "Duffing-v0" where gymnasium has no environment of that name.

gymnasium.make("smc_mujoco:Duffing-v0") imports this package and then looks the id up. So importing the package
registers the ids, but must not import gymnasium, which most users do not have: where it is not there yet, its import is
waited for. Light: plants are known by their files.
"""

import importlib.abc
import importlib.machinery
import importlib.util
import pkgutil
import sys
import types
from collections.abc import Sequence
from pathlib import Path

LIBRARY = "gymnasium"
SPACE = "smc"  # the namespace in which every plant is


def register() -> None:
    """Register an id, or two, for every plant; again if need be."""
    from gymnasium.envs import registration as theirs  # what called this has imported gymnasium

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
    """Names of the plants, without importing one."""
    return [module.name for module in pkgutil.iter_modules([str(Path(__file__).parents[1] / "mechanisms" / "plants")])]


def camel(name: str) -> str:
    """van_der_pol -> VanDerPol."""
    return "".join(word.capitalize() for word in name.split("_"))


def attend() -> None:
    """Register now where gymnasium is imported, else as soon as it is."""
    if sys.modules.get(LIBRARY) is not None:
        register()
    elif not any(isinstance(finder, Waiting) for finder in sys.meta_path):
        sys.meta_path.insert(0, Waiting())


class Waiting(importlib.abc.MetaPathFinder):
    """Finds what others find, and registers the plants once gymnasium has been imported."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: types.ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """The spec of gymnasium alone, with a loader that registers afterwards."""
        if fullname != LIBRARY:
            return None
        others = [finder for finder in sys.meta_path if finder is not self and hasattr(finder, "find_spec")]
        found = (finder.find_spec(fullname, path, target) for finder in others)
        spec = next((spec for spec in found if spec is not None), None)
        if spec is not None and spec.loader is not None:
            run = spec.loader.exec_module

            def exec_module(module: types.ModuleType) -> None:
                run(module)
                if self in sys.meta_path:
                    sys.meta_path.remove(self)
                register()

            spec.loader.exec_module = exec_module
        return spec
