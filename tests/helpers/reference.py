"""The oracle of runs: mj_step, controlled by the `Controller` in Python.

The tests compare the compiled callback with it: the same Scenario must give the same Trace. It is
written to be read, with numpy's Philox and none of the callback's code. A step takes tens of
microseconds.
"""

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

from helpers.python_controller import Controller
from smc_mujoco.common import jit
from smc_mujoco.mechanisms.hardware import stepper
from smc_mujoco.mechanisms.hardware.drives import DriveStep, advanced, drive_step, rippled
from smc_mujoco.mechanisms.hardware.friction import dry_step
from smc_mujoco.mechanisms.hardware.moments import JointState, torque
from smc_mujoco.mechanisms.hardware.own_friction import OwnFriction
from smc_mujoco.mechanisms.hardware.sliding import STICKING_SPEED, Sliding
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.callback import installed
from smc_mujoco.simulation.controller import MAX_STATE
from smc_mujoco.simulation.prepare import pause_phase
from smc_mujoco.simulation.python_functions import Failure, evaluate, failure_of
from smc_mujoco.simulation.run import DISTURBANCE_NOT_FINITE, PLANT_DIVERGED
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Push, Signal
from smc_mujoco.simulation.state import LOG
from smc_mujoco.simulation.step import LAST_STAGE
from smc_mujoco.simulation.trace import Trace, from_log


def run(scenario: Scenario) -> Trace:
    """Return the trace of a scenario."""
    with installed():
        loop = Loop(scenario, models.mechanism(scenario))
    # the loop itself checks for NaN and inf
    with installed(loop.control), np.errstate(all="ignore"):
        for step in range(loop.total + 1):
            loop.step(step)
            if loop.failure:
                break
    return from_log(scenario, loop.log, loop.failed_step, loop.failure)


def motors_at_start(s: Scenario) -> list[dict[str, float]]:
    """Return each stepper motor at the start of a run: at rest, with its field at its joint."""
    zero = dict.fromkeys(stepper.GENERATOR, 0.0) | {"stepped": -math.inf, "until": math.inf}
    motors = []
    for i in range(s.plant.driven):
        phase = philox.random_words(s.seed, i, philox.REFILL, 0)[0] * 2.0**-53
        motors.append(zero | {"phase": phase, "origin": s.resolved.x0[i]})
    return motors


def evaluate_friction(
    formula: Sliding, numbers: tuple, i: int, v: float, motor: float, load: float
) -> tuple[float, float, float]:
    """Return the sliding friction of joint i by a formula, and its bounds at rest."""
    try:
        if isinstance(formula, OwnFriction):
            return by_function(formula, numbers, v, motor, load)
        return type(formula).value(v, motor, load, numbers)
    except Exception as error:
        raise failure_of(f"friction {type(formula).__name__}", error, channel=i) from error


def by_function(
    part: OwnFriction, numbers: tuple, v: float, motor: float, load: float
) -> tuple[float, float, float]:
    """Return the friction of a user's function of speed and load, and its bounds at rest."""
    y = JointState(0.0, 0.0, 0.0, v, 0.0, motor, load)
    force = type(part).function(y, numbers, np.zeros(0))
    if isinstance(force, tuple):
        return force
    rest = abs(type(part).function(y._replace(v=0.0), numbers, np.zeros(0)))
    return math.copysign(force, v), -rest, rest


def advance(
    effect: DriveStep, u: np.ndarray, first: np.ndarray, second: np.ndarray, v: np.ndarray
) -> np.ndarray:
    """Return the mean force over a step and both states at its end, (3, ...), without compiling."""
    next_states = []
    for command, state, second_state, speed in zip(u, first, second, v, strict=True):
        states = SimpleNamespace(first=state, second=second_state)
        next_states.append(
            (advanced.py_func(effect, states, command, speed), states.first, states.second)
        )
    return np.array(next_states).T


class Motor:
    """A stepper motor, by the functions of hardware.stepper, without their compilation."""

    def __init__(self, part: stepper.Stepper, values: dict[str, float]):
        self.state = SimpleNamespace(**values)
        self.numbers = stepper.pulsing(part)
        self.queue = [0.0] * (2 * part.queued)

    def step(self, u: float | None, step: int, h: float) -> None:
        """Turn the field through a physics step of h s; u is a command that arrives at its start,
        or None.
        """
        start = step * h
        end = (step + 1) * h
        if u is not None:
            stepper.command(self.state, self.numbers, u, start)
        stepper.advance(self.state, self.numbers, self.queue, start, end)
        stepper.field(self.state, self.numbers, self.queue, start, end)

    def torque(self, x: float, sign: int) -> float:
        """Return the torque on a joint at x; sign is -1 and 1 in the first and last stage of RK4,
        else 0.
        """
        return stepper.torque(
            self.state, self.numbers, x, self.state.middle + sign * self.state.rise
        )


class Loop:
    """One simulation and its controller; `control` is the control callback."""

    def __init__(self, scenario: Scenario, mechanism: models.Mechanism):
        self.scenario = scenario.resolved
        n = scenario.plant.n
        self.base = mechanism.model
        table = mechanism.channels
        self.model = models.with_values(self.base, scenario)
        self.data = mujoco.MjData(self.model)
        self.channels = {name: table[name].copy() for name in table.dtype.names or ()}
        self.driven = self.channels["ctrl"] >= 0
        self.hinged = self.channels["hinge_body"] >= 0
        self.has_friction = self.channels["friction_force"] >= 0
        self.has_drive = self.channels["force"] >= 0
        models.put_initial_state(self.model, self.data, scenario)
        self.total = scenario.samples * scenario.steps  # physics steps
        self.loops = self.with_pauses()
        self.calls = 0
        self.controller = Controller(scenario)
        self.signal_memory = [
            [np.zeros(max(d.memory, 1)) for _ in range(n)] for d in scenario.disturbance
        ]
        self.streams = [scenario.noise_stream(j) for j in range(len(scenario.disturbance))]
        self.commands: list[np.ndarray] = []
        self.d = np.zeros(n)  # disturbances at the last stage
        # sums over a control period: of the drives, of friction and contacts
        self.forces = np.zeros((2, n))
        self.drive_step = drive_step(
            scenario.drive_train.chains[0], scenario.resolved.physics_step, scenario.stages > 1
        )
        if self.drive_step:  # both states of the drives
            self.first, self.second = self.drive_step.start(self.data.qvel[self.channels["shaft"]])
        # the mean force in a step of RK4, and its rise to the last stage
        self.middle, self.rise = np.zeros((2, n))
        names = channel_names(scenario.plant)
        self.formulas: list[Sliding | None] = [None] * n
        self.numbers: list[tuple] = [()] * n
        for formula in self.scenario.friction:
            if not isinstance(formula, Sliding):
                continue
            record = jit.named(formula.names)
            for place, joint in enumerate(formula.joint_names(scenario.plant)):
                i = names.index(joint)
                self.formulas[i] = formula
                self.numbers[i] = record(*(formula.parameters(place) or [0.0]))
        self.speed = [0.0] * n  # at the step before
        self.stuck_at = [math.nan] * n
        self.level = [0.0] * n  # of MuJoCo's dry friction, in the step before
        # of dry friction, see `apply_exact_friction`: None while a formula gives it at every stage
        self.rubbing: list[tuple | None] = [None] * n
        # speed, F and slope of a user's function, see `while_sliding`
        self.line = [(0.0, 0.0, 0.0)] * n
        self.stuck = [False] * n
        self.held = np.zeros(n)
        self.motors = []
        for part in scenario.actuator:
            if isinstance(part, stepper.Stepper):
                self.motors = [Motor(part, values) for values in motors_at_start(self.scenario)]
        self.sent = np.zeros(n)  # the commands whose delay has passed
        self.delayed = np.zeros(n)  # those that the actuators get
        self.log = np.full((scenario.samples + 1, n), np.nan, LOG)
        self.failure: str | None = None
        self.failed_step = 0  # physics step

    def step(self, step: int) -> None:
        """Do physics step 0, 1, ..., with `control` installed.

        The step after the last one only completes the log.
        """
        if step == self.scenario.jump_step:
            models.put_values(self.model, self.base, self.scenario, step)
            mujoco.mj_setConst(self.model, mujoco.MjData(self.model))
        if step < self.total:
            mujoco.mj_step(self.model, self.data)
        else:
            mujoco.mj_forward(self.model, self.data)

    def control(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Control callback: run the law at the first stage of a sample, and apply the disturbances
        at every stage.
        """
        if self.failure:
            return
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
            d = self.d = self.apply_disturbances(data, t)
            if any(self.formulas) and not self.scenario.exact_friction:
                self.apply_friction(data, d)
            if stage == 0 and within == 0:
                x = data.qpos[self.channels["qpos"]]
                v = data.qvel[self.channels["qvel"]]
                applied = np.where(self.driven, self.delayed, 0.0)
                sample = (
                    x,
                    v,
                    self.commands[-1],
                    applied,
                    self.controller.s,
                    d,
                    self.controller.r,
                    *self.forces / self.scenario.steps,
                    self.held,
                    self.controller.added,
                )
                for name, values in zip(LOG.names or (), sample, strict=True):
                    self.log[name][k] = values
                self.forces[:] = self.held[:] = 0.0
            self.apply_motors(data, stage)
            if self.scenario.exact_friction:
                self.apply_exact_friction(data, d, stage)
        except Failure as failure:
            self.failure = " ".join(str(failure).split())
            self.failed_step = step

    def begin_step(self, data: mujoco.MjData, step: int) -> None:
        """Begin a physics step: run the law if it is a sample, and apply the command whose delay
        has passed.
        """
        self.sum_forces(data)
        if not ((np.abs(data.qpos) < MAX_STATE).all() and (np.abs(data.qvel) < MAX_STATE).all()):
            raise Failure(PLANT_DIVERGED)
        k, within = divmod(step, self.scenario.steps)
        if within == 0:
            self.commands.append(self.commands[-1] if k else np.zeros(self.scenario.plant.n))
        if within == self.late(k):
            t = k * self.scenario.control_period + within * self.scenario.physics_step
            places = self.channels
            if self.scenario.model == "true":
                self.controller.reported = self.d + self.forces[1] / self.scenario.steps
            x = data.sensordata[places["x_sensor"]]
            v = data.sensordata[places["v_sensor"]]
            self.commands[k], self.log["s"][k] = self.controller(k, t, x, v)
            self.log["u"][k] = self.commands[k]
            self.log["r"][k] = self.controller.r
        past = step - self.scenario.delay_steps
        if past >= 0 and past % self.scenario.steps >= self.late(past // self.scenario.steps):
            self.sent = self.commands[past // self.scenario.steps]
        self.delayed = self.with_fault(step)
        if self.motors:
            sample, rest = divmod(past, self.scenario.steps)
            arrives = past >= 0 and rest == self.late(sample)
            for motor, u in zip(self.motors, self.delayed, strict=False):
                motor.step(float(u) if arrives else None, step, self.scenario.physics_step)
            return
        command = self.delayed
        v = data.qvel[self.channels["shaft"]]
        if self.drive_step:
            self.rise = self.controller.scale * (
                self.drive_step.rise_first * (self.first - command)
            )
            states = advance(self.drive_step, command, self.first, self.second, v)
            command, self.first, self.second = states
        control = self.middle = self.controller.scale * command
        control = control - self.rise
        if self.drive_step and self.drive_step.ripple:
            moving = zip(
                control,
                data.qpos[self.channels["qpos"]],
                v,
                strict=True,
            )
            control = np.array([rippled(self.drive_step, *joint) for joint in moving])
        data.ctrl[self.channels["ctrl"][self.driven]] = control[self.driven]

    def with_fault(self, step: int) -> np.ndarray:
        """Return the commands that the actuators get in a physics step."""
        fault = self.scenario.fault
        if fault is None or step < self.scenario.fault_step:
            return self.sent
        faulty = self.delayed
        if not fault.stuck:
            faulty = fault.gain * self.sent + fault.bias
        failing = self.scenario.failing()
        if failing < 0:
            return faulty
        return np.where(np.arange(len(faulty)) == failing, faulty, self.sent)

    def apply_motors(self, data: mujoco.MjData, stage: int) -> None:
        """Give every stepper motor its torque at a stage."""
        rk4 = self.scenario.stages > 1
        for i, motor in enumerate(self.motors):
            force = motor.torque(
                float(data.qpos[self.channels["shaft_qpos"][i]]), (-1, 0, 0, 1)[stage] if rk4 else 0
            )
            data.ctrl[self.channels["ctrl"][i]] = force
            self.forces[0, i] += force / ((6.0, 3.0, 3.0, 6.0)[stage] if rk4 else 1.0)

    def give_moment(self, data: mujoco.MjData, stage: int) -> None:
        """Give the later stages of an RK4 step the force that has its mean and first moment, see
        `DriveStep`.
        """
        if stage == 3:
            force = self.middle + self.rise
        else:
            force = self.middle
        data.ctrl[self.channels["ctrl"][self.driven]] = force[self.driven]
        if stage == 3:  # what the actuators did in the stage before, with the mean force
            self.forces[0] += np.where(
                self.has_drive, data.actuator_force[self.channels["force"]], 0.0
            )

    def late(self, k: int) -> int:
        """Return by how many physics steps sample k is late; -1 if it does not run."""
        clock = self.scenario.clock
        seed = self.scenario.seed
        if k in (0, self.scenario.samples):
            return 0
        if (
            clock.missed
            and philox.random_words(seed, 0, philox.MISSED, k)[0] * 2.0**-53 < clock.missed
        ):
            return -1
        if self.loops is not None:
            return self.loops.get(k, -1)
        if not (steps := clock.jitter_steps(self.scenario.physics_step)):
            return 0
        return int(philox.random_words(seed, 0, philox.JITTER, k)[0] * 2.0**-53 * (steps + 1))

    def with_pauses(self) -> dict[int, int] | None:
        """Return the samples of a loop with pauses, and by how many physics steps each is late;
        None without pauses.
        """
        s = self.scenario
        late = {}
        step = 0
        length, samples = s.clock.pauses(s.control_period, s.physics_step)
        if not length:
            return None
        count = pause_phase(s)  # samples since the last pause
        while step <= self.total:
            late[step // s.steps] = step % s.steps
            count += 1
            step += s.steps
            if count == samples:
                step, count = step + length, 0
        return late

    def apply_disturbances(self, data: mujoco.MjData, t: float) -> np.ndarray:
        """Apply the disturbances at time t, s, to the bodies.

        Return their generalised forces, (n,).
        """
        xfrc = data.xfrc_applied.ravel()
        places = self.channels
        xfrc[places["xfrc"]] = xfrc[places["horizontal"]] = 0.0
        self.apply_pushes(data, t)
        joints = np.zeros(len(self.driven))  # forces on the joints themselves, in a user's model
        for signal, memory, stream in zip(
            self.scenario.disturbance, self.signal_memory, self.streams, strict=True
        ):
            if isinstance(signal, Push):
                continue
            d = self.disturbance(signal, data, t, memory, stream)
            matched = places["sign"] * d * self.driven  # only on joints with an actuator
            joints += matched
            if signal.cartesian:
                xfrc[places["horizontal"]] += d
            else:
                xfrc[places["xfrc"]] += matched
        d = places["sign"] * xfrc[places["xfrc"]]
        if self.scenario.plant.direct:
            xfrc[places["xfrc"]] = 0.0
            data.qfrc_applied[places["qfrc"]] = d = joints
        if self.hinged.any():
            anchor = data.xanchor[places["anchor"] // 3]
            axis = data.xaxis[places["anchor"] // 3]
            arm = data.xipos[places["hinge_body"] // 3] - anchor
            channel = np.arange(len(d))
            j = places["axis"] + 1
            k = (places["axis"] + 2) % 3
            turn = axis[channel, j] * arm[channel, k] - axis[channel, k] * arm[channel, j]
            d[self.hinged] += (turn * xfrc[places["horizontal"]])[self.hinged]
        if not np.isfinite(d).all():
            raise Failure(DISTURBANCE_NOT_FINITE)
        return d

    def disturbance(self, signal, data, t, memory, stream):
        """Return a disturbance at time t, s: of each channel, or the same in all."""
        if signal.random:
            seed = self.scenario.seed
            return [
                evaluate(signal, t, state, seed, i, stream)[0] for i, state in enumerate(memory)
            ]
        if signal.sees:
            return self.feedback_force(signal, data, t, memory[0])
        return evaluate(signal, t)[0]

    def feedback_force(
        self, signal: Signal, data: mujoco.MjData, t: float, memory: np.ndarray
    ) -> float:
        """Return the force of a disturbance that sees the loop: a new one at each sample, constant
        until the next.
        """
        k, rest = divmod(self.calls - 1, self.scenario.stages * self.scenario.steps)
        if rest == 0:
            r = float(self.controller.r[0])
            s = float(self.controller.s[0])
            if k:
                dr = (r - self.log["r"][k - 1, 0]) / self.scenario.control_period
            else:
                dr = 0.0
            x = data.qpos[self.channels["qpos"][0]]
            v = data.qvel[self.channels["qvel"][0]]
            evaluate(
                signal,
                t,
                memory,
                float(x - r),
                float(v - dr),
                s,
            )
        return memory[0]

    def apply_pushes(self, data: mujoco.MjData, t: float) -> None:
        """Apply the disturbances that push one body each, at time t, s."""
        pushes = []
        for signal in self.scenario.disturbance:
            if isinstance(signal, Push):
                pushes.append(signal)
        bodies = [self.model.body(push.body).id for push in pushes]
        data.xfrc_applied[bodies, :3] = 0.0
        for body, push in zip(bodies, pushes, strict=True):
            data.xfrc_applied[body, :3] += evaluate(push, t)[0] * np.array([push.x, push.y, push.z])

    def seldom(self, i: int) -> bool:
        """Return whether joint i has a user's function, which is called seldom."""
        return isinstance(self.formulas[i], OwnFriction)

    def evaluate(self, i: int, v: float, motor: float, load: float) -> Sequence[float]:
        """Return the friction by a formula of joint i and its bounds at rest, 0 without one."""
        if (formula := self.formulas[i]) is None:
            return 0.0, 0.0, 0.0
        return evaluate_friction(formula, self.numbers[i], i, v, motor, load)

    def apply_friction(self, data: mujoco.MjData, d: np.ndarray) -> None:
        """Give the joints their friction by a formula for a physics step; d are the disturbances,
        (n,).
        """
        places = self.channels
        for i, dof in enumerate(places["qvel"]):
            if self.formulas[i] is None:
                continue
            v = float(data.qvel[dof])
            if self.has_drive[i]:
                motor = float(data.actuator_force[places["force"][i]])
            else:
                motor = 0.0
            load = float(data.qfrc_spring[dof] - data.qfrc_bias[dof])
            held = float(data.qfrc_constraint[dof])
            load += held + d[i]
            if (shaft := places["shaft"][i]) not in (-1, dof):
                load += data.qfrc_constraint[shaft]
                held += data.qfrc_constraint[shaft]
            load -= min(max(held, -self.level[i]), self.level[i])
            friction, low, high = self.evaluate(i, v, motor, load)
            slow = abs(v) < STICKING_SPEED or v * self.speed[i] < 0.0
            self.speed[i] = v
            force = 0.0
            level = abs(friction)
            away = 0.0
            if low >= high:
                force = -friction
                level = 0.0
            elif not slow:
                self.stuck_at[i] = math.nan
            else:
                x = float(data.qpos[places["qpos"][i]])
                if math.isnan(self.stuck_at[i]):
                    self.stuck_at[i] = x
                away = x - self.stuck_at[i]
                force = -0.5 * (low + high)
                level = 0.5 * (high - low)
            self.level[i] = float(self.model.dof_frictionloss[dof]) + level
            row = (data.efc_type == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF) & (
                data.efc_id == dof
            )
            data.efc_frictionloss[row] = self.level[i]
            h = self.scenario.resolved.physics_step
            data.efc_aref[row] -= away / (h * h)
            data.qfrc_applied[dof] = force + (d[i] if self.scenario.plant.direct else 0.0)
            self.forces[1, i] += force

    def apply_exact_friction(self, data: mujoco.MjData, d: np.ndarray, stage: int) -> None:
        """Give the joints their dry friction at a stage of RK4, by its formula or by its moments in
        the step; d are the disturbances, (n,).
        """
        places = self.channels
        for i, dof in enumerate(places["qvel"]):
            v = float(data.qvel[dof])
            if self.driven[i]:
                drive = torque(
                    self.scenario.drive_train.torques[i], float(data.ctrl[places["ctrl"][i]]), v
                )
            else:
                drive = 0.0
            load = float(data.qfrc_spring[dof] - data.qfrc_bias[dof]) + d[i]
            other_forces = float(data.qfrc_passive[dof] - data.qfrc_bias[dof] + d[i])
            if stage == 0:
                if self.drive_step and self.drive_step.rise_first:
                    smooth = other_forces + self.middle[i]
                else:
                    smooth = other_forces + drive
                self.rubbing[i] = self.begin_friction(data, i, smooth, drive, load)
            moments = self.rubbing[i]
            if moments is None:
                force = -self.while_sliding(i, v, drive, load, stage)
            else:
                mean, rise, smooth, holding, low, high = moments
                force = min(max(mean - holding * (other_forces + drive - smooth), low), high)
                force += (-rise, 0.0, 0.0, rise)[stage]
            data.qfrc_applied[dof] = force + (d[i] if self.scenario.plant.direct else 0.0)
            self.forces[1, i] += force / (6.0, 3.0, 3.0, 6.0)[stage]

    def while_sliding(self, i: int, v: float, drive: float, load: float, stage: int) -> float:
        """Return the force of friction on a sliding joint at a stage. A user's function is called at
        the first two; the last two are on the line through them.
        """
        if stage > 1 and self.seldom(i):
            v0, f0, slope = self.line[i]
            return f0 + slope * (v - v0)
        f = self.evaluate(i, v, drive, load)[0]
        if stage == 0:
            self.line[i] = v, f, 0.0
        elif self.seldom(i):
            v0, f0, _ = self.line[i]
            self.line[i] = v0, f0, (f - f0) / (v - v0) if v != v0 else 0.0
        return f

    def opening_speed(
        self, i: int, v: float, slow: bool, mobility_step: float, smooth: float
    ) -> float:
        """Return the speed of joint i at which its friction is taken first in a step."""
        if not self.seldom(i):
            return v
        if slow:
            return 0.0
        formula: Any = self.formulas[i]
        alone = abs(v) <= -math.copysign(mobility_step, v) * smooth
        if formula.levels and alone and self.evaluate(i, 0.0, 0.0, 0.0)[2] > 0.0:
            return math.copysign(STICKING_SPEED, v)
        return v

    def begin_friction(
        self, data: mujoco.MjData, i: int, smooth: float, drive: float, load: float
    ) -> tuple | None:
        """Return the moments of a joint's dry friction in a step, and its bounds; None if its
        formula acts at every stage.
        """
        dof = self.channels["qvel"][i]
        h = self.scenario.physics_step
        mobility = float(data.qLDiagInv[dof])
        v = float(data.qvel[dof])
        if not any(self.formulas):
            high = float(self.model.dof_frictionloss[dof])
            low = -high
            sliding = -math.copysign(high, v)
            starting = -math.copysign(high, smooth)
        else:

            def force(v: float) -> Sequence[float]:
                return self.evaluate(i, v, drive, load)

            slow = abs(v) < STICKING_SPEED and (self.stuck[i] or abs(v) <= abs(self.speed[i]))
            f, low, high = force(self.opening_speed(i, v, slow, h * mobility, smooth))
            self.speed[i] = v
            stops = abs(v) <= -math.copysign(h * mobility, v) * (smooth - f)
            if low >= high or not (slow or stops or v == 0.0):
                self.stuck[i] = False
                return None
            if slow:
                sliding = -high if v > 0.0 else -low
            elif self.seldom(i):
                sliding = -f
            else:
                sliding = -force(0.5 * v)[0]
            if self.seldom(i) and low <= smooth <= high:
                starting = -high if math.copysign(1.0, smooth) > 0.0 else -low
            else:
                starting = -force(math.copysign(STICKING_SPEED, smooth))[0]
            if smooth * (smooth + starting) <= 0.0:
                low, high = min(low, smooth), max(high, smooth)
        mean, rise, held = dry_step(v, smooth, sliding, starting, low, high, mobility, h)
        self.held[i] += held
        self.stuck[i] = held > 0.0
        slid = 1.0 - held / h
        bounds = min(-high, sliding, starting), max(-low, sliding, starting)
        return mean, rise, smooth, 1.0 - slid * slid if held > 0.0 else 0.0, *bounds

    def sum_forces(self, data: mujoco.MjData) -> None:
        """Add the forces of the last physics step on the joints: of the drives, and of friction and
        contacts.
        """
        if not (self.motors or (self.drive_step and self.drive_step.rise_first)):
            self.forces[0] += np.where(
                self.has_drive, data.actuator_force[self.channels["force"]], 0.0
            )
        self.forces[1] += data.qfrc_constraint[self.channels["qvel"]]
        if self.has_friction.any():
            self.forces[1, self.has_friction] += data.actuator_force[
                self.channels["friction_force"][self.has_friction]
            ]
