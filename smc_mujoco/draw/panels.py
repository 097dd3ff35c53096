"""Panels of figures and films: a quantity of several traces over time, a phase portrait, the last samples of u.

Traces are cut to their finite samples (decimate.finite) and to a group of channels (style.split). Over time, the line
is the mean of the channels, and where it chatters also a mean over a window of time (decimate.smooth). The band behind
it is the range within a column of the picture, of u and s over all channels. Single channels of a network are light.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from smc_mujoco.draw import style
from smc_mujoco.draw.decimate import columns, end, line, stretches, window
from smc_mujoco.draw.states import HOLD, at_rest, has_dry_friction
from smc_mujoco.metrics.channel_groups import Group
from smc_mujoco.metrics.conventions import BAND, scale
from smc_mujoco.simulation.reference import LEFT_THE_WORLD
from smc_mujoco.simulation.trace import Trace

COLUMNS = 360  # of a panel
LAST_SAMPLES = 60  # control samples in the close-up of u
MIN_CLOSE_UP = 0.02  # height of the close-up, as a share of the largest |u|: hides round-off; chosen
MAX_LIGHT = 9  # channels of a network that are drawn one by one
LASTING = 0.98  # quantile of |reaction| that a panel shows in full; what is larger are blows; chosen
MAX_RESTS = 12  # marked in a phase portrait
SPACING = 1 / 200  # of points in a phase portrait, as a share of its diagonal
REALISM = ("force", "reaction")  # quantities of realistic mechanisms alone
UNBANDED = ("x", "spread")  # drawn sample by sample, without a mean over time

QUANTITIES: dict[str, Callable[[Trace], np.ndarray]] = {  # name -> (K+1, n)
    "x": lambda trace: trace.x,
    "v": lambda trace: trace.v,
    "u": lambda trace: trace.u,
    "applied": lambda trace: trace.applied,
    "d": lambda trace: trace.d,
    "s": lambda trace: trace.s,
    "force": lambda trace: trace.force,
    "reaction": lambda trace: trace.reaction,
    "spread": lambda trace: np.ptp(trace.x, axis=1, keepdims=True),
}


class Panel(NamedTuple):
    """A quantity of a group of channels over time."""

    quantity: str
    group: Group
    traces: Sequence[Trace]  # of these channels alone

    @property
    def label(self) -> str:
        """The label of the vertical axis, with its unit."""
        name, group, plant = self.quantity, self.group, self.traces[0].scenario.plant
        mean = "mean " * (len(group.channels) > 1)
        unit = f" ({style.units(group)[{'spread': 'x', 'force': 'u', 'reaction': 'u'}.get(name, name)]})"
        if name == "spread":
            return f"max − min x{unit}"
        if name in REALISM:
            return f"{mean}{'delivered' if name == 'force' else 'reaction'}{' on q' * (not group.driven)}{unit}"
        if name == "s" and plant.free:
            return f"{mean}sliding variable s"  # of both joints, in a unit that depends on the law
        if name == "s" and plant.mixed:
            return f"{mean}s{unit}"  # short: there are many such panels, and they are low
        kind = {"rad": "angle", "m": "position"}[group.unit]
        kind = {"x": kind if group.driven else f"free {kind}", "v": "velocity", "u": "control", "s": "sliding variable"}
        letter = name if group.driven else {"x": "q", "v": "q′"}.get(name, name)
        return f"{mean or kind[name] + ' '}{letter}{unit}"


def overview(traces: Sequence[Trace]) -> list[Panel]:
    """Return the panels of a figure, from top to bottom; of realistic mechanisms also what acts on the joints."""
    groups = style.split(traces)
    driven = {group: parts for group, parts in groups.items() if group.driven}
    panels = []
    for group, parts in groups.items():
        spread = ["spread"] * (group.driven and len(group.channels) > 1)
        panels += [Panel(name, group, parts) for name in ("x", *spread)]
    for group, parts in driven.items():
        force = ["force"] * any(trace.scenario.actuator for trace in traces)
        panels += [Panel(name, group, parts) for name in ("u", *force)]
    for group, parts in groups.items():
        panels += [Panel("reaction", group, parts)] * any(np.nan_to_num(part.reaction).any() for part in parts)
    return panels + [Panel("s", group, parts) for group, parts in driven.items()]


def strip(traces: Sequence[Trace]) -> list[Panel]:
    """Return the panels below a film, from left to right: x of each group of channels, and u of the driven ones."""
    groups = style.split(traces).items()
    return [Panel("x", *each) for each in groups] + [Panel("u", *each) for each in groups if each[0].driven]


def meaning(panels: Sequence[Panel]) -> dict[str, str]:
    """Return what bands and lines mean, where it needs words: "band", "line", "light" -> words."""
    n = max(len(panel.group.channels) for panel in panels)
    banded = dict.fromkeys(panel.quantity for panel in panels if panel.quantity not in UNBANDED)
    windows = [mean_window(panel.traces) for panel in panels if panel.quantity == "u"]
    over, single, words = max(filter(None, windows), default=None), len(light(n)), {}
    if banded and (over or n > 1):
        words["band"] = f"range of {', '.join(banded).replace('force', 'delivered')}"
    if over:
        words["line"] = f"mean over {1e3 * over:.3g} ms where it chatters"
    if n > 1:
        words["light"] = "single channels" if single == n else f"{single} of {n} channels"
    return words


def titles(panels: Sequence[Panel], pitch: float) -> list[str]:
    """Return the labels of panels `pitch` points apart; the unit is on a second line if two would touch."""
    words = [panel.label for panel in panels]
    wide = [style.width(text, style.RC["font.size"]) for text in words]
    close = {i for i, (a, b) in enumerate(itertools.pairwise(wide)) if (a + b) / 2 > pitch - 4}
    return [text.replace(" (", "\n(") if {i - 1, i} & close else text for i, text in enumerate(words)]


def layers(traces: Sequence[Trace], colours: Sequence[str]) -> list[tuple[Trace, str, float]]:
    """Return the traces from bottom to top, their colours, and how much wider their lines are.

    The first is on top, each one below is a little wider, so that curves which coincide are all seen.
    """
    return [(trace, colours[i], 0.5 * i) for i, trace in reversed(list(enumerate(traces)))]


def curve(trace: Trace, y: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the line of a quantity y (K+1,): times in s, and values. Few samples are drawn as they are."""
    return line(trace.t, y, 0 if name in UNBANDED else window(trace)) if smoothed(trace) else (trace.t, y)


def smoothed(trace: Trace) -> bool:
    """Return whether the trace has too many samples to show each."""
    return trace.scenario.samples > COLUMNS


def mean_window(traces: Sequence[Trace]) -> float | None:
    """Return the longest time that lines of u are means over, s; None if no u chatters."""
    times = [
        window(trace) * trace.scenario.control_period
        for trace in traces
        if smoothed(trace) and stretches(trace.u.mean(axis=1), window(trace))
    ]
    return max(times, default=None)


def over_time(ax: Axes, panel: Panel, colours: Sequence[str]) -> list[Artist]:
    """Draw the panel, set its vertical range, and return the artists of the traces."""
    artists: list[Artist] = []
    name = panel.quantity
    ax.set_ylim(limits(panel.traces, name))
    if name == "reaction":
        clip_blows(ax, panel)
    for trace, colour, wider in layers(panel.traces, colours):
        y, steps = QUANTITIES[name](trace), "default" if smoothed(trace) or name != "u" else "steps-post"
        mean = y.mean(axis=1)
        e = columns(trace.t, mean[:, None] if name == "x" else y, COLUMNS)
        artists.append(ax.fill_between(e.t, e.low.min(axis=1), e.high.max(axis=1), color=colour, alpha=0.22, lw=0))
        if y.shape[1] > 1:
            for i in light(y.shape[1]):
                artists += ax.plot(*curve(trace, y[:, i], name), color=colour, alpha=0.3, lw=0.8, drawstyle=steps)
        artists += ax.plot(*curve(trace, mean, name), color=colour, lw=1.5 + wider, drawstyle=steps)
        if trace.diverged_at is not None:
            last = np.clip(mean[-1], *ax.get_ylim())
            artists += ax.plot(trace.t[-1], last, "X", color=colour, ms=9, mec="white", clip_on=False, zorder=5)
    return artists


def clip_blows(ax: Axes, panel: Panel) -> None:
    """Fit the vertical range to what lasts of a reaction, and print the size of blows, which are short, beyond it."""
    sizes = [np.abs(trace.reaction[np.isfinite(trace.reaction)]) for trace in panel.traces]
    peak = max(size.max(initial=0.0) for size in sizes)
    lasting = [float(np.quantile(size, LASTING)) for size in sizes if size.size]
    usual = max(*lasting, *map(abs, span(panel.traces, "u")))
    if peak > 2.0 * usual > 0.0:
        ax.set_ylim(-1.16 * usual, 1.16 * usual)
        words = f"blows up to {style.short(peak, 3)} {style.units(panel.group)['u']}"
        ax.set_title(words, loc="right", fontweight="normal", fontsize=9.5, color=style.MUTED)


def rests(trace: Trace) -> list[int]:
    """Return the last samples of the latest times when dry friction holds all channels, for HOLD s or longer."""
    if not trace.scenario.realistic or not has_dry_friction(trace.scenario):
        return []
    still = at_rest(trace).all(axis=1)
    edges = np.flatnonzero(np.diff(still.astype(int), prepend=0, append=0)).reshape(-1, 2)
    long = [int(last) for first, last in edges - (0, 1) if trace.t[last] - trace.t[first] >= HOLD]
    return long[-MAX_RESTS:]


def target(ax: Axes, traces: Sequence[Trace]) -> None:
    """Draw each reference to the end of the longest run that has it, and the settling band around it."""
    for trace in {trace.scenario.reference: trace for trace in sorted(traces, key=lambda trace: len(trace.t))}.values():
        if np.isfinite(trace.r).all():
            (t, r), half = line(trace.t, trace.r[:, 0], 2), BAND * scale(trace)
            ax.fill_between(t, r - half, r + half, color=style.BAND, lw=0, zorder=1)
            ax.plot(t, r, color=style.MUTED, lw=0.9, ls=(0, (5, 3)), zorder=1.5)


def jumps(ax: Axes, changes: Mapping[float, str], named: bool) -> None:
    """Mark when plants change, time in s -> words; with the words if `named`."""
    for time, words in changes.items():
        ax.axvline(time, color=style.INK, lw=0.9, ls=(0, (2, 2)), zorder=1.5)
        if named:
            ax.annotate(
                words,
                (time, 1.0),
                (4, -3),
                ("data", "axes fraction"),
                "offset points",
                va="top",
                fontsize=9,
                bbox={"facecolor": style.PAPER, "alpha": 0.8, "pad": 1, "lw": 0},
                parse_math=False,
                zorder=4,
            )


def phase(ax: Axes, traces: Sequence[Trace], colours: Sequence[str], held: Sequence[Sequence[int]]) -> None:
    """Draw v over x: a ring at the start of each trace, a diamond at each sample in `held`, where friction holds it."""
    for (trace, colour, wider), samples in zip(layers(traces, colours), reversed(held), strict=True):
        x, v = QUANTITIES["x"](trace), QUANTITIES["v"](trace)
        if x.shape[1] > 1:
            for i in light(x.shape[1]):
                ax.plot(*thinned(x[:, i], v[:, i]), color=colour, alpha=0.3, lw=0.7)
        x, v = x.mean(axis=1), v.mean(axis=1)
        ax.plot(*thinned(x, v), color=colour, lw=1.4 + wider)
        ax.plot(x[0], v[0], "o", color=colour, mfc="white", ms=6, zorder=4)
        for sample in samples:
            ax.plot(x[sample], 0.0, "D", color=colour, ms=5.5, mec=style.PAPER, zorder=4)
        if trace.diverged_at is not None:
            ax.plot(x[-1], v[-1], "X", color=colour, ms=9, mec="white", zorder=5)
    ax.axhline(0.0, color=style.RULE, lw=0.9, zorder=1)
    ax.axvline(0.0, color=style.RULE, lw=0.9, zorder=1)
    ax.set_xlim(limits(traces, "x"))
    ax.set_ylim(limits(traces, "v"))


def last_samples(ax: Axes, traces: Sequence[Trace], colours: Sequence[str]) -> None:
    """Draw the last samples of u of the first channel, each held until the next."""
    period = max(trace.scenario.control_period for trace in traces)
    stop = end(traces)
    begin = max(0.0, stop - LAST_SAMPLES * period)
    for trace, colour, wider in layers(traces, colours):
        part = slice(int(np.searchsorted(trace.t, begin - 1e-9)), None)
        ax.step(1e3 * (trace.t[part] - stop), trace.u[part, 0], where="post", color=colour, lw=1.2 + wider)
    if all(trace.diverged_at is not None for trace in traces):
        ax.text(0.5, 0.5, "no run lasted", transform=ax.transAxes, ha="center", color=style.MUTED)
    ax.set_xlim(1e3 * (begin - stop), 0.0)
    low, high = ax.dataLim.intervaly
    if low <= high:
        half = max(0.62 * (high - low), MIN_CLOSE_UP / 2 * max(map(abs, span(traces, "u")))) or 1.0
        ax.set_ylim((low + high) / 2 - half, (low + high) / 2 + half)


def light(n: int) -> np.ndarray:
    """Return the indices of those of n channels that are drawn one by one."""
    return np.unique(np.linspace(0, n - 1, min(n, MAX_LIGHT)).round().astype(int))


def thinned(x: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a curve with points evenly apart on paper."""
    step = np.hypot(np.diff(x) / (np.ptp(x) or 1.0), np.diff(v) / (np.ptp(v) or 1.0))
    place = np.floor(np.concatenate([[0.0], np.cumsum(step)]) / SPACING)
    keep = np.append(np.flatnonzero(np.diff(place, prepend=-1.0)), len(x) - 1)
    keep = keep[:: max(1, len(keep) // 4000)]
    return x[keep], v[keep]


def span(traces: Sequence[Trace], name: str) -> tuple[float, float]:
    """Return the least and largest value of the runs that lasted; if none did, of all but the ends of diverged ones."""
    seen = [QUANTITIES[name](trace) for trace in traces if trace.diverged_at is None]
    for trace in traces if not seen else ():
        y = QUANTITIES[name](trace)
        left = trace.failure is None or trace.failure.startswith(LEFT_THE_WORLD)
        seen.append(y[: max(1, int(0.8 * len(y)))] if left else y)
    seen = [y for y in seen if np.isfinite(y).all()] or [np.zeros(1)]
    return float(min(y.min() for y in seen)), float(max(y.max() for y in seen))


def limits(traces: Sequence[Trace], name: str) -> tuple[float, float]:
    """Return the vertical range for a quantity: its span with some margin."""
    low, high = span(traces, name)
    air = 0.08 * (high - low) or 1.0
    return low - air, high + air
