"""Finding the entries of a catalogue, such as the laws: one file of this package, one entry; and entry points."""

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import TypeVar

from smc_mujoco.common.catalogue import NAME, Catalogue, added, imported

T = TypeVar("T")


def modules(package: str) -> Iterator[ModuleType]:
    """Import and yield every module of a package."""
    for info in pkgutil.iter_modules(importlib.import_module(package).__path__):
        yield importlib.import_module(f"{package}.{info.name}")


def discover(package: str, kind: type[T]) -> dict[str, T]:
    """Return every object of a kind at the top level of a package's modules, by its name, in alphabetical order."""
    values = [value for module in modules(package) for value in vars(module).values() if isinstance(value, kind)]
    return {NAME(value): value for value in sorted(values, key=NAME)}


def catalogue_of(
    package: str, kind: type[T], group: str, fits: Callable[[T], bool] = lambda value: True
) -> Catalogue[T]:
    """Return the objects of a kind in a package's modules, and those of other packages in a group of entry points.

    Args:
      fits: what else must hold for an object of another package.
    """
    return Catalogue(discover(package, kind), added(group, imported(kind, fits)))


def subclasses(base: type[T]) -> list[type[T]]:
    """Return every class derived from a base, users' own included, a base before what is derived from it."""
    found = base.__subclasses__()
    for kind in found:
        found.extend(kind.__subclasses__())
    return found


# Former name of a module, as files of recorded runs have it -> its present name.
FORMER_PLACES = {
    "smc_mujoco.actuators": "smc_mujoco.mechanisms.hardware.drives",
    "smc_mujoco.backlash": "smc_mujoco.mechanisms.hardware.backlash",
    "smc_mujoco.contact": "smc_mujoco.mechanisms.hardware.contact",
    "smc_mujoco.friction": "smc_mujoco.mechanisms.hardware.friction",
    "smc_mujoco.sensors": "smc_mujoco.mechanisms.hardware.encoder",
    "smc_mujoco.plants": "smc_mujoco.mechanisms.plants",
    "smc_mujoco.laws": "smc_mujoco.control.laws",
    "smc_mujoco.surfaces": "smc_mujoco.control.surfaces",
    "smc_mujoco.estimators": "smc_mujoco.control.estimators",
    "smc_mujoco.signals": "smc_mujoco.simulation.signals",
    "smc_mujoco.references": "smc_mujoco.simulation.signals",
    "smc_mujoco.simulation.references": "smc_mujoco.simulation.signals",
    "smc_mujoco.studies.paper": "smc_mujoco.studies.papers.gaber",
    "smc_mujoco.series": "smc_mujoco.simulation.time_series",
}


def present_place(module: str) -> str:
    """Return the present name of a module that a file names."""
    for former, present in FORMER_PLACES.items():
        if module == former or module.startswith(f"{former}."):
            return present + module.removeprefix(former)
    return module
