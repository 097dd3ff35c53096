"""Films and pictures of a report's runs. They are small, as they are part of the page."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from smc_mujoco.common.files import scratch
from smc_mujoco.draw import dot_plot
from smc_mujoco.draw.figure import figure
from smc_mujoco.draw.film import film as video
from smc_mujoco.draw.film.encoder import encoder
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.plan import Report
from smc_mujoco.simulation.trace import Trace

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table

WIDTH = 10.0  # inches, of charts: their letters have 11 px at least, also on a phone, see style.css
SIZE, FPS = (960, 540), 20  # px; 1/s


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scene:
    """Runs of one plant in one condition, side by side."""

    plant: str
    condition: str
    laws: tuple[str, ...]
    curves: bytes  # SVG, x and u
    film: bytes | None = None  # WebM
    seconds: float = 0.0  # duration of the film


def film(traces: Sequence[Trace], title: str, report: Report = lambda done, whole: None) -> bytes:
    """Return a film of the traces as WebM."""
    frames = video.Frames(traces, title=title, size=SIZE, fps=FPS)
    with scratch() as folder:
        path = folder / "film.webm"
        with encoder(path, (SIZE[1], SIZE[0]), FPS) as write:
            for k, picture in enumerate(frames, 1):
                write(picture)
                report(k, len(frames))
        return path.read_bytes()


def picture(draw: Callable[[Path], object]) -> bytes:
    """Return the SVG file that a function draws."""
    with scratch() as folder:
        draw(folder / "picture.svg")
        return (folder / "picture.svg").read_bytes()


def medians(table: "Table", condition: str) -> bytes:
    """Draw each law's median in one condition, with its interval: a row of panels per plant, a
    column per metric.
    """
    title = f"Medians, {words.condition(condition)}"
    some = table.select(condition=condition)
    plants, laws = (len(set(some.column(name).tolist())) for name in ("plant", "law"))
    size = WIDTH, 1.1 + plants * (0.7 + dot_plot.LINE_HEIGHT * (laws + 1))
    return picture(
        lambda path: dot_plot.plot(some, path, words.MAIN_METRICS, title, size, format="svg")
    )


def curves(traces: Sequence[Trace], title: str) -> bytes:
    """Draw x and u of every law over time."""
    size = WIDTH, 5.6
    return picture(
        lambda path: figure(traces, path, title=title, panels=("x", "u"), size=size, format="svg")
    )
