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

from smc_mujoco.common import fingerprint
from smc_mujoco.common.errors import ScenarioError, shown, whole
from smc_mujoco.common.files import write_json
from smc_mujoco.simulation.scenario import MAX_SEED, Scenario

DRAWN = "drawn"
FILE = "noise_key.json"


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
        found = []
        for one in scenarios:
            if not isinstance(one, Scenario):
                yield one  # which the study refuses
                return
            found.append(one)
        if not resume:
            (folder / FILE).unlink(missing_ok=True)
        scenarios = found
        key = _of_folder(folder / FILE, sorted(set(map(identity, filter(own, found)))))
    elif isinstance(wanted, str):
        raise ScenarioError(f"noise_key is {shown(wanted)}: give a whole number, or {DRAWN!r}")
    else:
        key = whole("noise_key", wanted, 0, MAX_SEED)
    for scenario in scenarios:
        same = not isinstance(scenario, Scenario) or scenario.noise_key == key or not key
        yield scenario if same else dataclasses.replace(scenario, noise_key=key).named(scenario.condition)


def _of_folder(file: Path, laws: list[str]) -> int:
    """Return the key in a file if it was drawn for all these laws, else a new one, which is kept there."""
    try:
        known = json.loads(file.read_text(encoding="utf-8"))
        key, fixed = whole("noise_key", known["key"], 1, MAX_SEED), set(known["laws"])
    except (OSError, ValueError, KeyError, TypeError):
        key, fixed = 0, set()
    if key and fixed.issuperset(laws):
        return key
    if key:
        print("a law of yours is new or has changed: with a new noise key, all runs are done again", file=sys.stderr)
    key = draw()
    write_json(file, {"key": key, "laws": laws})
    return key


def own(scenario: Scenario) -> bool:
    """Return whether the law, its surface or its estimator is not of this package."""
    parts = (*scenario.law.parts, scenario.surface, scenario.velocity)
    return any(
        part and not (getattr(part.function, "__module__", "") or "").startswith("smc_mujoco.") for part in parts
    )


def identity(scenario: Scenario) -> str:
    """Return a hash of the code and the gains of a scenario's law, surface and estimator."""
    parts = [part for part in (*scenario.law.parts, scenario.surface, scenario.velocity) if part]
    return fingerprint.of(tuple(part.function for part in parts))[:16] + repr([dict(part.gains) for part in parts])
