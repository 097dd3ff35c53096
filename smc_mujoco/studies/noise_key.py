"""The noise key of a study: a number that is drawn when its laws are fixed, so that no law can know its noise.

The noise of a run follows from its seed. Seeds are 0, 1, 2, ..., so a law could try them all against its first readings
and know every later one. With a key, the noise of a seed is that of a hash of key and seed.

The key is stored in the study's folder, so that a study that was stopped goes on with the same noise. It is valid for
the user's laws, with the code and gains that they had when it was drawn. The author of another law may have read it,
so a new key is drawn for that law, and all runs are done again.
"""

import dataclasses
import json
import secrets
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from smc_mujoco.common import fingerprint
from smc_mujoco.common.errors import ScenarioError, shown, whole
from smc_mujoco.common.files import write_json
from smc_mujoco.common.text import joined
from smc_mujoco.control.component import Component
from smc_mujoco.simulation.scenario import MAX_SEED, Scenario

DRAWN = "drawn"
FILE = "noise_key.json"


def draw_key() -> int:
    """Return a new key."""
    return secrets.randbelow(MAX_SEED) + 1


def keyed(scenarios: Iterable[Scenario], wanted: int | str, folder: Path, resume: bool = True) -> Iterator[Scenario]:
    """Yield the scenarios with the wanted key. 0: noise by the seeds alone; DRAWN: the folder's key, else a new one."""
    if wanted == DRAWN:
        scenarios = list(scenarios)
        if not resume:
            (folder / FILE).unlink(missing_ok=True)
        laws = {law_hash(scenario): scenario for scenario in filter(has_user_code, scenarios)}
        key = _of_folder(folder / FILE, {name: _description(scenario) for name, scenario in laws.items()})
    elif isinstance(wanted, str):
        raise ScenarioError(f"noise_key is {shown(wanted)}: give a whole number, or {DRAWN!r}")
    else:
        key = whole("noise_key", wanted, 0, MAX_SEED)
    for scenario in scenarios:
        same = scenario.noise_key == key or not key
        yield scenario if same else dataclasses.replace(scenario, noise_key=key).named(scenario.condition)


def _of_folder(file: Path, laws: dict[str, dict[str, str]]) -> int:
    """Return the key in a file if it was drawn for all these laws, else a new one, which is written there."""
    try:
        stored = json.loads(file.read_text(encoding="utf-8"))
        key = whole("noise_key", stored["key"], 1, MAX_SEED)
        before = {name: dict(law) for name, law in dict(stored["laws"]).items()}
    except (OSError, ValueError, KeyError, TypeError):
        key, before = 0, {}
    new = [law for name, law in laws.items() if name not in before]
    if key and not new:
        return key
    if key:
        changes = joined(dict.fromkeys(_change_in_words(law, list(before.values())) for law in new))
        print(f"{changes}: a new noise key is drawn, and all runs are done again", file=sys.stderr)
    key = draw_key()
    write_json(file, {"key": key, "laws": laws})
    return key


def _description(scenario: Scenario) -> dict[str, str]:
    """Return the name of a scenario's law, its gains, and hashes of its code and of each variable that it reads."""
    parts, variables = _parts(scenario), {}
    for part in parts:
        variables |= fingerprint.variables(part.function)
    code = fingerprint.now(tuple(getattr(part.function, "__code__", part.function) for part in parts))
    return variables | {"name": scenario.law.name, "its gains": _gains(parts), "its code": code}


def _change_in_words(law: dict[str, str], before: list[dict[str, str]]) -> str:
    """Return what has changed of a law since the laws `before`, or that no law of its name was among them."""
    same_name = [other for other in before if other.get("name") == law["name"]]
    if not same_name:
        return f"law {law['name']} is new"
    changed = [name for name, value in law.items() if value != same_name[-1].get(name)]
    return f"law {law['name']} has changed ({joined(changed or ['its code'])})"


def _gains(parts: Iterable[Component]) -> str:
    return repr([dict(part.gains) for part in parts])


def _parts(scenario: Scenario) -> list[Component]:
    """Return the law, or the laws of the channels, the surface and the estimator of a scenario."""
    return [part for part in (*scenario.law.parts, scenario.surface, scenario.velocity) if part]


def has_user_code(scenario: Scenario) -> bool:
    """Return whether a scenario's law, surface or estimator is not of this package."""
    return not all(fingerprint.ours(part.function) for part in _parts(scenario))


def law_hash(scenario: Scenario) -> str:
    """Return a hash of the code and the gains of a scenario's law, surface and estimator."""
    parts = _parts(scenario)
    return fingerprint.of(tuple(part.function for part in parts))[:16] + _gains(parts)
