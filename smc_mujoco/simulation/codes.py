"""Hashes of the code that a run calls: of its functions, and of a user's parts and plant."""

from typing import Any

from smc_mujoco.common import fingerprint
from smc_mujoco.common.errors import warn_once
from smc_mujoco.common.text import joined
from smc_mujoco.mechanisms.custom.mjcf import digest_of
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.scenario import Scenario

PACKAGE = "smc_mujoco."
# Plant -> hashes of its code and files, shared by the runs of a study. Each study has a new dict:
# files may change.
Hashes = dict[Plant, list[str]]


def code_hashes(s: Scenario, plants: Hashes) -> list[str]:
    """Return hashes of the code that a run calls: law, estimator, surface, signals, and a user's
    parts and plant.
    """
    things = []
    for part in (*s.law.parts, s.velocity, s.surface):
        if part is not None:
            things.append(part.function)
    references = dict.fromkeys(s.references)
    for signal in (*references, s.feedforward_signal, *s.disturbance):
        if signal is not None:
            things.append(type(signal))
    for part in (*s.friction, *s.compensated, *s.contact, *s.actuator):
        kind = type(part)
        if not kind.__module__.startswith(PACKAGE):
            things.append(kind)
    if s.plant not in plants:
        plants[s.plant] = _plant_codes(s.plant)
    hashes = [*map(fingerprint.of, things), *plants[s.plant]]
    for digest in hashes:
        for function, names in fingerprint.unseen(digest).items():
            warn_once(
                f"{function} reads by {joined(names)}, and what it reads so is not in the keys of "
                "kept runs: after a change there a folder gives the old runs, so read it into a "
                "global variable, or give a new folder"
            )
    return hashes


def _plant_codes(plant: Plant) -> list[str]:
    """Return hashes of a user's parts of a plant: functions, and the model, which `build` may read
    from a file.
    """
    builds = *plant.contacts.items(), *plant.mechanisms.items()
    if plant.build.__module__.startswith(PACKAGE):
        of_user = filter(_of_a_user, (plant.fields, plant.nominal, *builds))
        return list(map(fingerprint.of, of_user))
    functions = plant.build, plant.fields, plant.nominal, builds
    digest = digest_of(plant.spec())
    return [*map(fingerprint.of, functions), digest]


def _of_a_user(thing: Any) -> bool:
    """Return whether a function is not of this package, or any function in nested tuples is not."""
    if isinstance(thing, tuple):
        return any(map(_of_a_user, thing))
    return callable(thing) and not (thing.__module__ or "").startswith(
        PACKAGE
    )  # generated code has no module
