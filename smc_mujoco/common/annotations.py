"""What an annotation asks for: a test of values, and the words of a sentence that asks for one.

kind_of(Sequence[float] | None).takes([1.0, "a"])        # False
kind_of(Sequence[float] | None).one                      # "a list of numbers or None"
"""

import itertools
import math
import numbers
import os
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.errors import MOST, number, whole

LONGEST = 255  # bytes of a file's name


class Kind(NamedTuple):
    """What an annotation asks for: whether a value is that, and the words for one and for several."""

    fits: Callable[[Any], bool]
    one: str
    several: str

    def takes(self, value: Any) -> bool:
        """Whether a value is of this kind; of an iterator the items are not looked at."""
        try:
            return self.fits(value)
        except Exception:  # whatever `number`, `whole` and the value's own methods raise
            return False


def _flag(value: Any) -> bool:
    return isinstance(value, bool | np.bool_) or (isinstance(value, int) and value in (0, 1))


def _text(value: Any) -> bool:
    return isinstance(value, str) and "\0" not in value and value.encode() is not None


def _path(value: Any) -> bool:
    text = os.fspath(value)
    return _text(text) and all(len(part.encode()) <= LONGEST for part in Path(text).parts)


def _number(value: Any) -> bool:
    plain = isinstance(value, float | np.floating) or math.isfinite(float(value))  # an int beyond floats is no number
    return plain and not isinstance(value, np.ndarray) and number("", value, infinite=True) is not None


def _whole(value: Any) -> bool:
    return isinstance(value, numbers.Integral) and whole("", value, -(2**63), 2**63 - 1) is not None


KINDS: dict[Any, Kind] = {
    Any: Kind(lambda value: True, "anything", "anything"),
    bool: Kind(_flag, "True or False", "flags"),
    int: Kind(_whole, "a whole number", "whole numbers"),
    float: Kind(_number, "a number", "numbers"),
    str: Kind(_text, "text", "texts"),
    os.PathLike: Kind(_path, "a path", "paths"),
    types.NoneType: Kind(lambda value: value is None, "None", "None"),
    Callable: Kind(callable, "a function", "functions"),
}


def kind_of(hint: Any) -> Kind:
    """What an annotation asks for."""
    origin, args = typing.get_origin(hint) or hint, typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        found = _either([kind_of(arm) for arm in args])
    elif origin in KINDS or not isinstance(origin, type):
        found = KINDS.get(origin, KINDS[Any])
    elif getattr(origin, "_is_protocol", False):
        asked = sorted(name for name in vars(origin) if not name.startswith("_"))
        words = f"something that has {' and '.join(asked)}"
        found = Kind(lambda value: all(hasattr(value, name) for name in asked), words, words)
    elif issubclass(origin, Mapping):
        found = _mapping([kind_of(arg) for arg in args or (Any, Any)])
    elif issubclass(origin, Iterable) and origin.__module__ in ("builtins", "collections.abc"):
        fixed = origin is tuple and args and args[-1] is not ...
        found = _several(origin, [kind_of(arg) for arg in args if arg is not ...], len(args) if fixed else None)
    else:
        name = origin.__name__
        article = "an" if name[0] in "AEIOU" else "a"
        found = Kind(lambda value: isinstance(value, origin), f"{article} {name}", f"{name}s")
    return found


def _either(arms: Sequence[Kind]) -> Kind:
    """What fits one of the arms."""
    if KINDS[os.PathLike] in arms:  # which takes texts too, if they are paths
        arms = [arm for arm in arms if arm is not KINDS[str]]
    one, several = _joined([arm.one for arm in arms]), _joined([arm.several for arm in arms])
    return Kind(lambda value: any(arm.takes(value) for arm in arms), one, several)


def _joined(words: Sequence[str]) -> str:
    """Words with "or" before the last."""
    *most, last = dict.fromkeys(words)
    return f"{', '.join(most)} or {last}" if most else last


def _mapping(held: Sequence[Kind]) -> Kind:
    """A dict from the first kind to the second."""
    keys, values = held

    def test(value: Any) -> bool:
        items = value.items() if isinstance(value, Mapping) else [(keys, None)]
        return all(keys.takes(key) and values.takes(item) for key, item in items)

    words = f"a dict of {keys.several} and {values.several}"
    return Kind(test, words, words.replace("a dict", "dicts"))


def _several(origin: type, held: list[Kind], count: int | None) -> Kind:
    """A list or an iterator of a kind, or of `count` values each of its own."""

    def test(value: Any) -> bool:
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
            return False
        if not isinstance(value, Sized):
            return not issubclass(origin, Sized)
        if count not in (None, len(value)):
            return False
        kinds = itertools.repeat(held[0]) if count is None and held else held
        items = itertools.islice(value, MOST)  # of a range without end the beginning
        return all(kind.takes(item) for kind, item in zip(kinds, items, strict=False))

    plural = held[0].several if held else "values"
    return Kind(test, f"a list of {plural}" if count is None else f"{count} {plural}", f"lists of {plural}")
