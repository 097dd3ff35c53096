"""Films and pictures of a report's scenes, runs side by side. They are small, as they are part of the page."""

import dataclasses
from collections.abc import Sequence

from smc_mujoco.common.files import scratch
from smc_mujoco.draw.figure import figure
from smc_mujoco.draw.film import film as video
from smc_mujoco.draw.film import pace
from smc_mujoco.draw.film.encoder import encoder
from smc_mujoco.evidence.report import charts
from smc_mujoco.evidence.report.plan import Report
from smc_mujoco.simulation.trace import Trace

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
    shown = pace.clock(traces, FPS)
    with scratch() as folder:
        path = folder / "film.webm"
        with encoder(path, (SIZE[1], SIZE[0]), FPS) as write:
            for k, picture in enumerate(video.pictures(traces, shown, None, title, SIZE), 1):
                write(picture)
                report(k, len(shown.times))
        return path.read_bytes()


def curves(traces: Sequence[Trace], title: str) -> bytes:
    """Draw x and u of every law over time."""
    size = charts.WIDTH, 5.6
    return charts.picture(lambda path: figure(traces, path, title=title, panels=("x", "u"), size=size, format="svg"))
