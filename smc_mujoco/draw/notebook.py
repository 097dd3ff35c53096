"""Films and figures in a notebook's cell, and a film's pictures for other packages."""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure, SubFigure

from smc_mujoco.common import html
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import scratch
from smc_mujoco.draw import page
from smc_mujoco.draw.film import encoder, film, pace
from smc_mujoco.draw.film.camera import Camera, checked
from smc_mujoco.simulation.trace import Trace

if TYPE_CHECKING:
    from mediapy import VideoMetadata

CELL_SIZE = 800, 450  # px, of a film in a cell


@dataclasses.dataclass(repr=False, eq=False)
class Frames:
    """Pictures of a film, each (height, width, 3) uint8. They are made while you iterate, as often as you do.

    `mediapy.show_video` and `mediapy.write_video` take them as they are; `numpy.stack(list(frames))` is an array.
    `clock` has the times of the run at each picture, s. Arguments: as `film`.

    Raises:
      ScenarioError: as `film`; those of size and OpenGL are raised at the first picture.
    """

    traces: Trace | Sequence[Trace]
    labels: Sequence[str] | None = None
    title: str | None = None
    size: tuple[int, int] = CELL_SIZE
    fps: float = film.FPS
    speed: float | None = None
    camera: Camera | None = None

    def __post_init__(self) -> None:
        checked(self.camera)
        self.clock = pace.clock(self.traces, self.fps, self.speed)

    def __len__(self) -> int:
        return len(self.clock.times)

    def __iter__(self) -> Iterator[np.ndarray]:
        return film.frames(self.traces, self.clock, self.labels, self.title, self.size, self.camera)

    def __repr__(self) -> str:
        return f"Frames({len(self)} of {self.size[0]} x {self.size[1]} px, {self.fps:g} a second)"

    @property
    def metadata(self) -> "VideoMetadata":
        """The playback speed, which mediapy reads here. It also gets the ffmpeg of imageio_ffmpeg."""
        width, height = self.size
        return encoder.mediapy().VideoMetadata(len(self), (height, width), self.fps, None)


frames = Frames
"""Pictures of a film for other packages, such as `mediapy.show_video(smc.frames(traces))`, see `Frames`."""


def show(
    what: Trace | Sequence[Trace] | Frames | Figure | SubFigure,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: tuple[int, int] = CELL_SIZE,
    fps: float = film.FPS,
    speed: float | None = None,
    camera: Camera | None = None,
) -> None:
    """Show a film of traces, or a figure, in a notebook's cell.

    A figure at the end of a cell shows itself; `show` is for several in a cell.

    Args:
      what: one or several traces of one plant, which are filmed; `frames`; or a figure.
      labels, title, size, fps, speed, camera: of a film, as `film`.

    Raises:
      ScenarioError: not in a notebook, or as `film`.
    """
    if not html.in_notebook():
        raise ScenarioError("smc.show needs a notebook: elsewhere, write a film with smc.film(traces, 'film.mp4')")
    from IPython.display import HTML, display

    if isinstance(what, Figure | SubFigure):
        display(HTML(html.embedded(page.png(what), "image/png", page.css_width(what))))
        return
    its = what if isinstance(what, Frames) else frames(what, labels, title, size, fps, speed, camera)
    if why := film.missing():
        raise ScenarioError(why)
    with scratch() as folder:
        path = folder / "film.mp4"
        film.film(its.traces, path, its.labels, its.title, its.size, its.fps, its.speed, its.camera)
        display(HTML(html.embedded(path.read_bytes(), "video/mp4", its.size[0])))
