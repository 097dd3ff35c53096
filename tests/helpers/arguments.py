"""Arguments of a call as text, for records of what a command or a function hands on."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from types import NoneType
from typing import Any

from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.robustness.uncertainty import Uncertainty
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.grid import Starts
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies.scene import Scene


def reported(value: Any) -> str:
    """Return an argument as text: of what the package makes, its name and what differs from the
    default.
    """
    text = next((text for kind, text in TEXTS.items() if isinstance(value, kind)), None)
    if text:
        return text(value)
    return " ".join(filter(None, ["a", type(value).__name__, getattr(value, "name", "")]))


def told_items(values: list | tuple) -> str:
    """Return the first items of a list: twelve, or three scenarios."""
    values_told = values[: 3 if all(isinstance(entry, Scenario) for entry in values) else 12]
    return (
        f"[{', '.join([*map(reported, values_told), *['...'] * (len(values) > len(values_told))])}]"
    )


def told_scenario(scenario: Scenario) -> str:
    """Return plant, law and what differs from the default."""
    plain = Scenario(plant=scenario.plant, law=scenario.law)
    value_by_field = {
        field.name: getattr(scenario, field.name) for field in dataclasses.fields(scenario)
    }
    changed = []
    for name, setting in value_by_field.items():
        if setting != getattr(plain, name):
            changed.append(f"{name}={reported(setting)}")
    return f"Scenario({', '.join([reported(scenario.plant), reported(scenario.law), *changed])})"


TEXTS: dict[Any, Callable[[Any], str]] = {
    Scenario: told_scenario,
    Scene: lambda scene: (
        f"Scene({scene.title}, camera={scene.camera}, "
        f"seeds={ {s.seed for _, _, s in scene.runs()} })"
    ),
    Plant: lambda plant: f"plant {plant.name}",
    Component: lambda one: (
        f"{one.kind} {one.name if one.source.search else one}, gains of kind {one.source.kind}"
    ),
    Path: lambda path: f"Path({path.as_posix()})",
    Mapping: lambda values: (
        "{" + ", ".join(f"{key}: {reported(setting)}" for key, setting in values.items()) + "}"
    ),
    (list, tuple): told_items,
    (bool, int, float, str, range, NoneType, Condition, Starts, Uncertainty): repr,
}
