"""What one pair of axes shows: a quantity of several traces over time, their phase portrait, the last samples of u.

Traces come cut to what is finite (envelope.finite) and to a group of channels (style.split). Over time, a curve is the
mean of the channels, and where it chatters its mean over a window of time too (envelope.py); the band behind it is the
range in a column of the picture, of u and s over all channels. Single channels of a network are light.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from smc_mujoco.draw import style
from smc_mujoco.draw.decimate import columns, end, line, stretches, window
from smc_mujoco.draw.states import HOLD, resting, rubs
from smc_mujoco.metrics.channel_groups import Group
from smc_mujoco.metrics.conventions import BAND, scale
from smc_mujoco.simulation.reference import LEFT_THE_WORLD
from smc_mujoco.simulation.trace import Trace

COLUMNS = 360  # of a panel
LAST = 60  # control samples in the close-up of u
LEAST = 0.02  # of the largest |u| of the runs: the close-up is no less high, so that it shows no round-off; chosen
LIGHT = 9  # channels of a network drawn one by one
BRIEF = 0.98  # of a run: a reaction that is larger for the rest of it is blows; chosen
MARKED = 12  # rests in a phase portrait
FINE = 1 / 200  # of a phase portrait's diagonal: how far apart its points are

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


def layers(traces: Sequence[Trace], colours: Sequence[str]) -> list[tuple[Trace, str, float]]:
    """Traces from the bottom to the top with their colours and how much wider their lines are.

    The first is on top, each one below is a little wider: curves that coincide all show.
    """
    return [(trace, colours[i], 0.5 * i) for i, trace in reversed(list(enumerate(traces)))]


def curve(trace: Trace, y: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """The line of a quantity y (K+1,) on paper. Few samples are drawn as they are, and so is where a joint is."""
    width = 0 if name in ("x", "spread") else window(trace)
    return line(trace.t, y, width) if smoothed(trace) else (trace.t, y)


def smoothed(trace: Trace) -> bool:
    """Whether the trace has too many samples to show each."""
    return trace.scenario.samples > COLUMNS


def mean_window(traces: Sequence[Trace]) -> float | None:
    """Over how many s the lines of u are means; None where no u chatters."""
    found = [
        window(trace) * trace.scenario.control_period
        for trace in traces
        if smoothed(trace) and stretches(QUANTITIES["u"](trace).mean(axis=1), window(trace))
    ]
    return max(found, default=None)


def over_time(ax: Axes, traces: Sequence[Trace], colours: Sequence[str], name: str, group: Group) -> list[Artist]:
    """Draw a quantity of every trace, which are those of a group, and set the vertical range."""
    drawn: list[Artist] = []
    ax.set_ylim(limits(traces, name))
    if name == "reaction":
        blows(ax, traces, style.units(group)["u"])
    for trace, colour, wider in layers(traces, colours):
        y, held = QUANTITIES[name](trace), "default" if smoothed(trace) or name != "u" else "steps-post"
        mean = y.mean(axis=1)
        e = columns(trace.t, mean[:, None] if name == "x" else y, COLUMNS)
        drawn.append(ax.fill_between(e.t, e.low.min(axis=1), e.high.max(axis=1), color=colour, alpha=0.22, lw=0))
        if y.shape[1] > 1:
            for i in light(y.shape[1]):
                drawn += ax.plot(*curve(trace, y[:, i], name), color=colour, alpha=0.3, lw=0.8, drawstyle=held)
        drawn += ax.plot(*curve(trace, mean, name), color=colour, lw=1.5 + wider, drawstyle=held)
        if trace.diverged_at is not None:
            last = np.clip(mean[-1], *ax.get_ylim())
            drawn += ax.plot(trace.t[-1], last, "X", color=colour, ms=9, mec="white", clip_on=False, zorder=5)
    return drawn


def blows(ax: Axes, traces: Sequence[Trace], unit: str) -> None:
    """Show what lasts of a reaction, and tell of the blows beyond it, which are short and would squash the rest."""
    sizes = [np.abs(trace.reaction[np.isfinite(trace.reaction)]) for trace in traces]
    peak = max(size.max(initial=0.0) for size in sizes)
    usual = max(*(float(np.quantile(size, BRIEF)) for size in sizes if size.size), *map(abs, span(traces, "u")))
    if peak > 2.0 * usual > 0.0:
        ax.set_ylim(-1.16 * usual, 1.16 * usual)
        words = f"blows up to {style.short(peak, 3)} {unit}"
        ax.set_title(words, loc="right", fontweight="normal", fontsize=9.5, color=style.MUTED)


def rests(trace: Trace) -> list[int]:
    """The last samples of the latest times in which dry friction holds all channels of a machine, HOLD s or longer."""
    if not trace.scenario.realistic or not rubs(trace.scenario):
        return []
    still = resting(trace).all(axis=1)
    edges = np.flatnonzero(np.diff(still.astype(int), prepend=0, append=0)).reshape(-1, 2)
    long = [int(last) for first, last in edges - (0, 1) if trace.t[last] - trace.t[first] >= HOLD]
    return long[-MARKED:]


def target(ax: Axes, traces: Sequence[Trace]) -> None:
    """Draw each reference for as long as a run had it, and the settling band around it."""
    for trace in {trace.scenario.reference: trace for trace in sorted(traces, key=lambda trace: len(trace.t))}.values():
        if np.isfinite(trace.r).all():
            (t, r), half = line(trace.t, trace.r[:, 0], 2), BAND * scale(trace)
            ax.fill_between(t, r - half, r + half, color=style.BAND, lw=0, zorder=1)
            ax.plot(t, r, color=style.MUTED, lw=0.9, ls=(0, (5, 3)), zorder=1.5)


def jumps(ax: Axes, changes: Mapping[float, str], named: bool) -> None:
    """Mark when a plant changed, time in s -> words; the words too if `named`."""
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
    """Draw v over x, with a ring where each trace starts, and a diamond at each of the samples in which it is held."""
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
    """Draw u of the first channel as it was held over the last samples."""
    period = max(trace.scenario.control_period for trace in traces)
    stop = end(traces)
    begin = max(0.0, stop - LAST * period)
    for trace, colour, wider in layers(traces, colours):
        part = slice(int(np.searchsorted(trace.t, begin - 1e-9)), None)
        ax.step(1e3 * (trace.t[part] - stop), trace.u[part, 0], where="post", color=colour, lw=1.2 + wider)
    if all(trace.diverged_at is not None for trace in traces):
        ax.text(0.5, 0.5, "no run lasted", transform=ax.transAxes, ha="center", color=style.MUTED)
    ax.set_xlim(1e3 * (begin - stop), 0.0)
    low, high = ax.dataLim.intervaly
    if low <= high:
        half = max(0.62 * (high - low), LEAST / 2 * max(map(abs, span(traces, "u")))) or 1.0
        ax.set_ylim((low + high) / 2 - half, (low + high) / 2 + half)


def light(n: int) -> np.ndarray:
    """Which of n channels are drawn one by one."""
    return np.unique(np.linspace(0, n - 1, min(n, LIGHT)).round().astype(int))


def thinned(x: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A curve with its points evenly apart on paper."""
    step = np.hypot(np.diff(x) / (np.ptp(x) or 1.0), np.diff(v) / (np.ptp(v) or 1.0))
    place = np.floor(np.concatenate([[0.0], np.cumsum(step)]) / FINE)
    keep = np.append(np.flatnonzero(np.diff(place, prepend=-1.0)), len(x) - 1)
    keep = keep[:: max(1, len(keep) // 4000)]
    return x[keep], v[keep]


def span(traces: Sequence[Trace], name: str) -> tuple[float, float]:
    """Least and largest value of the runs that lasted; where none did, of all, without the ends of those that left."""
    seen = [QUANTITIES[name](trace) for trace in traces if trace.diverged_at is None]
    for trace in traces if not seen else ():
        y = QUANTITIES[name](trace)
        left = trace.failure is None or trace.failure.startswith(LEFT_THE_WORLD)
        seen.append(y[: max(1, int(0.8 * len(y)))] if left else y)
    seen = [y for y in seen if np.isfinite(y).all()] or [np.zeros(1)]
    return float(min(y.min() for y in seen)), float(max(y.max() for y in seen))


def limits(traces: Sequence[Trace], name: str) -> tuple[float, float]:
    """The vertical range for a quantity: its span with some air."""
    low, high = span(traces, name)
    air = 0.08 * (high - low) or 1.0
    return low - air, high + air
