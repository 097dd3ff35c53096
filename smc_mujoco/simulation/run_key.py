"""The identity of a run: its key, the name of its condition, and the columns of a table that
describe it.
"""

import contextlib
import functools
import hashlib
import json
from typing import Any

from smc_mujoco.common import fingerprint
from smc_mujoco.common.aliases import Fields
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import to_json
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import scenario_json
from smc_mujoco.simulation.codes import PACKAGE, Hashes, code_hashes
from smc_mujoco.simulation.conditions import CONTROL_PERIOD, NAMED, find_condition
from smc_mujoco.simulation.force_bounds import U_MAX
from smc_mujoco.simulation.scenario import Scenario

# Fields of a description that belong to the plant, the law or the run, and not to the condition.
NOT_OF_CONDITION = (
    "plant",
    "law",
    "model",
    "surface",
    "seed",
    "x0",
    "duration",
    "versions",
    "condition",
)
# of this package, which do not affect runs
UNRELATED = (
    "evidence/audit",
    "evidence/papers",
    fingerprint.PAPERS,
    "draw",
    "testing",
    "control/tuned_gains",
)
MAX_NAME = 60  # characters of a condition's name


def description(scenario: Scenario) -> Fields:
    """Return the scenario as plain data.

    It is the same for equal scenarios: the source of gains is left out.
    """
    data = scenario_json.describe(scenario)
    del data["left_out"], data["source"]
    return data


def run_key(scenario: Scenario, data: Fields | None = None, plants: Hashes | None = None) -> str:
    """Return a hash, 32 hex digits, of all that determines a run: scenario, code, versions.

    A user's code counts, and not the name of its module: the same file is `__main__` as a script,
    and has another name where it is imported. `plants` is a cache.
    """
    data = data or description(scenario)
    if scenario.condition in NAMED:  # the name adds nothing to the fields
        data = data | {"condition": None}
    codes = code_hashes(scenario, {} if plants is None else plants)
    package = fingerprint.package(*UNRELATED)
    text = to_json([_without_modules(data), codes, package], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _without_modules(data: Any) -> Any:
    """Return plain data without the names of modules that are not of this package."""
    if isinstance(data, list | tuple):
        return list(map(_without_modules, data))
    if not isinstance(data, dict):
        return data
    plain = {}
    for name, value in data.items():
        # a gain may be called so, too
        of_user = name == "module" and isinstance(value, str) and not value.startswith(PACKAGE)
        plain[name] = None if of_user else _without_modules(value)
    return plain


def portable_key(scenario: Scenario) -> str:
    """Return a hash, 16 hex digits, of the scenario and of the code of its parts alone: the same on
    every machine.
    """
    # the condition's name adds nothing
    data = description(scenario) | {"versions": None, "condition": None}
    hashes = code_hashes(scenario, {})
    text = to_json([data, hashes], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def row(scenario: Scenario, plants: Hashes | None = None) -> Fields:
    """Return the columns of a table that describe a run. `plants` is as in `key`."""
    data = description(scenario)
    return {
        "hash": run_key(scenario, data, plants),
        "plant": scenario.plant.name,
        "law": scenario.law.name,
        "gains": to_json(dict(scenario.law.gains)),
        "seed": scenario.seed,
        "duration": scenario.duration,
        "versions": to_json(data["versions"]),
        **run_labels(scenario, data),
    }


def run_labels(scenario: Scenario, data: Fields | None = None) -> dict[str, str | None]:
    """Return the columns of a table that two runs of one key may differ in: where the gains come
    from, and how the condition is called.
    """
    data = data or description(scenario)
    about = scenario.law.source.about()
    return {
        "source": about["kind"],
        "search": about["search"] and to_json(about["search"]),
        "condition": condition(scenario, data),
        "scenario": to_json(data),
    }


def condition(scenario: Scenario, data: Fields | None = None) -> str:
    """Return the name of the run's condition: the given name, or the differences from the nominal
    condition.
    """
    if scenario.condition:
        return scenario.condition
    text = _condition_text(data or description(scenario))
    nominal = _nominal(scenario.plant, scenario.duration)
    if text == nominal:
        return "nominal"
    usual = json.loads(nominal)
    parts = []
    for field, value in json.loads(text).items():
        attribute = getattr(scenario, field)
        if usual.get(field) != value and attribute is not None:  # None is a default
            parts.append(f"{field}={' '.join(repr(attribute).split())}")
    name = ", ".join(parts)
    if len(name) <= MAX_NAME:
        return name
    return f"{name[:MAX_NAME]}... {hashlib.sha256(text.encode()).hexdigest()[:6]}"


def _condition_text(data: Fields) -> str:
    """Return the fields of a description that belong to the condition, as JSON."""
    return to_json({name: value for name, value in data.items() if name not in NOT_OF_CONDITION})


@functools.lru_cache(maxsize=256)
def _nominal(plant: Plant, duration: float) -> str:
    """Return the `_condition_text` of the nominal condition on a plant, "{}" where it does not fit
    the plant.
    """
    fields = {"plant": plant, "law": "none", "duration": duration, "control_period": CONTROL_PERIOD}
    if not plant.limits:  # with limits, its motors bound u
        fields["u_max"] = U_MAX
    with contextlib.suppress(ScenarioError):
        fields |= find_condition("nominal").on(plant, duration)
        # `recorded`: x0 may be outside a joint's range, as this is not run
        return _condition_text(description(Scenario.recorded(**fields)))
    return "{}"
