"""What calls of public names are given: where Python would complain, the argument that does not fit is named instead.

A public function checks what it is given where it uses it, and says so in a sentence of its own. For all that it does
not check this module speaks, once for every public name: an exception of Python's is answered by looking at the call's
arguments beside the annotations of the signature. The first that does not fit its annotation is named, with its value
and with what to give. If all of them fit, the exception stays as it is. A call that ends well costs nothing.
"""

import builtins
import functools
import inspect
import sys
import types
import typing
from collections.abc import Callable
from typing import Any

from smc_mujoco.common.annotations import kind_of
from smc_mujoco.common.errors import ScenarioError, shown, unknown

OURS = "smc_mujoco"
_KNOWN: set[type] = set()  # classes whose methods explain themselves


def explained(value: Any) -> Any:
    """A public name as users get it: a function, a class or a module whose calls name the argument that does not fit.

    Classes and modules are changed in place, and so are the classes of what the functions return.
    """
    if isinstance(value, types.FunctionType):
        value = _explained(value)
        value.__module__ = OURS  # where pickle finds this one
    if isinstance(value, type) and not issubclass(value, BaseException):
        _open(value)
    if isinstance(value, types.ModuleType):
        for name, held in list(vars(value).items()):
            own = isinstance(held, types.FunctionType) and held.__module__ == value.__name__
            if own and not name.startswith("_") and not hasattr(held, "explains"):
                setattr(value, name, _explained(held))
    return value


def _open(kind: type) -> None:
    """Make the methods of one of our classes explain themselves."""
    if kind in _KNOWN or kind.__module__.partition(".")[0] != OURS:
        return
    _KNOWN.add(kind)
    for name, held in list(vars(kind).items()):
        function = held.__func__ if isinstance(held, classmethod | staticmethod) else held
        if not isinstance(function, types.FunctionType):
            continue
        asks = name == "__init__" or (not name.startswith("_") and len(function.__annotations__) > 1)
        if asks:
            method = _explained(function, kind)
            setattr(kind, name, method if held is function else type(held)(method))


def _explained(function: Callable, home: type | None = None) -> Callable:
    """The function, or the method of a class, with its exceptions explained."""

    @functools.wraps(function)
    def call(*args: Any, **named: Any) -> Any:
        try:
            result = function(*args, **named)
        except ScenarioError:
            raise
        except Exception:
            if (wrong := _misfit(function, home, args, named)) is None:
                raise
        else:
            for one in result[:1] if isinstance(result, list) else (result,):
                _open(type(one))
            return result
        raise wrong

    @functools.wraps(function)
    def iterate(*args: Any, **named: Any) -> Any:
        try:
            return (yield from function(*args, **named))
        except ScenarioError:
            raise
        except Exception:
            if (wrong := _misfit(function, home, args, named)) is None:
                raise
        raise wrong

    found = iterate if inspect.isgeneratorfunction(function) else call
    found.explains = function  # pyright: ignore[reportFunctionMemberAccess]
    return found


def _misfit(function: Callable, home: type | None, args: tuple, named: dict[str, Any]) -> ScenarioError | None:
    """The error that names the first argument that a call should not have, or lacks, or that does not fit."""
    signature = inspect.signature(function)
    try:
        given = signature.bind(*args, **named).arguments
    except TypeError:
        return _unbound(function, home, signature, args, named)
    kinds = {name: kind_of(hint) for name, hint in _hints(function).items()}
    defaults = {name: p.default for name, p in signature.parameters.items() if name in kinds}
    if any(default is None and not kinds[name].takes(None) for name, default in defaults.items()):
        return None  # a Scenario: its annotations say what fields hold, not what they are made from
    for name, value in given.items():
        kind = kinds.get(name)
        if kind and not kind.takes(value):
            broken = isinstance(value, str) and kind.takes("text")
            cure = "shorter text, without NUL or halves of surrogate pairs" if broken else kind.one
            return ScenarioError(f"{name} is {shown(value)}: give {cure}")
    return None


def _unbound(
    function: Callable, home: type | None, signature: inspect.Signature, args: tuple, named: dict[str, Any]
) -> ScenarioError:
    """The error for arguments that a signature does not take."""
    parameters, name, what = list(signature.parameters.values()), function.__name__, "argument"
    if home is not None:
        name, what = (home.__name__, "field") if name == "__init__" else (f"{home.__name__}.{name}", what)
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
    """The names that annotations use: a module's own, then public ones, then those of any module that is loaded."""

    def __missing__(self, name: str) -> Any:
        if hasattr(builtins, name):
            raise KeyError(name)
        package = sys.modules[OURS]
        if name in dir(package):
            return getattr(package, name)
        for module in [module for key, module in list(sys.modules.items()) if key.startswith(f"{OURS}.")]:
            if name in vars(module):
                return vars(module)[name]
        return type(name, (), {})  # of a module that nobody has loaded: no value is of it


def _hints(function: Callable) -> dict[str, Any]:
    """The annotations of a function's arguments, those resolved that are text."""
    return typing.get_type_hints(function, localns=_Names(function.__globals__))
