"""A scenario as JSON data and back."""

import dataclasses
from importlib.metadata import version

from smc_mujoco import __version__
from smc_mujoco.component import Component, Template
from smc_mujoco.conditions import Jump, Noise
from smc_mujoco.errors import ScenarioError
from smc_mujoco.estimators import catalogue as estimators
from smc_mujoco.law import catalogue as laws
from smc_mujoco.plant import plant as find_plant
from smc_mujoco.scenario import Scenario
from smc_mujoco.signals import Recorded, Signal, kinds

PLAIN = ("duration", "control_period", "physics_step", "u_max", "x0", "v0", "input_delay", "seed", "integrator")


def describe(scenario: Scenario) -> dict:
    """The scenario as plain data that JSON holds without loss."""
    return {name: getattr(scenario, name) for name in PLAIN} | {
        "plant": {"name": scenario.plant.name, "n": scenario.plant.n, "module": scenario.plant.build.__module__}
        | dict(scenario.plant.parameters),
        "versions": {"smc_mujoco": __version__} | {name: version(name) for name in ("mujoco", "numba", "numpy")},
        "law": _component(scenario.law),
        "velocity": _component(scenario.velocity),
        "reference": _signal(scenario.reference),
        "disturbance": [_signal(d) for d in scenario.disturbance],
        "noise": dataclasses.asdict(scenario.noise),
        "mismatch": dict(scenario.mismatch),
        "jump": scenario.jump and {"time": scenario.jump.time, "factors": dict(scenario.jump.factors)},
    }


def restore(data: dict) -> Scenario:
    """The scenario that was described. A law or signal that is not at hand keeps its name and values, not its code."""
    plant = dict(data["plant"])
    if plant.pop("module") != find_plant(plant["name"]).build.__module__:
        raise ScenarioError(f"plant {plant['name']!r} is not the library's: run it where it is defined")
    fields = {name: data[name] for name in PLAIN}
    return Scenario(
        **fields,
        plant=find_plant(plant.pop("name"), **plant),
        law=_find(data["law"], "law", laws()),
        velocity=_find(data["velocity"], "estimator", estimators()),
        reference=_restore_signal(data["reference"]),
        disturbance=tuple(_restore_signal(d) for d in data["disturbance"]),
        noise=Noise(**data["noise"]),
        mismatch=data["mismatch"],
        jump=data["jump"] and Jump(**data["jump"]),
    )


def _component(c: Component) -> dict:
    return {"name": c.name, "gains": dict(c.gains), "memory": c.memory, "module": getattr(c.function, "__module__", "")}


def _find(data: dict, kind: str, known: dict[str, Template]) -> Component:
    template = known.get(data["name"])
    if template is not None and template.function.__module__ == data["module"]:
        return template(**data["gains"])
    return Component(kind=kind, name=data["name"], gains=dict(data["gains"]), memory=data["memory"], function=None)


def _signal(signal: Signal) -> dict:
    home = (signal.kind, signal.module) if isinstance(signal, Recorded) else _home(type(signal))
    return {"kind": home[0], "module": home[1], "values": signal.parameters()}


def _restore_signal(data: dict) -> Signal:
    kind = {_home(known): known for known in kinds()}.get((data["kind"], data["module"]))
    return kind(**data["values"]) if kind else Recorded(**data)


def _home(kind: type) -> tuple[str, str]:
    return kind.__name__, kind.__module__
