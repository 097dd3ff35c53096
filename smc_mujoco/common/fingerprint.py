"""A function's code as a hash: two functions that may compute different things have different ones.

    of(my_law.function)        # "5f0c..."; another after an edit of it, or of a helper that it calls

What counts: bytecode, constants, defaults, closed-over values, and whatever it reaches by a global name - constants by
value, functions by their own code, objects by their class and what pickle would keep of them, down to functions and
classes of Python and of the numerical packages, which a version tells. A law in C counts by its machine code. The names
of files, lines and comments do not count. It holds for one version of Python.
"""

import functools
import hashlib
import math
import pickle
import struct
import sys
from collections.abc import Iterable, Iterator, Mapping
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.jit import AtAddress

VERSIONED = {*sys.stdlib_module_names, "numpy", "numba", "scipy", "mujoco"}  # packages told by version, not by code
SIMPLE = (bool, int, float, complex, str, bytes, type(None), type(...), np.generic)
CONTAINERS = (tuple, list, set, frozenset, Mapping)
Seen = dict[int, tuple[int, Any]]  # id -> number, and the thing itself, so that no other one gets its id


@functools.cache
def arithmetic() -> str:
    """How this machine rounds: a hash of what its C library's functions give.

    Their last bits differ between C libraries, and between processors with and without FMA (fused multiply-add); all
    else that a run computes is fixed by IEEE 754.
    """
    inputs = [1e-3 * 1.01**k for k in range(1000)]  # 1 mrad to 20 rad
    functions = math.sin, math.cos, math.tan, math.atan, math.tanh, math.exp, math.log, lambda x: x**0.7
    values = [f(x) for f in functions for x in inputs]
    return hashlib.sha256(struct.pack(f"<{len(values)}d", *values)).hexdigest()[:8]


def of(thing: Any) -> str:
    """The hash of a function, a class (all its methods), an object that can be called, or a tuple of such.

    Raises:
      ScenarioError: it holds what can be neither read nor pickled.
    """
    kept = isinstance(thing, FunctionType | type | tuple)  # anything else may change
    try:
        return _kept(thing) if kept else _of(thing)
    except TypeError:  # not hashable
        return _of(thing)


def _of(thing: Any) -> str:
    digest = hashlib.sha256()
    for piece in _pieces(thing, {}):
        digest.update(f"{len(piece)}:".encode() + piece)
    return digest.hexdigest()


_kept = functools.cache(_of)  # as a compiled law keeps the globals that it was compiled with


def _pieces(thing: Any, seen: Seen) -> Iterator[bytes]:
    """What makes the thing, piece by piece; one met before is told by its number, so that circles end."""
    thing = _written(thing)
    if isinstance(thing, SIMPLE):
        yield f"{type(thing).__name__} {thing!r}".encode()
        return
    if not isinstance(thing, tuple | CodeType):  # of which equal ones may or may not be the same
        if id(thing) in seen:
            yield f"again {seen[id(thing)][0]}".encode()
            return
        seen[id(thing)] = len(seen), thing
    if isinstance(thing, ModuleType):
        yield f"module {thing.__name__}".encode()
    elif _versioned(thing):
        yield f"{thing.__module__}.{getattr(thing, '__qualname__', '')}".encode()
    elif isinstance(thing, FunctionType):
        yield from _function(thing, seen)
    elif isinstance(thing, MethodType):
        yield from _all((thing.__func__, thing.__self__), seen)
    elif isinstance(thing, AtAddress):
        yield f"machine code {thing.digest}".encode()
    elif isinstance(thing, CodeType):
        yield thing.co_code + thing.co_exceptiontable
        yield from _all([*thing.co_names, *thing.co_varnames, thing.co_argcount, *thing.co_consts], seen)
    elif isinstance(thing, type):
        yield from _class(thing, seen)
    elif isinstance(thing, CONTAINERS):
        yield from _container(thing, seen)
    else:
        yield from _object(thing, seen)


def _container(thing: Any, seen: Seen) -> Iterator[bytes]:
    yield type(thing).__name__.encode()
    if isinstance(thing, Mapping):
        for item in sorted(thing.items(), key=lambda item: repr(item[0])):
            yield from _all(item, seen)
    else:
        yield from _all(thing if isinstance(thing, tuple | list) else sorted(thing, key=repr), seen)


def _all(things: Iterable[Any], seen: Seen) -> Iterator[bytes]:
    for thing in things:
        yield from _pieces(thing, seen)
    yield b"end"


def _written(thing: Any) -> Any:
    """The function as it was written, of one that is compiled, a static method, kept results or a public one."""
    thing = getattr(thing, "explains", thing) if isinstance(thing, FunctionType) else thing
    if not isinstance(thing, FunctionType | MethodType | type):
        for name in ("py_func", "__func__", "__wrapped__"):
            thing = getattr(thing, name, thing)
    return thing


def _versioned(thing: Any) -> bool:
    """Whether it is a function or class of a package whose version says what it is."""
    module = getattr(thing, "__module__", None)
    return hasattr(thing, "__qualname__") and isinstance(module, str) and module.split(".")[0] in VERSIONED


def _function(function: FunctionType, seen: Seen) -> Iterator[bytes]:
    yield from _pieces(function.__code__, seen)
    yield from _all((function.__defaults__, function.__kwdefaults__), seen)
    yield from _all((_content(cell) for cell in function.__closure__ or ()), seen)
    names = _names(function.__code__)
    for name in sorted(names & function.__globals__.keys()):
        yield name.encode()
        yield from _reached(function.__globals__[name], names, seen)


def _reached(value: Any, names: set[str], seen: Seen) -> Iterator[bytes]:
    """What a function reaches by these names: a value, and of a module what is in it."""
    known = id(value) in seen
    yield from _pieces(value, seen)
    if isinstance(value, ModuleType) and not known and value.__name__.split(".")[0] not in VERSIONED:
        for name in sorted(names & vars(value).keys()):
            yield name.encode()
            yield from _reached(vars(value)[name], names, seen)


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None


def _names(code: CodeType) -> set[str]:
    """The names that code uses, and the functions within it."""
    return set(code.co_names).union(*(_names(c) for c in code.co_consts if isinstance(c, CodeType)))


def _class(kind: type, seen: Seen) -> Iterator[bytes]:
    """A class by the functions that it was written with, and its bases."""
    yield kind.__qualname__.encode()
    yield from _all((base for base in kind.__bases__ if not _versioned(base)), seen)
    for name, held in sorted(vars(kind).items()):
        value = _written(held.fget if isinstance(held, property) else held)
        written = name == "__call__" or not name.startswith("__")
        if written and isinstance(value, (FunctionType, np.ndarray, *CONTAINERS, *SIMPLE)):
            yield name.encode()
            yield from _pieces(value, seen)


def _object(thing: Any, seen: Seen) -> Iterator[bytes]:
    """Anything else: arrays by their bytes, objects by what pickle would keep of them, functions by their code."""
    yield from _pieces(type(thing), seen)
    if isinstance(thing, np.ndarray) and thing.dtype != object:
        yield f"{thing.dtype} {thing.shape}".encode() + thing.tobytes()
        return
    try:
        reduced = thing.__reduce_ex__(pickle.DEFAULT_PROTOCOL)
        parts = [reduced] if isinstance(reduced, str) else [list(p) if isinstance(p, Iterator) else p for p in reduced]
    except Exception as error:  # whatever its class raises
        why = " ".join(str(error).split())
        raise ScenarioError(
            f"cannot tell {shown(thing)} from others ({why}): use plain functions and numbers"
        ) from None
    yield from _all(parts, seen)
