"""Finding the entries of a catalogue, such as the laws: in the modules of this package, and in other packages."""

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
    """Return name -> object, of every object of a kind at the top level of a package's modules, sorted by name."""
    values = [value for module in modules(package) for value in vars(module).values() if isinstance(value, kind)]
    return {NAME(value): value for value in sorted(values, key=NAME)}


def catalogue_of(
    package: str, kind: type[T], group: str, fits: Callable[[T], bool] = lambda value: True
) -> Catalogue[T]:
    """Return the objects of a kind in a package's modules, and those of other packages in a group of entry points.

    Args:
      package: whose modules define the library's objects, such as "smc_mujoco.control.laws".
      kind: their class.
      group: of the entry points of other packages, such as "smc_mujoco.laws".
      fits: what else must hold for an object of another package.
    """
    return Catalogue(discover(package, kind), added(group, imported(kind, fits)))


def subclasses(base: type[T]) -> list[type[T]]:
    """Return every class derived from a base, users' too. A class comes before those derived from it."""
    below = base.__subclasses__()
    for kind in below:
        below.extend(kind.__subclasses__())
    return below
