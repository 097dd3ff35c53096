"""Checked laws: no cheat is called checked, every honest law is, and the decision costs a run nothing."""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import ctypes
import ctypes.util
import dataclasses
import math
import operator
import time
from collections.abc import Callable
from typing import NamedTuple

import numba
import numpy as np
import pytest
from llvmlite import ir
from numba import carray, objmode
from numba.core import types
from numba.extending import intrinsic, lower_builtin, lower_cast, lower_getattr, overload, overload_attribute
from numba.np.arrayobj import make_array
from numpy import empty

import smc_mujoco as smc
from smc_mujoco.common import numba_internals
from smc_mujoco.common.jit import call, pointer
from smc_mujoco.control import checked, estimator, joint_law, surface
from smc_mujoco.control.law import known_laws

WRITEABLE, FROZEN = np.arange(4.0), np.arange(4.0)
FROZEN.flags.writeable = False
BIG = np.zeros(2**18)  # numba reads arrays of this size in place
BIG.flags.writeable = False
COUNT = 0
ADDRESS = 4096
C_TIME = ctypes.CDLL(ctypes.util.find_library("c")).clock
C_TIME.restype, C_TIME.argtypes = ctypes.c_long, []


@pytest.fixture(autouse=True)
def library_is_examined_too(monkeypatch, library_is_checked):
    """Examine the library's laws here, on which other tests rely."""
    monkeypatch.setattr(checked, "_found", library_is_checked)


@numba.cfunc("float64(float64)")
def from_elsewhere(x):
    return 2.0 * x


@intrinsic
def ticks(typingctx):
    def codegen(context, builder, signature, args):
        kind = ir.FunctionType(ir.IntType(64), [])
        return builder.call(builder.module.declare_intrinsic("llvm.readcyclecounter", fnty=kind), [])

    return types.int64(), codegen


@overload(np.heaviside)
def _heaviside(a, b):
    return lambda a, b: np.lib.stride_tricks.as_strided(a, (10_000,), (8,))[5_000]


@overload(operator.lshift)
def _beyond(a, k):
    if isinstance(a, types.Array):
        return lambda a, k: np.lib.stride_tricks.as_strided(a, (10_000,), (8,))[k]
    return None


@numba.njit
def helper(a):
    return np.random.normal() * a  # noqa: NPY002


CHEATS: dict[str, Callable] = {
    "reads_a_global_array": lambda y, gains, memory: (-y.e * WRITEABLE[1], y.e),
    "reads_an_array_in_place": lambda y, gains, memory: (-y.e * BIG[1], y.e),
    "reads_the_clock": lambda y, gains, memory: (-y.e * time.perf_counter(), y.e),
    "calls_ctypes": lambda y, gains, memory: (-y.e * C_TIME(), y.e),
    "calls_a_pointer": lambda y, gains, memory: (from_elsewhere(y.e), y.e),
    "reads_an_address": lambda y, gains, memory: (carray(pointer(ADDRESS), (1,))[0], y.e),
    "calls_an_address": lambda y, gains, memory: (float(call(ADDRESS, 0, 0, 0, 0)), y.e),
    "beyond_its_memory": lambda y, gains, memory: (carray(pointer(memory.ctypes.data), (10_000,))[5_000], y.e),
    "strides_beyond_its_memory": lambda y, gains, memory: (
        np.lib.stride_tricks.as_strided(memory, (10_000,), (8,))[5_000],
        y.e,
    ),
    "draws": lambda y, gains, memory: (-y.e * np.random.random(), y.e),  # noqa: NPY002
    "draws_in_a_helper": lambda y, gains, memory: (helper(y.e), y.e),
    "counts_cycles": lambda y, gains, memory: (-y.e * ticks(), y.e),
    "reads_what_is_left": lambda y, gains, memory: (np.empty(1000)[500], y.e),
    "fancy_index": lambda y, gains, memory: (memory[np.array([5_000])][0], y.e),
    "overloaded": lambda y, gains, memory: (np.heaviside(memory, memory), y.e),
    "operator_of_an_author": lambda y, gains, memory: (memory << 5_000, y.e),
    # 3 * 6148914691236517208 is 8, the size of the memory, modulo 2^64
    "shape_of_too_many": lambda y, gains, memory: (memory.reshape((3, 6148914691236517208))[0, 5_000], y.e),
    "into_an_array": lambda y, gains, memory: (np.outer(memory, memory, np.zeros((50, 50)))[40, 40], y.e),
    "default_of_a_helper": lambda y, gains, memory: (with_default(y.e), y.e),
    # which is no cheat, but numba does it by an address
    "calls_itself": lambda y, gains, memory: (-y.e * factorial(3), y.e),
}


def cheat(function):
    CHEATS[function.__name__] = function
    return function


@cheat
def counts_in_a_global(y, gains, memory):
    global COUNT  # noqa: PLW0603
    COUNT += 1
    return -y.e * COUNT, y.e


@cheat
def reads_the_key(y, gains, memory):
    with open("noise_key.json") as file:
        return -y.e * len(file.read()), y.e


@cheat
def key_in_object_mode(y, gains, memory):
    with objmode(size="float64"):
        size = float(len(open("noise_key.json").read()))  # noqa: SIM115
    return -y.e * size, y.e


@cheat
def prints(y, gains, memory):
    print(y.x)
    return -y.e, y.e


@cheat
def says_in_an_exception(y, gains, memory):
    if y.t > 1.0:
        raise ValueError(y.x)
    return -y.e, y.e


@cheat
def catches(y, gains, memory):
    try:
        memory[0] = 1.0 / y.e
    except Exception:
        memory[0] = 0.0
    return -memory[0], y.e


@numba.njit
def doubles(a):
    return 2.0 * a


@cheat
def what_is_left_after_a_helper(y, gains, memory):
    k = doubles(y.e)
    return k * empty(1000)[500], y.e


@numba.njit
def with_default(a, table=WRITEABLE):
    return a * table[1]


def made():
    array = np.zeros(3)

    @cheat
    def reads_its_closure_array(y, gains, memory):
        return -y.e * array[0], y.e


made()


@numba.njit
def factorial(k):
    return 1.0 if k < 1 else k * factorial(k - 1)


class LooksAlike(NamedTuple):
    x: np.ndarray
    dynamics: int


def makes_a_handle(y, gains, memory):
    other = joint_law.JointMeasurement(
        y.t, y.dt, y.model, ADDRESS, y.x, y.v, y.e, y.de, y.r, y.dr, y.ddr, y.a, y.limit, y.M, y.h, y.g
    )
    return joint_law.coriolis(other, y.v), y.e


HANDLES = {
    "read": lambda y, gains, memory: (y.e * float(y.dynamics), y.e),
    "read by number": lambda y, gains, memory: (y.e * float(y[3]), y.e),
    "made": makes_a_handle,
    "in what looks alike": lambda y, gains, memory: (joint_law.coriolis(LooksAlike(y.x, ADDRESS), y.v), y.e),
    "in what is named": lambda y, gains, memory: (joint_law.coriolis(w=y.v, y=LooksAlike(y.x, ADDRESS)), y.e),
}


def uses_its_author_s(y, gains, memory):  # what it calls is honest
    return -len(memory) * y.e + math.erfc(y.e) % 3.0, y.e


def clock(context, builder, *rest):
    kind = ir.FunctionType(ir.IntType(64), [])
    now = builder.call(builder.module.declare_intrinsic("llvm.readcyclecounter", fnty=kind), [])
    return builder.sitofp(now, ir.DoubleType())


def instruction(context, builder, *rest):  # LLVM aborts where it cannot read such code: it must not be compiled
    now = builder.asm(ir.FunctionType(ir.IntType(64), []), "rdtsc", "=A,~{rdx}", [], True)
    return builder.sitofp(now, ir.DoubleType())


def beyond(context, builder, kind, value):
    data = make_array(kind)(context, builder, value).data
    return builder.fptosi(builder.load(builder.gep(data, [ir.Constant(ir.IntType(64), 5_000)])), ir.IntType(64))


VECTOR = types.Array(types.float64, 1, "C")
REPLACED = {
    "function": lambda: lower_builtin(math.erfc, types.float64)(clock),
    "instruction": lambda: lower_builtin(math.erfc, types.float64)(instruction),
    "operator": lambda: lower_builtin(operator.mod, types.float64, types.float64)(clock),
    "method": lambda: lower_builtin("array.sum", VECTOR)(lambda c, b, s, v: beyond(c, b, s.args[0], v[0])),
    "length": lambda: lower_builtin(len, VECTOR)(lambda c, b, s, v: beyond(c, b, s.args[0], v[0])),
    "attribute": lambda: lower_getattr(VECTOR, "size")(beyond),
    "overloaded attribute": lambda: overload_attribute(types.Array, "conj")(lambda a: lambda a: a[0]),
    "cast": lambda: lower_cast(types.int64, types.float64)(clock),
}


def definitions():
    """All lists of what numba compiles for its operations and attributes."""
    context, typing = numba_internals.cpu_target.target_context, numba_internals.cpu_target.typing_context
    context.refresh()
    typing.refresh()
    selectors = [*context._defns.values(), *context._getattrs.values(), context._casts]
    return selectors, [*(selector.versions for selector in selectors), *typing._attributes.values()]


@pytest.fixture
def replaced(request):
    """Let an author say what numba compiles for its own operations, and undo it: only what the author has added."""
    before = {id(one) for its in definitions()[1] for one in its}
    request.param()
    added = [one for its in definitions()[1] for one in its if id(one) not in before]
    assert added
    yield
    selectors, lists = definitions()
    for its in lists:
        its[:] = [one for one in its if not any(one is its_own for its_own in added)]
    for selector in selectors:
        selector._cache.clear()
    checked._found.cache_clear()


@pytest.mark.parametrize("replaced", REPLACED.values(), ids=REPLACED, indirect=True)
def test_no_law_is_checked_where_an_author_says_what_numba_compiles(replaced):
    why = smc.law_function(uses_its_author_s)().why_unchecked
    assert why.startswith("law uses_its_author_s is unchecked: it may run ")
    assert why.endswith(", which changes what numba compiles for its own types")


def test_the_law_of_that_test_is_checked_otherwise():
    assert smc.law_function(uses_its_author_s)().why_unchecked == ""


@pytest.mark.parametrize("name", CHEATS)
def test_no_cheat_is_called_checked(name):
    law = smc.law_function(CHEATS[name])()
    assert not law.checked
    assert law.why_unchecked.startswith(f"law {law.name} is unchecked: it ")
    assert "\n" not in law.why_unchecked


@pytest.mark.parametrize("function", HANDLES.values(), ids=HANDLES)
def test_no_law_of_many_joints_gets_at_the_address_of_the_model(function):
    assert not smc.law_function(joint=True)(function)().checked


def test_what_numba_did_not_compile_is_unchecked(tmp_path):
    source = tmp_path / "honest.c"
    source.write_text(
        '#include "smc_law.h"\n'
        "int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out) "
        "{ out[0] = -5.0 * y->e; out[1] = y->e; return 0; }\n"
    )
    assert smc.exchange.law_from_c(source)().why_unchecked == (
        "law honest is unchecked: it is machine code that numba did not compile"
    )


TUPLES = ((1.0, 2.0), (3.0, 4.0))


class Limits(NamedTuple):
    low: float
    high: float


BOTH = Limits(-1.0, 1.0)


@numba.njit
def clipped(a):
    return min(max(a, BOTH.low), BOTH.high)


def helpers(y, gains, memory):
    return -gains.k * clipped(y.e), y.e


def loops(y, gains, memory):
    total = 0.0
    for i, row in enumerate(TUPLES):
        for value in row:
            total += value * i
    k = 0
    while k < len(memory):
        memory[k] = memory[k - 1] + total
        k += 1
    return -gains.k * y.e - memory[-1], y.e


def numpy_scalars(y, gains, memory):
    values = np.array([y.e, y.de, 1.0]) + np.zeros(3)
    values[:2] = np.clip(values[:2], -1.0, 1.0)
    return -gains.k * np.tanh(values[0]) * FROZEN[1] - np.dot(values, values) + np.sign(y.e) * math.hypot(
        y.e, y.de
    ), y.e


def lists(y, gains, memory):
    values = [y.e, y.de]
    values.append(round(y.t / y.dt) % 7)
    return -gains.k * sum(values) + math.floor(y.x) ** 2, y.e


def raises(y, gains, memory):
    if y.e > 1e9:
        raise ValueError("too far")
    return -gains.k * y.e, y.e


def within(y, gains, memory):
    def doubled(a):
        return 2.0 * a

    return -gains.k * doubled(y.e), y.e


def linear_algebra(y, gains, memory):
    A = np.array([[2.0, 1.0], [1.0, 3.0]])
    z = np.linalg.solve(A, np.array([y.e, y.de])) + np.outer(memory, memory)[:2, 0]
    return -gains.k * np.linalg.norm(z) + np.nextafter(y.e, 1.0), y.e


HONEST = [helpers, loops, numpy_scalars, lists, raises, within, linear_algebra]


@pytest.mark.parametrize("function", HONEST, ids=lambda f: f.__name__)
def test_an_honest_law_of_a_user_s_is_checked(function):
    assert smc.law_function(gains={"k": 2.0})(function)().why_unchecked == ""


def test_a_law_of_many_joints_is_checked_with_its_shared_gains():
    @smc.law_function(joint=True, gains={"k": 2.0, "c": smc.control.units.Gain(1.0, shared=True)})
    def product(y, gains, memory):
        memory[:, 0] += y.dt * y.e
        return -gains.k * (y.M @ y.e) - gains.c * joint_law.coriolis(y, y.v) - memory[:, 0], y.e

    assert product().why_unchecked == ""


CATALOGUE = [*known_laws().values(), *surface.catalogue().values(), *estimator.catalogue().values()]


@pytest.mark.parametrize("template", CATALOGUE, ids=lambda t: f"{t.kind}-{t.name}")
def test_the_catalogue_is_checked(template):
    assert template.bind({}).why_unchecked == ""


def test_an_index_beyond_the_memory_ends_the_run():
    @smc.law_function(memory=2)
    def beyond(y, gains, memory):
        return memory[100] + memory[int(1e6 * y.e)], y.e

    law = beyond()
    assert law.checked
    assert smc.run(smc.Scenario(plant="duffing", law=law, duration=0.05)).failure is not None


def longer_in_place(y, gains, memory):
    values = np.zeros(1000)
    values += memory
    return values[900], y.e


def shorter_in_place(y, gains, memory):
    memory += np.ones(1000)
    return memory[0], y.e


def longer_given(y, gains, memory):
    values = np.zeros(1000)
    np.add(memory, memory, values)
    return values[900], y.e


def two_given(y, gains, memory):
    values = np.zeros(1)
    np.divmod(np.ones(1000), 2.0, np.zeros(1000), values)
    return values[0], y.e


@pytest.mark.parametrize("function", [longer_in_place, shorter_in_place, longer_given, two_given])
def test_no_array_is_read_or_written_in_place_beyond_its_end(function):
    trace = smc.run(smc.Scenario(plant="duffing", law=smc.law_function(function)(), duration=0.01))
    assert trace.failure is not None
    assert "raised ValueError" in trace.failure
    assert "broadcast" in trace.failure


def test_arrays_that_fit_are_changed_in_place():
    @smc.law_function
    def fits(y, gains, memory):
        memory[:3] += np.ones(1)
        memory[3:] -= np.arange(5.0)
        memory *= 2.0
        np.multiply(memory, 3.0, memory)
        return memory[0] + memory[7], y.e

    law = fits()
    assert law.checked
    trace = smc.run(smc.Scenario(plant="duffing", law=law, duration=0.01, u_max=1e6, control_period=0.001))
    assert trace.u[:3, 0].tolist() == [-18.0, -126.0, -774.0]


def test_no_vector_shorter_than_the_measurement_goes_to_coriolis():
    def short(y, gains, memory):
        return joint_law.coriolis(y, y.v[:1]), y.e

    trace = smc.run(smc.Scenario(plant="double_pendulum", law=smc.law_function(joint=True)(short)(), duration=0.01))
    assert trace.failure is not None


def test_the_types_are_those_with_which_the_callback_compiles():
    from smc_mujoco.common.jit import jit
    from smc_mujoco.simulation.cfunctions import compile_component

    for law in (smc.law_function(gains={"k": 2.0})(helpers)(), smc.law_function(gains={"k": 2.0})(loops)()):
        assert law.checked
        before = len(vars(jit(law.function))["overloads"])
        compile_component(law)
        assert len(vars(jit(law.function))["overloads"]) == before == 1


def test_the_decision_is_made_once(monkeypatch):
    law = smc.law_function(gains={"k": 2.0})(raises)()
    assert law.checked
    monkeypatch.setattr(checked, "compiled_for", None)
    assert law.checked
    assert dataclasses.replace(law, gains={"k": 5.0}).checked


WORDS = {"a": 1}


class InPython(smc.Signal):
    """A signal that numba cannot compile."""

    @staticmethod
    def value(t, p):
        """A constant."""
        return 0.1 * len(WORDS), 0.0, 0.0


@pytest.mark.filterwarnings("ignore::smc_mujoco.simulation.run.PlainLoopWarning")
def test_a_run_in_python_is_unchecked_though_its_law_is_checked():
    """There a law is what its file makes of it during the run: here another function than was checked."""
    space = {"factor": 1.0}
    exec("def simple(y, gains, memory):\n    return -factor * y.e, y.e", space)
    law = smc.law_function(space["simple"])()
    scenario = smc.Scenario(plant="duffing", law=law, duration=0.01)
    slow = dataclasses.replace(scenario, disturbance=InPython())
    assert law.checked
    assert scenario.checked
    before, python = smc.run(scenario), smc.run(slow)
    space["factor"] = 2.0
    assert not slow.checked
    np.testing.assert_array_equal(smc.run(scenario).u, before.u)
    assert smc.run(slow).u[0, 0] != python.u[0, 0]
