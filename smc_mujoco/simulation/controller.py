"""The controller: what the control callback does in one simulation, according to its record.

At the first stage of a control sample, for each channel:

    sensors -> noise -> `read` -> velocity estimator -> law -> saturation -> delay buffer

A sample may come late in its period, or be missed, see `Clock`. The log then repeats the command of
the sample before. At the first stage of a physics step, the command whose delay has passed goes to
ctrl, or to the drive that a part is. At every stage, disturbance(t) goes to xfrc_applied. Each
sample is logged with the mean forces since the last one. How signals act is in exogenous.py. At
every stage the parts act last, see hardware/moments.py: the controller knows none of them.

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

from numba import njit

from smc_mujoco.common.jit import integers, pointer
from smc_mujoco.common.mjcb import slots
from smc_mujoco.control.joint_law import begin_measurement, put_channel
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.hardware.moments import (
    channel_at,
    drive_at,
    evaluate,
    function_at,
    generalised_disturbance,
    reader_at,
    state_at,
)
from smc_mujoco.simulation import exogenous, parts, philox
from smc_mujoco.simulation import state as record
from smc_mujoco.simulation.parts import MAX_CONTROL
from smc_mujoco.simulation.signals import after_pauses
from smc_mujoco.simulation.state import log_at

MAX_STATE = 1e6  # SI units: a run with larger |x| or |v| has diverged; MuJoCo gives up at 1e10
# of a step: where RK4's last stage evaluates signals, just before a jump at the step's end
LAST_STAGE = 1.0 - 1e-8
OTHER_CALLBACKS = len(slots())


# Arrays of one mjData, as pointers to their numbers; of its mjModel the levels of dry friction, and
# the addresses of what rotors and drag have.
Arrays = namedtuple(
    "Arrays",
    """qpos qvel ctrl xfrc_applied qfrc_applied sensordata xipos xanchor xaxis
    actuator_force qfrc_constraint qfrc_bias qfrc_spring qfrc_passive qfrc_actuator qLDiagInv
    efc_frictionloss efc_aref dof_frictionloss actuator_user body_user""",
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
    parts.clear_joints(sim, data)
    if sim.reaches != 0:
        parts.keep_reach(sim.reach, data)
    sim.stage = stage
    sim.now = step
    sim.arrived = 0
    if stage == 0:
        _sum_forces(sim, data)
        if _diverged(sim, data):
            failure = record.DIVERGED
        elif k >= sim.samples or _interfered(sim):  # or the simulation is stepped beyond its end
            failure = record.INTERRUPTED
        else:
            failure = _sample(address, sim, data, k, within)
        _arrive(sim, data, step)
    if sim.disturbance_count != 0 and failure == record.FINE:
        if stage == 0:
            fraction = 0.0
        else:
            fraction = LAST_STAGE if stage == 3 else 0.5
        sample = k if stage + within == 0 else -1
        t = k * sim.period + (within + fraction) * sim.step
        failure = exogenous.disturb(address, sim, data, t, sample)
    if failure == record.FINE:
        if stage == 0 and within == 0:
            _log(sim, data, k)
        if sim.part_count != 0:
            failure = parts.act(address, sim, data)
    if failure != record.FINE:
        sim.failure = failure
        sim.failed_step = step
        _zero_inputs(sim, data)


@njit(error_model="numpy", inline="always")
def lateness(sim, k, last):
    """Return by how many physics steps sample k is late; -1 if it does not run."""
    if k in (0, last):
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
    late = lateness(sim, k, sim.samples - 1)
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
    for i in range(sim.n):
        sample = log_at(sim.log, k * sim.n + i)
        before = log_at(sim.log, (k - 1) * sim.n + i)
        sample.u, sample.s, sample.r, buffer[i] = before.u, before.s, before.r, before.u


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
    """Return whether other code has set a callback of MuJoCo's, perhaps in another thread.

    It is asked once a step: at every stage of RK4 it cost some 3 % of a step.
    """
    slots = integers(sim.slots)
    for i in range(OTHER_CALLBACKS):  # noqa: SIM110  # numba knows no generator
        if integers(slots[i])[0] != 0:
            return True
    return False


@njit(error_model="numpy", inline="always")
def _read_sensor(address, sim, i, k, t, hinge):
    """Give the reading of channel i at sample k, at t s, its noise, and what the sensor makes of
    it. Return whether that raised.
    """
    reading = sim.reading
    j = k
    if sim.readers != 0:
        reader = reader_at(sim.readers, i)
        if reader.period != 0.0:
            j = max(0, math.floor((t - reader.delay) / reader.period + 1e-6))
    if sim.sigma_x != 0.0 or sim.sigma_v != 0.0:
        z = philox.normals(sim.seed, i, philox.MEASUREMENT, j)
        reading.x += sim.sigma_x * z[0]
        reading.v += sim.sigma_v * z[1]
    if sim.readers == 0 or reader_at(sim.readers, i).function.address == 0:
        return False
    function = reader_at(sim.readers, i).function
    sight = sim.sight
    sight.x = reading.x
    sight.v = reading.v
    sight.j = j
    sight.hinge = hinge
    sight.chance = philox.uniform(sim.seed, i, philox.DROPOUT, j)
    if evaluate(function, 0, address + record.AT.sight, address + record.AT.raw):
        return True
    reading.x = sim.raw.x
    reading.v = sim.raw.v
    return False


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
    x = pointer(sim.seen.x)
    v = pointer(sim.seen.v)
    a = pointer(sim.a)
    reading = sim.reading
    estimate = sim.estimate
    reading.dt = sim.period
    x_error = exogenous.measurement_error(address, sim, sim.position_error, t)
    v_error = exogenous.measurement_error(address, sim, sim.velocity_error, t)
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        state = state_at(sim.states, i)
        reading.x = _position(data.sensordata, channel.x_sensor, channel.turn) + x_error
        reading.v = data.sensordata[channel.v_sensor] + v_error
        sim.seen.i = i
        if _read_sensor(address, sim, i, k, t, channel.hinge_body >= 0):
            return record.RAISED
        if evaluate(sim.estimator, i, address + record.AT.reading, address + record.AT.estimate):
            return record.RAISED
        x[i], v[i], a[i] = reading.x, estimate.v, estimate.a
        if sim.other_forces != 0:
            pointer(sim.other_forces)[i] = (
                generalised_disturbance(data, channel) + state.reaction / sim.steps
            )
    return record.FINE


@njit(error_model="numpy", inline="always")
def _evaluate_model(address, sim, i):
    """Write nominal f and g of channel i into the record. Return whether the model raised."""
    sim.seen.i = i
    return evaluate(sim.nominal, 0, address + record.AT.seen, address + record.AT.model)


@njit(error_model="numpy")
def update_law(address, sim, k, t):  # noqa: PLR0912
    """Run the law at sample k, at time t, s: once for each driven channel, or once for all.

    Return a failure code.

    A channel's nominal model may depend on the new commands of the channels before it.
    """
    n = sim.n
    width = sim.width
    last_u = pointer(sim.seen.u)  # the forces of the drives, as the model knows them
    v = pointer(sim.seen.v)
    feedforward = 0.0
    joint = sim.joint != 0
    commands = pointer(sim.commands)
    y = sim.joint if joint else address + record.AT.y
    buffer = pointer(sim.delay_buffer + 8 * n * (k % sim.delay_slots))
    sim.instant.t = t
    for i in range(n if sim.other_forces != 0 else 0):
        # what the model takes for the force on each joint
        last_u[i] += pointer(sim.other_forces)[i]
    if sim.feedforward.address != 0:
        if exogenous.evaluate_signal(address, sim.feedforward, 0):
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
        if evaluate(law, first, y, sim.commands):
            return record.LAW_RAISED
        for j in range(min(width, sim.driven)):
            i = first + j
            drive = drive_at(sim.drives, i)
            limit = drive.limit
            command = commands[j] + feedforward
            s = commands[width + j]
            sample = log_at(sim.log, k * n + i)
            u = min(max(command, -limit), limit)
            if not (
                math.isfinite(command)
                and math.isfinite(s)
                and abs(u) * max(1.0, drive.scale) < MAX_CONTROL
            ):
                sim.seen.i = i
                return record.NOT_FINITE
            buffer[i], sample.u, sample.s = u, u, s
            last_u[i] = drive.gain * u - drive.drag * v[i]
            if sim.other_forces != 0:
                last_u[i] += pointer(sim.other_forces)[i]
    if sim.mixer != 0:
        _mix(sim, last_u, buffer)
    for i in range(sim.driven, n):  # only measured
        sample = log_at(sim.log, k * n + i)
        buffer[i], sample.u, sample.s = 0.0, 0.0, 0.0
        if sim.referenced <= i:
            sample.r = 0.0
        elif not joint and exogenous.write_reference(address, sim, k, i):
            return record.RAISED
    for i in range(n if sim.other_forces != 0 else 0):
        drive = drive_at(sim.drives, i)
        last_u[i] = drive.gain * log_at(sim.log, k * n + i).u - drive.drag * v[i]
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
def _measure_channel(address, sim, k, t, i):
    """Write what the law of channel i reads.

    The force in its nominal model is that of the drive, gain u - drag v.
    """
    if exogenous.write_reference(address, sim, k, i):
        return record.RAISED
    y = sim.y
    x = pointer(sim.seen.x)
    v = pointer(sim.seen.v)
    a = pointer(sim.a)
    motion = sim.motion
    model = sim.model
    drive = drive_at(sim.drives, i)
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
        if _evaluate_model(address, sim, partner):
            return record.RAISED
        y.q = x[partner]
        y.dq = v[partner]
        y.fq = model.f - drive.drag * v[i] * model.g
        y.gq = drive.gain * model.g
    if _evaluate_model(address, sim, i):
        return record.RAISED
    y.f = model.f - drive.drag * v[i] * model.g
    y.g = drive.gain * model.g
    if sim.other_forces != 0:
        y.f += pointer(sim.other_forces)[i] * model.g
    if drive.accelerates != 0.0:  # u is the acceleration x''
        y.gq /= y.g
        y.fq -= y.gq * y.f
        y.f = 0.0
        y.g = 1.0
    y.x = x[i]
    y.v = v[i]
    y.e = y.x - y.r
    y.de = y.v - y.dr
    y.a = y.ddr if math.isnan(a[i]) else a[i]  # NaN: the estimator gives none
    y.limit = drive.limit
    y.model = sim.uses_model
    y.has_surface = 0.0
    y.s = 0.0
    y.v_eq = 0.0
    if sim.surface.address != 0:
        if evaluate(sim.surface, i, address + record.AT.y, address + record.AT.sliding):
            return record.RAISED
        y.has_surface = 1.0
        y.s = sim.sliding.s
        y.v_eq = sim.sliding.v_eq
    return record.FINE


@njit(error_model="numpy")
def _measure_joints(address, sim, k, t):
    """Write what a law of many joints reads at sample k, at time t, s."""
    seen = sim.seen
    motion = sim.motion
    dynamics = 0
    if sim.handle.coriolis != 0.0:
        dynamics = address + record.AT.handle
    y = begin_measurement(sim.joint, t, sim.period, sim.uses_model, dynamics, sim.n, sim.driven)
    for i in range(sim.n):
        if exogenous.write_reference(address, sim, k, i):
            return record.RAISED
        put_channel(
            y,
            i,
            pointer(seen.x)[i],
            pointer(seen.v)[i],
            pointer(sim.a)[i],
            drive_at(sim.drives, i).limit,
            motion.value,
            motion.rate,
            motion.acceleration,
        )
    if sim.mixer != 0:
        rotation.put_attitude_error(y.x, y.v, y.r, y.dr, y.e, y.de)
    return _measure_dynamics(address, sim, y)


@njit(error_model="numpy")
def _measure_dynamics(address, sim, y):
    """Write nominal M, h and g of all channels, per unit of u, into a joint measurement."""
    n = sim.n
    failure = record.FINE
    if sim.uses_model == 0.0:
        y.M[:] = 0.0
        y.h[:] = 0.0
        y.g[:] = 0.0
        for i in range(n):
            y.M[i, i] = 1.0
        return failure
    if sim.dynamics.address == 0:
        failure = _separate_equations(address, sim, y)
    elif evaluate(sim.dynamics, 0, address + record.AT.seen, y.M.ctypes.data):
        failure = record.RAISED
    v = pointer(sim.seen.v)
    for i in range(n):
        drive = drive_at(sim.drives, i)
        for j in range(n):
            y.M[i, j] /= drive.gain
        y.h[i] = (y.h[i] + drive.drag * v[i]) / drive.gain
        y.g[i] /= drive.gain
    return failure


@njit(error_model="numpy")
def _separate_equations(address, sim, y):
    """Write M, h and g of channels that each have their own equation x'' = f + g u:

    M is diagonal.
    """
    n = sim.n
    v = pointer(sim.seen.v)
    y.M[:] = 0.0
    for moving in (True, False):  # h at v, then g at rest
        for i in range(n):
            v[i] = y.v[i] if moving else 0.0
        for i in range(n):
            if _evaluate_model(address, sim, i):
                return record.RAISED
            y.M[i, i] = 1.0 / sim.model.g
            if moving:
                y.h[i] = -sim.model.f / sim.model.g
            else:
                y.g[i] = -sim.model.f / sim.model.g
    for i in range(n):
        v[i] = y.v[i]
    return record.FINE


@njit(error_model="numpy", inline="always")
def _arrive(sim, data, step):
    """Give the actuators, or the drives, the command whose delay has passed at this physics step,
    if there is one.
    """
    past = step - sim.delay
    sent = past // sim.steps
    arrives = past >= 0 and past % sim.steps == lateness(sim, sent, sim.samples - 1)
    faulty = step >= sim.fault_step
    if faulty and sim.stuck != 0 and sim.failing < 0:
        return
    if arrives or step == sim.fault_step:  # a fault begins on what is held
        sim.arrived = 1
        buffer = pointer(sim.delay_buffer + 8 * sim.n * (sent % sim.delay_slots))
        for i in range(sim.n):
            state = state_at(sim.states, i)
            u = buffer[i] if arrives else state.delayed
            if faulty and (sim.failing < 0 or sim.failing == i):
                u = state.delayed if sim.stuck != 0 else sim.fault_gain * u + sim.fault_bias
            state.delayed = u
            channel = channel_at(sim.channels, i)
            if channel.ctrl >= 0:
                data.ctrl[channel.ctrl] = drive_at(sim.drives, i).scale * u


@njit(error_model="numpy", inline="always")
def _zero_inputs(sim, data):
    """Set all commands and disturbances to 0."""
    exogenous.clear(sim, data)
    for i in range(sim.n):
        ctrl = channel_at(sim.channels, i).ctrl
        if ctrl >= 0:
            data.ctrl[ctrl] = 0.0


@njit(error_model="numpy", inline="always")
def _sum_forces(sim, data):
    """Add the forces of the last physics step on each joint: of the drive, and of friction and
    contacts.
    """
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        state = state_at(sim.states, i)
        if channel.force >= 0 and drive_at(sim.drives, i).sums_force == 0.0:
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
        sample.applied = state.delayed if channel.ctrl >= 0 else 0.0
        sample.d = generalised_disturbance(data, channel)
        sample.force = state.force / sim.steps
        sample.reaction = state.reaction / sim.steps
        sample.held = state.held
        state.force = 0.0
        state.reaction = 0.0
        state.held = 0.0
