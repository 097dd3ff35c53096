"""The reference loop: mj_step, with laws, estimators and signals called as the Python functions they are.

It runs what does not compile. The tests compare the compiled callback with it: the same Scenario must give the same
Trace. It is written to be read, with numpy's Philox and none of the callback's code. A step takes tens of microseconds.
"""

import contextlib
import math
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common import jit, mjcb
from smc_mujoco.common.errors import one_line, shown
from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.control.component import Component, gain_at
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import JointMeasurement
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.custom.nominal_model import NominalModel
from smc_mujoco.mechanisms.hardware.drives import rippled
from smc_mujoco.mechanisms.hardware.friction import coulomb_step
from smc_mujoco.mechanisms.hardware.sliding import STICKING_SPEED, Sliding
from smc_mujoco.mechanisms.plant import Dynamics, Plant, Values
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation import philox, trace
from smc_mujoco.simulation.callback import installed
from smc_mujoco.simulation.controller import LAST_STAGE, MAX_CONTROL, MAX_STATE
from smc_mujoco.simulation.prepare import references
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Push, Signal
from smc_mujoco.simulation.state import LOG
from smc_mujoco.simulation.trace import Trace, from_log

USER_EXCEPTIONS = (Exception, SystemExit)  # of a user's function; they end one run
RETURN_VALUES = {  # kind of a component -> what it returns, for messages
    "law": "the two numbers u, s",
    "surface": "the two numbers s, v_eq",
    "estimator": "a velocity, or a velocity and an acceleration",
}
CALLBACK_STEPS = 100  # physics steps after which MuJoCo's callbacks are compared with ours; chosen
PLANT_DIVERGED = f"{trace.PLANT_DIVERGED} (|x| or |v| above {MAX_STATE:g}, or NaN)"


def interrupted(name: str) -> str:
    """Return why a run failed during which other code set one of MuJoCo's callbacks; "" is the control callback."""
    name = name or "control"
    so = ", so that its law was not called" * (name == "control")
    return (
        f"other code replaced MuJoCo's {name} callback during the run{so}: "
        f"call mujoco.set_mjcb_{name} before or after the run, or restore what mujoco.get_mjcb_{name}() returned"
    )


class Failure(Exception):
    """Why a run ended early."""


def run(scenario: Scenario, mechanism: models.Mechanism | None = None) -> Trace:
    """Return the trace of a scenario, run in the reference loop. `mechanism`: the scenario's, if it is made already."""
    mechanism = mechanism or models.mechanism(scenario)
    with installed():
        loop = Loop(scenario, mechanism)
    with installed(loop.control), np.errstate(all="ignore"):  # the loop itself checks for NaN and inf
        for step in range(loop.total + 1):
            loop.step(step)
            if loop.failure:
                break
    return from_log(scenario, loop.log, loop.failed_step, loop.failure)


class Loop:
    """One simulation and its controller; `control` is the control callback."""

    def __init__(self, scenario: Scenario, mechanism: models.Mechanism):
        self.scenario, n = scenario.resolved, scenario.plant.n
        self.base, table = mechanism.model, mechanism.channels
        self.model = models.with_values(self.base, scenario)
        self.data = mujoco.MjData(self.model)
        self.channels = {name: table[name].copy() for name in table.dtype.names or ()}
        self.driven, self.hinged = self.channels["ctrl"] >= 0, self.channels["hinge_body"] >= 0  # (n,) bool
        self.has_friction, self.has_drive = self.channels["friction_force"] >= 0, self.channels["force"] >= 0
        models.put_initial_state(self.model, self.data, scenario)
        self.total = scenario.samples * scenario.steps  # physics steps
        self.calls = 0
        self.law, self.estimator = (PythonComponent(c, n) for c in (scenario.law, self.scenario.velocity))
        self.surface = scenario.surface and PythonComponent(scenario.surface, n)
        self.nominal = Values(**scenario.plant.parameters)
        if isinstance(scenario.plant.nominal, NominalModel):  # compiles, while there is no Python callback
            scenario.plant.nominal(np.zeros(n), np.zeros(n), 0, self.nominal)
        self.signal_memory = [[np.zeros(max(d.memory, 1)) for _ in range(n)] for d in scenario.disturbance]
        self.streams = [scenario.noise_stream(j) for j in range(len(scenario.disturbance))]
        self.commands: list[np.ndarray] = []
        self.last_u = np.zeros(n)  # commands of the last sample
        self.s, self.r, self.a = np.zeros(n), np.zeros(n), np.zeros(n)  # a: estimated accelerations, or NaN
        self.last_reading = np.zeros((n, 2))  # positions and velocities, of the last readings that were not lost
        self.forces = np.zeros((2, n))  # sums over a control period: of the drives, of friction and contacts
        self.scale = math.prod(part.scale for part in scenario.actuator)
        self.drive_step = scenario.drive_step
        if self.drive_step:  # both states of the drives
            self.first, self.second = self.drive_step.start(self.data.qvel[self.channels["shaft"]])
        self.middle, self.rise = np.zeros((2, n))  # the mean force in a step of RK4, and its rise to the last stage
        self.limits = np.array(scenario.limits)
        inertia, formula = self.model.dof_M0[self.channels["qvel"]], self.scenario.formula_friction
        self.bristles = [] if formula is None else [formula.bristle(i, inertia[i]) for i in range(n)]
        self.numbers = [] if formula is None else [friction_numbers(formula, i) for i in range(n)]
        self.stuck_at, self.speed = [math.nan] * n, [0.0] * n  # positions of joints that stick, or NaN; last speeds
        self.rubbing, self.held = np.zeros((n, 4)), np.zeros(n)  # of Coulomb friction, see `apply_exact_friction`
        self.delayed = np.zeros(n)  # the commands whose delay has passed
        self.log = np.full((scenario.samples + 1, n), np.nan, LOG)
        self.failure: str | None = None
        self.failed_step = 0  # physics step

    def step(self, step: int) -> None:
        """Do physics step 0, 1, ..., with `control` installed. The step after the last one only completes the log."""
        if step == self.scenario.jump_step:
            models.put_values(self.model, self.base, self.scenario, step)
            mujoco.mj_setConst(self.model, mujoco.MjData(self.model))
        with contextlib.suppress(mujoco.UnexpectedError):  # MuJoCo's, where our Python callback is taken away
            if step < self.total:
                mujoco.mj_step(self.model, self.data)
            else:
                mujoco.mj_forward(self.model, self.data)
        expected_calls = min(step + 1, self.total) * self.scenario.stages + (step == self.total)
        other = mjcb.replaced() if step % CALLBACK_STEPS == 0 or step == self.total else ""
        if (other or self.calls != expected_calls) and self.failure is None:
            self.failure, self.failed_step = interrupted(other), step

    def control(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Control callback: run the law at the first stage of a sample, and apply the disturbances at every stage."""
        if self.failure or data._address != self.data._address:
            return  # a law or another thread may step another model
        step, stage = divmod(self.calls, self.scenario.stages)
        self.calls += 1
        try:
            if stage == 0:
                self.begin_step(data, step)
            elif self.drive_step and self.drive_step.rise_first:
                self.give_moment(data, stage)
            fraction = (0.0, 0.5, 0.5, LAST_STAGE)[stage]
            k, within = divmod(step, self.scenario.steps)
            t = k * self.scenario.control_period + (within + fraction) * self.scenario.physics_step
            d = self.apply_disturbances(data, t)
            if self.scenario.formula_friction:
                self.apply_friction(data, d, self.scenario.formula_friction)
            if stage == 0 and within == 0:
                x, v = data.qpos[self.channels["qpos"]], data.qvel[self.channels["qvel"]]
                delayed = self.delayed if self.drive_step else data.ctrl[self.channels["ctrl"]] / self.scale
                applied = np.zeros(len(x))  # the quotient may round to just beyond the limit
                applied[self.driven] = np.clip(delayed[self.driven], -self.limits, self.limits)
                sample = (
                    x,
                    v,
                    self.commands[-1],
                    applied,
                    self.s,
                    d,
                    self.r,
                    *self.forces / self.scenario.steps,
                    self.held,
                )
                for name, values in zip(LOG.names or (), sample, strict=True):
                    self.log[name][k] = values
                self.forces[:] = self.held[:] = 0.0
            if self.scenario.exact_friction:
                self.apply_exact_friction(data, d, stage)
        except Failure as failure:
            self.failure, self.failed_step = " ".join(str(failure).split()), step

    def begin_step(self, data: mujoco.MjData, step: int) -> None:
        """Begin a physics step: run the law if it is a sample, and apply the command whose delay has passed."""
        self.sum_forces(data)
        if not ((np.abs(data.qpos) < MAX_STATE).all() and (np.abs(data.qvel) < MAX_STATE).all()):
            raise Failure(PLANT_DIVERGED)
        k, within = divmod(step, self.scenario.steps)
        if within == 0:
            self.commands.append(self.commands[-1] if k else np.zeros(self.scenario.plant.n))
        if within == self.late(k) and not self.missed(k):
            t = k * self.scenario.control_period + within * self.scenario.physics_step
            self.commands[k], self.s = self.update_law(*self.measure(data, k, t), t)
            for name, values in (("u", self.commands[k]), ("s", self.s), ("r", self.r)):
                self.log[name][k] = values
        past = step - self.scenario.delay_steps
        if past >= 0 and past % self.scenario.steps >= self.late(past // self.scenario.steps):
            self.delayed = self.commands[past // self.scenario.steps]
        command, v = self.delayed, data.qvel[self.channels["shaft"]]
        if self.drive_step:
            self.rise = self.scale * self.drive_step.rise(command, self.first)
            command, self.first, self.second = self.drive_step(command, self.first, self.second, v)
        control = self.middle = self.scale * command
        control = control - self.rise
        if self.drive_step and self.drive_step.ripple:
            moving = zip(control, data.qpos[self.channels["qpos"]], v, strict=True)
            control = np.array([rippled(self.drive_step, *each) for each in moving])
        data.ctrl[self.channels["ctrl"][self.driven]] = control[self.driven]

    def give_moment(self, data: mujoco.MjData, stage: int) -> None:
        """Give the later stages of an RK4 step the force that has its mean and first moment, see `DriveStep`."""
        force = self.middle + self.rise if stage == 3 else self.middle
        data.ctrl[self.channels["ctrl"][self.driven]] = force[self.driven]
        if stage == 3:  # what the actuators did in the stage before, with the mean force
            self.forces[0] += np.where(self.has_drive, data.actuator_force[self.channels["force"]], 0.0)

    def late(self, k: int) -> int:
        """Return by how many physics steps sample k is late."""
        steps = self.scenario.clock.jitter_steps(self.scenario.physics_step)
        if not steps or k in (0, self.scenario.samples):
            return 0
        return int(random_words(self.scenario.noise_seed, 0, philox.JITTER, k)[0] * 2.0**-53 * (steps + 1))

    def missed(self, k: int) -> bool:
        """Return whether sample k does not run."""
        probability = self.scenario.clock.missed
        if not probability or k in (0, self.scenario.samples):
            return False
        return random_words(self.scenario.noise_seed, 0, philox.MISSED, k)[0] * 2.0**-53 < probability

    def measure(self, data: mujoco.MjData, k: int, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return measured positions and estimated velocities, (n,) each, at sample k, at time t, s."""
        x, v = data.sensordata[self.channels["x_sensor"]], data.sensordata[self.channels["v_sensor"]]
        j, sensor = k, self.scenario.sensor
        if sensor is not None and sensor.period is not None:
            j = max(0, math.floor((t - sensor.delay) / sensor.period + 1e-6))
        errors = [-0.0 if signal is None else evaluate(signal, t)[0] for signal in self.scenario.noise.errors]
        for i in range(len(x)):
            x[i], v[i] = self.read(i, x[i] + errors[0], v[i] + errors[1], j)
            v[i], self.a[i] = self.estimator(i, Reading(self.scenario.control_period, float(x[i]), float(v[i])))
        return x, v

    def read(self, i: int, x: float, v: float, j: int) -> tuple[float, float]:
        """Return reading j of channel i: true position x and velocity v with noise, bias, rounding and loss."""
        sigma, sensor, seed = self.scenario.noise, self.scenario.sensor, self.scenario.noise_seed
        if sigma.position or sigma.velocity:
            z = normals(seed, i, philox.MEASUREMENT, j)
            x, v = x + sigma.position * z[0], v + sigma.velocity * z[1]
        if sensor is None:
            return x, v
        x += sensor.bias
        if q := sensor.quantum(self.channels["hinge_body"][i] >= 0):
            x = q * float(np.floor(x / q + 0.5))
        if j > 0 and random_words(seed, i, philox.DROPOUT, j)[0] * 2.0**-53 < sensor.dropout:
            return self.last_reading[i, 0], self.last_reading[i, 1]
        self.last_reading[i] = x, v
        return x, v

    def update_law(self, x: np.ndarray, v: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return saturated commands and sliding variables, (n,) each, for measured x and v at time t, s."""
        scenario, n = self.scenario, len(x)
        feedforward = 0.0 if scenario.feedforward is None else evaluate(scenario.feedforward, t)[0]
        values = [evaluate(signal, t) for signal in references(scenario)]  # one for all channels, or one for each
        motion = np.array([values[i % len(values)] for i in range(n)]).T.copy()
        self.r, u, s = np.where(self.driven, motion[0], 0.0), np.zeros(n), np.zeros(n)
        if scenario.law.joint:
            u, s = self.law.call_joint(self.joint_measurement(x, v, t, motion))
            return np.array([self.bounded_command(i, u[i] + feedforward, s[i]) for i in range(n)]), s
        for i in np.flatnonzero(self.driven).tolist():
            u[i], s[i] = self.law(i, self.measurement(x, v, t, motion, i))
            u[i] = self.bounded_command(i, u[i] + feedforward, s[i])
        return u, s

    def measurement(self, x: np.ndarray, v: np.ndarray, t: float, motion: np.ndarray, i: int) -> Measurement:
        """Return what the law of channel i reads; `motion` has the references and two derivatives, (3, n)."""
        scenario, r, dr, ddr = self.scenario, *motion[:, i].tolist()
        xi, vi, (f, g) = float(x[i]), float(v[i]), self.model_at(x, v, i, i)
        y = Measurement(
            t, scenario.control_period, xi, vi, xi - r, vi - dr, r, dr, ddr, float(f), float(g),
            float(ddr if math.isnan(self.a[i]) else self.a[i]), scenario.limits[i], float(scenario.model == "nominal"),
        )  # fmt: skip
        if (j := i + len(scenario.limits)) < len(x):  # a joint without actuator, which moves with channel i
            fq, gq = self.model_at(x, v, j, i)
            y = y._replace(q=float(x[j]), dq=float(v[j]), fq=float(fq), gq=float(gq))
        if self.surface:
            sliding, v_eq = self.surface(i, y)
            y = y._replace(has_surface=1.0, s=sliding, v_eq=v_eq)
        return y

    def joint_measurement(self, x: np.ndarray, v: np.ndarray, t: float, motion: np.ndarray) -> JointMeasurement:
        """Return what a law of many joints reads, as `measurement` does for one."""
        scenario, (r, dr, ddr) = self.scenario, motion
        return JointMeasurement(
            t, scenario.control_period, float(scenario.model == "nominal"), NominalDynamics(scenario, x, v), x.copy(),
            v.copy(), x - r, v - dr, r, dr, ddr, np.where(np.isnan(self.a), ddr, self.a), self.limits.copy(),
            *dynamics(scenario, x, v),
        )  # fmt: skip

    def bounded_command(self, i: int, u: float, s: float) -> float:
        """Return the command u of channel i within its bound, and keep it in `last_u`."""
        limit = self.limits[i]
        self.last_u[i] = min(max(u, -limit), limit)
        if not (math.isfinite(u) and math.isfinite(s) and min(abs(u), limit) * max(1.0, self.scale) < MAX_CONTROL):
            raise Failure(f"{self.law.name} returned u = {u:g}, s = {s:g} in channel {i}")
        return self.last_u[i]

    def model_at(self, x: np.ndarray, v: np.ndarray, i: int, driven: int) -> tuple[float, float]:
        """Return nominal f and g of channel i, for the u of a driven channel."""
        f, g = nominal(self.scenario.plant, x, v, i, self.nominal, self.last_u)
        gain, drag = self.scenario.nominal_drive
        return f - drag * v[driven] * g, gain * g

    def apply_disturbances(self, data: mujoco.MjData, t: float) -> np.ndarray:
        """Apply the disturbances at time t, s, to the bodies. Return their generalised forces, (n,)."""
        xfrc, at = data.xfrc_applied.ravel(), self.channels
        xfrc[at["xfrc"]] = xfrc[at["horizontal"]] = 0.0
        self.apply_pushes(data, t)
        joints = np.zeros(len(self.driven))  # forces on the joints themselves, in a user's model
        for signal, memory, stream in zip(self.scenario.disturbance, self.signal_memory, self.streams, strict=True):
            if isinstance(signal, Push):
                continue
            if signal.random:
                seed = self.scenario.noise_seed
                d = [evaluate(signal, t, state, seed, i, stream)[0] for i, state in enumerate(memory)]
            elif signal.sees:
                d = self.feedback_force(signal, data, t, memory[0])
            else:
                d = evaluate(signal, t)[0]  # the same in all channels
            matched = at["sign"] * d * self.driven  # only on joints with an actuator
            joints += matched
            xfrc[at["horizontal" if signal.cartesian else "xfrc"]] += d if signal.cartesian else matched
        if self.scenario.plant.direct:
            xfrc[at["xfrc"]], data.qfrc_applied[at["qfrc"]] = 0.0, joints
        d = joints if self.scenario.plant.direct else at["sign"] * xfrc[at["xfrc"]]
        if self.hinged.any():
            anchor, axis = data.xanchor[at["anchor"] // 3], data.xaxis[at["anchor"] // 3]
            arm = data.xipos[at["hinge_body"] // 3] - anchor
            channel, j, k = np.arange(len(d)), at["axis"] + 1, (at["axis"] + 2) % 3
            turn = axis[channel, j] * arm[channel, k] - axis[channel, k] * arm[channel, j]
            d[self.hinged] += (turn * xfrc[at["horizontal"]])[self.hinged]
        if not np.isfinite(d).all():
            raise Failure("the disturbance became NaN or inf")
        return d

    def feedback_force(self, signal: Signal, data: mujoco.MjData, t: float, memory: np.ndarray) -> float:
        """Return the force of a disturbance that sees the loop: a new one at each sample, constant until the next."""
        k, rest = divmod(self.calls - 1, self.scenario.stages * self.scenario.steps)
        if rest == 0:
            dr = (self.r[0] - self.log["r"][k - 1, 0]) / self.scenario.control_period if k else 0.0
            x, v = data.qpos[self.channels["qpos"][0]], data.qvel[self.channels["qvel"][0]]
            evaluate(signal, t, memory, float(x - self.r[0]), float(v - dr), float(self.s[0]))
        return memory[0]

    def apply_pushes(self, data: mujoco.MjData, t: float) -> None:
        """Apply the disturbances that push one body each, at time t, s."""
        pushes = [signal for signal in self.scenario.disturbance if isinstance(signal, Push)]
        bodies = [self.model.body(push.body).id for push in pushes]
        data.xfrc_applied[bodies, :3] = 0.0
        for body, push in zip(bodies, pushes, strict=True):
            data.xfrc_applied[body, :3] += evaluate(push, t)[0] * np.array([push.x, push.y, push.z])

    def apply_friction(self, data: mujoco.MjData, d: np.ndarray, formula: Sliding) -> None:
        """Give the joints their friction by a formula for a physics step; d are the disturbances, (n,)."""
        at = self.channels
        for i, dof in enumerate(at["qvel"]):
            x, v = float(data.qpos[at["qpos"][i]]), float(data.qvel[dof])
            motor = float(data.actuator_force[at["force"][i]]) if self.has_drive[i] else 0.0
            load = float(data.qfrc_spring[dof] - data.qfrc_bias[dof])
            load += float(data.qfrc_constraint[dof] + d[i])
            friction, low, high = sliding_friction(formula, self.numbers[i], v, motor, load)
            stuck, before = not math.isnan(self.stuck_at[i]), self.speed[i]
            slows = abs(v) < STICKING_SPEED and abs(v) <= abs(before)
            if not stuck and (slows or v * before < 0.0):
                stuck, self.stuck_at[i] = True, x
            if stuck:
                stiffness, damping = self.bristles[i]
                spring = stiffness * (x - self.stuck_at[i])
                if low < high and low <= spring <= high:
                    friction = min(max(spring + damping * v, low), high)
                else:
                    self.stuck_at[i] = math.nan
            self.speed[i], data.ctrl[at["friction_ctrl"][i]] = v, -friction

    def apply_exact_friction(self, data: mujoco.MjData, d: np.ndarray, stage: int) -> None:
        """Give the joints the moments of their Coulomb friction at a stage of RK4; d are the disturbances, (n,)."""
        at, h = self.channels, self.scenario.physics_step
        for i, dof in enumerate(at["qvel"]):
            drive = float(data.ctrl[at["ctrl"][i]]) if self.driven[i] else 0.0
            level = float(self.model.dof_frictionloss[dof])
            others = float(data.qfrc_passive[dof] - data.qfrc_bias[dof] + d[i])
            if stage == 0:
                middle = self.middle[i] if self.drive_step and self.drive_step.rise_first else drive
                smooth, v, mobility = others + middle, float(data.qvel[dof]), float(data.qLDiagInv[dof])
                mean, rise, held = coulomb_step(v, smooth, level, mobility, h)
                sliding = 1.0 - held / h
                self.rubbing[i] = mean, rise, smooth, 1.0 - sliding * sliding if held > 0.0 else 0.0
                self.held[i] += held
            mean, rise, smooth, holding = self.rubbing[i]
            force = min(max(mean - holding * (others + drive - smooth), -level), level)
            force += (-rise, 0.0, 0.0, rise)[stage]
            data.qfrc_applied[dof] = force + (d[i] if self.scenario.plant.direct else 0.0)
            self.forces[1, i] += force / (6.0, 3.0, 3.0, 6.0)[stage]

    def sum_forces(self, data: mujoco.MjData) -> None:
        """Add the forces of the last physics step on the joints: of the drives, and of friction and contacts."""
        if not (self.drive_step and self.drive_step.rise_first):
            self.forces[0] += np.where(self.has_drive, data.actuator_force[self.channels["force"]], 0.0)
        self.forces[1] += data.qfrc_constraint[self.channels["qvel"]]
        if self.has_friction.any():
            self.forces[1, self.has_friction] += data.actuator_force[self.channels["friction_force"][self.has_friction]]


def gains_of(c: Component, n: int = 1) -> tuple:
    """Return the gains of a component as the record that its function reads: vectors (n,) for a law of many joints."""
    values: list[Any] = list(c.gains.values())
    if c.joint:
        each = [[gain_at(value, i) for i in range(n)] for value in values]
        values = [one[0] if name in c.shared else np.array(one) for name, one in zip(c.gains, each, strict=True)]
    return jit.named(tuple(c.gains))(*(values or [0.0]))


class PythonComponent:
    """A law, surface or estimator as the Python function that its author wrote, with a memory, (n, c.memory)."""

    def __init__(self, c: Component, n: int):
        self.name, self.returns = f"{c.kind} {c.name!r}", RETURN_VALUES[c.kind]
        self.memory = np.zeros((n, c.memory))
        parts = c.of_channels(n)  # one for each channel, or one for all
        parts = parts * n if len(parts) == 1 else parts
        functions = {id(part.function): part.function for part in parts}  # a callable object may have no hash
        uncompiled = {key: rebuild(function, lambda inner: inner) for key, function in functions.items()}
        own = [uncompiled[id(part.function)] for part in parts]
        self.functions = [function.fresh() if isinstance(function, jit.Uncompiled) else function for function in own]
        self.sizes = [part.memory for part in parts]
        gains = {id(part): gains_of(part, n) for part in {id(part): part for part in parts}.values()}
        self.gains = [gains[id(part)] for part in parts]  # the record that each reads

    def __call__(self, i: int, y: tuple) -> list[float]:
        """Return its two numbers for channel i, of a Reading or a Measurement; NaN for a missing acceleration."""
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
            raise Failure(f"{self.name} returned {shown(out)} instead of two vectors u, s of {n} numbers each")
        return u, s


def friction_numbers(formula: Sliding, i: int) -> tuple:
    """Return the numbers of channel i as the record that the formula of a friction reads."""
    return jit.named(formula.names)(*(formula.parameters(i) or [0.0]))


def sliding_friction(formula: Sliding, numbers: tuple, v: float, motor: float, load: float) -> list[float]:
    """Return the sliding friction by a formula with the `friction_numbers` of a channel, and its bounds at rest."""
    name = f"friction {type(formula).__name__}"
    try:
        out = type(formula).value(v, motor, load, numbers)
    except USER_EXCEPTIONS as error:
        raise failure_of(name, error) from error
    return as_floats(name, out, "a force and two bounds", 3)


class NominalDynamics:
    """The nominal mechanism, as `coriolis` and `jacobian` of control.joint_law call it in the reference loop."""

    def __init__(self, scenario: Scenario, x: np.ndarray, v: np.ndarray):
        self.scenario, self.x, self.v = scenario, x, v

    def coriolis(self, w: np.ndarray) -> np.ndarray:
        """Return C(x, v) w per unit of u, (n,)."""
        plant, nominal = self.scenario.plant, self.nominal
        if nominal is None:
            return np.zeros(len(self.x))
        return nominal.coriolis(self.x, self.v, w, Values(**plant.parameters)) / self.scenario.nominal_drive.gain

    def jacobian(self) -> np.ndarray:
        """Return the tip's Jacobian, (3, n)."""
        plant, nominal = self.scenario.plant, self.nominal
        if nominal is None or not plant.tip:
            raise ValueError("there is no tip, or the law has no model: give the plant a tip, and the law the model")
        return nominal.jacobian(self.x, Values(**plant.parameters), plant.tip)

    @property
    def nominal(self) -> NominalModel | None:
        """The nominal model of all joints, if the plant has one and the law may use it."""
        model = self.scenario.plant.nominal
        return model if isinstance(model, NominalModel) and self.scenario.resolved.model == "nominal" else None


def dynamics(scenario: Scenario, x: np.ndarray, v: np.ndarray) -> Dynamics:
    """Return the M, h and g that a law of many joints sees at measured x and v, (n,) each, per unit of u."""
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
        terms = Dynamics(np.diag(1.0 / moving[:, 1]), -moving[:, 0] / moving[:, 1], -resting[:, 0] / resting[:, 1])
    return Dynamics(terms.M / gain, (terms.h + drag * v) / gain, terms.g / gain)


def evaluate(signal: Signal, t: float, *state: Any) -> list[float]:
    """Return a signal and its two derivatives at time t, s.

    The state is memory, seed, channel and stream for process noise, and memory, e, e' and s for one that sees the loop.
    """
    name = type(signal).__name__
    try:
        inputs = state if signal.random or signal.sees else (signal.data,) if signal.series else ()
        out = type(signal).value(t, signal, *inputs)
    except USER_EXCEPTIONS as error:
        raise failure_of(name, error) from error
    return as_floats(name, out, "a value and two derivatives", 3)


def nominal(plant: Plant, x: np.ndarray, v: np.ndarray, i: int, values: Values, u: np.ndarray) -> tuple[float, float]:
    """Return nominal f and g of channel i. The model of coupled channels also depends on the last commands u, (n,)."""
    try:
        return plant.nominal(x, v, i, values, *((u,) if isinstance(plant.nominal, NominalModel) else ()))
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
    """Return the result of a user's function as `count` floats; raise Failure if it is anything else."""
    try:
        values = [float(value) for value in out]
    except (TypeError, ValueError, OverflowError):
        values = []
    if len(values) != count:
        raise Failure(f"{name} returned {shown(out)} instead of {expected}")
    return values


def normals(seed: int, channel: int, stream: int, k: int) -> tuple[float, float]:
    """Return the numbers of philox.normals, from numpy's generator."""
    first, second = random_words(seed, channel, stream, k)
    radius = math.sqrt(-2.0 * math.log((first + 1) * 2.0**-53))
    angle = 2.0 * math.pi * second * 2.0**-53
    return radius * math.cos(angle), radius * math.sin(angle)


def random_words(seed: int, channel: int, stream: int, k: int) -> tuple[int, int]:
    """Return two whole numbers of 53 random bits, from numpy's generator."""
    counter = (k - 1 + (stream << 64)) % 2**256
    first, second = np.random.Philox(key=seed + (channel << 64), counter=counter).random_raw(2)
    return int(first) >> 11, int(second) >> 11
