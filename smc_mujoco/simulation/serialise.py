"""A scenario as JSON data and back."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from typing import Any, TypeVar

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.fingerprint import arithmetic
from smc_mujoco.common.registry import subclasses
from smc_mujoco.common.version import __version__
from smc_mujoco.control import serialise as components
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import catalogue as estimators
from smc_mujoco.control.surface import catalogue as surfaces
from smc_mujoco.mechanisms.custom.plant_from import UserModel, restored
from smc_mujoco.mechanisms.hardware import backlash, drives, friction, servos  # noqa: F401  # whose parts a file may name
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation import time_series, waypoints  # noqa: F401  # whose signals a file may name
from smc_mujoco.simulation.clock import Clock
from smc_mujoco.simulation.perturbations import Jump, Noise
from smc_mujoco.simulation.scenario import Resolved, Scenario
from smc_mujoco.simulation.signals import PerChannel, Recorded, Signal

RESOLVED = tuple(Resolved.__annotations__)  # fields that are None if left out, with a default that `resolved` has
T = TypeVar("T")


def describe(scenario: Scenario) -> dict:
    """Return a scenario as plain data that JSON represents without loss."""
    resolved = scenario.resolved
    return {name: _data(getattr(resolved, name)) for name in Scenario.fields()} | {
        "versions": dict(_versions()),
        "source": scenario.law.source.about(),
        "condition": scenario.condition,
        "left_out": [name for name in RESOLVED if getattr(scenario, name) is None],
    }


def _data(value: Any) -> Any:  # noqa: PLR0911  # a table
    """Return the value of a scenario's field as plain data."""
    match value:
        case Plant():
            return _plant(value)
        case Component():
            return components.describe(value)
        case Recorded():
            return {"kind": value.kind, "module": value.module, "values": value.parameters()}
        case PerChannel():
            return {"each": [_data(signal) for signal in value.signals]}
        case Signal() | Part():
            values = {f.name: getattr(value, f.name) for f in dataclasses.fields(value) if f.init}
            return dict(zip(("kind", "module"), _name_and_module(type(value)), strict=True)) | {"values": values}
        case Noise() | Clock() | Jump():
            return {name: _data(item) for name, item in vars(value).items() if item is not None}
        case Mapping():
            return dict(value)
        case [Signal() | Part(), *_]:
            return [_data(item) for item in value]
    return value


@functools.cache
def _versions() -> dict[str, str]:
    """Return the versions of the packages that a trace depends on, and how the machine rounds. It takes 5 ms."""
    packages = {"smc_mujoco": __version__} | {name: version(name) for name in ("mujoco", "numba", "numpy")}
    return packages | {"arithmetic": arithmetic()}


def restore(data: dict) -> Scenario:
    """Return the scenario that `describe` wrote. A law or signal that is not installed here has no code."""
    fields = {name: data[name] for name in Scenario.fields()}
    fields |= {name: restored(fields[name]) for name, restored in RESTORERS.items() if fields.get(name)}
    fields["law"] = components.law(data["law"], data.get("source"))
    exact = Scenario.recorded(**fields)
    with_defaults = Scenario.recorded(**fields | dict.fromkeys(data.get("left_out", ())))
    scenario = with_defaults if with_defaults == exact else exact  # other defaults do not change the recorded values
    return scenario.named(data.get("condition"))


def _plant(plant: Plant) -> dict:
    data = {"name": plant.name, "n": plant.n, "module": plant.build.__module__} | dict(plant.parameters)
    return data | ({"mjcf": plant.build.about()} if isinstance(plant.build, UserModel) else {})


def _restore_plant(data: dict) -> Plant:
    plant = dict(data)
    name, module = plant.pop("name"), plant.pop("module")
    if mjcf := plant.pop("mjcf", None):
        del plant["n"]
        return dataclasses.replace(restored(mjcf, name), parameters=plant)
    if module != find_plant(name).build.__module__:
        raise ScenarioError(f"plant {name!r} is not one of the library's: import {module}, which defines it, to run it")
    return find_plant(name, **plant)


def _restore_signal(data: dict) -> Signal:
    if "each" in data:
        return PerChannel(tuple(map(_restore_signal, data["each"])))
    kind, values = _kinds(Signal).get((data["kind"], data["module"])), _values(data)
    return kind(**values) if kind else Recorded(data["kind"], data["module"], values)


def _restore_noise(data: dict) -> Noise:
    values: dict = {name: _restore_signal(item) if isinstance(item, dict) else item for name, item in data.items()}
    return Noise(**values)


def _restore_part(data: dict) -> Part:
    kind = _kinds(Part).get((data["kind"], data["module"]))
    if kind is None:
        raise ScenarioError(f"part {data['kind']!r} is unknown here: first import {data['module']}, which defines it")
    return kind(**_values(data))


def _restore_parts(data: Sequence[dict]) -> tuple[Part, ...]:
    return tuple(map(_restore_part, data))


def _values(data: dict) -> dict:
    """Return the values of the fields of a part or signal, with tuples for JSON's lists."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in data["values"].items()}


def _kinds(base: type[T]) -> dict[tuple[str, str], type[T]]:
    """Return every class derived from a base, also users' classes, by its name and module."""
    return {_name_and_module(kind): kind for kind in subclasses(base)}


def _name_and_module(kind: type) -> tuple[str, str]:
    return kind.__name__, kind.__module__


RESTORERS: Mapping[str, Callable[[Any], Any]] = {  # field -> inverse of `_data`; other fields are plain data
    "plant": _restore_plant,
    "velocity": lambda data: components.restore(data, "estimator", estimators()),
    "surface": lambda data: components.restore(data, "surface", surfaces()),
    "reference": _restore_signal,
    "feedforward": _restore_signal,
    "disturbance": lambda data: tuple(map(_restore_signal, data)),
    "noise": _restore_noise,
    "clock": lambda data: Clock(**data),
    "jump": lambda data: Jump(**data),
    "friction": _restore_parts,
    "contact": _restore_part,
    "actuator": _restore_parts,
    "sensor": _restore_part,
}
