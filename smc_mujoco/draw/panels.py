"""Panels of figures and films: a quantity of several traces over time, a phase portrait, the last
samples of u.

Traces are cut to their finite samples (decimate.finite) and to a group of channels
(shared_axes.split). There is a line for each channel. Where that chatters, it is its mean over a
window of time (decimate.smooth). The band behind the lines is the range of u, s or a force within a
column of pixels.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from smc_mujoco.common.aliases import Array, ArrayPair, Data, Fields, Pair
from smc_mujoco.common.text import joined
from smc_mujoco.draw import lettering, shared_axes, style, wording
from smc_mujoco.draw.coincidence import Agreement, agreements, tell_agreements
from smc_mujoco.draw.decimate import COLUMNS, band, end, line, smooth, window
from smc_mujoco.draw.quantities import (
    LASTING_QUANTILE,
    PEAKS,
    QUANTITIES,
    limits,
    span,
)
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.metrics.conventions import (
    ChannelGroup,
    group_trace,
    scale,
    settling_band,
)
from smc_mujoco.metrics.tip import knows_contacts
from smc_mujoco.simulation.trace import Trace

LAST_SAMPLES = 60  # control samples in the close-up of u
# least height of the close-up, of the largest |u|, so that it hides round-off; chosen
MIN_CLOSE_UP = 0.02
# of a network, drawn one by one: of more, evenly chosen ones and the extreme ones
MAX_DRAWN_CHANNELS = 40
LEAST_LASTING = 0.02  # of the peaks: an axis that holds these shows smaller lasting values, too
LINE, LIGHT_LINE = 1.5, 0.8  # points, width of every curve, and of a single channel among several
SLOWEST_LINE = 2.4  # points, width of the channel whose x comes to its reference last
VISIBLE_CHATTERING = 0.01  # of a panel's height: chattering that is smaller needs no words; chosen
QUANTITY_OF_UNIT = {  # quantity -> another one of the same unit
    **dict.fromkeys(("spread", "e", "settling", "distance"), "x"),
    "de": "v",
    **dict.fromkeys(("largest", "applied"), "u"),
    **dict.fromkeys(("reaction", "d"), "force"),
}
WORDS = {
    "force": "delivered",
    "reaction": "reaction",
    "spread": "max − min x",
}  # quantity -> words instead of a letter
KINDS = {"v": "velocity", "s": "sliding variable", "e": "error", "d": "disturbance"}
KINDS |= {"de": "its rate"}
KINDS |= dict.fromkeys(("u", "applied"), "control")
WHOLE_LABELS = {  # quantity, one number a sample -> what an axis says
    "tip": "tip off its path (mm)",
    "contact": "force of contact (N)",
    "load": "largest |u| (% of limit)",
    "settling": "|x − r|",
    "distance": "|x − r|",
    "tip distance": "tip off its path (mm)",
    "largest": "largest |u|",
}
SINGLE = ("spread", *WHOLE_LABELS)  # one number a sample, whatever the number of channels
UNBANDED = ("x", "e", *SINGLE)  # drawn sample by sample, without a mean over time
NO_SURFACE = ("baseline", "predictive", "feedback", "linear")  # families of laws without an s
BETWEEN_DECADES = ((3.0,), (2.0, 5.0), (2.0, 3.0, 4.0, 5.0, 6.0, 8.0))
DASHES = (0, (4, 4))  # of a reference's line
BAND_OPACITY = 0.22  # of the range of one run's values, or of two runs'; chosen
DOTS = (0, (2, 2))  # of the upright line at which something happens
REFERENCE = "reference"  # id of a reference's lines
HEIGHT = 2  # channel of a free body


class Panel(NamedTuple):
    """A quantity of a group of channels, or of one channel, over time."""

    quantity: str
    group: ChannelGroup
    traces: Sequence[Trace]  # of these channels alone
    channel: int | None = None  # of a small panel
    group_traces: Sequence[Trace] = ()  # of all channels of the group, where one is shown

    def band(self, trace: Trace) -> float:
        """Return the settling band of one of its traces, which is that of the group, as in
        scores.
        """
        of_group = [
            channel_trace
            for channel_trace in self.group_traces
            if channel_trace.scenario is trace.scenario
        ]
        return settling_band(trace.scenario, scale([*of_group, trace][0]))

    @property
    def scale(self) -> tuple[float, str]:
        """The factor of the numbers at the vertical axis and their unit in brackets, so that none
        needs an exponent.

        The unit is "" where the words have it; or where it depends on the law, as that of s does:
        the s of twisting is e, and that of PID is a force.
        """
        if self.quantity in ("tip", "tip distance", "contact", "load"):
            return 1.0, ""
        name = QUANTITY_OF_UNIT.get(self.quantity, self.quantity)
        unit = shared_axes.units(self.group)[name]
        if self.quantity in PEAKS:
            return 1.0, f" ({unit})"
        ends = limits(self.traces, self.quantity)
        largest = max(map(abs, ends))
        factor, prefixed = shared_axes.prefixed(largest, unit)
        if self.quantity != "s" or all(map(slides_on_speed, filter(slides, self.traces))):
            return factor, f" ({prefixed})"
        return factor, "" if factor == 1.0 else f" / {1.0 / factor:g}"

    @property
    def label(self) -> str:
        """The label of the vertical axis, with its unit. A joint of a robot has its name in it."""
        name = self.quantity
        group = self.group
        plant = self.traces[0].scenario.plant
        unit = self.scale[1]
        single = len(group.channels) == 1
        speed = group.unit.endswith("/s")
        if name in ("settling", "distance") and speed:
            return f"|v − r′|{unit}"
        if name in WHOLE_LABELS:
            return WHOLE_LABELS[name] + unit
        word = WORDS.get(name, name)
        letter = {"de": "e′"}.get(name, word)
        if speed:
            letter = {"x": "v", "e": "v − r′"}.get(name, letter)
        if not group.driven:
            letter = {"x": "q", "v": "q′"}.get(name, letter)
        if single and plant.pose and name == "u" and group.unit == "m":  # of an actuator
            return f"actuator {group.channels[0] + 1} {letter}{unit}"
        if single and (plant.direct or self.channel is not None):
            words = f"{channel_names(plant)[group.channels[0]]} {letter}"
            if plant.pose and name == "x" and group.channels[0] == HEIGHT:
                words = "height z"
            return words + unit
        if name in WORDS or (name == "s" and plant.mixed):  # mixed plants have low panels
            return letter + ("" if group.driven else " on q") + unit
        kind = "position" if group.unit == "m" else "angle"
        if speed:
            kind = "speed"
        if not group.driven:
            kind = f"free {kind}"
        return f"{KINDS.get(name, kind)} {letter}{unit}"


def slides(trace: Trace) -> bool:
    """Return whether a law has a sliding variable: the s of a baseline such as PID is a force, and
    a law that cancels what an observer finds slides only if it switches.
    """
    template = trace.scenario.law.template
    if template is None:
        return True
    if template.family == "disturbance-observer":
        return not template.continuous
    return template.family not in NO_SURFACE


def slides_on_speed(trace: Trace) -> bool:
    """Return whether s has the unit of a speed: that of twisting is e."""
    scenario = trace.scenario
    return scenario.law.relative_degree == 1 and not scenario.plant.free and slides(trace)


def without_s(trace: Trace) -> Trace:
    """Return a trace whose s is unknown, so that no panel draws it."""
    unknown = np.full_like(trace.s, np.nan)
    return dataclasses.replace(trace, s=unknown)


def is_shared(panel: Panel) -> bool:
    """Return whether a panel shows one disturbance, which all its runs have."""
    first, *later_traces = panel.traces
    if panel.quantity != "d" or not later_traces:
        return False
    return all(np.array_equal(first.d, trace.d, equal_nan=True) for trace in later_traces)


def of_groups(traces: Sequence[Trace], quantity: str) -> list[Panel]:
    """Return a panel of the quantity for each group of channels."""
    return [Panel(quantity, *group_traces) for group_traces in shared_axes.split(traces).items()]


def over_groups(traces: Sequence[Trace], quantity: str) -> list[Panel]:
    """Return the panels of a quantity over time, one for each group of channels that has it; a tip
    has one panel.
    """
    scenarios = [trace.scenario for trace in traces]
    if quantity == "s":
        traces = [trace if slides(trace) else without_s(trace) for trace in traces]
    panels = of_groups(traces, quantity)
    if quantity == "tip":
        tips = all(s.plant.tip for s in scenarios)
        return [panels[0]._replace(traces=traces)] if tips else []
    if quantity == "contact":
        contacts = all(map(knows_contacts, scenarios))
        return [panels[0]._replace(traces=traces)] if contacts else []
    if quantity in ("x", "e", "v"):
        return panels
    if quantity == "force" and not any(scenario.actuator for scenario in scenarios):
        return []
    panels_of_groups = []
    for panel in filter(has_something, panels):
        if quantity in ("u", "applied") and not panel.group.effort:
            panels_of_groups += by_channel(panel)
        else:
            panels_of_groups.append(panel)
    return panels_of_groups


def has_something(panel: Panel) -> bool:
    """Return whether a panel has something to show: reactions and disturbances may be zero, and
    channels without an actuator have no control.
    """
    quantity = panel.quantity
    if quantity in ("reaction", "d"):
        return any(np.nan_to_num(QUANTITIES[quantity](part)).any() for part in panel.traces)
    if quantity == "s":
        return panel.group.driven and any(map(slides, panel.traces))
    if quantity == "spread":
        return panel.group.driven and len(panel.group.channels) > 1
    return panel.group.driven


def worst_first(traces: Sequence[Trace]) -> list[Panel]:
    """Return a panel of the error of each channel, first that of the largest mean |e|, in scales of
    its group.
    """
    sized_panels = []
    for group, parts in shared_axes.split(traces).items():
        size = max(map(scale, parts))
        for panel in by_channel(Panel("e", group, parts)):
            sized_panels.append((mean_error(panel) / size, panel))
    sized_panels.sort(key=lambda one: -one[0])
    return [panel for _, panel in sized_panels]


def mean_error(panel: Panel) -> float:
    """Return the largest mean |x - r| of a panel's runs, those that failed included."""
    errors = []
    for run in panel.traces:
        sizes = np.abs(run.x - run.r)
        total = float(np.nansum(sizes))
        errors.append(total / len(run.t))
    return max(errors)


def by_channel(panel: Panel) -> list[Panel]:
    """Return a panel for each channel of a panel's group whose error counts."""
    if panel.quantity in SINGLE:
        return [panel]
    panels = []
    scored = panel.traces[0].scenario.scored_channels
    for place, channel in enumerate(i for i in panel.group.channels if i in scored):
        within = dataclasses.replace(panel.group, channels=(place,))
        traces = [group_trace(trace, within) for trace in panel.traces]
        effort = panel.traces[0].scenario.efforts[channel]
        group = dataclasses.replace(panel.group, channels=(channel,), effort=effort)
        panel_of_channel = Panel(panel.quantity, group, traces, channel, panel.traces)
        panels.append(panel_of_channel)
    return panels


def actuators(traces: Sequence[Trace]) -> list[Panel]:
    """Return a panel of the force of each actuator of a free body, in their order, of those that
    push at all.
    """
    groups = shared_axes.split(traces).items()
    group, parts = next(iter(groups))
    first = dataclasses.replace(group, channels=(0,))
    pushed = [np.nan_to_num(part.u).any(axis=0) for part in parts]
    pushing = np.any(pushed, axis=0)
    panels = []
    for j in np.flatnonzero(pushing).tolist():
        runs = []
        for part in parts:
            u = part.u[:, j : j + 1]
            of_actuator = group_trace(part, first)
            runs.append(dataclasses.replace(of_actuator, u=u))
        own = dataclasses.replace(group, channels=(j,))
        panels.append(Panel("u", own, runs, j))
    return panels


def together(panels: Sequence[Panel]) -> list[Panel]:
    """Return one panel of u that has the channels of all these panels, which share their runs."""
    runs = []
    for traces in zip(*(panel.traces for panel in panels), strict=True):
        u = np.hstack([trace.u for trace in traces])
        runs.append(dataclasses.replace(traces[0], u=u))
    channels = tuple(panel.group.channels[0] for panel in panels)
    group = dataclasses.replace(panels[0].group, channels=channels)
    return [Panel("u", group, runs)]


def meaning(panels: Sequence[Panel]) -> dict[str, str]:
    """Return the meaning of bands and lines that need an explanation: "band", "line", ... ->
    words.
    """
    n = 1
    kind = "channels"
    banded = []
    over = 0.0
    for panel in panels:
        if panel.quantity not in SINGLE and parted(panel):
            n = max(n, len(panel.group.channels))
            if panel.traces[0].scenario.plant.pose and panel.quantity == "u":
                kind = "actuators"
        if panel.quantity not in (*UNBANDED, *banded):
            banded.append(panel.quantity)
        if panel.quantity == "u":
            over = max(over, mean_window(panel.traces))
    words = {}
    if banded and (over or n > 1):
        words["band"] = f"range of {', '.join(banded).replace('force', 'delivered')}"
    if over:
        words["line"] = f"mean over up to {1e3 * over:.3g} ms where it chatters"
    if n > 1:
        drawn_channels = min(n, MAX_DRAWN_CHANNELS)
        words["thin lines"] = (
            f"the {n} {kind}" if drawn_channels == n else f"{drawn_channels} of {n} {kind}"
        )
        if any(panel.quantity == "x" for panel in panels):
            words["thin lines"] += ", the slowest thick"
    return words


def aims(panel: Panel) -> bool:
    """Return whether a panel of x or of the error shows a reference."""
    have_references = [np.isfinite(trace.r).any() for trace in panel.traces]
    return panel.quantity in ("x", "e") and any(have_references)


def parted(panel: Panel) -> bool:
    """Return whether the channels of a panel's runs ever differ."""
    spreads = [np.ptp(QUANTITIES[panel.quantity](trace), axis=1) for trace in panel.traces]
    return any(np.nan_to_num(spread).any() for spread in spreads)


def titles(panels: Sequence[Panel], heights: Sequence[float]) -> list[str]:
    """Return the labels of panels of these heights in points, long ones on several lines."""
    pairs = zip(panels, heights, strict=True)
    folded = []
    for panel, height in pairs:
        title = lettering.folded(panel.label, 0.95 * height)
        folded.append(title)
    return folded


def curve(trace: Trace, y: Array, name: str) -> ArrayPair:
    """Return the line of a quantity y (K+1,): times in s, and values.

    A short trace is not smoothed.
    """
    if smoothed(trace):
        return line(trace.t, y, 0 if name in UNBANDED else window(trace))
    return (trace.t, y)


def middle(trace: Trace, name: str) -> ArrayPair:
    """Return the line of the mean of a quantity over the channels: times in s, and values."""
    mean = QUANTITIES[name](trace).mean(axis=1)
    return curve(trace, mean, name)


def smoothed(trace: Trace) -> bool:
    """Return whether the trace has too many samples to show each."""
    return trace.scenario.samples > COLUMNS


def mean_window(traces: Sequence[Trace]) -> float:
    """Return the longest window of the means of u, s; 0 if no u chatters visibly.

    It does if u swings to and fro, within the time in which two reversals are chattering.
    """
    from scipy.ndimage import grey_closing, grey_opening

    low, high = limits(traces, "u")
    longest = 0.0
    for trace in filter(smoothed, traces):
        for u in trace.u.T[drawn_channels(trace.u)]:
            meant = smooth(u, window(trace)) != u
            near = window(trace) // 4
            swing = grey_closing(u, near) - grey_opening(u, near)
            chattering = 0.5 * swing[meant].max(initial=0.0)
            if chattering > VISIBLE_CHATTERING * (high - low):
                seconds = window(trace) * trace.scenario.control_period
                longest = max(longest, seconds)
                break
    return longest


def over_time(
    ax: Axes,
    panel: Panel,
    colours: Sequence[str],
    among: Sequence[Trace] = (),
    bands: bool = True,
    names: Sequence[str] = (),
) -> list[Artist]:
    """Draw the panel with the first trace on top, set its vertical range, and return the artists of
    the traces.

    The reference of x is drawn in front, its settling band behind. Words tell which traces agree,
    as those behind are hidden, and which have no values, as s of a law without a surface. The
    traces `among` set the range, by default the panel's own; `bands`: whether to draw ranges behind
    the lines; `names`: of the traces, for the words.
    """
    artists: list[Artist] = []
    name = panel.quantity
    traces = panel.traces
    means = [QUANTITIES[name](trace).mean(axis=1) for trace in traces]
    heights = limits(traces, name)
    if name in PEAKS:
        set_logarithmic(ax, heights)
    ax.set_ylim(limits(among or traces, name))
    own = panel._replace(traces=among or traces)
    set_numbers(ax.yaxis, own)
    clipped = name == "reaction" and clip_impacts(ax, panel, colours)
    if name in ("x", "e"):
        target(ax, panel)
    looks = style.looks(traces)
    opacity = BAND_OPACITY * min(1.0, 2.0 / len(traces))  # lines are seen through several bands
    rows = zip(traces, colours, means, looks, strict=True)
    for trace, colour, mean, look in reversed(list(rows)):
        if not np.isfinite(mean).any():  # s of a law without a surface
            continue
        y = QUANTITIES[name](trace)
        look |= {"color": colour, "drawstyle": steps(trace, name)}
        if bands and name not in UNBANDED and (smoothed(trace) or y.shape[1] > 1):
            edges = band(trace.t, y)
            filled = ax.fill_between(*edges, color=colour, alpha=opacity, lw=0)
            artists.append(filled)
        if y.shape[1] > 1:
            artists += channels(ax, trace, y, name, look)
        else:
            points = curve(trace, mean, name)
            artists += ax.plot(*points, lw=style.points(LINE), **look)
        # a trace that is cut to a close-up may end before its run failed
        end = trace.t[-1] + trace.scenario.control_period
        if trace.diverged_at is not None and end > trace.diverged_at - 1e-9:
            last = np.clip(mean[-1], *ax.get_ylim())
            ending: Fields = {"color": colour, "clip_on": False, "zorder": 5, **cross()}
            artists += ax.plot(trace.t[-1], last, "X", **ending)
    alone = name in SINGLE or len(panel.group.channels) == 1
    if names and alone and not clipped:  # words have no room above impacts
        empty = []
        for i, mean in enumerate(means):
            if not np.isfinite(mean).any():
                empty.append(names[i])
        missing = f"no {name}: {joined(empty)}" if empty else ""
        tell_agreements(ax, agreed(panel), names, missing)
    return artists


def agreed(panel: Panel) -> list[Agreement]:
    """Return which of a panel's runs agree, in the means of their channels, and until when."""
    name = panel.quantity
    lines = []
    for trace in panel.traces:
        lines.append((trace.t, QUANTITIES[name](trace).mean(axis=1)))
    return agreements(lines, limits(panel.traces, name), name in PEAKS)


def set_logarithmic(ax: Axes, heights: Pair) -> None:
    """Make the vertical axis logarithmic, for values in this range."""
    ax.set_yscale("log")
    number_decades(ax.yaxis, heights)


def number_decades(axis: Axis, ends: Pair) -> None:
    """Number the decades of a logarithmic axis between its ends; with fewer than two of them,
    numbers between them too, so that there are two, and ticks at all multiples of a decade.
    """
    first, last = np.log10(ends)
    if math.floor(last) > math.ceil(first):
        axis.set_minor_formatter(NullFormatter())
        return
    decades = 10.0 ** np.arange(math.floor(first), math.ceil(last) + 1)
    between: tuple[float, ...] = ()
    for between in BETWEEN_DECADES:
        numbers = np.outer(decades, [1.0, *between])
        if np.sum((numbers >= min(ends)) & (numbers <= max(ends))) > 1:
            break
    axis.set_minor_locator(LogLocator(subs=range(2, 10)))
    axis.set_tick_params(which="minor", length=rcParams["xtick.major.size"])  # numbers in one line

    def numbered(value: float, _: int) -> str:
        first_digit = round(value / 10.0 ** math.floor(math.log10(value) + 1e-9))
        return wording.short(value) if first_digit in (1, *between) else ""

    axis.set_major_formatter(FuncFormatter(numbered))
    axis.set_minor_formatter(FuncFormatter(numbered))


def steps(trace: Trace, name: str) -> str:
    """Return how a line of a quantity goes from sample to sample: u is held."""
    return "steps-post" if name == "u" and not smoothed(trace) else "default"


def channels(ax: Axes, trace: Trace, y: Array, name: str, look: Data) -> list[Artist]:
    """Draw the channels of y, (K+1, n), one by one, the slowest x thick."""
    artists: list[Artist] = []
    slowest = -1
    if name == "x":
        off = np.abs(y - trace.r)
        misses = np.nansum(off, axis=0)
        slowest = int(misses.argmax())
    for i in sorted({*drawn_channels(y), slowest} - {-1}):
        width, alpha = (SLOWEST_LINE, 1.0) if i == slowest else (LIGHT_LINE, 0.55)
        line = curve(trace, y[:, i], name)
        artists += ax.plot(*line, alpha=alpha, lw=style.points(width), **look)
    return artists


def set_numbers(axis: Axis, panel: Panel) -> None:
    """Give an axis that shows a panel's quantity numbers in the panel's unit."""
    if (factor := panel.scale[0]) != 1.0:
        axis.set_major_formatter(
            FuncFormatter(lambda value, _: f"{factor * value:.6g}".replace("-", "−"))
        )


def cross() -> Fields:
    """Return the look of the mark at the end of a failed run."""
    return {"ms": style.points(9), "mec": "white", "mew": style.points(1)}


def clip_impacts(ax: Axes, panel: Panel, colours: Sequence[str]) -> bool:
    """Fit the vertical range to lasting reactions, such as friction, where there are any, and
    return whether impacts leave it.

    Mark short impacts outside it by arrows, the largest of each run with its size.
    """
    peak = 0.0
    usual = 0.0
    for trace in panel.traces:
        finite = np.isfinite(trace.reaction)
        sizes = np.abs(trace.reaction[finite])
        if sizes.size:
            peak = max(peak, float(sizes.max()))
            lasting_size = np.quantile(sizes, LASTING_QUANTILE)
            usual = max(usual, float(lasting_size))
    if not peak > 2.0 * usual > LEAST_LASTING * peak:
        return False
    top = 1.16 * usual
    ax.set_ylim(-top, top)
    look = {"ls": "", "ms": style.points(5), "mew": style.points(1.2), "clip_on": False}
    for trace, colour in zip(panel.traces, colours, strict=True):
        for side, mark in ((1, 2), (-1, 3)):  # matplotlib's ticks up and down, outside the axes
            reactions = np.nan_to_num(side * trace.reaction)
            largest = reactions.max(axis=1)
            beyond = (largest > top).astype(int)
            begins = np.diff(beyond, prepend=0) > 0
            starts = trace.t[np.flatnonzero(begins)]
            heights = np.full(len(starts), side * top)
            ax.plot(starts, heights, color=colour, marker=mark, in_layout=False, **look)
    note(ax, f"|reaction| up to {wording.short(peak, 3)} {shared_axes.units(panel.group)['force']}")
    return True


def note(ax: Axes, words: str) -> None:
    """Print words above the right end of the axes."""
    ax.set_title(
        words, loc="right", fontweight="normal", fontsize=style.points(9.5), color=style.MUTED
    )


def references(traces: Sequence[Trace]) -> list[tuple[Trace, Array, Array]]:
    """Return the longest trace of each reference, with its times (K+1,) and values (K+1,), the mean
    of its channels.
    """
    longest = {}
    for trace in sorted(traces, key=lambda trace: len(trace.t)):
        longest[trace.scenario.resolved.reference] = trace
    reference_lines = []
    for trace in longest.values():
        r = trace.r.mean(axis=1)
        finite = np.isfinite(r)
        if finite.any():
            reference_lines.append((trace, trace.t[finite], r[finite]))
    return reference_lines


def target(ax: Axes, panel: Panel) -> None:
    """Draw each reference (zero for an error) as long as a run has it, and its settling band."""
    bottom, top = ax.get_ylim()
    for trace, times, values in references(panel.traces):
        drawn_values = values if panel.quantity == "x" else 0.0 * values
        t, r = line(times, drawn_values, 2)
        half = panel.band(trace)
        if not (r - half < bottom).all() or not (r + half > top).all():  # else it is the background
            ax.fill_between(t, r - half, r + half, color=style.BAND, lw=0, zorder=1)
        look = {"lw": style.points(0.8), "ls": DASHES, "zorder": 3, "gid": REFERENCE}
        ax.plot(t, r, color=style.INK, **look)


def mark(ax: Axes, changes: Mapping[float, str], named: bool) -> None:
    """Mark when plants change or arms are hit, time in s -> words; with the words above the axes if
    `named`.
    """
    last = ax.get_xlim()[1]
    size = style.points(9)
    room = ax.get_window_extent().width * 72 / ax.figure.dpi  # points
    ends: list[float] = []  # of the words in each row above the axes, in points
    for time, change in sorted(changes.items()):
        ax.axvline(time, color=style.INK, lw=style.points(0.9), ls=DOTS, zorder=1.5)
        if not named:
            continue
        words = lettering.cropped(change, room, size)
        width = lettering.width(words, size)
        offset = room * time / last
        begin = min(offset, room - width)
        row = 0
        while row < len(ends) and ends[row] >= begin:
            row += 1
        ends[row:] = [begin + width + size]
        place = (begin - offset, 2 + 1.2 * size * row)
        look = {"va": "bottom", "fontsize": size, "parse_math": False}
        ax.annotate(words, (time, 1.0), place, ("data", "axes fraction"), "offset points", **look)


def phase(ax: Axes, panel: Panel, colours: Sequence[str]) -> None:
    """Draw v over x of a panel's traces; under a reference that moves, the error's rate over the
    error.

    A ring marks the start of a trace.
    """
    traces = panel.traces
    names = "x", "v"
    if any(np.nan_to_num(np.ptp(trace.r, axis=0)).any() for trace in traces):
        names = "e", "de"
    for axis, name in zip((ax.xaxis, ax.yaxis), names, strict=True):
        own = panel._replace(quantity=name)
        set_numbers(axis, own)
        axis.set_label_text(lettering.folded(own.label))
    ax.set(xlim=limits(traces, names[0]), ylim=limits(traces, names[1]))
    is_single = traces[0].x.shape[1] == 1
    width = style.points(LINE if is_single else LIGHT_LINE)
    rows = zip(traces, colours, style.looks(traces), strict=True)
    for trace, colour, look in reversed(list(rows)):
        places = QUANTITIES[names[0]](trace)
        speeds = QUANTITIES[names[1]](trace)
        for i in drawn_channels(places):
            x = places[:, i]
            v = speeds[:, i]
            ax.plot(x, v, color=colour, lw=width, **look)
            ax.plot(x[0], v[0], "o", color=colour, mfc="white", ms=style.points(6), zorder=4)
        if trace.diverged_at is not None:
            ax.plot(places[-1, 0], speeds[-1, 0], "X", color=colour, zorder=5, **cross())
    rule = {"color": style.RULE, "lw": style.points(0.9), "zorder": 1}
    ax.axhline(0.0, **rule)
    ax.axvline(0.0, **rule)


def last_samples(ax: Axes, panel: Panel, colours: Sequence[str], beside: float = 0.0) -> None:
    """Draw the last samples of u of the first channel, each held until the next, of the longest
    run. `beside` is the largest |u| of runs in other rows, for the range of a u that is 0.
    """
    stop = end(panel.traces)
    begin = close_up_begin(panel.traces)
    set_numbers(ax.yaxis, panel)
    ends = []
    looks = style.looks(panel.traces)
    rows = zip(panel.traces, colours, looks, strict=True)
    for trace, colour, look in reversed(list(rows)):
        part = trace.t >= begin - 1e-9
        u = trace.u[part, 0]
        t = 1e3 * (trace.t[part] - stop)
        ax.step(t, u, where="post", color=colour, lw=style.points(LINE), ls=look["ls"])
        if u.size:
            ends += [u.min(), u.max()]
    if ends:
        largest = max(map(abs, span(panel.traces, "u")))
        least = MIN_CLOSE_UP / 2 * (largest or beside)
        half_range = 0.62 * np.ptp(ends)
        half = max(half_range, least) or 1.0
        middle = (min(ends) + max(ends)) / 2
        ax.set_ylim(middle - half, middle + half)
    else:
        words = "the run failed" if len(panel.traces) == 1 else "all runs failed"
        place = {"transform": ax.transAxes, "ha": "center", "va": "center"}
        ax.text(0.5, 0.5, words, color=style.MUTED, **place)
        ax.tick_params(labelleft=False)
    ax.set_xlim(1e3 * (begin - stop), 0.0)


def close_up_begin(traces: Sequence[Trace]) -> float:
    """Return the time, s, from which a close-up shows the last samples of the longest run."""
    close_up_time = LAST_SAMPLES * traces[0].scenario.control_period
    return max(0.0, end(traces) - close_up_time)


def dot(ax: Axes, colour: str) -> Line2D:
    """Add to axes the dot of a run."""
    rim: Fields = {"mec": style.PAPER, "mew": style.points(0.6), "ms": style.points(5.0)}
    (marker,) = ax.plot([], [], "o", color=colour, zorder=6, clip_on=False, animated=True, **rim)
    return marker


def drawn_channels(y: Array) -> list[int]:
    """Return the indices of the channels of y, (K + 1, n), that are drawn one by one.

    Those of its least and largest value are among them, so that their curves reach as far as those
    of all.
    """
    n = y.shape[1]
    if n <= MAX_DRAWN_CHANNELS:
        return list(range(n))
    spread = np.linspace(0, n - 1, MAX_DRAWN_CHANNELS)
    chosen = spread.round().astype(int)
    lowest = int(np.nanargmin(y)) % n
    highest = int(np.nanargmax(y)) % n
    return sorted({*chosen.tolist(), lowest, highest})
