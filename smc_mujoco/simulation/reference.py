"""The reference loop: mj_step with the law called as the Python function it is.

It runs what does not compile, and it is the oracle that the tests hold the compiled callback against: same Scenario,
same Trace, but written for reading, with numpy's own Philox and nothing of the harness. A step takes tens of
microseconds.
"""

import math

import mujoco
import numpy as np

from smc_mujoco.common.remade import remade
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware import encoder
from smc_mujoco.mechanisms.plant import Coupled, Values
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.callback import installed
from smc_mujoco.simulation.channels import channels
from smc_mujoco.simulation.controller import LAST_STAGE, MAX_CONTROL, MAX_STATE
from smc_mujoco.simulation.guarded import (
    Failure,
    as_written,
    estimated,
    guarded,
    named,
    nominal,
    numbers,
    signalled,
    surfaced,
)
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.state import LOG
from smc_mujoco.simulation.trace import Trace, from_log

LEFT_THE_WORLD = f"the plant left the finite world (|x| or |v| above {MAX_STATE:g}, or NaN)"

INTERRUPTED = (
    "MuJoCo's control callback was set by someone else during the run, which went on without its law: "
    "call mujoco.set_mjcb_control before or after it, or put back what mujoco.get_mjcb_control() gave"
)


def run(scenario: Scenario) -> Trace:
    """One run in the reference loop."""
    with installed():
        loop = Loop(scenario)
    with installed(loop.control), np.errstate(all="ignore"):  # the finite world is checked, and NaN named
        for step in range(loop.total + 1):
            loop.step(step)
            if loop.failure:
                break
    return from_log(scenario, loop.log, loop.failed_step, loop.failure)


class Loop:
    """One simulation and its controller; `control` is the control callback."""

    def __init__(self, scenario: Scenario):
        self.scenario, n = scenario, scenario.plant.n
        self.compiled = assembly.model([scenario])
        self.model = assembly.numbered(self.compiled, scenario)
        self.data = mujoco.MjData(self.model)
        self.channels = channels(self.model)
        self.data.qpos[:], self.data.qvel[:] = assembly.start(self.model, scenario)
        if self.model.nhistory:
            encoder.remember(self.model, self.data)
        self.total = scenario.samples * scenario.steps  # physics steps
        self.calls = 0
        self.law, self.estimator = (remade(c.function, as_written) for c in (scenario.law, scenario.velocity))
        self.surface = scenario.surface and remade(scenario.surface.function, as_written)
        self.surface_memory = [np.zeros(scenario.surface.memory if scenario.surface else 0) for _ in range(n)]
        self.nominal = Values(**scenario.plant.parameters)
        if isinstance(scenario.plant.nominal, Coupled):  # compiles, while there is no Python callback
            scenario.plant.nominal(np.zeros(n), np.zeros(n), 0, self.nominal)
        self.memory = [np.zeros(scenario.law.memory) for _ in range(n)]
        self.estimator_memory = [np.zeros(scenario.velocity.memory) for _ in range(n)]
        self.signal_memory = [[np.zeros(max(d.memory, 1)) for _ in range(n)] for d in scenario.disturbance]
        self.commands: list[np.ndarray] = []
        self.latest = np.zeros(n)  # the last command of each channel
        self.s, self.r, self.a = np.zeros(n), np.zeros(n), np.zeros(n)
        self.held = np.zeros((n, 2))  # the last readings that arrived
        self.acted = np.zeros((2, n))  # sums of what drives, and what friction and contacts, exerted on the joints
        self.scale = math.prod(part.scale for part in scenario.actuator)
        self.tandem, self.first = scenario.tandem, np.zeros(n)  # of two drives, and the output of the first
        self.limits = np.array(scenario.limits)
        self.arrived = np.zeros(n)  # the commands whose delay has passed
        self.log = np.full((scenario.samples + 1, n), np.nan, LOG)
        self.failure: str | None = None
        self.failed_step = 0  # physics step

    def step(self, step: int) -> None:
        """Physics step 0, 1, ..., with `control` installed; that after the last one only completes the log."""
        if step == self.scenario.jump_step:
            self.set_parameters(step)
        if step < self.total:
            mujoco.mj_step(self.model, self.data)
        else:
            mujoco.mj_forward(self.model, self.data)
        due = min(step + 1, self.total) * self.scenario.stages + (step == self.total)
        if self.calls != due and self.failure is None:
            self.failure, self.failed_step = INTERRUPTED, step

    def set_parameters(self, step: int) -> None:
        """Give the mechanism the true parameters that hold from a step on."""
        assembly.put_numbers(self.model, self.compiled, self.scenario, step)
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
            fraction = (0.0, 0.5, 0.5, LAST_STAGE)[stage]
            k, within = divmod(step, self.scenario.steps)
            t = k * self.scenario.control_period + (within + fraction) * self.scenario.physics_step
            d = self.disturb(data, t)
            if stage == 0 and within == 0:
                x, v = data.qpos[self.channels["qpos"]], data.qvel[self.channels["qvel"]]
                reached = self.arrived if self.tandem else data.ctrl[self.channels["ctrl"]] / self.scale
                applied, driven = np.zeros(len(x)), self.channels["ctrl"] >= 0
                applied[driven] = np.clip(reached[driven], -self.limits, self.limits)  # scaled and back: an ulp beyond
                acted = self.acted / self.scenario.steps
                sample = (x, v, self.commands[-1], applied, self.s, d, self.r, *acted)
                for name, values in zip(LOG.names or (), sample, strict=True):
                    self.log[name][k] = values
                self.acted[:] = 0.0
        except Failure as failure:
            self.failure, self.failed_step = " ".join(str(failure).split()), step

    def begin(self, data: mujoco.MjData, step: int) -> None:
        """The first stage of a physics step: at a sample the law; the command whose delay has passed."""
        self.weigh(data)
        if not (np.all(np.abs(data.qpos) < MAX_STATE) and np.all(np.abs(data.qvel) < MAX_STATE)):
            raise Failure(LEFT_THE_WORLD)
        k, within = divmod(step, self.scenario.steps)
        if within == 0:
            u, self.s = self.decide(*self.measure(data, k), k)
            self.commands.append(u)
        past = step - self.scenario.delay_steps
        if past >= 0:
            self.arrived = self.commands[past // self.scenario.steps]
        asked, driven = self.arrived, self.channels["ctrl"] >= 0
        if self.tandem:
            asked, self.first = self.tandem(asked, self.first)
        data.ctrl[self.channels["ctrl"][driven]] = (self.scale * asked)[driven]

    def measure(self, data: mujoco.MjData, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Measured positions and estimated velocities, (n,) each."""
        x, v = data.sensordata[self.channels["x_sensor"]], data.sensordata[self.channels["v_sensor"]]
        estimator, j, sensor = self.scenario.velocity, k, self.scenario.sensor
        if sensor is not None and sensor.period is not None:
            j = max(0, math.floor((k * self.scenario.control_period - sensor.delay) / sensor.period + 1e-6))
        for i in range(len(x)):
            x[i], v[i] = self.read(i, x[i], v[i], j)
            reading = Reading(self.scenario.control_period, float(x[i]), float(v[i]))
            out = guarded(estimator, self.estimator, i, reading, named(estimator), self.estimator_memory[i])
            v[i], self.a[i] = estimated(estimator, out)
        return x, v

    def read(self, i: int, x: float, v: float, j: int) -> tuple[float, float]:
        """Reading j of channel i: position and velocity after noise, bias, rounding, and loss."""
        sigma, sensor, seed = self.scenario.noise, self.scenario.sensor, self.scenario.seed
        if sigma.position or sigma.velocity:
            z = normals(seed, i, philox.MEASUREMENT, j)
            x, v = x + sigma.position * z[0], v + sigma.velocity * z[1]
        if sensor is None:
            return x, v
        x += sensor.bias
        if q := sensor.quantum(self.channels["tip"][i] >= 0):
            x = q * math.floor(x / q + 0.5)
        if j > 0 and words(seed, i, philox.DROPOUT, j)[0] * 2.0**-53 < sensor.dropout:
            return self.held[i, 0], self.held[i, 1]
        self.held[i] = x, v
        return x, v

    def decide(self, x: np.ndarray, v: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Saturated commands and sliding variables, (n,) each."""
        scenario, law = self.scenario, self.scenario.law
        t, u, s = k * scenario.control_period, np.empty_like(x), np.empty_like(x)
        limits = scenario.limits
        r, dr, ddr = signalled(scenario.reference, t)
        self.r[:] = r
        for i in range(len(x)):
            if self.channels["ctrl"][i] < 0:  # only measured
                u[i] = s[i] = self.r[i] = 0.0
                continue
            xi, vi, (f, g) = float(x[i]), float(v[i]), self.model_at(x, v, i)
            y = Measurement(
                t, scenario.control_period, xi, vi, xi - r, vi - dr, r, dr, ddr, float(f), float(g),
                float(ddr if math.isnan(self.a[i]) else self.a[i]), limits[i], float(scenario.model == "nominal"),
            )  # fmt: skip
            if (j := i + int(np.sum(self.channels["ctrl"] >= 0))) < len(x):  # moves with it, without an actuator
                fq, gq = self.model_at(x, v, j)
                y = y._replace(q=float(x[j]), dq=float(v[j]), fq=float(fq), gq=float(gq))
            if scenario.surface is not None:
                slid = guarded(scenario.surface, self.surface, i, y, named(scenario.surface), self.surface_memory[i])
                y = y._replace(surfaced=1.0, **dict(zip(("s", "eq"), surfaced(scenario.surface, slid), strict=True)))
            out = guarded(law, self.law, i, y, named(law), self.memory[i])
            u[i], s[i] = numbers(f"law {law.name!r}", out, "the two numbers u, s", 2)
            self.latest[i] = np.clip(u[i], -limits[i], limits[i])
            asked = min(abs(u[i]), limits[i]) * max(1.0, self.scale)
            if not (math.isfinite(u[i]) and math.isfinite(s[i]) and asked < MAX_CONTROL):
                raise Failure(f"law {law.name!r} returned u = {u[i]:g}, s = {s[i]:g} in channel {i}")
            u[i] = self.latest[i]
        return u, s

    def model_at(self, x: np.ndarray, v: np.ndarray, i: int) -> tuple[float, float]:
        """Nominal f and g of channel i."""
        return nominal(self.scenario.plant, x, v, i, self.nominal, self.latest)

    def disturb(self, data: mujoco.MjData, t: float) -> np.ndarray:
        """Put the disturbances of time t on the bodies; their generalised forces, (n,)."""
        xfrc, table = data.xfrc_applied.ravel(), self.channels
        xfrc[table["xfrc"]] = xfrc[table["push"]] = 0.0
        joints = np.zeros(len(table))  # those of an own model
        for j, (signal, memory) in enumerate(zip(self.scenario.disturbance, self.signal_memory, strict=True)):
            stream = self.scenario.stream(j)
            d = [signalled(signal, t, memory[i], self.scenario.seed, i, stream)[0] for i in range(len(table))]
            matched = table["sign"] * d * (table["ctrl"] >= 0)  # where an actuator could answer it
            joints += matched
            xfrc[table["push" if signal.cartesian else "xfrc"]] += d if signal.cartesian else matched
        if self.scenario.plant.direct:
            xfrc[table["xfrc"]], data.qfrc_applied[table["direct"]] = 0.0, joints
        d = joints if self.scenario.plant.direct else table["sign"] * xfrc[table["xfrc"]]
        hinged = table["tip"] >= 0
        arm = data.xipos.ravel()[table["tip"]] - data.xanchor.ravel()[table["anchor"]]
        d[hinged] += (table["push_sign"] * arm * xfrc[table["push"]])[hinged]
        if not np.all(np.isfinite(d)):
            raise Failure("the disturbance became NaN or inf")
        return d

    def weigh(self, data: mujoco.MjData) -> None:
        """Add up what drives, and what friction and contacts, exerted on the joints in the last physics step."""
        rubs = self.channels["friction"] >= 0
        self.acted[0] += np.where(self.channels["force"] >= 0, data.actuator_force[self.channels["force"]], 0.0)
        self.acted[1] += data.qfrc_constraint[self.channels["qvel"]]
        self.acted[1, rubs] += data.actuator_force[self.channels["friction"][rubs]]


def normals(seed: int, channel: int, stream: int, k: int) -> tuple[float, float]:
    """What noise.normals gives, from numpy's own generator."""
    first, second = words(seed, channel, stream, k)
    radius = math.sqrt(-2.0 * math.log((first + 1) * 2.0**-53))
    angle = 2.0 * math.pi * second * 2.0**-53
    return radius * math.cos(angle), radius * math.sin(angle)


def words(seed: int, channel: int, stream: int, k: int) -> tuple[int, int]:
    """Two whole numbers of 53 random bits, from numpy's own generator."""
    before = (k - 1 + (stream << 64)) % 2**256
    first, second = np.random.Philox(key=seed + (channel << 64), counter=before).random_raw(2)
    return int(first) >> 11, int(second) >> 11
