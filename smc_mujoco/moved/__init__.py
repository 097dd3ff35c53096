"""Old names of modules, such as smc_mujoco.law, for one release. They work, with a DeprecationWarning.

This folder is on the package's path, so `from smc_mujoco.law import law_function` finds law.py here.
"""

import importlib
import sys
import types
import warnings


class Moved(types.ModuleType):
    """A module under its old name. If a public function has that name too, the module can be called in its place."""

    def __call__(self, *args: object, **kwargs: object) -> object:
        """Call the public function of this name."""
        return importlib.import_module("smc_mujoco").__getattr__(self.__name__.rpartition(".")[2])(*args, **kwargs)


def forward(old: str, place: str) -> None:
    """Give a module under its old name all that the module in its new place has, and warn of that place."""
    warnings.warn(f"{old} is now {place}: import it from there", DeprecationWarning, stacklevel=3)
    module, home = sys.modules[old], importlib.import_module(place)
    module.__class__, module.__doc__ = Moved, home.__doc__
    vars(module).update({name: value for name, value in vars(home).items() if not name.startswith("__")})
    vars(module)["__getattr__"] = lambda name: getattr(home, name)
