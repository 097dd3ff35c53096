"""The report of a failing test: tables of its step responses, a figure and, with --smc-film, a film."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path

from smc_mujoco.common.files import slug
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.testing.response import StepResponse

MAX_ID = 150  # characters of a test's id in a file's name: most file systems allow 255 bytes


def report_of(test: str, responses: Sequence[StepResponse], folder: Path, video: bool) -> str:
    """Return tables of all responses, and the paths of the files that show them: a figure and a film for each plant."""
    from smc_mujoco.draw.figure import figure
    from smc_mujoco.draw.film.film import film

    parts = [f"{response}\n{response.table()}" for response in responses]
    plants: dict[str, list[Trace]] = {}
    for response in responses:
        plants.setdefault(response.scenario.plant.name, []).append(response.trace)
    lines = []
    for plant, traces in plants.items():
        name = slug(test[-MAX_ID:], MAX_ID) + (f"-{slug(plant)}" if len(plants) > 1 else "")
        titled = functools.partial(figure, title=test.rpartition("::")[2])
        lines.append(_line("figure", titled, traces, folder / f"{name}.png"))
        if video:
            lines.append(_line("film", film, traces, folder / f"{name}.mp4"))
    return "\n\n".join([*parts, "\n".join(dict.fromkeys(lines))])


def _line(what: str, draw: Callable[[Sequence[Trace], Path], object], traces: Sequence[Trace], path: Path) -> str:
    """Draw traces. Return a line with the file, or with the reason why there is none."""
    try:
        draw(traces, path)
    except Exception as error:  # a picture must not hide why the test failed
        return f"no {what}: {str(error).removeprefix(f'no {what}: ')}"
    return f"{what}: {path}"
