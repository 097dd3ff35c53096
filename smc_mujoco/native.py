"""Pure Python functions compiled to C functions that the callback calls by address.

Laws, estimators, signals and nominal models all become one C type,

    int64 f(const double *inputs, const double *parameters, double *memory, double *outputs)

which returns 0, or 1 where the Python function would have raised. Array accesses are bounds-checked: a law that
writes beyond its memory fails, it does not corrupt its neighbour.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import functools
from collections import namedtuple
from collections.abc import Callable

from llvmlite import ir
from numba import carray, cfunc, njit, types
from numba.core.dispatcher import Dispatcher
from numba.core.errors import TypingError
from numba.extending import intrinsic

from smc_mujoco.component import Component
from smc_mujoco.estimators import Reading
from smc_mujoco.law import Measurement
from smc_mujoco.signals import Signal

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
def attempt(typingctx, body, arguments):
    """(whether body(*arguments) returned, what it returned): an exception ends as False, not in Python."""
    resolved = body.get_call_type(typingctx, tuple(arguments), {})
    if not isinstance(resolved.return_type, types.BaseTuple | types.Number | types.Boolean):
        raise TypingError(f"it returns {resolved.return_type} instead of numbers")

    def codegen(context, builder, signature, args):
        compiled = body.dispatcher.overloads[resolved.args]
        context.active_code_library.add_linking_library(compiled.library)
        values = [builder.extract_value(args[1], i) for i in range(len(resolved.args))]
        status, result = context.call_internal_no_propagate(builder, compiled.fndesc, resolved, values)
        return context.make_tuple(builder, signature.return_type, [status.is_ok, result])

    returned = types.Tuple([types.boolean, resolved.return_type])
    return returned(body, arguments), codegen


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
            return builder.load(builder.inttoptr(args[0], context.get_value_type(record).as_pointer()))

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


# How the lines of numba's errors begin that say where it was, not what it did not like.
WHEREABOUTS = (
    *(
        "Failed in",
        "No implementation",
        "There are",
        "- Of which",
        "Overload",
        "Intrinsic",
        "With argument",
        "Rejected",
    ),
    *("TypingError: Failed", "raised from", "During", "File ", ">>>", "[1]", "def ", "^", "<source"),
)


def reason(error: Exception) -> str:
    """The line of a compiler's error that says what it did not like."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip(" ^~.")]
    telling = [line for line in lines if not line.startswith(WHEREABOUTS)]
    return (telling or lines or [type(error).__name__])[0].removeprefix("TypingError: ")


def jit(function: Callable) -> Callable:
    """`function` compiled so that it raises where Python would: out of bounds, divided by zero."""
    if isinstance(function, Dispatcher):
        function = function.py_func
    try:
        return njit(error_model="python", boundscheck=True)(function)
    except Exception as error:
        raise NotCompilable(f"a {type(function).__name__} is not a plain function") from error


@functools.cache
def law(function: Callable, gains: tuple[str, ...], memory: int) -> Function:
    """(y, gains, memory) -> (u, s)."""
    body, measurement, values = jit(function), loader(Measurement), loader(named(gains))

    def native(y, g, m, out):
        ok, result = attempt(body, (measurement(y), values(g), carray(pointer(m), (memory,))))
        if ok:
            u, s = result
            output = carray(pointer(out), (2,))
            output[0], output[1] = u, s
        return not ok

    return Function(native)


@functools.cache
def estimator(function: Callable, gains: tuple[str, ...], memory: int) -> Function:
    """(y, gains, memory) -> velocity."""
    body, reading, values = jit(function), loader(Reading), loader(named(gains))

    def native(y, g, m, out):
        ok, result = attempt(body, (reading(y), values(g), carray(pointer(m), (memory,))))
        if ok:
            carray(pointer(out), (1,))[0] = result
        return not ok

    return Function(native)


@functools.cache
def signal(kind: type[Signal], names: tuple[str, ...]) -> Function:
    """inputs: t, seed, channel, stream -> outputs: value, first and second derivative."""
    body, values = jit(kind.value), loader(named(names))
    random, memory = kind.random, max(kind.memory, 1)

    def native(y, p, m, out):
        i = carray(pointer(y), (4,))
        if random:
            ok, result = attempt(body, (i[0], values(p), carray(pointer(m), (memory,)), i[1], i[2], i[3]))
        else:
            ok, result = attempt(body, (i[0], values(p)))
        if ok:
            r, dr, ddr = result
            output = carray(pointer(out), (3,))
            output[0], output[1], output[2] = r, dr, ddr
        return not ok

    return Function(native)


@functools.cache
def nominal(function: Callable, names: tuple[str, ...]) -> Function:
    """inputs: i, n, x (n,), v (n,) -> outputs: f and g of channel i."""
    body, values = jit(function), loader(named(names))

    def native(y, p, m, out):
        head = carray(pointer(y), (2,))
        i, n = int(head[0]), int(head[1])
        x, v = carray(pointer(y + 16), (n,)), carray(pointer(y + 16 + 8 * n), (n,))
        ok, result = attempt(body, (x, v, i, values(p)))
        if ok:
            f, g = result
            output = carray(pointer(out), (2,))
            output[0], output[1] = f, g
        return not ok

    return Function(native)


def component(c: Component) -> Function:
    """A law or an estimator, compiled.

    Raises:
      NotCompilable: with its name and the compiler's reason.
    """
    compiler = {"law": law, "estimator": estimator}[c.kind]
    return _named(f"{c.kind} {c.name!r}", compiler, c.function, tuple(c.gains), c.memory)


def of_signal(s: Signal) -> Function:
    """A signal, compiled; raises as `component`."""
    return _named(type(s).__name__, signal, type(s), tuple(s.parameters()))


def _named(name: str, compiler: Callable[..., Function], *arguments: object) -> Function:
    try:
        return compiler(*arguments)
    except NotCompilable as error:
        raise NotCompilable(f"{name} does not compile: {error}") from None
    except TypeError:
        raise NotCompilable(f"{name} does not compile: it is not hashable") from None
