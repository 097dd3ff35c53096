"""The controller: what the control callback does in one simulation, according to its record.

The order of a step is that of `step`. Here are its moments for MuJoCo: how they read mjData and
write into it. The command goes to ctrl, or to the drive that a part is; disturbances go to
xfrc_applied. Each sample is logged with the mean forces since the last one. How signals act is in
exogenous.py. At every stage the parts act last, see hardware/moments.py: the controller knows none
of them.

The controller counts its calls, because mjData.time does not tell the last stage of a step from the
start of the next: RK4 calls at t, t + h/2, t + h/2 and t + h, and the next step begins at t + h
again. A run that diverges, or whose law raises an exception, is marked in its record and gets no
more control. The other simulations of the batch continue.

Private functions take a View, or of it the address of the record, the record `sim`, and `data`, the
Arrays of its mjData. Those that can fail return a failure code of state.py, unless they say
otherwise.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import math
from collections import namedtuple

from smc_mujoco.common.jit import call, inlined, integers, not_inlined, pointer, store
from smc_mujoco.common.mjcb import slots
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.hardware.feedforward import AT_REST, ON
from smc_mujoco.mechanisms.hardware.moments import (
    channel_at,
    drive_at,
    evaluate,
    function_at,
    generalised_disturbance,
    part_at,
    reader_at,
    state_at,
)
from smc_mujoco.simulation import exogenous, parts, philox
from smc_mujoco.simulation import state as record
from smc_mujoco.simulation.state import log_at
from smc_mujoco.simulation.step import Asked, Moments, asking, lateness, order, reading_at

MAX_STATE = 1e6  # SI units: a run with larger |x| or |v| has diverged; MuJoCo gives up at 1e10
OTHER_CALLBACKS = len(slots())
ON_SPEED, ON_ERROR = ON.index("speed"), ON.index("error")


# Arrays of one mjData, as pointers to their numbers; of its mjModel the levels of dry friction, and
# the addresses of what rotors and drag have.
Arrays = namedtuple(
    "Arrays",
    """qpos qvel ctrl xfrc_applied qfrc_applied sensordata xipos xanchor xaxis
    actuator_force qfrc_constraint qfrc_bias qfrc_spring qfrc_passive qfrc_actuator qLDiagInv
    efc_frictionloss efc_aref ten_J dof_frictionloss actuator_user body_user""",
)
# What the moments see of a run: the address of its record, the record, and the Arrays.
View = namedtuple("View", ("address", "sim", "data"))


@inlined
def _sum_forces(view):
    """Add the forces of the last physics step on each joint: of the drive, and of friction and
    contacts.
    """
    _, sim, data = view
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


@inlined
def _diverged(view):
    """Return whether a position or velocity of the mechanism is NaN or above MAX_STATE."""
    _, sim, data = view
    for i in range(sim.nq):
        if not abs(data.qpos[i]) < MAX_STATE:
            return True
    for i in range(sim.nv):  # noqa: SIM110  # numba knows no generator
        if not abs(data.qvel[i]) < MAX_STATE:
            return True
    return False


@inlined
def _over(view, k):
    """Return a failure where the simulation is stepped beyond its end, or other code interferes."""
    if k >= view.sim.samples or _interfered(view.sim):
        return record.INTERRUPTED
    return record.FINE


@inlined
def _interfered(sim):
    """Return whether other code has set a callback of MuJoCo's, perhaps in another thread.

    It is asked once a step: at every stage of RK4 it cost some 3 % of a step.
    """
    slots = integers(sim.slots)
    for i in range(OTHER_CALLBACKS):  # noqa: SIM110  # numba knows no generator
        if integers(slots[i])[0] != 0:
            return True
    return False


@inlined
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


@inlined
def log_row(view, k, i):
    """Return the LOG of channel i at sample k."""
    return log_at(view.sim.log, k * view.sim.n + i)


@inlined
def ring(view, k):
    """Return the commands of sample k, (n,), in the delay buffer."""
    sim = view.sim
    return pointer(sim.delay_buffer + 8 * sim.n * (k % sim.delay_slots))


@inlined
def _seen(view):
    seen = view.sim.seen
    return pointer(seen.x), pointer(seen.v), pointer(view.sim.a)


@inlined
def _errors(view, t):
    address, sim, _ = view
    sim.reading.dt = sim.period
    return (
        exogenous.measurement_error(address, sim, sim.position_error, t),
        exogenous.measurement_error(address, sim, sim.velocity_error, t),
    )


@inlined
def _sense(view, i, t):
    _, sim, data = view
    channel = channel_at(sim.channels, i)
    sim.seen.i = i
    x = _position(data.sensordata, channel.x_sensor, channel.turn)
    return x, data.sensordata[channel.v_sensor]


@inlined
def _reading(view, i, k, t):
    sim = view.sim
    if sim.readers == 0:
        return k
    reader = reader_at(sim.readers, i)
    return reading_at(k, t, reader.period, reader.delay)


@inlined
def _read(view, i, j, x, v):
    address, sim, _ = view
    if sim.readers == 0 or reader_at(sim.readers, i).function.address == 0:
        return False, x, v
    sight = sim.sight
    sight.x = x
    sight.v = v
    sight.j = j
    sight.hinge = channel_at(sim.channels, i).hinge_body >= 0
    sight.chance = philox.uniform(sim.seed, i, philox.DROPOUT, j)
    function = reader_at(sim.readers, i).function
    raised = evaluate(function, 0, address + record.AT.sight, address + record.AT.raw)
    return raised, sim.raw.x, sim.raw.v


@inlined
def _noise(view, i, j):
    return philox.normals(view.sim.seed, i, philox.MEASUREMENT, j)


@inlined
def _estimate(view, i, x, v):
    address, sim, _ = view
    sim.reading.x = x
    sim.reading.v = v
    raised = evaluate(sim.estimator, i, address + record.AT.reading, address + record.AT.estimate)
    if sim.other_forces != 0:
        reaction = state_at(sim.states, i).reaction / sim.steps
        pointer(sim.other_forces)[i] = _disturbance(view, i) + reaction
    return raised, sim.estimate.v, sim.estimate.a


@inlined
def _feedforward(view, t):
    """Return whether it raised, and its value. The model then takes the other forces on each joint
    for part of the force of the drive.
    """
    address, sim, _ = view
    sim.instant.t = t
    for i in range(sim.n if sim.other_forces != 0 else 0):
        pointer(sim.seen.u)[i] += pointer(sim.other_forces)[i]
    if sim.feedforward.address == 0:
        return False, 0.0
    return exogenous.evaluate_signal(address, sim.feedforward, 0), sim.motion.value


@inlined
def refer(view, i, k, t):
    """Return whether the reference of channel i raised, and its motion."""
    address, sim, _ = view
    raised = False
    if sim.references != 0:
        raised = exogenous.evaluate_signal(address, function_at(sim.references, i), 0)
    elif i == 0:
        raised = exogenous.evaluate_signal(address, sim.reference, 0)
    motion = sim.motion
    return raised, motion.value, motion.rate, motion.acceleration


@inlined
def lead(view, i, dr):
    """Return how far the reference that the law of channel i sees leads, through a play."""
    drive = drive_at(view.sim.drives, i)
    if drive.lead == 0.0:
        return 0.0
    return drive.lead * math.tanh(dr / view.sim.eps)


@inlined
def _compensate(view, k, t, i, u):
    """Return whether it raised, and the u of channel i that compensates friction beside u."""
    if view.sim.compensated == 0:
        return False, 0.0
    return _compensation(view, k, t, i, u)


@not_inlined
def _compensation(view, k, t, i, u):
    address, sim, _ = view
    x = pointer(sim.seen.x)[i]
    v = pointer(sim.seen.v)[i]
    size = v
    if sim.compensates_on != ON_SPEED:
        raised, r, v, _ = refer(view, i, k, t)
        if raised:
            return True, 0.0
        size = v
        if sim.compensates_on == ON_ERROR:
            size = r - x
            v = math.copysign(AT_REST, size)
    y = sim.joint_state
    y.t = t
    y.x = x
    y.v = v
    y.h = y.motor = y.load = 0.0
    gain = drive_at(sim.drives, i).gain
    y.u = gain * u
    force = 0.0
    for j in range(sim.compensated):
        part = part_at(sim.compensations, j)
        if part.channel == i:
            places = record.AT
            if evaluate(part.function, 0, address + places.joint_state, address + places.exerted):
                return True, 0.0
            force += sim.exerted.force
    return False, sim.share * math.tanh(abs(size) / sim.eps) * force / gain


@inlined
def evaluate_model(address, sim, i):
    """Write nominal f and g of channel i into the record. Return whether the model raised."""
    sim.seen.i = i
    return evaluate(sim.nominal, 0, address + record.AT.seen, address + record.AT.model)


@inlined
def _nominal(view, i):
    raised = evaluate_model(view.address, view.sim, i)
    return raised, view.sim.model.f, view.sim.model.g


@inlined
def _slide(view, i, y):
    address, sim, _ = view
    store(y, address + record.AT.y)
    raised = evaluate(sim.surface, i, address + record.AT.y, address + record.AT.sliding)
    return raised, sim.sliding.s, sim.sliding.v_eq


@inlined
def _law(view, i, y):
    address, sim, _ = view
    store(y, address + record.AT.y)
    law = sim.law
    if sim.laws != 0:
        law = function_at(sim.laws, i)
    commands = pointer(sim.commands)
    return evaluate(law, i, address + record.AT.y, sim.commands), commands[0], commands[1]


@inlined
def _commanded(view, i, u):
    """Tell the nominal model the force of a drive: that of a later channel may depend on it."""
    sim = view.sim
    drive = drive_at(sim.drives, i)
    last_u = pointer(sim.seen.u)
    last_u[i] = drive.gain * u - drive.drag * pointer(sim.seen.v)[i]
    if sim.other_forces != 0:
        last_u[i] += pointer(sim.other_forces)[i]


@not_inlined
def _asked(view, k):
    """Write commands and references of the channels that are only measured."""
    sim = view.sim
    buffer = ring(view, k)
    last_u = pointer(sim.seen.u)
    if sim.mixer != 0:
        call(sim.mix, view.address, k, 0, 0)
    for i in range(sim.driven, sim.n):
        sample = log_row(view, k, i)
        buffer[i], sample.u, sample.s = 0.0, 0.0, 0.0
        if sim.referenced <= i:
            sample.r = 0.0
        elif sim.joint == 0:
            if refer(view, i, k, 0.0)[0]:
                return record.RAISED
            sample.r = sim.motion.value
    for i in range(sim.n if sim.other_forces != 0 else 0):
        drive = drive_at(sim.drives, i)
        last_u[i] = drive.gain * log_row(view, k, i).u - drive.drag * pointer(sim.seen.v)[i]
    return record.FINE


@inlined
def _apply(view, i, u):
    channel = channel_at(view.sim.channels, i)
    if channel.ctrl >= 0:
        view.data.ctrl[channel.ctrl] = drive_at(view.sim.drives, i).scale * u


@inlined
def _arrived(view):
    view.sim.arrived = 1


@inlined
def _disturb(view, t, k):
    sim = view.sim
    if sim.disturbance_count == 0:
        return record.FINE
    sim.instant.t = t
    return call(sim.disturb, view.address, k, 0, 0)


@inlined
def _truth(view, i):
    _, sim, data = view
    channel = channel_at(sim.channels, i)
    return _position(data.qpos, channel.qpos, channel.turn), data.qvel[channel.qvel]


@inlined
def _applied(view, i):
    held = channel_at(view.sim.channels, i).ctrl >= 0
    return state_at(view.sim.states, i).delayed if held else 0.0


@inlined
def _disturbance(view, i):
    return generalised_disturbance(view.data, channel_at(view.sim.channels, i))


@inlined
def _zero_inputs(sim, data):
    """Set all commands and disturbances to 0."""
    exogenous.clear(sim, data)
    for i in range(sim.n):
        ctrl = channel_at(sim.channels, i).ctrl
        if ctrl >= 0:
            data.ctrl[ctrl] = 0.0


@inlined
def _ask_joints(view, k, t, i):
    """Ask a law of many joints once, for all channels, see joint_controller.py."""
    sim = view.sim
    commands = pointer(sim.commands)
    if i == 0:
        sim.instant.t = t
        failure = call(sim.ask_joints, view.address, k, 0, 0)
        if failure != record.FINE:
            return failure, 0.0, 0.0
    sim.seen.i = i
    return record.FINE, commands[i], commands[sim.width + i]


@inlined
def _ask(view, k, t, i):
    if view.sim.joint != 0:
        return _ask_joints(view, k, t, i)
    return _ask_channel(view, k, t, i)


MOMENTS = Moments(
    n=inlined(lambda view: view.sim.n),
    driven=inlined(lambda view: view.sim.driven),
    settings=inlined(lambda view: view.sim),
    late=inlined(lambda view, k: lateness(view.sim, k, view.sim.samples - 1)),
    now=log_row,
    before=inlined(lambda view, k, i: log_row(view, k - 1, i)),
    state=inlined(lambda view, i: state_at(view.sim.states, i)),
    drive=inlined(lambda view, i: drive_at(view.sim.drives, i)),
    ring=ring,
    seen=_seen,
    errors=_errors,
    sense=_sense,
    reading=_reading,
    read=_read,
    noise=_noise,
    estimate=_estimate,
    feedforward=_feedforward,
    ask=_ask,
    compensate=_compensate,
    commanded=_commanded,
    finish=_asked,
    apply=_apply,
    arrived=_arrived,
    sum_forces=_sum_forces,
    diverged=_diverged,
    over=_over,
    disturb=_disturb,
    truth=_truth,
    applied=_applied,
    disturbance=_disturbance,
)
_ask_channel = asking(
    MOMENTS,
    Asked(
        partners=inlined(lambda view: view.sim.partners != 0),
        knows=inlined(lambda view: view.sim.other_forces != 0),
        refer=refer,
        lead=lead,
        nominal=_nominal,
        slides=inlined(lambda view: view.sim.surface.address != 0),
        slide=_slide,
        law=_law,
    ),
)
BEGIN, BETWEEN = order(MOMENTS)


@not_inlined
def control(address, sim, data):
    """Do one callback of one simulation."""
    calls = sim.calls
    sim.calls = calls + 1
    if sim.failure != record.FINE:
        return
    step = calls // sim.stages
    stage = calls % sim.stages
    k = step // sim.steps
    within = step % sim.steps
    view = View(address, sim, data)
    parts.clear_joints(sim, data)
    if sim.reaches != 0:
        parts.keep_reach(sim.reach, data)
    sim.stage = stage
    sim.now = step
    sim.arrived = 0
    if stage == 0:
        failure = BEGIN(view, k, within, step)
    else:
        failure = BETWEEN(view, k, within, stage)
    if failure == record.FINE and sim.part_count != 0:
        failure = parts.act(address, sim, data)
    if failure != record.FINE:
        sim.failure = failure
        sim.failed_step = step
        _zero_inputs(sim, data)
