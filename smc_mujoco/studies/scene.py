"""A scene: one question, the runs that answer it, and how they are shown.

The folder scenes/ has a script for each.

The docstring of a scene file says the question, the figure of the paper that it answers, and what
to look for. The file
defines `scene`:

    scene = smc.Scene(title="Duffing", conditions={"nominal": smc.paper.comparison("duffing")})

The sentence that answers the question is made of parts, see `Outcome`. Values that differ by less
than the least relevant difference are tied, as on leaderboards. These are single runs: a study says
whether another start or noise would change the order.
"""

import ast
import dataclasses
import functools
import math
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.metadata import EntryPoint
from pathlib import Path

from smc_mujoco.analysis.paired_runs import floor
from smc_mujoco.analysis.ranking import exceeds
from smc_mujoco.common import errors
from smc_mujoco.common.catalogue import Catalogue, added, source
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.errors import find as lookup
from smc_mujoco.common.files import shipped, slug
from smc_mujoco.common.scripts import execute
from smc_mujoco.common.text import capital, every, joined, number
from smc_mujoco.draw.film.camera import Camera, checked
from smc_mujoco.metrics.catalogue import CATALOGUE, settling_time
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

Measure = str | Callable[[Trace], float]


def settles(trace: Trace) -> bool:
    """Return whether every channel stays in its settling band, from some time until the end of the
    run.
    """
    return math.isfinite(settling_time(trace))


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """The runs of a scene, and their outcome in words: the argument of `Scene.answer`.

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
        return list(dict.fromkeys(label for runs in self.traces.values() for label in runs))

    @property
    def named(self) -> str:
        """The labels in a row: "a, b and c", "none"."""
        return joined(self.labels) if self.labels else "none"

    def only(self, *labels: str) -> "Outcome":
        """Return the outcome of the runs with these labels."""
        for label in labels:
            lookup("label of the scene", label, dict.fromkeys(self.labels))
        return Outcome(
            traces={name: {x: run for x, run in runs.items() if x in labels} for name, runs in self}
        )

    def those(self, holds: Callable[[Trace], bool] = settles) -> "Outcome":
        """Return the outcome of the runs for which `holds` is true; by default, of those that
        settle.
        """
        kept = {
            name: {label: run for label, run in runs.items() if _true(holds, run)}
            for name, runs in self
        }
        return Outcome(traces=kept)

    def __iter__(self) -> Iterator[tuple[str, Mapping[str, Trace]]]:
        return iter(self.traces.items())

    def values(self, measure: Measure) -> dict[str, dict[str, float]]:
        """Return condition -> label -> value: NaN for a run that failed, inf for "never"."""
        value = _function(measure)
        return {name: {label: value(run) for label, run in runs.items()} for name, runs in self}

    def size(self, measure: Measure, unit: str = "") -> str:
        """Return a run's value, or the range over several: "0.323 s", "1.12 to 1.13 s, 1 failed",
        "never".

        Args:
          unit: unit of the value, if the measure is a function.
        """
        values = []
        for by_label in self.values(measure).values():
            for value in by_label.values():
                values.append(value)
        units = {unit or _unit(measure, run) for _, runs in self for run in runs.values()}
        if values:
            return _range(values, units.pop() if len(units) == 1 else "")
        return "none"

    def leaders(self, *measures: Measure) -> list[str]:
        """Return the labels whose value is smallest, or tied with the smallest, in every measure
        and condition.
        """
        winners = []
        for name in self.traces:
            for measure in measures:
                winners.append(self._level(name, measure, smallest=True))
        return [label for label in self.labels if all(label in level for level in winners)]

    def least(self, measure: Measure, unit: str = "") -> str:
        """Return whose value is smallest, with the value: "classical (1.12 s)", "a and b tied (1.12
        to 1.13 s)".

        Several conditions have a winner each: "classical (10 ms, 20 ms), adaptive (50 ms)". "none"
        where all fail.
        """
        return self._first(measure, unit, smallest=True)

    def most(self, measure: Measure, unit: str = "") -> str:
        """Return whose value is largest, as `least` does."""
        return self._first(measure, unit, smallest=False)

    def who(self, singular: str, plural: str, holds: Callable[[Trace], bool] = settles) -> str:
        """Return in words for which runs `holds` is true: "all 4 settle", "a and b settle, c does
        not".

        Over several conditions: "a settles in all 3 conditions, b in all but 50 ms, c in none".

        Args:
          singular: the verb, such as "settles", with what follows it.
          plural: the same for several runs, such as "settle".
          holds: whether a run counts; by default whether it settles.
        """
        where = self._where(holds)
        if len(self.traces) == 1:
            yes, no = (
                [label for label in where if bool(where[label]) == wanted]
                for wanted in (True, False)
            )
            return _one_condition(yes, no, singular, plural)
        parts: dict[tuple[str, tuple[str, ...]], list[str]] = {}
        for label, names in where.items():
            tried = [name for name, runs in self if label in runs]
            parts.setdefault((_share(names, tried), tuple(names)), []).append(label)
        first, *others = sorted(parts, key=lambda part: -len(part[1]))
        if not first[1]:
            return f"{_one_condition([], self.labels, singular, plural)} in any condition"
        sentence = f"{_all(parts[first], self.labels)} {singular if len(parts[first]) == 1 else plural} {first[0]}"
        return ", ".join([sentence, *(f"{joined(parts[part])} {part[0]}" for part in others)])

    def up_to(self, holds: Callable[[Trace], bool] = settles) -> str:
        """Return the last condition that each label tolerates, if the conditions are ordered from
        weak to strong.

        It is the last one before `holds` is first false: "a and b 20 ms, c 10 ms, d none". The
        sentence also names later conditions in which it is true again.
        """
        where = self._where(holds)
        words = {}
        for label, names in where.items():
            tried = [name for name, runs in self if label in runs]
            good = next((i for i, name in enumerate(tried) if name not in names), len(tried))
            again = [name for name in tried[good:] if name in names]
            text = tried[good - 1] if good else "none"
            if again:
                text += f" (and {joined(again)} again)"
            else:
                text += ""
            words.setdefault((-good, text), []).append(label)
        return ", ".join(f"{_all(words[key], self.labels)} {key[1]}" for key in sorted(words))

    def changes(self, measure: Measure, one: str, other: str, unit: str = "") -> str:
        """Return each label's value in one condition and in another: "a 1.20 to 1.43 s".

        A change below the least relevant difference is called that: "b no relevant change (0.535
        s)".
        """
        value = _function(measure)
        parts = []
        before, after = (
            lookup("condition of the scene", name, self.traces) for name in (one, other)
        )
        for label in (label for label in before if label in after):
            run = before[label]
            pair = [value(run), value(after[label])]
            size = _from_to(pair, unit or _unit(measure, run))
            level = not any(map(math.isnan, pair)) and not _exceeds(
                max(pair), min(pair), _floor(measure, run)
            )
            parts.append(f"{label} no relevant change ({size})" if level else f"{label} {size}")
        return ", ".join(parts) or "none"

    def _where(self, holds: Callable[[Trace], bool]) -> dict[str, list[str]]:
        """Return label -> the conditions in which `holds` is true for its run."""
        where: dict[str, list[str]] = {label: [] for label in self.labels}
        for name, runs in self:
            for label, run in runs.items():
                if _true(holds, run):
                    where[label].append(name)
        return where

    def _level(self, condition: str, measure: Measure, smallest: bool) -> dict[str, float]:
        """Return label -> value of the runs with the extreme value, or tied with it; {} if the
        smallest is "never".
        """
        values = self[condition].values(measure)[condition]
        known = {label: value for label, value in values.items() if not math.isnan(value)}
        if not known or (smallest and min(known.values()) == math.inf):
            return {}
        resolution = _floor(measure, self.traces[condition][next(iter(known))])
        best = (min if smallest else max)(known.values())
        ends = {}
        for label, value in known.items():
            if smallest:
                ends[label] = (value, best)
            else:
                ends[label] = (best, value)
        return {
            label: known[label] for label, (a, b) in ends.items() if not _exceeds(a, b, resolution)
        }

    def _first(self, measure: Measure, unit: str, smallest: bool) -> str:
        """Return in words the runs with the smallest or largest value of each condition."""
        winners: dict[tuple[str, ...], dict[str, list[float]]] = {}
        for name in self.traces:
            level = self._level(name, measure, smallest)
            winners.setdefault(tuple(level), {})[name] = list(level.values())
        parts = []
        for labels, where in winners.items():
            if len(labels) > 1:
                several = f"{joined(labels)} tied"
            else:
                several = joined(labels) if labels else "none"
            if 1 < len(labels) == len(self.labels):
                several = f"{_all(labels, self.labels)} tied"
            values = []
            for of_condition in where.values():
                for value in of_condition:
                    values.append(value)
            units = {
                unit or _unit(measure, self.traces[name][labels[0]]) for name in where if labels
            }
            if len(units) == 1:
                size = _range(values, units.pop())
            else:
                size = ""
            sized = f" ({size})" if size else ""
            if len(self.traces) == 1:
                parts.append(several + sized)
            elif len(winners) == 1:
                parts.append(f"{several} in {every(len(where))} conditions{sized}")
            else:
                parts.append(f"{several} ({', '.join(where)})")
        return ", ".join(parts)


def _function(measure: Measure) -> Callable[[Trace], float]:
    """Return the function of a measure; its value is NaN for a run that failed."""
    if not isinstance(measure, str) and not callable(measure):
        raise ScenarioError(
            f"a measure is {shown(measure)}: give the name of a metric, or a function of a trace"
        )
    if isinstance(measure, str):
        value = lookup("metric", measure, CATALOGUE).of
    else:
        value = measure
    return lambda run: math.nan if run.failure is not None else float(value(run))


def _true(holds: Callable[[Trace], bool], run: Trace) -> bool:
    """Return whether `holds` is true for a run; False for a run that failed."""
    return run.failure is None and bool(holds(run))


def _one_condition(yes: Sequence[str], no: Sequence[str], singular: str, plural: str) -> str:
    """Return the sentence of `who` for one condition: who does what the verb says, and who does
    not.
    """
    count = len(yes) + len(no)
    if not yes:
        if count == 1:
            return f"{no[0]} does not {plural}"
        return f"none of the {count} {singular}"
    if not no:
        if count == 1:
            return f"{yes[0]} {singular}"
        return f"{_all(yes, yes)} {plural}"
    return f"{joined(yes)} {singular if len(yes) == 1 else plural}, {joined(no)} {'does' if len(no) == 1 else 'do'} not"


def _share(names: Sequence[str], tried: Sequence[str]) -> str:
    """Return some of the conditions tried in words: "in all 3 conditions", "in all but 50 ms", "in
    none".
    """
    if len(names) == len(tried):
        return f"in {every(len(tried))} conditions"
    if not names:
        return "in none"
    missing = [name for name in tried if name not in names]
    if len(missing) < len(names):
        return f"in all but {joined(missing)}"
    return f"only in {joined(names)}"


def _all(some: Sequence[str], labels: Sequence[str]) -> str:
    """Return labels in a row, or "both" or "all 3" if these are all of several."""
    if len(some) == len(labels) > 1:
        return every(len(some))
    return joined(some)


def _exceeds(a: float, b: float, resolution: float) -> bool:
    """Return whether a is larger than b by more than the least relevant difference; inf is not
    larger than inf.
    """
    return a != b and bool(exceeds(a, b, resolution))


def _floor(measure: Measure, run: Trace) -> float:
    """Return the smallest value of a metric that matters, as on leaderboards; 0 for a function."""
    if isinstance(measure, str):
        return floor(run.scenario, measure)
    return 0.0


def _unit(measure: Measure, run: Trace) -> str:
    """Return the unit of a metric in a run; "" for a function."""
    if isinstance(measure, str):
        unit = CATALOGUE[measure].unit_in(run.scenario)
    else:
        unit = ""
    return "" if unit == "1" else unit


def _range(values: Sequence[float], unit: str) -> str:
    """Return the value, or the smallest and the largest: "0.323 s", "1.12 to 1.13 s, 1 failed",
    "never".
    """
    known = [value for value in values if not math.isnan(value)]
    if not known:
        return "failed"
    failed = len(values) - len(known)
    return _from_to((min(known), max(known)), unit) + f", {failed} failed" * bool(failed)


def _from_to(pair: Sequence[float], unit: str) -> str:
    """Return two values, or one if their texts are equal: "1.12 to 1.13 s", "0.4 s to never"."""
    texts = ["failed" if math.isnan(value) else number(value) for value in pair]
    if all(map(math.isfinite, pair)):
        return f"{' to '.join(dict.fromkeys(texts))} {unit}".rstrip()
    sized = (
        f"{text} {unit}".rstrip() if math.isfinite(v) else text
        for v, text in zip(pair, texts, strict=True)
    )
    return " to ".join(dict.fromkeys(sized))


def summary(runs: Outcome) -> str:
    """Return who settles, who is first, and who failed: the answer of a scene that declares none."""
    failed = []
    for name, condition in runs:
        for label, run in condition.items():
            if run.failure is not None:
                failed.append((label, name))
    parts = [runs.who("settles", "settle")]
    if runs.those().labels:
        parts.append(f"first: {runs.least('settling_time')}")
    if failed:
        parts.append(f"failed: {', '.join(f'{label} ({name})' for label, name in failed)}")
    return "; ".join(parts)


# the scene


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scene:
    """What a scene file declares.

    Attributes:
      title: shown on figures and films.
      conditions: condition -> label -> Scenario. Each condition gets a figure, which compares its
        labelled runs.
      film: the condition that is filmed; by default the first.
      figure: "overview" (as `smc.figure`, a figure for each condition), "signals" (u of all
        conditions in one) or "chattering" (amplitude over the actuator's lag, predicted and run,
        all conditions in one).
      answers: metrics of the driven channels that answer the scene's question, printed after the
        scores.
      answer: function of the `Outcome` of all runs that returns the sentence which answers the
        scene's question. The default says who settles, and who is first.
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
            raise ScenarioError(
                f"scene {self.title!r} has conditions {shown(self.conditions)}: give names with runs"
            )
        for condition, runs in self.conditions.items():
            errors.name(f"a condition of scene {self.title!r}", condition)
            if (
                not isinstance(runs, Mapping)
                or not runs
                or not all(isinstance(s, Scenario) for s in runs.values())
            ):
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
                raise ScenarioError(
                    f"scene {self.title!r} has names that make the same file name: {', '.join(same)}"
                )
        object.__setattr__(self, "film", self.film or next(iter(self.conditions)))
        lookup(f"condition to film in scene {self.title!r}", self.film, self.conditions)
        lookup("kind of figure", self.figure, dict.fromkeys(("overview", "signals", "chattering")))
        object.__setattr__(self, "camera", checked(self.camera))
        if isinstance(self.answers, str):
            answers = (self.answers,)
        else:
            answers = tuple(self.answers)
        object.__setattr__(self, "answers", answers)
        for name in answers:
            lookup(f"metric that answers scene {self.title!r}", name, CATALOGUE)
        if not callable(self.answer):
            raise ScenarioError(
                f"scene {self.title!r} has answer {shown(self.answer)}: give a function of its runs"
            )

    def sentence(self, traces: Mapping[str, Mapping[str, Trace]]) -> str:
        """Return the sentence that answers the question of the scene, from condition -> label ->
        Trace.
        """
        text = self.answer(Outcome(traces=traces))
        if not isinstance(text, str) or not text.strip():
            raise ScenarioError(
                f"the answer of scene {self.title!r} is {shown(text)}: give a function that returns text"
            )
        text = " ".join(text.split())
        labels = "|".join(re.escape(label) for _, label, _ in self.runs())
        # labels stay as in tables
        if not re.match(rf"(?:{labels})(?!\w)", text):
            text = capital(text)
        return text + "." * (not text.endswith((".", "?", "!")))

    def seeded(self, seed: int) -> "Scene":
        """Return the same scene with another seed in every run."""
        conditions = {
            condition: {
                label: dataclasses.replace(scenario, seed=seed) for label, scenario in runs.items()
            }
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
    """Return the scene file that an entry point of another package names.

    The file is read, and not run.
    """
    path = Path(str(source(point).origin))
    ast.parse(path.read_text(encoding="utf-8"), str(path))
    return path


def find(name: str) -> Path:
    """Return the scene file at a path, or the one of that name that comes with a package."""
    if os.path.isfile(name):
        return Path(name)
    if Path(name).suffix or Path(name).name != name:
        raise ScenarioError(
            f"no scene file {name}: give the path of a scene file, or a name from smc-mujoco list"
        )
    return lookup("scene", name, scenes())


def read(path: Path) -> Scene:
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
    """Return the first line of a scene file's docstring."""
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")[0]
