"""An immutable dict: data that were checked cannot change afterwards."""

from collections.abc import Mapping
from typing import NoReturn, TypeVar

V = TypeVar("V")


class Frozen(dict[str, V]):
    """A mapping that reads, compares and prints as a dict, hashes, pickles, and refuses to change."""

    def __hash__(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return hash(frozenset(self.items()))

    def __reduce__(self):
        return type(self), (dict(self),)

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("a checked mapping does not change: make a new one")

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _refuse  # pyright: ignore


def frozen(mapping: Mapping[str, V]) -> Frozen[V]:
    """Return a frozen copy."""
    return Frozen(mapping)
