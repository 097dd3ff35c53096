"""Numbers of the parts of a scenario by their paths: FIELD.JOINT.NAME, as friction.elbow.kc, or
FIELD.NAME where only one part has such a number.
"""

import copy
import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Names
from smc_mujoco.common.constraints import Number, of_fields
from smc_mujoco.common.errors import ScenarioError, shown, unknown
from smc_mujoco.common.text import counted
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.mechanisms.plant import Plant

# Fields of a scenario whose parts have numbers
FIELDS = "friction", "actuator", "sensor", "contact", "disturbance"


class PartNumber(NamedTuple):
    """A number of a part of a scenario."""

    field: str
    part: int  # its index in the field
    name: str
    joint: int  # which of the part's joints, where each has a number; else -1

    def of(self, parts: Sequence[Any]) -> Any:
        """Return the number."""
        value = getattr(parts[self.part], self.name)
        return value if self.joint < 0 else value[self.joint]

    def put(self, parts: Sequence[Any], value: float) -> tuple[Any, ...]:
        """Return the parts with another number, unchecked: a search keeps within its range. A level
        at rest follows one while sliding that would pass it, and the other way round.
        """
        part = copy.copy(parts[self.part])
        if getattr(part, "is_of_file", False):  # a scenario takes the file's own from the plant
            object.__setattr__(part, "is_of_file", False)
        self._set(part, self.name, value)
        if partner := self.partner(parts):
            ordered: Names = getattr(part, "ordered", ())
            low, high = (np.ravel(getattr(part, name))[max(self.joint, 0)] for name in ordered)
            if low > high:
                self._set(part, partner.name, value)
        after = parts[self.part + 1 :]
        return *parts[: self.part], part, *after

    def partner(self, parts: Sequence[Any]) -> "PartNumber | None":
        """Return the other one of the two levels that a friction keeps in order; None without."""
        part = parts[self.part]
        ordered: Any = getattr(part, "ordered", ())
        if self.name not in ordered or getattr(part, ordered[1]) is None:
            return None
        (name,) = set(ordered) - {self.name}
        return self._replace(name=name)

    def _set(self, part: Any, name: str, value: float) -> None:
        """Set a number of a part, of this joint where each has one."""
        within = self.within(getattr(part, name), value)
        object.__setattr__(part, name, within)

    def within(self, every: Any, value: float) -> Any:
        """Return the part's field `every` with this number: one, or a tuple with one a joint."""
        if not isinstance(every, tuple):
            return value
        changed = list(every)
        changed[max(self.joint, 0)] = value
        return tuple(changed)


def is_path(name: str) -> bool:
    """Return whether a name may be a path to a number of a part."""
    field, dot, _ = name.partition(".")
    return bool(dot) and field in FIELDS


def parts_of(scenario: Any, field: str) -> tuple[Any, ...]:
    """Return the parts of a field of a scenario."""
    parts = getattr(scenario, field)
    if parts is None:
        return ()
    return parts if isinstance(parts, tuple) else (parts,)


def names_of(part: Any) -> list[str]:
    """Return the names of a part's numbers: of those declared as such, and of floats."""
    declared = of_fields(type(part))
    names = []
    for field in dataclasses.fields(part):
        is_number = any(ranges(declared.get(field.name)))
        if is_number or isinstance(getattr(part, field.name), float):
            names.append(field.name)
    return names


def paths_of_parts(scenario: Any, field: str) -> list[str]:
    """Return every path to a number of a field's parts."""
    paths = []
    for part in parts_of(scenario, field):
        joints = [f".{joint}" for joint in getattr(part, "on", ())] or [""]
        for joint in joints:
            for name in names_of(part):
                paths.append(f"{field}{joint}.{name}")
    return paths


def part_number(scenario: Any, path: str, paths: Sequence[str]) -> PartNumber:
    """Return where a number of a part is.

    Raises:
      ScenarioError: there is no such number among the paths `known`, several parts have it, it is
        one number of several joints, or no number is given.
    """
    field, *joint, name = path.split(".")
    plant = scenario.plant
    matches = []
    for i, part in enumerate(parts_of(scenario, field)):
        if not dataclasses.is_dataclass(part) or name not in names_of(part):
            continue
        joints = _joints_of(part, plant)
        if joint and ".".join(joint) not in joints:
            continue
        by_joint = isinstance(getattr(part, name), tuple)
        if by_joint and not joint:
            continue
        if joint and not by_joint and len(joints) > 1:
            raise ScenarioError(
                f"{path} is one number of {counted(len(joints), 'joint')}: name it "
                f"{field}.{name}, or give each joint its own {type(part).__name__}, as "
                f"{field}={{{'.'.join(joint)!r}: ...}}"
            )
        place = joints.index(".".join(joint)) if by_joint else -1
        matches.append(PartNumber(field, i, name, place))
    if not matches:
        raise unknown(f"number of {plant.name}", path, paths)
    if len(matches) > 1:
        raise ScenarioError(
            f"{path} is a number of {len(matches)} parts: name the joint, as {field}.JOINT.{name}"
        )
    value = matches[0].of(parts_of(scenario, field))
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise ScenarioError(f"{path} is {shown(value)}: give it a number in the scenario")
    return matches[0]


def changed(scenario: Any, factors: Mapping[str, float]) -> dict[str, Any]:
    """Return the fields of a scenario whose parts have factors on their numbers, by path. A number
    that is 0 gets the factor itself.

    Raises:
      ScenarioError: there is no such number, or it leaves its range.
    """
    paths = []
    for field in FIELDS:
        paths += paths_of_parts(scenario, field)
    of_parts: dict[tuple[str, int], dict[str, Any]] = {}
    for path, factor in factors.items():
        if path.startswith("disturbance."):
            raise ScenarioError(
                f"Jump has {path}, and a disturbance is a function of time by itself: give one "
                "that changes then, such as smc.signals.Held(times, values)"
            )
        place = part_number(scenario, path, paths)
        parts = parts_of(scenario, place.field)
        numbers = of_parts.setdefault((place.field, place.part), {})
        own = getattr(parts[place.part], place.name)
        current = numbers.get(place.name, own)
        value = place.of(parts)
        scaled = value * factor if value else factor
        numbers[place.name] = place.within(current, scaled)
    fields = {}
    for (field, i), numbers in of_parts.items():
        parts = fields.get(field, parts_of(scenario, field))
        replaced = dataclasses.replace(parts[i], **numbers)
        after = parts[i + 1 :]
        fields[field] = (*parts[:i], replaced, *after)
    for field, parts in fields.items():
        if not isinstance(getattr(scenario, field), tuple):
            (fields[field],) = parts
    return fields


def _joints_of(part: Any, plant: Plant) -> list[str]:
    """Return the joints that a part of a scenario acts on."""
    names = channel_names(plant)
    if hasattr(part, "channels"):
        return [names[i] for i in part.channels(plant) if i >= 0]
    return list(names)


def ranges(constraint: Any) -> Iterator[Number]:
    """Yield the Number in a constraint, which may be that of each joint."""
    while constraint is not None:
        if isinstance(constraint, Number):
            yield constraint
        constraint = getattr(constraint, "item", None)
