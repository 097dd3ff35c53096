"""Errors of public calls: an exception of Python becomes a sentence that names the wrong argument.

Public functions check the values of their arguments themselves. This module covers the rest, once for every public
name: when a call raises any other exception, its arguments are compared with the annotations of the signature. The
error then names the first argument that does not fit, its value, and what to give instead. If all arguments fit, the
exception stays as it is. A call without an exception is not checked.

    kind_of(Sequence[float] | None).takes([1.0, "a"])        # False
    kind_of(Sequence[float] | None).one                      # "a list of numbers or None"
"""

import builtins
import contextlib
import functools
import inspect
import itertools
import math
import numbers
import os
import sys
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.errors import MAX_ITEMS, ScenarioError, number, shown, unknown, whole

PACKAGE = "smc_mujoco"
MAX_FILE_NAME = 255  # bytes of a file's name
_explained_types: set[type] = set()  # classes whose methods are wrapped already


def explained(value: Any) -> Any:
    """Return a public function, class or module whose calls name the argument that does not fit.

    Classes and modules are changed in place, and so are the classes of what the functions return.
    """
    if isinstance(value, types.FunctionType):
        value = _explained(value)
        value.__module__ = PACKAGE  # where pickle finds this one
    if isinstance(value, type) and not issubclass(value, BaseException):
        _explain_methods(value)
    if isinstance(value, types.ModuleType):
        for name, held in list(vars(value).items()):
            own = isinstance(held, types.FunctionType) and held.__module__ == value.__name__
            if own and not name.startswith("_") and not hasattr(held, "explains"):
                setattr(value, name, _explained(held))
    return value


def _explain_methods(kind: type) -> None:
    """Replace the public methods of one of our classes by ones whose calls name the argument that does not fit."""
    if kind in _explained_types or kind.__module__.partition(".")[0] != PACKAGE:
        return
    _explained_types.add(kind)
    for name, held in list(vars(kind).items()):
        function = held.__func__ if isinstance(held, classmethod | staticmethod) else held
        if not isinstance(function, types.FunctionType):
            continue
        if name == "__init__" or (not name.startswith("_") and len(function.__annotations__) > 1):
            method = _explained(function, kind)
            setattr(kind, name, method if held is function else type(held)(method))


def _explained(function: Callable, owner: type | None = None) -> Callable:
    """Return a function, or a method of the class `owner`, with its exceptions explained."""

    @functools.wraps(function)
    def call(*args: Any, **named: Any) -> Any:
        with _explaining(function, owner, args, named):
            result = function(*args, **named)
        for one in result[:1] if isinstance(result, list) else (result,):
            _explain_methods(type(one))
        return result

    @functools.wraps(function)
    def iterate(*args: Any, **named: Any) -> Any:
        with _explaining(function, owner, args, named):
            return (yield from function(*args, **named))

    wrapper = iterate if inspect.isgeneratorfunction(function) else call
    wrapper.explains = function  # pyright: ignore[reportFunctionMemberAccess]
    return wrapper


@contextlib.contextmanager
def _explaining(function: Callable, owner: type | None, args: tuple, named: dict[str, Any]) -> Iterator[None]:
    """Turn an exception of a call into the error that names the argument at fault, if there is one."""
    try:
        yield
    except ScenarioError:
        raise
    except Exception:
        if (wrong := _misfit(function, owner, args, named)) is None:
            raise
        raise wrong from None


def _misfit(function: Callable, owner: type | None, args: tuple, named: dict[str, Any]) -> ScenarioError | None:
    """Return the error that names the first argument that is unknown, missing, or does not fit; None if all fit."""
    signature = inspect.signature(function)
    try:
        given = signature.bind(*args, **named).arguments
    except TypeError:
        return _unbound(function, owner, signature, args, named)
    hints = typing.get_type_hints(function, localns=_Names(function.__globals__))
    kinds = {name: kind_of(hint) for name, hint in hints.items()}
    defaults = {name: p.default for name, p in signature.parameters.items() if name in kinds}
    if any(default is None and not kinds[name].takes(None) for name, default in defaults.items()):
        return None  # a Scenario: its annotations are the types that its fields have, not those that it accepts
    for name, value in given.items():
        kind = kinds.get(name)
        if kind and not kind.takes(value):
            broken = isinstance(value, str) and kind.takes("text")
            cure = "shorter text, without NUL or halves of surrogate pairs" if broken else kind.one
            return ScenarioError(f"{name} is {shown(value)}: give {cure}")
    return None


def _unbound(
    function: Callable, owner: type | None, signature: inspect.Signature, args: tuple, named: dict[str, Any]
) -> ScenarioError:
    """Return the error for arguments that a signature does not take."""
    parameters, name, what = list(signature.parameters.values()), function.__name__, "argument"
    if owner is not None:
        name, what = (owner.__name__, "field") if name == "__init__" else (f"{owner.__name__}.{name}", what)
        parameters, args = parameters[1:], args[1:]
    by_name = [p.name for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    by_place = [p.name for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    there = {*by_place[: len(args)], *named}
    required = [p.name for p in parameters if p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    takes_any = any(p.kind is p.VAR_KEYWORD for p in parameters)
    if strange := [key for key in named if key not in by_name and not takes_any]:
        return unknown(f"{what} of {name}", strange[0], by_name)
    if len(args) > len(by_place):
        return ScenarioError(f"{name} takes {len(by_place)} {what}s without a name, not {len(args)}: name the others")
    if missing := [key for key in required if key not in there]:
        return ScenarioError(f"{name} lacks {' and '.join(missing)}: give {missing[0]}=...")
    twice = next(key for key in by_place if key in named)
    return ScenarioError(f"{name} got its {what} {twice!r} twice: give it once")


class _Names(dict):
    """Names in annotations, looked up in the function's module, the public names, then every loaded module."""

    def __missing__(self, name: str) -> Any:
        if hasattr(builtins, name):
            raise KeyError(name)
        package = sys.modules[PACKAGE]
        if name in dir(package):
            return getattr(package, name)
        for module in [module for key, module in list(sys.modules.items()) if key.startswith(f"{PACKAGE}.")]:
            if name in vars(module):
                return vars(module)[name]
        return type(name, (), {})  # a type of a module that is not loaded: no value can be of it


class Kind(NamedTuple):
    """What an annotation asks for: whether a value is that, and the words for one and for several."""

    fits: Callable[[Any], bool]
    one: str
    several: str

    def takes(self, value: Any) -> bool:
        """Return whether a value is of this kind; the items of an iterator are not checked."""
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
    return _text(text) and all(len(part.encode()) <= MAX_FILE_NAME for part in Path(text).parts)


def _number(value: Any) -> bool:
    plain = isinstance(value, float | np.floating) or math.isfinite(float(value))  # raises where an int is too large
    return plain and not isinstance(value, np.ndarray) and number("", value, infinite=True) is not None


def _whole(value: Any) -> bool:
    return isinstance(value, numbers.Integral) and whole("", value, -(2**63), 2**63 - 1) is not None


KINDS: dict[Any, Kind] = {  # annotation -> what it asks for
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
    """Return what an annotation asks for."""
    origin, args = typing.get_origin(hint) or hint, typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        found = _either([kind_of(arm) for arm in args])
    elif origin in KINDS or not isinstance(origin, type):
        found = KINDS.get(origin, KINDS[Any])
    elif getattr(origin, "_is_protocol", False):
        names = sorted(name for name in vars(origin) if not name.startswith("_"))
        words = f"something that has {' and '.join(names)}"
        found = Kind(lambda value: all(hasattr(value, name) for name in names), words, words)
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
    """Return the union of these kinds."""
    if KINDS[os.PathLike] in arms:  # a text that is a path fits it
        arms = [arm for arm in arms if arm is not KINDS[str]]
    one, several = _joined([arm.one for arm in arms]), _joined([arm.several for arm in arms])
    return Kind(lambda value: any(arm.takes(value) for arm in arms), one, several)


def _joined(words: Sequence[str]) -> str:
    """Join words with commas, and "or" before the last."""
    *most, last = dict.fromkeys(words)
    return f"{', '.join(most)} or {last}" if most else last


def _mapping(kinds: Sequence[Kind]) -> Kind:
    """Return the kind of dicts whose keys are of the first kind and whose values are of the second."""
    keys, values = kinds

    def test(value: Any) -> bool:
        return isinstance(value, Mapping) and all(keys.takes(key) and values.takes(item) for key, item in value.items())

    words = f"a dict of {keys.several} and {values.several}"
    return Kind(test, words, words.replace("a dict", "dicts"))


def _several(origin: type, held: list[Kind], count: int | None) -> Kind:
    """Return the kind of lists or iterators of one kind, or of `count` values with a kind each."""

    def test(value: Any) -> bool:
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
            return False
        if not isinstance(value, Sized):
            return not issubclass(origin, Sized)
        if count not in (None, len(value)):
            return False
        kinds = itertools.repeat(held[0]) if count is None and held else held
        items = itertools.islice(value, MAX_ITEMS)  # a long range would take minutes
        return all(kind.takes(item) for kind, item in zip(kinds, items, strict=False))

    plural = held[0].several if held else "values"
    return Kind(test, f"a list of {plural}" if count is None else f"{count} {plural}", f"lists of {plural}")
