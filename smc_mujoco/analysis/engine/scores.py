"""Metrics that a run sums up sample by sample, so that it needs no log.

Each is that of `metrics`; all but settling_time, rest_share and outcome are of the channels that
have an actuator. A metric is two compiled functions: one takes a sample into its numbers in `work`,
the other makes the score of them at the end.
"""

import math
from collections.abc import Callable
from typing import Any

from numba import njit

from smc_mujoco.analysis.engine.form import SCORES, Form, row_places, work_places
from smc_mujoco.metrics.conventions import SETTLING_BAND

# without wrappers for Python, which would take half the time to compile; and LLVM inlines all of
# them, so that no call is left in a step
OPTIONS: dict[str, Any] = {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "forceinline": True,
}
own = njit(error_model="numpy", **OPTIONS)
RESTING = ("settling_time", "rest_share")  # of a reference that does not move


def tallying(form: Form) -> Any:
    """Return a compiled function (row, work, scores, k): take sample k into all metrics, and give
    the scores after the last.
    """
    tally = own(lambda row, work, scores, k: None)
    for i, name in enumerate(form.metrics):
        tally = _and(tally, METRICS[name](form, work_places(form).at[f"metric {name}"]), i, form)
    return tally


def _and(others: Any, metric: tuple[Any, Any], i: int, form: Form) -> Any:
    take, score = metric
    SAMPLES = row_places(form).at["samples"]

    @own
    def tally(row, work, scores, k):
        take(row, work, k)
        if k == int(row[SAMPLES]):
            scores[SCORES + i] = score(row, work)
        others(row, work, scores, k)

    return tally


def _integral(kind: str) -> Callable:
    """Return an integral of the error by the trapezoid rule: ITAE, IAE or ISE."""
    weighted = kind == "itae"
    squared = kind == "ise"

    def made(form: Form, at: int) -> tuple[Any, Any]:
        n = form.driven
        X, R = work_places(form).of("sample_x", "r")
        PERIOD = row_places(form).at["period"]

        @own
        def take(row, work, k):
            now = 0.0
            for i in range(n):
                e = abs(work[X + i] - work[R + i])
                now += e * e if squared else e
            if weighted:
                now *= k * row[PERIOD]
            if k > 0:
                work[at] += 0.5 * (work[at + 1] + now) * row[PERIOD]
            work[at + 1] = now

        return take, own(lambda row, work: work[at])

    return made


def _largest(column: str, late: bool = False, error: bool = False, share: bool = False) -> Callable:
    """Return the largest |value| of a column, of the last part if `late`; minus r for an error;
    over the scale of its channel's group for a share.
    """

    def made(form: Form, at: int) -> tuple[Any, Any]:
        n = form.n if share else form.driven
        VALUE, R = work_places(form).of(column, "r")
        LATE, BANDS = row_places(form).of("late", "bands")

        @own
        def take(row, work, k):
            if not late or k >= row[LATE]:
                for i in range(n):
                    value = work[VALUE + i]
                    if error:
                        value -= work[R + i]
                    if share:
                        value /= row[BANDS + i]
                    work[at] = max(work[at], abs(value))

        return take, own(lambda row, work: SETTLING_BAND * work[at] if share else work[at])

    return made


def _variation(late: bool) -> Callable:
    """Return the total variation of u, worst channel; of the last part per second if `late`."""

    def made(form: Form, at: int) -> tuple[Any, Any]:
        n = form.driven
        U, LAST_U = work_places(form).of("u", "last_u")
        LATE, SAMPLES, PERIOD = row_places(form).of("late", "samples", "period")

        @own
        def take(row, work, k):
            if k > 0 and (not late or k > row[LATE]):
                for i in range(n):
                    work[at + i] += abs(work[U + i] - work[LAST_U + i])

        @own
        def score(row, work):
            largest = 0.0
            for i in range(n):
                largest = max(largest, work[at + i])
            if late and row[SAMPLES] > row[LATE]:
                largest /= (row[SAMPLES] - row[LATE]) * row[PERIOD]
            return largest

        return take, score

    return made


def _energy(form: Form, at: int) -> tuple[Any, Any]:
    n = form.driven
    U = work_places(form).at["u"]
    SAMPLES, PERIOD = row_places(form).of("samples", "period")

    @own
    def take(row, work, k):
        if k < row[SAMPLES]:
            for i in range(n):
                work[at] += work[U + i] * work[U + i] * row[PERIOD]

    return take, own(lambda row, work: work[at])


def _mean(squared: bool) -> Callable:
    """Return the root mean square of e after the transient, or |mean of e| in the last part, worst
    channel.
    """

    def made(form: Form, at: int) -> tuple[Any, Any]:
        n = form.driven
        X, R = work_places(form).of("sample_x", "r")
        SAMPLES = row_places(form).at["samples"]
        FIRST = row_places(form).at["early" if squared else "late"]

        @own
        def take(row, work, k):
            if k >= row[FIRST]:
                for i in range(n):
                    e = work[X + i] - work[R + i]
                    work[at + i] += e * e if squared else e

        @own
        def score(row, work):
            largest = 0.0
            for i in range(n):
                mean = work[at + i] / (row[SAMPLES] + 1.0 - row[FIRST])
                largest = max(largest, math.sqrt(mean) if squared else abs(mean))
            return largest

        return take, score

    return made


def _settling_time(form: Form, at: int) -> tuple[Any, Any]:
    n = form.n
    X, R = work_places(form).of("sample_x", "r")
    BANDS, SAMPLES, PERIOD = row_places(form).of("bands", "samples", "period")

    @own
    def take(row, work, k):
        for i in range(n):
            if abs(work[X + i] - work[R + i]) > row[BANDS + i]:
                work[at] = k + 1.0  # the first sample that may be within for good

    @own
    def score(row, work):
        if work[at] > row[SAMPLES]:
            return math.inf
        return work[at] * row[PERIOD]

    return take, score


METRICS: dict[str, Callable] = {
    "rest_share": _largest("sample_x", late=True, error=True, share=True),
    "itae": _integral("itae"),
    "iae": _integral("iae"),
    "ise": _integral("ise"),
    "tv": _variation(late=False),
    "tv_rate": _variation(late=True),
    "max_u": _largest("u"),
    "peak": _largest("sample_x"),
    "ultimate_bound": _largest("sample_x", late=True, error=True),
    "rms_error": _mean(squared=True),
    "steady_error": _mean(squared=False),
    "energy": _energy,
    "settling_time": _settling_time,
}
