"""Names of the package in texts."""

import re

import smc_mujoco as smc
from helpers import annexes


def public_names(text: str) -> list[str]:
    """Return what stands after each "smc." in a text: a name, or a name of one of its modules."""
    modules = "|".join([*smc._LAZY.modules, "exchange"])
    return re.findall(rf"\bsmc\.((?:(?:{modules})\.)?\w+)", text)


def there(name: str) -> bool:
    """Return whether the package has a public name; those of a missing annex are taken for granted."""
    if not annexes.here([name]):
        return True
    home, _, last = name.rpartition(".")
    return hasattr(getattr(smc, home) if home else smc, last)
