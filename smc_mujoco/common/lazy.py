"""Public names of a package that are imported when they are first used, so that importing the
package costs nothing.
"""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from smc_mujoco.common import annexes

NAMES = re.compile(r"^from (\S+) import (\w+) as \2$", re.MULTILINE)
ALIASES = re.compile(r"^(\w+) = (smc_mujoco\.\S+)$", re.MULTILINE)

MOVED = {  # public modules of versions before the first release
    "audits": ": see smc.claims, smc.identify and smc.accuracy",
    "fidelity": ": see smc.accuracy",
}


class LazyModule(NamedTuple):
    """What a package's `__init__.py` defines; `modules` are public modules, by the names that they
    have here. Without an annex its names are in neither, and say what is missing when used.
    """

    getattr: Callable[[str], object]
    dir: Callable[[], list[str]]
    origins: dict[str, str]  # public name -> its module
    modules: dict[str, str]  # public module -> its full name


def lazy_module(package: str) -> LazyModule:
    """Return the public names of a package, which `__init__.pyi` beside its `__init__.py` lists for
    type checkers, too.

    There, `from module import name as name` is a public name, and `name = smc_mujoco.module` or
    `from package import module as module` a public module.
    """
    own = sys.modules[package]
    stub = Path(own.__file__ or "").with_suffix(".pyi").read_text(encoding="utf-8")
    origins = {name: module for module, name in NAMES.findall(stub)}
    beside = [name for name, module in origins.items() if module == package]
    modules = {name: f"{origins.pop(name)}.{name}" for name in beside} | dict(ALIASES.findall(stub))

    def imported(name: str) -> object:
        """Return a public function, class or module."""
        if name not in origins and name not in modules:
            raise AttributeError(
                f"module {package!r} has no attribute {name!r}{MOVED.get(name, '')}"
            )
        from smc_mujoco.common.gl import mend_gl
        from smc_mujoco.common.interrupts import delay_signals

        mend_gl()
        with delay_signals():
            what = f"{package.replace('smc_mujoco', 'smc', 1)}.{name}"
            module = annexes.module(modules.get(name) or origins[name], what)
        value = module if name in modules else getattr(module, name)
        setattr(own, name, value)
        return value

    def names() -> list[str]:
        return sorted({*here(origins), *here(modules), "__doc__"})

    def here(found: dict[str, str]) -> dict[str, str]:
        present = {}
        for name, module in found.items():
            if not annexes.missing_annex(module):
                present[name] = module
        return present

    return LazyModule(imported, names, here(origins), here(modules))
