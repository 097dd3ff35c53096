"""The noise key of a study: a number that is drawn when its laws are fixed, so that no law can know its noise.

The noise of a run follows from its seed. Seeds are 0, 1, 2, ..., so a law could try them all against its first readings
and know every later one. With a key, the noise of a seed is that of a hash of key and seed.

Until the last run has ended the key is not in the study's folder: not in a file of its own, nor in the parts or the
traces. It is in memory and, so that a study that was stopped goes on with the same noise, in a file of the user's own
folder for state, see `pending`. A checked law can read neither. An unchecked one could, as it can read any file and all
memory of its process: this is why it is marked. After the last run the key is written to the study's folder, and the
other file is removed.

A key is valid for the user's laws, with the code and gains that they had when it was drawn. The author of another law
may have read it, so a new key is drawn for that law, and all runs are done again. So is one for new runs of an
unchecked law, which may have read the key of earlier runs.
"""

import contextlib
import dataclasses
import hashlib
import json
import os
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
    """Yield the scenarios with the wanted key. 0: noise by the seeds alone; DRAWN: the study's key, else a new one."""
    if wanted == DRAWN:
        scenarios = list(scenarios)
        if not resume:
            forget(folder)
        key = _drawn(folder, _laws(scenarios))
    elif isinstance(wanted, str):
        raise ScenarioError(f"noise_key is {shown(wanted)}: give a whole number, or {DRAWN!r}")
    else:
        key = whole("noise_key", wanted, 0, MAX_SEED)
    for scenario in scenarios:
        same = scenario.noise_key == key or not key
        yield scenario if same else dataclasses.replace(scenario, noise_key=key).named(scenario.condition)


def pending(folder: Path) -> Path:
    """Return the file with the key of a study whose last run has not ended, outside of its folder."""
    home = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".local" / "state"
    name = hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:32]
    return Path(home) / "smc_mujoco" / "noise_keys" / f"{name}.json"


def public(folder: Path) -> bool:
    """Return whether the key of a study is in its folder."""
    return (folder / FILE).exists()


def publish(folder: Path, scenarios: Iterable[Scenario]) -> None:
    """Write the key of a study, whose runs have all ended, to its folder."""
    scenarios = list(scenarios)
    if not public(folder):
        write_json(folder / FILE, {"key": scenarios[0].noise_key, "laws": _laws(scenarios)})
    with contextlib.suppress(OSError):
        pending(folder).unlink(missing_ok=True)


def forget(folder: Path) -> None:
    """Remove the key of a study."""
    (folder / FILE).unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        pending(folder).unlink(missing_ok=True)


def _laws(scenarios: Iterable[Scenario]) -> dict[str, dict[str, str]]:
    """Return hash -> description of the user's laws."""
    laws = {law_hash(scenario): scenario for scenario in filter(has_user_code, scenarios)}
    return {name: _description(scenario) for name, scenario in laws.items()}


def _drawn(folder: Path, laws: dict[str, dict[str, str]]) -> int:
    """Return the key of a study if it was drawn for all these laws, else a new one, which is kept in `pending`."""
    key, before = 0, {}
    for file in (pending(folder), folder / FILE):
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            stored = json.loads(file.read_text(encoding="utf-8"))
            key, before = (
                whole("noise_key", stored["key"], 1, MAX_SEED),
                {n: dict(v) for n, v in stored["laws"].items()},
            )
            break
    new = [law for name, law in laws.items() if name not in before]
    if key and not new:
        return key
    if key:
        changes = joined(dict.fromkeys(_change_in_words(law, list(before.values())) for law in new))
        print(f"{changes}: a new noise key is drawn, and all runs are done again", file=sys.stderr)
    forget(folder)
    key = draw_key()
    with contextlib.suppress(OSError, ScenarioError):  # nowhere to write: a study that is stopped then begins again
        pending(folder).parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_json(pending(folder), {"key": key, "laws": laws}).chmod(0o600)
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
