"""A scene: one question, the runs that answer it, and how they are shown.

The folder scenes/ has a script for each. The docstring of a scene file says the question, the
figure of the paper that it answers, and what to look for. The file defines `scene`:

    scene = smc.Scene(title="Duffing", conditions={"nominal": smc.paper.comparison("duffing")})

The text that answers the question is made of parts, see `Outcome`. Values that differ by less than
the least relevant difference are tied, as on leaderboards. These are single runs: a study says
whether another start or noise would change the order.
"""

import ast
import dataclasses
import functools
import itertools
import math
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.metadata import EntryPoint
from pathlib import Path

from smc_mujoco.analysis.paired_runs import floor
from smc_mujoco.analysis.ranking import exceeds
from smc_mujoco.common import errors
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, items_of, shown
from smc_mujoco.common.errors import find as lookup
from smc_mujoco.common.files import shipped, slug
from smc_mujoco.common.registry import Catalogue, added, module_spec
from smc_mujoco.common.scripts import execute
from smc_mujoco.common.text import first_paragraph, joined, number
from smc_mujoco.draw.film.camera import Camera, checked
from smc_mujoco.metrics.catalogue import CATALOGUE, arrived, settling_time
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

Measure = str | Callable[[Trace], float]
Holds = Callable[[Trace], bool]
FIGURES = dict.fromkeys(("overview", "signals", "chattering"))


def settles(trace: Trace) -> bool:
    """Return whether every channel stays in its settling band, from some time until the end of the
    run.
    """
    return math.isfinite(settling_time(trace))


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """The runs of a scene, and their outcome as text: the argument of `Scene.answer`.

    A measure is the name of a metric, or a function Trace -> float. For `least`, smaller values are
    better. A run that failed has no value, and every `holds` counts as False for it.

    Attributes:
      traces: condition -> label -> Trace.
    """

    traces: Mapping[str, Mapping[str, Trace]]

    def __getitem__(self, condition: str) -> "Outcome":
        """Return the outcome of one condition."""
        return Outcome(traces={condition: lookup("condition of the scene", condition, self.traces)})

    @property
    def labels(self) -> list[str]:
        """The labels of all runs."""
        return list(dict.fromkeys(itertools.chain.from_iterable(self.traces.values())))

    @property
    def named(self) -> str:
        """The labels in a row: "a, b and c", "none"."""
        return joined(self.labels) or "none"

    def only(self, *labels: str) -> "Outcome":
        """Return the outcome of the runs with these labels."""
        for label in labels:
            lookup("label of the scene", label, dict.fromkeys(self.labels))
        return self._filtered(lambda label, run: label in labels)

    def select(self, holds: Holds = settles) -> "Outcome":
        """Return the outcome of the runs for which `holds` is true; by default, of those that
        settle.
        """
        return self._filtered(lambda label, run: run.failure is None and bool(holds(run)))

    def _filtered(self, wanted: Callable[[str, Trace], bool]) -> "Outcome":
        selected = {}
        for name, runs in self.traces.items():
            selected[name] = {}
            for label, run in runs.items():
                if wanted(label, run):
                    selected[name][label] = run
        return Outcome(traces=selected)

    def values(self, measure: Measure) -> dict[str, dict[str, float]]:
        """Return condition -> label -> value: NaN for a run that failed, inf for "never"."""
        if isinstance(measure, str):
            value = lookup("metric", measure, CATALOGUE).of
        else:
            value = measure
        by_condition: dict[str, dict[str, float]] = {}
        for name, runs in self.traces.items():
            by_condition[name] = {}
            for label, run in runs.items():
                if run.failure is not None:
                    by_condition[name][label] = math.nan
                else:
                    by_condition[name][label] = float(value(run))
        return by_condition

    def size(self, measure: Measure, unit: str = "") -> str:
        """Return a run's value, or the range over several: "0.323 s", "1.12 to 1.13 s, 1 failed",
        "never".

        Args:
          unit: unit of the value, if the measure is a function.
        """
        values = []
        for by_label in self.values(measure).values():
            values += by_label.values()
        return _range(values, unit or self._unit(measure))

    def leaders(self, *measures: Measure) -> list[str]:
        """Return the labels whose value is smallest, or tied with the smallest, in every measure
        and condition.
        """
        leading: Counter[str] = Counter()
        for measure in measures:
            for name in self.traces:
                leading.update(list(self._level(name, measure, 1.0)))
        most = len(measures) * len(self.traces)
        leaders = []
        for label in self.labels:
            if leading[label] == most:
                leaders.append(label)
        return leaders

    def least(self, measure: Measure, unit: str = "") -> str:
        """Return whose value is smallest, with the value: "classical (1.12 s)", "a and b tied (1.12
        to 1.13 s)".

        Several conditions have one each: "classical (1 s) under 10 ms, none under 50 ms". "none"
        where all fail.
        """
        return self._first(measure, unit, 1.0)

    def most(self, measure: Measure, unit: str = "") -> str:
        """Return whose value is largest, as `least` does."""
        return self._first(measure, unit, -1.0)

    def count(self, plural: str, holds: Holds = settles) -> str:
        """Return for how many runs `holds` is true: "3 of 4 settle (not c)"; over several
        conditions "1 of 2 settle under nominal (not b), 2 of 2 under noise".

        Args:
          plural: the verb, such as "settle", with what follows it.
          holds: whether a run counts; by default whether it settles.
        """
        holding = self.select(holds).traces
        parts = []
        for name, runs in self.traces.items():
            failing = []
            for label in runs:
                if label not in holding[name]:
                    failing.append(label)
            text = f"{len(holding[name])} of {len(runs)}"
            if not parts:
                text += f" {plural}"
            if len(self.traces) > 1:
                text += f" under {name}"
            if failing:
                text += f" (not {joined(failing)})"
            parts.append(text)
        return ", ".join(parts)

    def up_to(self, holds: Holds = settles) -> str:
        """Return the last condition that each label tolerates, if the conditions are ordered from
        weak to strong: the last one before `holds` is first false, as in "a and b 20 ms, c none".
        """
        holding = self.select(holds).traces
        last: dict[str, list[str]] = {}
        for label in self.labels:
            tolerated = "none"
            for name, runs in holding.items():
                if label in self.traces[name]:
                    if label not in runs:
                        break
                    tolerated = name
            last.setdefault(tolerated, []).append(label)
        parts = []
        for name, labels in last.items():
            parts.append(f"{joined(labels)} {name}")
        return ", ".join(parts)

    def changes(self, measure: Measure, one: str, other: str, unit: str = "") -> str:
        """Return each label's value in one condition and in another: "a 1.20 to 1.43 s"."""
        before = self[one].values(measure)[one]
        after = self[other].values(measure)[other]
        unit = unit or self._unit(measure)
        parts = []
        for label in before:
            if label in after:
                parts.append(f"{label} {_from_to((before[label], after[label]), unit)}")
        return ", ".join(parts) or "none"

    def _level(self, condition: str, measure: Measure, sign: float) -> dict[str, float]:
        """Return label -> value of the runs with the smallest value, or for a sign of -1 with the
        largest, or tied with it; {} if the smallest is "never".
        """
        values = self[condition].values(measure)[condition]
        runs = self.traces[condition]
        # who does nothing is calm
        to_arrive = isinstance(measure, str) and sign > 0.0 and not CATALOGUE[measure].error
        comparable = {}
        for label, value in values.items():
            if math.isnan(value) or (to_arrive and not arrived(runs[label])):
                continue
            comparable[label] = value
        best = min(comparable.values(), key=lambda value: sign * value, default=math.nan)
        if not comparable or sign * best == math.inf:
            return {}
        least = 0.0
        if isinstance(measure, str):
            least = floor(self.traces[condition][next(iter(comparable))].scenario, measure)
        level = {}
        for label, value in comparable.items():
            if sign > 0.0:
                worse, better = (value, best)
            else:
                worse, better = (best, value)
            if worse == better or not exceeds(worse, better, least):
                level[label] = value
        return level

    def _first(self, measure: Measure, unit: str, sign: float) -> str:
        """Return the runs with the smallest or largest value of each condition."""
        parts = []
        for name in self.traces:
            level = self._level(name, measure, sign)
            text = joined(level) or "none"
            if len(level) > 1:
                text += " tied"
            if level:
                text += f" ({_range(list(level.values()), unit or self[name]._unit(measure))})"
            if len(self.traces) > 1:
                text += f" under {name}"
            parts.append(text)
        return ", ".join(parts)

    def _unit(self, measure: Measure) -> str:
        """Return the unit of a metric, if it is the same in all runs; "" for a function."""
        if not isinstance(measure, str):
            return ""
        units = set()
        for runs in self.traces.values():
            for run in runs.values():
                units.add(CATALOGUE[measure].unit_in(run.scenario))
        if len(units) > 1 or units == {""}:
            return ""
        return "".join(units)


def _range(values: Sequence[float], unit: str) -> str:
    """Return the value, or the smallest and the largest: "0.323 s", "1.12 to 1.13 s, 1 failed",
    "never"; "none" of none.
    """
    numbers = []
    for value in values:
        if not math.isnan(value):
            numbers.append(value)
    failed = len(values) - len(numbers)
    parts = []
    if numbers:
        parts.append(_from_to((min(numbers), max(numbers)), unit))
    if failed:
        parts.append(f"{failed} failed")
    return ", ".join(parts) or "none"


def _from_to(pair: tuple[float, float], unit: str) -> str:
    """Return two values, or one if their texts are equal: "1.12 to 1.13 s", "0.4 s to never"."""
    texts = []
    for value in pair:
        if math.isnan(value):
            text = "failed"
        else:
            text = number(value)
        texts.append(f"{text} {unit}".rstrip() if math.isfinite(value) else text)
    if all(map(math.isfinite, pair)) and texts[0] != texts[1]:
        texts[0] = number(pair[0])
    return " to ".join(dict.fromkeys(texts))


def scene_answer(runs: Outcome) -> str:
    """Return who settles, is first, and failed: the answer of a scene that declares none."""
    parts = [runs.count("settle"), f"first: {runs.select().least('settling_time')}"]
    failed = runs._filtered(lambda label, run: run.failure is not None)
    if failed.labels:
        parts.append(f"failed: {failed.named}")
    return "; ".join(parts)


# the scene


@keyword_dataclass
class Scene:
    """What a scene file declares.

    Attributes:
      title: shown on figures and films.
      conditions: condition -> label -> Scenario. Each condition gets a figure, which compares its
        labelled runs.
      film: the condition that is filmed; by default the first.
      figure: "overview" (as `smc.figure`, a figure for each condition), "signals" (the same of u
        alone) or "chattering" (amplitude over the actuator's lag, predicted and run, all conditions
        in one).
      answers: metrics of the driven channels that answer the scene's question, printed after the
        scores.
      answer: function of the `Outcome` of all runs that returns the text which answers the
        scene's question. The default says who settles, and who is first.
      camera: of the film, as `smc.film` takes it; default: the plant's own.
    """

    title: str
    conditions: Mapping[str, Mapping[str, Scenario]]
    film: str = ""
    figure: str = "overview"
    answers: tuple[str, ...] = ()
    answer: Callable[[Outcome], str] = dataclasses.field(default_factory=lambda: scene_answer)
    camera: Camera | None = None

    def __post_init__(self):
        errors.name("title", self.title)
        _check_runs("a scene", "conditions", self.conditions)
        label_of: dict[str, str] = {}
        for condition, runs in self.conditions.items():
            _check_runs(f"condition {condition!r}", "labels", runs)
            plants = set()
            for label, scenario in runs.items():
                if not isinstance(scenario, Scenario):
                    raise ScenarioError(f"run {label!r} is {shown(scenario)}: give a Scenario")
                plants.add(scenario.plant.name)
                file = f"{slug(condition)}-{slug(label)}"
                if label_of.setdefault(file, label) != label:
                    raise ScenarioError(
                        f"{label_of[file]} and {label} have one file name: rename one"
                    )
            if len(plants) > 1:
                raise ScenarioError(
                    f"condition {condition!r} has the plants {', '.join(sorted(plants))}, which "
                    "share no axes: give each plant its own condition"
                )
        if len({slug(condition) for condition in self.conditions}) < len(self.conditions):
            raise ScenarioError(f"conditions of {self.title!r} have one file name: rename one")
        film = self.film
        if isinstance(film, str) and not film:
            film = next(iter(self.conditions))
        lookup("condition to film", film, self.conditions)
        lookup("kind of figure", self.figure, dict.fromkeys(FIGURES))
        for name in items_of("answers", self.answers):
            lookup("metric that answers", name, CATALOGUE)
        object.__setattr__(self, "film", film)
        object.__setattr__(self, "camera", checked(self.camera))

    def sentence(self, traces: Mapping[str, Mapping[str, Trace]]) -> str:
        """Return the text that answers the question of the scene, from condition -> label -> Trace,
        on one line.
        """
        return " ".join(self.answer(Outcome(traces=traces)).split())

    def seeded(self, seed: int) -> "Scene":
        """Return the same scene with another seed in every run."""
        conditions: dict[str, dict[str, Scenario]] = {}
        for condition, label, scenario in self.runs():
            seeded = dataclasses.replace(scenario, seed=seed)
            conditions.setdefault(condition, {})[label] = seeded
        return dataclasses.replace(self, conditions=conditions)

    def runs(self) -> Iterator[tuple[str, str, Scenario]]:
        """Yield (condition, label, scenario) of every run."""
        for condition, runs in self.conditions.items():
            for label, scenario in runs.items():
                yield condition, label, scenario


def _check_runs(what: str, names: str, given: object) -> None:
    """Refuse what is no mapping of names."""
    if not isinstance(given, Mapping) or not given:
        raise ScenarioError(f"{what} has {names} {shown(given)}: give names with runs")
    for name in given:
        errors.name(f"{names} of {what}", name)


@functools.cache
def scenes() -> Catalogue[Path]:
    """Return name -> file of every scene that comes with the package, or with another one."""
    library = {}
    for path in sorted(shipped("scenes").glob("*.py")):
        library[path.stem] = path
    return Catalogue(library, added("smc_mujoco.scenes", _of_package))


def _of_package(point: EntryPoint) -> Path:
    """Return the scene file that an entry point of another package names.

    The file is read, and not run.
    """
    path = Path(str(module_spec(point).origin))
    ast.parse(path.read_text(encoding="utf-8"), str(path))
    return path


def find(name: str) -> Path:
    """Return the scene file at a path, or the one of that name that comes with a package."""
    if os.path.isfile(name) and name.endswith(".py"):
        return Path(name)
    if Path(name).suffix or Path(name).name != name:
        raise ScenarioError(
            f"no scene file {name}: give the path of a .py file, or a name from smc-mujoco list; "
            "for your own model give smc-mujoco compare FILE.xml:joint --law pid"
        )
    return lookup("scene", name, scenes())


def read_scene(path: Path) -> Scene:
    """Return the scene that a file declares."""
    main = sys.modules["__main__"]
    if getattr(main, "__file__", None) and Path(str(main.__file__)).resolve() == path.resolve():
        scene = vars(main).get("scene")  # it is running already, as a script
    else:
        scene = execute(path).get("scene")
    if not isinstance(scene, Scene):
        raise ScenarioError(
            f"{path} declares no scene: write `scene = smc.Scene(title=..., conditions=...)`"
        )
    return scene


def question(path: Path) -> str:
    """Return the first paragraph of a scene file's docstring."""
    return first_paragraph(ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))))
