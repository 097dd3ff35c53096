"""Metrics: numbers that say how well a run went, each a function Trace -> float.

Conventions (groups, e, scale, settling band, last part, approach, worst channel or sum) and letters
are those of `conventions`. A metric is one decorated function here; `score` and all tables then
include it. If it takes one sample after the other, its row in `@folded` says all of it, and the
fast engine sums it up as well. Every metric refuses a trace that diverged or has a NaN
(ScenarioError). inf means "never".
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from smc_mujoco.common.errors import ScenarioError, find, unknown
from smc_mujoco.metrics import conventions, limit_cycle
from smc_mujoco.metrics.conventions import (
    ARRIVAL_BAND,
    ARRIVAL_COUNTS,
    CATALOGUE,
    SETTLING_BAND,
    UNIT_OF_S,
    Metric,
    approaches,
    error,
    folded,
    last_exit,
    last_part,
    metric,
    refuse,
    resolution,
    scale,
    travels,
)
from smc_mujoco.metrics.fold import Fold

if TYPE_CHECKING:
    from smc_mujoco.mechanisms.plant import Plant
    from smc_mujoco.simulation.scenario import Scenario
    from smc_mujoco.simulation.trace import Trace

# rows that tuning and problems read, too
ITAE = Fold("e", "integral", timed=True)
TV = Fold("u", "sum", change=True)
RISE_LEVELS = (0.1, 0.9)  # shares of the way from the start of an approach to the reference
# Hz, chosen: above the bandwidth of plants and laws, below the chattering at 1 kHz sampling
HIGH_FREQUENCY = 50.0
ROUNDING_SHARE = 1e-12  # of max |u|, and of a frequency: smaller differences are rounding


def metrics() -> tuple[Metric, ...]:
    """Return every metric, in the order of tables."""
    return tuple(CATALOGUE.values())


def metric_of(machine: Plant | Scenario, name: object) -> Metric:
    """Return the metric of a name. Raise ScenarioError if there is none, or if it has no single
    value for the plant, or for the scenario.
    """
    chosen = find("metric", name, CATALOGUE)
    if why := chosen.refusal(machine):
        raise ScenarioError(why)
    return chosen


class UnknownMetric(ScenarioError, KeyError):
    """An error: a trace has no metric of this name."""

    __str__ = ScenarioError.__str__


class MetricValues(dict[str, float]):
    """Metrics of a trace by name."""

    def __missing__(self, name: object) -> float:
        raise UnknownMetric(str(unknown("metric", name, self)))


def score(trace: Trace) -> dict[str, float]:
    """Return name -> value of every metric that has a single value for the plant.

    Metrics that compare channels are for networks only. For a cart with a pole, times and
    percentages of the motion are the worse of the two; metrics with a unit of length are the
    cart's.

    Raises:
      ScenarioError: the run diverged, failed or holds NaN.
    """
    refuse(trace)
    traces = conventions.by_group(trace)
    values = MetricValues()
    for m in metrics():
        if not m.refusal(trace.scenario):
            values[m.name] = m.worst(traces)
    return values


def scores(trace: Trace) -> dict[str, dict[str, float]]:
    """Return the metrics of each group of channels by itself: {"driven": {...}, "free": {...}} for
    a cart with a pole.

        trace = smc.run(smc.Scenario(plant="cart_pole", law="hierarchical", duration=1.0))
        print(smc.scores(trace)["free"]["peak"])

    Joints without an actuator are free. If channels of a kind have several units, each unit is a
    group, such as "driven m". Raises like `score`.

    Returns:
      Group -> metric -> value.
    """
    refuse(trace)
    by_group = {}
    for group, part in conventions.by_group(trace).items():
        by_group[group.name] = group_scores(group, part)
    return by_group


def group_scores(group: conventions.ChannelGroup, part: Trace) -> dict[str, float]:
    """Return name -> value of the metrics that apply to a group, from the trace of its channels."""
    values = {}
    for m in metrics():
        if m.applies_to(group):
            values[m.name] = float(m.formula(part))
    return values


def arrived(trace: Trace) -> bool:
    """Return whether a run has arrived, see `conventions`; False if it diverged or failed."""
    if trace.failure is not None or trace.diverged_at is not None or conventions.leans(trace):
        return False
    for group, part in conventions.by_group(trace).items():
        off = error(part)
        largest = scale(part)
        if travels(part):
            speed = np.gradient(part.r, part.t, axis=0)
            off = part.v - speed
            largest = np.abs(speed).max()
        band = max(ARRIVAL_BAND * largest, ARRIVAL_COUNTS * resolution(trace.scenario, group))
        # NaN, too, has not arrived
        if not np.abs(off[last_part(part)]).max() <= band:
            return False
    return True


def trends(trace: Trace) -> dict[str, float]:
    """Return name -> rho of the metrics of the last part: their value over that of the run without
    its last part.

    A run in which such a metric falls has not yet reached its end. Metrics that are 0 in either
    part are left out.

    Raises:
      ScenarioError: the run diverged, failed or holds NaN.
    """
    refuse(trace)
    count = last_part(trace).start + 1
    begun = {}
    for name, array in trace.arrays().items():
        begun[name] = array[:count]
    earlier = conventions.by_group(dataclasses.replace(trace, **begun))
    groups_of_run = conventions.by_group(trace)
    ratios = {}
    for m in metrics():
        if m.late and not m.refusal(trace.scenario):
            now = m.worst(groups_of_run)
            before = m.worst(earlier)
            if now > 0.0 and before > 0.0:
                ratios[m.name] = now / before
    return ratios


def _band(trace: Trace) -> float:
    return conventions.settling_band(trace.scenario, scale(trace))


@metric("s", need="fast", error=True)
def settling_time(trace: Trace) -> float:
    """Time from which every channel stays in the settling band.

    Last exit of max_i |e_i| from 2 % of the scale, or from 5 standard deviations of the noise if
    the run starts within 15. The time counts from t[0], even if r steps later. NaN where the
    reference travels, as in a speed loop: no time is known for that.
    """
    if travels(trace):
        return np.nan
    if conventions.leans(trace):
        return np.inf
    return last_exit(trace.t, conventions.row_max(np.abs(error(trace))), _band(trace))


@metric("s")
def rise_time(trace: Trace) -> float:
    """Time from 10 % to 90 % of the way to the reference, slowest channel.

    It is taken on a channel's first approach whose e at the start, e_b, is not 0: the time from the
    first sample with 1 - e/e_b >= 0.1 to the first with >= 0.9 (Ogata, Modern Control Engineering,
    transient response), inf if there is none. A channel without such an approach is left out; 0 if
    all are.
    """
    e = error(trace)
    t = trace.t
    times = [0.0]
    for i, parts in enumerate(approaches(trace)):
        part = next((p for p in parts if e[p.start, i] != 0), None)
        if part is not None:
            done = 1 - e[part, i] / e[part.start, i]
            low, high = RISE_LEVELS
            if np.any(done >= high):
                begun = t[part][np.argmax(done >= low)]
                times.append(float(t[part][np.argmax(done >= high)] - begun))
            else:
                times.append(np.inf)
    return max(times)


@metric("%", need="no-overshoot")
def overshoot(trace: Trace) -> float:
    """How far a channel goes beyond its reference, in percent of the scale.

    Maximum of 100 max(0, -sign(e_b) e) / scale over all channels and approaches, with e_b the e at
    the approach's start: only the far side of the reference counts. If e_b = 0, both sides count:
    100 |e| / scale.
    """
    e = error(trace)
    worst = 0.0
    for i, parts in enumerate(approaches(trace)):
        for part in parts:
            side = np.sign(e[part.start, i])
            if side:
                beyond = -side * e[part, i]
            else:
                beyond = np.abs(e[part, i])
            worst = max(worst, beyond.max())
    return 100 * worst / scale(trace)


@folded("{x}", Fold("x", "largest"))
def peak(trace: Trace) -> float:
    """Largest |x| of the run (x, not e)."""
    ...


@folded("{x}", Fold("e", "mean", power=0, part="late"))
def steady_error(trace: Trace) -> float:
    """|mean of e over the samples of the last part|, worst channel."""
    ...


@folded("{x}", Fold("e", "largest", part="late"), label="final error", need="accurate", error=True)
def ultimate_bound(trace: Trace) -> float:
    """Largest |e| in the last part, worst channel."""
    ...


@folded("", Fold("rest", "largest", part="late"), error=True)
def rest_share(trace: Trace) -> float:
    """Ultimate bound over the scale."""
    ...


@folded("{x}", Fold("e", "range", power=0, part="late"))
def ripple(trace: Trace) -> float:
    """Peak-to-peak e in the last part, worst channel; what is left of a transient counts."""
    ...


@folded("{x}", Fold("e", "mean", power=2, part="early"), label="rms error", error=True)
def rms_error(trace: Trace) -> float:
    """Root mean square of e from a quarter of the run on, worst channel.

    Samples t >= t0 + 0.25 (tK - t0) have equal weights. `worst_case` maximises it, because its
    square is smooth.
    """
    ...


@folded("({x})^2 s", Fold("e", "integral", power=2), label="ISE", error=True)
def ise(trace: Trace) -> float:
    """Integral of e^2 dt, summed over the channels (trapezoid)."""
    ...


@folded("{x} s", Fold("e", "integral"), label="IAE", error=True)
def iae(trace: Trace) -> float:
    """Integral of |e| dt, summed over the channels (trapezoid)."""
    ...


@folded("{x} s^2", ITAE, label="ITAE", need="on-track", error=True)
def itae(trace: Trace) -> float:
    """Integral of (t - t0) |e| dt, summed over the channels (trapezoid)."""
    ...


@metric("s", command=True)
def reaching_time(trace: Trace) -> float:
    """Time from which |s| stays within 2 % of its start.

    Last exit of max_i |s_i| from 2 % of max_i |s_i(0)|: permanent entry, not first touch. A run
    that starts on the surface, s(0) = 0, is measured against the largest |s| of the run. 0 if s = 0
    throughout, as for a law without a surface. s is what the law computed from its measurement:
    under noise it may never stay.
    """
    magnitude = conventions.row_max(np.abs(trace.s))
    return last_exit(trace.t, magnitude, SETTLING_BAND * (magnitude[0] or magnitude.max()))


@folded("{u}", Fold("u", "largest"), label="max |u|", need="gentle")
def max_u(trace: Trace) -> float:
    """Largest |u|, worst channel."""
    ...


@folded("{u}", Fold("u", "largest", change=True))
def max_step(trace: Trace) -> float:
    """Largest |u[k+1] - u[k]|, worst channel; 0 for a single sample."""
    ...


@folded("{u}", TV, label="TV")
def tv(trace: Trace) -> float:
    """Total variation of u: sum of |u[k+1] - u[k]| over the run, worst channel."""
    ...


@folded(
    "{u}/s",
    Fold("u", "sum", part="late", change=True, rate=True),
    label="variation of u",
    need="calm",
)
def tv_rate(trace: Trace) -> float:
    """Total variation of u per second in the last part, worst channel.

    Sum of |u[k+1] - u[k]| between samples of the last part, divided by the time from its first to
    its last sample; 0 for a single sample.
    """
    ...


@folded("({u})^2 s", Fold("u", "held", power=2), need="frugal")
def energy(trace: Trace) -> float:
    """Integral of u^2 dt, summed over the channels.

    Sum of u[k]^2 (t[k+1] - t[k]), k < K: exact for the held command. Control effort, not mechanical
    work.
    """
    ...


@metric("", command=True)
def hf_share(trace: Trace) -> float:
    """Share of the variance of u above 50 Hz, 0 to 1.

    U is the discrete Fourier transform of u[0..K-1], without a window. The share is the sum of
    |U(f)|^2 at |f| > 50 Hz divided by the sum at all f except 0 (by Parseval, K^2 times the
    variance). Powers are pooled over the channels, so that a channel at rest does not count. 0 if u
    is constant, and if half the sampling rate is 50 Hz or less.
    """
    u = trace.u[:-1]
    t = trace.t
    rounding = ROUNDING_SHARE * np.abs(u).max(initial=0.0)
    if u.size == 0 or np.ptp(u, axis=0).max() <= rounding:
        return 0.0
    k = len(u)
    spectrum = np.abs(np.fft.rfft(u, axis=0))
    power = (spectrum**2).sum(axis=1)
    power[1 : (k + 1) // 2] *= 2  # f > 0 stands for -f as well, except at half the sampling rate
    frequency = np.arange(power.size) / (t[-1] - t[0])
    return power[frequency > HIGH_FREQUENCY * (1 + ROUNDING_SHARE)].sum() / power[1:].sum()


@metric(UNIT_OF_S, command=True, absent=0.0)
def chattering_amplitude(trace: Trace) -> float:
    """Amplitude of the limit cycle of s in the last part, worst channel; NaN without one.

    Half the range of s within a period, without slow waves. `limit_cycle` says what counts as a
    limit cycle. Laws without one are compared with the value 0.
    """
    return limit_cycle.largest_cycle(trace)[0]


@metric("Hz", command=True)
def chattering_frequency(trace: Trace) -> float:
    """Frequency of the limit cycle of s in the last part, channel of the largest; NaN without one.

    A limit cycle has at least five periods in the last part.
    """
    return limit_cycle.largest_cycle(trace)[1]


@folded("s", Fold("held", "sum"), realistic=True)
def stick_time(trace: Trace) -> float:
    """Time for which a channel is at rest, with a reaction of friction or contact; longest channel.

    Where dry friction ran by its moments, it is the time for which it held the joint, also within a
    control period. With LuGre friction it is the time for which bristles bend and do not slide.
    """
    ...


@folded("1/s", Fold("slips", "sum", part="late", rate=True), realistic=True)
def slip_rate(trace: Trace) -> float:
    """How many times a second a joint breaks away from friction in the last part, worst channel.

    A joint that hunts sticks and slips again and again. A joint that never sticks has no slips.
    """
    ...


@folded("{x}", Fold("turned", "largest", part="early"), realistic=True)
def reversal_error(trace: Trace) -> float:
    """Largest |e| in the 0.15 s after the reference turns back, worst channel.

    Dry friction changes its sign there. It counts from a quarter of the run on; 0 where the
    reference does not turn.
    """
    ...


@folded("{force}", Fold("reaction", "largest"), realistic=True)
def peak_reaction(trace: Trace) -> float:
    """Largest force of friction, contacts, stops and backlash on a joint at a sample."""
    ...


@metric("1/s", realistic=True)
def reversal_rate(trace: Trace) -> float:
    """How often e turns back a second in the last part, worst channel.

    It is twice the frequency of a limit cycle. Only swings of at least half the ripple count; 0 for
    a ripple up to 1e-6 of the scale. A cycle longer than the last part is not seen.
    """
    part = last_part(trace)
    threshold = 1e-6 * scale(trace)
    counts = []
    for e in error(trace)[part].T:
        counts.append(conventions.turns(e, threshold))
    return max(counts) / (np.ptp(trace.t[part]) or np.inf)


@metric("s", network=True)
def mean_settling_time(trace: Trace) -> float:
    """Time from which |mean of e over the channels| stays in the settling band."""
    return last_exit(trace.t, np.abs(error(trace).mean(axis=1)), _band(trace))


@metric("s", network=True)
def spread_settling_time(trace: Trace) -> float:
    """Time from which max_i x_i - min_i x_i stays within 2 % of the scale."""
    return last_exit(trace.t, np.ptp(trace.x, axis=1), _band(trace))


@metric("{x}", network=True, late=True)
def spread_bound(trace: Trace) -> float:
    """Largest max_i x_i - min_i x_i in the last part."""
    return np.ptp(trace.x[last_part(trace)], axis=1).max()
