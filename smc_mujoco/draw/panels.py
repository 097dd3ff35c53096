"""Panels of figures and films: a quantity of several traces over time, a phase portrait, the last
samples of u.

Traces are cut to their finite samples (decimate.finite) and to a group of channels (style.split).
There is a line for each channel. Where that chatters, it is its mean over a window of time
(decimate.smooth). The band behind the lines is the range of u, s or a force within a column of
pixels.
"""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, NullFormatter

from smc_mujoco.common.text import joined
from smc_mujoco.draw import style
from smc_mujoco.draw.decimate import COLUMNS, band, end, line, smooth, window
from smc_mujoco.mechanisms.hardware.part import joint_names
from smc_mujoco.metrics import tip
from smc_mujoco.metrics.conventions import SETTLING_BAND, Group, group_trace, scale
from smc_mujoco.simulation.trace import Trace

LAST_SAMPLES = 60  # control samples in the close-up of u
MIN_CLOSE_UP = (
    0.02  # least height of the close-up, of the largest |u|, so that it hides round-off; chosen
)
MAX_DRAWN_CHANNELS = (
    40  # of a network, drawn one by one: of more, evenly chosen ones and the extreme ones
)
LASTING_QUANTILE = (
    0.98  # of |reaction|, or of what an arrow shows: values above it are short peaks; chosen
)
MIN_WORDS = (
    4.0  # of a panel's height, in heights of letters, from which on it has room for words; chosen
)
CROWDED_STRIP = 3  # groups of channels, from which on a film has no panel of the error
LINE, LIGHT_LINE = 1.5, 0.8  # points, width of every curve, and of a single channel among several
SLOWEST_LINE = 2.4  # points, width of the channel whose x comes to its reference last
COINCIDENT_DISTANCE = (
    0.01  # of a panel's height, below the width of a line: curves no farther apart agree
)
COINCIDENT_SHARE = (
    0.99  # of agreeing curves' samples, so that controls that switch a sample apart agree; chosen
)
# of the time that a panel shows: curves that agree for less have their colours there; chosen
MIN_AGREEMENT = 0.15
ALL = {2: "both", 3: "all three", 4: "all four", 5: "all five", 6: "all six"}
MIN_WIDE_BAND, MAX_BANDS = (
    0.2,
    1,
)  # mean height of a wide band, of a panel's, and how many share a row; chosen
VISIBLE_CHATTERING = 0.01  # of a panel's height: chattering that is smaller needs no words; chosen
REST_BAND = 0.02  # of a panel's height: an x that stays within it rests; chosen
ZOOM, MAX_ZOOMED = (
    1.3,
    0.5,
)  # panels show ZOOM times the time until all rest, if that is less than this part of a run
MIN_ERROR, MIN_RATIO = (
    1e-9,
    20.0,
)  # smaller errors are drawn at it; least ratio of a logarithmic axis, chosen
JUMP_RATIO = (
    2.0  # a reference jumps where its rate is more than this many times the 99 % quantile; chosen
)
QUANTITY_OF_UNIT = {  # quantity -> another one of the same unit
    **dict.fromkeys(("spread", "e", "settling"), "x"),
    **dict.fromkeys(("largest", "applied"), "u"),
    **dict.fromkeys(("reaction", "d"), "force"),
}
WORDS = {
    "force": "delivered",
    "reaction": "reaction",
    "spread": "max − min x",
}  # quantity -> words instead of a letter
KINDS = {"v": "velocity", "s": "sliding variable", "e": "error", "d": "disturbance"}
KINDS |= dict.fromkeys(("u", "applied"), "control")
WHOLE_LABELS = {  # quantity, one number a sample -> what an axis says
    "tip": "tip off its path (mm)",
    "contact": "force of contact (N)",
    "settling": "|x − r|",
    "largest": "largest |u|",
}
PEAKS = ("settling", "tip")  # drawn as `peaks`, on a logarithmic axis
SINGLE = ("spread", *WHOLE_LABELS)  # one number a sample, whatever the number of channels
UNBANDED = ("x", "e", *SINGLE)  # drawn sample by sample, without a mean over time
# of a run whose plant diverged: its first part sets a panel's range if no run lasts; chosen
UNDIVERGED_SHARE = 0.8
MARGIN = 0.08  # of a panel's height, above and below its curves
REFERENCE, AGREED = (
    "reference",
    "agreed",
)  # ids of a reference's lines, and of those of several traces that agree

QUANTITIES: dict[str, Callable[[Trace], np.ndarray]] = {  # name -> (K+1, n)
    "x": lambda trace: trace.x,
    "e": lambda trace: trace.x - trace.r,
    "v": lambda trace: trace.v,
    "u": lambda trace: trace.u,
    "applied": lambda trace: trace.applied,
    "d": lambda trace: trace.d,
    "s": lambda trace: trace.s,
    "force": lambda trace: trace.force,
    "reaction": lambda trace: trace.reaction,
    "spread": lambda trace: np.ptp(trace.x, axis=1, keepdims=True),
    "tip": lambda trace: peaks(1e3 * tip.tip_error(trace), trace),
    "contact": lambda trace: tip.contacts(trace).force[:, None],
    "settling": lambda trace: peaks(np.abs(trace.x - trace.r).max(axis=1), trace),
    "largest": lambda trace: np.abs(trace.u).max(axis=1, keepdims=True),
}


class Panel(NamedTuple):
    """A quantity of a group of channels, or of one channel, over time."""

    quantity: str
    group: Group
    traces: Sequence[Trace]  # of these channels alone
    channel: int | None = None  # of a small panel

    @property
    def scale(self) -> tuple[float, str]:
        """The factor of the numbers at the vertical axis and their unit in brackets, so that none
        needs an exponent.

        The unit is "" where the words have it; or where it depends on the law, as that of s does:
        the s of twisting is e, and that of PID is a force.
        """
        scenarios = [trace.scenario for trace in self.traces]
        baseline = any(
            one.law.template and one.law.template.family == "baseline" for one in scenarios
        )
        first_degree = scenarios[0].plant.free == 0 and all(
            one.law.relative_degree == 1 for one in scenarios
        )
        if self.quantity in ("tip", "contact"):
            return 1.0, ""
        unit = style.units(self.group)[QUANTITY_OF_UNIT.get(self.quantity, self.quantity)]
        if self.quantity in PEAKS:
            return 1.0, f" ({unit})"
        factor, prefixed = style.prefixed(max(map(abs, limits(self.traces, self.quantity))), unit)
        if self.quantity != "s" or (first_degree and not baseline):
            return factor, f" ({prefixed})"
        return factor, "" if factor == 1.0 else f" / {1.0 / factor:g}"

    @property
    def label(self) -> str:
        """The label of the vertical axis, with its unit. A joint of a robot has its name in it."""
        name = self.quantity
        group = self.group
        plant = self.traces[0].scenario.plant
        unit = self.scale[1]
        if name in WHOLE_LABELS:
            return WHOLE_LABELS[name] + unit
        if group.driven:
            letter = WORDS.get(name, name)
        else:
            letter = {"x": "q", "v": "q′"}.get(name, WORDS.get(name, name))
        if (
            plant.pose and name == "u" and group.unit == "m" and len(group.channels) == 1
        ):  # of an actuator
            return f"actuator {group.channels[0] + 1} {letter}{unit}"
        if len(group.channels) == 1 and (plant.direct or self.channel is not None):
            return f"{joint_names(plant)[group.channels[0]]} {letter}{unit}"
        if name in WORDS or (
            name == "s" and plant.mixed
        ):  # short: mixed plants have many panels, and low ones
            return f"{letter}{' on q' * (not group.driven)}{unit}"
        kind = {"rad": "angle", "m": "position"}[group.unit]
        return f"{KINDS.get(name, kind if group.driven else f'free {kind}')} {letter}{unit}"


def over_groups(traces: Sequence[Trace], quantity: str) -> list[Panel]:
    """Return the panels of a quantity over time, one for each group of channels that has it; a tip
    has one panel.
    """
    groups = style.split(traces)
    scenarios = [trace.scenario for trace in traces]
    if quantity in ("tip", "contact"):
        has = []
        for one in scenarios:
            has.append(tip.knows_contacts(one) if quantity == "contact" else bool(one.plant.tip))
        return [Panel(quantity, next(iter(groups)), traces)] * all(has)
    panels = [Panel(quantity, group, parts) for group, parts in groups.items()]
    if quantity == "reaction":
        return [
            panel
            for panel in panels
            if any(np.nan_to_num(part.reaction).any() for part in panel.traces)
        ]
    if quantity in ("x", "e", "v"):
        return panels
    if quantity == "force" and not any(one.actuator for one in scenarios):
        return []
    several = 2 if quantity == "spread" else 1
    return [
        panel for panel in panels if panel.group.driven and len(panel.group.channels) >= several
    ]


def worst_first(traces: Sequence[Trace]) -> list[Panel]:
    """Return a panel of the error of each channel, first that of the largest mean |e|, in scales of
    its group.
    """
    found = []
    for group, parts in style.split(traces).items():
        runs = [part for part in parts if part.diverged_at is None] or parts
        means = np.max(
            [np.nanmean(np.abs(part.x - part.r), axis=0) / scale(part) for part in runs], axis=0
        )
        found += zip(means.tolist(), by_channel(Panel("e", group, parts)), strict=True)
    return [panel for _, panel in sorted(found, key=lambda one: -one[0])]


def by_channel(panel: Panel) -> list[Panel]:
    """Return a panel for each channel of a panel's group whose error counts."""
    if panel.quantity in SINGLE:
        return [panel]
    panels = []
    scored = panel.traces[0].scenario.plant.scored_channels
    for k, i in enumerate(i for i in panel.group.channels if i in scored):
        place, channel = (dataclasses.replace(panel.group, channels=(j,)) for j in (k, i))
        panels.append(
            Panel(panel.quantity, channel, [group_trace(trace, place) for trace in panel.traces], i)
        )
    return panels


def actuators(traces: Sequence[Trace]) -> list[Panel]:
    """Return a panel of the force of each actuator of a free body, in their order, of those that
    push at all.
    """
    group, parts = next(iter(style.split(traces).items()))
    panels = []
    for j in np.flatnonzero(
        np.any([np.nan_to_num(part.u).any(axis=0) for part in parts], axis=0)
    ).tolist():
        one, first = (dataclasses.replace(group, channels=(i,)) for i in (j, 0))
        of = []
        for part in parts:
            of.append(dataclasses.replace(group_trace(part, first), u=part.u[:, j : j + 1]))
        panels.append(Panel("u", one, of, j))
    return panels


def strip(traces: Sequence[Trace]) -> list[Panel]:
    """Return the panels below a film, from left to right: x of each group of channels, the error, u
    of driven ones.

    Of arms: how far the tip is off its path, and the force of its contact, or else the error. Of a
    network: how far its channels are apart, the error and u. Of two joints of your own model: x and
    u of each; of more: the error and the largest u of a joint.
    """
    groups = list(style.split(traces).items())
    plant = traces[0].scenario.plant
    driven = [each for each in groups if each[0].driven]
    errors = [Panel("settling", *each) for each in driven]
    if of_tip := [panel for name in ("tip", "contact") for panel in over_groups(traces, name)]:
        if len(of_tip) > 1:
            return of_tip
        return [*of_tip, *errors]
    if all(len(group.channels) == 1 for group, _ in groups):
        errors = errors[: len(groups) < CROWDED_STRIP]
        return [
            *(Panel("x", *each) for each in groups),
            *errors,
            *(Panel("u", *each) for each in driven),
        ]
    if plant.direct and plant.n == plant.driven == 2:
        pairs = []
        for each in groups:
            pairs.append(zip(*(by_channel(Panel(name, *each)) for name in "xu"), strict=True))
        return [panel for joints in pairs for pair in joints for panel in pair]
    if plant.direct:
        names = ("settling", "largest")
    else:
        names = ("spread", "settling", "u")
    return [Panel(name, *each) for each in driven for name in names]


def meaning(panels: Sequence[Panel]) -> dict[str, str]:
    """Return the meaning of bands and lines that need an explanation: "band", "line", ... ->
    words.
    """
    n = max(
        (len(panel.group.channels) for panel in panels if panel.quantity not in SINGLE), default=1
    )
    banded = dict.fromkeys(panel.quantity for panel in panels if panel.quantity not in UNBANDED)
    windows = [mean_window(panel.traces) for panel in panels if panel.quantity == "u"]
    over = max(filter(None, windows), default=None)
    single = min(n, MAX_DRAWN_CHANNELS)
    words = {}
    if banded and (over or n > 1):
        words["band"] = f"range of {', '.join(banded).replace('force', 'delivered')}"
    if over:
        words["line"] = f"mean over {1e3 * over:.3g} ms where it chatters"
    if n > 1:
        if single == n:
            words["thin lines"] = f"the {n} channels"
        else:
            words["thin lines"] = f"{single} of {n} channels"
        words["thin lines"] += ", the slowest thick" * any(
            panel.quantity == "x" for panel in panels
        )
    if any(panel.quantity in PEAKS for panel in panels):
        words["peaks"] = f"largest in {1e3 * peak_window(panels[0].traces):.3g} ms"
    return words


def titles(panels: Sequence[Panel], heights: Sequence[float]) -> list[str]:
    """Return the labels of panels of these heights in points; the unit is on a second line if two
    would be close.
    """
    words = [panel.label for panel in panels]
    size = style.points(style.RC["font.size"])
    free = [height - style.width(text, size) for height, text in zip(heights, words, strict=True)]
    close = {i for i, (a, b) in enumerate(itertools.pairwise(free)) if (a + b) / 2 < size}
    return [
        text.replace(" (", "\n(") if {i - 1, i} & close else text for i, text in enumerate(words)
    ]


def curve(trace: Trace, y: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the line of a quantity y (K+1,): times in s, and values.

    A short trace is not smoothed.
    """
    if smoothed(trace):
        return line(trace.t, y, 0 if name in UNBANDED else window(trace))
    return (trace.t, y)


def smoothed(trace: Trace) -> bool:
    """Return whether the trace has too many samples to show each."""
    return trace.scenario.samples > COLUMNS


def mean_window(traces: Sequence[Trace]) -> float | None:
    """Return the longest window of the means of u, s; None if no u chatters visibly."""
    low, high = limits(traces, "u")
    times = []
    for trace in filter(smoothed, traces):
        lines = trace.u.T[drawn_channels(trace.u)]
        if any(
            np.abs(smooth(u, window(trace)) - u).max() > VISIBLE_CHATTERING * (high - low)
            for u in lines
        ):
            times.append(window(trace) * trace.scenario.control_period)
    return max(times, default=None)


def peaks(y: np.ndarray, trace: Trace) -> np.ndarray:
    """Return the largest of y (K+1,) within a window around each sample, (K+1, 1), or MIN_ERROR if
    that is more.
    """
    from scipy.ndimage import maximum_filter1d

    return np.maximum(maximum_filter1d(y, window(trace), mode="nearest"), MIN_ERROR)[:, None]


def peak_window(traces: Sequence[Trace]) -> float:
    """Return the longest time over which `peaks` are taken, s."""
    return max(window(trace) * trace.scenario.control_period for trace in traces)


def horizon(traces: Sequence[Trace]) -> float:
    """Return the time that panels of x, u and s show, s: the whole run, or the first part if all
    rest after it.

    Nothing changes or disturbs the plant after that part, and no reference moves.
    """
    whole = end(traces)
    last = 0.0
    for group, parts in style.split(traces).items():
        low, high = span(parts, "x")
        for trace in parts:
            moved = np.abs(trace.x - trace.x[-1]).max(axis=1) > REST_BAND * (high - low)
            acted = (trace.d != 0.0).any(axis=1) | (trace.r != trace.r[-1]).any(axis=1)
            last = max(
                last, *trace.t[moved | (acted & group.driven)][-1:], trace.diverged_at or 0.0
            )
        last = max([last, *(trace.scenario.jump.time for trace in parts if trace.scenario.jump)])
    if 0.0 < ZOOM * last < MAX_ZOOMED * whole:
        return ZOOM * last
    return whole


def until(trace: Trace, time: float) -> Trace:
    """Return the trace up to a time, s, with two samples at least."""
    count = max(2, int(np.searchsorted(trace.t, time + 1e-9)))
    return dataclasses.replace(
        trace, **{name: array[:count] for name, array in trace.arrays().items()}
    )


def over_time(
    ax: Axes,
    panel: Panel,
    colours: Sequence[str],
    among: Sequence[Trace] = (),
    bands: bool = True,
    names: Sequence[str] = (),
    reported: bool = True,
) -> list[Artist]:
    """Draw the panel with the first trace on top, set its vertical range, and return the artists of
    the traces.

    The reference of x is drawn in front, its settling band behind. Traces that agree from the start
    are drawn once, in ink, with words; their colours begin where they part. The traces `among` set
    the range, by default the panel's own; `bands`: whether to draw ranges behind the lines;
    `names`: of the traces, for the words; `reported`: whether to write them.
    """
    artists: list[Artist] = []
    name = panel.quantity
    traces = panel.traces
    means = [QUANTITIES[name](trace).mean(axis=1) for trace in traces]
    heights = limits(traces, name)
    exact = means
    if name in PEAKS:
        ax.set_yscale("log")
        ax.yaxis.set_minor_formatter(NullFormatter())
        exact = [np.log10(mean) for mean in means]
        heights = np.log10(heights)
    ax.set_ylim(limits(among or traces, name))
    set_numbers(ax.yaxis, panel._replace(traces=among or traces))
    if name == "reaction":
        clip_impacts(ax, panel, colours)
    if name in ("x", "e"):
        target(ax, panel)
    lines = [curve(trace, mean, name) for trace, mean in zip(traces, means, strict=True)]
    shared: list[Agreement] = []
    if name in SINGLE or len(panel.group.channels) == 1:
        places = [(trace.t, y) for trace, y in zip(traces, exact, strict=True)]
        shared = agreements(places, float(np.ptp(heights)))
    starts = partings(shared, len(lines))
    for trace, colour, mean, path, start in reversed(
        list(zip(traces, colours, means, lines, starts, strict=True))
    ):
        y = QUANTITIES[name](trace)
        look: dict[str, Any] = {"color": colour, "drawstyle": steps(trace, name)}
        if bands and name not in UNBANDED:
            artists.append(ax.fill_between(*band(trace.t, y), color=colour, alpha=0.22, lw=0))
        if y.shape[1] > 1:
            artists += channels(ax, trace, y, name, look)
        else:
            artists += ax.plot(*between(path, start, np.inf), lw=style.points(LINE), **look)
        # a trace that is cut to a close-up may end before its run failed
        end = trace.t[-1] + trace.scenario.control_period
        if trace.diverged_at is not None and end > trace.diverged_at - 1e-9:
            last = np.clip(mean[-1], *ax.get_ylim())
            look: dict[str, Any] = {"color": colour, "clip_on": False, "zorder": 5, **cross()}
            artists += ax.plot(trace.t[-1], last, "X", **look)
    for (first, *_), start, stop in shared:
        look: dict[str, Any] = {"color": style.INK, "drawstyle": steps(traces[first], name)}
        look["gid"] = AGREED
        path = between(lines[first], start, stop)
        artists += ax.plot(*path, lw=style.points(LINE), **look)
    tell_agreements(ax, shared if reported else [], lines, names)
    return artists


def steps(trace: Trace, name: str) -> str:
    """Return how a line of a quantity goes from sample to sample: u is held."""
    return "steps-post" if name == "u" and not smoothed(trace) else "default"


def channels(
    ax: Axes, trace: Trace, y: np.ndarray, name: str, look: Mapping[str, Any]
) -> list[Artist]:
    """Draw the channels of y, (K+1, n), one by one, the slowest x thick."""
    artists: list[Artist] = []
    slowest = -1
    if name == "x":
        slowest = int(np.nansum(np.abs(y - trace.r), axis=0).argmax())
    for i in sorted({*drawn_channels(y).tolist(), slowest} - {-1}):
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


def cross() -> dict[str, Any]:
    """Return the look of the mark at the end of a failed run."""
    return {"ms": style.points(9), "mec": "white", "mew": style.points(1)}


Agreement = tuple[list[int], float, float]  # of these lines, from one time to another, s


def agreements(lines: Sequence[tuple[np.ndarray, np.ndarray]], height: float) -> list[Agreement]:
    """Return until when all lines (times and values) agree in a panel of this height, and which of
    them never part.
    """
    first, last = span_of(lines)
    until = []
    for one in lines:
        until.append([_parting(one, other, COINCIDENT_DISTANCE * height) for other in lines])
    groups: list[list[int]] = []
    for i in range(len(lines)):
        group = next((group for group in groups if until[group[0]][i] >= last), None)
        groups.append([i]) if group is None else group.append(i)
    stop = min(until[0])
    together = first < stop < last and stop - first >= MIN_AGREEMENT * (last - first)
    start = stop if together else first
    whole = [([*range(len(lines))], first, stop)] * (together and len(lines) > 1)
    return [*whole, *((group, start, last) for group in groups if len(group) > 1)]


def span_of(lines: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[float, float]:
    """Return the first and the last time of lines; 0 for lines without points."""
    times = np.concatenate([t for t, _ in lines])
    if times.size:
        return (float(times.min()), float(times.max()))
    return (0.0, 0.0)


def partings(shared: Sequence[Agreement], count: int) -> list[float]:
    """Return until when each of `count` lines agrees with another; -inf for none."""
    return [
        max((stop for who, _, stop in shared if i in who), default=-np.inf) for i in range(count)
    ]


def _parting(
    one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray], apart: float
) -> float:
    """Return until when, s, but for a small share of their points, two lines are no farther than
    `apart` apart.
    """
    t = one[0][one[0] <= other[0].max(initial=-np.inf) + 1e-9]
    if not t.size:
        return -np.inf
    near = np.abs(np.interp(t, *other) - one[1][: len(t)]) <= apart
    share = np.cumsum(near) / np.arange(1, len(t) + 1)
    return float(t[near & (share >= COINCIDENT_SHARE)].max(initial=-np.inf))


def between(
    path: tuple[np.ndarray, np.ndarray], start: float, stop: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the part of a line between two times, s, with its ends; nothing if it ends before."""
    t, y = path
    if not t.size or start >= t[-1]:
        return t[:0], y[:0]
    at = np.unique([*t[(t >= start) & (t <= stop)], *np.clip([start, stop], t[0], t[-1])])
    return at, np.interp(at, t, y)


def tell_agreements(
    ax: Axes,
    shared: Sequence[Agreement],
    lines: Sequence[tuple[np.ndarray, np.ndarray]],
    names: Sequence[str],
    unit: str = "s",
) -> None:
    """Write which traces each line in ink shows, and until when, in rows where fewer of the curves
    are.
    """
    (first, last), size = span_of(lines), style.points(9.0)
    if 72 * ax.get_window_extent().height / ax.figure.dpi < MIN_WORDS * size:
        return
    middle = float(
        np.mean([np.interp(0.5 * (first + last), *path) for path in lines if len(path[0])] or [0.0])
    )
    top = ax.transLimits.transform(ax.transScale.transform(np.array([last, middle])))[1] < 0.5
    for k, (who, _, stop) in enumerate(shared):
        if names:
            few = joined([names[i] for i in who])
        else:
            few = f"{len(who)} of {len(lines)}"
        parts = stop < last - 1e-9
        if len(who) == len(lines):
            words = ALL.get(len(who), f"all {len(who)}")
        else:
            words = few
        if parts:
            words += f" agree until {stop:.3g} {unit}"
        else:
            words += " agree"
        room = 72 * ax.get_window_extent().width / ax.figure.dpi
        if not (style.width(words, size) < room):
            words = words.replace(" agree", "")
        words = style.cropped(words, room, size)
        wide = style.width(words, size)
        gap = 0.4 * size
        start, parting, whole = ax.xaxis.get_transform().transform(np.array([first, stop, last]))
        ends = room * float((parting - start) / (whole - start)) - gap
        left = ends > wide  # of where they part
        if left:
            x = ends
        else:
            x = min(ends + 2.0 * gap, room - wide)
        down = (-1 if top else 1) * size * (0.4 + 1.3 * k)
        look = {
            "ha": "right" if left else "left",
            "va": "top" if top else "bottom",
            "fontsize": size,
        }
        look |= {
            "bbox": {"facecolor": style.PAPER, "edgecolor": "none", "alpha": 0.7, "pad": 0.5},
            "in_layout": False,
        }
        place = (x / room, 1.0 if top else 0.0), (0.0, down), "axes fraction", "offset points"
        ax.annotate(words, *place, parse_math=False, **look)
        if parts:
            ax.axvline(stop, color=style.RULE, lw=style.points(0.9), zorder=1.5)


def clip_impacts(ax: Axes, panel: Panel, colours: Sequence[str]) -> None:
    """Fit the vertical range to lasting reactions.

    Mark short impacts outside it and print their size.
    """
    sizes = [np.abs(trace.reaction[np.isfinite(trace.reaction)]) for trace in panel.traces]
    peak = max(size.max(initial=0.0) for size in sizes)
    levels = [float(np.quantile(size, LASTING_QUANTILE)) for size in sizes if size.size]
    usual = max(*levels, *map(abs, span(panel.traces, "u")))
    if not peak > 2.0 * usual > 0.0:
        return
    top = 1.16 * usual
    ax.set_ylim(-top, top)
    for trace, colour in zip(panel.traces, colours, strict=True):
        for side, mark in ((1, 2), (-1, 3)):  # matplotlib's ticks up and down, outside the axes
            beyond = (np.nan_to_num(side * trace.reaction).max(axis=1) > top).astype(int)
            starts = trace.t[np.flatnonzero(np.diff(beyond, prepend=0) > 0)]
            look = {
                "marker": mark,
                "ls": "",
                "color": colour,
                "ms": style.points(5),
                "mew": style.points(1.2),
            }
            ax.plot(
                starts, np.full(len(starts), side * top), clip_on=False, in_layout=False, **look
            )
    note(ax, f"|reaction| up to {style.short(peak, 3)} {style.units(panel.group)['force']}")


def note(ax: Axes, words: str) -> None:
    """Print words above the right end of the axes."""
    ax.set_title(
        words, loc="right", fontweight="normal", fontsize=style.points(9.5), color=style.MUTED
    )


def references(traces: Sequence[Trace]) -> list[tuple[Trace, np.ndarray, np.ndarray]]:
    """Return the longest trace of each reference, with its times (K+1,) and values (K+1,), the mean
    of its channels.
    """
    longest = sorted(traces, key=lambda trace: len(trace.t))
    found = []
    for trace in {trace.scenario.resolved.reference: trace for trace in longest}.values():
        r = trace.r.mean(axis=1)
        found.append((trace, trace.t[np.isfinite(r)], r[np.isfinite(r)]))
    return [each for each in found if len(each[1])]


def target(ax: Axes, panel: Panel) -> None:
    """Draw each reference (zero for an error) as long as a run has it, and its settling band."""
    bottom, top = ax.get_ylim()
    for trace, times, values in references(panel.traces):
        (t, r), half = (
            line(times, values if panel.quantity == "x" else 0.0 * values, 2),
            SETTLING_BAND * scale(trace),
        )
        if not (r - half < bottom).all() or not (r + half > top).all():  # else it is the background
            ax.fill_between(t, r - half, r + half, color=style.BAND, lw=0, zorder=1)
        ax.plot(
            t, r, color=style.INK, lw=style.points(0.8), ls=(0, (4, 4)), zorder=3, gid=REFERENCE
        )


def mark(ax: Axes, changes: Mapping[float, str], named: bool) -> None:
    """Mark when plants change or arms are hit, time in s -> words; with the words above the axes if
    `named`.
    """
    last = ax.get_xlim()[1]
    size = style.points(9)
    room = ax.get_window_extent().width * 72 / ax.figure.dpi  # points
    ends: list[float] = []  # of the words in each row above the axes, in points
    for time, change in sorted(changes.items()):
        ax.axvline(time, color=style.INK, lw=style.points(0.9), ls=(0, (2, 2)), zorder=1.5)
        if not named:
            continue
        words = style.cropped(change, room, size)
        width = style.width(words, size)
        at = room * time / last
        begin = min(at, room - width)
        row = next((row for row, end in enumerate(ends) if end < begin), len(ends))
        ends[row:] = [begin + width + size]
        place = (begin - at, 2 + 1.2 * size * row)
        look = {"va": "bottom", "fontsize": size, "parse_math": False}
        ax.annotate(words, (time, 1.0), place, ("data", "axes fraction"), "offset points", **look)


def phase(ax: Axes, panel: Panel, colours: Sequence[str]) -> None:
    """Draw v over x of a panel's traces, and of a reference that moves.

    A ring marks the start of a trace.
    """
    traces = panel.traces
    speed = panel._replace(quantity="v")
    for axis, words in ((ax.xaxis, panel), (ax.yaxis, speed)):
        set_numbers(axis, words)
        axis.set_label_text(words.label)
    (left, right), (low, high) = limits(traces, "x"), limits(traces, "v")
    ax.set_xlim(left, right)
    one = traces[0].x.shape[1] == 1
    places = [
        (trace.t, trace.x[:, 0] / (right - left) + 1j * trace.v[:, 0] / (high - low))
        for trace in traces
    ]
    shared = agreements(places, 1.0) if one else []
    width = style.points(LINE if one else LIGHT_LINE)
    for trace, colour, start in reversed(
        list(zip(traces, colours, partings(shared, len(traces)), strict=True))
    ):
        shown = drawn_channels(trace.x)
        later = trace.t >= start
        for x, v in zip(trace.x.T[shown], trace.v.T[shown], strict=True):
            ax.plot(x[later], v[later], color=colour, lw=width)
            ax.plot(x[0], v[0], "o", color=colour, mfc="white", ms=style.points(6), zorder=4)
        if trace.diverged_at is not None:
            ax.plot(trace.x[-1, 0], trace.v[-1, 0], "X", color=colour, zorder=5, **cross())
    for (first, *_), start, stop in shared:
        part = (traces[first].t >= start) & (traces[first].t <= stop)
        ax.plot(
            traces[first].x[part, 0],
            traces[first].v[part, 0],
            color=style.INK,
            lw=width,
            gid=AGREED,
        )
    ax.axhline(0.0, color=style.RULE, lw=style.points(0.9), zorder=1)
    ax.axvline(0.0, color=style.RULE, lw=style.points(0.9), zorder=1)
    for trace, _, r in references(traces):
        if len(r) > 1:
            dr = np.gradient(r, trace.scenario.control_period)
        else:
            dr = 0.0 * r
        steady = np.abs(dr) <= JUMP_RATIO * np.quantile(
            np.abs(dr), 0.99
        )  # where the reference does not jump
        dr = dr[steady]
        if dr.any():
            ax.plot(
                r[steady],
                dr,
                color=style.INK,
                lw=style.points(0.8),
                ls=(0, (4, 4)),
                zorder=3,
                gid=REFERENCE,
            )
            low, high = min(low, 1.05 * dr.min()), max(high, 1.05 * dr.max())
    ax.set_ylim(low, high)


def last_samples(
    ax: Axes,
    panel: Panel,
    colours: Sequence[str],
    among: Sequence[Trace],
    names: Sequence[str] = (),
) -> None:
    """Draw the last samples of u of the first channel, each held until the next, of the longest run
    of `among`.
    """
    traces = panel.traces
    stop = end(among)
    set_numbers(ax.yaxis, panel._replace(traces=among))
    begin = max(0.0, stop - LAST_SAMPLES * max(trace.scenario.control_period for trace in among))
    lines = []
    for trace in traces:
        part = slice(int(np.searchsorted(trace.t, begin - 1e-9)), None)
        lines.append((1e3 * (trace.t[part] - stop), trace.u[part, 0]))
    shown = np.concatenate([u for _, u in lines])
    if shown.size:
        low = shown.min()
        high = shown.max()
        half = max(0.62 * (high - low), MIN_CLOSE_UP / 2 * max(map(abs, span(traces, "u")))) or 1.0
        ax.set_ylim((low + high) / 2 - half, (low + high) / 2 + half)
    shared = agreements(lines, float(np.ptp(ax.get_ylim())))
    for path, colour, since in reversed(
        list(zip(lines, colours, partings(shared, len(lines)), strict=True))
    ):
        ax.step(*between(path, since, np.inf), where="post", color=colour, lw=style.points(LINE))
    for who, since, until in shared:
        path = between(lines[who[0]], since, until)
        ax.step(*path, where="post", color=style.INK, lw=style.points(LINE), gid=AGREED)
    tell_agreements(ax, shared, lines, names, "ms")
    if all(trace.diverged_at is not None for trace in traces):
        if len(traces) == 1:
            words = "the run failed"
        else:
            words = "all runs failed"
        ax.text(
            0.5, 0.5, words, transform=ax.transAxes, ha="center", va="center", color=style.MUTED
        )
        ax.tick_params(labelleft=False)
    ax.set_xlim(1e3 * (begin - stop), 0.0)


def crowded(panel: Panel) -> bool:
    """Return whether each trace needs a row: it has several channels, or more than MAX_BANDS bands
    of u are wide.
    """
    if len(panel.group.channels) > 1 and panel.quantity not in SINGLE:
        return len(panel.traces) > 1
    if panel.quantity != "u":
        return False
    low, high = limits(panel.traces, "u")
    wide = 0
    for trace in panel.traces:
        _, least, most = band(trace.t, trace.u)
        wide += float(np.mean(most - least)) > MIN_WIDE_BAND * (high - low)
    return wide > MAX_BANDS


def drawn_channels(y: np.ndarray) -> np.ndarray:
    """Return the indices of the channels of y, (K + 1, n), that are drawn one by one.

    Those of its least and largest value are among them, so that their curves reach as far as those
    of all.
    """
    n = y.shape[1]
    if n <= MAX_DRAWN_CHANNELS:
        return np.arange(n)
    extremes = [int(np.nanargmin(y)) % n, int(np.nanargmax(y)) % n]
    return np.unique(
        [*np.linspace(0, n - 1, MAX_DRAWN_CHANNELS - 2).round().astype(int), *extremes]
    )


def lasting(traces: Sequence[Trace], name: str) -> list[np.ndarray]:
    """Return the values of successful runs; if there are none, of failed ones without their
    ends.
    """
    values = [QUANTITIES[name](trace) for trace in traces if trace.diverged_at is None]
    if not values:
        shares = [UNDIVERGED_SHARE if trace.plant_diverged else 1.0 for trace in traces]
        whole = [QUANTITIES[name](trace) for trace in traces]
        values = [y[: max(1, int(share * len(y)))] for y, share in zip(whole, shares, strict=True)]
    return [y for y in values if np.isfinite(y).all()]


def span(traces: Sequence[Trace], name: str) -> tuple[float, float]:
    """Return the least and largest value of the runs that last."""
    values = lasting(traces, name) or [np.zeros(1)]
    return float(min(y.min() for y in values)), float(max(y.max() for y in values))


def limits(traces: Sequence[Trace], name: str) -> tuple[float, float]:
    """Return the vertical range for a quantity: its span with the reference (zero for an error),
    and a margin.
    """
    low, high = span(traces, name)
    if name == "x":
        r = np.concatenate([trace.r[np.isfinite(trace.r)] for trace in traces])
        low, high = min(low, r.min(initial=low)), max(high, r.max(initial=high))
    if name == "e":
        low, high = min(low, 0.0), max(high, 0.0)
    if name in PEAKS:
        high = max(high, MIN_RATIO * MIN_ERROR)
        return min(max(low, MIN_ERROR), high / MIN_RATIO) / 1.5, high * 1.5
    air = MARGIN * (high - low) or 1.0
    return low - air, high + air
