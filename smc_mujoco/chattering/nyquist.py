"""Predicted chattering beside a run:

L and 1/N in the complex plane with their crossing, and s with the amplitude.

L is the answer of the linearised mechanism to u, 1/N the inverse of the law's describing function
at the frequency of the crossing. Both are divided by their common value there, and turned: they
cross at -1. One row for each scenario; s is that of the last periods of a run, or of the whole run
where no limit cycle is predicted.
"""

import math
import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from smc_mujoco.analysis.step_halving import NOTE, StepChange
from smc_mujoco.chattering.harmonics import Loop
from smc_mujoco.chattering.prediction import Chattering
from smc_mujoco.draw import colouring, lettering, shared_axes, style, wording
from smc_mujoco.draw import page as pages
from smc_mujoco.draw.page import Handle
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

ROW_HEIGHT = 3.4  # inches
SPAN_FACTOR = 40.0  # from the crossing to the ends of L's frequencies and of N's amplitudes
NEAR = 0.5  # of the complex plane, around -1
SHOWN_PERIODS = 6  # of s
WIDE = 1.6  # points on a full page, of the curves in the plane
DASHES = (0, (4, 2))  # of 1/N
RESPONSE = "L, over frequency"
INVERSE = "1/N, over amplitude"
CYCLE = "cycle, with harmonics of e"


def nyquist(
    scenarios: Sequence[Scenario],
    channel: int,
    cycles: Sequence[Chattering],
    traces: Sequence[Trace],
    changes: Sequence[StepChange],
    path: str | os.PathLike[str] | None = None,
) -> Figure:
    """Draw the harmonic balance of scenarios, and their sliding variable, predicted and run.

    Args:
      scenarios: of one plant and one set of conditions, with different laws.
      channel: index of a driven channel.
      cycles, traces: predicted for these scenarios, and run.
      changes: of the traces, see `smc.accuracy.step_halving`; marked ones get a note.
      path: as in `figure`.
    """
    with style.page():
        colours = colouring.law_colours([scenario.law for scenario in scenarios])
        sources = [[scenario.law.source] for scenario in scenarios]
        gains, shared = pages.gain_sources(sources)
        handles: list[Handle] = []
        for scenario, cycle, colour, source in zip(scenarios, cycles, colours, gains, strict=True):
            words = "no limit cycle predicted, L and 1/N do not cross"
            if cycle:
                words = f"{cycle.frequency:.3g} Hz predicted"
            label = f"{wording.law_name(scenario.law)}: {words}{source}"
            handles.append(pages.entry(label, colour))
        if any(cycles):
            wide = style.points(WIDE)
            handles.append(pages.entry(RESPONSE, style.INK, lw=wide))
            handles.append(pages.entry(INVERSE, lw=wide, ls=DASHES))
            dot = {"marker": "o", "lw": 0.0, "ms": style.points(8)}
            handles.append(pages.entry(CYCLE, **dot))
        head = pages.head_height(style.FULL_WIDTH, handles)
        height = head + ROW_HEIGHT * len(scenarios)
        page = pages.blank(style.FULL_WIDTH, height)
        axes = page.subplots(len(scenarios), 2, squeeze=False, width_ratios=[1.0, 2.0])
        size = style.points(9.5)
        rows = zip(axes, scenarios, cycles, traces, changes, colours, strict=True)
        for (left_axes, right), scenario, cycle, trace, change, colour in rows:
            if cycle:
                plane(left_axes, scenario, cycle, channel, colour)
            else:  # nothing crosses: s has the whole row
                left_axes.remove()
                grid = right.get_subplotspec()
                row = grid.get_gridspec()[grid.rowspan.start, :]
                right.set_subplotspec(row)
            last_periods(right, trace, cycle, channel, colour)
            if change.marked:
                room = 72 * 0.53 * style.FULL_WIDTH
                words = lettering.wrapped(NOTE, room, size, lines=2)
                right.set_title(words, loc="left", fontsize=size, fontweight="normal")
        title = f"Chattering: {wording.head(scenarios)}"
        pages.set_head(page, style.FULL_WIDTH, title, handles, shared)
        return pages.write_page(page, pages.files(path))


def plane(ax: Axes, scenario: Scenario, cycle: Chattering, channel: int, colour: str) -> None:
    """Draw L over frequency and 1/N over amplitude near -1, and mark where they cross."""
    ax.set(xlabel="real part", ylabel="imaginary part", xlim=(-1.0 - NEAR, -1.0 + NEAR))
    ax.axhline(0.0, color=style.RULE, lw=style.points(0.8))
    loop = Loop(scenario, channel)
    omega = math.tau * cycle.frequency
    unit = -cycle.response
    fastest = math.pi / scenario.control_period
    last = min(omega * SPAN_FACTOR, fastest)
    omegas = np.geomspace(omega / SPAN_FACTOR, last, 400)
    responses = []
    for w in omegas:
        responses.append(loop.response(w))
    response = np.array(responses) / unit
    factors = np.geomspace(1 / SPAN_FACTOR, SPAN_FACTOR, 60)
    amplitudes = cycle.amplitude_x * factors
    inverses = []
    for a in amplitudes:
        gain = loop.gain(a, omega)
        inverses.append(1.0 / (gain or math.nan))
    inverse = np.array(inverses) / unit
    near = np.concatenate([response, inverse])
    near = near[np.abs(near.real + 1.0) <= NEAR]
    largest = 1.2 * float(np.abs(near.imag).max(initial=0.0))
    ax.set_ylim(-largest or -NEAR, largest or NEAR)
    wide = style.points(WIDE)
    ax.plot(response.real, response.imag, color=style.INK, lw=wide, label=RESPONSE)
    ax.plot(inverse.real, inverse.imag, color=colour, lw=wide, ls=DASHES, label=INVERSE)
    mark = {"color": colour, "ms": style.points(8), "mec": style.PAPER, "label": CYCLE}
    ax.plot([-1.0], [0.0], "o", **mark)


def last_periods(ax: Axes, trace: Trace, cycle: Chattering, channel: int, colour: str) -> None:
    """Draw s in the last periods of a run, the predicted amplitude as a band and an unstable one as
    lines.
    """
    start = 0.0
    label = "time (s)"
    if cycle:
        start = trace.t[-1] - SHOWN_PERIODS / cycle.frequency
        label = f"last {SHOWN_PERIODS} periods predicted (ms)"
    part = trace.t >= start
    s = trace.s[part, channel]
    unit = f"{trace.scenario.plant.units[channel]}/s"
    largest = float(np.abs(s).max())
    factor, unit = shared_axes.prefixed(largest, unit)
    s = factor * s
    t = trace.t[part] - trace.t[part][0]
    if cycle:
        t = 1e3 * t
    ax.plot(t, s, color=colour, lw=style.points(1.4), drawstyle="steps-post")
    ax.set(xlabel=label, ylabel=f"s ({unit})")
    if cycle:
        mean = float(s.mean())
        amplitude = factor * cycle.amplitude
        ax.axhspan(mean - amplitude, mean + amplitude, color=colour, alpha=0.15, lw=0)
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + 0.18 * (high - low))
        words = f"band: ±{wording.short(amplitude)} {unit}, predicted"
        if cycle.uncertainty > 1.0:
            words += "; irregular"
        if cycle.threshold_x:
            unstable = cycle.threshold_x * amplitude / cycle.amplitude_x
            for level in (mean - unstable, mean + unstable):
                ax.axhline(level, color=colour, lw=style.points(1.2), ls="dotted")
            words += f"; dotted: about ±{wording.short(unstable)}, unstable, within it a run rests"
        place = {"transform": ax.transAxes, "ha": "right", "va": "top"}
        ax.text(0.99, 0.97, words, fontsize=style.points(9.5), **place)
