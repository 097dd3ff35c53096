"""Old names in a package, kept for one release."""

import importlib
import warnings
from collections.abc import Callable, Mapping


def old_names(package: str, places: Mapping[str, str]) -> Callable[[str], object]:
    """Return a `__getattr__` for a package whose names have moved to other modules.

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
