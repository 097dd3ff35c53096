"""What one pair of axes shows: a quantity of several traces over time, their phase portrait, the last samples of u.

Over time, a curve is the mean of the channels in each window (envelope.py); the band behind it is the range in the
window, of u and s over all channels too. Single channels of a network are light.
"""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from smc_mujoco import style
from smc_mujoco.envelope import columns, samples
from smc_mujoco.measure import BAND, scale
from smc_mujoco.trace import Trace

WINDOWS = 360  # of a panel
LAST = 60  # control samples in the close-up of u
LIGHT = 9  # channels of a network drawn one by one
FINE = 1 / 200  # of a phase portrait's diagonal: how far apart its points are

QUANTITIES: dict[str, Callable[[Trace], np.ndarray]] = {  # name -> (K+1, n)
    "x": lambda trace: trace.x,
    "v": lambda trace: trace.v,
    "u": lambda trace: trace.u,
    "applied": lambda trace: trace.applied,
    "d": lambda trace: trace.d,
    "s": lambda trace: trace.s,
    "spread": lambda trace: np.ptp(trace.x, axis=1, keepdims=True),
}


def values(trace: Trace, name: str) -> np.ndarray:
    """A quantity at the trace's finite samples, (samples, n)."""
    return QUANTITIES[name](trace)[: samples(trace)]


def layers(traces: Sequence[Trace], colours: Sequence[str]) -> list[tuple[Trace, str, float]]:
    """Traces from the bottom to the top with their colours and how much wider their lines are.

    The first is on top, each one below is a little wider: curves that coincide all show.
    """
    return [(trace, colours[i], 0.5 * i) for i, trace in reversed(list(enumerate(traces)))]


def over_time(ax: Axes, traces: Sequence[Trace], colours: Sequence[str], name: str) -> list[Artist]:
    """Draw a quantity of every trace and set the vertical range."""
    drawn: list[Artist] = []
    for trace, colour, wider in layers(traces, colours):
        y = values(trace, name)
        t, states = trace.t[: len(y)], name == "x"
        each, mean = columns(t, y, WINDOWS), columns(t, y.mean(axis=1, keepdims=True), WINDOWS)
        band = (mean.low, mean.high) if states else (each.low, each.high)
        drawn.append(ax.fill_between(mean.t, band[0].min(axis=1), band[1].max(axis=1), color=colour, alpha=0.22, lw=0))
        if y.shape[1] > 1 and states:
            for i in light(y.shape[1]):
                drawn += ax.plot(each.t, each.mean[:, i], color=colour, alpha=0.3, lw=0.8)
        drawn += ax.plot(mean.t, mean.mean[:, 0], color=colour, lw=1.5 + wider)
    ax.set_ylim(limits(traces, name))
    for trace, colour in zip(traces, colours, strict=True):
        if trace.diverged_at is not None:
            y = values(trace, name)
            end = np.clip(y[-1].mean(), *ax.get_ylim())
            drawn += ax.plot(trace.t[len(y) - 1], end, "X", color=colour, ms=9, mec="white", clip_on=False, zorder=5)
    return drawn


def target(ax: Axes, traces: Sequence[Trace]) -> None:
    """Draw each reference, and the settling band around it."""
    for trace in {trace.scenario.reference: trace for trace in traces}.values():
        e, half = columns(trace.t, trace.r[:, :1], WINDOWS), BAND * scale(trace)
        r = e.mean[:, 0]
        ax.fill_between(e.t, r - half, r + half, color=style.BAND, lw=0, zorder=1)
        ax.plot(e.t, r, color=style.MUTED, lw=0.9, ls=(0, (5, 3)), zorder=1.5)


def phase(ax: Axes, traces: Sequence[Trace], colours: Sequence[str]) -> None:
    """Draw v over x, with a ring where each trace starts."""
    for trace, colour, wider in layers(traces, colours):
        x, v = values(trace, "x"), values(trace, "v")
        if x.shape[1] > 1:
            for i in light(x.shape[1]):
                ax.plot(*thinned(x[:, i], v[:, i]), color=colour, alpha=0.3, lw=0.7)
        x, v = x.mean(axis=1), v.mean(axis=1)
        ax.plot(*thinned(x, v), color=colour, lw=1.4 + wider)
        ax.plot(x[0], v[0], "o", color=colour, mfc="white", ms=6, zorder=4)
        if trace.diverged_at is not None:
            ax.plot(x[-1], v[-1], "X", color=colour, ms=9, mec="white", zorder=5)
    ax.axhline(0.0, color=style.RULE, lw=0.9, zorder=1)
    ax.axvline(0.0, color=style.RULE, lw=0.9, zorder=1)
    ax.set_xlim(limits(traces, "x"))
    ax.set_ylim(limits(traces, "v"))


def last_samples(ax: Axes, traces: Sequence[Trace], colours: Sequence[str]) -> None:
    """Draw u of the first channel as it was held over the last samples."""
    period = max(trace.scenario.control_period for trace in traces)
    end = max(trace.t[-1] for trace in traces)
    begin = max(0.0, end - LAST * period)
    for trace, colour, wider in layers(traces, colours):
        part = slice(int(np.searchsorted(trace.t, begin - 1e-9)), samples(trace))
        ax.step(1e3 * (trace.t[part] - end), trace.u[part, 0], where="post", color=colour, lw=1.2 + wider)
    if all(trace.diverged_at is not None for trace in traces):
        ax.text(0.5, 0.5, "no run lasted", transform=ax.transAxes, ha="center", color=style.MUTED)
    ax.set_xlim(1e3 * (begin - end), 0.0)
    ax.margins(y=0.12)


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
    """Least and largest value of the runs that lasted; where none did, of all runs without their ends."""
    seen = [values(trace, name) for trace in traces if trace.diverged_at is None]
    seen = seen or [y[: max(1, int(0.8 * len(y)))] for y in (values(trace, name) for trace in traces)]
    return float(min(y.min() for y in seen)), float(max(y.max() for y in seen))


def limits(traces: Sequence[Trace], name: str) -> tuple[float, float]:
    """The vertical range for a quantity: its span with some air."""
    low, high = span(traces, name)
    air = 0.08 * (high - low) or 1.0
    return low - air, high + air
