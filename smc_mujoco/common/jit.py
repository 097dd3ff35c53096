"""Compilation with numba: intrinsics for addresses and calls, C functions, and laws that check
array bounds.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import contextlib
import functools
import hashlib
import importlib
import itertools
import math
import os
import pickle
import re
import secrets
import sys
import time
from collections import namedtuple
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import TypingError, from_dtype, njit, typeof, types
from numba.extending import intrinsic

from smc_mujoco.common import numba_internals as internals
from smc_mujoco.common.attended import attended
from smc_mujoco.common.errors import ScenarioError, printable
from smc_mujoco.common.files import own, replacing
from smc_mujoco.common.process import free_after_fork
from smc_mujoco.common.rebuild import helpers, names_in, rebuild, values_in
from smc_mujoco.common.text import joined

# For compiled code alone: without wrappers for Python, which take half the time to compile.
not_inlined = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
# The same, copied by LLVM to where it is called: numba's own `inline="always"` takes twice the time
# to compile.
inlined = njit(
    error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True
)
if numba.config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]
    raise ScenarioError(
        "NUMBA_DISABLE_JIT is set, and MuJoCo can call only compiled laws: unset it"
    )

SIGNATURE = types.int64(types.intp, types.intp, types.intp, types.intp)
UNREAD = 30 * 86400.0  # s after which a compiled function is deleted
SEAL_SIZE = hashlib.sha256().digest_size
# Beginnings of lines in numba's errors that say where an error was, not what it was.
WHEREABOUTS = re.compile(
    r"Failed in|No implementation|There are|- Of which|Overload|Intrinsic|With argument|Rejected|"
    r"TypingError: Failed|raised from|During|File |>>>|\[1\]|def |\^|<source"
)
PLAIN_HELPER = re.compile(
    r"Untyped global name '(\w+)': Cannot determine Numba type of <class 'function'>"
)
COLOURS = re.compile(r"\x1b\[[\d;]*m")  # numba writes them if NUMBA_COLOR_SCHEME is set

# When numba loads a function from the disk, it imports the function's module. If that module cannot
# be imported, such as a scene file, numba has stored the name of a placeholder instead.
sys.modules.setdefault(internals.DYNAMIC_MODULE, ModuleType(internals.DYNAMIC_MODULE))

free_after_fork(internals.global_compiler_lock)


class Numbers:
    """Numbers for the functions that this package compiles.

    They count from a random one, so no process repeats them.

    The number is part of a function's symbol, also in code on disk. Numba counts from 1 in every
    process, so a process that loads code of two others would run one function in place of another
    with the same name, types and number (https://github.com/numba/numba/issues/10486).
    """

    FIRST = 2**61  # numba's own count does not come so far

    def __init__(self) -> None:
        self.begin()
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self.begin)

    def begin(self) -> None:
        """Count from another number on."""
        self.count = itertools.count(self.FIRST + secrets.randbits(61))

    @contextlib.contextmanager
    def given(self) -> Iterator[None]:
        """Let numba give these numbers to the functions that it compiles in the block."""
        with internals.global_compiler_lock:
            theirs = internals.FunctionIdentity._unique_ids
            internals.FunctionIdentity._unique_ids = self.count
            try:
                yield
            finally:
                internals.FunctionIdentity._unique_ids = theirs

    def foreign(self, symbol: str) -> bool:
        """Return whether a symbol has a number that is not of this count."""
        return any(int(number) < self.FIRST for number in re.findall(r"B\d+v(\d+)", symbol))


NUMBERS = Numbers()


class NotCompilable(Exception):
    """A function cannot be compiled, and is called in Python. The message says why."""


class CallsPlain(NotCompilable):
    """It calls a function that is not compiled, the first of which the message names."""


def always(value: Any) -> Callable:
    """Return a compiled function that returns this value, whatever its arguments."""
    kind: Any = typeof(value)

    @intrinsic
    def constant(typingctx, *arguments):
        def codegen(context, builder, signature, args):
            return context.get_constant_generic(builder, kind, value)

        return kind(types.StarArgTuple.from_types(arguments)), codegen

    return constant


def _at(kind: types.Type) -> Callable:
    """Return a compiled function that turns an address into a pointer of this type."""

    @intrinsic
    def at(typingctx, address):
        def codegen(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(kind))

        return kind(types.intp), codegen

    return at


pointer = _at(types.CPointer(types.float64))  # an address as a pointer to float64
integers = _at(types.CPointer(types.int64))  # an address as a pointer to int64


@intrinsic
def address_of(typingctx, array):
    """Return the address that a pointer is."""

    def codegen(context, builder, signature, args):
        return builder.ptrtoint(args[0], ir.IntType(64))

    return types.int64(array), codegen


def floats(names: Iterable[str]) -> np.dtype:
    """Return the dtype of a record of float64."""
    return np.dtype([(name, "f8") for name in names], align=True)


def whole_numbers(names: Iterable[str]) -> np.dtype:
    """Return the dtype of a record of int64."""
    return np.dtype([(name, "i8") for name in names])


def record_at(dtype: Any) -> Callable:
    """Return a compiled function (address, i) -> record i of the NumPy array of this dtype at an
    address.
    """
    record = from_dtype(dtype)

    @intrinsic
    def at(typingctx, address, i):
        def codegen(context, builder, signature, args):
            place = builder.add(
                args[0], builder.mul(args[1], ir.Constant(args[1].type, dtype.itemsize))
            )
            return builder.inttoptr(place, context.get_value_type(record))

        return record(types.intp, types.intp), codegen

    return at


def record_in(dtype: Any) -> Callable:
    """Return a compiled function (pointer, i) -> the record of this dtype at number i behind a
    pointer to numbers.
    """
    record = from_dtype(dtype)

    @intrinsic
    def at(typingctx, numbers, i):
        def codegen(context, builder, signature, args):
            return builder.bitcast(builder.gep(args[0], [args[1]]), context.get_value_type(record))

        return record(numbers, types.intp), codegen

    return at


@intrinsic
def beyond(typingctx, numbers, i):
    """Return a pointer to number i behind a pointer."""

    def codegen(context, builder, signature, args):
        return builder.gep(args[0], [args[1]])

    return numbers(numbers, types.intp), codegen


@intrinsic
def store(typingctx, values, address):
    """Write a NamedTuple of floats at an address, where `loader` finds it."""

    def codegen(context, builder, signature, args):
        place = builder.inttoptr(args[1], context.get_value_type(values).as_pointer())
        builder.store(args[0], place)
        return context.get_dummy_value()

    return types.none(values, types.intp), codegen


def _calling(bits: int) -> Callable:
    """Return a compiled function that calls the C function at an address; its status has this many
    bits.
    """

    @intrinsic
    def call(typingctx, address, inputs, parameters, memory, outputs):
        def codegen(context, builder, signature, args):
            function = ir.FunctionType(ir.IntType(bits), [ir.IntType(64)] * 4).as_pointer()
            status = builder.call(builder.inttoptr(args[0], function), args[1:])
            if bits < 64:
                return builder.sext(status, ir.IntType(64))
            return status

        return types.int64(*[types.intp] * 5), codegen

    return call


call = _calling(64)  # (address, inputs, parameters, memory, outputs) -> status
# the same for a C function that returns an int: the register's upper half is undefined
call_int = _calling(32)


@intrinsic
def call_callback(typingctx, address, model, data):
    """Call the C function void(model, data) at an address."""

    def codegen(context, builder, signature, args):
        function = ir.FunctionType(ir.VoidType(), [ir.IntType(64)] * 2).as_pointer()
        builder.call(builder.inttoptr(args[0], function), args[1:])
        return context.get_dummy_value()

    return types.none(*[types.intp] * 3), codegen


@functools.cache
def attempting(count: int, estimates: bool = False) -> Callable:
    """Return a compiled function: it stores the `count` numbers of body(*arguments).

    It returns 1 if body raised, or 0.

    No exception reaches Python. An estimator may return one number, its velocity: its acceleration
    is then NaN.
    """

    @intrinsic
    def attempt(typingctx, body, arguments, outputs):
        resolved = body.get_call_type(typingctx, tuple(arguments), {})
        returned = resolved.return_type
        items = list(returned.types if isinstance(returned, types.BaseTuple) else [returned])  # pyright: ignore[reportAttributeAccessIssue] tuples of numba have it
        if not all(isinstance(item, types.Integer | types.Float | types.Boolean) for item in items):
            kind = str(returned).replace("none", "None")
            raise TypingError(f"it returns {kind} instead of numbers")
        if len(items) != count and not (estimates and len(items) == 1):
            raise TypingError(f"it returns {len(items)} numbers instead of {count}")

        def codegen(context, builder, signature, args):
            compiled = body.dispatcher.overloads[resolved.args]
            context.active_code_library.add_linking_library(compiled.library)
            values = [builder.extract_value(args[1], i) for i in range(len(resolved.args))]
            status, result = context.call_internal_no_propagate(
                builder, compiled.fndesc, resolved, values
            )
            with builder.if_then(status.is_ok):
                single = not isinstance(returned, types.BaseTuple)
                if single:
                    numbers = [result]
                else:
                    numbers = [builder.extract_value(result, i) for i in range(count)]
                stored = []
                for x, item in zip(numbers, items, strict=True):
                    stored.append(context.cast(builder, x, item, types.float64))
                place = builder.inttoptr(args[2], ir.DoubleType().as_pointer())
                for i, x in enumerate([*stored, ir.Constant(ir.DoubleType(), math.nan)][:count]):
                    builder.store(x, builder.gep(place, [ir.Constant(ir.IntType(64), i)]))
            return builder.zext(builder.not_(status.is_ok), ir.IntType(64))

        return types.int64(body, arguments, types.intp), codegen

    return attempt


@functools.cache
def named(names: tuple[str, ...]) -> type:
    """Return the NamedTuple type with these fields; with one unused field if there are none.

    A number whose name is a path, such as "elbow.damping", has a place that compiled code does not
    name.
    """
    return namedtuple("Parameters", names or ("unused",), rename=True)


@functools.cache
def loader(kind: type) -> Callable:
    """Return a compiled function that reads a NamedTuple of floats from an address."""
    record = types.NamedUniTuple(types.float64, len(kind._fields), kind)

    @intrinsic
    def load(typingctx, address):
        def codegen(context, builder, signature, args):
            stored = context.get_value_type(record)
            return builder.load(builder.inttoptr(args[0], stored.as_pointer()), typ=stored)

        return record(types.intp), codegen

    return load


class Key(NamedTuple):
    """By what a compiled function is found on disk."""

    name: str
    used: str  # a hash of all that it uses, see common/fingerprint.py


def compiled_cfunc(signature: Any, body: Callable, key: Key | None = None) -> Any:
    """Return numba's CFunc of a function.

    With a key it is loaded from the disk, or written there.
    """
    options = {"error_model": "numpy"}
    function = internals.CFunc(body, (signature.args, signature.return_type), {}, options)
    if key is not None:
        function._cache = Cache(key)  # pyright: ignore[reportAttributeAccessIssue] numba's own
    _in_thread(function.compile)
    return function


def compile_for(dispatcher: Any, arguments: tuple[Any, ...], key: Key | None) -> None:
    """Compile a function of numba's njit for these types, as `compiled_cfunc` does."""
    if key is not None:
        dispatcher._cache = Cache(key)
    _in_thread(dispatcher.compile, tuple(map(typeof, arguments)))


def _in_thread(work: Callable, *arguments: Any) -> None:
    """Let numba compile in a thread of its own, as it may lose Ctrl-C halfway, or break at it.

    The thread goes on after Ctrl-C, and leaves its result on the disk. What numba raises in it is
    NotCompilable; what the handler of a signal raises meanwhile is not.
    """

    def compiling() -> None:
        try:
            with _compiling():
                work(*arguments)
        except Exception as error:  # numba raises many types
            if plain := PLAIN_HELPER.search(COLOURS.sub("", str(error))):
                raise CallsPlain(_cure([plain[1]])) from None
            raise NotCompilable(reason(error)) from None

    attended([compiling], bool)


@contextlib.contextmanager
def _compiling() -> Iterator[None]:
    """Let numba compile in the block, with this package's numbers, and arrays written in place
    within their bounds.
    """
    with NUMBERS.given():
        _load_numba()
        from numba.np import npyimpl

        theirs = npyimpl.numpy_ufunc_kernel
        npyimpl.numpy_ufunc_kernel = functools.partial(
            _within_bounds, theirs, npyimpl._prepare_argument
        )
        try:
            yield
        finally:
            npyimpl.numpy_ufunc_kernel = theirs


def _within_bounds(kernel, prepare, context, builder, sig, args, ufunc, kind):
    """Write numba's code for a function of whole arrays.

    Where it writes into an array, compare all shapes before.

    Numba's own code for a += b reads beyond the end of b if a is longer.
    """
    arrays = []
    targets = []  # those of them that it writes into
    for i, (value, numba_type) in enumerate(zip(args, sig.args, strict=True)):
        if isinstance(numba_type, types.ArrayCompatible):
            arrays.append(prepare(context, builder, value, numba_type))
            if i >= ufunc.nin:
                targets.append(arrays[-1])
    for target, array in itertools.product(targets, arrays):
        if array.ndim > target.ndim:
            raise TypingError("it writes into an array of fewer dimensions than it reads")
        for own_size, size in zip(reversed(array.shape), reversed(target.shape), strict=False):
            fits = builder.or_(
                builder.icmp_signed("==", own_size, size),
                builder.icmp_signed("==", own_size, own_size.type(1)),
            )
            with builder.if_then(builder.not_(fits), likely=False):
                context.call_conv.return_user_exc(
                    builder, ValueError, ("operands could not be broadcast",)
                )
    return kernel(
        context,
        builder,
        sig,
        args,
        ufunc,
        kind,
    )


def _load_numba() -> None:
    """Load numba's array functions without SciPy's linear algebra, which takes a tenth of a
    process's start.
    """
    with internals.global_compiler_lock:
        if "numba.np.arraymath" not in sys.modules:
            from numba.np import linalg

            ensure_blas, linalg.ensure_blas = linalg.ensure_blas, lambda: None
            try:
                importlib.import_module("numba.np.arraymath")
            finally:
                linalg.ensure_blas = ensure_blas


def cache_folder() -> Path:
    """Return the folder of compiled functions."""
    if folder := getattr(numba.config, "CACHE_DIR", ""):
        return Path(folder)
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(caches, "smc_mujoco", "numba")


class Cache:
    """A compiled function on disk, in place of numba's own cache.

    Numba's own would take it for outdated if a line of its file changed, and for current if a
    function that it calls changed. A damaged file counts as missing, and so does one that another
    user may have written, as a pickle runs code; a full disk is not an error.
    """

    def __init__(self, key: Key):
        self.key = key
        self.folder = cache_folder()

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return numba's result for a signature, or None."""
        target.refresh()
        path = self._path(signature, target.codegen())
        try:
            if not (own(path.parent) and own(path)):
                return None
            content = path.read_bytes()
            os.utime(path)  # read today: see `delete_unread`
        except OSError:
            return None
        result = content[SEAL_SIZE:]
        if _seal(path, result) != content[:SEAL_SIZE]:
            return None
        # a damaged file may raise any exception: compile again
        with contextlib.suppress(Exception):
            return internals.CompileResult._rebuild(target, *pickle.loads(result))
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Write numba's result for a signature, unless no other process could load it."""
        library = result.library
        if library.has_dynamic_globals or not _complete(library):
            return
        path = self._path(signature, library.codegen)
        content = internals.dumps(result._reduce())
        # there may be nowhere to write
        with contextlib.suppress(OSError):
            self.folder.mkdir(0o700, parents=True, exist_ok=True)
            delete_unread(self.folder)
        with contextlib.suppress(OSError, ScenarioError), replacing(path) as file:
            file.write_bytes(_seal(path, content) + content)
            file.chmod(0o600)

    def _path(self, signature: Any, codegen: Any) -> Path:
        """Return the path of a signature's file for this machine."""
        made_by = (self.key.used, str(signature), codegen.magic_tuple(), numba.__version__)
        digest = hashlib.sha256(repr(made_by).encode()).hexdigest()
        # a file's name has 255 bytes at most
        return self.folder / f"{self.key.name[:80]}-{digest[:32]}.code"


@functools.cache
def delete_unread(folder: Path) -> None:
    """Delete the compiled functions of a folder that no process has read for 30 days."""
    oldest = time.time() - UNREAD
    for path in folder.glob("*.code"):
        with contextlib.suppress(OSError):  # another process may delete it, too
            if path.stat().st_mtime < oldest:
                path.unlink()


def _seal(path: Path, content: bytes) -> bytes:
    """Return a hash of a file's name and content."""
    return hashlib.sha256(path.name.encode() + content).digest()


def _complete(library: Any) -> bool:
    """Return whether code is complete before it is linked, so that another process can load it,
    beside any other.

    Numba fills in some addresses while it links, such as that of a function that calls itself, and
    only in the process that compiles. A process that loads such code from the disk would abort. A
    function that numba compiled outside of this package has one of numba's own numbers.
    """
    module = library._final_module
    for variable in module.global_variables:
        if variable.name.startswith(internals.UNRESOLVED):
            return False
    defined = []
    for function in module.functions:
        if not function.is_declaration:
            defined.append(function.name)
    return not any(map(NUMBERS.foreign, defined))


class CompiledFunction:
    """A compiled C function, kept alive, and its `address`. For `key` see `compiled_cfunc`.

    Whether it was `checked` for how it `differs` from its Python is of simulation/agreement.py.
    """

    checked = False
    differs = ""

    def __init__(self, body: Callable, key: Key | None = None):
        self._cfunc = compiled_cfunc(SIGNATURE, body, key)
        self.address: int = self._cfunc.address  # pyright: ignore[reportAttributeAccessIssue] numba's own


class AtAddress:
    """Base of laws that are C functions, and already have the signature that the callback calls."""

    address: int  # of the function, valid as long as this object lives
    digest: str  # a hash of its machine code


class Uncompiled:
    """Base of laws that only run in Python.

    `why` is the reason, worded to follow the law's name.
    """

    why: str

    def __call__(self, y: Any, gains: Any, memory: Any) -> tuple[float, float]:
        """Return u and s."""
        raise NotImplementedError

    def fresh(self) -> "Uncompiled":
        """Return what one channel of one run calls: itself, if it keeps no state outside of the
        memory.
        """
        return self


def reason(error: Exception) -> str:
    """Return the line of a compiler's error that says what is wrong, printable even if it quotes a
    user's text.
    """
    first = ""
    for line in map(str.strip, COLOURS.sub("", str(error)).splitlines()):
        if line.strip(" ^~."):
            first = first or line
            if not WHEREABOUTS.match(line):
                first = line
                break
    return printable((first or type(error).__name__).removeprefix("TypingError: "))


def calls_plain(function: Any) -> str:
    """Return the plain functions that a function calls, also by others, with the cure; "" if it
    names none.
    """
    names: dict[str, None] = {}
    unread = [function]
    seen = []
    while unread:
        caller = unread.pop(0)
        if not isinstance(caller, FunctionType) or caller in seen:
            continue
        seen.append(caller)
        unread += helpers(caller)
        for value in values_in(caller):
            if isinstance(value, FunctionType) and not value.__module__.startswith("smc_mujoco."):
                names[value.__name__] = None
                unread.append(value)
    return _cure([*names]) if names else ""


def _cure(names: Sequence[str]) -> str:
    """Return that these plain functions are called, with the cure."""
    what = "a plain function" if len(names) == 1 else "plain functions"
    return f"it calls {joined(names)}, {what}: put @numba.njit on {joined(names)}"


# Raises out of bounds and at division by zero. Without wrappers for Python, which would take half
# the time to compile.
OPTIONS: dict[str, Any] = {"error_model": "python", "boundscheck": True}
OPTIONS |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
checked = njit(**OPTIONS)
# of numpy: numba compiles them without checks of bounds
UNCHECKED = "flat", "bincount", "as_strided", "take_along_axis"
_shared: dict[Callable, Any] = {}  # this package's own helpers, compiled once for all laws


@functools.cache
def jit(function: Callable) -> Callable:
    """Compile a function, and the compiled functions that it calls, to raise out of bounds and at
    division by zero.
    """
    if isinstance(function, FunctionType):
        _refuse_unchecked(function, ())
    with internals.global_compiler_lock:
        copies = dict(_shared)
        try:
            copied = rebuild(function, checked, copies)
        except Exception as error:
            raise NotCompilable(f"a {type(function).__name__} is not a plain function") from error
        # shared only now: after an exception the copies may lack functions that they call
        for original, copy in copies.items():
            if (original.__module__ or "").startswith("smc_mujoco."):
                _shared[original] = copy
        return copied


def _refuse_unchecked(function: FunctionType, callers: tuple[FunctionType, ...]) -> None:
    """Raise NotCompilable for what compiled code would do without a check, here and in the compiled
    functions that are called: it would end the process, or read what is not the law's.
    """
    if function in callers:
        raise NotCompilable(
            f"{function.__name__} calls itself, and compiled code has no bound on how often"
        )
    names = names_in(function.__code__)
    used = names.variables | names.attributes
    for value in values_in(function):
        used.add(getattr(value, "__name__", ""))
    for name in UNCHECKED:
        if name in used:
            raise NotCompilable(f"it uses {name}, whose indices compiled code does not check")
    for helper in helpers(function):
        if not (helper.__module__ or "").startswith("smc_mujoco."):
            _refuse_unchecked(helper, (*callers, function))
