"""The harness: what the control callback does in one simulation, as its row names it.

At the first stage of a control sample, per channel:

    sensors -> noise, encoder -> velocity estimator -> law -> saturation -> ring of commands

and at every stage: the command whose delay has passed -> ctrl, of two drives in series through the first; and
disturbance(t) -> xfrc_applied. The forces that acted since the sample before, on average, are logged with each. Time
counts in calls: RK4 calls four times a step, at t, t + h/2, t + h/2 and t + h, and the next step begins at t + h again,
so the clock alone cannot tell a sample from a last stage. A run that leaves the finite world, or whose law raises, is
marked in its row and gets no more control; the simulations beside it go on.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import math

from numba import carray, njit

from smc_mujoco import channels as column
from smc_mujoco import noise
from smc_mujoco import row as slot
from smc_mujoco.compiled import call, integers, pointer
from smc_mujoco.forces import clear, disturb, disturbance, weigh

WORLD = 1e6  # |x| or |v| beyond this many SI units has diverged; MuJoCo itself gives up at 1e10
LEFT = 1.0 - 1e-8  # of a step: the last stage of RK4 looks at its end from the left, before a jump that happens there
HUGE = 1e10  # MuJoCo drops every control where one is larger


@njit(inline="always")
def _at(base, row, name):
    """Address of the slice whose offset stands in a header slot."""
    return base + 8 * int(row[name])


@njit(error_model="numpy", inline="always")
def _escaped(row, qpos, qvel):
    for i in range(int(row[slot.POSITIONS])):
        if not abs(qpos[i]) < WORLD:
            return True
    for i in range(int(row[slot.VELOCITIES])):  # noqa: SIM110  # numba knows no generator
        if not abs(qvel[i]) < WORLD:
            return True
    return False


@njit(error_model="numpy", inline="always")
def _read(row, i, x, v, j, hinge):
    """Reading j of channel i: position and velocity after noise, bias, rounding, and loss."""
    if row[slot.SIGMA_X] != 0.0 or row[slot.SIGMA_V] != 0.0:
        z = noise.normals(row[slot.SEED], i, noise.MEASUREMENT, j)
        x, v = x + row[slot.SIGMA_X] * z[0], v + row[slot.SIGMA_V] * z[1]
    if row[slot.BIAS] != 0.0:
        x += row[slot.BIAS]
    if row[slot.COUNTS] != 0.0:
        quantum = (2.0 * math.pi if hinge else 1.0) / row[slot.COUNTS]
        x = quantum * math.floor(x / quantum + 0.5)
    held = int(row[slot.HELD]) + 2 * i
    if row[slot.LOST] != 0.0:
        if j > 0 and noise.uniform(row[slot.SEED], i, noise.DROPOUT, j) < row[slot.LOST]:
            return row[held], row[held + 1]
        row[held], row[held + 1] = x, v
    return x, v


@njit(error_model="numpy")
def _measure(base, row, table, sensors, k):
    """Measured position and estimated velocity of every channel into the row's state; a failure code."""
    n, at, given, out = int(row[slot.CHANNELS]), int(row[slot.STATE]) + 2, int(row[slot.INPUT]), int(row[slot.OUTPUT])
    j = k
    if row[slot.READ_PERIOD] != 0.0:
        j = max(0, math.floor((k * row[slot.PERIOD] - row[slot.READ_DELAY]) / row[slot.READ_PERIOD] + 1e-6))
    for i in range(n):
        x, v = sensors[table[i, column.X_SENSOR]], sensors[table[i, column.V_SENSOR]]
        x, v = _read(row, i, x, v, j, table[i, column.TIP] >= 0)
        row[at - 2], row[given], row[given + 1], row[given + 2] = i, row[slot.PERIOD], x, v
        memory = _at(base, row, slot.ESTIMATOR_MEMORY) + 8 * i * int(row[slot.ESTIMATOR_STRIDE])
        gains = _at(base, row, slot.ESTIMATOR_GAINS)
        if call(int(row[slot.ESTIMATOR]), base + 8 * given, gains, memory, base + 8 * out) != 0:
            return slot.ESTIMATOR_RAISED
        row[at + i], row[at + n + i], row[at + 2 * n + i] = x, row[out], row[out + 1]
    return slot.FINE


@njit(error_model="numpy", inline="always")
def _nominal(base, row, i):
    """Nominal f and g of channel i into the row's outputs; not 0 where the model raised."""
    state = int(row[slot.STATE])
    row[state], row[state + 1] = i, row[slot.CHANNELS]
    return call(
        int(row[slot.NOMINAL]),
        base + 8 * state,
        _at(base, row, slot.NOMINAL_VALUES),
        0,
        _at(base, row, slot.OUTPUT),
    )


@njit(error_model="numpy", inline="always")
def _limit(row, i):
    """Bound on |u| of driven channel i."""
    return row[slot.LIMIT] if row[slot.LIMITS] == 0.0 else row[int(row[slot.LIMITS]) + i]


@njit(error_model="numpy", inline="always")
def _inform(base, row, y, i, partner):
    """What the law of channel i is told, y; `partner` moves with it without an actuator (0: none). A failure code."""
    n, state, given, out = int(row[slot.CHANNELS]), int(row[slot.STATE]), int(row[slot.INPUT]), int(row[slot.OUTPUT])
    x, v, a = state + 2, state + 2 + n, state + 2 + 2 * n
    y[17], y[18], y[19], y[20] = 0.0, 0.0, 0.0, 0.0
    if partner > 0:
        if _nominal(base, row, partner) != 0:
            return slot.NOMINAL_RAISED
        y[17], y[18], y[19], y[20] = row[x + partner], row[v + partner], row[out], row[out + 1]
    if _nominal(base, row, i) != 0:
        return slot.NOMINAL_RAISED
    y[9], y[10] = row[out], row[out + 1]
    y[2], y[3] = row[x + i], row[v + i]
    y[4], y[5] = y[2] - y[6], y[3] - y[7]
    y[11] = y[8] if math.isnan(row[a + i]) else row[a + i]  # none is estimated: as the reference asks
    y[12], y[13], y[14], y[15], y[16] = _limit(row, i), row[slot.MODEL], 0.0, 0.0, 0.0
    if row[slot.SURFACE] != 0.0:
        memory = _at(base, row, slot.SURFACE_MEMORY) + 8 * i * int(row[slot.SURFACE_STRIDE])
        gains = _at(base, row, slot.SURFACE_GAINS)
        if call(int(row[slot.SURFACE]), base + 8 * given, gains, memory, base + 8 * out) != 0:
            return slot.SURFACE_RAISED
        y[14], y[15], y[16] = 1.0, row[out], row[out + 1]
    return slot.FINE


@njit(error_model="numpy")
def _decide(base, row, table, log, k):
    """The law of every driven channel: its command into the ring, u and s into the log; a failure code."""
    n, given, out = int(row[slot.CHANNELS]), int(row[slot.INPUT]), int(row[slot.OUTPUT])
    ring = int(row[slot.RING]) + (k % int(row[slot.RINGS])) * n
    y = row[given : given + 21]
    y[0], y[1], y[2] = k * row[slot.PERIOD], 0.0, 0.0
    if call(int(row[slot.REFERENCE]), base + 8 * given, _at(base, row, slot.REFERENCE_VALUES), 0, base + 8 * out) != 0:
        return slot.REFERENCE_RAISED
    y[1], y[6], y[7], y[8] = row[slot.PERIOD], row[out], row[out + 1], row[out + 2]
    driven = _driven(table, n)
    for i in range(n):
        if i >= driven:  # only measured
            row[ring + i], log[2, k, i], log[4, k, i], log[6, k, i] = 0.0, 0.0, 0.0, 0.0
            continue
        failure = _inform(base, row, y, i, i + driven if i + driven < n else 0)
        if failure != slot.FINE:
            return failure
        memory = _at(base, row, slot.LAW_MEMORY) + 8 * i * int(row[slot.LAW_STRIDE])
        if call(int(row[slot.LAW]), base + 8 * given, _at(base, row, slot.GAINS), memory, base + 8 * out) != 0:
            return slot.LAW_RAISED
        limit = _limit(row, i)
        u = min(max(row[out], -limit), limit)
        asked = abs(u) * max(1.0, row[slot.SCALE])
        if not (math.isfinite(row[out]) and math.isfinite(row[out + 1]) and asked < HUGE):
            return slot.NOT_FINITE
        row[ring + i], log[2, k, i], log[4, k, i], log[6, k, i] = u, u, row[out + 1], y[6]
        row[int(row[slot.STATE]) + 2 + 3 * n + i] = u
    return slot.FINE


@njit(error_model="numpy", inline="always")
def _driven(table, n):
    """How many of the channels have an actuator: the first ones."""
    count = 0
    for i in range(n):
        count += table[i, column.CTRL] >= 0
    return count


@njit(error_model="numpy", inline="always")
def _apply(row, table, ctrl, step):
    """The command whose delay has passed at a physics step, where one arrives, to the actuators."""
    n, past, first = int(row[slot.CHANNELS]), step - int(row[slot.DELAY]), int(row[slot.FIRST])
    if past >= 0 and past % int(row[slot.STEPS]) == 0:
        ring = int(row[slot.RING]) + (past // int(row[slot.STEPS]) % int(row[slot.RINGS])) * n
        for i in range(n):
            if first > 0:
                row[first + 2 * i] = row[ring + i]
            elif table[i, column.CTRL] >= 0:
                ctrl[table[i, column.CTRL]] = row[slot.SCALE] * row[ring + i]
    if first > 0:
        _pass_on(row, table, ctrl, n, first)


@njit(error_model="numpy", inline="always")
def _pass_on(row, table, ctrl, n, first):
    """Of two drives the first: what it asks of the second over a physics step, and its output at the end."""
    for i in range(n):
        if table[i, column.CTRL] >= 0:
            u, a = row[first + 2 * i], row[first + 2 * i + 1]
            ctrl[table[i, column.CTRL]] = row[slot.SCALE] * (u + row[slot.FIRST_HELD] * (a - u))
            row[first + 2 * i + 1] = u + row[slot.FIRST_LEFT] * (a - u)


@njit(error_model="numpy", inline="always")
def _applied(row, table, ctrl, i):
    """The command that reached the drive of channel i."""
    if table[i, column.CTRL] < 0:
        return 0.0
    if row[slot.FIRST] > 0.0:
        return row[int(row[slot.FIRST]) + 2 * i]
    limit = _limit(row, i)
    return min(max(ctrl[table[i, column.CTRL]] / row[slot.SCALE], -limit), limit)  # scaled and back: an ulp beyond


@njit(error_model="numpy")
def control(base, row, qpos, qvel, ctrl, xfrc, sensors, tips, anchors, actuators, constraints, joints):
    """One callback of one simulation."""
    calls, n = int(row[slot.CALLS]), int(row[slot.CHANNELS])
    row[slot.CALLS] = calls + 1
    if row[slot.FAILURE] != slot.FINE:
        return
    step, stage = calls // int(row[slot.STAGES]), calls % int(row[slot.STAGES])
    table = carray(integers(int(row[slot.TABLE])), (n, column.COLUMNS))
    k, within = step // int(row[slot.STEPS]), step % int(row[slot.STEPS])
    log = carray(pointer(int(row[slot.LOG])), (slot.LOGS, int(row[slot.SAMPLES]), n))
    sampling = stage == 0 and within == 0
    failure = slot.FINE
    if stage == 0:
        weigh(row, table, actuators, constraints)
    if stage == 0 and _escaped(row, qpos, qvel):
        failure = slot.DIVERGED
    elif sampling:
        failure = _measure(base, row, table, sensors, k)
        if failure == slot.FINE:
            failure = _decide(base, row, table, log, k)
    if stage == 0:
        _apply(row, table, ctrl, step)
    if row[slot.SIGNAL_COUNT] != 0.0 and failure == slot.FINE:
        fraction = 0.0 if stage == 0 else (LEFT if stage == 3 else 0.5)
        failure = disturb(base, row, table, xfrc, joints, k * row[slot.PERIOD] + (within + fraction) * row[slot.STEP])
    if failure != slot.FINE:
        row[slot.FAILURE], row[slot.FAILED_STEP] = failure, step
        clear(row, table, xfrc, joints)
        for i in range(n):
            if table[i, column.CTRL] >= 0:
                ctrl[table[i, column.CTRL]] = 0.0
    elif sampling:
        for i in range(n):
            log[0, k, i], log[1, k, i] = qpos[table[i, column.QPOS]], qvel[table[i, column.QVEL]]
            log[3, k, i] = _applied(row, table, ctrl, i)
            log[5, k, i] = disturbance(table, i, xfrc, joints, tips, anchors)
            at = int(row[slot.FORCES]) + 2 * i
            log[7, k, i], log[8, k, i] = row[at] / row[slot.STEPS], row[at + 1] / row[slot.STEPS]
            row[at], row[at + 1] = 0.0, 0.0
