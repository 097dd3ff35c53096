"""How a loop calls the functions of its form: each reads its numbers where `layout` places them.

The functions of a user come compiled: on the processor with checks, so that a law that writes
beyond its memory raises. All functions that are made here are of a View of a run, first.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import functools
import math
from collections import namedtuple
from collections.abc import Callable, Sequence
from typing import Any

from numba import njit, types
from numba.extending import intrinsic, overload

from smc_mujoco.analysis.engine.form import (
    ACTIVE,
    PARAMETERS,
    SETTING,
    STREAM,
    Form,
    PartAt,
    Settings,
    SignalAt,
    layout,
    measured_places,
    parameters,
)
from smc_mujoco.common import fingerprint
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import (
    Key,
    address_of,
    always,
    call,
    compile_for,
    floats,
    inlined,
    named,
    record_in,
)
from smc_mujoco.common.numba_internals import arrayobj, cgutils

Compiler = Callable[[Any], Any]
# A run's numbers, the points of its series, and its state, as pointers.
View = namedtuple("View", ("row", "tables", "work"))
settings_in = record_in(floats(Settings._fields))


def compiled_once(function: Callable) -> Any:
    """Return a function of counts and addresses, compiled, and kept on the disk if all that it uses
    has a hash.
    """
    dispatcher = njit(error_model="numpy", nogil=True)(function)
    try:
        key = Key(function.__module__, fingerprint.now(function))
    except ScenarioError:  # a function that has no hash is compiled in every process
        key = None
    compile_for(dispatcher, (0,) * function.__code__.co_argcount, key)
    return dispatcher


@functools.cache
def reader(names: tuple[str, ...]) -> Callable:
    """Return a compiled function (array, at) -> the numbers from an index on, by these names."""
    values = [f"array[at + {i}]" for i in range(len(names))] or ["0.0"]
    space = {"Parameters": named(names)}
    exec(f"def parameters_at(array, at): return Parameters({', '.join(values)})", space)
    return inlined(space["parameters_at"])


@intrinsic
def array_in(typingctx, numbers, first, count):
    """Return an array (count,) of the numbers from an index on, behind a pointer."""
    array = types.Array(types.float64, 1, "C")

    def codegen(context, builder, signature, args):
        header = cgutils.create_struct_proxy(array)(context, builder)
        eight = context.get_constant(types.intp, 8)
        arrayobj.populate_array(
            header,
            data=builder.gep(args[0], [args[1]]),
            shape=[args[2]],
            strides=[eight],
            itemsize=eight,
            meminfo=None,
        )
        return header._getvalue()

    return array(numbers, types.intp, types.intp), codegen


def signal(signal_at: SignalAt | None, compile_user: Compiler) -> Any:
    """Return a function (view, t, i) -> value, rate and acceleration of a signal in channel i, all
    0 without one; of a signal that sees the loop, (view, t, e, de, s).
    """
    if signal_at is None:
        return always((0.0, 0.0, 0.0))
    kind, first, last = signal_at
    value = compile_user(kind.value)
    values = reader(parameters(kind))
    numbers = first + PARAMETERS
    table = numbers + len(parameters(kind))
    memory_at = last + 1
    memory = kind.memory
    rows = kind.rows

    def random(view, t, i):
        state = array_in(view.work, memory_at + i * memory, memory)
        seed = view.row[SETTING.seed]
        return value(t, values(view.row, numbers), state, seed, float(i), view.row[first + STREAM])

    def series(view, t, i):
        count = int(view.row[table + 1])
        points = array_in(view.tables, int(view.row[table]), rows * count)
        return value(t, values(view.row, numbers), points.reshape((rows, count)))

    def seeing(view, t, e, de, s):
        state = array_in(view.work, memory_at, memory)
        return value(t, values(view.row, numbers), state, e, de, s)

    def plain(view, t, i):
        return value(t, values(view.row, numbers))

    if kind.random:
        return inlined(random)
    if kind.sees:
        return inlined(seeing)
    return inlined(series if kind.series else plain)


def added(at: SignalAt, others: Any, d: int, driven: int, compile_user: Compiler) -> Any:
    """Return a function (view, t, k, seen): add a disturbance to `others`, the sum in each channel
    from place `d` on.

    k is the sample at its first stage, and -1 at all others; a signal that sees the loop reads
    `seen`, its e, e' and s, at a sample.
    """
    evaluate = signal(at, compile_user)
    alone = at.kind.random
    sees = at.kind.sees
    last = at.memory
    active = at.numbers + ACTIVE

    @inlined
    def add(view, t, k, seen):
        others(view, t, k, seen)
        work = view.work
        for i in range(driven if view.row[active] != 0.0 else 0):
            if sees:
                if i == 0 and k >= 0:
                    work[last] = evaluate(view, t, seen[0], seen[1], seen[2])[0]
            elif i == 0 or alone:
                work[last] = evaluate(view, t, i)[0]
            work[d + i] += work[last]

    return add


def acting(part_at: PartAt, compile_user: Compiler) -> Any:
    """Return a function (view, y, i) -> what a part gives channel i for y."""
    part, _, first, memory_at = part_at
    function = compile_user(part.function)
    numbers = reader(part.names)
    memory = part.memory
    size = len(part.names) if part.channels else 0

    @inlined
    def act(view, y, i):
        state = array_in(view.work, memory_at + i * memory, memory)
        return function(y, numbers(view.row, first + i * size), state)

    return act


def by_channel(functions: Sequence[Any], j: int = 0) -> Any:
    """Return a function (view, y, i) that calls the function of channel i, or the last one."""
    function = functions[j]
    if j == len(functions) - 1:
        return function
    further = by_channel(functions, j + 1)

    @inlined
    def choose(view, y, i):
        if i == j:
            return function(view, y, i)
        return further(view, y, i)

    return choose


def channel_law(form: Form, at: PartAt, compile_user: Compiler) -> Any:
    """Return a function (view, y, i) -> u and s of a law of one channel."""
    if at.part.function is not None:
        return acting(at, compile_user)
    ask = calling(form, at)
    size = measured_places(form)
    measured = layout(form).work.measured
    commanded = layout(form).work.commanded

    @inlined
    def in_c(view, y, i):
        for j in range(size):
            view.work[measured + j] = y[j]
        ask(view, i)
        return view.work[commanded], view.work[commanded + 1]

    return in_c


def calling(form: Form, law_at: PartAt) -> Any:
    """Return a function (view, i): call a law in C, which takes addresses, on what was measured."""
    part, address, numbers, memory_at = law_at
    memory = part.memory
    measured = layout(form).work.measured
    commanded = layout(form).work.commanded

    @inlined
    def ask(view, i):
        first = address_of(view.work)
        state = first + 8 * (memory_at + i * memory)
        gains = address_of(view.row) + 8 * numbers
        function = int(view.row[address])
        if call(function, first + 8 * measured, gains, state, first + 8 * commanded) != 0:
            raise ValueError

    return ask


def estimating(at: PartAt, compile_user: Compiler) -> Any:
    """Return a function (view, reading, i) -> the velocity of channel i, and its acceleration: NaN
    if the estimator gives none.
    """
    estimator = acting(at, compile_user)
    return inlined(lambda view, reading, i: _pair(estimator(view, reading, i)))


def _pair(found):
    """Return an estimator's velocity and acceleration, NaN if it gives none."""
    raise NotImplementedError


@overload(_pair)
def _pair_of(found):
    if isinstance(found, types.BaseTuple):
        return lambda found: (found[0], found[1])
    return lambda found: (found, math.nan)
