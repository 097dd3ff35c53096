"""Forces on a channel's body: disturbances that the callback puts there, and what mjData says acted on the joint."""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import math

from numba import njit

from smc_mujoco.common.jit import call
from smc_mujoco.simulation import channels as column
from smc_mujoco.simulation import state as slot


@njit(error_model="numpy", inline="always")
def clear(row, table, xfrc, joints):
    """Take the disturbances of every channel away."""
    for i in range(int(row[slot.CHANNELS])):
        xfrc[table[i, column.XFRC]], xfrc[table[i, column.PUSH]] = 0.0, 0.0
        if table[i, column.DIRECT] >= 0:
            joints[table[i, column.DIRECT]] = 0.0


@njit(error_model="numpy")
def disturb(base, row, table, xfrc, joints, t):
    """The sum of the disturbances of every channel at time t, onto its body; of an own model's, onto its joint."""
    n, given, out, first = int(row[slot.CHANNELS]), int(row[slot.INPUT]), int(row[slot.OUTPUT]), int(row[slot.SIGNALS])
    row[given], row[given + 1] = t, row[slot.SEED]
    clear(row, table, xfrc, joints)
    for j in range(int(row[slot.SIGNAL_COUNT])):
        at = first + slot.SIGNAL_FIELDS * j
        address, values, stream = int(row[at]), base + 8 * int(row[at + 1]), row[at + 2]
        row[given + 3] = stream
        for i in range(n):
            if stream != 0.0 or i == 0:  # what is not random is the same in every channel
                row[given + 2] = i
                memory = base + 8 * (int(row[at + 3]) + i * int(row[at + 4]))
                if call(address, base + 8 * given, values, memory, base + 8 * out) != 0:
                    return slot.DISTURBANCE_RAISED
            if row[at + 5] != 0.0:  # a horizontal force
                xfrc[table[i, column.PUSH]] += row[out]
            elif table[i, column.CTRL] >= 0 and table[i, column.DIRECT] >= 0:
                joints[table[i, column.DIRECT]] += row[out]
            elif table[i, column.CTRL] >= 0:  # matched: where an actuator could answer it
                xfrc[table[i, column.XFRC]] += table[i, column.SIGN] * row[out]
    for i in range(n):
        if not (math.isfinite(xfrc[table[i, column.XFRC]]) and math.isfinite(xfrc[table[i, column.PUSH]])):
            return slot.DISTURBANCE_NOT_FINITE
        if table[i, column.DIRECT] >= 0 and not math.isfinite(joints[table[i, column.DIRECT]]):
            return slot.DISTURBANCE_NOT_FINITE
    return slot.FINE


@njit(error_model="numpy", inline="always")
def disturbance(table, i, xfrc, joints, tips, anchors):
    """The generalised force that disturbances exert on channel i."""
    if table[i, column.DIRECT] >= 0:
        return joints[table[i, column.DIRECT]]
    d = table[i, column.SIGN] * xfrc[table[i, column.XFRC]]
    if table[i, column.TIP] >= 0:
        arm = tips[table[i, column.TIP]] - anchors[table[i, column.ANCHOR]]
        d += table[i, column.PUSH_SIGN] * arm * xfrc[table[i, column.PUSH]]
    return d


@njit(error_model="numpy", inline="always")
def weigh(row, table, actuators, constraints):
    """Add up what drives, and what friction and contacts, exerted on each joint in the last physics step."""
    for i in range(int(row[slot.CHANNELS])):
        at = int(row[slot.FORCES]) + 2 * i
        if table[i, column.FORCE] >= 0:
            row[at] += actuators[table[i, column.FORCE]]
        row[at + 1] += constraints[table[i, column.QVEL]]
        if table[i, column.FRICTION] >= 0:
            row[at + 1] += actuators[table[i, column.FRICTION]]
