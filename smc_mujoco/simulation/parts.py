"""The parts of a run, as the control callback lets them act on the joints.

`address`, `sim` and `data` are those of the controller.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
from numba import njit

from smc_mujoco.common.jit import address_of, call, not_inlined
from smc_mujoco.mechanisms.hardware.moments import (
    PART,
    channel_at,
    drive_at,
    evaluate,
    generalised_disturbance,
    part_at,
    state_at,
    torque,
)
from smc_mujoco.simulation import state as record
from smc_mujoco.simulation.step import MAX_CONTROL

PART_BYTES = PART.itemsize


@njit(error_model="numpy", inline="always")
def clear_joints(sim, data):
    """Take what parts exerted at the last stage from the joints."""
    for i in range(sim.n if sim.exerts != 0 else 0):
        data.qfrc_applied[channel_at(sim.channels, i).qvel] = 0.0
        state_at(sim.states, i).exerted = 0.0


@njit(error_model="numpy", inline="always")
def keep_reach(reach, data):
    """Keep where the arrays are that `act` and `push` reach."""
    reach.qpos = address_of(data.qpos)
    reach.qvel = address_of(data.qvel)
    reach.ctrl = address_of(data.ctrl)
    reach.xfrc_applied = address_of(data.xfrc_applied)
    reach.qfrc_applied = address_of(data.qfrc_applied)
    reach.actuator_force = address_of(data.actuator_force)
    reach.ten_J = address_of(data.ten_J)
    reach.actuator_user = data.actuator_user
    reach.body_user = data.body_user


@not_inlined
def act(address, sim, data):
    """Let the parts act at a stage, in their order. Return a failure code of state.py."""
    for j in range(sim.part_count):
        part = part_at(sim.parts, j)
        if part.acts != 0:
            call(part.function.address, address, sim.parts + PART_BYTES * j, 0, 0)
        elif (part.staged != 0 or sim.stage == 0) and _exert(address, sim, data, part):
            return record.RAISED
    for i in range(sim.n if sim.exerts != 0 else 0):
        data.qfrc_applied[channel_at(sim.channels, i).qvel] += state_at(sim.states, i).exerted
    return record.FINE


@not_inlined
def _exert(address, sim, data, part):
    """Evaluate a part on a joint. Its force goes to ctrl or to a sum; a brake sets friction, too.

    Return whether the part raised, or gave what is NaN or too large.
    """
    i = part.channel
    channel = channel_at(sim.channels, i)
    state = state_at(sim.states, i)
    drive = drive_at(sim.drives, i)
    joint = channel.qvel
    y = sim.joint_state
    pushed = generalised_disturbance(data, channel)
    y.t = sim.now * sim.step
    y.h = sim.step
    y.x = data.qpos[channel.qpos]
    y.v = data.qvel[joint]
    y.u = state.delayed
    y.load = data.qfrc_spring[joint] - data.qfrc_bias[joint]
    y.load += data.qfrc_constraint[joint] + pushed
    held = data.qfrc_constraint[joint]
    # a play or a spring passes on the drive's force: on shaft and joint it cancels
    if channel.shaft >= 0 and channel.shaft != joint:
        y.load += data.qfrc_constraint[channel.shaft] + data.qfrc_spring[channel.shaft]
        held += data.qfrc_constraint[channel.shaft]
    if part.row >= 0:  # without what dry friction took of the constraints' force
        y.load -= min(max(held, -state.level), state.level)
    y.motor = 0.0
    weight = 1.0
    if part.staged != 0:
        y.stage = sim.stage
        if channel.ctrl >= 0:
            y.motor = torque(drive.torque, data.ctrl[channel.ctrl], y.v)
        y.mean = state.middle if drive.sums_force != 0.0 else y.motor
        y.others = data.qfrc_passive[joint] - data.qfrc_bias[joint] + pushed
        y.level = data.dof_frictionloss[joint]
        y.mobility = data.qLDiagInv[joint]
        weight = 6.0 if sim.stage % 3 == 0 else 3.0  # the first stage, or the last
    elif channel.force >= 0:
        y.motor = data.actuator_force[channel.force]
    sim.seen.i = i
    out = sim.exerted
    if evaluate(part.function, 0, address + record.AT.joint_state, address + record.AT.exerted):
        return True
    if sim.stage == 0 and not abs(out.force) < MAX_CONTROL:
        return True
    if part.row >= 0:
        state.level = data.dof_frictionloss[joint] + out.grip
        if not state.level < MAX_CONTROL:
            return True
        if address_of(data.efc_frictionloss) != 0:  # MuJoCo has had room for its constraints
            data.efc_frictionloss[part.row] = state.level
            data.efc_aref[part.row] -= out.away / (sim.step * sim.step)
    if part.ctrl >= 0:
        data.ctrl[part.ctrl] = out.force
        return False
    state.exerted += out.force
    state.reaction += out.force / weight
    if part.staged != 0:
        state.held += out.grip
    return False
