"""Panels whose traces would hide each other: each trace has a row of its own."""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from smc_mujoco.common.aliases import Array, Fields
from smc_mujoco.draw import lettering, shared_axes, style, wording
from smc_mujoco.draw.decimate import band
from smc_mujoco.draw.panels import (
    MIN_CLOSE_UP,
    SINGLE,
    Panel,
    close_up_begin,
    mark,
    over_time,
    smoothed,
)
from smc_mujoco.draw.quantities import MARGIN, PEAKS, limits, span, usual
from smc_mujoco.simulation.trace import Trace

MIN_WIDE_BAND = 0.2  # mean height of a wide band, of a panel's; chosen
MAX_BANDS = 1  # wide bands that share a row; chosen
LANE_BAND = 0.45  # opacity of a band in a row of its own, below a film
LANE_GAP = 0.25  # letters between a row, and how far u swings
END_SHARE = 0.1  # of the time shown: its end, over which a row says how far u swings
MAX_SWITCHES = 20  # of a u that shares its axes with others
SMOOTH_SHARE = 0.02  # of a panel's range: a swing below it is none
FILM_RANGE = 1e-5  # of the largest error: below a film smaller ones are off the panel; chosen
BESIDE = 4.0  # px, from the mark of a settled run to the next
STEM = 1.3  # px, width of the line over the mark of a settled run
ROW_FILLED = 0.82  # part of a trace's row that its axes fill


class Row(NamedTuple):
    """Axes, the panel that they show, and the colours of its traces."""

    axes: Axes
    panel: Panel
    colours: Sequence[str]


def run_lanes(
    frame: Axes,
    panel: Panel,
    colours: Sequence[str],
    wide: float = 1.0,
    share: Axes | None = None,
) -> list[Row]:
    """Return a row for each trace of a panel, from above, within a share of the width of its
    axes.
    """
    pitch = 1.0 / len(panel.traces)
    drawn_rows = []
    for i, (trace, colour) in enumerate(zip(panel.traces, colours, strict=True), 1):
        place = (0.0, 1.0 - i * pitch, wide, ROW_FILLED * pitch)
        ax = frame.inset_axes(place, sharex=share)
        single = panel._replace(traces=[trace])
        drawn_rows.append(Row(ax, single, [colour]))
        share = ax
    return drawn_rows


def below_film(
    ax: Axes,
    panel: Panel,
    colours: Sequence[str],
    names: Sequence[str],
    changes: Mapping[float, str],
    settled: Sequence[float],
) -> tuple[list[Row], list[Artist]]:
    """Draw a panel below a film, whose time axis is set, and return its rows, one a run where they
    would hide each other, and the artists of the runs, which have `settled` at these times, s.
    """
    drawn_rows = [Row(ax, panel, colours)]
    laned = in_lanes(panel)
    if laned:
        letters = style.points(float(style.RC["font.size"]))
        room = 72 * ax.get_window_extent().width / ax.figure.dpi
        beside = (lettering.width("smooth", letters) + 2.0) / room
        drawn_rows = run_lanes(ax, panel, colours, 1.0 - beside)
        for row in drawn_rows:
            row.axes.set(xlim=ax.get_xlim(), xticks=ax.get_xticks())
            row.axes.set_xticklabels(ax.get_xticklabels())
            row.axes.tick_params(length=0, labelbottom=row is drawn_rows[-1], labelleft=False)
        ax.set_axis_off()
    drawn: list[Artist] = []
    for row in drawn_rows:
        mark(row.axes, changes, named=False)
        bands = laned or not crowded(panel)
        drawn += over_time(row.axes, row.panel, row.colours, panel.traces, bands, names)
        if panel.quantity in PEAKS:
            low, high = row.axes.get_ylim()
            row.axes.set_ylim(max(low, FILM_RANGE * high), high)
        if panel.quantity == "largest":
            cut_peak(row.axes, row.panel)
        if laned:
            drawn += tell_swing(row.axes, row.panel.traces[0], row.colours[0], panel.scale[0])
    if panel.quantity == "x":
        drawn += mark_settled(ax, panel.traces, colours, settled)
    return drawn_rows, drawn


def in_lanes(panel: Panel) -> bool:
    """Return whether each law's u has its own row, because a wide band would hide the others, or
    one that switches often.
    """
    if panel.quantity != "u" or len(panel.traces) < 2:
        return False
    ends = limits(panel.traces, "u")
    least = MIN_WIDE_BAND * np.ptp(ends)
    return switches_often([trace.u for trace in panel.traces], least) or crowded(panel, 0)


def end_in_lanes(panel: Panel) -> bool:
    """Return whether each run's u has its own row in a close-up of its end, where smaller switching
    hides the others, too.
    """
    if in_lanes(panel):
        return True
    begin = close_up_begin(panel.traces)
    parts = [trace.u[trace.t >= begin - 1e-9, :1] for trace in panel.traces]
    ends = np.concatenate(parts)
    if len(parts) < 2 or not len(ends):
        return False
    largest = max(map(abs, span(panel.traces, "u")))
    height = max(float(np.ptp(ends)), MIN_CLOSE_UP * largest)
    return switches_often(parts, MIN_WIDE_BAND * height)


def switches_often(controls: Sequence[Array], least: float) -> bool:
    """Return whether one of several u (K+1, n) has over MAX_SWITCHES steps larger than `least`."""
    counts = []
    for u in controls:
        steps = np.diff(u, axis=0)
        counts.append(np.sum(np.abs(steps) > least))
    return max(counts) > MAX_SWITCHES


def cut_peak(ax: Axes, panel: Panel) -> None:
    """Fit the vertical range to the largest |u| that lasts, where there is a brief one of over
    twice it, such as at the start, and say how large that is; not where other words are.
    """
    peak = span(panel.traces, "largest")[1]
    lasting = usual(panel.traces, "largest")
    if 0.0 < lasting < peak and not ax.texts:
        air = MARGIN * lasting
        ax.set_ylim(-air, lasting + 2.0 * air)
        words = f"up to {wording.short(peak)} {shared_axes.units(panel.group)['u']}"
        size = style.points(9.0)
        place: Fields = {"xytext": (-0.5 * size, -0.4 * size), "textcoords": "offset points"}
        look: Fields = {"ha": "right", "va": "top", "fontsize": size, "color": style.INK}
        look["bbox"] = {"fc": style.PAPER, "ec": "none", "pad": 0.1 * size}
        ax.annotate(words, (1.0, 1.0), xycoords="axes fraction", **place, **look)


def mark_settled(
    ax: Axes, traces: Sequence[Trace], colours: Sequence[str], times: Sequence[float]
) -> list[Artist]:
    """Mark on the x of runs when each has settled for good, s, where it does after the start, with
    a stem in the dashes of its line, and return the marks. Those that would hide each other stand
    beside each other.
    """
    marks: list[Artist] = []
    top = ax.get_ylim()[1]
    drawn_time = ax.get_xlim()[1]
    beside = BESIDE * drawn_time * ax.figure.dpi / 72 / ax.get_window_extent().width
    places = apart(times, style.points(beside))
    look: Fields = {"ms": style.points(6), "mec": style.PAPER, "mew": style.points(0.5)}
    look |= {"marker": "v", "markevery": [0], "lw": style.points(STEM), "clip_on": False}
    runs = zip(traces, colours, style.looks(traces), times, places, strict=True)
    for trace, colour, dashes, time, place in runs:
        if 0.0 < time < min(trace.t[-1], drawn_time):
            mean = trace.x.mean(axis=1)
            y = float(np.interp(time, trace.t, mean))
            marks += ax.plot([place, place], [y, top], color=colour, zorder=6, **look, **dashes)
    return marks


def apart(times: Sequence[float], least: float) -> list[float]:
    """Return places of marks at these times, s: later ones stand later where they are less than
    `least` s apart.
    """
    order = sorted(range(len(times)), key=times.__getitem__)
    places = list(times)
    for before, after in itertools.pairwise(order):
        lacking = least - (places[after] - places[before])
        if 0.0 < lacking < np.inf:
            places[after] += lacking
    return places


def tell_swing(lane: Axes, trace: Trace, colour: str, factor: float) -> list[Artist]:
    """Write beside a row how far u swings at the end of the time shown, in the unit of its numbers,
    which are `factor` times as large, with a bar; "smooth" if it does not swing. Return the words
    and the bar.
    """
    drawn: list[Artist] = []
    low, high = lane.get_ylim()
    for swings in lane.collections:
        swings.set_alpha(LANE_BAND)
    count = max(2, round(END_SHARE * len(trace.t)))
    u = trace.u[-count:]
    u = u[np.isfinite(u)]
    least = float(u.min(initial=np.inf))
    most = float(u.max(initial=-np.inf))
    swing = 0.5 * (most - least)
    if trace.diverged_at is not None:
        words = "fails"
    elif swing > SMOOTH_SHARE * (high - low):
        words = f"±{wording.short(factor * swing)}"
        places = lane.transLimits.transform([(0.0, least), (0.0, most)])
        ends = places[:, 1]
        look: Fields = {"color": colour, "lw": style.points(3), "clip_on": False}
        drawn += lane.plot([1.012, 1.012], ends, transform=lane.transAxes, **look)
    else:
        words = "smooth"
    size = style.points(style.RC["font.size"])
    place: Fields = {"xytext": (LANE_GAP * size, 0.0), "textcoords": "offset points"}
    look: Fields = {"va": "center", "fontsize": size, "color": style.INK}
    drawn.append(lane.annotate(words, (1.0, 0.5), xycoords="axes fraction", **place, **look))
    return drawn


def crowded(panel: Panel, allowed: int = MAX_BANDS) -> bool:
    """Return whether each trace needs a row: it has several channels, or more than `allowed` bands
    of u are wide.
    """
    if len(panel.group.channels) > 1 and panel.quantity not in SINGLE:
        return len(panel.traces) > 1
    if panel.quantity != "u":
        return False
    low, high = limits(panel.traces, "u")
    wide = 0
    for trace in filter(smoothed, panel.traces):
        _, least, most = band(trace.t, trace.u)
        width = float(np.mean(most - least))
        wide += width > MIN_WIDE_BAND * (high - low)
    return wide > allowed
