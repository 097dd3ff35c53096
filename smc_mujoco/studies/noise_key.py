"""The noise key of a study: a number that is drawn when its laws are fixed, so that no law can know its noise.

The noise of a run follows from its seed. Seeds are 0, 1, 2, ..., so a law could try them all against its first readings
and know every later one. With a key, the noise of a seed is that of a hash of key and seed.

The key is kept beside the study, so that a study which was stopped goes on with the same noise. It holds for the code
and the gains of the user's laws that were there when it was drawn: their author may have read it since. For another law
a new key is drawn, and all runs are done again.
"""

import dataclasses
import json
import secrets
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from smc_mujoco.common import fingerprint
from smc_mujoco.common.errors import ScenarioError, shown, whole
from smc_mujoco.common.files import write_json
from smc_mujoco.common.text import joined
from smc_mujoco.control.component import Component
from smc_mujoco.simulation.scenario import MAX_SEED, Scenario

DRAWN = "drawn"
FILE = "noise_key.json"
CODE = "its code"  # beside the names of variables


def draw() -> int:
    """Return a new key."""
    return secrets.randbelow(MAX_SEED) + 1


def keyed(scenarios: Iterable[Scenario], wanted: int | str, folder: Path, resume: bool = True) -> Iterator[Scenario]:
    """Yield the scenarios with the noise key of a study.

    Args:
      wanted: a key; 0 for the noise of the seeds alone; DRAWN for that of the folder, or a new one.
      folder: of the study.
      resume: whether the folder's key may be that of the study.

    Raises:
      ScenarioError: another key.
    """
    if wanted == DRAWN:
        given = []
        for one in scenarios:
            if not isinstance(one, Scenario):
                yield one  # which the study refuses
                return
            given.append(one)
        if not resume:
            (folder / FILE).unlink(missing_ok=True)
        scenarios = given
        laws = {identity(one): one for one in filter(own, given)}
        key = _of_folder(folder / FILE, {name: _about(one) for name, one in laws.items()})
    elif isinstance(wanted, str):
        raise ScenarioError(f"noise_key is {shown(wanted)}: give a whole number, or {DRAWN!r}")
    else:
        key = whole("noise_key", wanted, 0, MAX_SEED)
    for scenario in scenarios:
        same = not isinstance(scenario, Scenario) or scenario.noise_key == key or not key
        yield scenario if same else dataclasses.replace(scenario, noise_key=key).named(scenario.condition)


def _of_folder(file: Path, laws: dict[str, dict[str, Any]]) -> int:
    """Return the key in a file if it was drawn for all these laws, else a new one, which is kept there.

    Args:
      laws: `identity` of each of the user's laws -> what `_about` returns.
    """
    try:
        known = json.loads(file.read_text(encoding="utf-8"))
        key, fixed = whole("noise_key", known["key"], 1, MAX_SEED), dict(known["laws"])
    except (OSError, ValueError, KeyError, TypeError):
        key, fixed = 0, {}
    others = [about for name, about in laws.items() if name not in fixed]
    if key and not others:
        return key
    if key:
        changes = joined(dict.fromkeys(_changed(about, list(fixed.values())) for about in others))
        print(f"{changes}: a new noise key is drawn, and all runs are done again", file=sys.stderr)
    key = draw()
    write_json(file, {"key": key, "laws": laws})
    return key


def _about(scenario: Scenario) -> dict[str, Any]:
    """Return the name of a scenario's law, and the hashes of what law, surface and estimator read."""
    functions = tuple(part.function for part in _parts(scenario))
    reads = {CODE: fingerprint.of(functions)}
    for function in functions:
        reads |= fingerprint.variables(function)
    return {"name": scenario.law.name, "reads": reads}


def _changed(about: dict[str, Any], before: list[dict[str, Any]]) -> str:
    """Return in words what is new or has changed of a law, compared with the laws of its name before."""
    name = about["name"]
    alike = [one["reads"] for one in before if one["name"] == name]
    if not alike:
        return f"law {name} is new"
    names = [what for what, its in about["reads"].items() if its != alike[-1].get(what)]
    variables = [what for what in names if what != CODE]
    return f"law {name} has changed ({joined(variables or names or ['its gains'])})"


def _parts(scenario: Scenario) -> list[Component]:
    """Return the law, or those of the channels, the surface and the estimator of a scenario."""
    return [part for part in (*scenario.law.parts, scenario.surface, scenario.velocity) if part]


def own(scenario: Scenario) -> bool:
    """Return whether the law, its surface or its estimator is not of this package."""
    return not all(fingerprint.ours(part.function) for part in _parts(scenario))


def identity(scenario: Scenario) -> str:
    """Return a hash of the code and the gains of a scenario's law, surface and estimator."""
    parts = _parts(scenario)
    return fingerprint.of(tuple(part.function for part in parts))[:16] + repr([dict(part.gains) for part in parts])
