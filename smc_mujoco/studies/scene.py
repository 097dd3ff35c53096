"""A scene: one question, the runs that answer it, and how they are shown. The folder scenes/ has a script for each.

The docstring of a scene file says the question, the figure of the paper that it answers, and what to look for. The file
defines `scene`:

    scene = smc.Scene(title="Duffing", conditions={"nominal": smc.paper.comparison("duffing")})
"""

import ast
import dataclasses
import functools
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import EntryPoint
from pathlib import Path

from smc_mujoco.common import errors
from smc_mujoco.common.catalogue import Catalogue, added, source
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.errors import find as lookup
from smc_mujoco.common.files import shipped, slug
from smc_mujoco.common.scripts import execute
from smc_mujoco.common.text import capital
from smc_mujoco.draw.film.camera import Camera, checked
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.outcome import Outcome, summary


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scene:
    """What a scene file declares.

    Attributes:
      title: shown on figures and films.
      conditions: condition -> label -> Scenario. Each condition gets a figure, which compares its labelled runs.
      film: the condition that is filmed; by default the first.
      figure: "overview" (as `smc.figure`, a figure for each condition), "signals" (u of all conditions in one) or
        "chattering" (amplitude over the actuator's lag, predicted and run, all conditions in one).
      answers: metrics of the driven channels that answer the scene's question, printed after the scores.
      answer: function of the `Outcome` of all runs that returns the sentence which answers the scene's question. The
        default says who settles, and who is first.
      camera: of the film, as `smc.film` takes it; default: the plant's own.
    """

    title: str
    conditions: Mapping[str, Mapping[str, Scenario]]
    film: str = ""
    figure: str = "overview"
    answers: tuple[str, ...] = ()
    answer: Callable[[Outcome], str] = dataclasses.field(default_factory=lambda: summary)
    camera: Camera | None = None

    def __post_init__(self):
        errors.name("title", self.title)
        if not isinstance(self.conditions, Mapping) or not self.conditions:
            raise ScenarioError(f"scene {self.title!r} has conditions {shown(self.conditions)}: give names with runs")
        for condition, runs in self.conditions.items():
            errors.name(f"a condition of scene {self.title!r}", condition)
            if not isinstance(runs, Mapping) or not runs or not all(isinstance(s, Scenario) for s in runs.values()):
                raise ScenarioError(
                    f"condition {condition!r} of scene {self.title!r} is {shown(runs)}: give labels with Scenarios"
                )
            for label in runs:
                errors.name(f"a label of condition {condition!r} of scene {self.title!r}", label)
            if len(plants := {s.plant.name for s in runs.values()}) > 1:
                raise ScenarioError(
                    f"condition {condition!r} of scene {self.title!r} has the plants {', '.join(sorted(plants))}, "
                    "which share no axes: give each plant its own condition"
                )
        files = [(f"{slug(condition)}-{slug(label)}", label) for condition, label, _ in self.runs()]
        for named in ([(slug(condition), condition) for condition in self.conditions], files):
            made = [file for file, _ in named]
            if same := [name for file, name in named if made.count(file) > 1]:
                raise ScenarioError(f"scene {self.title!r} has names that make the same file name: {', '.join(same)}")
        object.__setattr__(self, "film", self.film or next(iter(self.conditions)))
        lookup(f"condition to film in scene {self.title!r}", self.film, self.conditions)
        lookup("kind of figure", self.figure, dict.fromkeys(("overview", "signals", "chattering")))
        object.__setattr__(self, "camera", checked(self.camera))
        answers = (self.answers,) if isinstance(self.answers, str) else tuple(self.answers)
        object.__setattr__(self, "answers", answers)
        for name in answers:
            lookup(f"metric that answers scene {self.title!r}", name, CATALOGUE)
        if not callable(self.answer):
            raise ScenarioError(f"scene {self.title!r} has answer {shown(self.answer)}: give a function of its runs")

    def sentence(self, traces: Mapping[str, Mapping[str, Trace]]) -> str:
        """Return the sentence that answers the question of the scene, from condition -> label -> Trace."""
        text = self.answer(Outcome(traces=traces))
        if not isinstance(text, str) or not text.strip():
            raise ScenarioError(
                f"the answer of scene {self.title!r} is {shown(text)}: give a function that returns text"
            )
        text = " ".join(text.split())
        labels = "|".join(re.escape(label) for _, label, _ in self.runs())
        text = text if re.match(rf"(?:{labels})(?!\w)", text) else capital(text)  # labels stay as in tables
        return text + "." * (not text.endswith((".", "?", "!")))

    def seeded(self, seed: int) -> "Scene":
        """Return the same scene with another seed in every run."""
        conditions = {
            condition: {label: dataclasses.replace(scenario, seed=seed) for label, scenario in runs.items()}
            for condition, runs in self.conditions.items()
        }
        return dataclasses.replace(self, conditions=conditions)

    def runs(self) -> Iterator[tuple[str, str, Scenario]]:
        """Yield (condition, label, scenario) of every run."""
        for condition, runs in self.conditions.items():
            for label, scenario in runs.items():
                yield condition, label, scenario


@functools.cache
def scenes() -> Catalogue[Path]:
    """Return name -> file of every scene that comes with the package, or with another one."""
    library = {path.stem: path for path in sorted(shipped("scenes").glob("*.py"))}
    return Catalogue(library, added("smc_mujoco.scenes", _of_package))


def _of_package(point: EntryPoint) -> Path:
    """Return the scene file that an entry point of another package names. The file is read, and not run."""
    path = Path(str(source(point).origin))
    ast.parse(path.read_text(encoding="utf-8"), str(path))
    return path


def find(name: str) -> Path:
    """Return the scene file at a path, or the one of that name that comes with a package."""
    if os.path.isfile(name):
        return Path(name)
    if Path(name).suffix or Path(name).name != name:
        raise ScenarioError(f"no scene file {name}: give the path of a scene file, or a name from smc-mujoco list")
    return lookup("scene", name, scenes())


def read(path: Path) -> Scene:
    """Return the scene that a file declares."""
    main = sys.modules["__main__"]
    if getattr(main, "__file__", None) and Path(str(main.__file__)).resolve() == path.resolve():
        scene = vars(main).get("scene")  # it is running already, as a script
    else:
        scene = execute(path).get("scene")
    if not isinstance(scene, Scene):
        raise ScenarioError(f"{path} declares no scene: write `scene = smc.Scene(title=..., conditions=...)`")
    return scene


def question(path: Path) -> str:
    """Return the first line of a scene file's docstring."""
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")[0]
