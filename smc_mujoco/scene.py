"""A scene: one question, the runs that answer it, and how they are shown. scenes/ holds one script each.

A scene file has a docstring - the question, the figure of the paper it answers, what to look for - and a `scene`:

    scene = smc.Scene(title="Duffing", conditions={"nominal": smc.paper.comparison("duffing")})
"""

import ast
import dataclasses
import runpy
import traceback
from collections.abc import Iterator, Mapping
from pathlib import Path

from smc_mujoco.errors import ScenarioError, unknown
from smc_mujoco.plant import shipped
from smc_mujoco.scenario import Scenario


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scene:
    """What a scene file declares.

    Attributes:
      title: shown on figures and films.
      conditions: condition -> label -> Scenario. Each condition gets a figure, which compares its labelled runs.
      film: the condition that is filmed; by default the first.
      figure: "overview" (x, u, s and phase portrait, a figure a condition) or "signals" (u of all conditions in one).
    """

    title: str
    conditions: Mapping[str, Mapping[str, Scenario]]
    film: str = ""
    figure: str = "overview"

    def __post_init__(self):
        if not self.conditions or not all(self.conditions.values()):
            raise ScenarioError(f"scene {self.title!r} has a condition without runs: give each at least one Scenario")
        object.__setattr__(self, "film", self.film or next(iter(self.conditions)))
        if self.film not in self.conditions:
            raise unknown(f"condition to film in scene {self.title!r}", self.film, self.conditions)
        if self.figure not in ("overview", "signals"):
            raise unknown("kind of figure", self.figure, ("overview", "signals"))

    def seeded(self, seed: int) -> "Scene":
        """The same scene with another seed in every run."""
        conditions = {
            condition: {label: dataclasses.replace(scenario, seed=seed) for label, scenario in runs.items()}
            for condition, runs in self.conditions.items()
        }
        return dataclasses.replace(self, conditions=conditions)

    def runs(self) -> Iterator[tuple[str, str, Scenario]]:
        """(condition, label, scenario) of every run."""
        for condition, runs in self.conditions.items():
            for label, scenario in runs.items():
                yield condition, label, scenario


def scenes() -> dict[str, Path]:
    """Name -> file of every scene that comes with the package."""
    return {path.stem: path for path in sorted(shipped("scenes").glob("*.py"))}


def find(name: str) -> Path:
    """The scene file at a path, or the one of that name that comes with the package."""
    if Path(name).suffix == ".py":
        if Path(name).is_file():
            return Path(name)
        name = Path(name).stem
    if name not in scenes():
        raise unknown("scene", name, scenes())
    return scenes()[name]


def read(path: Path) -> Scene:
    """The scene that a file declares.

    Raises:
      ScenarioError: the file fails, or declares none.
    """
    try:
        scene = runpy.run_path(str(path)).get("scene")
    except ScenarioError:
        raise
    except Exception as error:  # whatever a user's script raises
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
        where = f"{path}, line {lines[-1]}" if lines else str(path)
        raise ScenarioError(f"{where}: {type(error).__name__}: {error}; mend the scene file") from error
    if not isinstance(scene, Scene):
        raise ScenarioError(f"{path} declares no scene: write `scene = smc.Scene(title=..., conditions=...)`")
    return scene


def question(path: Path) -> str:
    """The first line of a scene file's docstring."""
    return (ast.get_docstring(ast.parse(path.read_text())) or "").partition("\n")[0]
