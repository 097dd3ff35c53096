"""The machinery of compilation: intrinsics for addresses and calls, and functions compiled so that mistakes show."""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import functools
import re
from collections import namedtuple
from collections.abc import Callable

from llvmlite import ir
from numba import cfunc, njit, types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from smc_mujoco.remade import remade

SIGNATURE = types.int64(types.intp, types.intp, types.intp, types.intp)


class NotCompilable(Exception):
    """Why a function runs in the plain loop instead."""


def _pointer_to(kind: types.Type) -> Callable:
    @intrinsic
    def pointer(typingctx, address):
        def codegen(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(kind).as_pointer())

        return types.CPointer(kind)(types.intp), codegen

    return pointer


pointer = _pointer_to(types.float64)  # an address as a pointer to float64
integers = _pointer_to(types.int64)  # an address as a pointer to int64


@intrinsic
def call(typingctx, address, inputs, parameters, memory, outputs):
    """Call the C function at an address; the status it returns."""

    def codegen(context, builder, signature, args):
        function = ir.FunctionType(ir.IntType(64), [ir.IntType(64)] * 4).as_pointer()
        return builder.call(builder.inttoptr(args[0], function), args[1:])

    return types.int64(*[types.intp] * 5), codegen


@intrinsic
def call_int(typingctx, address, inputs, parameters, memory, outputs):
    """`call` for a C function that returns an int: the rest of the register it comes in is not its own."""

    def codegen(context, builder, signature, args):
        function = ir.FunctionType(ir.IntType(32), [ir.IntType(64)] * 4).as_pointer()
        return builder.sext(builder.call(builder.inttoptr(args[0], function), args[1:]), ir.IntType(64))

    return types.int64(*[types.intp] * 5), codegen


@intrinsic
def attempt(typingctx, body, arguments):
    """(whether body(*arguments) returned, what it returned): an exception ends as False, not in Python."""
    resolved = body.get_call_type(typingctx, tuple(arguments), {})
    returned = resolved.return_type
    for item in returned.types if isinstance(returned, types.BaseTuple) else (returned,):
        if not isinstance(item, types.Integer | types.Float | types.Boolean):
            raise TypingError(f"it returns {returned} instead of numbers")

    def codegen(context, builder, signature, args):
        compiled = body.dispatcher.overloads[resolved.args]
        context.active_code_library.add_linking_library(compiled.library)
        values = [builder.extract_value(args[1], i) for i in range(len(resolved.args))]
        status, result = context.call_internal_no_propagate(builder, compiled.fndesc, resolved, values)
        return context.make_tuple(builder, signature.return_type, [status.is_ok, result])

    return types.Tuple([types.boolean, returned])(body, arguments), codegen


@functools.cache
def named(names: tuple[str, ...]) -> type:
    """The NamedTuple type with these fields; one unused field where there is none."""
    return namedtuple("Parameters", names or ("unused",))


@functools.cache
def loader(kind: type) -> Callable:
    """A compiled function that reads a NamedTuple of floats from an address."""
    record = types.NamedUniTuple(types.float64, len(kind._fields), kind)

    @intrinsic
    def load(typingctx, address):
        def codegen(context, builder, signature, args):
            stored = context.get_value_type(record)
            return builder.load(builder.inttoptr(args[0], stored.as_pointer()), typ=stored)

        return record(types.intp), codegen

    return load


class Function:
    """A compiled C function, kept alive; `address` is where it lies."""

    def __init__(self, body: Callable):
        try:
            self._cfunc = cfunc(SIGNATURE, error_model="numpy")(body)
        except Exception as error:  # numba raises many kinds; each means the same to the caller
            raise NotCompilable(reason(error)) from None
        self.address: int = self._cfunc.address


class AtAddress:
    """What is a C function of the callback's type already.

    Attributes:
      address: where it lies, as long as this lives.
      digest: a hash of its machine code.
    """

    address: int
    digest: str


class Uncompiled:
    """What is Python by its nature; `why` says so of a law, after its name."""

    why: str


# How the lines of numba's errors begin that say where it was, not what it did not like.
WHEREABOUTS = re.compile(
    r"Failed in|No implementation|There are|- Of which|Overload|Intrinsic|With argument|Rejected|"
    r"TypingError: Failed|raised from|During|File |>>>|\[1\]|def |\^|<source"
)


def reason(error: Exception) -> str:
    """The line of a compiler's error that says what it did not like."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip(" ^~.")]
    telling = [line for line in lines if not WHEREABOUTS.match(line)]
    return (telling or lines or [type(error).__name__])[0].removeprefix("TypingError: ")


@functools.cache
def jit(function: Callable) -> Callable:
    """`function`, and whatever compiled functions it calls, compiled to raise out of bounds and at division by zero."""
    try:
        return remade(function, njit(error_model="python", boundscheck=True))
    except Exception as error:
        raise NotCompilable(f"a {type(function).__name__} is not a plain function") from error
