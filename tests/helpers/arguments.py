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
    shown = values[: 3 if all(isinstance(one, Scenario) for one in values) else 12]
    return f"[{', '.join([*map(reported, shown), *['...'] * (len(values) > len(shown))])}]"


def told_scenario(scenario: Scenario) -> str:
    """Return plant, law and what differs from the default."""
    plain = Scenario(plant=scenario.plant, law=scenario.law)
    given = {one.name: getattr(scenario, one.name) for one in dataclasses.fields(scenario)}
    changed = []
    for name, one in given.items():
        if one != getattr(plain, name):
            changed.append(f"{name}={reported(one)}")
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
        "{" + ", ".join(f"{key}: {reported(one)}" for key, one in values.items()) + "}"
    ),
    (list, tuple): told_items,
    (bool, int, float, str, range, NoneType, Condition, Starts, Uncertainty): repr,
}
