"""A scenario as JSON data and back."""

import contextlib
import dataclasses
import functools
import importlib
import operator
from collections.abc import Callable, Mapping
from importlib.metadata import version
from typing import Any

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.fingerprint import arithmetic
from smc_mujoco.common.registry import subclasses
from smc_mujoco.common.version import __version__
from smc_mujoco.control import component_json as components
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import estimator_catalogue as estimators
from smc_mujoco.control.surface import surface_catalogue as surfaces
from smc_mujoco.mechanisms.custom.model_numbers import dotted, with_model_numbers
from smc_mujoco.mechanisms.custom.plant_from import restored
from smc_mujoco.mechanisms.hardware.feedforward import Feedforward
from smc_mujoco.mechanisms.hardware.part import Friction, Part
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.coerce import EVERY
from smc_mujoco.simulation.scenario import Resolved, Scenario
from smc_mujoco.simulation.signals import Clock, Fault, Jump, Noise, PerChannel, Signal

FOLDERS = (
    "smc_mujoco.mechanisms.hardware",
    "smc_mujoco.simulation",
)  # of the parts and signals of this package
# Fields that older records lack -> their defaults, which are not written either
LATER = {"fault": None, "tracks": "position"}
RUN_FILE = "<run_path>"  # the module of what runpy runs
RESOLVED = tuple(
    Resolved.__annotations__
)  # fields that are None if left out, with a default that `resolved` has


def describe(scenario: Scenario) -> dict:
    """Return a scenario as plain data that JSON represents without loss."""
    resolved = scenario.resolved
    fields = {name: _data(getattr(resolved, name)) for name in Scenario.fields()}
    for name, default in LATER.items():
        if fields[name] == default:
            del fields[name]
    return fields | {
        "versions": dict(_versions()),
        "source": scenario.law.source.about(),
        "condition": scenario.condition,
        "left_out": [name for name in RESOLVED if getattr(scenario, name) is None],
    }


def _data(value: Any) -> Any:  # noqa: PLR0911  # a table
    """Return the value of a scenario's field as plain data."""
    match value:
        case Plant():
            data = {
                "name": value.name,
                "n": value.n,
                "module": value.build.__module__,
            } | dict(value.parameters)
            about = getattr(value.build, "about", None)  # of a user's model
            return data | ({"mjcf": about()} if about else {})
        case Component():
            return components.describe(value)
        case PerChannel():
            return {"each": [_data(signal) for signal in value.signals]}
        case Signal(signals=signals):
            return {"sum": [_data(signal) for signal in signals]}
        case Signal() | Part() | Feedforward():
            values = {}
            for f in dataclasses.fields(value):
                content = getattr(value, f.name)
                # of words that came later only those that say something are written
                later = f.kw_only and f.name != "on"
                if f.init and not (later and content == f.default):
                    values[f.name] = _data(content)
            if not isinstance(value, Friction) and not values.get("on", True):
                del values["on"]
            return {
                "kind": type(value).__name__,
                "module": type(value).__module__,
                "values": values,
            }
        case Noise() | Clock() | Jump() | Fault():
            return {name: _data(item) for name, item in vars(value).items() if item is not None}
        case Mapping():
            return dict(value)
        case [Signal() | Part(), *_]:
            return [_data(item) for item in value]
    return value


@functools.cache
def _versions() -> dict[str, str]:
    """Return the versions of the packages that a trace depends on, and how the machine rounds.

    It takes 5 ms.
    """
    packages = {"smc_mujoco": __version__}
    for name in ("mujoco", "numba", "numpy"):
        packages[name] = version(name)
    return packages | {"arithmetic": arithmetic()}


def restore(data: dict, plant: Plant | None = None) -> Scenario:
    """Return the scenario that `describe` wrote. A law that is not installed here has no code.

    `plant`: that of the scenario, if it is known; one that a script defines cannot be found by its
    name.
    """
    fields = {name: (LATER | data)[name] for name in Scenario.fields()}
    fields |= {"plant": plant} if plant else {}
    for name, value in fields.items():
        if value and value is not plant:
            fields[name] = RESTORERS.get(name, _restored)(value)
    fields["law"] = components.restored_law(data["law"], data.get("source"))
    exact = Scenario.recorded(**fields)
    left_out = data.get("left_out", ())
    with_defaults = Scenario.recorded(**fields | dict.fromkeys(left_out))
    # other defaults do not change the recorded values
    if with_defaults == exact:
        scenario = with_defaults
    else:
        scenario = exact
    return scenario.named(data.get("condition"))


def _restored(data: Any) -> Any:
    """Return the signal or the part that plain data describe, several of them, or other data as
    they are.
    """
    if isinstance(data, list):
        return tuple(map(_restored, data))
    if isinstance(data, dict) and "each" in data:
        return PerChannel(tuple(map(_restored, data["each"])))
    if isinstance(data, dict) and "sum" in data:
        return functools.reduce(operator.add, map(_restored, data["sum"]))
    if not isinstance(data, dict) or "kind" not in data:
        return data
    if data["module"].rpartition(".")[0] in FOLDERS:  # else it is a user's, and imported already
        with contextlib.suppress(ImportError):
            importlib.import_module(data["module"])
    kinds = {}
    for kind in (Feedforward, *subclasses(Signal), *subclasses(Part)):
        kinds[(kind.__name__, kind.__module__)] = kind
    if (kind := kinds.get((data["kind"], data["module"]))) is None:
        cure = f"import {data['module']}, which defines it"
        if data["module"] == RUN_FILE:
            cure = "run the file that defines it, by runpy.run_path(FILE)"
        raise ScenarioError(f"{data['kind']!r} is unknown here: first {cure}")
    values = {name: _restored(value) for name, value in data["values"].items()}
    if issubclass(kind, Friction) and "on" not in values:  # of an older version: on all joints
        values["on"] = () if values.pop("driven", False) else (EVERY,)
    return kind(**values)


def _restore_plant(data: dict) -> Plant:
    plant = dict(data)
    name = plant.pop("name")
    module = plant.pop("module")
    if mjcf := plant.pop("mjcf", None):
        del plant["n"]
        restored_plant = with_model_numbers(restored(mjcf, name), dotted(plant))
        return dataclasses.replace(restored_plant, parameters=plant)
    if module != find_plant(name).build.__module__:
        raise ScenarioError(
            f"plant {name!r} is not one of the library's: import {module}, which defines it, to "
            "run it"
        )
    return find_plant(name, **plant)


RESTORERS: Mapping[str, Callable[[Any], Any]] = {  # field -> inverse of `_data`, if not `_restored`
    "plant": _restore_plant,
    "law": lambda data: data,
    "velocity": lambda data: components.restored_component(data, "estimator", estimators()),
    "surface": lambda data: components.restored_component(data, "surface", surfaces()),
    "noise": lambda data: Noise(**{name: _restored(item) for name, item in data.items()}),
    "clock": lambda data: Clock(**data),
    "jump": lambda data: Jump(**data),
    "fault": lambda data: Fault(**data),
}
