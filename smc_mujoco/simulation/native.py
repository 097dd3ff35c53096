"""Pure Python functions compiled to C functions, which the callback calls by address.

Laws, estimators, signals and nominal models all become functions of one C type:

    int64 f(const double *inputs, const double *parameters, double *memory, double *outputs)

It returns 0, or 1 if the function raised an exception. Array accesses are bounds-checked, also in compiled functions
that a law calls, so a law that writes beyond its memory fails instead of overwriting other data. Functions of the
math module do not raise in compiled code. Outside their domain they return NaN, and inf beyond the largest float. If
that reaches u or s, the run ends.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import functools
import math
import re
from collections.abc import Callable

from numba import carray, types
from numba.extending import intrinsic

from smc_mujoco.common import fingerprint
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import (
    AtAddress,
    Function,
    NotCompilable,
    Uncompiled,
    attempt,
    checked,
    floats,
    jit,
    loader,
    named,
    pointer,
    record_at,
)
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import measurement_at
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware.sliding import Sliding
from smc_mujoco.mechanisms.plant import SEEN
from smc_mujoco.simulation.callback import magic
from smc_mujoco.simulation.signals import Signal
from smc_mujoco.simulation.state import INSTANT, RUBBING

SERIES = floats(("address", "count"))  # what follows the parameters of a series: its data
instant_at, rubbing_at, seen_at, series_at = map(record_at, (INSTANT, RUBBING, SEEN, SERIES))


@functools.cache
def _component(function: Callable, kind: str, gains: tuple[str, ...], memory: int) -> Function:
    """Compile (y, gains, memory) -> two numbers; an estimator may return only the velocity."""
    body, inputs, values = jit(function), loader(Reading if kind == "estimator" else Measurement), loader(named(gains))
    estimates = kind == "estimator"

    def native(y, g, m, out):
        ok, result = attempt(body, (inputs(y), values(g), carray(pointer(m), (memory,))))
        if ok:
            if estimates:
                first, second = with_acceleration(result)
            else:
                first, second = result
            output = carray(pointer(out), (2,))
            output[0], output[1] = first, second
        return not ok

    return _made(native, function, kind, gains, memory)


@functools.cache
def _joint(function: Callable, gains: tuple[str, ...], shared: tuple[str, ...], memory: int) -> Function:
    """Compile (y, gains, memory) -> two vectors, of a law of many joints.

    Its inputs are the numbers of a JointMeasurement, its parameters n numbers a gain, its outputs u and s, (n,) each.
    """
    body, values = jit(function), _vectors(gains, shared)

    @checked
    def law(y, g, m, out):
        u, s = body(y, g, m)
        if len(u) != len(y.x) or len(s) != len(y.x):
            raise ValueError
        for i in range(len(u)):
            out[i], out[len(u) + i] = u[i], s[i]
        return 0

    def native(y, g, m, out):
        seen = measurement_at(y)
        n = len(seen.x)
        memories, output = carray(pointer(m), (n, memory)), carray(pointer(out), (2 * n,))
        ok, _ = attempt(law, (seen, values(g, n), memories, output))
        return not ok

    return _made(native, function, gains, shared, memory)


@functools.cache
def _vectors(names: tuple[str, ...], shared: tuple[str, ...]) -> Callable:
    """Return a compiled function (address, n) -> gains by name: a vector (n,) of each, one number of a shared one."""
    vector = "carray(pointer(address + 8 * n * {0}), (n,))"
    read = [(vector + "[0]" * (name in shared)).format(i) for i, name in enumerate(names or ("unused",))]
    space = {"carray": carray, "pointer": pointer, "Gains": named(names)}
    exec(f"def gains_at(address, n): return Gains({', '.join(read)})", space)
    return checked(space["gains_at"])


@intrinsic
def with_acceleration(typingctx, result):
    """Return (v, NaN) for a number v, which is a velocity without acceleration; anything else as it is."""
    if not isinstance(result, types.Float | types.Integer | types.Boolean):
        return result(result), lambda context, builder, signature, args: args[0]
    numbers = types.UniTuple(types.float64, 2)

    def codegen(context, builder, signature, args):
        v = context.cast(builder, args[0], result, types.float64)
        return context.make_tuple(builder, numbers, [v, context.get_constant(types.float64, math.nan)])

    return numbers(result), codegen


@functools.cache
def _signal(kind: type[Signal], names: tuple[str, ...]) -> Function:
    """Compile a record INSTANT -> value, first and second derivative.

    The parameters of a series are followed by the address and the number of its data.
    """
    body, values = jit(kind.value), loader(named(names))
    random, series, memory, behind = kind.random, kind.series, max(kind.memory, 1), 8 * len(names)
    rows, sees = kind.rows, kind.sees

    def native(y, p, m, out):
        now = instant_at(y, 0)
        if random:
            noise = carray(pointer(m), (memory,))
            ok, result = attempt(body, (now.t, values(p), noise, now.seed, now.channel, now.stream))
        elif sees:
            kept = carray(pointer(m), (memory,))
            ok, result = attempt(body, (now.t, values(p), kept, now.e, now.de, now.s))
        elif series:
            data = series_at(p + behind, 0)
            table = carray(pointer(int(data.address)), (rows, int(data.count)))
            ok, result = attempt(body, (now.t, values(p), table))
        else:
            ok, result = attempt(body, (now.t, values(p)))
        if ok:
            r, dr, ddr = result
            output = carray(pointer(out), (3,))
            output[0], output[1], output[2] = r, dr, ddr
        return not ok

    made = _made(native, kind.value, names, random, series, memory, rows, sees)
    fingerprint.hold(kind)
    return made


@functools.cache
def nominal(function: Callable, names: tuple[str, ...]) -> Function:
    """Compile a record SEEN -> f and g of channel i."""
    body, values = jit(function), loader(named(names))

    def native(y, p, m, out):
        seen = seen_at(y, 0)
        x, v = carray(pointer(seen.x), (seen.n,)), carray(pointer(seen.v), (seen.n,))
        ok, result = attempt(body, (x, v, seen.i, values(p)))
        if ok:
            f, g = result
            output = carray(pointer(out), (2,))
            output[0], output[1] = f, g
        return not ok

    return _made(native, function, names)


@functools.cache
def _friction(function: Callable, names: tuple[str, ...]) -> Function:
    """Compile v, motor, load -> what resists, and the bounds of what holds, of a friction by a formula."""
    body, values = jit(function), loader(named(names))

    def native(y, p, m, out):
        rubbing = rubbing_at(y, 0)
        ok, result = attempt(body, (rubbing.v, rubbing.motor, rubbing.load, values(p)))
        if ok:
            f, low, high = result
            output = carray(pointer(out), (3,))
            output[0], output[1], output[2] = f, low, high
        return not ok

    return _made(native, function, names)


def _made(native: Callable, function: Callable, *arguments: object) -> Function:
    """Return a C function of a user's function, kept on disk under its hash and these arguments."""
    made = Function(native, _cached(function, *arguments))
    fingerprint.hold(function)
    return made


def _cached(function: Callable, *arguments: object) -> tuple[str, str] | bool:
    """Return the name and the hash under which a compiled function is kept on disk.

    It is False, for none, if the function has no hash, or if a global of it has changed since it was compiled first, as
    for other gains: the code has the present value.
    """
    function_name = getattr(function, "__qualname__", function.__name__)
    name = re.sub(r"\W+", "-", f"{function.__module__}.{function_name}")
    try:
        known = fingerprint.of(function)
        return known == fingerprint.now(function) and (name, f"{magic()} {known} {arguments}")
    except ScenarioError:
        return False


def component(c: Component) -> Function | AtAddress:
    """Return a law, a surface or an estimator as a C function: compiled, unless it is one already.

    Raises:
      NotCompilable: with its name and the reason of the compiler.
    """
    if isinstance(c.function, AtAddress):
        return c.function
    who = f"{c.kind} {c.name!r}"
    if isinstance(c.function, Uncompiled):
        raise NotCompilable(f"{who} {c.function.why}")
    if c.joint:
        return _named(who, _joint, c.function, tuple(c.gains), c.shared, c.memory)
    return _named(who, _component, c.function, c.kind, tuple(c.gains), c.memory)


def of_signal(s: Signal) -> Function:
    """Return a signal, compiled; raises as `component`."""
    return _named(type(s).__name__, _signal, type(s), tuple(s.parameters()))


def of_friction(f: Sliding) -> Function:
    """Return the formula of a friction, compiled; raises as `component`."""
    return _named(type(f).__name__, _friction, type(f).value, f.names)


def values_of(s: Signal) -> tuple[float, ...]:
    """Return the numbers that a compiled signal reads as its parameters, valid as long as the signal exists."""
    values = tuple(s.parameters().values())
    if not s.series:
        return values
    data = s.data
    if data.shape[:1] != (s.rows,) or data.ndim != 2 or data.dtype != float or not data.flags.c_contiguous:
        raise ScenarioError(
            f"{type(s).__name__}'s data are {data.dtype} of shape {data.shape}: give float64, ({s.rows}, N), "
            "C-contiguous"
        )
    return (*values, float(data.ctypes.data), float(data.shape[1]))


def _named(who: str, compiler: Callable[..., Function], *arguments: object) -> Function:
    """Return what a compiler makes; its errors name the function."""
    try:
        return compiler(*arguments)
    except NotCompilable as error:
        raise NotCompilable(f"{who} does not compile: {error}") from None
    except TypeError:
        raise NotCompilable(f"{who} does not compile: it is not hashable") from None
