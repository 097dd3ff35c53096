"""Hashes of code: of a user's functions, of this package, and of the machine's arithmetic.

    of(my_law.function)  # "5f0c..."; it changes with the function, and with every helper

A function's hash covers its bytecode, constants, defaults, closure and everything that it reaches
by a global name or imports: constants by value, functions by their own code, objects by their class
and by what pickle keeps of them. What it opens, or finds by a text, does not count: `unseen` names
that. Functions and classes of Python and of the numerical packages count by
name, since the versions of those packages are recorded. A law in C counts by its machine code, one
in another file by its content. Names of files, line numbers, comments and docstrings do not count.
Hashes hold for one version of Python.
"""

import contextlib
import dataclasses
import dis
import functools
import hashlib
import io
import itertools
import math
import pickle
import struct
import sys
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np
from numba import types
from numba.extending import is_jitted

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.files import shipped
from smc_mujoco.common.jit import AtAddress
from smc_mujoco.common.numba_internals import builtin_registry
from smc_mujoco.common.rebuild import names_in

PACKAGE = Path(__file__).parents[1]
# folders that are in the package in a wheel, and beside it in a checkout
BESIDE_PACKAGE = ("models", "scenes", "benchmarks")
PAPERS = "benchmarks/papers"
PRESENTATION = (
    "evidence/commands",
    "exchange/commands.py",
    "cli",
)  # files that show results and do not change them
VERSIONED = {
    *sys.stdlib_module_names,
    "numpy",
    "numba",
    "llvmlite",
    "scipy",
    "mujoco",
}  # identified by their version
LOCKS = type(threading.Lock()), type(threading.RLock())  # which no result depends on
# Built-in functions, and functions of modules, that read what no name in the code leads to
BY_TEXT = {"open", "globals", "locals", "vars", "getattr", "eval", "exec", "__import__"}
READERS = {
    "numpy": {"load", "loadtxt", "genfromtxt", "fromfile"},
    "json": {"load"},
    "pickle": {"load"},
    "importlib": {"import_module"},
}
READING_METHODS = {"read_text", "read_bytes"}  # of paths
VALUES = (bool, int, float, complex, str, bytes, type(None), type(...), np.generic, np.ndarray)
VALUES += (tuple, list, set, frozenset, Mapping)


@functools.cache
def arithmetic() -> str:
    """Return a hash of values of the C library's functions on this machine.

    The last bits of these values differ between C libraries, and between processors with and
    without FMA (fused multiply-add). IEEE 754 fixes everything else that a run computes.
    """
    inputs = [1e-3 * 1.01**k for k in range(1000)]  # 1 mrad to 20 rad
    functions = (
        math.sin,
        math.cos,
        math.tan,
        math.atan,
        math.tanh,
        math.exp,
        math.log,
        lambda x: x**0.7,
    )
    values = []
    for function in functions:
        values += map(function, inputs)
    return hashlib.sha256(struct.pack(f"<{len(values)}d", *values)).hexdigest()[:8]


@functools.cache
def package(*without: str) -> str:
    """Return a hash of this package's code, models, gains and papers, without PRESENTATION and some
    folders.
    """
    left_out = (*BESIDE_PACKAGE, *PRESENTATION, *without)
    files = {}
    for path in PACKAGE.rglob("*"):
        name = path.relative_to(PACKAGE)
        if not any(map(name.is_relative_to, left_out)):
            files[name] = path
    for folder in {"models", PAPERS} - {*without}:
        home = shipped(folder)
        for path in home.rglob("*"):
            files[Path(folder, path.relative_to(home))] = path
    digest = hashlib.sha256()
    for name, path in sorted(files.items()):
        if path.suffix in (".py", ".xml", ".json", ".toml"):
            digest.update(name.as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def of(thing: Any) -> str:
    """Return the hash of a function, a class with its methods, a callable object, or a tuple of
    these.

    For functions and classes of this package it is computed once; for others at each call, until
    `keep` keeps it.
    """
    try:
        if thing in _compiled_hashes:
            return _compiled_hashes[thing]
        return _cached(thing) if ours(thing) else now(thing)
    except TypeError:  # not hashable
        return now(thing)


def keep(thing: Any) -> None:
    """Keep the first hash of a function or class that is compiled, because compiled code keeps its
    present globals.
    """
    with contextlib.suppress(ScenarioError):
        _compiled_hashes.setdefault(thing, of(thing))


def now(thing: Any) -> str:
    """Return the hash of a thing as it is now; raises as `of`."""
    buffer = io.BytesIO()
    pickler = _CodePickler(buffer, pickle.DEFAULT_PROTOCOL)
    try:
        pickler.dump(thing)
    except Exception as error:  # whatever an object's own methods raise
        why = " ".join(str(error).split())
        cure = "use plain functions and numbers"
        raise ScenarioError(f"cannot tell {shown(thing)} from others ({why}): {cure}") from None
    digest = hashlib.sha256(buffer.getvalue()).hexdigest()
    if pickler.readers:
        _readers[digest] = pickler.readers
    return digest


def unseen(digest: str) -> dict[str, list[str]]:
    """Return function -> names of what it reads by, of the code of a hash that this process has
    taken: what is read so does not count.
    """
    return _readers.get(digest, {})


def variables(function: Any) -> dict[str, str]:
    """Return name -> hash of each variable that a function reads from outside itself; {} for
    machine code.
    """
    function = _as_written(function)
    if not isinstance(function, FunctionType):
        return {}
    names = names_in(function.__code__)
    reached = _reached(function.__globals__, names.variables, names.attributes, set())
    cells = zip(
        function.__code__.co_freevars, map(_cell_contents, function.__closure__ or ()), strict=True
    )
    hashes = {}
    pairs = zip(reached[::2], reached[1::2], strict=True)
    for name, value in (*pairs, *cells):
        hashes[name] = now(value)
    return hashes


_compiled_hashes: dict[Any, str] = {}  # function or class -> its hash when it was compiled
_readers: dict[str, dict[str, list[str]]] = {}  # hash -> what `unseen` returns
_cached = functools.cache(now)


def ours(thing: Any) -> bool:
    """Return whether a thing is a function or class of this package."""
    return isinstance(thing, FunctionType | type) and (thing.__module__ or "").startswith(
        f"{PACKAGE.name}."
    )


class _CodePickler(pickle._Pickler):
    """Pickler that writes the contents of functions and classes, not their names.

    The result is never loaded.
    """

    def __init__(self, *arguments: Any):
        super().__init__(*arguments)
        self.readers: dict[str, list[str]] = {}  # function -> what it reads by

    def memoize(self, obj: Any) -> None:
        """Note an object as written, except constants: whether equal ones are one object depends on
        the compiler.
        """
        if not isinstance(obj, tuple | str | bytes | CodeType):
            super().memoize(obj)  # pyright: ignore[reportAttributeAccessIssue] of the pickler in Python

    def persistent_id(self, obj: Any) -> str | None:
        """Return the name of an object that is written by its name; None for others."""
        obj = _as_written(obj)
        if isinstance(obj, ModuleType):
            return f"module {obj.__name__}"
        if isinstance(obj, LOCKS):
            return "lock"
        if isinstance(obj, AtAddress):
            return f"machine code {obj.digest}"
        if _versioned(obj):
            return f"{obj.__module__}.{obj.__qualname__}"
        return None

    def reducer_override(self, obj: Any) -> Any:
        """Return how an object is written: its kind, and its contents, which may contain the object
        itself.
        """
        if is_jitted(obj):
            return (str, ("compiled",), [obj.py_func, sorted(obj.targetoptions.items())])
        obj = _as_written(obj)
        kind = ""
        contents: Any = NotImplemented
        if isinstance(obj, FunctionType):
            contents = self._function_contents(obj)
        elif isinstance(obj, MethodType):
            contents = obj.__func__, obj.__self__
        elif isinstance(obj, CodeType):
            names = obj.co_names, obj.co_varnames, obj.co_argcount
            contents = obj.co_code, obj.co_exceptiontable, *names, obj.co_consts
        elif isinstance(obj, type):
            kind = obj.__qualname__
            contents = _class_contents(obj)
        elif isinstance(obj, types.Type):
            contents = obj.key  # not its number, which depends on what numba has compiled before
        elif isinstance(obj, set | frozenset):
            contents = sorted(obj, key=repr)
        elif isinstance(obj, Mapping):
            contents = sorted(obj.items(), key=lambda item: repr(item[0]))
        elif dataclasses.is_dataclass(obj) and hasattr(obj, "digest"):
            # a file counts by its content: its folder does not compare
            values = []
            for field in dataclasses.fields(obj):
                if field.compare:
                    values.append(getattr(obj, field.name))
            contents = [type(obj), *values]
        if contents is NotImplemented:
            return contents
        return (str, (f"{type(obj).__name__} {kind}",), contents)

    def _function_contents(self, function: FunctionType) -> list[Any]:
        """Return everything that a function's result may depend on, and note how it reads what does
        not count.
        """
        if not ours(function) and (readers := _reading(function)):
            self.readers[function.__qualname__] = readers
        names = names_in(function.__code__)
        closure = list(map(_cell_contents, function.__closure__ or ()))
        return [
            _without_docstring(function),
            function.__defaults__,
            function.__kwdefaults__,
            closure,
            *_reached(function.__globals__, names.variables, names.attributes, set()),
            *_imported(function, names.attributes),
            *_overloads(function),
        ]


def _as_written(value: Any) -> Any:
    """Return the function that the user wrote, without its wrappers: compiled, static or cached."""
    if not isinstance(value, FunctionType | MethodType | type):
        for name in ("py_func", "__func__", "__wrapped__"):
            value = getattr(value, name, value)
    return value


def _versioned(thing: Any) -> bool:
    """Return whether a thing is a function or class of a package in VERSIONED."""
    module = getattr(thing, "__module__", None)
    return (
        hasattr(thing, "__qualname__")
        and isinstance(module, str)
        and module.split(".")[0] in VERSIONED
    )


def _imported(function: FunctionType, attributes: set[str]) -> list[Any]:
    """Return what a function reaches in the modules that it imports in its body, as `_reached`
    does. They are imported now: it would do so when it is called.
    """
    if ours(function):
        return []
    parts: list[Any] = []
    for code in _codes(function.__code__):
        instructions = list(dis.get_instructions(code))
        for i, instruction in enumerate(instructions):
            if instruction.opname != "IMPORT_NAME":
                continue
            level, names = (before.argval for before in instructions[i - 2 : i])
            try:
                module = __import__(instruction.argval, function.__globals__, None, names, level)
            except Exception:  # the call says what is wrong
                continue
            parts += _reached({instruction.argval: module}, {instruction.argval}, attributes, set())
    return parts


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield the code of a function, and of those that are defined in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _reading(function: FunctionType) -> list[str]:
    """Return the names by which a function reads what its names do not lead to, sorted."""
    names = names_in(function.__code__)
    space = function.__globals__
    readers = {name for name in BY_TEXT & names.variables if name not in space}
    for code in _codes(function.__code__):
        for variable, attribute in itertools.pairwise(dis.get_instructions(code)):
            if variable.opname == "LOAD_GLOBAL":
                module = getattr(space.get(variable.argval), "__name__", "")
                if attribute.argval in READERS.get(module, ()):
                    readers.add(f"{variable.argval}.{attribute.argval}")
    return sorted(readers | (READING_METHODS & names.attributes))


def _without_docstring(function: FunctionType) -> CodeType:
    """Return a function's code with None in place of its docstring, which is its first constant."""
    code = function.__code__
    if function.__doc__ is None or code.co_consts[:1] != (function.__doc__,):
        return code
    return code.replace(co_consts=(None, *code.co_consts[1:]))


def _overloads(function: FunctionType) -> list[Any]:
    """Return the functions that numba compiles in place of this one, as declared by
    `numba.extending.overload`.
    """
    return _overloads_of(len(builtin_registry.globals)).get(id(function), [])


@functools.lru_cache(maxsize=1)
def _overloads_of(count: int) -> dict[int, list[Any]]:
    """Return the id of a function -> its overloads; numba has registered `count` globals so far."""
    overloads: dict[int, list[Any]] = {}
    for function, kind in builtin_registry.globals:
        for template in getattr(kind, "templates", ()):
            if "_overload_func" in vars(template):
                overloads.setdefault(id(function), []).append(vars(template)["_overload_func"])
    return overloads


def _reached(
    space: Mapping[str, Any], names: set[str], attributes: set[str], known: set[int]
) -> list[Any]:
    """Return the values of some names in a namespace, and of some attributes of the modules among
    those values.
    """
    parts: list[Any] = []
    for name in sorted(names & space.keys()):
        value = space[name]
        parts += [name, value]
        unversioned = (
            isinstance(value, ModuleType) and value.__name__.split(".")[0] not in VERSIONED
        )
        if unversioned and id(value) not in known:
            known.add(id(value))
            parts += _reached(vars(value), attributes, attributes, known)
    return parts


def _cell_contents(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None


def _class_contents(kind: type) -> list[Any]:
    """Return the bases of a class, and the functions and values in its definition. What it has
    from a base and states again does not count: cloudpickle leaves that out.
    """
    parts: list[Any] = []
    stated = dict(vars(kind))
    for base in kind.__bases__:
        if not _versioned(base):
            parts.append(base)
        for name, value in vars(base).items():
            if name in stated and stated[name] is value:
                del stated[name]
    for name, value in sorted(stated.items()):
        content = _as_written(value.fget if isinstance(value, property) else value)
        written = name == "__call__" or not name.startswith("__")
        if written and isinstance(content, (FunctionType, *VALUES)):
            parts += [name, content]
    return parts
