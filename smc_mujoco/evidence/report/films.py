"""Curves and films of a report's scenes: runs side by side, in few points and few bytes.

Films are WebM, and small, as they are part of the page.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from smc_mujoco.common.files import scratch
from smc_mujoco.draw import decimate
from smc_mujoco.draw.film import film as video
from smc_mujoco.draw.film import pace
from smc_mujoco.draw.film.encoder import encoder
from smc_mujoco.evidence.report.plan import Report
from smc_mujoco.simulation.trace import Trace

SIZE, FPS = (960, 540), 20  # px; 1/s
BAND_WINDOWS = 250  # windows of a band across the run


@dataclasses.dataclass(frozen=True, kw_only=True)
class Curve:
    """One channel of a trace in few points: x(t), the line of u, and the band between the extremes of u."""

    law: str
    t: np.ndarray  # (k,), of x
    x: np.ndarray
    tu: np.ndarray  # of the line of u, a mean where u chatters
    u: np.ndarray
    tb: np.ndarray  # windows of the band
    low: np.ndarray
    high: np.ndarray


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scene:
    """Runs of one plant in one condition, side by side: curves of the channel that starts farthest out."""

    plant: str
    condition: str
    unit: str  # of x
    u_max: float
    curves: tuple[Curve, ...]
    film: bytes | None = None  # WebM
    seconds: float = 0.0  # duration of the film


def curve(trace: Trace) -> Curve:
    """Return the channel of a trace that starts farthest out, in few points with every extreme kept."""
    whole = decimate.finite(trace)
    i = int(np.argmax(np.abs(trace.scenario.resolved.x0)))
    t, x, u = whole.t, whole.x[:, i], whole.u[:, i]
    width = decimate.window(trace)
    tu, line = decimate.line(t, u, width)
    band = decimate.columns(t, u[:, None], BAND_WINDOWS) if decimate.chattering_parts(u, width) else None
    tb, low, high = (band.t, band.low[:, 0], band.high[:, 0]) if band else (np.empty(0),) * 3
    tx, x = decimate.line(t, x, 0)
    return Curve(law=trace.scenario.law.name, t=tx, x=x, tu=tu, u=line, tb=tb[: len(low)], low=low, high=high)


def film(traces: Sequence[Trace], title: str, report: Report = lambda done, whole: None) -> bytes:
    """Return a film of the traces as WebM."""
    shown = pace.clock(traces, FPS)
    with scratch() as folder:
        path = folder / "film.webm"
        with encoder(path, (SIZE[1], SIZE[0]), FPS) as write:
            for k, picture in enumerate(video.frames(traces, shown, None, title, SIZE), 1):
                write(picture)
                report(k, len(shown.times))
        return path.read_bytes()
