"""Amplitude of chattering over the actuator's lag: predicted as lines, run as dots, one colour for
each label.

    amplitudes({"lag 1 ms": {"relay": trace, "super-twisting": other}, "lag 10 ms": {...}},
    "chattering.svg")

Each run is repeated, see `analysis.step_halving`. Where that changes its cycle by more than 5 %,
the dot is hollow.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from smc_mujoco.analysis.step_halving import step_halving
from smc_mujoco.chattering.prediction import predict
from smc_mujoco.common.aliases import AnyPath, Fields
from smc_mujoco.draw import colouring, style, wording
from smc_mujoco.draw import page as pages
from smc_mujoco.draw.panels import number_decades
from smc_mujoco.metrics.limit_cycle import channel_cycle
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

PAGE_HEIGHT = 4.6  # inches


def lag(scenario: Scenario) -> float:
    """Return the sum of all delays and time constants between command and force, s."""
    lags = []
    for chain in scenario.drive_train.chains:
        lags.append(sum(part.delay + part.lateness for part in chain if part.drives))
    return scenario.resolved.input_delay + max(lags)


def crossover(lags: Sequence[float], one: Sequence[float], other: Sequence[float]) -> float:
    """Return the lag, s, at which two amplitudes are equal, interpolated in logarithms; NaN where
    they do not cross.
    """
    columns = np.array([lags, one, other], float)
    table = np.log(columns)
    finite = np.isfinite(table).all(axis=0)
    log_lags, first, second = table[:, finite]
    ratios = first - second
    crossed = ratios[:-1] * ratios[1:] <= 0.0
    for k in np.flatnonzero(crossed):
        if ratios[k] != ratios[k + 1]:
            share = ratios[k] / (ratios[k] - ratios[k + 1])
            return math.exp(log_lags[k] + share * (log_lags[k + 1] - log_lags[k]))
    return math.nan


def mark_crossover(ax: Axes, equal: float) -> None:
    """Draw a line at the lag, ms, at which two laws chatter equally; none at NaN."""
    if math.isnan(equal):
        return
    dashes = (0, (4, 3))
    ax.axvline(equal, color=style.RULE, lw=style.points(1.0), ls=dashes)
    words = f"equal at {wording.short(equal)} ms"
    place = (equal, 0.0), (-4, 4), ("data", "axes fraction"), "offset points"
    ax.annotate(words, *place, ha="right", va="bottom")


def amplitudes(
    traces: Mapping[str, Mapping[str, Trace]],
    path: AnyPath | None = None,
    title: str = "Chattering",
) -> Figure:
    """Draw the amplitude of s of the first channel over the actuator's lag, predicted and run.

    `traces` are condition -> label -> Trace, each condition with another lag.
    """
    runs: dict[str, list[Trace]] = {}
    for by_label in traces.values():
        for label, trace in by_label.items():
            runs.setdefault(label, []).append(trace)
    laws = []
    sources = []
    for law_traces in runs.values():
        law_traces.sort(key=lambda trace: lag(trace.scenario))
        laws.append(law_traces[0].scenario.law)
        of_law = []
        for trace in law_traces:
            of_law.append(trace.scenario.law.source)
        sources.append(of_law)
    gains, shared = pages.gain_sources(sources)
    handles = []
    drawn = []
    with style.page():
        page = pages.blank(style.FULL_WIDTH, PAGE_HEIGHT)
        ax = page.subplots()
        ax.set(xscale="log", yscale="log")
        colours = colouring.law_colours(laws)
        rows = zip(runs.items(), colours, gains, strict=True)
        for (label, law_traces), colour, source in rows:
            over_lag = amplitudes_of(law_traces)
            drawn.append(over_lag)
            draw_law(ax, law_traces, over_lag, colour)
            words = f"{wording.label(label)}{source}"
            if not over_lag.cycles:
                words += ": no limit cycle"
            handles.append(pages.entry(words, colour))
        if len(drawn) == 2:
            first_law, second_law = drawn
            crossing = crossover(first_law.lags, first_law.predicted, second_law.predicted)
            mark_crossover(ax, crossing)
        dot = {"marker": "o", "lw": 0.0}
        sample = pages.entry("predicted", lw=style.points(1.5))
        handles.append(sample)
        handles.append(pages.entry("run", **dot))
        label = "run that differs when repeated"
        doubtful = pages.entry(label, style.PAPER, mec=style.MUTED, **dot)
        handles.append(doubtful)
        first = next(iter(runs.values()))[0]
        plant = first.scenario.plant
        ticks = set()
        for over_lag in drawn:
            ticks.update(over_lag.lags)
        set_axes(ax, sorted(ticks), f"{plant.unit}/s")
        pages.set_head(page, style.FULL_WIDTH, title, handles, shared)
        return pages.write_page(page, pages.files(path))


class OverLag(NamedTuple):
    """The amplitudes of a law's runs, by lag."""

    lags: list[float]  # ms
    predicted: list[float]  # of s, 0 or NaN without a limit cycle
    run: list[float]

    @property
    def cycles(self) -> bool:
        """Whether any limit cycle is predicted or run."""
        numbers = np.nan_to_num([*self.predicted, *self.run])
        return bool(numbers.any())


def amplitudes_of(traces: Sequence[Trace]) -> OverLag:
    """Return the amplitudes of s of the first channel of a law's runs."""
    lags = []
    sizes = []
    swings = []
    for trace in traces:
        lags.append(1e3 * lag(trace.scenario))
        cycle = predict(trace.scenario, ranges=False)
        sizes.append(cycle.amplitude)
        swings.append(channel_cycle(trace)[0])
    return OverLag(lags, sizes, swings)


def draw_law(ax: Axes, traces: Sequence[Trace], over_lag: OverLag, colour: str) -> None:
    """Draw a line through the predicted amplitudes, and a dot for each run."""
    ax.plot(over_lag.lags, over_lag.predicted, color=colour, lw=style.points(2.0))
    changes = step_halving(traces, 0)
    for lag_time, size, change in zip(over_lag.lags, over_lag.run, changes, strict=True):
        look: Fields = {"color": colour, "mec": style.PAPER}
        if change.marked:
            look = {"color": style.PAPER, "mec": colour}
        size_of_dot = style.points(7.0)
        ax.plot(lag_time, size, "o", ms=size_of_dot, **look)


def set_axes(ax: Axes, lags: Sequence[float], unit: str) -> None:
    """Label axes with ticks at the lags, ms, and at the decades of amplitude."""
    ax.set(xlabel="lag of the actuator (ms)", ylabel=f"amplitude of s ({unit})")
    ax.set_xticks(lags, [f"{tick:.3g}" for tick in lags])
    ax.set_xticks([], minor=True)
    ax.margins(0.04, 0.06)
    number_decades(ax.yaxis, (ax.dataLim.minposy, ax.dataLim.ymax))
