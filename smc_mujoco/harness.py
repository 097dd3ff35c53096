"""The harness: what the control callback does in one simulation, as its row names it.

At the first stage of a control sample, per channel:

    sensors -> noise -> velocity estimator -> law -> saturation -> ring of commands

and at every stage: the command whose delay has passed -> ctrl, disturbance(t) -> xfrc_applied. Time counts in calls:
RK4 calls four times a step, at t, t + h/2, t + h/2 and t + h, and the next step begins at t + h again, so the clock
alone cannot tell a sample from a last stage. A run that leaves the finite world, or whose law raises, is marked in its
row and gets no more control; the simulations beside it go on.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import math

from numba import carray, njit

from smc_mujoco import noise
from smc_mujoco.channels import CTRL, QPOS, QVEL, SIGN, V_SENSOR, X_SENSOR, XFRC
from smc_mujoco.compiled import call, integers, pointer
from smc_mujoco.row import (
    CALLS,
    CHANNELS,
    DELAY,
    DISTURBANCE_NOT_FINITE,
    DISTURBANCE_RAISED,
    DIVERGED,
    ESTIMATOR,
    ESTIMATOR_GAINS,
    ESTIMATOR_MEMORY,
    ESTIMATOR_RAISED,
    ESTIMATOR_STRIDE,
    FAILED_STEP,
    FAILURE,
    FINE,
    GAINS,
    INPUT,
    LAW,
    LAW_MEMORY,
    LAW_RAISED,
    LAW_STRIDE,
    LIMIT,
    LOG,
    NOMINAL,
    NOMINAL_RAISED,
    NOMINAL_VALUES,
    NOT_FINITE,
    OUTPUT,
    PERIOD,
    REFERENCE,
    REFERENCE_RAISED,
    REFERENCE_VALUES,
    RING,
    RINGS,
    SAMPLES,
    SEED,
    SIGMA_V,
    SIGMA_X,
    SIGNAL_COUNT,
    SIGNAL_FIELDS,
    SIGNALS,
    STAGES,
    STATE,
    STEP,
    STEPS,
    TABLE,
)  # fmt: skip

WORLD = 1e6  # |x| or |v| beyond this many SI units has diverged; MuJoCo itself gives up at 1e10
LEFT = 1.0 - 1e-8  # of a step: the last stage of RK4 looks at its end from the left, before a jump that happens there
HUGE = 1e10  # MuJoCo drops every control where one is larger


@njit(inline="always")
def _at(base, row, slot):
    """Address of the slice whose offset stands in a header slot."""
    return base + 8 * int(row[slot])


@njit(error_model="numpy")
def _escaped(row, table, qpos, qvel):
    for i in range(int(row[CHANNELS])):
        if not (abs(qpos[table[i, QPOS]]) < WORLD and abs(qvel[table[i, QVEL]]) < WORLD):
            return True
    return False


@njit(error_model="numpy")
def _measure(base, row, table, sensors, k):
    """Noisy position and estimated velocity of every channel into the row's state; a failure code."""
    n, at, given, out = int(row[CHANNELS]), int(row[STATE]) + 2, int(row[INPUT]), int(row[OUTPUT])
    noisy = row[SIGMA_X] != 0.0 or row[SIGMA_V] != 0.0
    for i in range(n):
        x, v = sensors[table[i, X_SENSOR]], sensors[table[i, V_SENSOR]]
        if noisy:
            z = noise.normals(row[SEED], i, noise.MEASUREMENT, k)
            x, v = x + row[SIGMA_X] * z[0], v + row[SIGMA_V] * z[1]
        row[given], row[given + 1], row[given + 2] = row[PERIOD], x, v
        memory = _at(base, row, ESTIMATOR_MEMORY) + 8 * i * int(row[ESTIMATOR_STRIDE])
        if call(int(row[ESTIMATOR]), base + 8 * given, _at(base, row, ESTIMATOR_GAINS), memory, base + 8 * out) != 0:
            return ESTIMATOR_RAISED
        row[at + i], row[at + n + i] = x, row[out]
    return FINE


@njit(error_model="numpy")
def _decide(base, row, log, k):
    """The law of every channel: its command into the ring, u and s into the log; a failure code."""
    n, state, given, out = int(row[CHANNELS]), int(row[STATE]), int(row[INPUT]), int(row[OUTPUT])
    ring = int(row[RING]) + (k % int(row[RINGS])) * n
    y = row[given : given + 11]
    t = k * row[PERIOD]
    y[0], y[1], y[2] = t, 0.0, 0.0
    if call(int(row[REFERENCE]), base + 8 * given, _at(base, row, REFERENCE_VALUES), 0, base + 8 * out) != 0:
        return REFERENCE_RAISED
    y[1], y[6], y[7], y[8] = row[PERIOD], row[out], row[out + 1], row[out + 2]
    row[state + 1] = n
    for i in range(n):
        row[state] = i
        if call(int(row[NOMINAL]), base + 8 * state, _at(base, row, NOMINAL_VALUES), 0, base + 8 * out) != 0:
            return NOMINAL_RAISED
        y[9], y[10] = row[out], row[out + 1]
        y[2], y[3] = row[state + 2 + i], row[state + 2 + n + i]
        y[4], y[5] = y[2] - y[6], y[3] - y[7]
        memory = _at(base, row, LAW_MEMORY) + 8 * i * int(row[LAW_STRIDE])
        if call(int(row[LAW]), base + 8 * given, _at(base, row, GAINS), memory, base + 8 * out) != 0:
            return LAW_RAISED
        u = min(max(row[out], -row[LIMIT]), row[LIMIT])
        if not (math.isfinite(row[out]) and math.isfinite(row[out + 1]) and abs(u) < HUGE):
            return NOT_FINITE
        row[ring + i], log[2, k, i], log[4, k, i], log[6, k, i] = u, u, row[out + 1], y[6]
    return FINE


@njit(error_model="numpy")
def _disturb(base, row, table, xfrc, t):
    """The sum of the disturbances of every channel at time t, onto its body."""
    n, given, out, first = int(row[CHANNELS]), int(row[INPUT]), int(row[OUTPUT]), int(row[SIGNALS])
    row[given], row[given + 1] = t, row[SEED]
    for i in range(n):
        xfrc[table[i, XFRC]] = 0.0
    for j in range(int(row[SIGNAL_COUNT])):
        at = first + SIGNAL_FIELDS * j
        address, values, stream = int(row[at]), base + 8 * int(row[at + 1]), row[at + 2]
        row[given + 3] = stream
        for i in range(n):
            if stream != 0.0 or i == 0:  # what is not random is the same in every channel
                row[given + 2] = i
                memory = base + 8 * (int(row[at + 3]) + i * int(row[at + 4]))
                if call(address, base + 8 * given, values, memory, base + 8 * out) != 0:
                    return DISTURBANCE_RAISED
            xfrc[table[i, XFRC]] += table[i, SIGN] * row[out]
    for i in range(n):
        if not math.isfinite(xfrc[table[i, XFRC]]):
            return DISTURBANCE_NOT_FINITE
    return FINE


@njit(error_model="numpy")
def control(base, row, qpos, qvel, ctrl, xfrc, sensors):
    """One callback of one simulation."""
    calls, n = int(row[CALLS]), int(row[CHANNELS])
    row[CALLS] = calls + 1
    if row[FAILURE] != FINE:
        return
    step, stage = calls // int(row[STAGES]), calls % int(row[STAGES])
    table = carray(integers(int(row[TABLE])), (n, 7))
    k, within = step // int(row[STEPS]), step % int(row[STEPS])
    log = carray(pointer(int(row[LOG])), (7, int(row[SAMPLES]), n))
    sampling = stage == 0 and within == 0
    failure = FINE
    if stage == 0 and _escaped(row, table, qpos, qvel):
        failure = DIVERGED
    elif sampling:
        failure = _measure(base, row, table, sensors, k)
        if failure == FINE:
            failure = _decide(base, row, log, k)
    past = step - int(row[DELAY])
    if stage == 0 and past >= 0 and past % int(row[STEPS]) == 0:
        ring = int(row[RING]) + (past // int(row[STEPS]) % int(row[RINGS])) * n
        for i in range(n):
            ctrl[table[i, CTRL]] = row[ring + i]
    if row[SIGNAL_COUNT] != 0.0 and failure == FINE:
        fraction = 0.0 if stage == 0 else (LEFT if stage == 3 else 0.5)
        failure = _disturb(base, row, table, xfrc, k * row[PERIOD] + (within + fraction) * row[STEP])
    if failure != FINE:
        row[FAILURE], row[FAILED_STEP] = failure, step
        for i in range(n):
            ctrl[table[i, CTRL]], xfrc[table[i, XFRC]] = 0.0, 0.0
    elif sampling:
        for i in range(n):
            log[0, k, i], log[1, k, i] = qpos[table[i, QPOS]], qvel[table[i, QVEL]]
            log[3, k, i], log[5, k, i] = ctrl[table[i, CTRL]], table[i, SIGN] * xfrc[table[i, XFRC]]
