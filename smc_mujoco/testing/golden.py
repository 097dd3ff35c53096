"""Golden metrics:

`pytest --smc-update` records them in a JSON file beside the test, and later runs compare with it.

The file of test_laws.py is test_laws.golden.json. It has, for each test and metric, the value, the
tolerance, and the unit of both. A test that names no tolerance uses those of the file.
"""

import contextlib
import json
import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from smc_mujoco.common.aliases import Fields, Numbers
from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.common.files import plain_data, read_json, write_text
from smc_mujoco.testing.limits import Limit, judge, quantity
from smc_mujoco.testing.response import StepResponse

__tracebackhide__ = True  # pytest hides the frames of a module that has it
# default tolerance, as a share of the value: chosen, far above rounding errors of other processors
RELATIVE = 0.01
UPDATE = "run pytest --smc-update"
MIN_TOLERANCE = 1e-9  # in the metric's unit: above rounding errors of a value that is 0


def record(file: Path, key: str, response: StepResponse, tolerances: Numbers) -> None:
    """Write a response's metrics and their tolerances into the file, under `key`.

    Arguments are those of `compare`.
    """
    tolerances = _checked(response, tolerances)
    entry = {}
    for name in tolerances or filter(response.applies, response.values):
        value, unit = response.value(name)
        tolerance = 0.0
        if math.isfinite(value):
            tolerance = float(f"{max(RELATIVE * abs(value), MIN_TOLERANCE):.2g}")
        tolerance: Any = tolerances.get(name, tolerance)
        entry[name] = {"value": value, "tolerance": tolerance, "unit": unit}
    try:
        with locked(file.parent):
            entries = dict(sorted((read_golden(file) | {key: entry}).items()))
            text = json.dumps(plain_data(entries), indent=2, ensure_ascii=False)
            write_text(file, f"{text}\n")
    except OSError as error:
        raise ScenarioError(
            f"{file} cannot be written ({error.strerror}): record it in a writable folder"
        ) from None


def compare_with_record(file: Path, key: str, response: StepResponse, tolerances: Numbers) -> None:
    """Compare a response with the metrics recorded under `key`.

    With `tolerances`, in the metrics' units, only these metrics count; without, all with the
    tolerances in the file.
    """
    tolerances = _checked(response, tolerances)
    recorded = read_golden(file).get(key, {})
    missing = [name for name in tolerances if name not in recorded]
    if not recorded:
        missing = missing or ["metrics"]
    if missing:
        raise AssertionError(f"{file.name} has no golden {', '.join(missing)} of {key}: {UPDATE}")
    names = tolerances or recorded
    try:
        response.check_names(names)
    except ScenarioError as error:  # recorded by another version, or of another plant
        raise ScenarioError(f"{file.name}, {key}: {error}; or {UPDATE}") from None
    limits = []
    for name in names:
        value, unit = response.value(name)
        golden: Any = recorded[name]["value"]
        if (of_file := recorded[name].get("unit")) != unit:
            raise ScenarioError(
                f"{file.name}, {key}: {name} is recorded in {shown(of_file)} and "
                f"measured in {shown(unit)}: {UPDATE}"
            )
        tolerance = tolerances.get(name, recorded[name]["tolerance"])
        alike = value == golden or (math.isnan(value) and math.isnan(golden))
        within = alike or abs(value - golden) <= tolerance
        expected = f"{quantity(golden)} ± {quantity(tolerance)}"  # pyright: ignore[reportArgumentType] NaN is None only in the file
        limits.append(Limit(name, quantity(value, unit), expected, within))
    judge(limits, "golden", ("run", str(response)), ("next", f"if it is meant, {UPDATE}"))


def _checked(response: object, tolerances: Numbers) -> dict[str, float]:
    """Return tolerances as numbers; raise ScenarioError for others, and for anything but a response
    that has them.
    """
    if not isinstance(response, StepResponse):
        raise ScenarioError(f"golden is given {shown(response)}: give what step_response returned")
    response.check_names(tolerances)
    checked = {}
    for name, value in tolerances.items():
        checked[name] = number(f"tolerance of {name}", value, low=0.0)
    return checked


def read_golden(file: Path) -> dict[str, dict[str, Fields]]:
    """Return the content of a golden file, test -> metric -> value, tolerance and unit; {} if there
    is no file.
    """
    try:
        stored = read_json(file)
        for entry in stored.values():
            for golden in entry.values():
                tolerance = number("a tolerance in it", golden["tolerance"], low=0.0)
                golden.update(value=float(golden["value"]), tolerance=tolerance)
        return stored
    except FileNotFoundError:
        return {}
    except (AttributeError, KeyError, TypeError):
        why = "it is not test -> metric -> value and tolerance"
    except (OSError, ValueError) as error:
        why = str(error)
    raise ScenarioError(f"{file} cannot be read ({why}): delete it and {UPDATE}")


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder, so that only one worker of a parallel session at a time writes into it."""
    try:
        import fcntl
    except ImportError:  # Windows locks no folder: record there without parallel workers
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)  # releases the lock
