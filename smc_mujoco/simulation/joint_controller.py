"""What the control callback does for all channels at once: it asks a law of many joints, and mixes
the force and torque of a free body into its actuators.

Both are C functions of their own, see `cfunctions.compile_moment`: a run that has neither does not
wait for them to compile. `address` and `sim` are those of the controller. Functions return a
failure code of state.py.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
from smc_mujoco.common.jit import not_inlined, pointer
from smc_mujoco.control.joint_law import begin_measurement, put_channel
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.hardware.moments import drive_at, evaluate
from smc_mujoco.simulation import state as record
from smc_mujoco.simulation.controller import View, evaluate_model, lead, log_row, refer, ring


@not_inlined
def ask(address, sim, k):
    """Ask a law of many joints for u and s of all channels, at sample k, the record's instant."""
    failure = _measure(View(address, sim, 0), k, sim.instant.t)
    if failure == record.FINE and evaluate(sim.law, 0, sim.joint, sim.commands):
        failure = record.LAW_RAISED
    return failure


@not_inlined
def _measure(view, k, t):
    """Write what a law of many joints reads at sample k, at time t, s."""
    address, sim, _ = view
    seen = sim.seen
    motion = sim.motion
    dynamics = 0
    if sim.handle.coriolis != 0.0:
        dynamics = address + record.AT.handle
    y = begin_measurement(sim.joint, t, sim.period, sim.uses_model, dynamics, sim.n, sim.driven)
    for i in range(sim.n):
        if refer(view, i, k, t)[0]:
            return record.RAISED
        log_row(view, k, i).r = motion.value
        put_channel(
            y,
            i,
            pointer(seen.x)[i],
            pointer(seen.v)[i],
            pointer(sim.a)[i],
            drive_at(sim.drives, i).limit,
            motion.value + lead(view, i, motion.rate),
            motion.rate,
            motion.acceleration,
        )
    if sim.mixer != 0:
        rotation.put_attitude_error(y.x, y.v, y.r, y.dr, y.e, y.de)
    return _measure_dynamics(address, sim, y)


@not_inlined
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


@not_inlined
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
            if evaluate_model(address, sim, i):
                return record.RAISED
            y.M[i, i] = 1.0 / sim.model.g
            if moving:
                y.h[i] = -sim.model.f / sim.model.g
            else:
                y.g[i] = -sim.model.f / sim.model.g
    for i in range(n):
        v[i] = y.v[i]
    return record.FINE


@not_inlined
def mix(address, sim, k):
    """Write the controls of a free body's actuators for its force and torque at sample k, by the
    measured attitude.
    """
    controls = ring(View(address, sim, 0), k)
    for j in range(sim.n):
        controls[j] = 0.0
    rotation.mix(
        pointer(sim.seen.x),
        pointer(sim.seen.u),
        pointer(sim.mixer),
        sim.actuators,
        sim.keeps_torques,
        controls,
    )
    return record.FINE
