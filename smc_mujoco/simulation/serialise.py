"""A scenario as JSON data and back."""

import dataclasses
import functools
from collections.abc import Sequence
from importlib.metadata import version
from typing import TypeVar

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.fingerprint import arithmetic
from smc_mujoco.common.registry import subclasses
from smc_mujoco.common.version import __version__
from smc_mujoco.control import as_data as component
from smc_mujoco.control.estimator import catalogue as estimators
from smc_mujoco.control.surface import catalogue as surfaces
from smc_mujoco.mechanisms.custom.plant_from import OwnModel, restored
from smc_mujoco.mechanisms.hardware import backlash, drives, friction, servos  # noqa: F401  # whose parts a file may name
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation import time_series, waypoints  # noqa: F401  # whose signals a file may name
from smc_mujoco.simulation.clock import Clock
from smc_mujoco.simulation.perturbations import Jump, Noise
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import PerChannel, Recorded, Signal

PLAIN = ("duration", "control_period", "physics_step", "u_max", "x0", "v0", "input_delay", "seed", "integrator")
DEPENDENT = ("model", "physics_step", "integrator", "velocity", "u_max", "x0", "v0", "reference")  # None where left out
PARTS = ("friction", "contact", "actuator", "sensor")
T = TypeVar("T")


def describe(scenario: Scenario) -> dict:
    """Return a scenario as plain data that JSON holds without loss."""
    given, scenario = scenario, scenario.resolved
    return (
        {name: getattr(scenario, name) for name in PLAIN}
        | {
            "plant": _plant(scenario.plant),
            "versions": dict(_versions()),
            "law": component.describe(scenario.law),
            "source": scenario.law.source.about(),
            "velocity": component.describe(scenario.velocity),
            "surface": scenario.surface and component.describe(scenario.surface),
            "model": scenario.model,
            "reference": _signal(scenario.reference),
            "feedforward": scenario.feedforward and _signal(scenario.feedforward),
            "disturbance": [_signal(d) for d in scenario.disturbance],
            "noise": _noise(scenario.noise),
            "clock": dataclasses.asdict(scenario.clock),
            "mismatch": dict(scenario.mismatch),
            "jump": scenario.jump and {"time": scenario.jump.time, "factors": dict(scenario.jump.factors)},
            "mechanism": scenario.mechanism,
            "condition": scenario.condition,
            "left_out": [name for name in DEPENDENT if getattr(given, name) is None],
        }
        | {name: _parts(getattr(scenario, name)) for name in PARTS}
        | ({"noise_key": scenario.noise_key} if scenario.noise_key else {})
    )


@functools.cache
def _versions() -> dict[str, str]:
    """Return the versions of the packages that a trace depends on, and how the machine rounds. It takes 5 ms."""
    packages = {"smc_mujoco": __version__} | {name: version(name) for name in ("mujoco", "numba", "numpy")}
    return packages | {"arithmetic": arithmetic()}


def restore(data: dict) -> Scenario:
    """Return the scenario that `describe` wrote. A law or signal that is not installed here loses its code.

    Recorded scenarios skip validation rules added after they were recorded.
    """
    fields = {name: data[name] for name in PLAIN}
    fields |= {name: _restore_parts(data[name]) for name in PARTS if name in data}  # an ideal run's file may lack them
    fields |= {name: data[name] for name in ("mechanism", "model", "noise_key") if name in data}
    fields |= {
        "plant": _restore_plant(data["plant"]),
        "law": component.law(data["law"], data.get("source")),
        "velocity": component.restore(data["velocity"], "estimator", estimators()),
        "surface": data.get("surface") and component.restore(data["surface"], "surface", surfaces()),
        "reference": _restore_signal(data["reference"]),
        "feedforward": (added := data.get("feedforward")) and _restore_signal(added),
        "disturbance": tuple(_restore_signal(d) for d in data["disturbance"]),
        "noise": _restore_noise(data["noise"]),
        "clock": Clock(**data["clock"]),
        "mismatch": data["mismatch"],
        "jump": data["jump"] and Jump(**data["jump"]),
    }
    exact = Scenario.recorded(**fields)
    given = Scenario.recorded(**fields | dict.fromkeys(data.get("left_out", ())))
    scenario = given if given == exact else exact  # where this version's defaults differ, keep the recorded values
    return scenario.named(data.get("condition"))


def _plant(plant: Plant) -> dict:
    data = {"name": plant.name, "n": plant.n, "module": plant.build.__module__} | dict(plant.parameters)
    return data | ({"mjcf": plant.build.about()} if isinstance(plant.build, OwnModel) else {})


def _restore_plant(data: dict) -> Plant:
    plant = dict(data)
    name, module = plant.pop("name"), plant.pop("module")
    if mjcf := plant.pop("mjcf", None):
        del plant["n"]
        return dataclasses.replace(restored(mjcf, name), parameters=plant)
    if module != find_plant(name).build.__module__:
        raise ScenarioError(f"plant {name!r} is not one of the library's: import {module}, which defines it, to run it")
    return find_plant(name, **plant)


def _signal(signal: Signal) -> dict:
    if isinstance(signal, Recorded):
        return {"kind": signal.kind, "module": signal.module, "values": signal.parameters()}
    if isinstance(signal, PerChannel):
        return {"each": [_signal(one) for one in signal.signals]}
    return _thing(signal)


def _restore_signal(data: dict) -> Signal:
    if "each" in data:
        return PerChannel(tuple(_restore_signal(one) for one in data["each"]))
    kind, values = _kinds(Signal).get((data["kind"], data["module"])), _values(data)
    return kind(**values) if kind else Recorded(data["kind"], data["module"], values)


def _noise(noise: Noise) -> dict:
    data = {"position": noise.position, "velocity": noise.velocity}
    errors = zip(("position_error", "velocity_error"), noise.errors, strict=True)
    return data | {name: _signal(error) for name, error in errors if error}


def _restore_noise(data: dict) -> Noise:
    errors: dict = {name: _restore_signal(one) for name, one in data.items() if isinstance(one, dict)}
    return Noise(**data | errors)


def _parts(value: Part | Sequence[Part] | None) -> dict | list[dict] | None:
    if value is None or isinstance(value, Part):
        return value and _thing(value)
    return [_thing(part) for part in value]


def _restore_parts(data: dict | Sequence[dict] | None) -> Part | tuple[Part, ...] | None:
    if data is None or isinstance(data, dict):
        return None if data is None else _restore_part(data)
    return tuple(_restore_part(part) for part in data)


def _restore_part(data: dict) -> Part:
    kind = _kinds(Part).get((data["kind"], data["module"]))
    if kind is None:
        raise ScenarioError(f"part {data['kind']!r} is unknown here: first import {data['module']}, which defines it")
    return kind(**_values(data))


def _thing(thing: Signal | Part) -> dict:
    """Return the class of a thing by name, and the values of its fields."""
    values = {f.name: getattr(thing, f.name) for f in dataclasses.fields(thing) if f.init}
    return dict(zip(("kind", "module"), _home(type(thing)), strict=True)) | {"values": values}


def _values(data: dict) -> dict:
    """Return the values of a thing's fields, with tuples for the lists that JSON made of them."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in data["values"].items()}


def _kinds(base: type[T]) -> dict[tuple[str, str], type[T]]:
    """Return every class derived from a base, also users' classes, by its name and module."""
    return {_home(kind): kind for kind in subclasses(base)}


def _home(kind: type) -> tuple[str, str]:
    return kind.__name__, kind.__module__
