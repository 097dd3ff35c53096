"""One simulation's mjData.userdata: everything the callback needs besides the MuJoCo state, slices by name.

    header | gains: law, estimator, nominal, reference | disturbances | inputs | outputs | state | memories | ring

The header holds scalars: counts, addresses (exact in a float64, they are below 2^53) and offsets of the other slices.
What is the same for every simulation of a layout - the channel table - and what is only written - the log - lie outside
the row, by address. All of it is float64, so that a Batch copies it as state.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

# Header slots.
(
    IS_ROW, CALLS, FAILURE, FAILED_STEP,  # what happened so far
    CHANNELS, TABLE, POSITIONS, VELOCITIES, STEPS, STAGES, STEP, PERIOD,  # channel table, nq, nv, clock
    DELAY, RING, RINGS, LIMIT, LIMITS, SCALE, FORCES,  # delay in steps, ring, its samples; u_max, or one each; drive
    FIRST, FIRST_HELD, FIRST_LEFT,  # of two drives the first: its command and output a channel, and its Tandem
    SEED, SIGMA_X, SIGMA_V, BIAS, COUNTS, LOST, HELD, READ_PERIOD, READ_DELAY,  # noise, encoder, its last readings
    LAW, GAINS, MODEL, SURFACE, SURFACE_GAINS, ESTIMATOR, ESTIMATOR_GAINS,
    NOMINAL, NOMINAL_VALUES, REFERENCE, REFERENCE_VALUES,
    SIGNALS, SIGNAL_COUNT, LOG, SAMPLES,
    INPUT, OUTPUT, STATE,
    LAW_MEMORY, LAW_STRIDE, SURFACE_MEMORY, SURFACE_STRIDE, ESTIMATOR_MEMORY, ESTIMATOR_STRIDE,
    HEADER,
) = range(56)  # fmt: skip

# Of each disturbance: function, offset of its parameters, stream of random numbers, offset and stride of its memory,
# whether it is a Cartesian force.
SIGNAL_FIELDS = 6

# What a log holds of every sample: position, velocity, command, command after its delay, sliding variable, disturbance,
# reference, the drive's force, what friction and contacts exert.
LOGGED = ("x", "v", "u", "applied", "s", "d", "r", "force", "reaction")
LOGS = len(LOGGED)

# What FAILURE says.
FINE, DIVERGED, NOT_FINITE, DISTURBANCE_NOT_FINITE = range(4)
ESTIMATOR_RAISED, REFERENCE_RAISED, NOMINAL_RAISED, LAW_RAISED, DISTURBANCE_RAISED, SURFACE_RAISED, INTERRUPTED = range(
    4, 11
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Part:
    """A compiled function's address, its parameters, and the floats of memory it keeps per channel."""

    address: int
    values: Sequence[float]
    memory: int = 0
    stream: int = 0  # of random numbers; 0: it takes none, and is the same in every channel
    cartesian: bool = False  # a disturbance that is a horizontal force on the body, not a force on the joint
    kept: object = None  # what must live as long as the row


@dataclasses.dataclass(frozen=True, kw_only=True)
class Contents:
    """What one simulation's row says."""

    law: Part
    model: bool  # whether the law may use the nominal model
    surface: Part | None
    estimator: Part
    nominal: Part
    reference: Part
    disturbances: Sequence[Part]
    n: int
    steps: int  # physics steps per control sample
    stages: int  # callbacks per physics step
    step: float  # s
    period: float  # s
    delay: int  # physics steps
    limit: float  # on |u|
    limits: Sequence[float]  # of each driven channel, where they are not all `limit`; else empty
    seed: int
    sigma_x: float
    sigma_v: float
    scale: float = 1.0  # what a drive takes per unit of u: V / (N m) of a motor's amplifier
    tandem: tuple[float, float] | None = None  # of two drives, as of Tandem
    bias: float = 0.0  # of the encoder, in the unit of x
    counts: float = 0.0  # a revolution of a hinge, a metre of a slide; 0: no rounding
    lost: float = 0.0  # probability that a reading gets lost
    read_period: float = 0.0  # s between readings; 0: every control sample
    read_delay: float = 0.0  # s until a reading arrives


def pack(c: Contents, mark: float, table: np.ndarray, log: np.ndarray) -> np.ndarray:
    """A fresh row.

    Args:
      c: its contents.
      mark: what tells it from any other userdata, `callback.mark()`.
      table: the channel table, (n, 14) int64, which must outlive the run.
      log: (LOGS, K + 1, n) float64, written at samples, which must outlive the run.
    """
    row = [0.0] * HEADER
    n, rings = c.n, c.delay // c.steps + 1

    def put(slot: int, values: Sequence[float]) -> None:
        row[slot] = len(row)
        row.extend(values)

    def reserve(slot: int, size: int) -> None:
        put(slot, [0.0] * size)

    row[IS_ROW] = mark
    row[CHANNELS], row[TABLE], row[STEPS], row[STAGES] = n, address(table), c.steps, c.stages
    row[STEP], row[PERIOD], row[DELAY], row[RINGS] = c.step, c.period, c.delay, rings
    row[LIMIT], row[SCALE] = c.limit, c.scale
    row[SEED], row[SIGMA_X], row[SIGMA_V] = c.seed, c.sigma_x, c.sigma_v
    row[BIAS], row[COUNTS], row[LOST] = c.bias, c.counts, c.lost
    row[READ_PERIOD], row[READ_DELAY] = c.read_period, c.read_delay
    row[LAW], row[ESTIMATOR], row[NOMINAL] = c.law.address, c.estimator.address, c.nominal.address
    row[REFERENCE], row[SIGNAL_COUNT] = c.reference.address, len(c.disturbances)
    row[LOG], row[SAMPLES] = address(log), log.shape[1]
    row[LAW_STRIDE], row[ESTIMATOR_STRIDE] = c.law.memory, c.estimator.memory
    row[MODEL] = c.model
    if c.limits:
        put(LIMITS, c.limits)
    if c.tandem is not None:
        row[FIRST_HELD], row[FIRST_LEFT] = c.tandem
        reserve(FIRST, 2 * n)
    put(GAINS, c.law.values)
    if c.surface is not None:
        row[SURFACE], row[SURFACE_STRIDE] = c.surface.address, c.surface.memory
        put(SURFACE_GAINS, c.surface.values)
        reserve(SURFACE_MEMORY, c.surface.memory * n)
    put(ESTIMATOR_GAINS, c.estimator.values)
    put(NOMINAL_VALUES, c.nominal.values)
    put(REFERENCE_VALUES, c.reference.values)
    reserve(SIGNALS, SIGNAL_FIELDS * len(c.disturbances))
    reserve(INPUT, 24)
    reserve(OUTPUT, 4)
    reserve(STATE, 2 + 4 * n)  # the nominal model's input: i, n, measured x, estimated v and acceleration, last u
    reserve(HELD, 2 * n)
    reserve(FORCES, 2 * n)
    for i, d in enumerate(c.disturbances):
        at = int(row[SIGNALS]) + SIGNAL_FIELDS * i
        memory = len(row) + len(d.values)
        row[at : at + SIGNAL_FIELDS] = [d.address, len(row), d.stream, memory, d.memory, d.cartesian]
        row.extend([*d.values, *[0.0] * (d.memory * n)])
    reserve(LAW_MEMORY, c.law.memory * n)
    reserve(ESTIMATOR_MEMORY, c.estimator.memory * n)
    reserve(RING, rings * n)
    return np.array(row)


def address(array: np.ndarray) -> int:
    """Where a C-contiguous array's data lie."""
    return array.ctypes.data
