"""Old names that a package hands on for one release."""

import importlib
import warnings
from collections.abc import Callable, Mapping


def old_names(package: str, places: Mapping[str, str]) -> Callable[[str], object]:
    """Return the `__getattr__` of a package whose names are in other modules now.

    Args:
      package: its name.
      places: old name -> the module that has it now.
    """

    def find(name: str) -> object:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        place = f"{places[name]}.{name}"
        warnings.warn(f"{package}.{name} is now {place}: import it from there", DeprecationWarning, stacklevel=2)
        return getattr(importlib.import_module(places[name]), name)

    return find
