"""Functions that do not compile, as C functions which the callback calls like compiled ones:
through ctypes, in Python.

A call takes some microseconds and the interpreter's lock. The text of an exception is kept for the
trace's `failure`.
"""

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import measurement_of, stored_dtype
from smc_mujoco.control.law import Measurement
from smc_mujoco.simulation.python_controller import NominalDynamics, PythonComponent, evaluate
from smc_mujoco.simulation.signals import Signal

DOUBLES = ctypes.POINTER(ctypes.c_double)
C_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int64, *[DOUBLES] * 4)


class PythonFunction:
    """A C function that calls `body(y, memory)`, which returns the outputs; `error` is its last
    exception.
    """

    def __init__(self, body: Callable[[Any, Any], Any]):
        self.error: Exception | None = None

        def call(y, _, m, out):
            try:
                for i, number in enumerate(body(y, m)):
                    out[i] = number
            except Exception as error:  # whatever a user's function raises
                self.error = error
                return 1
            return 0

        self._call = C_FUNCTION(call)
        self.address: int = ctypes.cast(self._call, ctypes.c_void_p).value or 0


class Memories(dict[int, np.ndarray]):
    """The memories of a function by address: the same array at each call, which lives as long as
    the run.
    """

    def at(self, m: Any, shape: tuple[int, int]) -> np.ndarray:
        """Return the memory at a pointer."""
        if not shape[1]:
            return np.empty(shape)
        place = ctypes.addressof(m.contents)
        if place in self:
            return self[place]
        return self.setdefault(place, np.ctypeslib.as_array(m, shape))


def of_component(c: Component, n: int, s: Any) -> PythonFunction:
    """Return a law, a surface or an estimator of one run; a law of many joints needs the scenario
    s.
    """
    memories = Memories()
    if c.joint:
        dtype = stored_dtype(n)
        function = PythonComponent(c, n)

        def joint(y, m):
            seen = np.ctypeslib.as_array(y, (dtype.itemsize // 8,)).view(dtype)[0]
            function.memory = memories.at(m, (n, c.memory))
            return np.concatenate(
                function.call_joint(measurement_of(seen, NominalDynamics(s, seen["x"], seen["v"])))
            )

        return PythonFunction(joint)
    record = Reading if c.kind == "estimator" else Measurement
    function = PythonComponent(c, 1)

    def one(y, m):
        function.memory = memories.at(m, (1, c.memory))
        return function(0, record(*y[: len(record._fields)]))

    return PythonFunction(one)


def of_signal(signal: Signal) -> PythonFunction:
    """Return a reference or a disturbance."""

    def value(y, m):
        t, seed, channel, stream, *loop = y[:7]
        if signal.random or signal.sees:
            memory = np.ctypeslib.as_array(m, (max(signal.memory, 1),))
        else:
            memory = None
        if signal.random:
            state = (memory, int(seed), int(channel), stream)
        else:
            state = (memory, *loop) if signal.sees else ()
        return evaluate(signal, t, *state)

    return PythonFunction(value)
