"""Pure Python functions compiled to C functions that the callback calls by address.

Laws, estimators, signals and nominal models all become one C type,

    int64 f(const double *inputs, const double *parameters, double *memory, double *outputs)

which returns 0, or 1 where the function raised. Array accesses are bounds-checked, also in compiled functions that a
law calls: one that writes beyond its memory fails, it does not corrupt its neighbour. Functions of the math module do
not raise in compiled code: outside their domain they return NaN, beyond the largest float inf; where that reaches u or
s it ends the run.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import functools
import math
from collections.abc import Callable

from numba import carray

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import AtAddress, Function, NotCompilable, Uncompiled, attempt, jit, loader, named, pointer
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.law import Measurement
from smc_mujoco.simulation.signals import Signal


@functools.cache
def law(function: Callable, gains: tuple[str, ...], memory: int) -> Function:
    """(y, gains, memory) -> (u, s); of a surface (s, eq)."""
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
    """(y, gains, memory) -> velocity, or velocity and acceleration."""
    body, reading, values = jit(function), loader(Reading), loader(named(gains))

    def one(y, g, m, out):
        ok, result = attempt(body, (reading(y), values(g), carray(pointer(m), (memory,))))
        if ok:
            output = carray(pointer(out), (2,))
            output[0], output[1] = result, math.nan  # no acceleration
        return not ok

    def two(y, g, m, out):
        ok, result = attempt(body, (reading(y), values(g), carray(pointer(m), (memory,))))
        if ok:
            v, a = result
            output = carray(pointer(out), (2,))
            output[0], output[1] = v, a
        return not ok

    try:
        return Function(one)
    except NotCompilable as error:
        try:
            return Function(two)
        except NotCompilable:
            raise error from None


@functools.cache
def signal(kind: type[Signal], names: tuple[str, ...]) -> Function:
    """inputs: t, seed, channel, stream -> outputs: value, first and second derivative.

    After the parameters of a series follow the address of its data and their count.
    """
    body, values = jit(kind.value), loader(named(names))
    random, series, memory, behind = kind.random, kind.series, max(kind.memory, 1), 8 * len(names)

    def native(y, p, m, out):
        i = carray(pointer(y), (4,))
        if random:
            ok, result = attempt(body, (i[0], values(p), carray(pointer(m), (memory,)), i[1], i[2], i[3]))
        elif series:
            data = carray(pointer(p + behind), (2,))
            ok, result = attempt(body, (i[0], values(p), carray(pointer(int(data[0])), (2, int(data[1])))))
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


def component(c: Component) -> Function | AtAddress:
    """A law, a surface or an estimator, compiled; one that is in C already as it is.

    Raises:
      NotCompilable: with its name and the compiler's reason.
    """
    if isinstance(c.function, AtAddress):
        return c.function
    if isinstance(c.function, Uncompiled):
        raise NotCompilable(f"{c.kind} {c.name!r} {c.function.why}")
    compiler = {"law": law, "surface": law, "estimator": estimator}[c.kind]
    return _named(f"{c.kind} {c.name!r}", compiler, c.function, tuple(c.gains), c.memory)


def of_signal(s: Signal) -> Function:
    """A signal, compiled; raises as `component`."""
    return _named(type(s).__name__, signal, type(s), tuple(s.parameters()))


def values_of(s: Signal) -> tuple[float, ...]:
    """What the compiled signal reads at its parameters' address; good for as long as the signal itself lives.

    Raises:
      ScenarioError: a series whose data are not (2, N) float64, C-contiguous.
    """
    values = tuple(s.parameters().values())
    if not s.series:
        return values
    data = s.data
    if data.shape[:1] != (2,) or data.ndim != 2 or data.dtype != float or not data.flags.c_contiguous:
        raise ScenarioError(
            f"{type(s).__name__}'s data are {data.dtype} of shape {data.shape}: give float64, (2, N), C-contiguous"
        )
    return (*values, float(data.ctypes.data), float(data.shape[1]))


def _named(name: str, compiler: Callable[..., Function], *arguments: object) -> Function:
    try:
        return compiler(*arguments)
    except NotCompilable as error:
        raise NotCompilable(f"{name} does not compile: {error}") from None
    except TypeError:
        raise NotCompilable(f"{name} does not compile: it is not hashable") from None
