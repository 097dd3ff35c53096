"""The controller of a run in Python: measured positions and velocities in, u and s out, without a
simulator.

    readings -> noise, encoder -> velocity estimator -> law -> saturation

It calls laws, estimators and signals as the Python functions they are, and has none of the
callback's code. The reference loop and agents control by it.
"""

import math
from typing import Any

import numpy as np

from smc_mujoco.common import jit
from smc_mujoco.common.errors import ScenarioError, one_line, shown
from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.control.component import Component, gain_at
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import JointMeasurement
from smc_mujoco.control.law import Law, Measurement
from smc_mujoco.mechanisms.custom.nominal_model import NominalModel
from smc_mujoco.mechanisms.plant import Dynamics, Plant, Values
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.controller import MAX_CONTROL
from smc_mujoco.simulation.prepare import known_values, references
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Signal

USER_EXCEPTIONS = (Exception, SystemExit)  # of a user's function; they end one run
RETURN_VALUES = {  # kind of a component -> what it returns, for messages
    "law": "the two numbers u, s",
    "surface": "the two numbers s, v_eq",
    "estimator": "a velocity, or a velocity and an acceleration",
}


class Failure(Exception):
    """Why a run ended early."""


class Controller:
    """The law of a scenario with its sensors, estimator and surface, and their memories; a new one
    is a new run.
    """

    def __init__(self, scenario: Scenario):
        self.scenario = scenario.resolved
        n = scenario.plant.n
        if scenario.plant.pose:
            raise ScenarioError(
                f"{scenario.plant.name} is a free body, which only smc.run moves: give it to smc.run"
            )
        self.law, self.estimator = (
            PythonComponent(c, n) for c in (self.scenario.law, self.scenario.velocity)
        )
        self.surface = scenario.surface and PythonComponent(scenario.surface, n)
        self.limits = np.array(scenario.limits)
        self.scale = math.prod(part.scale for part in scenario.actuator)
        self.values = Values(
            **dict(zip(scenario.plant.parameters, known_values(self.scenario), strict=True))
        )
        if isinstance(
            scenario.plant.nominal, NominalModel
        ):  # compiles, while there is no Python callback
            scenario.plant.nominal(np.zeros(n), np.zeros(n), 0, self.values)
        self.last_u = np.zeros(n)  # commands of the last sample
        self.told = np.zeros(n)  # other forces on the joints, for a law with the true model
        self.s, self.r, self.a = (
            np.zeros(n),
            np.zeros(n),
            np.zeros(n),
        )  # a: estimated accelerations, or NaN
        self.last_reading = np.zeros(
            (n, 2)
        )  # positions and velocities, of the last readings that were not lost

    def __call__(
        self, k: int, t: float, x: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return u within its bound and s, (n,) each, at sample k, at time t, s, of what the
        sensors read, (n,) each.

        The references and s of this sample remain in `r` and `s`.

        Raises:
          Failure: a function raised an exception, or u or s is no finite number.
        """
        u, self.s = self.command(*self.measure(k, t, x, v), t)
        return u, self.s

    def set_gains(self, law: Law) -> None:
        """Go on with the gains of another law of the same function; all memories stay."""
        self.law.gains = PythonComponent(law, len(self.last_u)).gains

    def measure(
        self, k: int, t: float, x: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return positions with their errors and estimated velocities, (n,) each, at sample k, at
        time t, s.
        """
        x, v = np.array(x, float), np.array(v, float)
        j = k
        sensor = self.scenario.sensor
        if sensor is not None and sensor.period is not None:
            j = max(0, math.floor((t - sensor.delay) / sensor.period + 1e-6))
        errors = []
        for signal in self.scenario.noise.errors:
            errors.append(-0.0 if signal is None else evaluate(signal, t)[0])
        for i in range(len(x)):
            x[i], v[i] = self.read(i, x[i] + errors[0], v[i] + errors[1], j)
            v[i], self.a[i] = self.estimator(
                i, Reading(self.scenario.control_period, float(x[i]), float(v[i]))
            )
        return x, v

    def read(self, i: int, x: float, v: float, j: int) -> tuple[float, float]:
        """Return reading j of channel i: true position x and velocity v with noise, bias, rounding
        and loss.
        """
        sigma = self.scenario.noise
        sensor = self.scenario.sensor
        seed = self.scenario.seed
        if sigma.position or sigma.velocity:
            z = normals(seed, i, philox.MEASUREMENT, j)
            x, v = x + sigma.position * z[0], v + sigma.velocity * z[1]
        if sensor is None:
            return x, v
        x += sensor.bias
        if q := sensor.quantum(self.scenario.plant.units[i] == "rad"):
            x = q * float(np.floor(x / q + 0.5))
        if j > 0 and philox.random_words(seed, i, philox.DROPOUT, j)[0] * 2.0**-53 < sensor.dropout:
            return self.last_reading[i, 0], self.last_reading[i, 1]
        self.last_reading[i] = x, v
        return x, v

    def command(self, x: np.ndarray, v: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return saturated commands and sliding variables, (n,) each, for measured x and v at time
        t, s.
        """
        scenario = self.scenario
        n = len(x)
        driven = len(self.limits)
        if scenario.feedforward is None:
            feedforward = 0.0
        else:
            feedforward = evaluate(scenario.feedforward, t)[0]
        # one for all channels, or one for each
        values = []
        for signal in references(scenario):
            values.append(evaluate(signal, t))
        motion = np.array([values[i % len(values)] for i in range(n)]).T.copy()
        self.r = np.where(np.arange(n) < driven, motion[0], 0.0)
        u = np.zeros(n)
        s = np.zeros(n)
        if scenario.law.joint:
            u, s = self.law.call_joint(self.joint_measurement(x, v, t, motion))
            return np.array(
                [self.bounded_command(i, u[i] + feedforward, s[i]) for i in range(n)]
            ), s
        for i in range(driven):
            u[i], s[i] = self.law(i, self.measurement(x, v, t, motion, i))
            u[i] = self.bounded_command(i, u[i] + feedforward, s[i])
        return u, s

    def measurement(
        self, x: np.ndarray, v: np.ndarray, t: float, motion: np.ndarray, i: int
    ) -> Measurement:
        """Return what the law of channel i reads; `motion` has the references and two derivatives,
        (3, n).
        """
        scenario, r, dr, ddr = self.scenario, *motion[:, i].tolist()
        xi, vi, (f, g) = float(x[i]), float(v[i]), self.model_at(x, v, i, i)
        y = Measurement(
            t,
            scenario.control_period,
            xi,
            vi,
            xi - r,
            vi - dr,
            r,
            dr,
            ddr,
            float(f),
            float(g),
            float(ddr if math.isnan(self.a[i]) else self.a[i]),
            scenario.limits[i],
            float(scenario.model != "none"),
        )
        if (j := i + len(scenario.limits)) < len(
            x
        ):  # a joint without actuator, which moves with channel i
            fq, gq = self.model_at(x, v, j, i)
            y = y._replace(q=float(x[j]), dq=float(v[j]), fq=float(fq), gq=float(gq))
        if scenario.stepper is not None:  # u is the acceleration x''
            gq = y.gq / y.g
            y = y._replace(f=0.0, g=1.0, fq=y.fq - gq * y.f, gq=gq)
        if self.surface:
            sliding, v_eq = self.surface(i, y)
            y = y._replace(has_surface=1.0, s=sliding, v_eq=v_eq)
        return y

    def joint_measurement(
        self, x: np.ndarray, v: np.ndarray, t: float, motion: np.ndarray
    ) -> JointMeasurement:
        """Return what a law of many joints reads, as `measurement` does for one."""
        scenario, (r, dr, ddr) = self.scenario, motion
        return JointMeasurement(
            t,
            scenario.control_period,
            float(scenario.model != "none"),
            NominalDynamics(scenario, x, v),
            x.copy(),
            v.copy(),
            x - r,
            v - dr,
            r,
            dr,
            ddr,
            np.where(np.isnan(self.a), ddr, self.a),
            self.limits.copy(),
            *dynamics(scenario, x, v),
        )

    def bounded_command(self, i: int, u: float, s: float) -> float:
        """Return the command u of channel i within its bound, and keep it in `last_u`."""
        limit = self.limits[i]
        self.last_u[i] = min(max(u, -limit), limit)
        if not (
            math.isfinite(u)
            and math.isfinite(s)
            and min(abs(u), limit) * max(1.0, self.scale) < MAX_CONTROL
        ):
            raise Failure(f"{self.law.name} returned u = {u:g}, s = {s:g} in channel {i}")
        return self.last_u[i]

    def model_at(self, x: np.ndarray, v: np.ndarray, i: int, driven: int) -> tuple[float, float]:
        """Return nominal f and g of channel i, for the u of a driven channel."""
        f, g = nominal(self.scenario.plant, x, v, i, self.values, self.last_u + self.told)
        gain, drag = self.scenario.nominal_drive
        return f - drag * v[driven] * g + self.told[i] * g, gain * g


def gains_of(c: Component, n: int = 1) -> tuple:
    """Return the gains of a component as the record that its function reads: vectors (n,) for a law
    of many joints.
    """
    values: list[Any] = list(c.gains.values())
    if c.joint:
        each = [[gain_at(value, i) for i in range(n)] for value in values]
        values = []
        for name, one in zip(c.gains, each, strict=True):
            values.append(one[0] if name in c.shared else np.array(one))
    return jit.named(tuple(c.gains))(*(values or [0.0]))


class PythonComponent:
    """A law, surface or estimator as the Python function that its author wrote, with a memory, (n,
    c.memory).
    """

    def __init__(self, c: Component, n: int, memory: np.ndarray | None = None):
        self.name = f"{c.kind} {c.name!r}"
        self.returns = RETURN_VALUES[c.kind]
        if memory is None:
            self.memory = np.zeros((n, c.memory))
        else:
            self.memory = memory
        parts = c.of_channels(n)  # one for each channel, or one for all
        parts = parts * n if len(parts) == 1 else parts
        functions = {
            id(part.function): part.function for part in parts
        }  # a callable object may have no hash
        uncompiled = {
            key: rebuild(function, lambda inner: inner) for key, function in functions.items()
        }
        own = [uncompiled[id(part.function)] for part in parts]
        self.functions = [
            function.fresh() if isinstance(function, jit.Uncompiled) else function
            for function in own
        ]
        self.sizes = [part.memory for part in parts]
        gains = {}
        for part in {id(part): part for part in parts}.values():
            gains[id(part)] = gains_of(part, n)
        self.gains = [gains[id(part)] for part in parts]  # the record that each reads

    def __call__(self, i: int, y: tuple) -> list[float]:
        """Return its two numbers for channel i, of a Reading or a Measurement; NaN for a missing
        acceleration.
        """
        try:
            out = self.functions[i](y, self.gains[i], self.memory[i, : self.sizes[i]])
        except USER_EXCEPTIONS as error:
            raise failure_of(self.name, error, f" in channel {i}") from error
        if isinstance(y, Reading) and not isinstance(out, tuple):
            out = out, math.nan
        return as_floats(self.name, out, self.returns, 2)

    def call_joint(self, y: JointMeasurement) -> tuple[np.ndarray, np.ndarray]:
        """Return u and s of a law of many joints, (n,) each; raise Failure if it fails."""
        try:
            out = self.functions[0](y, self.gains[0], self.memory)
        except USER_EXCEPTIONS as error:
            raise failure_of(self.name, error) from error
        n = len(self.memory)
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
    """The nominal mechanism, as `coriolis` and `jacobian` of control.joint_law call it in the
    reference loop.
    """

    def __init__(self, scenario: Scenario, x: np.ndarray, v: np.ndarray):
        self.scenario = scenario
        self.x = x
        self.v = v

    def coriolis(self, w: np.ndarray) -> np.ndarray:
        """Return C(x, v) w per unit of u, (n,)."""
        plant = self.scenario.plant
        nominal = self.nominal
        if nominal is None:
            return np.zeros(len(self.x))
        return (
            nominal.coriolis(self.x, self.v, w, Values(**plant.parameters))
            / self.scenario.nominal_drive.gain
        )

    def jacobian(self) -> np.ndarray:
        """Return the tip's Jacobian, (3, n)."""
        plant = self.scenario.plant
        nominal = self.nominal
        if nominal is None or not plant.tip:
            raise ValueError(
                "there is no tip, or the law has no model: give the plant a tip, and the law the model"
            )
        return nominal.jacobian(self.x, Values(**plant.parameters), plant.tip)

    @property
    def nominal(self) -> NominalModel | None:
        """The nominal model of all joints, if the plant has one and the law may use it."""
        model = self.scenario.plant.nominal
        if isinstance(model, NominalModel) and self.scenario.resolved.model != "none":
            return model
        return None


def dynamics(scenario: Scenario, x: np.ndarray, v: np.ndarray) -> Dynamics:
    """Return the M, h and g that a law of many joints sees at measured x and v, (n,) each, per unit
    of u.
    """
    plant, n, (gain, drag) = scenario.plant, len(x), scenario.nominal_drive
    if scenario.resolved.model == "none":
        return Dynamics(np.eye(n), np.zeros(n), np.zeros(n))
    values = Values(**plant.parameters)
    if isinstance(plant.nominal, NominalModel):
        try:
            terms = plant.nominal.dynamics(x, v, values)
        except USER_EXCEPTIONS as error:
            raise failure_of(f"the nominal model of {plant.name}", error) from error
    else:
        moving, resting = (
            np.array([nominal(plant, x, rate, i, values, np.zeros(n)) for i in range(n)], float)
            for rate in (v, np.zeros(n))
        )
        terms = Dynamics(
            np.diag(1.0 / moving[:, 1]),
            -moving[:, 0] / moving[:, 1],
            -resting[:, 0] / resting[:, 1],
        )
    return Dynamics(terms.M / gain, (terms.h + drag * v) / gain, terms.g / gain)


def evaluate(signal: Signal, t: float, *state: Any) -> list[float]:
    """Return a signal and its two derivatives at time t, s.

    The state is memory, seed, channel and stream for process noise, and memory, e, e' and s for one
    that sees the loop.
    """
    name = type(signal).__name__
    try:
        if signal.random or signal.sees:
            inputs = state
        else:
            inputs = (signal.data,) if signal.series else ()
        out = type(signal).value(t, signal, *inputs)
    except USER_EXCEPTIONS as error:
        raise failure_of(name, error) from error
    return as_floats(name, out, "a value and two derivatives", 3)


def nominal(
    plant: Plant, x: np.ndarray, v: np.ndarray, i: int, values: Values, u: np.ndarray
) -> tuple[float, float]:
    """Return nominal f and g of channel i.

    The model of coupled channels also depends on the last commands u, (n,).
    """
    try:
        return plant.nominal(
            x, v, i, values, *((u,) if isinstance(plant.nominal, NominalModel) else ())
        )
    except USER_EXCEPTIONS as error:
        raise failure_of(f"the nominal model of {plant.name}", error) from error


def failure_of(name: str, error: BaseException, where: str = "") -> Failure:
    """Return the Failure for an exception of a user's function."""
    try:
        text = str(error)
    except USER_EXCEPTIONS:
        text = "its text cannot be shown"
    return Failure(f"{name} raised {type(error).__name__} ({one_line(text)}){where}")


def as_floats(name: str, out: Any, expected: str, count: int) -> list[float]:
    """Return the result of a user's function as `count` floats; raise Failure if it is anything
    else.
    """
    try:
        values = [float(value) for value in out]
    except (TypeError, ValueError, OverflowError):
        values = []
    if len(values) != count:
        raise Failure(f"{name} returned {shown(out)} instead of {expected}")
    return values


def normals(seed: int, channel: int, stream: int, k: int) -> tuple[float, float]:
    """Return the numbers of philox.normals, from numpy's generator."""
    first, second = philox.random_words(seed, channel, stream, k)
    radius = math.sqrt(-2.0 * math.log((first + 1) * 2.0**-53))
    angle = 2.0 * math.pi * second * 2.0**-53
    return radius * math.cos(angle), radius * math.sin(angle)
