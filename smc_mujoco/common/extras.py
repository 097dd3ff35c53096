"""Optional packages, which an extra such as `pip install 'smc-mujoco[film]'` installs, and errors
if one is missing.
"""

import contextlib
import importlib.util
import sys
from collections.abc import Iterator

from smc_mujoco.common.errors import ScenarioError

LAST_PYTHON = {"dm": (3, 12)}  # extra -> the last Python for which pip can install it


class MissingPackageError(ScenarioError, ImportError):
    """An optional package is missing, or is of another version.

    The message says how to install one that fits.
    """


@contextlib.contextmanager
def extra(name: str, what: str) -> Iterator[None]:
    """Say how to install an extra if an import in the with block fails."""
    try:
        yield
    except (
        ImportError,
        AttributeError,
    ) as error:  # AttributeError: a package is too old for one that imports it
        raise MissingPackageError(
            f"{what} needs an optional package ({error}): {cure(name)}"
        ) from error


@contextlib.contextmanager
def package(name: str, what: str) -> Iterator[None]:
    """Say how to install a package that belongs to no extra if an import in the with block
    fails.
    """
    try:
        yield
    except ImportError as error:
        raise MissingPackageError(f"{what} needs {name} ({error}): pip install {name}") from error


def missing_extra(name: str, what: str, *packages: str) -> str | None:
    """Return None if packages of an extra are installed, else a sentence that says which are
    not.
    """
    absent = []
    for package in packages:
        if importlib.util.find_spec(package) is None:
            absent.append(package)
    if absent:
        return f"{what} needs {' and '.join(absent)}: {cure(name)}"
    return None


def cure(name: str) -> str:
    """Return how to install an extra."""
    last = LAST_PYTHON.get(name, sys.version_info[:2])
    if sys.version_info[:2] > last:
        return f"take Python {'.'.join(map(str, last))}, the last for which pip can install it"
    return f"pip install 'smc-mujoco[{name}]'"
