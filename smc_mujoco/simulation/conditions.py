"""Conditions: noise, disturbances, delays and other circumstances of a run, as named fields of a
Scenario.

    worn = smc.condition("worn gear", friction=smc.Coulomb(0.05), actuator=smc.Backlash(0.02))
    smc.grid(["duffing"], ["classical"], ["nominal", worn, "noise + delay_10ms"], seeds=16)

A condition applies to any plant. Those of the suite are in `NAMED`, under names such as "noise".
Names joined by "+" apply together. As text, a condition is its name, a colon and its fields,
written as in Python. Such a text is parsed, and only a file that it names is run:

    worn gear: friction=Coulomb(0.05), sensor=Encoder(counts=4096)
    mine: friction=my_parts.py:stribeck(static=0.3)
"""

import contextlib
import dataclasses
import functools
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.common import errors
from smc_mujoco.common.aliases import AnyPath
from smc_mujoco.common.errors import ScenarioError, find, number, shown, unknown
from smc_mujoco.common.files import reading
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.scripts import IN_FILE, object_named
from smc_mujoco.common.text import joined
from smc_mujoco.control import gain_sets
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.condition_text import assignments, read_fields, value_text
from smc_mujoco.simulation.law_checks import NOT_OF_FREE_BODIES
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.suite_conditions import IDEAL, REAL, Recipe

MAX_JOINED = 20  # conditions in one name: chosen
GRID_FIELDS = ("plant", "law", "model", "surface", "seed", "duration")  # that a grid sets itself
CONDITION_FIELDS = [name for name in Scenario.fields() if name not in GRID_FIELDS]
# their values add up when conditions are joined
ADDITIVE_FIELDS = ("disturbance", "friction", "actuator", "contact")

# The suite's defaults, under which its plants and laws are compared.
PLANTS = tuple(gain_sets.STUDY)  # the plants of the first paper
DURATION, CONTROL_PERIOD = 10.0, 1e-3  # s


@dataclasses.dataclass(frozen=True)
class Condition:
    """A named condition; see `condition`."""

    name: str
    fields: Recipe
    # the file that it was read from, if it was all of it, for commands that are printed
    file: str = dataclasses.field(default="", compare=False, repr=False)

    def __post_init__(self):
        if not callable(self.fields):
            fields = {}
            for name, value in self.fields.items():
                fields[name] = _frozen(value)
            object.__setattr__(self, "fields", frozen(fields))

    def __reduce__(self):
        """Pickle one of the suite by its name: its fields may be a function in a function."""
        if all(name.strip() in NAMED for name in self.name.split("+")):
            return find_condition, (self.name,)
        return super().__reduce__()

    def on(self, plant: Plant, duration: float) -> dict[str, Any]:
        """Return the Scenario fields for a plant and a duration, s.

        Single events happen at half of the duration.
        """
        length = number("duration", duration, above=0.0)
        template = self.fields(plant, length) if callable(self.fields) else self.fields
        fields = dict(template)
        refused = []
        for name in NOT_OF_FREE_BODIES:
            if plant.pose and fields.get(name) and not isinstance(fields[name], Mapping):
                refused.append(name)
        if refused:
            raise ScenarioError(
                f"condition {self.name!r} sets {refused[0]}, and {plant.name} is a free body, "
                "which takes none: choose another condition"
            )
        return fields

    def __add__(self, other: "Condition | str") -> "Condition":
        """Return both at once.

        Disturbances, frictions and actuators add up; other fields must not differ.
        """
        pair = self, find_condition(other)
        return Condition(
            f"{self.name} + {pair[1].name}",
            lambda plant, duration: _joined_fields(pair, plant, duration),
        )

    def __str__(self) -> str:
        """Return the text that `parse` reads, or the name alone for a condition of the suite."""
        return self.text()

    def text(self, files: bool = True) -> str:
        """Return the text that `parse` reads, or the name alone for a condition of the suite.

        Without `files` it names a user's part alone, without the file that has it.
        """
        if self.name in NAMED or callable(self.fields):
            return self.name
        try:
            texts = assignments(self.fields, functools.partial(value_text, files=files))
        # the repr of a value that no scenario takes may fail; this text is for the error about it
        except Exception:
            texts = assignments(self.fields, shown)
        return f"{self.name}: {texts}"

    def brief(self, plant: Plant, duration: float) -> str:
        """Return the fields on a plant for people, without those of parts that are none or 0 by
        default; arguments and errors as in `on`.
        """
        fields = self.on(plant, duration)
        return assignments(fields, functools.partial(value_text, files=False, brief=True))


def condition(name: str, **fields: Any) -> Condition:
    """Return your own condition, for `grid`, `tune`, `margins` and `basin`.

        smc.condition("dry", friction=smc.Coulomb(0.05), noise=smc.Noise(position=1e-3))

    In its place these functions, as the commands, take its text, or the path of a text file with
    one condition a line, as `Identified.save` writes it. They take the names of
    the suite's conditions, too, such as noise, sine, step, delay_10ms, light, heavy, jump_hard,
    period_20ms, friction, coulomb, stiction, lag_20ms, dc_motor, backlash, encoder, contact and
    fault; `smc-mujoco list` has all.

    Args:
      name: its name in tables and figures; not a name of the suite. Or, without fields, the text of
        a condition, such as "dry: friction=Coulomb(0.05)", or names of the suite's, such as
        "noise+encoder".
      fields: fields of a Scenario, such as friction=smc.Coulomb(0.05), except plant, law, model,
        surface, seed and duration.

    Returns:
      A Condition.

    Raises:
      ScenarioError: the name is one of the suite's, a field does not exist or belongs to no
        condition, or there is no field at all.
    """
    if isinstance(name, str) and set(":+") & set(name) and not fields:
        return find_condition(name)
    if errors.name("a condition's name", name) in NAMED:
        raise ScenarioError(f"condition {name!r} is a name of the suite: give another")
    if set(":+,") & set(name):
        raise ScenarioError(f"condition {shown(name)} has one of : + , in it: give another name")
    if not fields:
        raise ScenarioError(
            f"condition {name!r} has no fields: give some, such as friction=smc.Coulomb(0.05)"
        )
    for field in fields:
        if field in GRID_FIELDS:
            raise ScenarioError(
                f"condition {name!r} sets {field}, which the grid sets itself: leave it out"
            )
        if field not in CONDITION_FIELDS:
            raise unknown("field of a Scenario", field, CONDITION_FIELDS)
    return Condition(name, fields)


def find_condition(value: "Condition | AnyPath") -> Condition:
    """Return the Condition for a Condition, a name, several names joined by "+", the text of a
    condition, or the path of a text file with one.
    """
    conditions = find_conditions(value)
    if len(conditions) != 1:
        names = joined(repr(condition.name) for condition in conditions)
        raise ScenarioError(
            f"{str(value)!r} has {len(conditions)} conditions ({names}), and this takes one: leave "
            "the others out, or join two as noise+encoder"
        )
    return conditions[0]


def find_conditions(value: "Condition | AnyPath") -> list[Condition]:
    """Return what `find_condition` does, or every condition of a file."""
    if isinstance(value, Condition):
        return [value]
    if isinstance(value, os.PathLike) or _is_path(value):
        return from_file(Path(value))
    return [_of_text(value)]


def _is_path(text: object) -> bool:
    """Return whether a text is the path of a file, and no name or text of a condition."""
    if not isinstance(text, str) or set(":=(") & set(text) or text in NAMED:
        return False
    path = Path(text)
    return path.name != text or bool(path.suffix) or os.path.isfile(path)


def _of_text(value: object) -> Condition:
    """Return the condition of names joined by "+", or of a text."""
    if not isinstance(value, str):
        raise ScenarioError(f"condition is {shown(value)}: give a name, or smc.condition(...)")
    if in_file := IN_FILE.fullmatch(value):
        kind = f'condition (of a part: "{in_file["name"]}: friction={value}")'
        return object_named(value, kind, lambda thing: isinstance(thing, Condition))
    if ":" in value:
        return parse(value)
    if set("=(") & set(value):
        raise ScenarioError(
            f"condition {shown(value)} has no colon: write a name, a colon and fields, as worn: "
            "x0=0.3"
        )
    if (count := value.count("+") + 1) > MAX_JOINED:
        raise ScenarioError(
            f"condition {shown(value)} joins {count:,} conditions: give at most {MAX_JOINED}"
        )
    first, *further = [_named(part.strip()) for part in value.split("+")]
    return sum(further, start=first)


def _named(name: str) -> Condition:
    """Return a condition of the suite."""
    if name not in NAMED and (delay := OTHER_DELAY.fullmatch(name)):
        seconds = f"{float(delay[1]) / 1e3:g}"
        raise ScenarioError(
            f"unknown condition {name!r}: write another delay as 'late: input_delay={seconds}'"
        )
    return find("condition", name, NAMED)


def applicable(names: Iterable[str], plants: Sequence[Plant], duration: float) -> list[str]:
    """Return those of the names, of conditions of the suite, that apply to every plant."""
    fitting = []
    for name in names:
        with contextlib.suppress(ScenarioError):
            for plant in plants:
                fields = NAMED[name].on(plant, duration)
                Scenario.recorded(plant=plant, law="none", duration=duration, **fields)
            fitting.append(name)
    return fitting


def parse(text: str) -> Condition:
    """Return the condition that a text describes, such as "worn gear: friction=Coulomb(0.05)"."""
    name, _, fields = text.partition(":")
    if set(",+") & set(name):
        raise ScenarioError(
            f"condition {shown(text)} has a comma or a + before its colon: a condition of your own "
            "needs its own --condition, in Python its own text"
        )
    try:
        values = read_fields(fields)
    except SyntaxError:
        cure = 'write it as "worn gear: friction=Coulomb(0.05), x0=0.3"'
        if with_unit := re.search(r"\b\d[\d.]*(?![eE][-+]?\d)[a-zA-Z]+", fields):
            cure = f"numbers stand without a unit, in SI, and {with_unit[0]!r} has one"
        raise ScenarioError(f"condition {shown(text)} cannot be read: {cure}") from None
    return condition(name.strip(), **values)


def from_file(path: Path) -> list[Condition]:
    """Return the conditions in a text file, one per line.

    Empty lines and lines that begin with # are skipped.
    """
    cure = "give a text file, one condition a line, or a condition, such as worn: x0=0.3"
    with reading(path, "file of conditions", cure) as file:
        lines = file.read_text(encoding="utf-8").splitlines()
    conditions = []
    for count, line in enumerate(lines, 1):
        text = line.strip()
        try:
            if text and not text.startswith("#"):
                conditions.append(_of_text(text))
        except ScenarioError as error:
            raise ScenarioError(f"line {count} of {str(path)!r}: {error}") from None
    if not conditions:
        raise ScenarioError(f"{str(path)!r} has no condition: write one on a line")
    if len(conditions) == 1:
        return [dataclasses.replace(conditions[0], file=str(path))]
    return conditions


def _frozen(value: Any) -> Any:
    """Return an immutable copy of a field's value."""
    if isinstance(value, Mapping):
        return frozen(value)
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        return tuple(value)
    return value


def _differ(first: Any, second: Any) -> bool:
    """Return whether two values of a field differ, as those do that cannot be compared."""
    try:
        return bool(first != second)
    except Exception:  # no scenario takes such a value; the caller's sentence names the field
        return True


def _joined_fields(
    pair: tuple[Condition, Condition], plant: Plant, duration: float
) -> dict[str, Any]:
    """Return the fields of two conditions at once."""
    first, second = (condition.on(plant, duration) for condition in pair)
    for field in second:
        if field not in first:
            continue
        if field in ADDITIVE_FIELDS:
            earlier = coerce.as_tuple(first[field])
            second[field] = *earlier, *coerce.as_tuple(second[field])
        elif _differ(first[field], second[field]):
            names = " and ".join(repr(condition.name) for condition in pair)
            raise ScenarioError(
                f"conditions {names} both set {field}: give one of them, or smc.condition(...)"
            )
    return first | second


OTHER_DELAY = re.compile(r"delay_([0-9.]+)ms")
NAMED: dict[str, Condition] = {
    name: Condition(name, fields) for name, fields in (IDEAL | REAL).items()
}
