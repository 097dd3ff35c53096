"""Curves and films of a report's scenes: runs side by side, in few points and few bytes.

Films are WebM, and small, as they are part of the page.
"""

import dataclasses
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from smc_mujoco.common.files import replacing, scratch
from smc_mujoco.draw import decimate
from smc_mujoco.draw.film import film as video
from smc_mujoco.draw.film import pace
from smc_mujoco.draw.film.encoder import encoder
from smc_mujoco.evidence.report.plan import Report
from smc_mujoco.simulation.trace import Trace

SIZE, FPS = (960, 540), 20  # px; 1/s
BAND_WINDOWS = 250  # windows of a band across the run
POSTER_TIME = 0.5  # s


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
    poster: bytes | None = None  # a picture of the film as JPEG
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


def film(traces: Sequence[Trace], title: str, report: Report = lambda done, whole: None) -> tuple[bytes, bytes]:
    """Return a film of the traces as WebM, and a picture of it as JPEG."""
    shown, poster = pace.clock(traces, FPS), io.BytesIO()
    count = len(shown.times)
    with scratch() as folder:
        path = folder / "film.webm"
        with encoder(path, (SIZE[1], SIZE[0]), FPS) as write:
            for k, picture in enumerate(video.frames(traces, shown, None, title, SIZE)):
                if k == min(int(np.searchsorted(shown.times, POSTER_TIME)), count - 1):
                    Image.fromarray(picture).save(poster, "JPEG", quality=80, optimize=True)
                write(picture)
                report(k + 1, count)
        return path.read_bytes(), poster.getvalue()


def save(made: tuple[bytes, bytes], path: Path) -> None:
    """Write the picture of a film, then the film beside it."""
    film, poster = made
    for data, file in ((poster, path.with_suffix(".jpg")), (film, path)):
        with replacing(file) as part:
            part.write_bytes(data)


def load(path: Path) -> tuple[bytes, bytes]:
    """Return the film and the picture that `save` wrote."""
    return path.read_bytes(), path.with_suffix(".jpg").read_bytes()
