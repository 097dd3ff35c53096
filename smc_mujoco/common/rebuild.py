"""Copies of functions in which every compiled helper is replaced: by one with bounds checks, or by plain Python.

The author of a law may compile its helpers, and numba checks array bounds only on request. So the callback runs a law
with copies of its helpers that are compiled with checks. The reference loop runs it with the helpers' plain Python.
"""

from collections.abc import Callable
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any

from numba.core.dispatcher import Dispatcher


def rebuild(function: Any, finish: Callable[[Any], Any], made: dict[Callable, Any] | None = None) -> Any:
    """Return a copy of a function that calls copies of its compiled helpers.

    Args:
      function: plain Python or compiled.
      finish: function, such as numba.njit, that is called with the plain Python of each copy; its result is used.
      made: function -> its copy, for copies that exist already. New ones are added.
    """
    return _rebuild(getattr(function, "py_func", function), finish, {} if made is None else made)


def _rebuild(function: Any, finish: Callable, made: dict) -> Any:
    if not isinstance(function, FunctionType):
        return finish(function)
    if function not in made and not _calls_compiled(function):
        made[function] = finish(function)
    elif function not in made:
        space, names = dict(function.__globals__), names_in(function.__code__)
        cells = tuple(CellType() for _ in function.__closure__ or ())
        made[function] = finish(FunctionType(function.__code__, space, function.__name__, function.__defaults__, cells))
        # filled in only now, because a function may call itself
        space |= {name: _swapped(space[name], names, finish, made) for name in names & space.keys()}
        for cell, old in zip(cells, function.__closure__ or (), strict=True):
            cell.cell_contents = _swapped(old.cell_contents, names, finish, made)
    return made[function]


def _swapped(value: Any, names: set[str], finish: Callable, made: dict) -> Any:
    """Return what replaces a value in a copy.

    That is a copy of a compiled function, a copy of a module in which compiled functions with these names are copied,
    or else the value itself.
    """
    if isinstance(value, Dispatcher):
        return _rebuild(value.py_func, finish, made)
    if isinstance(value, ModuleType) and _holds(value, names):
        copy = ModuleType(value.__name__)
        for name, thing in vars(value).items():
            vars(copy)[name] = _swapped(thing, set(), finish, made) if name in names else thing
        return copy
    return value


def _calls_compiled(function: FunctionType) -> bool:
    """Return whether a function refers to a compiled function, by name or in a module."""
    names = names_in(function.__code__)
    values = [function.__globals__[name] for name in names if name in function.__globals__]
    values += [cell.cell_contents for cell in function.__closure__ or ()]
    return any(isinstance(v, Dispatcher) or (isinstance(v, ModuleType) and _holds(v, names)) for v in values)


def _holds(module: ModuleType, names: set[str]) -> bool:
    """Return whether a module has a compiled function with one of these names."""
    return any(isinstance(vars(module).get(name), Dispatcher) for name in names)


def names_in(code: CodeType) -> set[str]:
    """Return the names that code uses, and those that functions defined in it use."""
    return set(code.co_names).union(*(names_in(c) for c in code.co_consts if isinstance(c, CodeType)))
