"""The functions of a run, called in Python: laws, estimators, surfaces, signals, nominal models and
parts.

What does not compile becomes a C function that calls Python through ctypes, in some microseconds.
The callback calls it as a compiled one. `Controller`, by which agents act, calls the same functions
directly.
"""

import contextlib
import ctypes
import functools
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common import jit
from smc_mujoco.common.errors import one_line, shown
from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.control.component import Component, gain_at
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import JointMeasurement, measurement_of, stored_dtype
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware.moments import JointState, Sight
from smc_mujoco.mechanisms.hardware.part import Actuator, Part
from smc_mujoco.mechanisms.plant import SEEN, Plant, Values
from smc_mujoco.simulation.cfunctions import OF_JOINTS
from smc_mujoco.simulation.signals import Signal

USER_EXCEPTIONS = (Exception, SystemExit)  # of a user's function; they end one run
RETURN_VALUES = {  # kind of a component -> what it returns, for messages
    "law": "the two numbers u, s",
    "surface": "the two numbers s, v_eq",
    "estimator": "a velocity, or a velocity and an acceleration",
}
DOUBLES = ctypes.POINTER(ctypes.c_double)
C_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int64, *[DOUBLES] * 4)


class Failure(Exception):
    """Why a run ended early, and in which channel a law, a surface or an estimator raised."""

    def __init__(self, why: str, channel: int | None = None):
        super().__init__(why)
        self.channel = channel

    def __str__(self) -> str:
        where = "" if self.channel is None else f" in channel {self.channel}"
        return f"{self.args[0]}{where}"


def failure_of(name: str, error: BaseException, channel: int | None = None) -> Failure:
    """Return the Failure for an exception of a user's function."""
    try:
        text = str(error)
    except USER_EXCEPTIONS:
        text = "its text cannot be shown"
    if isinstance(error, IndexError) and "out of bounds for axis" in text:
        text += "; memory has as many numbers as memory= of its function says"
    return Failure(f"{name} raised {type(error).__name__} ({one_line(text)})", channel)


def called(
    name: str, expected: str, count: int, function: Callable, *arguments: Any
) -> list[float]:
    """Return the `count` numbers of a user's function; raise Failure for anything else."""
    try:
        out = function(*arguments)
    except USER_EXCEPTIONS as error:
        raise failure_of(name, error) from error
    return as_floats(name, out, expected, count)


def as_floats(name: str, out: Any, expected: str, count: int) -> list[float]:
    """Return what a user's function returned as `count` floats; raise Failure if it is anything
    else.
    """
    try:
        values = list(map(float, out))
    except (TypeError, ValueError, OverflowError):
        values = []
    if len(values) != count:
        raise Failure(f"{name} returned {shown(out)} instead of {expected}")
    return values


def gains_of(c: Component, n: int = 1) -> tuple:
    """Return the gains of a component as the record that its function reads: vectors (n,) for a law
    of many joints.
    """
    values: list[Any] = list(c.gains.values())
    if c.joint:
        for k, (name, value) in enumerate(c.gains.items()):
            if name in c.shared:
                values[k] = gain_at(value, 0)
            else:
                values[k] = np.array([gain_at(value, i) for i in range(n)])
    return jit.named(tuple(c.gains))(*(values or [0.0]))


class PythonComponent:
    """A law, surface or estimator as the Python function that its author wrote, with a memory, (n,
    c.memory).
    """

    def __init__(self, c: Component, n: int, driven: int = 0):
        self.driven = driven or n
        self.name = f"{c.kind} {c.name!r}"
        self.returns = RETURN_VALUES[c.kind]
        self.memory = np.zeros((n, c.memory))
        parts = c.of_channels(n)
        if len(parts) == 1:
            parts = parts * n
        self.sizes = []
        self.gains = []
        plain = {}  # by id, as a callable object may have no hash
        self.functions = []
        for part in parts:
            self.sizes.append(part.memory)
            self.gains.append(gains_of(part, self.driven))
            rebuilt = rebuild(part.function, lambda f: f)
            function = plain.setdefault(id(part.function), rebuilt)
            if isinstance(function, jit.Uncompiled):
                function = function.fresh()
            self.functions.append(function)

    def __call__(self, i: int, y: tuple) -> list[float]:
        """Return its two numbers for channel i, of a Reading or a Measurement; NaN for a missing
        acceleration.
        """
        try:
            memory = self.memory[i, : self.sizes[i]]
            out = self.functions[i](y, self.gains[i], memory)
        except USER_EXCEPTIONS as error:
            raise failure_of(self.name, error, channel=i) from error
        if isinstance(y, Reading) and not isinstance(out, tuple):
            out = out, math.nan
        return as_floats(self.name, out, self.returns, 2)

    def call_joint(self, y: JointMeasurement) -> tuple[np.ndarray, np.ndarray]:
        """Return u and s of a law of many joints, (driven,) each; raise Failure if it fails."""
        try:
            out = self.functions[0](y, self.gains[0], self.memory)
        except USER_EXCEPTIONS as error:
            raise failure_of(self.name, error) from error
        n = self.driven
        try:
            u, s = (np.asarray(values, float) for values in out)
        except (TypeError, ValueError, OverflowError):
            u = s = np.empty(())
        if u.shape != (n,) or s.shape != (n,):
            raise Failure(
                f"{self.name} returned {shown(out)} instead of two vectors u, s of {n} numbers each"
            )
        return u, s


class NominalDynamics:
    """The nominal mechanism of a law in Python, for `coriolis` and `jacobian` of
    control.joint_law.
    """

    def __init__(self, scenario: Any, x: np.ndarray, v: np.ndarray):
        self.scenario = scenario
        self.x = x
        self.v = v

    def coriolis(self, w: np.ndarray) -> np.ndarray:
        """Return C(x, v) w per unit of u, (n,)."""
        nominal = self.nominal
        if nominal is None:
            return np.zeros(len(self.x))
        values = Values(**self.scenario.plant.parameters)
        units = np.array([drive.gain for drive in self.scenario.drive_train.nominal])
        return nominal.coriolis(self.x, self.v, w, values) / units

    def jacobian(self) -> np.ndarray:
        """Return the tip's Jacobian, (3, n)."""
        plant = self.scenario.plant
        nominal = self.nominal
        if nominal is None or not plant.tip:
            raise ValueError(
                "there is no tip, or the law has no model: give the plant a tip, and the law the "
                "model"
            )
        values = Values(**plant.parameters)
        return nominal.jacobian(self.x, values, plant.tip)

    @property
    def nominal(self) -> Any:
        """The NominalModel of all joints, if the plant has one and the law may use it, or None."""
        plant = self.scenario.plant
        if plant.by_mujoco and self.scenario.resolved.model != "none":
            return plant.nominal
        return None


def evaluate(signal: Signal, t: float, *state: Any) -> list[float]:
    """Return a signal and its two derivatives at time t, s.

    The state is memory, seed, channel and stream for process noise, and memory, e, e' and s for one
    that sees the loop.
    """
    inputs = state
    if not (signal.random or signal.sees):
        inputs = (signal.data,) if signal.series else ()
    kind = type(signal)
    return called(
        kind.__name__,
        "a value and two derivatives",
        3,
        kind.value,
        t,
        signal,
        *inputs,
    )


def evaluate_nominal(
    plant: Plant, x: np.ndarray, v: np.ndarray, i: int, values: Values, u: np.ndarray
) -> list[float]:
    """Return nominal f and g of channel i.

    The model of coupled channels also depends on the last commands u, (n,).
    """
    name = f"the nominal model of {plant.name}"
    inputs = (x, v, i, values)
    if plant.by_mujoco:
        inputs = (*inputs, u)
    return called(name, "the two numbers f, g", 2, plant.nominal, *inputs)


class PythonFunction:
    """A C function that calls body(inputs, parameters, memory), which returns its outputs.

    `error` is what the body raised, of which compiled code keeps nothing.
    """

    def __init__(self, body: Callable[[Any, Any, Any], Any]):
        self.error: BaseException | None = None

        def call(inputs, parameters, memory, outputs):
            try:
                for i, number in enumerate(body(inputs, parameters, memory)):
                    outputs[i] = number
            except BaseException as error:  # ctypes would print it, and go on
                self.error = error
                return 1
            return 0

        self.code = call.__code__
        self.call = C_FUNCTION(call)
        as_pointer = ctypes.cast(self.call, ctypes.c_void_p)
        self.address: int = as_pointer.value or 0

    def message(self, channel: int) -> str:
        """Return what was raised in words, with the channel if the function was called for one."""
        if isinstance(self.error, Failure) and self.error.channel is not None:
            self.error.channel = channel
        return str(self.error)


@contextlib.contextmanager
def hearing_ctrl_c(functions: Sequence[PythonFunction]) -> Iterator[None]:
    """Raise, at the end of a with block, Ctrl-C that came while a function was called in Python.

    While MuJoCo steps, Ctrl-C waits for Python. So it mostly comes as a function begins, where
    ctypes would print it and go on.
    """
    heard = []
    codes = {function.code for function in functions}
    before = sys.unraisablehook

    def hook(unraisable):
        traceback = unraisable.exc_traceback
        if traceback is not None and traceback.tb_frame.f_code in codes:
            heard.append(unraisable.exc_value)
        else:
            before(unraisable)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before
    errors = []
    for function in functions:
        if function.error is not None:
            errors.append(function.error)
    for error in (*heard, *errors):
        if not isinstance(error, Exception):
            raise error


class Memories:
    """Memories as arrays of a shape, by their addresses: at each call the same array, which lives
    as long as the run.
    """

    def __init__(self, *shape: int):
        self.shape = shape
        self.arrays: dict[int, np.ndarray] = {}

    def __getitem__(self, pointer: Any) -> np.ndarray:
        if 0 in self.shape:
            return np.empty(self.shape)
        address = ctypes.addressof(pointer.contents)
        if address not in self.arrays:
            self.arrays[address] = np.ctypeslib.as_array(pointer, self.shape)
        return self.arrays[address]


def of_component(c: Component, s: Any) -> PythonFunction:
    """Return a law, a surface or an estimator of a run: for one channel, or for all joints."""
    if c.joint:
        dynamics = functools.partial(NominalDynamics, s)
        return of_joint_law(c, s.plant.n, s.plant.driven, dynamics)
    return of_channel_component(c)


def of_channel_component(c: Component) -> PythonFunction:
    """Return a law of one channel, a surface or an estimator."""
    component = PythonComponent(c, 1)
    memories = Memories(1, c.memory)
    record = Reading if c.kind == "estimator" else Measurement
    count = len(record._fields)

    def body(inputs, _, memory):
        component.memory = memories[memory]
        return component(0, record(*inputs[:count]))

    return PythonFunction(body)


def of_joint_law(
    law: Component, n: int, driven: int, dynamics_at: Callable[[np.ndarray, np.ndarray], Any]
) -> PythonFunction:
    """Return a law of n joints, of which some are driven; `dynamics_at` makes the nominal mechanism
    of x and v.
    """
    component = PythonComponent(law, n, driven)
    memories = Memories(n, law.memory)
    dtype = stored_dtype(n)

    def body(inputs, _, memory):
        component.memory = memories[memory]
        flat = np.ctypeslib.as_array(inputs, (dtype.itemsize // 8,))
        stored = flat.view(dtype)[0]
        dynamics = dynamics_at(stored["x"], stored["v"])
        outputs = np.zeros((2, n))
        outputs[:, :driven] = component.call_joint(measurement_of(stored, dynamics))
        return outputs.ravel()

    return PythonFunction(body)


def of_signal(signal: Signal) -> PythonFunction:
    """Return a reference, a disturbance or another signal."""
    memories = Memories(max(signal.memory, 1))

    def body(inputs, _, memory):
        t, seed, channel, stream, *loop = inputs[:7]
        if signal.random:
            return evaluate(
                signal,
                t,
                memories[memory],
                int(seed),
                int(channel),
                stream,
            )
        if signal.sees:
            return evaluate(signal, t, memories[memory], *loop)
        return evaluate(signal, t)

    return PythonFunction(body)


def of_nominal(plant: Plant) -> PythonFunction:
    """Return the nominal model of a plant whose channels have one equation each."""
    names = tuple(plant.parameters)

    def body(inputs, parameters, _):
        width = len(SEEN.names or ())
        seen = np.ctypeslib.as_array(inputs, (width,)).view(SEEN)[0]
        n = int(seen["n"])
        arrays = [np.array(pointer(int(seen[name]))[:n]) for name in ("x", "v", "u")]
        own = parameters[: len(names)]
        values = Values(**dict(zip(names, own, strict=True)))
        x, v, u = arrays
        return evaluate_nominal(
            plant,
            x,
            v,
            int(seen["i"]),
            values,
            u,
        )

    return PythonFunction(body)


def pointer(address: int) -> Any:
    """Return an address as a pointer to numbers."""
    return ctypes.cast(address, DOUBLES)


def of_part(part: Part, kind: str) -> PythonFunction:
    """Return what a part does on one joint."""
    role = "actuator" if isinstance(part, Actuator) else "friction"
    if kind == "read":
        role = "sensor"
    name = f"{role} {type(part).__name__}"
    function = rebuild(getattr(part, kind), lambda inner: inner)
    numbers = jit.named(part.names)
    count = len(numbers._fields)
    record = Sight if kind == "read" else JointState
    memories = Memories(part.memory)

    def body(inputs, parameters, memory):
        y = record(*inputs[: len(record._fields)])
        try:
            p = numbers(*parameters[:count])
            out = function(y, p, memories[memory])
        except USER_EXCEPTIONS as error:
            raise failure_of(name, error, channel=0) from error
        if kind in ("force", "steady"):
            values = as_floats(name, [out], "a force", 1)
        else:
            values = as_floats(name, out, "numbers", OF_JOINTS[kind][1])
        if kind != "read" and not all(map(math.isfinite, values)):
            unfit = next(value for value in values if not math.isfinite(value))
            raise Failure(f"{name} returned {unfit:g}", channel=0)
        return values

    return PythonFunction(body)
