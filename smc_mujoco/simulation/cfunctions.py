"""Pure Python functions compiled to C functions, which the callback calls by address.

Laws, estimators, signals and nominal models all become functions of one C type:

    int64 f(const double *inputs, const double *parameters, double *memory, double *outputs)

It returns 0, or 1 if the function raised an exception. Array accesses are bounds-checked, also in
compiled functions that a law calls, so a law that writes beyond its memory fails instead of
overwriting other data. Functions of the math module do not raise in compiled code: they return NaN
outside their domain, and inf beyond the largest float. If such a number reaches u or s, the run
ends.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import functools
import re
from collections.abc import Callable
from typing import Any

from numba import carray, njit

from smc_mujoco.common import fingerprint
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import (
    AtAddress,
    CallsPlain,
    CompiledFunction,
    Key,
    NotCompilable,
    Uncompiled,
    attempting,
    calls_plain,
    checked,
    compile_for,
    floats,
    jit,
    loader,
    named,
    not_inlined,
    pointer,
    record_at,
)
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import head_at, measurement_at
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware.moments import JointState, Sight, part_at, reached
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.plant import SEEN, Plant
from smc_mujoco.simulation.signals import Signal
from smc_mujoco.simulation.state import INSTANT, simulation_at

SERIES = floats(("address", "count"))  # of a series' points; they follow its parameters
instant_at, seen_at, series_at = map(record_at, (INSTANT, SEEN, SERIES))
# Functions of a part on one joint, with what they read and how many numbers they return.
OF_JOINTS = {
    "force": (JointState, 1),
    "steady": (JointState, 1),
    "brake": (JointState, 3),
    "stage_force": (JointState, 2),
    "read": (Sight, 2),
}


@functools.cache
def _compile_pair(
    function: Callable, kind: str, gains: tuple[str, ...], memory: int
) -> CompiledFunction:
    """Compile (y, gains, memory) -> two numbers; an estimator may return only the velocity."""
    body = jit(function)
    inputs = loader(Reading if kind == "estimator" else Measurement)
    values = loader(named(gains))
    attempt = attempting(2, kind == "estimator")

    def native(y, g, m, out):
        return attempt(body, (inputs(y), values(g), carray(pointer(m), (memory,))), out)

    return _stored(native, function)


@functools.cache
def _compile_joint_law(
    function: Callable, gains: tuple[str, ...], shared: tuple[str, ...], memory: int
) -> CompiledFunction:
    """Compile (y, gains, memory) -> two vectors, of a law of many joints.

    Its inputs are the numbers of a JointMeasurement, its parameters one number for each driven
    channel a gain. Its outputs are u and s, (n,) each, of which it writes those of driven channels.
    """
    body = jit(function)
    values = _joint_gains(gains, shared)
    attempt = attempting(0)

    @checked
    def law(y, g, m, driven, out):
        u, s = body(y, g, m)
        if len(u) != driven or len(s) != driven:
            raise ValueError
        for i in range(driven):
            out[i], out[len(y.x) + i] = u[i], s[i]
        return ()

    def native(y, g, m, out):
        seen = measurement_at(y)
        driven = int(head_at(y, 0).driven)
        n = len(seen.x)
        memories = carray(pointer(m), (n, memory))
        output = carray(pointer(out), (2 * n,))
        return attempt(law, (seen, values(g, driven), memories, driven, output), out)

    return _stored(native, function)


@functools.cache
def _joint_gains(names: tuple[str, ...], shared: tuple[str, ...]) -> Callable:
    """Return a compiled function (address, n) -> gains by name: vectors (n,), but numbers for
    shared gains.
    """
    vector = "carray(pointer(address + 8 * n * {0}), (n,))"
    read = []
    for i, name in enumerate(names or ("unused",)):
        gain = vector.format(i)
        if name in shared:
            gain += "[0]"
        read.append(gain)
    space = {
        "carray": carray,
        "pointer": pointer,
        "Gains": named(names),
    }
    exec(f"def gains_at(address, n): return Gains({', '.join(read)})", space)
    return checked(space["gains_at"])


@functools.cache
def _compile_signal(kind: type[Signal], names: tuple[str, ...]) -> CompiledFunction:
    """Compile a record INSTANT -> value, first and second derivative.

    The parameters of a series are followed by the address and the number of its points.
    """
    body = jit(kind.value)
    values = loader(named(names))
    attempt = attempting(3)
    random = kind.random
    series = kind.series
    memory = max(kind.memory, 1)
    parameter_bytes = 8 * len(names)
    rows = kind.rows
    sees = kind.sees

    def native(y, p, m, out):
        now = instant_at(y, 0)
        state = carray(pointer(m), (memory,))
        if random:
            return attempt(body, (now.t, values(p), state, now.seed, now.channel, now.stream), out)
        if sees:
            return attempt(body, (now.t, values(p), state, now.e, now.de, now.s), out)
        if series:
            data = series_at(p + parameter_bytes, 0)
            table = carray(pointer(int(data.address)), (rows, int(data.count)))
            return attempt(body, (now.t, values(p), table), out)
        return attempt(body, (now.t, values(p)), out)

    compiled = _stored(native, kind.value)
    fingerprint.keep(kind)
    return compiled


@functools.cache
def _compile_nominal(function: Callable, names: tuple[str, ...]) -> CompiledFunction:
    """Compile a record SEEN -> f and g of channel i."""
    body = jit(function)
    values = loader(named(names))
    attempt = attempting(2)

    def native(y, p, m, out):
        seen = seen_at(y, 0)
        x = carray(pointer(seen.x), (seen.n,))
        v = carray(pointer(seen.v), (seen.n,))
        return attempt(body, (x, v, seen.i, values(p)), out)

    return _stored(native, function)


@functools.cache
def _compile_part(
    function: Callable, kind: str, names: tuple[str, ...], memory: int
) -> CompiledFunction:
    """Compile what a part does on one joint, one of OF_JOINTS."""
    record, count = OF_JOINTS[kind]
    body = jit(function)
    inputs = loader(record)
    values = loader(named(names))
    attempt = attempting(count)

    def native(y, p, m, out):
        return attempt(body, (inputs(y), values(p), carray(pointer(m), (memory,))), out)

    return _stored(native, function)


@functools.cache
def _compile_act(function: Callable) -> CompiledFunction:
    """Compile what a part does at a stage: of the record of the run, and its PART."""
    body = not_inlined(function)

    def native(address, part, _, __):
        sim = simulation_at(address, 0)
        body(sim, reached(sim.reach), part_at(part, 0))
        return 0

    return _stored(native, function)


@functools.cache
def compile_moment(moment: Any) -> CompiledFunction:
    """Compile what only some runs do at a moment of the control step, a compiled function
    (address, sim, k) -> failure code.

    It is no part of the callback, so only those runs wait for it to compile.
    """

    def native(address, k, _, __):
        return moment(address, simulation_at(address, 0), k)

    return _stored(native, moment.py_func)


def _stored(native: Callable, function: Callable) -> CompiledFunction:
    """Return the C function that calls a user's function. It is kept on disk."""
    compiled = CompiledFunction(native, _key(function, native))
    fingerprint.keep(function)
    return compiled


def cached(function: Callable) -> Callable:
    """Compile a function of numbers and arrays at its first call.

    The code is kept on disk, as for C functions.
    """
    compiled_function = njit(error_model="numpy")(function)

    @functools.wraps(function)
    def call(*arguments: Any) -> Any:
        if not compiled_function.overloads:
            compile_for(compiled_function, arguments, _key(function, function))
        return compiled_function(*arguments)

    return call


def _key(function: Callable, body: Callable) -> Key | None:
    """Return the key on disk of a body that calls a user's function.

    Return None if there is no hash of all that it uses, or if a global has changed since the
    function was first hashed.
    """
    function_name = getattr(function, "__qualname__", function.__name__)
    name = re.sub(r"\W+", "-", f"{function.__module__}.{function_name}")
    try:
        if not fingerprint.ours(function) and fingerprint.of(function) != fingerprint.now(function):
            return None
        return Key(name, fingerprint.now(body))
    except ScenarioError:
        return None


def compile_component(c: Component) -> CompiledFunction | AtAddress:
    """Return a law, a surface or an estimator as a C function; NotCompilable has its name and the
    reason.
    """
    if isinstance(c.function, AtAddress):
        return c.function
    name = f"{c.kind} {c.name!r}"
    if isinstance(c.function, Uncompiled):
        raise NotCompilable(f"{name} {c.function.why}")
    if c.joint:
        return _compile(
            name,
            _compile_joint_law,
            c.function,
            tuple(c.gains),
            c.shared,
            c.memory,
        )
    return _compile(
        name,
        _compile_pair,
        c.function,
        c.kind,
        tuple(c.gains),
        c.memory,
    )


def compile_signal(s: Signal) -> CompiledFunction:
    """Return a signal as a C function; raises as `compile_component`."""
    return _compile(type(s).__name__, _compile_signal, type(s), tuple(s.parameters()))


def compile_nominal(plant: Plant) -> CompiledFunction:
    """Return a plant's nominal model of one equation a channel as a C function; raises as
    `compile_component`.
    """
    name = f"the nominal model of {plant.name}"
    return _compile(name, _compile_nominal, plant.nominal, tuple(plant.parameters))


def compile_part(part: Part, kind: str) -> CompiledFunction:
    """Return a function of a part, see hardware/moments.py, as a C function; raises as
    `compile_component`.
    """
    name = type(part).__name__
    if kind in OF_JOINTS:
        return _compile(name, _compile_part, getattr(part, kind), kind, part.names, part.memory)
    return _compile(name, _compile_act, getattr(part, kind))


def _compile(
    name: str, compiler: Callable[..., CompiledFunction], *arguments: object
) -> CompiledFunction:
    """Return what a compiler makes of these arguments. Its errors begin with the name."""
    try:
        compiled_function = compiler(*arguments)
    except CallsPlain as error:  # numba says the first of them
        plain_calls = calls_plain(arguments[0]) or error
        raise NotCompilable(f"{name} does not compile: {plain_calls}") from None
    except NotCompilable as error:
        raise NotCompilable(f"{name} does not compile: {error}") from None
    except TypeError:
        raise NotCompilable(f"{name} does not compile: it is not hashable") from None
    if compiled_function.differs:
        raise NotCompilable(f"{name} {compiled_function.differs}")
    return compiled_function


def signal_values(s: Signal) -> tuple[float, ...]:
    """Return the numbers that a compiled signal reads as its parameters, valid as long as the
    signal exists.
    """
    values = tuple(s.parameters().values())
    if not s.series:
        return values
    data = s.data
    if (
        data.shape[:1] != (s.rows,)
        or data.ndim != 2
        or data.dtype != float
        or not data.flags.c_contiguous
    ):
        raise ScenarioError(
            f"{type(s).__name__}'s data are {data.dtype} of shape {data.shape}: give float64, "
            f"({s.rows}, N), C-contiguous"
        )
    return (*values, float(data.ctypes.data), float(data.shape[1]))
