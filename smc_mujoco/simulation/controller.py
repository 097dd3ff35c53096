"""The controller: what the control callback does in one simulation, according to its record.

At the first stage of a control sample, for each channel:

    sensors -> noise, encoder -> velocity estimator -> law -> saturation -> delay buffer

A sample may come late in its period, or be missed, see `Clock`. The log then repeats the command of
the sample before. At the first stage of a physics step, the command whose delay has passed goes to
ctrl, through lags and rate limits. At every stage, disturbance(t) goes to xfrc_applied. Then a
friction by a formula goes to ctrl; its steps have one stage. Dry friction on joints that move alone
goes to qfrc_applied, at every stage of RK4. Each sample is logged with the mean forces since the
last one.

The controller counts its calls, because mjData.time does not tell the last stage of a step from the
start of the next: RK4 calls at t, t + h/2, t + h/2 and t + h, and the next step begins at t + h
again. A run that diverges, or whose law raises an exception, is marked in its record and gets no
more control. The other simulations of the batch continue.

Private functions take the address of the record, the record `sim`, and `data`, the Arrays of its
mjData. Those that can fail return a failure code of state.py, unless they say otherwise.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import math
from collections import namedtuple

import numpy as np
from numba import njit

from smc_mujoco.common.jit import call, integers, pointer
from smc_mujoco.common.mjcb import slots
from smc_mujoco.control.joint_law import head_at
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.hardware import drives, stepper
from smc_mujoco.mechanisms.hardware.drives import rippled
from smc_mujoco.mechanisms.hardware.friction import dry_step
from smc_mujoco.mechanisms.hardware.rotors import DRAG_AXES, rotor_at, speed_for, spun, thrust_at
from smc_mujoco.mechanisms.hardware.sliding import STICKING_SPEED
from smc_mujoco.simulation import philox
from smc_mujoco.simulation import state as record
from smc_mujoco.simulation.signals import after_pauses
from smc_mujoco.simulation.state import (
    channel_at,
    disturbance_at,
    function_at,
    log_at,
    motor_at,
    state_at,
)

MAX_STATE = 1e6  # SI units: a run with larger |x| or |v| has diverged; MuJoCo gives up at 1e10
# of a step: where RK4's last stage evaluates signals, just before a jump at the step's end
LAST_STAGE = 1.0 - 1e-8
OTHER_CALLBACKS = len(slots())
FAST_ROTOR = 12.0  # time constants in a step: with more, a rotor has no lag
MAX_CONTROL = 1e10  # MuJoCo drops all controls if one is larger


# Arrays of one mjData, as pointers to their numbers; of its mjModel the levels of dry friction, and
# the addresses of what rotors and drag have.
Arrays = namedtuple(
    "Arrays",
    """qpos qvel ctrl xfrc_applied qfrc_applied sensordata xipos xanchor xaxis
    actuator_force qfrc_constraint qfrc_bias qfrc_spring qfrc_passive qfrc_actuator qLDiagInv
    dof_frictionloss actuator_user body_user""",
)


@njit(error_model="numpy")
def control(address, sim, data):  # noqa: PLR0912
    """Do one callback of one simulation."""
    calls = sim.calls
    sim.calls = calls + 1
    if sim.failure != record.FINE:
        return
    stages = sim.stages
    steps = sim.steps
    step = calls // stages
    stage = calls % stages
    k = step // steps
    within = step % steps
    failure = record.FINE
    if _interfered(sim):
        failure = record.INTERRUPTED
    _remove_exact_friction(sim, data)
    if stage == 0:
        _sum_forces(sim, data)
        if _diverged(sim, data):
            failure = record.DIVERGED
        elif k >= sim.samples:  # the simulation is stepped beyond its end
            failure = record.INTERRUPTED
        elif failure == record.FINE:
            failure = _sample(address, sim, data, k, within)
        _actuate(sim, data, step)
    elif sim.drive_step.rise_first != 0.0:
        _give_moment(sim, data, stage)
    if sim.rotors != 0:
        _fly(sim, data, step, stage)
    if sim.disturbance_count != 0 and failure == record.FINE:
        if stage == 0:
            fraction = 0.0
        else:
            fraction = LAST_STAGE if stage == 3 else 0.5
        sample = k if stage + within == 0 else -1
        failure = _apply_disturbances(
            address, sim, data, k * sim.period + (within + fraction) * sim.step, sample
        )
    # bristles, whose integrator has one stage
    if sim.frictions != 0 and sim.exact_friction == 0 and failure == record.FINE:
        failure = _apply_friction(address, sim, data)
    if failure == record.FINE:
        if stage == 0 and within == 0:
            _log(sim, data, k)
        failure = _apply_to_joints(address, sim, data, stage)
    if failure != record.FINE:
        sim.failure = failure
        sim.failed_step = step
        _remove_exact_friction(sim, data)
        _zero_inputs(sim, data)


@njit(error_model="numpy", inline="always")
def _apply_to_joints(address, sim, data, stage):
    """Give the joints what stepper motors and exact friction exert at a stage."""
    if sim.motors != 0:
        _apply_steppers(sim, data, stage)
    if sim.exact_friction != 0:
        return _apply_exact_friction(address, sim, data, stage)
    return record.FINE


@njit(error_model="numpy", inline="always")
def _late(sim, k):
    """Return by how many physics steps sample k is late; -1 if it does not run."""
    if k == 0 or k == sim.samples - 1:
        return 0
    if sim.missed != 0.0 and philox.uniform(sim.seed, 0, philox.MISSED, k) < sim.missed:
        return -1
    if sim.pause != 0:
        return after_pauses(k, sim.steps, sim.pause, sim.pause_samples, sim.pause_phase)
    if sim.jitter == 0:
        return 0
    return int(philox.uniform(sim.seed, 0, philox.JITTER, k) * (sim.jitter + 1))


@njit(error_model="numpy", inline="always")
def _sample(address, sim, data, k, within):
    """Run the law at sample k, if the sample comes in this physics step, `within` steps into its
    period.
    """
    late = _late(sim, k)
    if within == 0 and late != 0:
        _repeat_command(sim, k)
    if within != late:
        return record.FINE
    t = k * sim.period + late * sim.step
    failure = _measure(address, sim, data, k, t)
    if failure == record.FINE:
        failure = update_law(address, sim, k, t)
    if failure != record.FINE and late != 0:  # some channels may have written into the log
        _repeat_command(sim, k)
    return failure


@njit(error_model="numpy")
def _repeat_command(sim, k):
    """Give sample k the command of the sample before, with its u, s and r in the log."""
    buffer = pointer(sim.delay_buffer + 8 * sim.n * (k % sim.delay_slots))
    last_u = pointer(sim.seen.u)
    for i in range(sim.n):
        sample = log_at(sim.log, k * sim.n + i)
        before = log_at(sim.log, (k - 1) * sim.n + i)
        sample.u, sample.s, sample.r, buffer[i] = before.u, before.s, before.r, last_u[i]


@njit(error_model="numpy", inline="always")
def _diverged(sim, data):
    """Return whether a position or velocity of the mechanism is NaN or above MAX_STATE."""
    for i in range(sim.nq):
        if not abs(data.qpos[i]) < MAX_STATE:
            return True
    for i in range(sim.nv):  # noqa: SIM110  # numba knows no generator
        if not abs(data.qvel[i]) < MAX_STATE:
            return True
    return False


@njit(error_model="numpy", inline="always")
def _interfered(sim):
    """Return whether other code has set a callback of MuJoCo's, perhaps in another thread."""
    slots = integers(sim.slots)
    for i in range(OTHER_CALLBACKS):  # noqa: SIM110  # numba knows no generator
        if integers(slots[i])[0] != 0:
            return True
    return False


@njit(error_model="numpy", inline="always")
def _call(function, i, inputs, outputs):
    """Call a function for channel i, with the addresses of its inputs and outputs.

    Return 1 if it raised, or 0.
    """
    return call(
        function.address,
        inputs,
        function.parameters,
        function.memory + i * function.stride,
        outputs,
    )


@njit(error_model="numpy", inline="always")
def _read_sensor(sim, state, i, x, v, j, hinge):
    """Return reading j of channel i: true position x and velocity v with noise, bias, rounding and
    loss.
    """
    if sim.sigma_x != 0.0 or sim.sigma_v != 0.0:
        z = philox.normals(sim.seed, i, philox.MEASUREMENT, j)
        x, v = x + sim.sigma_x * z[0], v + sim.sigma_v * z[1]
    if sim.bias != 0.0:
        x += sim.bias
    if sim.counts != 0.0:
        quantum = (2.0 * math.pi if hinge else 1.0) / sim.counts
        x = quantum * np.floor(x / quantum + 0.5)
    if sim.dropout != 0.0:
        if j > 0 and philox.uniform(sim.seed, i, philox.DROPOUT, j) < sim.dropout:
            return state.last_x, state.last_v
        state.last_x = x
        state.last_v = v
    return x, v


@njit(error_model="numpy", inline="always")
def _measurement_error(address, sim, function, t):
    """Return a measurement error at time t, s:

    NaN if its signal raised, -0 (which changes no bit) without a signal.
    """
    if function.address == 0:
        return -0.0
    sim.instant.t = t
    if _call(function, 0, address + record.AT.instant, address + record.AT.motion) != 0:
        return math.nan
    return sim.motion.value


@njit(error_model="numpy", inline="always")
def _position(numbers, at, turn):
    """Return a number, or of the quaternion that begins there, number `turn` of its rotation
    vector.
    """
    if turn < 0:
        return numbers[at]
    vector = rotation.rotation_vector(
        numbers[at], numbers[at + 1], numbers[at + 2], numbers[at + 3]
    )
    if turn == 0:
        return vector[0]
    return vector[1] if turn == 1 else vector[2]


@njit(error_model="numpy")
def _measure(address, sim, data, k, t):
    """Measure position, and estimate velocity and acceleration, of every channel at sample k, at
    time t, s.
    """
    j = k
    x = pointer(sim.seen.x)
    v = pointer(sim.seen.v)
    a = pointer(sim.a)
    if sim.read_period != 0.0:
        j = max(0, math.floor((t - sim.read_delay) / sim.read_period + 1e-6))
    reading = sim.reading
    estimate = sim.estimate
    reading.dt = sim.period
    x_error = _measurement_error(address, sim, sim.position_error, t)
    v_error = _measurement_error(address, sim, sim.velocity_error, t)
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        state = state_at(sim.states, i)
        position = _position(data.sensordata, channel.x_sensor, channel.turn) + x_error
        velocity = data.sensordata[channel.v_sensor] + v_error
        reading.x, reading.v = _read_sensor(
            sim,
            state,
            i,
            position,
            velocity,
            j,
            channel.hinge_body >= 0,
        )
        sim.seen.i = i
        if _call(sim.estimator, i, address + record.AT.reading, address + record.AT.estimate) != 0:
            return record.RAISED
        x[i], v[i], a[i] = reading.x, estimate.v, estimate.a
        if sim.other_forces != 0:
            pointer(sim.other_forces)[i] = (
                _generalised_disturbance(data, channel) + state.reaction / sim.steps
            )
    return record.FINE


@njit(error_model="numpy", inline="always")
def _evaluate_model(address, sim, i):
    """Write nominal f and g of channel i into the record. Return 1 if the model raised, or 0."""
    sim.seen.i = i
    return _call(sim.nominal, 0, address + record.AT.seen, address + record.AT.model)


@njit(error_model="numpy")
def update_law(address, sim, k, t):  # noqa: PLR0912
    """Run the law at sample k, at time t, s: once for each driven channel, or once for all.

    Return a failure code.

    A channel's nominal model may depend on the new commands of the channels before it.
    """
    n = sim.n
    width = sim.width
    last_u = pointer(sim.seen.u)
    limits = pointer(sim.limits)
    feedforward = 0.0
    joint = sim.joint.head != 0
    commands = pointer(sim.commands)
    y = sim.joint.head if joint else address + record.AT.y
    buffer = pointer(sim.delay_buffer + 8 * n * (k % sim.delay_slots))
    sim.instant.t = t
    for i in range(n if sim.other_forces != 0 else 0):
        # what the model takes for the force on each joint
        last_u[i] += pointer(sim.other_forces)[i]
    if sim.feedforward.address != 0:
        if _call(sim.feedforward, 0, address + record.AT.instant, address + record.AT.motion) != 0:
            return record.RAISED
        feedforward = sim.motion.value
    for first in range(0, sim.driven, width):
        if joint:
            failure = _measure_joints(address, sim, k, t)
        else:
            failure = _measure_channel(address, sim, k, t, first)
        if failure != record.FINE:
            return failure
        if sim.laws == 0:
            law = sim.law
        else:
            law = function_at(sim.laws, first)
        if _call(law, first, y, sim.commands) != 0:
            return record.LAW_RAISED
        for j in range(min(width, sim.driven)):
            i = first + j
            limit = limits[first + j]
            command = commands[j] + feedforward
            s = commands[width + j]
            sample = log_at(sim.log, k * n + i)
            u = min(max(command, -limit), limit)
            if not (
                math.isfinite(command)
                and math.isfinite(s)
                and abs(u) * max(1.0, sim.scale) < MAX_CONTROL
            ):
                sim.seen.i = i
                return record.NOT_FINITE
            buffer[i], sample.u, sample.s, last_u[i] = u, u, s, u
            if sim.other_forces != 0:
                last_u[i] += pointer(sim.other_forces)[i]
    if sim.mixer != 0:
        _mix(sim, last_u, buffer)
    for i in range(sim.driven, n):  # only measured
        sample = log_at(sim.log, k * n + i)
        buffer[i], sample.u, sample.s = 0.0, 0.0, 0.0
        if sim.referenced <= i:
            sample.r = 0.0
        elif not joint and _evaluate_reference(address, sim, k, i) != 0:
            return record.RAISED
    for i in range(n if sim.other_forces != 0 else 0):
        last_u[i] = log_at(sim.log, k * n + i).u
    return record.FINE


@njit(error_model="numpy")
def _mix(sim, u, controls):
    """Write the controls of a free body's actuators for its force and torque u, (6,), by the
    measured attitude.
    """
    for j in range(sim.n):
        controls[j] = 0.0
    rotation.mix(
        pointer(sim.seen.x),
        u,
        pointer(sim.mixer),
        sim.actuators,
        sim.keeps_torques,
        controls,
    )


@njit(error_model="numpy", inline="always")
def _evaluate_reference(address, sim, k, i):
    """Write the reference of channel i into the record and the log. Return 1 if it raised, or 0."""
    if sim.references != 0:
        if (
            _call(
                function_at(sim.references, i),
                0,
                address + record.AT.instant,
                address + record.AT.motion,
            )
            != 0
        ):
            return 1
    elif (
        i == 0
        and _call(sim.reference, 0, address + record.AT.instant, address + record.AT.motion) != 0
    ):
        return 1
    log_at(sim.log, k * sim.n + i).r = sim.motion.value
    return 0


@njit(error_model="numpy", inline="always")
def _measure_channel(address, sim, k, t, i):
    """Write what the law of channel i reads.

    The force in its nominal model is that of the drive, gain u - drag v.
    """
    if _evaluate_reference(address, sim, k, i) != 0:
        return record.RAISED
    y = sim.y
    x = pointer(sim.seen.x)
    v = pointer(sim.seen.v)
    a = pointer(sim.a)
    motion = sim.motion
    model = sim.model
    y.t = t
    y.dt = sim.period
    y.r = motion.value
    y.dr = motion.rate
    y.ddr = motion.acceleration
    y.q = 0.0
    y.dq = 0.0
    y.fq = 0.0
    y.gq = 0.0
    if sim.partners != 0:  # a joint without actuator moves with channel i
        partner = i + sim.driven
        if _evaluate_model(address, sim, partner) != 0:
            return record.RAISED
        y.q = x[partner]
        y.dq = v[partner]
        y.fq = model.f - sim.drive_drag * v[i] * model.g
        y.gq = sim.drive_gain * model.g
    if _evaluate_model(address, sim, i) != 0:
        return record.RAISED
    y.f = model.f - sim.drive_drag * v[i] * model.g
    y.g = sim.drive_gain * model.g
    if sim.other_forces != 0:
        y.f += pointer(sim.other_forces)[i] * model.g
    if sim.motors != 0:  # u is the acceleration x''
        y.gq /= y.g
        y.fq -= y.gq * y.f
        y.f = 0.0
        y.g = 1.0
    y.x = x[i]
    y.v = v[i]
    y.e = y.x - y.r
    y.de = y.v - y.dr
    y.a = y.ddr if math.isnan(a[i]) else a[i]  # NaN: the estimator gives none
    y.limit = pointer(sim.limits)[i]
    y.model = sim.uses_model
    y.has_surface = 0.0
    y.s = 0.0
    y.v_eq = 0.0
    if sim.surface.address != 0:
        if _call(sim.surface, i, address + record.AT.y, address + record.AT.sliding) != 0:
            return record.RAISED
        y.has_surface = 1.0
        y.s = sim.sliding.s
        y.v_eq = sim.sliding.v_eq
    return record.FINE


@njit(error_model="numpy")
def _measure_joints(address, sim, k, t):
    """Write what a law of many joints reads at sample k, at time t, s."""
    y = sim.joint
    n = sim.n
    motion = sim.motion
    seen = sim.seen
    head = head_at(y.head, 0)
    head.t = t
    head.dt = sim.period
    head.model = sim.uses_model
    head.n = n
    head.driven = sim.driven
    if sim.handle.coriolis != 0.0:
        head.dynamics = address + record.AT.handle
    else:
        head.dynamics = 0
    for i in range(n):
        if _evaluate_reference(address, sim, k, i) != 0:
            return record.RAISED
        x = pointer(seen.x)[i]
        v = pointer(seen.v)[i]
        a = pointer(sim.a)[i]
        pointer(y.x)[i], pointer(y.v)[i] = x, v
        pointer(y.e)[i], pointer(y.de)[i] = x - motion.value, v - motion.rate
        pointer(y.r)[i], pointer(y.dr)[i], pointer(y.ddr)[i] = (
            motion.value,
            motion.rate,
            motion.acceleration,
        )
        pointer(y.a)[i], pointer(y.limit)[i] = (
            motion.acceleration if math.isnan(a) else a,
            pointer(sim.limits)[i],
        )
    if sim.mixer != 0:
        rotation.put_attitude_error(
            pointer(y.x),
            pointer(y.v),
            pointer(y.r),
            pointer(y.dr),
            pointer(y.e),
            pointer(y.de),
        )
    return _measure_dynamics(address, sim)


@njit(error_model="numpy")
def _measure_dynamics(address, sim):
    """Write nominal M, h and g of all channels, per unit of u, into a joint measurement."""
    n = sim.n
    v = pointer(sim.seen.v)
    M = pointer(sim.joint.M)
    h = pointer(sim.joint.h)
    g = pointer(sim.joint.g)
    failure = record.FINE
    if sim.uses_model == 0.0:
        for i in range(n * n):
            M[i] = 1.0 if i % (n + 1) == 0 else 0.0
        for i in range(n):
            h[i], g[i] = 0.0, 0.0
        return failure
    if sim.dynamics.address == 0:
        failure = _separate_equations(address, sim, M, h, g)
    elif _call(sim.dynamics, 0, address + record.AT.seen, sim.joint.M) != 0:
        failure = record.RAISED
    for i in range(n * n):
        M[i] /= sim.drive_gain
    for i in range(n):
        h[i], g[i] = (h[i] + sim.drive_drag * v[i]) / sim.drive_gain, g[i] / sim.drive_gain
    return failure


@njit(error_model="numpy")
def _separate_equations(address, sim, M, h, g):
    """Write M, h and g of channels that each have their own equation x'' = f + g u:

    M is diagonal.
    """
    n = sim.n
    v = pointer(sim.seen.v)
    measured = pointer(sim.joint.v)
    for i in range(n * n):
        M[i] = 0.0
    for moving in (True, False):  # h at v, then g at rest
        for i in range(n):
            v[i] = measured[i] if moving else 0.0
        for i in range(n):
            if _evaluate_model(address, sim, i) != 0:
                return record.RAISED
            M[(n + 1) * i] = 1.0 / sim.model.g
            if moving:
                h[i] = -sim.model.f / sim.model.g
            else:
                g[i] = -sim.model.f / sim.model.g
    for i in range(n):
        v[i] = measured[i]
    return record.FINE


@njit(error_model="numpy", inline="always")
def _actuate(sim, data, step):
    """Give the actuators the command whose delay has passed at this physics step, if there is
    one.
    """
    past = step - sim.delay
    if past >= 0 and past % sim.steps == _late(sim, past // sim.steps):
        buffer = pointer(sim.delay_buffer + 8 * sim.n * (past // sim.steps % sim.delay_slots))
        for i in range(sim.n):
            state_at(sim.states, i).delayed = buffer[i]
            if sim.has_drives == 0 and i < (sim.driven if sim.mixer == 0 else sim.actuators):
                data.ctrl[channel_at(sim.channels, i).ctrl] = sim.scale * buffer[i]
            if sim.motors != 0 and i < sim.driven:
                _command_stepper(_motor_at(sim, i), sim.stepper, buffer[i], step * sim.step)
    if sim.motors != 0:
        for i in range(sim.driven):
            motor = _motor_at(sim, i)
            queue = pointer(_queue_of(sim, i))
            _advance_stepper(motor, sim.stepper, queue, step * sim.step, (step + 1) * sim.step)
            _turn_field(motor, sim.stepper, queue, step * sim.step, (step + 1) * sim.step)
        return
    if sim.has_drives != 0:
        for i in range(sim.driven):
            channel = channel_at(sim.channels, i)
            v = data.qvel[channel.shaft]
            V = sim.scale * _step_drives(sim.drive_step, state_at(sim.states, i), v)
            if sim.drive_step.ripple != 0.0:
                V = _rippled(sim.drive_step, V, data.qpos[channel.qpos], v)
            if sim.drive_step.rise_first != 0.0:
                state = state_at(sim.states, i)
                state.middle = V
                state.rise *= sim.scale
                V -= state.rise
            data.ctrl[channel.ctrl] = V


_command_stepper, _advance_stepper, _turn_field, _stepper_torque = map(
    njit(error_model="numpy"), (stepper.command, stepper.advance, stepper.field, stepper.torque)
)


@njit(error_model="numpy", inline="always")
def _motor_at(sim, i):
    """Return the stepper motor of a channel."""
    return motor_at(sim.motors + i * sim.motor_stride, 0)


@njit(error_model="numpy", inline="always")
def _queue_of(sim, i):
    """Return the address of the queue of a channel's stepper motor."""
    return sim.motors + i * sim.motor_stride + record.MOTOR_BYTES


@njit(error_model="numpy")
def _apply_steppers(sim, data, stage):
    """Give every motor its torque at a stage, in the field whose stages have its mean and moment
    over the step.
    """
    for i in range(sim.driven):
        channel = channel_at(sim.channels, i)
        state = state_at(sim.states, i)
        motor = _motor_at(sim, i)
        moved = motor.middle
        weight = 1.0
        if sim.stages > 1:  # RK4
            if stage == 3:
                moved += motor.rise
            else:
                moved += -motor.rise if stage == 0 else 0.0
            weight = 6.0 if stage % 3 == 0 else 3.0
        force = _stepper_torque(motor, sim.stepper, data.qpos[channel.shaft_qpos], moved)
        data.ctrl[channel.ctrl] = force
        state.force += force / weight


@njit(error_model="numpy", inline="always")
def _give_moment(sim, data, stage):
    """Give the later stages of an RK4 step the force that has its mean and first moment, see
    `drives._rise`.
    """
    for i in range(sim.driven):
        channel = channel_at(sim.channels, i)
        state = state_at(sim.states, i)
        if stage == 3:
            data.ctrl[channel.ctrl] = state.middle + state.rise
        else:
            data.ctrl[channel.ctrl] = state.middle
        if stage == 3:  # what the actuators did in the stage before, with the mean force
            state.force += data.actuator_force[channel.force]


@njit(error_model="numpy", inline="always")
def _step_drives(factors, state, v):
    """Advance a channel's drives by a physics step, see DriveStep.

    Return the mean force. v: speed of the drive.
    """
    u = state.delayed
    second = state.second
    a = state.first - u
    b = second - u
    force = u + factors.force_first * a
    state.first = u + factors.first_left * a
    state.rise = factors.rise_first * a
    if factors.voltage != 0.0:
        bound = factors.voltage
        torque = second - factors.drag * v
        mean = min(max(force, -bound), bound)
        end = min(max(u + factors.second_first * a, -bound), bound)
        state.second = end + factors.second_left * (torque - end) - factors.second_drag * v
        return mean + factors.force_second * (torque - mean) - factors.force_drag * v
    if factors.reach == 0.0:
        state.second = u + factors.second_first * a + factors.second_left * b
        return force + factors.force_second * b
    reach = factors.reach
    state.second = min(max(state.first, second - reach), second + reach)
    if state.second != state.first:
        return 0.5 * (second + state.second)
    gap = min(max(u + factors.lagged * a - second, -reach), reach)
    return force - 0.5 * gap * abs(gap) / reach


_rippled = njit(error_model="numpy", inline="always")(rippled)


@njit(error_model="numpy")
def _fly(sim, data, step, stage):
    """Give a free body its rotors' thrust, their gyroscopic torque and its drag at a stage, see
    hardware/rotors.py.
    """
    if stage == 0:
        lifted = 0.0
        for j in range(sim.actuators):
            rotor = rotor_at(data.actuator_user, j)
            state = state_at(sim.states, j)
            if step > 0:
                state.first = spun(rotor, state.first, state.second, sim.step)[0]
            lifted += thrust_at(rotor, state.first)
        lifted = _command_rotors(sim, data, lifted)
        _command_rotors(sim, data, lifted)
        for j in range(sim.actuators):
            rotor = rotor_at(data.actuator_user, j)
            state = state_at(sim.states, j)
            if min(rotor.rise, rotor.fall) * sim.step > FAST_ROTOR:
                state.first = state.second
    passed = sim.step * (0.5 if sim.stages == 1 else 0.5 * ((stage + 1) // 2))
    momentum = 0.0
    change = 0.0
    for j in range(sim.actuators):
        rotor = rotor_at(data.actuator_user, j)
        state = state_at(sim.states, j)
        W, rate = spun(rotor, state.first, state.second, passed)
        data.ctrl[channel_at(sim.channels, j).ctrl] = thrust_at(rotor, W)
        momentum += rotor.inertia * rotor.spin * W
        change += rotor.inertia * rotor.spin * rate
    dof = channel_at(sim.channels, 0).qvel
    v = data.qvel
    drag = _drag(sim, data, data.qvel[dof], data.qvel[dof + 1], data.qvel[dof + 2])
    for i in range(3):
        data.qfrc_applied[dof + i] = -drag[i]
    data.qfrc_applied[dof + 3] = -v[dof + 4] * momentum
    data.qfrc_applied[dof + 4] = v[dof + 3] * momentum
    data.qfrc_applied[dof + 5] = -change


@njit(error_model="numpy")
def _command_rotors(sim, data, lifted):
    """Tell the rotors their speeds while all of them give the thrust `lifted`, N, and return what
    they then give in the middle of the step.
    """
    after = 0.0
    for j in range(sim.actuators):
        rotor = rotor_at(data.actuator_user, j)
        state = state_at(sim.states, j)
        state.second = speed_for(rotor, state.delayed) * max(0.0, 1.0 - rotor.sag * lifted)
        after += thrust_at(rotor, spun(rotor, state.first, state.second, 0.5 * sim.step)[0])
    return after


@njit(error_model="numpy")
def _drag(sim, data, x, y, z):
    """Return R diag(drag) R' times a velocity (x, y, z) in the axes of the world, N."""
    place = channel_at(sim.channels, 0)
    first = channel_at(sim.channels, 3).qpos
    q = data.qpos[first], data.qpos[first + 1], data.qpos[first + 2], data.qpos[first + 3]
    along = rotation.rotate_inverse(q, x, y, z)
    drag = pointer(data.body_user + 8 * DRAG_AXES * (place.xfrc // 6))
    return rotation.turned(q, drag[0] * along[0], drag[1] * along[1], drag[2] * along[2])


@njit(error_model="numpy", inline="always")
def _zero_inputs(sim, data):
    """Set all commands and disturbances to 0."""
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        _zero_disturbance(data, channel)
        if channel.ctrl >= 0:
            data.ctrl[channel.ctrl] = 0.0
        if channel.friction_ctrl >= 0:
            data.ctrl[channel.friction_ctrl] = 0.0


@njit(error_model="numpy", inline="always")
def _zero_disturbance(data, channel):
    """Set the disturbances of a channel to 0."""
    data.xfrc_applied[channel.xfrc], data.xfrc_applied[channel.horizontal] = 0.0, 0.0
    if channel.qfrc >= 0:
        data.qfrc_applied[channel.qfrc] = 0.0


@njit(error_model="numpy")
def _apply_pushes(address, sim, data):
    """Set all disturbances to 0, and apply those of kind `Push`."""
    for i in range(sim.n):
        _zero_disturbance(data, channel_at(sim.channels, i))
    for j in range(sim.disturbance_count):
        body = disturbance_at(sim.disturbances, j).body
        for k in range(3 if body >= 0 else 0):
            data.xfrc_applied[body + k] = 0.0
    for j in range(sim.disturbance_count):
        signal = disturbance_at(sim.disturbances, j)
        if signal.body >= 0:
            if (
                _call(signal.function, 0, address + record.AT.instant, address + record.AT.motion)
                != 0
            ):
                return record.RAISED
            for k in range(3):
                data.xfrc_applied[signal.body + k] += sim.motion.value * signal.peak[k]
    return record.FINE


@njit(error_model="numpy")
def _apply_wind(address, sim, data):
    """Apply the force of the air that moves past a free body with drag."""
    x = 0.0
    y = 0.0
    z = 0.0
    for j in range(sim.disturbance_count):
        signal = disturbance_at(sim.disturbances, j)
        sim.instant.stream = signal.stream
        for i in range(3 if signal.air != 0 else 0):
            sim.instant.channel = i
            if (
                _call(signal.function, i, address + record.AT.instant, address + record.AT.motion)
                != 0
            ):
                return record.RAISED
            part = sim.motion.value * signal.peak[i]
            x, y, z = x + part * (i == 0), y + part * (i == 1), z + part * (i == 2)
    force = _drag(sim, data, x, y, z)
    for i in range(3):
        data.xfrc_applied[channel_at(sim.channels, i).xfrc] += force[i]
    return record.FINE


@njit(error_model="numpy", inline="always")
def _add_force(data, channel, force, cartesian):
    """Add a force to a channel: a horizontal one on its body, or one on its joint, if an actuator
    acts there.
    """
    if cartesian:
        data.xfrc_applied[channel.horizontal] += force
    elif channel.ctrl >= 0 and channel.qfrc >= 0:
        data.qfrc_applied[channel.qfrc] += force
    elif channel.ctrl >= 0 or channel.gathered >= 0:
        data.xfrc_applied[channel.xfrc] += channel.sign * force


@njit(error_model="numpy")
def _evaluate_feedback(address, sim, data, signal, i, k):
    """Write the force of a disturbance that sees the loop: the last one again if k < 0.

    Return 1 if it raised, or 0.
    """
    if i > 0 or k < 0:
        sim.motion.value = pointer(signal.function.memory)[0]
        return 0
    channel = channel_at(sim.channels, 0)
    sample = log_at(sim.log, k * sim.n)
    instant = sim.instant
    if k == 0:
        before = sample.r
    else:
        before = log_at(sim.log, (k - 1) * sim.n).r
    instant.e = data.qpos[channel.qpos] - sample.r
    instant.de = data.qvel[channel.qvel] - (sample.r - before) / sim.period
    instant.s = sample.s
    return _call(signal.function, 0, address + record.AT.instant, address + record.AT.motion)


@njit(error_model="numpy")
def _apply_disturbances(address, sim, data, t, k):
    """Apply the sum of the disturbances at time t, s; k is the sample at its first stage, and -1 at
    all others.
    """
    instant = sim.instant
    motion = sim.motion
    instant.t = t
    instant.seed = sim.seed
    if _apply_pushes(address, sim, data) != record.FINE:
        return record.RAISED
    if sim.rotors != 0 and _apply_wind(address, sim, data) != record.FINE:
        return record.RAISED
    for j in range(sim.disturbance_count):
        signal = disturbance_at(sim.disturbances, j)
        instant.stream = signal.stream
        if signal.body >= 0 or signal.air != 0:
            continue
        for i in range(sim.n):
            channel = channel_at(sim.channels, i)
            if signal.sees != 0:
                raised = _evaluate_feedback(
                    address,
                    sim,
                    data,
                    signal,
                    i,
                    k,
                )
            elif (
                signal.stream != 0.0 or i == 0
            ):  # without random numbers it is the same in every channel
                instant.channel = i
                raised = _call(
                    signal.function, i, address + record.AT.instant, address + record.AT.motion
                )
            else:
                raised = 0
            if raised != 0:
                return record.RAISED
            _add_force(data, channel, motion.value, signal.cartesian != 0)
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        on_joint = data.xfrc_applied[channel.xfrc]
        horizontal = data.xfrc_applied[channel.horizontal]
        if not (math.isfinite(on_joint) and math.isfinite(horizontal)):
            return record.DISTURBANCE_NOT_FINITE
        if channel.qfrc >= 0 and not math.isfinite(data.qfrc_applied[channel.qfrc]):
            return record.DISTURBANCE_NOT_FINITE
    return record.FINE


@njit(error_model="numpy", inline="always")
def lever(channel, xipos, xanchor, xaxis):
    """Return the torque of a horizontal force of 1 N about a hinge, m: axis . (arm x force).

    All are flat arrays.
    """
    j = channel.axis + 1
    k = (channel.axis + 2) % 3
    arm_j = xipos[channel.hinge_body + j] - xanchor[channel.anchor + j]
    arm_k = xipos[channel.hinge_body + k] - xanchor[channel.anchor + k]
    return xaxis[channel.anchor + j] * arm_k - xaxis[channel.anchor + k] * arm_j


@njit(error_model="numpy", inline="always")
def _generalised_disturbance(data, channel):
    """Return the generalised force on a channel's joint of the disturbances that act on its
    body.
    """
    if channel.qfrc >= 0:
        return data.qfrc_applied[channel.qfrc]
    d = channel.sign * data.xfrc_applied[channel.xfrc]
    if channel.hinge_body >= 0:
        d += (
            lever(channel, data.xipos, data.xanchor, data.xaxis)
            * data.xfrc_applied[channel.horizontal]
        )
    return d


@njit(error_model="numpy", inline="always")
def _evaluate_friction(address, sim, i):
    """Write the friction by a formula of channel i into the record: 0 without one. Return 1 if it
    raised, or 0.
    """
    sim.seen.i = i
    function = function_at(sim.frictions, i)
    if function.address == 0:
        sim.friction_output.f = 0.0
        sim.friction_output.low = 0.0
        sim.friction_output.high = 0.0
        return 0
    at = record.AT
    return _call(function, 0, address + at.friction_input, address + at.friction_output)


@njit(error_model="numpy")
def _apply_friction(address, sim, data):
    """Give every joint its friction by a formula for a physics step, see hardware/sliding.py."""
    inputs = sim.friction_input
    outputs = sim.friction_output
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        if channel.friction_ctrl < 0:
            continue
        state = state_at(sim.states, i)
        x = data.qpos[channel.qpos]
        v = data.qvel[channel.qvel]
        joint = channel.qvel
        inputs.v = v
        inputs.motor = data.actuator_force[channel.force] if channel.force >= 0 else 0.0
        inputs.load = data.qfrc_spring[joint] - data.qfrc_bias[joint]
        inputs.load += data.qfrc_constraint[joint] + _generalised_disturbance(data, channel)
        if _evaluate_friction(address, sim, i) != 0:
            return record.RAISED
        f = outputs.f
        low = outputs.low
        high = outputs.high
        bristle = pointer(function_at(sim.frictions, i).memory)
        if state.stuck == 0.0:
            slows = abs(v) < STICKING_SPEED and abs(v) <= abs(state.speed)
            if slows or v * state.speed < 0.0:
                state.stuck = 1.0
                state.stuck_at = x
                if state.speed != 0.0:  # it stops, else it is at rest from the start
                    state.stuck_at -= min(max(inputs.motor + inputs.load, low), high) / bristle[0]
        if state.stuck != 0.0:
            spring = bristle[0] * (x - state.stuck_at)
            if low <= spring <= high and low < high:
                f = min(max(spring + bristle[1] * v, low), high)
            else:
                state.stuck = 0.0
        state.speed = v
        data.ctrl[channel.friction_ctrl] = -f
    return record.FINE


@njit(error_model="numpy", inline="always")
def _remove_exact_friction(sim, data):
    """Take the friction of the last stage from the joints."""
    for i in range(sim.n if sim.exact_friction != 0 else 0):
        data.qfrc_applied[channel_at(sim.channels, i).qvel] = 0.0


_dry_step = njit(error_model="numpy")(dry_step)
_torque = njit(error_model="numpy", inline="always")(drives.torque)


@njit(error_model="numpy")
def _apply_exact_friction(address, sim, data, stage):
    """Give every joint its dry friction at a stage of RK4: by its formula while it slides, else the
    moments of `dry_step`.

    While it holds the joint, it takes up what the other forces change within the step, too.
    """
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        state = state_at(sim.states, i)
        joint = channel.qvel
        v = data.qvel[joint]
        drive = _torque(sim.torque, data.ctrl[channel.ctrl], v) if channel.ctrl >= 0 else 0.0
        others = (
            data.qfrc_passive[joint]
            - data.qfrc_bias[joint]
            + _generalised_disturbance(data, channel)
        )
        if sim.frictions != 0:
            inputs = sim.friction_input
            inputs.v = v
            inputs.motor = drive
            inputs.load = data.qfrc_spring[joint] - data.qfrc_bias[joint]
            inputs.load += _generalised_disturbance(data, channel)
        if stage == 0:
            state.smooth = others + (state.middle if sim.drive_step.rise_first != 0.0 else drive)
            if _begin_friction(address, sim, data, i) != 0:
                return record.RAISED
        if state.slides != 0.0:
            if _evaluate_friction(address, sim, i) != 0:
                return record.RAISED
            force = -sim.friction_output.f
        else:
            holding = state.friction - state.holding * (others + drive - state.smooth)
            force = min(max(holding, state.low), state.high)
        weight = 3.0
        if stage % 3 == 0:  # the first stage, or the last
            if stage == 0:
                force += -state.friction_rise
            else:
                force += state.friction_rise
            weight = 6.0
        data.qfrc_applied[joint] += force
        state.reaction += force / weight
    return record.FINE


@njit(error_model="numpy")
def _begin_friction(address, sim, data, i):
    """Decide what the dry friction of channel i does in a step, under `smooth`, the other forces.

    Return 1 if its formula raised, or 0.
    """
    channel = channel_at(sim.channels, i)
    state = state_at(sim.states, i)
    v = data.qvel[channel.qvel]
    mobility = data.qLDiagInv[channel.qvel]
    smooth = state.smooth
    state.slides = 0.0
    if sim.frictions == 0:
        high = data.dof_frictionloss[channel.qvel]
        low = -high
        sliding = -math.copysign(high, v)
        starting = -math.copysign(high, smooth)
    else:
        inputs = sim.friction_input
        found = sim.friction_output
        if _evaluate_friction(address, sim, i) != 0:
            return 1
        low = found.low
        high = found.high
        sliding = -found.f
        slow = abs(v) < STICKING_SPEED and (state.stuck != 0.0 or abs(v) <= abs(state.speed))
        state.speed = v
        stops = abs(v) <= -math.copysign(sim.step * mobility, v) * (smooth + sliding)
        if not low < high or not (slow or stops or v == 0.0):
            state.slides = 1.0
            state.stuck = 0.0
            state.friction_rise = 0.0
            return 0
        if slow:
            sliding = -high if v > 0.0 else -low
        else:
            inputs.v = 0.5 * v
            if _evaluate_friction(address, sim, i) != 0:
                return 1
            sliding = -found.f
        inputs.v = math.copysign(STICKING_SPEED, smooth)
        if _evaluate_friction(address, sim, i) != 0:
            return 1
        starting = -found.f
        # friction that holds less than it exerts in motion would start no joint
        if smooth * (smooth + starting) <= 0.0:
            low = min(low, smooth)
            high = max(high, smooth)
    state.friction, state.friction_rise, held = _dry_step(
        v, smooth, sliding, starting, low, high, mobility, sim.step
    )
    slid = 1.0 - held / sim.step
    if held > 0.0:
        state.holding = 1.0 - slid * slid
    else:
        state.holding = 0.0
    state.held += held
    state.low = min(-high, sliding, starting)
    state.high = max(-low, sliding, starting)
    state.stuck = held
    return 0


@njit(error_model="numpy", inline="always")
def _sum_forces(sim, data):
    """Add the forces of the last physics step on each joint: of the drive, and of friction and
    contacts.
    """
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        state = state_at(sim.states, i)
        if channel.force >= 0 and sim.drive_step.rise_first == 0.0 and sim.motors == 0:
            state.force += data.actuator_force[channel.force]
        if channel.gathered >= 0:
            state.force += data.qfrc_actuator[channel.gathered]
        state.reaction += data.qfrc_constraint[channel.qvel]
        if channel.friction_force >= 0:
            state.reaction += data.actuator_force[channel.friction_force]


@njit(error_model="numpy", inline="always")
def _log(sim, data, k):
    """Write sample k of every channel into the log, except u, s and r, which are there already."""
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        state = state_at(sim.states, i)
        sample = log_at(sim.log, k * sim.n + i)
        sample.x = _position(data.qpos, channel.qpos, channel.turn)
        sample.v = data.qvel[channel.qvel]
        if channel.ctrl < 0:
            sample.applied = 0.0
        elif sim.mixer != 0:
            if sim.rotors != 0:
                sample.applied = state.delayed
            else:
                sample.applied = data.ctrl[channel.ctrl]
        else:
            applied = data.ctrl[channel.ctrl] / sim.scale
            limit = pointer(sim.limits)[i]
            # the quotient may round to just beyond the limit
            if sim.has_drives == 0:
                sample.applied = min(max(applied, -limit), limit)
            else:
                sample.applied = state.delayed
        sample.d = _generalised_disturbance(data, channel)
        sample.force = state.force / sim.steps
        sample.reaction = state.reaction / sim.steps
        sample.held = state.held
        state.force = 0.0
        state.reaction = 0.0
        state.held = 0.0
