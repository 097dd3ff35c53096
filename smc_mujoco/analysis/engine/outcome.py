"""Whether a run comes to rest, by the rule of `region_of_attraction`, taken sample by sample.

One rule serves the loop, where it is a metric, and traces of MuJoCo.
"""

import functools
from typing import Any

import numpy as np

from smc_mujoco.analysis.engine import CONVERGES, DOES_NOT, UNDECIDED
from smc_mujoco.analysis.engine.form import Form, Places, metric_places, row_places, work_places
from smc_mujoco.analysis.engine.scores import METRICS, own
from smc_mujoco.metrics.conventions import SETTLING_BAND
from smc_mujoco.simulation.cfunctions import cached

REST_TOLERANCE = 1e-6  # of X, V and u_max: a run that changes less is at rest
# of the squared distance (e/X)^2 + (v/V)^2, second half over first
MAX_FINAL_RATIO, MAX_EARLY_RATIO = 1.05, 0.9
NEAR_SQUARE = (0.1 * SETTLING_BAND) ** 2  # squared distance
PARTS = 5  # of the run, in which a run that approaches comes closer
NAME = "outcome"
SIGNALS = 3  # x, v and u, whose ranges tell rest


def kept_at(n: int, first: int) -> tuple[int, ...]:
    """Return where a run of n channels keeps each value in its row of work, from index `first` on.

    In order: the squared distance at the start; whether a late sample is in the band, and out of
    it; the largest squares of both late halves; the largest |u|. Then the first index of the
    largest squares of PARTS, of the smallest and of the largest values of the late signals.
    """
    ends = first + 6 + PARTS
    return (*range(first, first + 7), ends, ends + SIGNALS * n)


def taking(n: int, row_at: Places, work_at: Places, first: int) -> Any:
    """Return a compiled function (row, work, k): take sample k of n channels."""
    SAMPLES, LATE, REACH = row_at.of("samples", "late", "reach")
    X, V, U, R = work_at.of("sample_x", "sample_v", "u", "r")
    START, INSIDE, OUTSIDE, FIRST, SECOND, LARGEST_U, LARGEST, LOW, HIGH = kept_at(n, first)

    @own
    def take(row, work, k):
        count = int(row[SAMPLES]) + 1
        late = int(row[LATE])
        square = 0.0
        distance = 0.0
        for i in range(n):
            e = (work[X + i] - work[R + i]) / row[REACH]
            v = work[V + i] / row[REACH + 1]
            square += e * e + v * v
            distance = max(distance, abs(e), abs(v))
            work[LARGEST_U] = max(work[LARGEST_U], abs(work[U + i]))
            for j, value in enumerate((work[X + i], work[V + i], work[U + i])):
                at = SIGNALS * i + j
                if k == late:
                    work[LOW + at] = value
                    work[HIGH + at] = value
                work[LOW + at] = min(work[LOW + at], value)
                work[HIGH + at] = max(work[HIGH + at], value)
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


def judging(n: int, row_at: Places, first: int) -> Any:
    """Return a compiled function (row, work) -> verdict; UNDECIDED also where a run needs to be
    longer.
    """
    REACH = row_at.at["reach"]
    START, INSIDE, OUTSIDE, FIRST, SECOND, LARGEST_U, LARGEST, LOW, HIGH = kept_at(n, first)

    @own
    def judge(row, work):
        final = row[REACH + 3] != 0.0
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
        bound = row[REACH + 2]
        if bound == np.inf:
            bound = work[LARGEST_U]
        for i in range(SIGNALS * n):
            reach = bound
            if i % SIGNALS < 2:
                reach = row[REACH + i % SIGNALS]
            if work[HIGH + i] - work[LOW + i] > REST_TOLERANCE * reach:
                return UNDECIDED
        return DOES_NOT

    return judge


def outcome(form: Form, at: int) -> tuple[Any, Any]:
    """Return the verdict as a metric of the loop."""
    row_at = row_places(form)
    return taking(form.n, row_at, work_places(form), at), judging(form.n, row_at, at)


METRICS[NAME] = outcome


@functools.cache
def over_samples(n: int) -> Any:
    """Return a function (row, samples) -> verdict, on x, v, u and r of n channels, (K + 1, 4n).

    `row` has K, the first sample that counts, and the reach.
    """
    row_at = Places()
    work_at = Places()
    for name in ("samples", "late", "reach"):
        row_at.take(name)
    for name in ("sample_x", "sample_v", "u", "r"):
        work_at.take(name, n)
    first = work_at.size
    take = taking(n, row_at, work_at, first)
    judge = judging(n, row_at, first)
    size = first + metric_places(NAME, n)

    def verdict(row, samples):
        work = np.zeros(size)
        for k in range(len(samples)):
            for i in range(first):
                work[i] = samples[k, i]
            take(row, work, k)
        return judge(row, work)

    return cached(verdict)
