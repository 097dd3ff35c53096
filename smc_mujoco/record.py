"""A scenario as JSON data and back."""

import dataclasses

from smc_mujoco.component import Component, Template
from smc_mujoco.conditions import Jump, Noise
from smc_mujoco.errors import ScenarioError
from smc_mujoco.estimators import catalogue as estimators
from smc_mujoco.law import catalogue as laws
from smc_mujoco.plant import plant as find_plant
from smc_mujoco.scenario import Scenario
from smc_mujoco.signals import Signal, kinds

PLAIN = ("duration", "control_period", "physics_step", "u_max", "x0", "v0", "input_delay", "seed", "integrator")


def describe(scenario: Scenario) -> dict:
    """The scenario as plain data that JSON holds without loss."""
    return {name: getattr(scenario, name) for name in PLAIN} | {
        "plant": {"name": scenario.plant.name, "n": scenario.plant.n} | dict(scenario.plant.parameters),
        "law": _component(scenario.law),
        "velocity": _component(scenario.velocity),
        "reference": _signal(scenario.reference),
        "disturbance": [_signal(d) for d in scenario.disturbance],
        "noise": dataclasses.asdict(scenario.noise),
        "mismatch": dict(scenario.mismatch),
        "jump": scenario.jump and {"time": scenario.jump.time, "factors": dict(scenario.jump.factors)},
    }


def restore(data: dict) -> Scenario:
    """The scenario that was described. A law that is not in the library keeps its name and gains, not its code."""
    plant = dict(data["plant"])
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
    return {"kind": type(signal).__name__} | signal.parameters()


def _restore_signal(data: dict) -> Signal:
    known = {kind.__name__: kind for kind in kinds()}
    values = dict(data)
    kind = values.pop("kind")
    if kind not in known:
        raise ScenarioError(f"the trace has a signal {kind!r}: import the module that defines it first")
    return known[kind](**values)
