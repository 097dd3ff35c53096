"""Amplitude of chattering over the actuator's lag: predicted as lines, run as dots, one colour for
each label.

    amplitudes({"lag 1 ms": {"relay": trace, "super-twisting": other}, "lag 10 ms": {...}},
    "chattering.svg")

Each run is repeated at half its physics step, and from a nudged start. Where that changes its cycle
by more than 5 %, the dot is hollow.
"""

import itertools
import math
import os
from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from smc_mujoco.analysis.chattering import predict
from smc_mujoco.analysis.step_halving import step_halving
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.metrics.limit_cycle import channel_cycle
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

PAGE_HEIGHT = 4.6  # inches


def lag(scenario: Scenario) -> float:
    """Return the sum of all delays and time constants between command and force, s."""
    return scenario.resolved.input_delay + sum(
        part.delay for part in scenario.actuator if part.drives
    )


def crossover(lags: Sequence[float], one: Sequence[float], other: Sequence[float]) -> float:
    """Return the lag, s, at which two amplitudes are equal, interpolated in logarithms; NaN where
    they do not cross.
    """
    known = []
    for i, pair in enumerate(zip(one, other, strict=True)):
        if all(value > 0.0 for value in pair):
            known.append(i)
    ratios = [math.log(one[i] / other[i]) for i in known]
    for k, (low, high) in enumerate(itertools.pairwise(ratios)):
        if low * high <= 0.0 and low != high:
            start, end = (math.log(lags[known[i]]) for i in (k, k + 1))
            return math.exp(start + (end - start) * low / (low - high))
    return math.nan


def amplitudes(
    traces: Mapping[str, Mapping[str, Trace]],
    path: str | os.PathLike[str] | None = None,
    title: str = "Chattering",
) -> Figure | SubFigure:
    """Draw the amplitude of s of the first channel over the actuator's lag, predicted and run.

    `traces` are condition -> label -> Trace, each condition with another lag.
    """
    runs: dict[str, list[Trace]] = {}
    for label, trace in (pair for by_label in traces.values() for pair in by_label.items()):
        runs.setdefault(label, []).append(trace)
    with style.page():
        page = pages.blank(style.FULL_WIDTH, PAGE_HEIGHT)
        ax = page.subplots()
        colours = style.law_colours([its[0].scenario.law for its in runs.values()])
        handles = []
        predicted = {}
        hollow = False
        gains, shared = pages.gain_sources(
            [[trace.scenario.law.source for trace in its] for its in runs.values()]
        )
        for (label, its), colour, source in zip(runs.items(), colours, gains, strict=True):
            its.sort(key=lambda trace: lag(trace.scenario))
            lags = [1e3 * lag(trace.scenario) for trace in its]
            predicted[label] = (
                lags,
                [predict(trace.scenario, ranges=False).amplitude for trace in its],
            )
            ax.plot(*predicted[label], color=colour, lw=style.points(2.0))
            for at, trace, change in zip(lags, its, step_halving(its, 0), strict=True):
                if change.marked:
                    face = style.PAPER
                    edge = colour
                else:
                    face = colour
                    edge = style.PAPER
                ax.plot(
                    at, channel_cycle(trace)[0], "o", color=face, ms=style.points(7.0), mec=edge
                )
                hollow |= change.marked
            handles.append(
                Line2D(
                    [],
                    [],
                    color=colour,
                    lw=style.points(3.0),
                    label=f"{style.label(label)}{source}",
                )
            )
        if len(predicted) == 2:
            (lags, one), (_, other) = predicted.values()
            if not math.isnan(equal := crossover(lags, one, other)):
                place = {
                    "xytext": (-4, 4),
                    "textcoords": "offset points",
                    "ha": "right",
                    "va": "bottom",
                }
                ax.axvline(equal, color=style.RULE, lw=style.points(1.0), ls=(0, (4, 3)))
                ax.annotate(
                    f"equal at {style.short(equal)} ms",
                    (equal, 0.0),
                    xycoords=("data", "axes fraction"),
                    **place,
                )
        handles.append(Line2D([], [], color=style.MUTED, label="predicted"))
        handles.append(Line2D([], [], color=style.MUTED, marker="o", lw=0, label="run"))
        if hollow:
            label = "run that half the step or a nudged start changes"
            handles.append(
                Line2D([], [], color=style.PAPER, mec=style.MUTED, marker="o", lw=0, label=label)
            )
        unit = next(iter(runs.values()))[0].scenario.plant.unit
        ax.set(
            xscale="log",
            yscale="log",
            xlabel="lag of the actuator (ms)",
            ylabel=f"amplitude of s ({unit}/s)",
        )
        ax.xaxis.set_major_formatter("{x:g}")
        ax.margins(0.04, 0.06)
        pages.set_head(page, style.FULL_WIDTH, title, handles, shared)
        pages.write(page, pages.files(path))
    return page
