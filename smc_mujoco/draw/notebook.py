"""Films and figures in a notebook's cell."""

from collections.abc import Sequence

from matplotlib.figure import Figure, SubFigure

from smc_mujoco.common import html
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import scratch
from smc_mujoco.draw import page
from smc_mujoco.draw.film import film
from smc_mujoco.draw.film.camera import Camera
from smc_mujoco.draw.film.film import Frames
from smc_mujoco.simulation.trace import Trace


def show(
    what: Trace | Sequence[Trace] | Frames | Figure | SubFigure,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: tuple[int, int] = (800, 450),
    fps: float = film.FPS,
    speed: float | None = None,
    camera: Camera | None = None,
) -> None:
    """Show a film of traces, or a figure, in a notebook's cell.

        smc.show(smc.run(smc.Scenario(plant="duffing", law="pid")))

    A figure at the end of a cell shows itself; `show` is for several in a cell.

    Args:
      what: one or several traces of one plant, which are filmed; what `film(traces)` returns; or a
        figure.
      labels, title, size, fps, speed, camera: of a film, as `film`.

    Returns:
      None: the film or the figure stands in the cell.

    Raises:
      ScenarioError: not in a notebook, or as `film`.
    """
    if not html.in_notebook():
        raise ScenarioError(
            "smc.show needs a notebook: elsewhere, write a film with smc.film(traces, 'film.mp4')"
        )
    from IPython.display import HTML, display

    if isinstance(what, Figure | SubFigure):
        content, width = page.embedded(what)
        display(HTML(html.embedded(content, "image/png", width)))
        return
    if isinstance(what, Frames):
        frames = what
    else:
        frames = Frames(what, labels, title, size, fps, speed, camera)
    if why := film.missing_for_film():
        raise ScenarioError(why)
    with scratch() as folder:
        path = film.write_film(frames, folder / "film.mp4")
        display(HTML(html.embedded(path.read_bytes(), "video/mp4", frames.size[0])))
