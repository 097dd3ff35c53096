"""Copies of functions in which every compiled helper is replaced: by one with bounds checks, or by
plain Python.

The author of a law may compile its helpers, and numba checks array bounds only on request. So the
callback runs a law with copies of its helpers that are compiled with checks. A law that is called
in Python runs with the helpers' plain Python.
"""

import dis
import functools
from collections.abc import Callable
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

from numba.extending import is_jitted

# Instructions with the name of a global variable; those of all others have the name of an
# attribute.
OF_VARIABLES = {
    "LOAD_GLOBAL",
    "STORE_GLOBAL",
    "DELETE_GLOBAL",
    "LOAD_NAME",
    "LOAD_FROM_DICT_OR_GLOBALS",
}


class Names(NamedTuple):
    """Names in code: of global variables, and of attributes, of whatever object."""

    variables: set[str]
    attributes: set[str]


def rebuild(
    function: Any, finish: Callable[[Any], Any], copies: dict[Callable, Any] | None = None
) -> Any:
    """Return a copy of a function that calls copies of its compiled helpers."""
    function = getattr(function, "py_func", function)
    if copies is None:
        copies = {}
    if not isinstance(function, FunctionType):
        return finish(function)
    if function not in copies and not _calls_compiled(function):
        copies[function] = finish(function)
    elif function not in copies:
        space = dict(function.__globals__)
        names = names_in(function.__code__)
        cells = tuple(CellType() for _ in function.__closure__ or ())
        copy = FunctionType(
            function.__code__, space, function.__name__, function.__defaults__, cells
        )
        copies[function] = finish(copy)
        # filled in only now, because a function may call itself
        for name in names.variables & space.keys():
            space[name] = _swapped(space[name], names, finish, copies)
        for cell, old in zip(cells, function.__closure__ or (), strict=True):
            cell.cell_contents = _swapped(old.cell_contents, names, finish, copies)
    return copies[function]


def _swapped(value: Any, names: Names, finish: Callable, copies: dict) -> Any:
    """Return the copy of a compiled function, or of a module with such attributes among `names`;
    else the value.
    """
    if is_jitted(value):
        return rebuild(value, finish, copies)
    if isinstance(value, ModuleType) and _holds(value, names.attributes):
        copy = ModuleType(value.__name__)
        for name, attribute in vars(value).items():
            vars(copy)[name] = attribute
            if name in names.attributes:
                vars(copy)[name] = _swapped(attribute, Names(set(), set()), finish, copies)
        return copy
    return value


def _calls_compiled(function: FunctionType) -> bool:
    """Return whether a function refers to a compiled function, by name or in a module."""
    return bool(helpers(function))


def helpers(function: FunctionType) -> list[FunctionType]:
    """Return the compiled functions to which a function refers, by name or in a module, as they
    were written.
    """
    names = names_in(function.__code__)
    values: list[Any] = []
    for value in values_in(function):
        values.append(value)
        if isinstance(value, ModuleType):
            values += list(map(vars(value).get, names.attributes))
    written = []
    for value in values:
        if is_jitted(value):
            written.append(value.py_func)
    return written


def values_in(function: FunctionType) -> list[Any]:
    """Return the values of the global variables and of the closure of a function."""
    names = names_in(function.__code__)
    values: list[Any] = list(map(function.__globals__.get, names.variables))
    return values + [cell.cell_contents for cell in function.__closure__ or ()]


def _holds(module: ModuleType, names: set[str]) -> bool:
    """Return whether a module has a compiled function with one of these names."""
    members: list[Any] = list(map(vars(module).get, names))
    return any(map(is_jitted, members))


@functools.cache
def names_in(code: CodeType) -> Names:
    """Return the names that code uses, and those that functions defined in it use."""
    names = Names(set(), set())
    for instruction in dis.get_instructions(code):
        if instruction.opname in OF_VARIABLES:
            names.variables.add(instruction.argval)
        elif instruction.opcode in dis.hasname:
            names.attributes.add(instruction.argval)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            inner = names_in(constant)
            names.variables.update(inner.variables)
            names.attributes.update(inner.attributes)
    return names
