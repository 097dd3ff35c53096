"""What a group of runs is made of: the functions of its loop, and the places of its numbers."""

import dataclasses
import functools
from typing import Any, NamedTuple

from smc_mujoco.common.aliases import Fields, Names
from smc_mujoco.control.joint_law import stored_dtype
from smc_mujoco.control.measurement import Measurement
from smc_mujoco.mechanisms.hardware.drives import DriveStep, Series

LOGGED = ("x", "v", "u", "s", "d", "r")  # of a channel at a sample, in a log
FAILURE, FAILED_STEP, SCORES = range(3)  # places in the scores of a run; metrics follow
SETTINGS = ("samples", "steps", "step", "period", "delay", "jump_step", "seed", "uses_model")
SETTINGS += ("sigma_x", "sigma_v", "jitter", "missed", "pause", "pause_samples", "pause_phase")
SETTINGS += ("early", "late", "logging")
ACTIVE, STREAM, PARAMETERS = range(3)  # places in the numbers of a signal
# rest: velocities of 0
STATE = ("x", "v", "a", "x0", "v0", "sum_v", "sum_a", "applied", "rest", "d")
MEASURED = ("seen_x", "seen_v", "seen_a")
SAMPLED = ("sample_x", "sample_v", "sample_d", "u", "s", "r", "last_u", "last_r")


class Part(NamedTuple):
    """A function of the user's, with the names of its parameters and its memory in a channel."""

    function: Any  # None: one in C, whose address is in the row
    names: Names
    memory: int = 0


class Form(NamedTuple):
    """What decides the code of a loop. Runs of one form differ in numbers alone."""

    n: int  # channels
    driven: int  # those that have an actuator, which come first
    joint: bool  # whether the law is of many joints
    laws: tuple[Part, ...]  # of all channels, or one for each
    nominal: Part
    estimator: Part
    surface: Part | None
    frictions: tuple[Part, ...]
    sensor: Part | None
    drive: bool  # whether lags or rate limits stand between command and force
    references: tuple[type, ...]  # kinds of signals, of all channels, or one for each
    disturbances: tuple[type, ...]
    feedforward: type | None
    errors: tuple[type | None, ...]  # of position and velocity
    noise: bool
    true_model: bool
    jump: bool
    delay: bool
    clock: bool
    slots: int  # commands that are under way
    metrics: Names


class Places:
    """Indices of named numbers in one array."""

    def __init__(self) -> None:
        self.size = 0
        self.at: dict[str, int] = {}

    def take(self, name: str, count: int = 1) -> None:
        """Give the next `count` numbers a name."""
        self.at[name] = self.size
        self.size += count

    def of(self, *names: str) -> list[int]:
        """Return the first index of each name."""
        return [self.at[name] for name in names]


@functools.cache
def row_places(form: Form) -> Places:
    """Return where the numbers of a run are in its row."""
    places = Places()
    for name in SETTINGS:
        places.take(name)
    for name in ("x0", "v0", "limits", "bands"):
        places.take(name, form.n)
    for name in ("known", "before", "after"):
        places.take(name, len(form.nominal.names))
    for i, law in enumerate(form.laws):
        if law.function is None:
            places.take(f"address {i}")
        places.take(f"law {i}", len(law.names) * (form.driven if form.joint else 1))
    places.take("estimator", len(form.estimator.names))
    places.take("surface", len(form.surface.names) if form.surface else 0)
    places.take("drives", len(DriveStep._fields) * form.n if form.drive else 0)
    for name in ("levels", "damping"):
        places.take(name, form.n if form.frictions else 0)
    for j, friction in enumerate(form.frictions):
        places.take(f"friction {j}", (1 + len(friction.names)) * form.n)
    if form.sensor:
        places.take("hinges", form.n)
        places.take("sensor", len(form.sensor.names))
    for name, kind in signals(form).items():
        places.take(name, PARAMETERS + len(parameters(kind)) + 2 * kind.series)
    places.take("reach", 4)
    return places


@functools.cache
def work_places(form: Form) -> Places:
    """Return where the state of a run is."""
    places = Places()
    for name in (*STATE, *MEASURED, *SAMPLED):
        places.take(name, form.n)
    places.take("buffer", form.slots * form.n)
    places.take("law", max(law.memory for law in form.laws) * form.n)
    if any(law.function is None for law in form.laws):
        places.take("commanded", 2 * form.n)
        places.take("measured", measured_places(form))
    for name in ("mean", "motor"):  # forces of the drives
        if form.drive:
            places.take(name, form.n)
        else:
            places.at[name] = places.at["applied"]
    places.take("drives", Series.memory * form.n if form.drive else 0)
    places.take("reaction", form.n if form.frictions else 0)
    for j, friction in enumerate(form.frictions):
        places.take(f"friction {j}", friction.memory * form.n)
    places.take("sensor", form.sensor.memory * form.n if form.sensor else 0)
    places.take("estimator", form.estimator.memory * form.n)
    places.take("surface", form.surface.memory * form.n if form.surface else 0)
    for name, kind in signals(form).items():
        places.take(name, 1 + kind.memory * form.n)
    for name in form.metrics:
        places.take(f"metric {name}", metric_places(name, form.n))
    return places


def metric_places(name: str, n: int) -> int:
    """Return how many numbers a metric of n channels keeps."""
    return 11 + 6 * n if name == "outcome" else 4 * n


def measured_places(form: Form) -> int:
    """Return how many numbers a law in C reads."""
    if form.joint:
        return stored_dtype(form.n).itemsize // 8
    return len(Measurement._fields)


def signals(form: Form) -> Fields:
    """Return the kinds of a form's signals, by the names of their places."""
    found: Fields = {"feedforward": form.feedforward}
    for name in ("references", "disturbances", "errors"):
        for i, kind in enumerate(getattr(form, name)):
            found[f"{name} {i}"] = kind
    return {name: kind for name, kind in found.items() if kind is not None}


def parameters(kind: Any) -> Names:
    """Return the names of a signal's parameters."""
    if kind.series:  # its points say it all
        return ()
    return tuple(field.name for field in dataclasses.fields(kind))
