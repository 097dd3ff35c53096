"""Metrics that a run sums up sample by sample, so that it needs no log.

Those of the catalogue that are folds are made here of their rows; a few more are written out. A
metric is two compiled functions: one takes a sample into its numbers in `work`, the other makes the
score of them at the end. Those with a unit of x or u are of the channels that have an actuator.

The limit cycle of s has a spectrum, which needs a log of its run: see `cycles`.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.analysis.engine.form import (
    LOGGED,
    SCORES,
    SETTING,
    WIDTH,
    Form,
    Places,
    layout,
    metric_places,
)
from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.common.jit import always, inlined, record_in
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.metrics.conventions import SETTLING_BAND
from smc_mujoco.metrics.fold import Fold, after_turn, first_sample, slipped
from smc_mujoco.metrics.limit_cycle import largest_of
from smc_mujoco.simulation.cfunctions import cached
from smc_mujoco.simulation.state import LOG

log_in = record_in(LOG)
slips_now = inlined(slipped)
counts_after_turn = inlined(after_turn)
COLUMN = {name: i for i, name in enumerate(LOG.names or ())}  # places in a sample
RESTING = ("settling_time", "rest_share")  # of a reference that does not move
MADE = "e", "rest", "turned"  # signals that are made of columns
HOLDING = "held", "slips"  # those of friction that is exact, see `Scenario.exact_friction`
CYCLE = "chattering_amplitude", "chattering_frequency"  # of a log, which only the processor writes


class Samples(NamedTuple):
    """Where a metric finds the sample that it takes, and the one before."""

    n: int  # channels that it is of
    now: int
    before: int
    shares: int = 0  # in the row: 2 % of the scale of each channel's group


def summed_up(name: str) -> bool:
    """Return whether the engine has a metric of this name."""
    return name in WRITTEN_OUT or _fold(name) is not None


def engine_metrics() -> list[str]:
    """Return the names of all metrics that the engine has."""
    return [*WRITTEN_OUT, *filter(_fold, CATALOGUE)]


def _fold(name: str) -> Fold | None:
    """Return the row of a metric that is of a signal that the engine has: what dampers exert is
    added to the reactions of a trace when its run is over.
    """
    entry = CATALOGUE.get(name)
    if entry is None or entry.fold is None:
        return None
    sums = entry.fold.signal in (*MADE, *HOLDING, *LOGGED)
    return entry.fold if sums else None


def holds(name: str) -> bool:
    """Return whether a metric needs to know when friction held a joint."""
    fold = _fold(name)
    return fold is not None and fold.signal in HOLDING


def tallying(form: Form) -> Any:
    """Return a compiled function (row, work, scores, k, ends): take sample k into all metrics, and
    give the scores if the run `ends` with it.
    """
    work_at = layout(form).work
    metrics = []
    for name, first in zip(form.metrics, layout(form).metrics, strict=True):
        if fold := _fold(name):
            n = form.n if CATALOGUE[name].shared else form.driven
            samples = Samples(n, work_at.now, work_at.before, layout(form).row.shares)
            metrics.append(folding(fold, samples, first))
        elif name in CYCLE:
            metrics.append((always(None), always(math.nan)))
        else:
            metrics.append(WRITTEN_OUT[name](form, first))
    return _together(metrics)


def cycles(log: Array, late: int, period: float) -> Pair:
    """Return amplitude and frequency of the largest limit cycle of s from sample `late` on, as
    metrics have it. The log is (K + 1, channels, LOGGED), of the channels that have an actuator.
    """
    s = log[late:, :, LOGGED.index("s")]
    return largest_of(period * np.arange(len(s)), s)


def _together(metrics: Sequence[tuple[Any, Any]]) -> Any:
    tally = always(None)
    for i, metric in enumerate(metrics):
        tally = _and(tally, metric, i)
    return tally


def _and(others: Any, metric: tuple[Any, Any], i: int) -> Any:
    take, score = metric

    @inlined
    def tally(row, work, scores, k, ends):
        take(row, work, k)
        if ends:
            scores[SCORES + i] = score(row, work)
        others(row, work, scores, k, ends)

    return tally


def folding(fold: Fold, samples: Samples, at: int) -> tuple[Any, Any]:
    """Return a fold's two functions, take(row, work, k) and score(row, work). Its numbers are in
    `work` from place `at` on.
    """
    values = _valuing(fold, samples, at)
    if fold.reduction in ("integral", "held"):
        return _pooling(fold, samples.n, values, at)
    return _worst(fold, samples.n, values, at)


def _valuing(fold: Fold, samples: Samples, at: int) -> Any:
    """Return a function (row, work, k, i) -> what a fold takes of sample k of channel i."""
    if fold.signal == "slips":
        return _slipping(samples)
    if fold.signal == "turned":
        return _turning(samples, at)
    if fold.signal == "rest":
        return _resting(samples)
    power = fold.power
    change = fold.change
    of_error = fold.signal == "e"
    column = COLUMN["x" if of_error else fold.signal]
    r = COLUMN["r"]
    now, before = samples.now, samples.before

    @inlined
    def value(row, work, k, i):
        sample = now + WIDTH * i
        y = work[sample + column]
        if of_error:
            y -= work[sample + r]
        if change:
            last = before + WIDTH * i
            y -= work[last + column]
            if of_error:
                y += work[last + r]
        if power == 0:
            return y
        return abs(y) if power == 1 else y * y

    return value


def _slipping(samples: Samples) -> Any:
    """Return a function (row, work, k, i) -> 1 if friction let channel i go by sample k, else 0."""
    now, before = samples.now, samples.before

    @inlined
    def slips(row, work, k, i):
        was = log_in(work, before + WIDTH * i).held
        return 1.0 if slips_now(was, log_in(work, now + WIDTH * i).held) else 0.0

    return slips


def _resting(samples: Samples) -> Any:
    """Return a function (row, work, k, i) -> |e| of channel i over the scale of its group."""
    now, shares = samples.now, samples.shares

    @inlined
    def share(row, work, k, i):
        sample = log_in(work, now + WIDTH * i)
        return SETTLING_BAND * abs((sample.x - sample.r) / row[shares + i])

    return share


def _turning(samples: Samples, at: int) -> Any:
    """Return a function (row, work, k, i) -> |e| of channel i where its reference turned back a
    short time before sample k, else 0. It keeps the direction, and the sample of the last turn,
    behind the numbers of the fold.
    """
    n, now, before, _ = samples
    direction = at + 2 * n
    last = direction + n

    @inlined
    def error(row, work, k, i):
        sample = log_in(work, now + WIDTH * i)
        step = sample.r - log_in(work, before + WIDTH * i).r if k > 0 else 0.0
        if step != 0.0:
            side = math.copysign(1.0, step)
            if side * work[direction + i] < 0.0:
                work[last + i] = k  # the turn's sample, counted from 1
            work[direction + i] = side
        turn = work[last + i]
        if turn > 0.0 and counts_after_turn((k - turn + 1.0) * row[SETTING.period]):
            return abs(sample.x - sample.r)
        return 0.0

    return error


def _first(fold: Fold) -> Any:
    """Return a function (row) -> the first sample of a fold's part."""
    if not fold.part:
        return always(0.0)
    first = SETTING.late if fold.part == "late" else SETTING.early
    return inlined(lambda row: row[first])


def _worst(fold: Fold, n: int, value: Any, at: int) -> tuple[Any, Any]:
    """Return the functions of a fold of the worst channel."""
    first = _first(fold)
    change = fold.change
    turned = fold.signal == "turned"
    largest = fold.reduction == "largest"
    ranges = fold.reduction == "range"
    mean = fold.reduction == "mean"
    root = mean and fold.power == 2
    rate = fold.rate

    @inlined
    def take(row, work, k):
        begins = k == first(row)
        if k < first(row) or (change and begins):
            for i in range(n if turned else 0):
                value(row, work, k, i)  # which keeps the turns of the reference
            return
        for i in range(n):
            y = value(row, work, k, i)
            if largest:
                work[at + i] = max(work[at + i], y)
            elif ranges:
                work[at + i] = y if begins else max(work[at + i], y)
                work[at + n + i] = y if begins else min(work[at + n + i], y)
            else:
                work[at + i] += y

    @inlined
    def score(row, work):
        steps = row[SETTING.samples] - first(row)
        worst = 0.0
        for i in range(n):
            total = work[at + i]
            if ranges:
                total -= work[at + n + i]
            if mean:
                total /= steps + 1.0
                total = math.sqrt(total) if root else abs(total)
            worst = max(worst, total)
        if rate and steps > 0.0:
            worst /= steps * row[SETTING.period]
        return worst

    return take, score


def _pooling(fold: Fold, n: int, value: Any, at: int) -> tuple[Any, Any]:
    """Return the functions of a fold that is summed over the channels."""
    first = _first(fold)
    held = fold.reduction == "held"
    timed = fold.timed

    @inlined
    def take(row, work, k):
        if k < first(row) or (held and k >= row[SETTING.samples]):
            return
        period = row[SETTING.period]
        now = 0.0
        for i in range(n):
            if held:
                work[at] += value(row, work, k, i) * period
            else:
                now += value(row, work, k, i)
        if timed:
            now *= (k - first(row)) * period
        if not held:
            if k > first(row):
                work[at] += 0.5 * (work[at + 1] + now) * period
            work[at + 1] = now

    return take, inlined(lambda row, work: work[at])


def over_log(folds: Sequence[Fold], log: np.ndarray, n: int, period: float) -> list[float]:
    """Return the values of folds of a run's log, (K + 1, channels) LOG, of which the first n count,
    as the engine sums them up: terms in their order, so that the last bit is the same on every
    machine.
    """
    t = period * np.arange(len(log))
    row = np.zeros(len(SETTING))
    row[SETTING.samples] = len(log) - 1
    row[SETTING.period] = period
    row[SETTING.early] = first_sample("early", t)
    row[SETTING.late] = first_sample("late", t)
    scores = np.zeros(SCORES + len(folds))
    numbers = np.ascontiguousarray(log).view(np.float64)
    samples = numbers.reshape(len(log), -1)
    _over_samples(tuple(folds), n)(row, samples, scores)
    return scores[SCORES:].tolist()


@functools.cache
def _over_samples(folds: tuple[Fold, ...], n: int) -> Any:
    """Return a compiled function (row, samples, scores): the folds of samples, (K + 1, n WIDTH or
    more).
    """
    places = Places()
    width = WIDTH * n
    now = places.take(width)
    before = places.take(width)
    metrics = []
    for fold in folds:
        metrics.append(folding(fold, Samples(n, now, before), places.take(metric_places("", n))))
    tally = _together(metrics)
    size = places.size

    def scored(row, samples, scores):
        work = np.zeros(size)
        for k in range(len(samples)):
            for j in range(width):
                work[before + j] = work[now + j]
                work[now + j] = samples[k, j]
            tally(row, work, scores, k, k == len(samples) - 1)

    return cached(scored)


def _settling_time(form: Form, at: int) -> tuple[Any, Any]:
    n = form.n
    row_at, work_at = layout(form)[:2]

    @inlined
    def take(row, work, k):
        for i in range(n):
            now = log_in(work, work_at.now + WIDTH * i)
            if abs(now.x - now.r) > row[row_at.bands + i]:
                work[at] = k + 1.0  # the first sample that may be within for good

    @inlined
    def score(row, work):
        if work[at] > row[SETTING.samples]:
            return math.inf
        return work[at] * row[SETTING.period]

    return take, score


# name -> function (form, place) -> its two functions, of metrics that are no folds
WRITTEN_OUT: dict[str, Callable] = {"settling_time": _settling_time}
