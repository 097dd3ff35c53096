"""Whether a run comes to rest, by the rule of `region_of_attraction`, taken sample by sample.

One rule serves the loop, where it is a metric, and traces of MuJoCo.
"""

import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from smc_mujoco.analysis.engine import CONVERGES, DOES_NOT, UNDECIDED
from smc_mujoco.analysis.engine.form import SETTING, WIDTH, Form, layout, metric_places
from smc_mujoco.analysis.engine.scores import WRITTEN_OUT, log_in
from smc_mujoco.common.aliases import Floats
from smc_mujoco.common.jit import inlined, pointer
from smc_mujoco.metrics.conventions import SETTLING_BAND
from smc_mujoco.simulation.cfunctions import cached
from smc_mujoco.simulation.state import LOG

if TYPE_CHECKING:
    from smc_mujoco.simulation.trace import Trace

REST_TOLERANCE = 1e-6  # of X, V and u_max: a run that changes less is at rest
# of the squared distance (e/X)^2 + (v/V)^2, second half over first
MAX_FINAL_RATIO = 1.05
MAX_EARLY_RATIO = 0.9
NEAR_SQUARE = (0.1 * SETTLING_BAND) ** 2  # squared distance
PARTS = 5  # of the run, in which a run that approaches comes closer
NAME = "outcome"
SIGNALS = 3  # x, v and u, whose ranges tell rest


def work_indices(n: int, first: int) -> tuple[int, ...]:
    """Return where a run of n channels keeps each value in its row of work, from index `first` on.

    In order: the squared distance at the start; whether a late sample is in the band, and out of
    it; the largest squares of both late halves; the largest |u|. Then the first index of the
    largest squares of PARTS, of the smallest and of the largest values of the late signals.
    """
    ends = first + 6 + PARTS
    return (*range(first, first + 7), ends, ends + SIGNALS * n)


def taking(n: int, reach: int, now: int, first: int) -> Any:
    """Return a compiled function (row, work, k): take sample k of n channels, from place `now` of
    `work` on. The row has the reach from place `reach` on.
    """
    START, INSIDE, OUTSIDE, FIRST, SECOND, LARGEST_U, LARGEST, LOW, HIGH = work_indices(n, first)

    @inlined
    def take(row, work, k):
        count = int(row[SETTING.samples]) + 1
        late = int(row[SETTING.late])
        square = 0.0
        distance = 0.0
        for i in range(n):
            sample = log_in(work, now + WIDTH * i)
            e = (sample.x - sample.r) / row[reach]
            v = sample.v / row[reach + 1]
            square += e * e + v * v
            distance = max(distance, abs(e), abs(v))
            work[LARGEST_U] = max(work[LARGEST_U], abs(sample.u))
            for j, value in enumerate((sample.x, sample.v, sample.u)):
                place = SIGNALS * i + j
                if k == late:
                    work[LOW + place] = value
                    work[HIGH + place] = value
                work[LOW + place] = min(work[LOW + place], value)
                work[HIGH + place] = max(work[HIGH + place], value)
        if k == 0:
            work[START] = square
        # the first parts have a sample more than the others, as in numpy's array_split
        size = count // PARTS
        longer = count % PARTS
        part = k // (size + 1)
        if part >= longer:
            part = longer + (k - longer * (size + 1)) // size
        work[LARGEST + part] = max(work[LARGEST + part], square)
        if k >= late:
            if distance <= SETTLING_BAND:
                work[INSIDE] = 1.0
            else:
                work[OUTSIDE] = 1.0
            half = FIRST if k < late + (count - late) // 2 else SECOND
            work[half] = max(work[half], square)

    return take


def judging(n: int, reach: int, first: int) -> Any:
    """Return a compiled function (row, work) -> verdict; UNDECIDED also where a run needs to be
    longer.
    """
    START, INSIDE, OUTSIDE, FIRST, SECOND, LARGEST_U, LARGEST, LOW, HIGH = work_indices(n, first)

    @inlined
    def judge(row, work):
        final = row[reach + 3] != 0.0
        ratio = MAX_EARLY_RATIO
        near = 0.0
        if final:
            ratio = MAX_FINAL_RATIO
        if final or work[START] > NEAR_SQUARE:
            near = NEAR_SQUARE
        if work[OUTSIDE] == 0.0 and work[SECOND] <= max(ratio * work[FIRST], near):
            return CONVERGES
        if work[INSIDE] != 0.0:
            return UNDECIDED
        if final:
            for part in range(2, PARTS):
                if work[LARGEST + part] > MAX_EARLY_RATIO * work[LARGEST + part - 1]:
                    return DOES_NOT
            return UNDECIDED
        bound = row[reach + 2]
        if bound == np.inf:
            bound = work[LARGEST_U]
        for i in range(SIGNALS * n):
            size = bound
            if i % SIGNALS < 2:
                size = row[reach + i % SIGNALS]
            if work[HIGH + i] - work[LOW + i] > REST_TOLERANCE * size:
                return UNDECIDED
        return DOES_NOT

    return judge


def outcome(form: Form, at: int) -> tuple[Any, Any]:
    """Return the verdict as a metric of the loop."""
    row_at, work_at = layout(form)[:2]
    return taking(form.n, row_at.reach, work_at.now, at), judging(form.n, row_at.reach, at)


WRITTEN_OUT[NAME] = outcome


def over_trace(trace: "Trace", late: int, reach: Floats) -> float:
    """Return the verdict on a trace, of which samples from `late` on count, with the reach."""
    samples, n = trace.x.shape
    log = np.zeros((samples, n), LOG)
    for name in ("x", "v", "u", "r"):
        log[name] = getattr(trace, name)
    row = np.zeros(len(SETTING) + len(reach))
    row[SETTING.samples] = samples - 1
    row[SETTING.late] = late
    row[len(SETTING) :] = reach
    return _judged(n)(row, log.view(np.float64).reshape(samples, -1))


@functools.cache
def _judged(n: int) -> Any:
    """Return a compiled function (row, samples) -> verdict, of samples (K + 1, n WIDTH)."""
    width = WIDTH * n
    take = taking(n, len(SETTING), 0, width)
    judge = judging(n, len(SETTING), width)
    size = width + metric_places(NAME, n)

    def verdict(row, samples):
        work = np.zeros(size)
        for k in range(len(samples)):
            for j in range(width):
                work[j] = samples[k, j]
            take(row, pointer(work.ctypes.data), k)
        return judge(row, work)

    return cached(verdict)
