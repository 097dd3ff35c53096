"""Golden metrics: recorded by `pytest --smc-update` in a JSON file beside the test, and compared from then on.

test_laws.golden.json, for test_laws.py: test -> metric -> value, tolerance, unit. Value and tolerance have the same
unit; a test that names no tolerance has those of the file.
"""

import contextlib
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.common.files import plain, read_json, replacing
from smc_mujoco.testing.limits import Limit, answer, table, told
from smc_mujoco.testing.response import StepResponse

RELATIVE = 0.01  # of the recorded value, chosen: what another processor's rounding does to a smooth law is far below
UPDATE = "run pytest --smc-update"
LEAST = 1e-9  # in the metric's unit: what rounding leaves of a metric that is 0


def place(test: Path) -> Path:
    """The golden file of a test file."""
    return test.with_suffix(".golden.json")


def record(file: Path, key: str, response: StepResponse, rel: float | None, tolerances: Mapping[str, float]) -> None:
    """Write a response's metrics and their tolerances into the file, under `key`; what is compared says `compare`.

    Raises:
      ScenarioError: the run failed, or a tolerance is none.
    """
    _asked(response, tolerances)
    names = tolerances if tolerances and rel is None else [name for name in response.values if response.tells(name)]
    entry = {}
    for name in names:
        value = float(response.values[name])
        within = _tolerance(name, value, tolerances, RELATIVE if rel is None else rel)
        entry[name] = {"value": value, "tolerance": within, "unit": response.unit(name)}
    try:
        with locked(file.parent):
            known = (read(file) if file.exists() else {}) | {key: entry}
            text = json.dumps(plain(dict(sorted(known.items()))), indent=2, ensure_ascii=False, allow_nan=False)
            with replacing(file) as part:
                part.write_text(f"{text}\n", encoding="utf-8")
    except OSError as error:
        raise ScenarioError(f"{file} cannot be written ({error.strerror}): record where it can") from None


def compare(file: Path, key: str, response: StepResponse, rel: float | None, tolerances: Mapping[str, float]) -> None:
    """Compare a response with what was recorded under `key`.

    Args:
      rel: the share of its recorded value within which a metric must stay; None: the tolerance in the file.
      tolerances: metric -> tolerance in its unit. Without rel only these metrics are compared.

    Raises:
      AssertionError: nothing was recorded, or a metric is off; then the message has a table of all that were compared.
      ScenarioError: a file that cannot be read, or a tolerance that is none.
    """
    __tracebackhide__ = True
    _asked(response, tolerances)
    if response.failure is not None:
        raise AssertionError(f"{response}: {response.failure}")
    known = read(file).get(key, {}) if file.exists() else {}
    if missing := [name for name in tolerances if name not in known] or ([] if known else ["metrics"]):
        raise AssertionError(f"{file.name} has no golden {', '.join(missing)} of {key}: {UPDATE}")
    names = list(tolerances if tolerances and rel is None else known)
    try:
        response.named(dict.fromkeys(names))
    except ScenarioError as error:  # recorded by another version, or of another plant
        raise ScenarioError(f"{file.name}, {key}: {error}; or {UPDATE}") from None
    golden = {name: _number(file, key, name, known, "value") for name in names}
    asked = []
    for name, value in golden.items():
        given = rel is not None or name in tolerances
        within = (
            _tolerance(name, value, tolerances, rel or 0.0) if given else _number(file, key, name, known, "tolerance")
        )
        asked.append(_limit(response, name, value, within))
    response.limits.extend(asked)
    _judge(response, asked)


def _asked(response: object, tolerances: Mapping[str, float]) -> None:
    """Raise ScenarioError for what is no response, and for tolerances of what it has no metric for."""
    if not isinstance(response, StepResponse):
        raise ScenarioError(f"golden is given {shown(response)}: give what step_response returned")
    response.named(tolerances)


def _judge(response: StepResponse, asked: Sequence[Limit]) -> None:
    """Raise AssertionError where a metric is off."""
    __tracebackhide__ = True
    met = {name: told(response.values[name], response.unit(name)) for name, _, _ in asked}
    if off := [f"{name} is {met[name]}, golden {words}" for name, words, kept in asked if not kept]:
        lines = table(
            ("metric", "value", "golden", "ok"), [(n, met[n], words, answer(kept)) for n, words, kept in asked]
        )
        raise AssertionError(f"{'; '.join(off)} ({response}; if it is meant, {UPDATE})\n{lines}")


def _limit(response: StepResponse, name: str, golden: float, tolerance: float) -> Limit:
    value = float(response.values[name])
    kept = value == golden or abs(value - golden) <= tolerance
    return Limit(name, f"{told(golden)} ± {told(tolerance)}", kept)


def _tolerance(name: str, value: float, tolerances: Mapping[str, float], rel: float) -> float:
    """In the metric's unit: the one that is named, or a share of the value; of inf, compared as it is, nothing."""
    if name in tolerances:
        return number(f"tolerance of {name}", tolerances[name], least=0.0)
    share = max(number("rel", rel, least=0.0) * abs(value), LEAST)
    return float(f"{share:.2g}") if math.isfinite(value) else 0.0


def _number(file: Path, key: str, name: str, known: Mapping[str, Any], what: str) -> float:
    try:
        return float(known[name][what])
    except (TypeError, KeyError, ValueError):
        raise ScenarioError(f"{file.name} has no {what} of {name} for {key}: {UPDATE}") from None


def read(file: Path) -> dict[str, dict[str, Any]]:
    """What a golden file holds.

    Raises:
      ScenarioError: it is no golden file.
    """
    try:
        found = read_json(file)
        if isinstance(found, dict) and all(isinstance(entry, dict) for entry in found.values()):
            return found
        why = "it is not test -> metric -> value"
    except (OSError, ValueError) as error:
        why = str(error)
    raise ScenarioError(f"{file} cannot be read ({why}): delete it and {UPDATE}")


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """One writer at a time in a folder, among the workers of a parallel session; on Windows no lock."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)  # and with it the lock
