"""A jump of numbers of parts: what a run reads of them, from the jump on.

Fields of the model follow from `model.field_values`. The rest are the numbers of the parts that the
callback simulates, those of drives, and those of sensors.
"""

from collections.abc import Hashable, Iterator
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.moments import Torque
from smc_mujoco.simulation import state
from smc_mujoco.simulation.model import structure
from smc_mujoco.simulation.scenario import Scenario

FIXED = "period", "delay", "skew"  # numbers of a sensor, by which readings are under way


def check_jump(scenario: Scenario) -> None:
    """Raise ScenarioError for a number of a part that cannot change in a run."""
    before, *later = scenario.machines
    for after in later:
        for old, new in zip(before.sensors, after.sensors, strict=True):
            for name in FIXED:
                if getattr(old, name) != getattr(new, name):
                    raise _refused(f"sensor.{name}", "readings are under way")
        if _form(before) != _form(after):
            paths = ", ".join(before.jump.of_parts) if before.jump else ""
            raise _refused(paths, "the model is built with it")


def _refused(path: str, why: str) -> ScenarioError:
    return ScenarioError(
        f"Jump has {path}, which cannot change in a run, as {why}: leave it out, or run both "
        "machines, or give a factor such as 1e-9 instead of 0"
    )


def _form(scenario: Scenario) -> Hashable:
    """Return what must be equal before and after a jump."""
    acting = []
    for part, kind in scenario.acting:
        channels = tuple(part.channels(scenario.plant))
        acting.append((type(part), kind, part.memory, channels))
    return structure(scenario), tuple(acting)


def put(after: Scenario, packed: Any, runs: Iterator[Any]) -> None:
    """Write the numbers of a scenario's parts over those in the arrays of a simulation, a Packed.

    `runs` has the `Run` of each acting part, and then that of each sensor.
    """
    s = after.resolved
    rows = iter(packed.parts)
    for part, _ in s.acting:
        numbers = part.numbers(next(runs))
        for place, _ in enumerate(part.channels(s.plant)):
            joint = place if len(numbers) > 1 else 0
            _write(packed.numbers, next(rows), numbers[joint])
    for sensor in s.sensors:
        (numbers,) = sensor.numbers(next(runs))
        for i in sensor.channels(s.plant):
            _write(packed.numbers, packed.readers[i], numbers)
    driven = slice(s.plant.driven)
    packed.drives["scale"][driven] = s.drive_train.scales
    torques = np.array(s.drive_train.torques)
    for name, column in zip(Torque._fields, torques.T, strict=True):
        packed.drives["torque"][name][driven] = column


def _write(numbers: np.ndarray, row: Any, values: Any) -> None:
    """Write the parameters of the function in a row."""
    place = int(row["function"]["parameters"])
    state.array_at(numbers, place, (len(values),))[:] = values
