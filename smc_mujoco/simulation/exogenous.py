"""The signals of a run, as the control callback evaluates them: references, measurement errors, and
disturbances, of which each kind acts in its own way.

`address`, `sim` and `data` are those of the controller. Functions that evaluate or apply signals
return whether one raised, unless they say otherwise.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import math

from numba import njit

from smc_mujoco.common.jit import call, not_inlined, pointer
from smc_mujoco.mechanisms.hardware.moments import channel_at, evaluate, reached
from smc_mujoco.simulation import state as record
from smc_mujoco.simulation.state import disturbance_at, log_at


@njit(error_model="numpy", inline="always")
def evaluate_signal(address, signal, i):
    """Write the value of a signal in channel i, at the record's instant, into the record's motion.
    Return whether the signal raised.
    """
    return evaluate(signal, i, address + record.AT.instant, address + record.AT.motion)


@njit(error_model="numpy", inline="always")
def measurement_error(address, sim, signal, t):
    """Return a measurement error at time t, s:

    NaN if its signal raised, -0 (which changes no bit) without a signal.
    """
    if signal.address == 0:
        return -0.0
    sim.instant.t = t
    if evaluate_signal(address, signal, 0):
        return math.nan
    return sim.motion.value


@not_inlined
def disturb(address, sim, k):
    """Apply the sum of the disturbances at the record's instant; k is the sample at its first
    stage, and -1 at all others. Return a failure code of state.py.

    It is a C function of its own, see `cfunctions.compile_moment`.
    """
    data = reached(sim.reach)
    sim.instant.seed = sim.seed
    clear(sim, data)
    wind = sim.push.function.address != 0
    if _push_bodies(address, sim, data) or (wind and _blow(address, sim)):
        return record.RAISED
    for j in range(sim.disturbance_count):
        signal = disturbance_at(sim.disturbances, j)
        if signal.body < 0 and signal.air == 0 and _load(address, sim, data, signal, k):
            return record.RAISED
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        on_joint = data.xfrc_applied[channel.xfrc]
        horizontal = data.xfrc_applied[channel.horizontal]
        if not (math.isfinite(on_joint) and math.isfinite(horizontal)):
            return record.DISTURBANCE_NOT_FINITE
        if channel.qfrc >= 0 and not math.isfinite(data.qfrc_applied[channel.qfrc]):
            return record.DISTURBANCE_NOT_FINITE
    return record.FINE


@not_inlined
def clear(sim, data):
    """Set all disturbances to 0."""
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        data.xfrc_applied[channel.xfrc] = 0.0
        data.xfrc_applied[channel.horizontal] = 0.0
        if channel.qfrc >= 0:
            data.qfrc_applied[channel.qfrc] = 0.0
    for j in range(sim.disturbance_count):
        body = disturbance_at(sim.disturbances, j).body
        for axis in range(3 if body >= 0 else 0):
            data.xfrc_applied[body + axis] = 0.0


@not_inlined
def _push_bodies(address, sim, data):
    """Apply the disturbances of kind `Push`, forces in space. Return whether one raised."""
    for j in range(sim.disturbance_count):
        signal = disturbance_at(sim.disturbances, j)
        if signal.body >= 0:
            if evaluate_signal(address, signal.function, 0):
                return True
            for axis in range(3):
                data.xfrc_applied[signal.body + axis] += sim.motion.value * signal.peak[axis]
    return False


@not_inlined
def _blow(address, sim):
    """Let the part that has drag push by the wind, whose signals have an axis in each channel.

    Return whether one raised.
    """
    for axis in range(3):
        sim.wind[axis] = 0.0
    for j in range(sim.disturbance_count):
        signal = disturbance_at(sim.disturbances, j)
        sim.instant.stream = signal.stream
        for axis in range(3 if signal.air != 0 else 0):
            sim.instant.channel = axis
            if evaluate_signal(address, signal.function, axis):
                return True
            sim.wind[axis] += sim.motion.value * signal.peak[axis]
    call(sim.push.function.address, address, address + record.AT.push, 0, 0)
    return False


@not_inlined
def _load(address, sim, data, signal, k):
    """Apply a disturbance of every channel: a force on its joint, or a horizontal one on its body.
    Return whether it raised.
    """
    instant = sim.instant
    instant.stream = signal.stream
    for i in range(sim.n):
        channel = channel_at(sim.channels, i)
        if signal.sees != 0:
            if _evaluate_feedback(address, sim, data, signal.function, i, k):
                return True
        elif signal.stream != 0.0 or i == 0:  # without random numbers all channels have the same
            instant.channel = i
            if evaluate_signal(address, signal.function, i):
                return True
        force = sim.motion.value
        if signal.cartesian != 0:
            data.xfrc_applied[channel.horizontal] += force
        elif channel.ctrl >= 0 and channel.qfrc >= 0:
            data.qfrc_applied[channel.qfrc] += force
        elif channel.ctrl >= 0 or channel.gathered >= 0:
            data.xfrc_applied[channel.xfrc] += channel.sign * force
    return False


@not_inlined
def _evaluate_feedback(address, sim, data, function, i, k):
    """Write the force of a disturbance that sees the loop into the record's motion. It is evaluated
    once a sample, in channel 0, and repeated in the other channels and at other stages.

    Return whether it raised.
    """
    if i > 0 or k < 0:
        sim.motion.value = pointer(function.memory)[0]
        return False
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
    return evaluate_signal(address, function, 0)
