"""Static pages of results: an index, the boards of each suite, and a page for each entry.

The pages are HTML and SVG in a few files, without scripts, and need neither network nor server.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.extras import extra
from smc_mujoco.common.files import replacing, slug
from smc_mujoco.common.text import number
from smc_mujoco.problems import suite
from smc_mujoco.problems.results import MEASURE, TITLES, WORDS, QuestionBoard, Results, sound

if TYPE_CHECKING:
    from jinja2 import Environment

TEMPLATES = Path(__file__).parent / "templates"
CURVE = SimpleNamespace(width=320.0, height=120.0)  # of a picture of curves, in its own units
ASKS = {
    "forces": "Who stays nearest to the goal while something pushes?",
    "sensors": "Who stays nearest to the goal with a poor sensor?",
    "speed": "Who gets there first?",
    "calm": "Who moves the actuator least?",
}
SHOWN = 5  # best and worst problems on an entry's page


def build(results: Path, out: Path) -> tuple[Path, list[str]]:
    """Write the pages of all results in a folder.

    Return the first page, and why results are left out.

    Raises:
      ScenarioError: no results there, or a folder that cannot be written.
    """
    suites, refused = sound(results)
    if not suites:
        if refused:
            why = str(refused[0])
        else:
            why = "enter a law first, with smc-mujoco enter FOLDER"
        raise ScenarioError(f"no results in {str(results)!r}: {why}")
    environment = _environment()
    left_out = []
    for error in refused:
        left_out.append(str(error).replace(f"{results}{os.sep}", ""))
    for suite_results in suites:
        folder = suite.folder(suite_results.suite, suite_results.seed)
        page = {"found": suite_results, "folder": folder}
        _write(
            out / f"{folder}.html",
            environment,
            "suite.jinja",
            page,
            title=suite_results.title,
            up="",
        )
        for name in suite_results.entries:
            file = out / folder / f"{slug(name)}.html"
            _write(file, environment, "entry.jinja", page, name=name, title=name, up="../")
    index = {"suites": suites, "left_out": left_out}
    _write(out / "index.html", environment, "index.jinja", index, title="Results", up="")
    return out / "index.html", left_out


def _write(
    path: Path, made: "Environment", template: str, values: Mapping[str, Any], **more: Any
) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    page = made.get_template(template).render(values, **more)
    with replacing(path) as file:
        file.write_text(page, encoding="utf-8", errors="replace")


def _environment() -> "Environment":
    """Return the jinja2 environment of the templates: what they insert is escaped, a missing name
    an error.
    """
    with extra("site", "a page of results"):
        from jinja2 import Environment, FileSystemLoader, StrictUndefined
        from markupsafe import Markup

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {
        "css": Markup((TEMPLATES / "style.css").read_text(encoding="utf-8")),
        "titles": TITLES,
        "words": WORDS,
        "measure": MEASURE,
        "asks": ASKS,
        "curves": curves,
        "scale": scale,
        "extremes": extremes,
        "number": number,
        "slug": slug,
        "folder_of": suite.folder,
        "curve": CURVE,
    }
    return environment


def scale(board: QuestionBoard, rank: float) -> float:
    """Return where a rank lies in a board's picture, % from the left."""
    return round(100.0 * (rank - 0.5) / max(len(board.standings), 1), 2)


def curves(found: Results, question: str, names: Sequence[str]) -> dict[str, str]:
    """Return entry -> the points of its curve of targets, for an SVG polyline."""
    paths = {}
    for name in names:
        t, share = found.curve(name, question)
        x = CURVE.width * t / t[-1]
        y = CURVE.height * (1.0 - share)
        points = []
        for a, b in zip(x, y, strict=True):
            points.append(f"{a:.1f},{b:.1f}")
        paths[name] = " ".join(points)
    return paths


def extremes(found: Results, name: str) -> Mapping[str, list[tuple[str, str, int, float]]]:
    """Return "best" and "worst" -> where an entry stands so: question, problem, place among the
    entries, median.
    """
    names = list(found.entries)
    medians = found.entries[name].medians
    rows = []
    for question in found.boards():
        ranks = found.ranks(question)[names.index(name)]
        for cell, rank in zip(found.on(question), ranks, strict=True):
            median = medians[cell][MEASURE[question]]
            rows.append((question, cell, int(np.ceil(rank)), median))
    rows.sort(key=lambda row: row[2])
    return {"best": rows[:SHOWN], "worst": rows[::-1][:SHOWN]}
