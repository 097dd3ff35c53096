"""What a group of runs is made of: the functions of its loop, and the places of its numbers."""

import dataclasses
import functools
from typing import Any, NamedTuple

from smc_mujoco.common.aliases import Fields, Names
from smc_mujoco.control.joint_law import stored_dtype
from smc_mujoco.control.measurement import Measurement

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
    """A function that acts on channels, with the names of its parameters and its memory in each."""

    function: Any  # None: one in C, whose address is in the row
    names: Names
    memory: int = 0
    channels: tuple[int, ...] = ()  # on which it acts, with numbers for each; (): on all, with one


class Form(NamedTuple):
    """What decides the code of a loop. Runs of one form differ in numbers alone."""

    n: int  # channels
    driven: int  # those that have an actuator, which come first
    joint: bool  # whether the law is of many joints
    nominal: Part
    laws: tuple[Part, ...]  # of all channels, or one for each
    estimators: tuple[Part, ...]  # one
    surfaces: tuple[Part, ...]  # one or none, as are sensors and drives
    sensors: tuple[Part, ...]
    drives: tuple[Part, ...]  # between command and force
    frictions: tuple[Part, ...]
    references: tuple[type, ...]  # kinds of signals, of all channels, or one for each
    disturbances: tuple[type, ...]
    feedforwards: tuple[type, ...]  # one or none
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
        self.slices: dict[str, slice] = {}

    def take(self, name: str, count: int = 1) -> None:
        """Give the next `count` numbers a name."""
        self.at[name] = self.size
        self.size += count
        self.slices[name] = slice(self.at[name], self.size)

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
    for name, part in parts(form).items():
        places.take(f"{name} address")
        places.take(name, len(part.names) * (form.n if part.channels else 1))
    for name in ("damping", "levels"):
        places.take(name, form.n if form.frictions else 0)
    places.take("hinges", form.n if form.sensors else 0)
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
    if any(law.function is None for law in form.laws):
        places.take("commanded", 2 * form.n)
        places.take("measured", measured_places(form))
    for name in ("mean", "motor"):  # forces of the drives
        if form.drives:
            places.take(name, form.n)
        else:
            places.at[name] = places.at["applied"]
    places.take("reaction", form.n if form.frictions else 0)
    for name, part in parts(form).items():
        places.take(name, part.memory * form.n)
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


def parts(form: Form) -> dict[str, Part]:
    """Return the functions that act on channels, by the names of their places."""
    return _named(form, ("laws", "estimators", "surfaces", "sensors", "drives", "frictions"))


def signals(form: Form) -> Fields:
    """Return the kinds of a form's signals, by the names of their places."""
    return _named(form, ("feedforwards", "references", "disturbances", "errors"))


def _named(form: Form, names: Names) -> Fields:
    found = {}
    for name in names:
        for i, item in enumerate(getattr(form, name)):
            if item is not None:
                found[f"{name} {i}"] = item
    return found


def parameters(kind: Any) -> Names:
    """Return the names of a signal's parameters."""
    if kind.series:  # its points say it all
        return ()
    return tuple(field.name for field in dataclasses.fields(kind))
