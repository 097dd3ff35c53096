"""The plain loop: mj_step with the law called as the Python function it is.

It runs what does not compile, and it is the oracle that the tests hold the compiled callback against: same Scenario,
same Trace, but written for reading, with numpy's own Philox and nothing of the harness. A step takes tens of
microseconds.
"""

import math
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from smc_mujoco import noise
from smc_mujoco.callback import installed
from smc_mujoco.channels import CTRL, QPOS, QVEL, SIGN, V_SENSOR, X_SENSOR, XFRC, channels
from smc_mujoco.compiled import named as record_type
from smc_mujoco.component import Component
from smc_mujoco.errors import shown
from smc_mujoco.estimators import Reading
from smc_mujoco.harness import HUGE, LEFT, WORLD
from smc_mujoco.law import Measurement
from smc_mujoco.plant import Values, write
from smc_mujoco.remade import remade
from smc_mujoco.scenario import Scenario
from smc_mujoco.signals import Signal
from smc_mujoco.trace import Trace, from_log

LEFT_THE_WORLD = f"the plant left the finite world (|x| or |v| above {WORLD:g}, or NaN)"


class Failure(Exception):
    """Why a run ended early."""


def run(scenario: Scenario) -> Trace:
    """One run in the plain loop."""
    with installed():
        loop = Loop(scenario)
    total = scenario.samples * scenario.steps
    with installed(loop.control), np.errstate(all="ignore"):  # the finite world is checked, and NaN named
        for step in range(total + 1):
            if step == scenario.jump_step:
                loop.set_parameters(scenario.factors(step))
            if step < total:
                mujoco.mj_step(loop.model, loop.data)
            else:
                mujoco.mj_forward(loop.model, loop.data)
            if loop.failure:
                break
    return from_log(scenario, loop.log, loop.failed_step, loop.failure)


def as_written(function: Any) -> Any:
    """What `remade` makes of compiled functions here: what they were."""
    return function


class Loop:
    """One simulation and its controller; `control` is the control callback."""

    def __init__(self, scenario: Scenario):
        self.scenario, n = scenario, scenario.plant.n
        self.model = scenario.plant.load(scenario.factors(0))
        self.model.opt.timestep = scenario.physics_step
        self.model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{scenario.integrator.upper()}")
        self.data = mujoco.MjData(self.model)
        self.table = channels(self.model)
        self.data.qpos[self.table[:, QPOS]] = scenario.x0
        self.data.qvel[self.table[:, QVEL]] = scenario.v0
        self.calls = 0
        self.law, self.estimator = (remade(c.function, as_written) for c in (scenario.law, scenario.velocity))
        self.nominal = Values(**scenario.plant.parameters)
        self.memory = [np.zeros(scenario.law.memory) for _ in range(n)]
        self.estimator_memory = [np.zeros(scenario.velocity.memory) for _ in range(n)]
        self.signal_memory = [[np.zeros(max(d.memory, 1)) for _ in range(n)] for d in scenario.disturbance]
        self.commands: list[np.ndarray] = []
        self.s, self.r = np.zeros(n), np.zeros(n)
        self.log = np.full((7, scenario.samples + 1, n), np.nan)
        self.failure: str | None = None
        self.failed_step = 0  # physics step

    def set_parameters(self, factors: Mapping[str, float]) -> None:
        """Give the mechanism other true parameters."""
        plant = self.scenario.plant
        write(self.model, plant.fields(self.model, plant.values(factors)))
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))

    def control(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """The callback: at the first stage of a sample the law, at every stage the disturbance."""
        if self.failure or data._address != self.data._address:
            return  # a law may step a model of its own, and other threads load theirs
        step, stage = divmod(self.calls, self.scenario.stages)
        self.calls += 1
        try:
            if stage == 0:
                self.begin(data, step)
            fraction = (0.0, 0.5, 0.5, LEFT)[stage]
            k, within = divmod(step, self.scenario.steps)
            d = self.disturbance(k * self.scenario.control_period + (within + fraction) * self.scenario.physics_step)
            data.xfrc_applied.ravel()[self.table[:, XFRC]] = self.table[:, SIGN] * d
            if stage == 0 and within == 0:
                x, v = data.qpos[self.table[:, QPOS]], data.qvel[self.table[:, QVEL]]
                applied = data.ctrl[self.table[:, CTRL]]
                self.log[:, k] = x, v, self.commands[-1], applied, self.s, d, self.r
        except Failure as failure:
            self.failure, self.failed_step = " ".join(str(failure).split()), step

    def begin(self, data: mujoco.MjData, step: int) -> None:
        """The first stage of a physics step: at a sample the law; the command whose delay has passed."""
        if not (np.all(np.abs(data.qpos) < WORLD) and np.all(np.abs(data.qvel) < WORLD)):
            raise Failure(LEFT_THE_WORLD)
        k, within = divmod(step, self.scenario.steps)
        if within == 0:
            u, self.s = self.decide(*self.measure(data, k), k)
            self.commands.append(u)
        past = step - self.scenario.delay_steps
        if past >= 0:
            data.ctrl[self.table[:, CTRL]] = self.commands[past // self.scenario.steps]

    def measure(self, data: mujoco.MjData, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Measured positions and estimated velocities, (n,) each."""
        x, v = data.sensordata[self.table[:, X_SENSOR]], data.sensordata[self.table[:, V_SENSOR]]
        sigma, estimator = self.scenario.noise, self.scenario.velocity
        for i in range(len(x)):
            if sigma.position or sigma.velocity:
                z = normals(self.scenario.seed, i, noise.MEASUREMENT, k)
                x[i], v[i] = x[i] + sigma.position * z[0], v[i] + sigma.velocity * z[1]
            reading = Reading(self.scenario.control_period, float(x[i]), float(v[i]))
            out = guarded(estimator, self.estimator, i, reading, named(estimator), self.estimator_memory[i])
            v[i] = numbers(f"estimator {estimator.name!r}", (out,), "a velocity")[0]
        return x, v

    def decide(self, x: np.ndarray, v: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Saturated commands and sliding variables, (n,) each."""
        scenario, law = self.scenario, self.scenario.law
        t, u, s = k * scenario.control_period, np.empty_like(x), np.empty_like(x)
        r, dr, ddr = signalled(scenario.reference, t)
        self.r[:] = r
        for i in range(len(x)):
            xi, vi, (f, g) = float(x[i]), float(v[i]), self.model_at(x, v, i)
            y = Measurement(t, scenario.control_period, xi, vi, xi - r, vi - dr, r, dr, ddr, float(f), float(g))
            out = guarded(law, self.law, i, y, named(law), self.memory[i])
            u[i], s[i] = numbers(f"law {law.name!r}", out, "the two numbers u, s", 2)
            if not (math.isfinite(u[i]) and math.isfinite(s[i]) and min(abs(u[i]), scenario.u_max) < HUGE):
                raise Failure(f"law {law.name!r} returned u = {u[i]}, s = {s[i]} in channel {i}")
        return np.clip(u, -scenario.u_max, scenario.u_max), s

    def model_at(self, x: np.ndarray, v: np.ndarray, i: int) -> tuple[float, float]:
        """Nominal f and g of channel i."""
        plant = self.scenario.plant
        try:
            return plant.nominal(x, v, i, self.nominal)
        except Exception as error:
            raise Failure(f"the nominal model of {plant.name} raised {type(error).__name__} ({error})") from error

    def disturbance(self, t: float) -> np.ndarray:
        """The sum of the disturbances, (n,)."""
        d = np.zeros(self.scenario.plant.n)
        for j, (signal, memory) in enumerate(zip(self.scenario.disturbance, self.signal_memory, strict=True)):
            stream = self.scenario.stream(j)
            d += [signalled(signal, t, memory[i], self.scenario.seed, i, stream)[0] for i in range(len(d))]
        if not np.all(np.isfinite(d)):
            raise Failure("the disturbance became NaN or inf")
        return d


def signalled(signal: Signal, t: float, *state: Any) -> list[float]:
    """A signal and its two derivatives at time t; `state` is what random ones also take."""
    name, function = type(signal).__name__, type(signal).value
    try:
        out = function(t, signal, *state) if signal.random else function(t, signal)
    except Exception as error:
        raise Failure(f"{name} raised {type(error).__name__} ({error})") from error
    return numbers(name, out, "a value and two derivatives", 3)


def numbers(who: str, out: Any, what: str, count: int = 1) -> list[float]:
    """What a user's function returned, as floats."""
    try:
        values = [float(value) for value in out]
    except (TypeError, ValueError, OverflowError):
        values = []
    if len(values) != count:
        raise Failure(f"{who} returned {shown(out)} instead of {what}")
    return values


def named(component: Component) -> tuple:
    """A component's gains as the record its function reads."""
    return record_type(tuple(component.gains))(*(component.gains.values() or [0.0]))


def guarded(component: Component, function: Any, channel: int, y: tuple, gains: tuple, memory: np.ndarray) -> Any:
    """What a law or an estimator returns; its exception as a Failure that names it."""
    try:
        return function(y, gains, memory)
    except Exception as error:
        what = f"{component.kind} {component.name!r} raised {type(error).__name__} ({error})"
        raise Failure(f"{what} in channel {channel}") from error


def normals(seed: int, channel: int, stream: int, k: int) -> tuple[float, float]:
    """What noise.normals gives, from numpy's own generator."""
    before = (k - 1 + (stream << 64)) % 2**256
    words = np.random.Philox(key=seed + (channel << 64), counter=before).random_raw(2)
    radius = math.sqrt(-2.0 * math.log(((int(words[0]) >> 11) + 1) * 2.0**-53))
    angle = 2.0 * math.pi * (int(words[1]) >> 11) * 2.0**-53
    return radius * math.cos(angle), radius * math.sin(angle)
