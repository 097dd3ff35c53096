"""Curves and films of a report's scenes: runs side by side, in few points and few bytes.

Films are WebM (VP9), which every browser plays and no patent fences in; small, for they travel in the page.
"""

import io
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from smc_mujoco.common import extras, gl
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import replacing
from smc_mujoco.draw import decimate
from smc_mujoco.draw.film import film as video
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.report.findings import Curve

SIZE, FPS = (960, 540), 20  # px; 1/s
# Chosen: letters stay clean at 100 to 200 kB for 5 s.
VP9 = ["-crf", "34", "-b:v", "0", "-deadline", "good", "-cpu-used", "4", "-row-mt", "1", "-g", "60"]
BANDS = 250  # windows of a band across the run
POSTER = 0.5  # s
Report = Callable[[int], None]


def curve(trace: Trace) -> Curve:
    """Return one channel of a trace, that which starts farthest out, in few points with every extreme kept."""
    whole = decimate.finite(trace)
    i = int(np.argmax(np.abs(trace.scenario.x0)))
    t, x, u = whole.t, whole.x[:, i], whole.u[:, i]
    width = decimate.window(trace)
    tu, line = decimate.line(t, u, width)
    band = decimate.columns(t, u[:, None], BANDS) if decimate.stretches(u, width) else None
    at, least, most = (band.t, band.low[:, 0], band.high[:, 0]) if band else (np.empty(0),) * 3
    shown = _extremes(x)
    return Curve(
        law=trace.scenario.law.name, t=t[shown], x=x[shown], tu=tu, u=line, tb=at[: len(least)], low=least, high=most
    )


def _extremes(y: np.ndarray) -> np.ndarray:
    """Return the indices of the extremes of y (K + 1,) in each of some stretches, with its first and last."""
    parts = np.array_split(np.arange(len(y)), min(decimate.POINTS, len(y)))
    ends = [(part[np.argmin(y[part])], part[np.argmax(y[part])]) for part in parts]
    return np.unique([0, *np.ravel(ends), len(y) - 1])


def film(traces: Sequence[Trace], title: str, report: Report = lambda frames: None) -> tuple[bytes, bytes]:
    """Return a film of the traces as WebM, and a picture of it as JPEG.

    Raises:
      ScenarioError: nothing renders here, or ffmpeg cannot write.
    """
    with extras.extra("report", "a film"):
        import imageio_ffmpeg

    if why := gl.missing():
        raise ScenarioError(why)
    times, poster = video.clock(traces, FPS), b""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "film.webm")
        writer = imageio_ffmpeg.write_frames(
            path, SIZE, fps=FPS, codec="libvpx-vp9", output_params=VP9, macro_block_size=2, ffmpeg_log_level="error"
        )
        try:
            with video.sigint_blocked():
                writer.send(None)
            for k, picture in enumerate(video.frames(traces, times, None, title, SIZE)):
                if k == min(round(POSTER * FPS), len(times) - 1):
                    poster = jpeg(picture)
                writer.send(np.ascontiguousarray(picture))
                report(1)
        except OSError as error:
            raise ScenarioError(f"cannot write a film: {' '.join(str(error).split())}; make room") from error
        finally:
            writer.close()
        return path.read_bytes(), poster


def missing() -> str | None:
    """Return None when a film can be made, else one sentence that says why not and what to do."""
    return gl.missing() or extras.missing("report", "no film: it", "imageio_ffmpeg")


def jpeg(picture: np.ndarray) -> bytes:
    """Return a picture (height, width, 3) as JPEG."""
    from PIL import Image

    data = io.BytesIO()
    Image.fromarray(picture).save(data, "JPEG", quality=80, optimize=True)
    return data.getvalue()


def save(made: tuple[bytes, bytes], path: Path) -> None:
    """Write a film and, before it, its picture beside it."""
    for data, file in ((made[1], path.with_suffix(".jpg")), (made[0], path)):
        with replacing(file) as part:
            part.write_bytes(data)


def load(path: Path) -> tuple[bytes, bytes]:
    """Return the film and the picture that `save` wrote."""
    return path.read_bytes(), path.with_suffix(".jpg").read_bytes()
