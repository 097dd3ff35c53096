"""Catalogues: entries of the library by name, and those that other installed packages add by entry
points.

    [project.entry-points."smc_mujoco.laws"]
    my_law = "my_package.laws:my_law"

The names of other packages' entries are read from the packages' metadata. An entry is imported when
it is asked for by its name, or when all entries are listed. So a package costs nothing, and cannot
fail, until somebody asks for it.

If an entry is wrong, one sentence says why. It is an error if the entry was asked for by its name,
and a `PackageWarning` if all are listed, because the others still work.
"""

import dataclasses
import functools
import importlib
import importlib.metadata
import importlib.util
import itertools
import operator
import pkgutil
import sys
import warnings
from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping
from importlib.machinery import ModuleSpec
from importlib.metadata import EntryPoint
from types import ModuleType
from typing import Any, Generic, TypeVar

from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.errors import ScenarioError, shown, users_stacklevel, words

NAME = operator.attrgetter("name")
PREFIX = "smc_mujoco."
KINDS = {  # group of entry points -> what an entry is, and how one makes it
    "smc_mujoco.laws": ("law", "a function decorated with smc.law_function"),
    "smc_mujoco.joint_laws": (
        "law of many joints",
        "a function decorated with smc.law_function(joint=True)",
    ),
    "smc_mujoco.surfaces": ("surface", "a function decorated with smc.design.surface_function"),
    "smc_mujoco.estimators": (
        "velocity estimator",
        "a function decorated with smc.estimator_function",
    ),
    "smc_mujoco.plants": ("plant", "a smc_mujoco.mechanisms.plant.Plant"),
    "smc_mujoco.rigs": ("rig", "a smc_mujoco.identification.published_rig.PublishedRig"),
    "smc_mujoco.scenes": ("scene", "a module that declares a `scene`"),
    "smc_mujoco.papers": ("paper", "a package with paper.toml and claims.py"),
}

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
U = TypeVar("U")


class PackageWarning(UserWarning):
    """An installed package has an entry point for smc_mujoco that cannot be used.

    The message is one sentence.
    """


@dataclasses.dataclass(frozen=True)
class PackageEntry(Generic[T_co]):
    """An entry of another package, which is loaded at its first use."""

    point: EntryPoint
    make: Callable[[EntryPoint], T_co]  # may raise any exception

    @property
    def package(self) -> str:
        """The name of the installed package."""
        if self.point.dist:
            return self.point.dist.name
        return self.point.module.partition(".")[0]

    def __str__(self) -> str:
        return (
            f"package {self.package!r}: its {KINDS[self.point.group][0]} {self.point.name!r} "
            f"({self.point.value})"
        )

    @property
    def value(self) -> T_co:
        """The entry."""
        if _being_imported(self.point.module):
            entry = self._load()
        else:
            entry = self._loaded
        if isinstance(entry, ScenarioError):
            raise ScenarioError(str(entry)) from entry.__cause__
        return entry

    @cached_property
    def _loaded(self) -> T_co | ScenarioError:
        """The first result of `_load`, so that a failing package is imported only once."""
        return self._load()

    def _load(self) -> T_co | ScenarioError:
        """Return the entry, or the error that says what is wrong with it."""
        try:
            return self.make(self.point)
        except ScenarioError as error:
            return ScenarioError(f"{self}: {error}")
        except (Exception, SystemExit) as error:  # whatever another package raises
            failed = ScenarioError(
                f"{self} cannot be loaded ({words(error)}): fix, update or uninstall that package"
            )
            failed.__cause__ = error
            return failed


def _being_imported(module: str) -> bool:
    """Return whether a module, or a package around it, is being imported.

    Its entries may not exist yet.
    """
    for name in itertools.accumulate(module.split("."), "{}.{}".format):
        spec = getattr(sys.modules.get(name), "__spec__", None)
        if getattr(spec, "_initializing", False):  # importlib's own mark
            return True
    return False


class Catalogue(Mapping[str, T_co]):
    """Entries by name, in alphabetical order.

    `catalogue[name]` loads one entry. Iteration loads all, warns of those that cannot be loaded,
    and leaves them out.
    """

    def __init__(
        self,
        own: Mapping[str, T_co],
        added: Mapping[str, tuple[PackageEntry[T_co], ...]] | None = None,
    ):
        self.own = own
        self.added = dict(added or {})  # entries of other packages

    def __getitem__(self, name: str) -> T_co:
        if name in self.own:
            for entry in self.added.get(name, ()):
                warn(
                    f"{entry} has the name of an entry of the library, which is used instead: give "
                    "it another name"
                )
            return self.own[name]
        first, *further = self.added[name]
        if further:
            kind = KINDS[first.point.group][0]
            packages = " and ".join(repr(entry.package) for entry in (first, *further))
            raise ScenarioError(
                f"{kind} {name!r} is in the packages {packages}: uninstall one of them, or rename "
                "it"
            )
        return first.value

    def __contains__(self, name: object) -> bool:
        return name in self.own or name in self.added

    def __iter__(self) -> Iterator[str]:
        for name in sorted({*self.own, *self.added}):
            try:
                self[name]
            except ScenarioError as error:
                warn(str(error))
            else:
                yield name

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __or__(self, more: Mapping[str, U]) -> "Catalogue[T_co | U]":
        """Return the entries of both.

        Of two entries of the library with one name, that of `other` is taken.
        """
        if not isinstance(more, Catalogue):
            more = Catalogue(more)
        names = {*self.added, *more.added}
        entries = {}
        for name in names:
            ours = self.added.get(name, ())
            theirs = more.added.get(name, ())
            entries[name] = (*ours, *theirs)
        # it is only read
        own: Any = ChainMap[str, Any](more.own, self.own)  # pyright: ignore[reportArgumentType]
        return Catalogue(own, entries)

    def taken(self, name: str) -> bool:
        """Return whether an entry has this name.

        An entry whose module is being imported does not count.
        """
        if name in self.own:
            return True
        modules = [entry.point.module for entry in self.added.get(name, ())]
        return not all(map(_being_imported, modules))

    def package(self, name: str) -> str:
        """Return the name of the package that an entry is from, or "" if it is the library's."""
        if name in self.own or name not in self.added:
            return ""
        return self.added[name][0].package


def added(group: str, make: Callable[[EntryPoint], T]) -> dict[str, tuple[PackageEntry[T], ...]]:
    """Return name -> the entries of other packages in a group of entry points."""
    by_name: dict[str, tuple[PackageEntry[T], ...]] = {}
    for point in points(group):
        by_name[point.name] = (*by_name.get(point.name, ()), PackageEntry(point, make))
    return by_name


def imported(kind: type[T], wanted: Callable[[T], bool]) -> Callable[[EntryPoint], T]:
    """Return a function that imports the object that an entry point names, and checks its kind and
    its name.
    """

    def make(point: EntryPoint) -> T:
        entry = point.load()
        if not isinstance(entry, kind) or not wanted(entry):
            raise ScenarioError(f"it is {shown(entry)}: give {KINDS[point.group][1]}")
        if (its_name := NAME(entry)) != point.name:
            raise ScenarioError(f"its own name is {its_name!r}: give the entry point the same name")
        return entry

    return make


def module_spec(point: EntryPoint) -> ModuleSpec:
    """Return the spec of the module that an entry point names.

    It imports only the packages around the module.
    """
    if point.attr:
        raise ScenarioError(f"it is {point.attr!r} in a module: give {KINDS[point.group][1]}")
    if (spec := importlib.util.find_spec(point.module)) is None:
        raise ScenarioError(
            f"there is no module {point.module}: fix, update or uninstall that package"
        )
    if (its_name := point.module.rpartition(".")[2]) != point.name:
        raise ScenarioError(f"its own name is {its_name!r}: give the entry point the same name")
    return spec


@functools.cache
def _points() -> dict[str, list[EntryPoint]]:
    """Return group -> the entry points of all installed packages.

    It reads their metadata, and imports nothing.
    """
    installed = importlib.metadata.entry_points()
    by_group = {}
    for group in installed.groups:
        if group.startswith(PREFIX):
            in_group = installed.select(group=group)
            by_group[group] = sorted(in_group, key=lambda point: (point.name, point.value))
    return by_group


def points(group: str) -> list[EntryPoint]:
    """Return the entry points in a group of all installed packages."""
    return _points().get(group, [])


_warned: set[str] = set()


def warn(message: str) -> None:
    """Warn of a package's entry, once in a process."""
    if message not in _warned:
        _warned.add(message)
        warnings.warn(message, PackageWarning, users_stacklevel())


# finding entries


def modules(package: str) -> Iterator[ModuleType]:
    """Import and yield every module of a package."""
    for info in pkgutil.iter_modules(importlib.import_module(package).__path__):
        yield importlib.import_module(f"{package}.{info.name}")


def discover(package: str, kind: type[T]) -> dict[str, T]:
    """Return name -> object, of every object of a kind at the top level of a package's modules,
    sorted by name.
    """
    values = []
    for module in modules(package):
        for value in vars(module).values():
            if isinstance(value, kind):
                values.append(value)
    return {NAME(value): value for value in sorted(values, key=NAME)}


def file_names(package: str) -> list[str]:
    """Return the names of a package's modules, sorted, without importing them."""
    path = importlib.import_module(package).__path__
    return sorted(info.name for info in pkgutil.iter_modules(path))


class Files(Mapping[str, T_co]):
    """The objects of a kind in a package's modules, one in each and named as it, imported when it
    is asked for.
    """

    def __init__(self, package: str, kind: type[T_co]):
        self.package = package
        self.kind = kind
        self.names = file_names(package)

    def __getitem__(self, name: str) -> T_co:
        if name not in self.names:
            raise KeyError(name)
        module = importlib.import_module(f"{self.package}.{name}")
        for value in vars(module).values():
            if isinstance(value, self.kind) and NAME(value) == name:
                return value
        raise ScenarioError(
            f"{module.__file__} has no {self.kind.__name__} {name!r}: name the file as what it adds"
        )

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


def catalogue_of(
    package: str, kind: type[T], group: str, wanted: Callable[[T], bool] = lambda value: True
) -> Catalogue[T]:
    """Return the objects of a kind in a package's modules, and those of other packages in a group
    of entry points.
    """
    return Catalogue(Files(package, kind), added(group, imported(kind, wanted)))


def subclasses(base: type[T]) -> list[type[T]]:
    """Return every class derived from a base, users' too.

    A class comes before those derived from it.
    """
    below = base.__subclasses__()
    for kind in below:
        below.extend(kind.__subclasses__())
    return below
