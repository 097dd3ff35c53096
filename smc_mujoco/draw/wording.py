"""What pictures call laws, runs, plants and conditions, and what differs between runs."""

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import Any

from smc_mujoco.common.errors import ScenarioError, items_of, shown
from smc_mujoco.common.text import capital, stated
from smc_mujoco.control import estimator as estimators
from smc_mujoco.control import surface as surfaces
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import all_laws
from smc_mujoco.mechanisms.plant import Plant, plant_catalogue
from smc_mujoco.metrics.conventions import groups
from smc_mujoco.metrics.once_per_trace import once_per_trace
from smc_mujoco.simulation.conditions import CONDITION_FIELDS
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Fault, Jump
from smc_mujoco.simulation.trace import Trace

# where a word begins in DCMotor, but not in LuGre
CAMEL = re.compile(r"(?:(?<=[a-z]{3})|(?<=[A-Z]{2}))([A-Z])(?=[a-z])")
MAX_VALUES = 8  # numbers of a label
MAX_LETTERS = 50  # of what a label says of one field; chosen


def law_name(law: Component | str) -> str:
    """Return a law's label: its own, or its name in words. A user's law keeps the user's name."""
    template, name = _template(law)
    return (template and template.label) or (in_words(name) if name in all_laws() else name)


def run_name(trace: Trace) -> str:
    """Return the label of a run's law; where servos hold the joints without one, "Servo alone"."""
    law = trace.scenario.law
    held = any(group.is_set_point for group in groups(trace.scenario))
    return "Servo alone" if held and law.name == "none" else law_name(law)


def label(name: str) -> str:
    """Return the label of the library's law, surface or estimator of this name; other words
    unchanged.
    """
    named_parts = surfaces.surface_catalogue() | estimators.estimator_catalogue()
    if name in all_laws():
        return law_name(name)
    return in_words(name) if name in named_parts else name


def _template(law: Component | str) -> tuple[Template | None, str]:
    """Return the template of a law, if there is one, and the law's name."""
    if isinstance(law, str):
        return all_laws().get(law), law
    return law.template or all_laws().get(law.name), law.name


def titled(title: object, default: str) -> str:
    """Return the title that a user gives, on one line, or for None the default."""
    if title is None:
        return default
    line = " ".join(title.split()) if isinstance(title, str) else "\n"
    if not line.isprintable():
        raise ScenarioError(f"title is {shown(title)}: give a text")
    return line


def in_words(name: str) -> str:
    """Return an identifier as words: boundary_layer as "Boundary layer"."""
    return capital(name.replace("_", " "))


def run_names(traces: Sequence[Trace], own_labels: Sequence[str] | None) -> list[str]:
    """Return one label per trace: the given ones, else the laws' labels, with what differs between
    runs of one law.

    Machines whose parameters differ have these in their labels, whatever their laws. Equal labels
    are numbered.
    """
    if own_labels is not None:
        own_labels = items_of("labels", own_labels)
        if len(own_labels) != len(traces):
            raise ScenarioError(
                f"labels are {shown(own_labels)} for {len(traces)} traces: give one string a trace"
            )
        texts = []
        for label in own_labels:
            texts.append(label if isinstance(label, str) else shown(label))
        return texts
    names = list(map(run_name, traces))
    label_texts = []
    for trace, name in zip(traces, names, strict=True):
        words = differences(trace, traces)
        label_texts.append(f"{name}: {words}" if words else name)
    return numbered(label_texts)


def numbered(names: Sequence[str]) -> list[str]:
    """Return names, equal ones with numbers behind them."""
    apart = []
    for i, name in enumerate(names):
        is_repeated = names.count(name) > 1
        apart.append(f"{name} {names[:i].count(name) + 1}" if is_repeated else name)
    return apart


def differences(trace: Trace, others: Sequence[Trace]) -> str:
    """Return how a run differs from those of its law, and its machine from all, as "k1 = 6, no
    noise, m = 0.7".

    Where the condition differs, its name replaces the fields that are equal in all its runs.
    """
    scenario = trace.scenario
    law = run_name(trace)
    alike = []
    same = []
    for run in others:
        if run_name(run) == law:
            alike.append(run)
            if run.scenario.condition == scenario.condition:
                same.append(run)
    parts = []
    for name, words in _settings(trace).items():
        runs = same if name in CONDITION_FIELDS else alike
        if any(_settings(run).get(name) != words for run in runs):
            parts.append(_few(words))
    for name, words in _parameters(trace).items():
        # a payload is a parameter only where a mismatch names it
        if any(_parameters(run).get(name) != words for run in others):
            parts.append(f"plant's {words}" if name in scenario.law.gains else words)
    return ", ".join(parts)


def _few(words: str) -> str:
    """Return what a label says of a field, without its last items if it is long."""
    if len(words) <= MAX_LETTERS:
        return words
    shortened, _, _ = words[: MAX_LETTERS + 1].rpartition(",")
    return shortened or words


def _as_words(values: Mapping[str, Any]) -> dict[str, str]:
    return {name: _setting(name, value) for name, value in values.items()}


@once_per_trace
def _settings(trace: Trace) -> Mapping[str, str]:
    """Return the condition and the gains of a run, and the other fields of its scenario, in
    words.
    """
    scenario = trace.scenario
    values = {"condition": scenario.condition, **scenario.law.gains}
    for name in Scenario.fields():
        if name not in ("law", "plant", "mismatch"):
            values[name] = getattr(scenario, name)
    words = _as_words(values)
    if scenario.plant.is_user_model:  # whose file may have some
        words["friction"] = _setting("added friction", scenario.friction)
    return words


def _parameters(trace: Trace) -> dict[str, str]:
    """Return the true parameters of a run's machine in words."""
    true = vars(trace.scenario.plant.values(trace.scenario.mismatch))
    return _as_words(true)


def distinct(names: Sequence[str]) -> list[str]:
    """Return labels without the law that all of them begin with: "k = 1", "k = 2" of "Twisting: k =
    1", ...
    """
    law = f"{names[0].partition(': ')[0]}: "
    if all(name.startswith(law) for name in names):
        return [name.removeprefix(law) for name in names]
    return list(names)


def _setting(name: str, value: object) -> str:
    """Return a gain or a field of a scenario in words."""
    words = name.replace("_", " ")
    if name == "condition":
        return str(value).replace("_", " ")
    if isinstance(value, Jump | Fault):
        return value.text
    if value is True:
        return words
    if value in (None, False, ()) and not isinstance(value, int | float):
        return f"no {words}"
    text = _value(value).removeprefix(f"{capital(words)}, ")  # a noise is a Noise
    if text == capital(words):
        return f"no {words}"
    first = value[0] if isinstance(value, tuple) else value
    return f"{words} = {text}" if isinstance(first, int | float) else f"{words} {text}"


def _value(value: object) -> str:
    """Return a value of a field in words, such as "0.5", "Coulomb 0.005" or "Encoder, counts
    2000".
    """
    if isinstance(value, int | float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        parts = value[:1] if len(set(value)) == 1 else value
        few = ", ".join(map(_value, parts))
        return few if len(parts) <= MAX_VALUES else f"{len(value)} values"
    if isinstance(value, Component):
        return law_name(value)
    if not dataclasses.is_dataclass(value):
        return str(value).replace("_", " ")
    kind = re.sub(CAMEL, lambda start: f" {start[1].lower()}", type(value).__name__)
    words = [kind]
    alone = len(stated(value)) == 1
    for name, part in stated(value, defaults=False).items():
        said = _value(part)
        words.append(said if alone else f"{name.replace('_', ' ')} {said}")
    return (" " if alone else ", ").join(words)


def ending(trace: Trace) -> str:
    """Return how a run failed: "diverged at 0.4 s" (the plant) or "failed at 0.4 s" (its law); ""
    if it did not.
    """
    if trace.diverged_at is None:
        return ""
    return f"{'diverged' if trace.plant_diverged else 'failed'} at {trace.diverged_at:.3g} s"


def plant_name(plant: Plant | str, short: bool = False) -> str:
    """Return the plant's label: its own, or its name in words.

    A user's model keeps the user's name.
    """
    if isinstance(plant, str):
        library_plant = plant_catalogue().get(plant)
        return plant_name(library_plant, short) if library_plant else plant
    if short and plant.short:
        return plant.short
    return plant.label or (plant.name if plant.is_user_model else in_words(plant.name))


def head(scenarios: Sequence[Scenario]) -> str:
    """Return what a picture of runs is about: their plant, and their condition if all have the same
    one with a name.
    """
    return heading(
        [scenarios[0].plant], [scenario.condition or "nominal" for scenario in scenarios]
    )


def heading(
    plants: Sequence[Plant | str], conditions: Sequence[str] = (), short: bool = False
) -> str:
    """Return plants, and the condition if there is only one, which is not the nominal one."""
    plant_names = dict.fromkeys(plant_name(plant, short) for plant in plants)
    head = ", ".join(plant_names)
    if len(set(conditions)) == 1 and conditions[0] != "nominal":
        return under(head, condition_name(conditions[0]))
    return head


def under(title: str, condition: str) -> str:
    """Return a title followed by the condition, unless it names that already."""
    named = re.search(rf"\b{re.escape(condition)}\b", title, re.IGNORECASE)
    return title if named else f"{title}, {condition}"


def condition_name(condition: str) -> str:
    """Return a condition as pictures and LaTeX name it, such as "delay 10 ms"."""
    return re.sub(r"(?<=\d)ms\b", " ms", condition.replace("_", " "))


def short(value: float, digits: int = 2) -> str:
    """Return a number with few digits, such as 0.25, 6, 280; with an exponent from 1e6 on and below
    1e-4.
    """
    return f"{float(f'{value:.{digits}g}'):g}"
