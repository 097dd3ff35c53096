"""An immutable dict, for data that must not change after they were checked."""

from collections.abc import Mapping
from typing import NoReturn, TypeVar

from smc_mujoco.common.errors import ScenarioError, shown

V = TypeVar("V")


class Frozen(dict[str, V]):
    """A dict that cannot be changed. It can be hashed and pickled."""

    def __hash__(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return hash(frozenset(self.items()))

    def __reduce__(self):
        return type(self), (dict(self),)

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("a checked mapping does not change: make a new one")

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _refuse  # pyright: ignore


def frozen(mapping: Mapping[str, V]) -> Frozen[V]:
    """Return a frozen copy."""
    if not isinstance(mapping, Mapping):
        raise ScenarioError(f"{shown(mapping)} is no mapping: give a dict")
    return Frozen(mapping)
