"""The identity of a run: its key, the name of its condition, and the columns of a table that describe it."""

import functools
import hashlib
import json
from typing import Any

from smc_mujoco.common import fingerprint
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import to_json
from smc_mujoco.mechanisms.custom.channels import recorded
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import serialise
from smc_mujoco.simulation.conditions import NAMED
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies.paper import scenarios

OURS = "smc_mujoco."
# Of a description: what tells no condition from another, for it is of the plant, the law or the run.
NO_CONDITION = ("plant", "law", "model", "surface", "seed", "x0", "duration", "versions", "condition")
UNRELATED = ("studies/paper/claims", "draw", "testing", "control/tuned_gains")  # folders that change no run
LONGEST = 60  # characters of a condition's name


def described(scenario: Scenario) -> dict[str, Any]:
    """Return the scenario as plain data, the same for equal scenarios."""
    data = serialise.describe(scenario)
    del data["left_out"]
    return data


def key(scenario: Scenario) -> str:
    """Return a hash of everything that decides a run: its scenario, the code of its parts and of the package, versions.

    32 hex digits.
    """
    return _key(scenario, described(scenario))


def row(scenario: Scenario) -> dict[str, Any]:
    """Return the columns of a table that say what ran."""
    data = described(scenario)
    return {
        "hash": _key(scenario, data),
        "plant": scenario.plant.name,
        "law": scenario.law.name,
        "gains": to_json(dict(scenario.law.gains)),
        "condition": _condition(scenario, data),
        "seed": scenario.seed,
        "duration": scenario.duration,
        "versions": to_json(data["versions"]),
        "scenario": to_json(data),
    }


def condition(scenario: Scenario) -> str:
    """Return the name of the run's condition: as given, the suite's own, or its differences from the nominal one.

    Plant, law, start, seed and duration are no conditions.
    """
    return _condition(scenario, described(scenario))


def _key(scenario: Scenario, data: dict[str, Any]) -> str:
    if scenario.condition in NAMED:  # which the fields tell
        data = data | {"condition": None}
    text = to_json([data, _codes(scenario), fingerprint.package(*UNRELATED)], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _codes(s: Scenario) -> list[str]:
    """Return hashes of the code that a run calls: law, estimator, surface, signals, plants and parts of yours."""
    functions = [part.function for part in (s.law, s.velocity, s.surface) if part is not None]
    signals = [type(signal) for signal in (s.reference, *s.disturbance)]
    parts = [type(part) for part in (*s.friction, s.contact, *s.actuator, s.sensor)]
    own: list[Any] = [kind for kind in parts if not kind.__module__.startswith(OURS) and kind is not type(None)]
    if not s.plant.build.__module__.startswith(OURS):
        builds = *s.plant.contacts.items(), *s.plant.mechanisms.items()
        own.append((s.plant.build, s.plant.fields, s.plant.nominal, builds))
    return [fingerprint.of(thing) for thing in (*functions, *signals, *own)]


def _condition(scenario: Scenario, data: dict[str, Any]) -> str:
    if scenario.condition:
        return scenario.condition
    known = _conditions(scenario.plant, scenario.duration)
    if (text := _compared(data)) in known:
        return known[text]
    nominal = json.loads(next(iter(known), "{}"))
    changed = [name for name, value in json.loads(text).items() if nominal.get(name) != value]
    differ = [name for name in changed if name not in scenario.left_out]  # what others brought with them
    name = ", ".join(f"{name}={' '.join(repr(getattr(scenario, name)).split())}" for name in differ)
    return name if len(name) <= LONGEST else f"{name[:LONGEST]}... {hashlib.sha256(text.encode()).hexdigest()[:6]}"


def _compared(data: dict[str, Any]) -> str:
    return to_json({name: value for name, value in data.items() if name not in NO_CONDITION})


@functools.lru_cache(maxsize=256)
def _conditions(plant: Plant, duration: float) -> dict[str, str]:
    """Return what runs of a plant look like in the suite's conditions -> names of these, the nominal one first."""
    found: dict[str, str] = {}
    for name in NAMED:
        try:
            given = scenarios.fields(name, plant, duration)
            common: dict[str, Any] = {"plant": plant, "law": "none", "duration": duration}
            common |= {"control_period": scenarios.CONTROL_PERIOD}
            if not plant.limits:  # else it is what its motors give, unless somebody says another
                common |= {"u_max": scenarios.U_MAX}
            with recorded():  # nor is it to be run: the start that its model has may be outside a joint's range
                scenario = Scenario(**common | given)
        except ScenarioError:  # it is not for this plant, or for runs as short as this
            continue
        found.setdefault(_compared(described(scenario)), name)
    return found
