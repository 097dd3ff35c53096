"""Whether a user's function computes the same compiled as in Python, and the same twice.

Compiled integers have 64 bits and wrap in silence, and numbers of small types add up differently.
So both forms of each function get a few inputs, once a process. Where they differ, the function
counts as one that does not compile, and runs call it in Python. A function that gives other numbers
each time is named in a warning.
"""

import time
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common import fingerprint
from smc_mujoco.common.aliases import Array
from smc_mujoco.common.attended import attended
from smc_mujoco.common.errors import ScenarioWarning, users_stacklevel
from smc_mujoco.common.jit import AtAddress, CompiledFunction, NotCompilable
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import stored_dtype
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware.moments import JointState, Sight
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.simulation import cfunctions, python_functions, state
from smc_mujoco.simulation.signals import Signal

TIMES = 0.0, 1e-3, 0.4, 2.0, 37.3, 40.0, 1e3  # s, of the inputs
SIZES = 0.5, 1e-3, 0.3, 3.0, 40.0, -4.0, -0.1  # of the other numbers at these times
FIXED = {"dt": 1e-3, "h": 1e-3, "limit": 10.0, "model": 1.0, "has_surface": 1.0, "mobility": 1.3}
FIXED |= {"stage": 0.0, "chance": 0.5, "hinge": 1.0, "seed": 7.0, "channel": 0.0, "stream": 1.0}
FIXED |= {"g": 1.3, "dynamics": 0.0}
TOLERANCE = 1e-6  # relative: sums may be added in another order
SLOW = 1e-3  # s for the inputs: a slower function takes some .1 s in Python, and is not compared
FAILURES = ArithmeticError, ValueError, IndexError  # where compiled code may go on in silence
Call = Callable[..., int]  # with the pointers of a C function, see cfunctions


def check_component(c: Component, n: int, driven: int) -> None:
    """Check a law, a surface or an estimator, of a plant of n channels."""
    compiled = cfunctions.compile_component(c)
    if isinstance(compiled, AtAddress) or _needs_no_check(compiled, c.function):
        return
    name = f"{c.kind} {c.name!r}"
    if c.joint:
        python = python_functions.of_joint_law(c, n, driven, NoDynamics)
        joint_inputs = _joint_inputs(n, driven)
        _check(compiled, name, python, joint_inputs, c.numbers(driven), c.memory * n, 2 * n)
        return
    python = python_functions.of_channel_component(c)
    record = Reading if c.kind == "estimator" else Measurement
    inputs = _inputs(record._fields)
    _check(compiled, name, python, inputs, c.numbers(1), c.memory, 2)


def check_signal(signal: Signal) -> None:
    """Check a reference, a disturbance or another signal."""
    compiled = cfunctions.compile_signal(signal)
    if _needs_no_check(compiled, type(signal).value):
        return
    inputs = _inputs(state.INSTANT.names)
    python = python_functions.of_signal(signal)
    numbers = cfunctions.signal_values(signal)
    memory = max(signal.memory, 1)
    _check(compiled, type(signal).__name__, python, inputs, numbers, memory, 3)


def check_part(part: Part, kind: str, numbers: Callable[[], Sequence[float]]) -> None:
    """Check what a part does on one joint, with its numbers of one."""
    compiled = cfunctions.compile_part(part, kind)
    if kind not in cfunctions.OF_JOINTS or _needs_no_check(compiled, getattr(part, kind)):
        return
    record = Sight if kind == "read" else JointState
    inputs = _inputs(record._fields)
    python = python_functions.of_part(part, kind)
    count = cfunctions.OF_JOINTS[kind][1]
    _check(compiled, type(part).__name__, python, inputs, numbers(), part.memory, count)


class NoDynamics:
    """The nominal mechanism of a law of many joints, without forces."""

    def __init__(self, x: Array, v: Array):
        del x, v

    def coriolis(self, w: Array) -> Array:
        """Return zeros, (n,)."""
        return np.zeros(len(w))

    def jacobian(self) -> Array:
        """Raise: there is no tip."""
        raise ValueError("there is no tip")


def _needs_no_check(made: CompiledFunction, function: Any) -> bool:
    """Return whether a function needs no check: it had one, or is of this package."""
    return made.checked or fingerprint.ours(function)


def _input(names: Sequence[str] | None, t: float, size: float) -> Array:
    """Return inputs by name, the same in every process."""
    values = []
    for k, name in enumerate(names or ()):
        wave = np.sin(1.7 * k + 1.0)
        values.append(FIXED.get(name, size * wave))
        if name == "t":
            values[-1] = t
    return np.array(values)


def _inputs(names: Sequence[str] | None) -> list[Array]:
    """Return one set of inputs by name for each time and size."""
    return [_input(names, *instant) for instant in zip(TIMES, SIZES, strict=True)]


def _joint_inputs(n: int, driven: int) -> list[Array]:
    dtype = stored_dtype(n)
    inputs = []
    for t, size in zip(TIMES, SIZES, strict=True):
        names = tuple(map(str, range(dtype.itemsize // 8)))
        numbers = _input(names, t, size)
        record = numbers.view(dtype)[0]
        for name in ("dt", "model", "dynamics", "limit"):
            record[name] = FIXED[name]
        record["t"], record["n"], record["driven"] = t, n, driven
        record["M"] = 1.3 * np.eye(n) + 0.1
        inputs.append(numbers)
    return inputs


def _check(
    function: CompiledFunction,
    name: str,
    python: python_functions.PythonFunction,
    inputs: Sequence[Array],
    numbers: Sequence[float],
    memory: int,
    count: int,
) -> None:
    """Compare a compiled function with itself, and with its Python. Raise NotCompilable if Python
    has to call it.
    """
    function.checked = True
    parameters = np.array([*numbers, 0.0])
    rounds: list[list[Any]] = []
    compiled = python_functions.C_FUNCTION(function.address)

    taken: list[float] = []  # s, of each round: one may be long, as garbage is collected in it

    def measure() -> None:
        for _ in range(2):
            begin = time.thread_time()
            rounds.append(_results(compiled, inputs, parameters, memory, count))
            taken.append(time.thread_time() - begin)

    attended([measure], bool)  # it may never return
    once, twice = rounds
    if not all(map(_agree, once, twice)):
        warnings.warn(
            f"{name} gives other numbers when it is called again with the same inputs, so its runs "
            "cannot be repeated: keep its state in its memory, and let smc.Noise or a disturbance "
            "be what is random",
            ScenarioWarning,
            users_stacklevel(),
        )
        return
    if min(taken) > SLOW:
        return
    with (
        python_functions.hearing_ctrl_c([python]),
        np.errstate(all="ignore"),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        expected = _results(python.call, inputs, parameters, memory, count, python)
    for own, theirs in zip(once, expected, strict=False):  # as far as Python came
        if not _agree(own, theirs):
            function.differs = (
                f"gives {_words(own, count)} compiled and {_words(theirs, count)} in Python, "
                "for the same inputs: compiled integers have 64 bits and wrap, and numbers of "
                "small types add up differently, so write floats, such as 2.0**70"
            )
            raise NotCompilable(f"{name} {function.differs}")


def _results(
    call: Call,
    inputs: Sequence[Array],
    parameters: Array,
    memory: int,
    count: int,
    python: python_functions.PythonFunction | None = None,
) -> list[Array | None]:
    """Return outputs and memory after each of the inputs; None where it fails.

    Python stops where it raises what compiled code cannot: its form may need numba.
    """
    state = np.zeros(memory + 1)
    results: list[Array | None] = []
    for numbers in inputs:
        outputs = np.zeros(count)
        arrays = numbers.copy(), parameters, state, outputs
        pointers = []
        for array in arrays:
            pointers.append(array.ctypes.data_as(python_functions.DOUBLES))
        failed = call(*pointers)
        if python is not None and failed:
            cause = getattr(python.error, "__cause__", None)
            if cause is not None and not isinstance(cause, FAILURES):
                break
        if failed or not np.isfinite(outputs).all():
            state[:] = 0.0
            results.append(None)
        else:
            results.append(np.append(outputs, state))
    return results


def _agree(a: Array | None, b: Array | None) -> bool:
    if a is None or b is None:
        return a is b
    alike = np.allclose(a, b, rtol=TOLERANCE, atol=1e-12, equal_nan=True)
    return bool(alike)


def _words(result: Array | None, count: int) -> str:
    if result is None:
        return "an error or NaN"
    return ", ".join(f"{number:.6g}" for number in result[:count])
