"""The controller of a run in Python: measured positions and velocities in, u and s out, without a
simulator.

    readings -> noise, encoder -> velocity estimator -> law -> saturation

It calls laws, estimators and signals as the Python functions they are, and has none of the
callback's code, which the tests compare with it.
"""

import math

import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import JointMeasurement
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware.feedforward import Feedforward
from smc_mujoco.mechanisms.hardware.friction import Viscous
from smc_mujoco.mechanisms.plant import Dynamics, Values
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.prepare import nominal_values, references
from smc_mujoco.simulation.python_functions import (
    USER_EXCEPTIONS,
    Failure,
    NominalDynamics,
    PythonComponent,
    evaluate,
    evaluate_nominal,
    failure_of,
)
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.step import MAX_CONTROL


class Controller:
    """The law of a scenario with its sensors, estimator and surface, and their memories; a new one
    is a new run.
    """

    def __init__(self, scenario: Scenario):
        self.scenario = scenario.resolved
        n = scenario.plant.n
        if scenario.plant.pose:
            raise ScenarioError(
                f"{scenario.plant.name} is a free body, which only smc.run moves: give it to "
                "smc.run"
            )
        self.law = PythonComponent(self.scenario.law, n)
        self.estimator = PythonComponent(self.scenario.velocity, n)
        self.surface = scenario.surface and PythonComponent(scenario.surface, n)
        self.limits = np.array(scenario.limits)
        self.scale = math.prod(part.scale for part in scenario.actuator)
        parameters = zip(scenario.plant.parameters, nominal_values(self.scenario), strict=True)
        self.values = Values(**dict(parameters))
        if scenario.plant.by_mujoco:  # compiles now, not at the first call
            scenario.plant.nominal(np.zeros(n), np.zeros(n), 0, self.values)
        self.last_u = np.zeros(n)  # commands of the last sample
        self.reported = np.zeros(n)  # other forces on the joints, for a law with the true model
        self.s = np.zeros(n)
        self.r = np.zeros(n)
        self.added = np.zeros(n)
        self.a = np.zeros(n)  # estimated accelerations, or NaN
        self.last_reading = np.zeros((n, 2))  # x and v of the last readings that were not lost

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
        self.speeds = v
        self.added = np.zeros(len(x))  # what compensates friction
        n = len(x)
        driven = len(self.limits)
        feedforward = 0.0
        if scenario.feedforward_signal is not None:
            feedforward = evaluate(scenario.feedforward_signal, t)[0]
        # one for all channels, or one for each
        values = [evaluate(signal, t) for signal in references(scenario)]
        motion = np.array([values[i % len(values)] for i in range(n)]).T.copy()
        self.r = np.where(np.arange(n) < driven, motion[0], 0.0)
        u = np.zeros(n)
        s = np.zeros(n)
        if scenario.law.joint:
            u, s = self.law.call_joint(self.joint_measurement(x, v, t, motion))
            for i in range(driven):
                self.added[i] = self.compensation(i, v, motion)
                u[i] += feedforward + self.added[i]
            u = np.array([self.bounded_command(i, u[i], s[i]) for i in range(n)])
            return u, s
        for i in range(driven):
            u[i], s[i] = self.law(i, self.measurement(x, v, t, motion, i))
            self.added[i] = self.compensation(i, v, motion)
            u[i] += feedforward + self.added[i]
            u[i] = self.bounded_command(i, u[i], s[i])
        return u, s

    def compensation(self, i: int, v: np.ndarray, motion: np.ndarray) -> float:
        """Return what a Feedforward of Coulomb and viscous friction adds to u of channel i."""
        feedforward = self.scenario.feedforward
        if not isinstance(feedforward, Feedforward):
            return 0.0
        speed = float(motion[1, i] if feedforward.on == "reference" else v[i])
        force = 0.0
        for part in self.scenario.compensated:
            if i in part.channels(self.scenario.plant):
                if isinstance(part, Viscous):
                    force += part.b * speed
                else:
                    force += math.copysign(part.level, speed)
        share = (1.0 + feedforward.error) * math.tanh(abs(speed) / feedforward.eps)
        return share * force / self.scenario.drive_train.nominal[i].gain

    def measurement(
        self, x: np.ndarray, v: np.ndarray, t: float, motion: np.ndarray, i: int
    ) -> Measurement:
        """Return what the law of channel i reads; `motion` has the references and two derivatives,
        (3, n).
        """
        scenario = self.scenario
        r, dr, ddr = motion[:, i].tolist()
        xi = float(x[i])
        vi = float(v[i])
        f, g = self.model_at(x, v, i, i)
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
        j = i + len(scenario.limits)
        if j < len(x):  # a joint without actuator, which moves with channel i
            fq, gq = self.model_at(x, v, j, i)
            y = y._replace(
                q=float(x[j]),
                dq=float(v[j]),
                fq=float(fq),
                gq=float(gq),
            )
        if scenario.accelerates:  # u is the acceleration x''
            gq = y.gq / y.g
            y = y._replace(
                f=0.0,
                g=1.0,
                fq=y.fq - gq * y.f,
                gq=gq,
            )
        if self.surface:
            sliding, v_eq = self.surface(i, y)
            y = y._replace(has_surface=1.0, s=sliding, v_eq=v_eq)
        return y

    def joint_measurement(
        self, x: np.ndarray, v: np.ndarray, t: float, motion: np.ndarray
    ) -> JointMeasurement:
        """Return what a law of many joints reads, as `measurement` does for one."""
        scenario = self.scenario
        r, dr, ddr = motion
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
        """Return the command u of channel i within its bound, and keep its force in `last_u`."""
        limit = self.limits[i]
        bounded = min(max(u, -limit), limit)
        if not (
            math.isfinite(u)
            and math.isfinite(s)
            and min(abs(u), limit) * max(1.0, self.scale) < MAX_CONTROL
        ):
            raise Failure(f"{self.law.name} returned u = {u:g}, s = {s:g} in channel {i}")
        gain, drag = self.scenario.drive_train.nominal[i]
        self.last_u[i] = gain * bounded - drag * self.speeds[i]
        return bounded

    def model_at(self, x: np.ndarray, v: np.ndarray, i: int, driven: int) -> tuple[float, float]:
        """Return nominal f and g of channel i, for the u of a driven channel."""
        f, g = evaluate_nominal(
            self.scenario.plant,
            x,
            v,
            i,
            self.values,
            self.last_u + self.reported,
        )
        gain, drag = self.scenario.drive_train.nominal[0]
        return f - drag * v[driven] * g + self.reported[i] * g, gain * g


def dynamics(scenario: Scenario, x: np.ndarray, v: np.ndarray) -> Dynamics:
    """Return the M, h and g that a law of many joints sees at measured x and v, (n,) each, per unit
    of u.
    """
    plant = scenario.plant
    n = len(x)
    if scenario.resolved.model == "none":
        return Dynamics(np.eye(n), np.zeros(n), np.zeros(n))
    values = Values(**plant.parameters)
    if plant.by_mujoco:
        try:
            M, h, g = plant.nominal.dynamics(x, v, values)
        except USER_EXCEPTIONS as error:
            raise failure_of(f"the nominal model of {plant.name}", error) from error
    else:
        rest = np.zeros(n)
        moving = [
            evaluate_nominal(
                plant,
                x,
                v,
                i,
                values,
                rest,
            )
            for i in range(n)
        ]
        resting = [
            evaluate_nominal(
                plant,
                x,
                rest,
                i,
                values,
                rest,
            )
            for i in range(n)
        ]
        f, per_u = np.array(moving).T
        f_at_rest, per_u_at_rest = np.array(resting).T
        M = np.diag(1.0 / per_u)
        h = -f / per_u
        g = -f_at_rest / per_u_at_rest
    gain, drag = scenario.drive_train.nominal[0]
    return Dynamics(M / gain, (h + drag * v) / gain, g / gain)


def normals(seed: int, channel: int, stream: int, k: int) -> tuple[float, float]:
    """Return the numbers of philox.normals, from numpy's generator."""
    first, second = philox.random_words(seed, channel, stream, k)
    radius = math.sqrt(-2.0 * math.log((first + 1) * 2.0**-53))
    angle = 2.0 * math.pi * second * 2.0**-53
    return radius * math.cos(angle), radius * math.sin(angle)
