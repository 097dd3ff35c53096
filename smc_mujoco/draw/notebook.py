"""Films, figures and their files in a notebook's cell, and a film's pictures for other packages."""

import dataclasses
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure, SubFigure

from smc_mujoco.common import html, progress
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.files import reading, scratch
from smc_mujoco.draw import page
from smc_mujoco.draw.film import encoder, film, pace
from smc_mujoco.draw.film.camera import Camera, checked
from smc_mujoco.simulation.trace import Trace

if TYPE_CHECKING:
    from mediapy import VideoMetadata

CELL_SIZE = 800, 450  # px, of a film in a cell
MEDIA_TYPES = {".mp4": "video/mp4", ".webm": "video/webm", ".webp": "image/webp", ".gif": "image/gif"}
MEDIA_TYPES |= {".png": "image/png", ".svg": "image/svg+xml"}


@dataclasses.dataclass(repr=False, eq=False)
class Frames:
    """Pictures of a film, each (height, width, 3) uint8. They are made while you iterate, as often as you do.

    `mediapy.show_video` and `mediapy.write_video` take them as they are; `numpy.stack(list(frames))` is an array.

    Attributes:
      fps: pictures a second.
      times: of the run at each picture, (frames,) s.
    """

    traces: Trace | Sequence[Trace]
    labels: Sequence[str] | None
    title: str | None
    size: tuple[int, int]
    fps: float
    speed: float | None
    camera: Camera | None

    def __post_init__(self) -> None:
        checked(self.camera)
        self._clock = pace.clock(self.traces, self.fps, self.speed)
        self.times = self._clock.times

    def __len__(self) -> int:
        return len(self.times)

    def __iter__(self) -> Iterator[np.ndarray]:
        return film.frames(self.traces, self._clock, self.labels, self.title, self.size, self.camera)

    def __repr__(self) -> str:
        return f"Frames({len(self)} of {self.size[0]} x {self.size[1]} px, {self.fps:g} a second)"

    @property
    def metadata(self) -> "VideoMetadata":
        """The playback speed, which mediapy reads here. It also gets the ffmpeg of imageio_ffmpeg."""
        width, height = self.size
        return encoder.mediapy().VideoMetadata(len(self), (height, width), self.fps, None)

    def write(self, path: Path, report: film.Report) -> None:
        """Write an .mp4, see `film.film`."""
        film.film(self.traces, path, self.labels, self.title, self.size, self.fps, report, self.speed, self.camera)


def frames(
    traces: Trace | Sequence[Trace],
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: tuple[int, int] = CELL_SIZE,
    fps: float = film.FPS,
    speed: float | None = None,
    camera: Camera | None = None,
) -> Frames:
    """Return the pictures of a film, as `mediapy.show_video(smc.frames(trace))` takes them. Arguments: as `film`.

    Raises:
      ScenarioError: as `film`; what concerns the size or OpenGL when the first picture is made.
    """
    return Frames(traces, labels, title, size, fps, speed, camera)


def show(
    what: Trace | Sequence[Trace] | Frames | Figure | SubFigure | str | os.PathLike,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: tuple[int, int] = CELL_SIZE,
    fps: float = film.FPS,
    speed: float | None = None,
    camera: Camera | None = None,
) -> None:
    """Show a film of traces, a figure, or the file of one, in a notebook's cell.

    A figure at the end of a cell shows itself; `show` is for several in a cell.

    Args:
      what: one or several traces of one plant, which are filmed; `frames`; a figure; or the path of a film or picture.
      labels, title, size, fps, speed, camera: of a film, as `film`.

    Raises:
      ScenarioError: not in a notebook, no film or picture, or as `film`.
    """
    if not html.in_notebook():
        raise ScenarioError("smc.show needs a notebook: elsewhere, write a film with smc.film(traces, 'film.mp4')")
    from IPython.display import HTML, display

    display(HTML(embedded(what, labels, title, size, fps, speed, camera)))


def embedded(what: object, labels, title, size, fps, speed, camera) -> html.Html:
    """Return HTML with the film or picture in it, see `show`."""
    if isinstance(what, Figure | SubFigure):
        return html.embedded(page.png(what), "image/png", page.css_width(what))
    if isinstance(what, str | os.PathLike):
        kind = MEDIA_TYPES.get(Path(what).suffix.lower())
        if kind is None:
            raise ScenarioError(f"cannot show {Path(what).name!r}: end the name in {', '.join(MEDIA_TYPES)}")
        with reading(what, "film or picture", "give the path of one, such as film.mp4") as path:
            return html.embedded(path.read_bytes(), kind)
    if not isinstance(what, Frames):
        what = frames(_traces(what), labels, title, size, fps, speed, camera)
    if why := film.missing():
        raise ScenarioError(why)
    with scratch() as folder, progress.bar("film", len(what)) as bar:
        path = folder / "film.mp4"
        what.write(path, bar.advance)
        return html.embedded(path.read_bytes(), MEDIA_TYPES[".mp4"], what.size[0])


def _traces(what: object) -> list[Trace]:
    """Return what is a trace, or a list of them, as a list."""
    traces = list(what) if isinstance(what, list | tuple) else [what]
    if not all(isinstance(trace, Trace) for trace in traces):
        raise ScenarioError(f"cannot show {shown(what)}: give traces, smc.frames, a figure, or the path of a film")
    return traces  # pyright: ignore[reportReturnType]
