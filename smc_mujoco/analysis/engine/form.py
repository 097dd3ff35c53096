"""What a group of runs is made of: the functions of its loop, and the places of its numbers.

A place is an index, of the first number of its kind.
"""

import dataclasses
import functools
from typing import Any, NamedTuple

from smc_mujoco.common.aliases import Names
from smc_mujoco.control.joint_law import stored_dtype
from smc_mujoco.control.measurement import Measurement
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.hardware.moments import CHANNEL_STATE
from smc_mujoco.simulation.state import LOG

LOGGED = ("x", "v", "u", "s", "d", "r")  # of a channel at a sample, in a log
FAILURE, FAILED_STEP, SCORES = range(3)  # places in the scores of a run; metrics follow
UNDER_WAY = -1  # the failure of a run that has not ended; others are of state.py
ACTIVE, STREAM, PARAMETERS = range(3)  # places in the numbers of a signal
WIDTH = len(LOG.names or ())  # numbers of a sample of a channel
STATES = len(CHANNEL_STATE.names or ())


class Settings(NamedTuple):
    """The first numbers of a run's row; most are those of `prepare.settings`."""

    samples: Any  # K: they are counted from 0
    steps: Any
    step: Any
    period: Any
    delay: Any
    jump_step: Any
    seed: Any
    uses_model: Any
    sigma_x: Any
    sigma_v: Any
    jitter: Any
    missed: Any
    pause: Any
    pause_samples: Any
    pause_phase: Any
    fault_step: Any
    fault_gain: Any
    fault_bias: Any
    stuck: Any
    failing: Any
    early: Any  # the first sample after the transient
    late: Any  # the first sample of the last part
    logging: Any  # whether the run writes a log


SETTING = Settings(*range(len(Settings._fields)))  # places


class ChannelFunction(NamedTuple):
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
    nominal: ChannelFunction
    laws: tuple[ChannelFunction, ...]  # of all channels, or one for each
    estimator: ChannelFunction
    surface: ChannelFunction | None
    sensor: ChannelFunction | None
    drive: ChannelFunction | None  # between command and force
    rotors: tuple[int, ...]  # channels whose drive turns a rotor beside the joint
    motor_side: tuple[int, ...]  # those of them whose sensor reads the rotor
    frictions: tuple[ChannelFunction, ...]  # on joints
    rotor_frictions: tuple[ChannelFunction, ...]  # on rotors, by the channels of their joints
    compensated: tuple[ChannelFunction, ...]  # frictions
    compensates_on: int  # at which speed they are compensated, an index of feedforward.ON
    references: tuple[type, ...]  # kinds of signals, of all channels, or one for each
    disturbances: tuple[type, ...]
    feedforward: type | None
    errors: tuple[type | None, ...]  # of position and velocity
    noise: bool
    true_model: bool
    jump: bool
    delay: bool
    clock: bool
    fails: bool
    drops: bool  # whether a sensor loses readings
    implicit: bool  # whether a step is implicitfast's, with plays; else RK4's, with springs
    slots: int  # commands that are under way
    past: int  # physics steps whose states a sensor may read; 0 if it reads the present one
    metrics: Names

    @property
    def bodies(self) -> int:
        """How many positions it integrates: of all channels, then of their rotors."""
        return self.n + len(self.rotors)

    @property
    def rubs(self) -> bool:
        """Whether the loop has forces of friction."""
        return bool(self.frictions) or self.implicit

    @property
    def beside_names(self) -> Names:
        """Names of the numbers of what is between a rotor and its joint."""
        return Backlash.names if self.implicit else ElasticJoint.names


class PartAt(NamedTuple):
    """Where a part of a form has its numbers."""

    part: ChannelFunction
    address: int  # in the row: of a function in C
    numbers: int  # in the row: its parameters, of all channels or of each in turn
    memory: int  # in the state: of each channel in turn


class SignalAt(NamedTuple):
    """Where a signal of a form has its numbers."""

    kind: Any
    numbers: int  # in the row: ACTIVE, STREAM, its parameters; of a series its place and its length
    memory: int  # in the state: its last value, and its memory in each channel


class RowPlaces(NamedTuple):
    """Where a run's other numbers are in its row; n of each, where it says no other."""

    x0: int
    v0: int
    limits: int
    bands: int  # within which a channel has settled
    shares: int  # 2 % of the scale of a channel's group
    nominal: int  # values of the plant, as the law knows them; as many as it has names
    before: int  # and as they are until a jump
    after: int
    damping: int  # on bodies; this and `levels` only with frictions or in an implicit step
    levels: int  # of dry friction
    counted: int  # damping of bristles on each body, as an implicit step counts it; only in one
    beside: int  # what is between each rotor and its joint, by `beside_names`
    hinges: int  # whether a joint is one; only with a sensor
    periods: int  # s between readings, and until one arrives; only with a past
    delays: int
    compensation: int  # 1 + error and eps; only with compensated frictions
    reach: int  # 4 numbers of an `outcome`
    draw: int  # address of what draws noise on the processor; only with noise


class WorkPlaces(NamedTuple):
    """Where a run's state is; n numbers of each, where it says no other."""

    x: int  # of all bodies, as are the next six: of all channels, then of their rotors
    v: int
    a: int  # of the stages of a step, as are the next four
    x0: int
    v0: int
    sum_v: int
    sum_a: int
    rest: int  # velocities of 0
    unit: int  # and of 1 in one joint; only in an implicit step, as the next
    dry: int  # force of MuJoCo's dry friction, of joint and rotor together, in the step before
    motor: int  # force of a drive at a stage
    d: int  # the disturbances' force
    seen_x: int
    seen_v: int
    seen_a: int
    now: int  # LOG of each channel
    before: int  # LOG at the sample before
    states: int  # CHANNEL_STATE of each channel
    ring: int  # commands of `slots` samples
    past: int  # x and v of all bodies, in each of `past` steps
    measured: int  # what a law in C reads
    commanded: int  # its u and s, 2 n


class Layout(NamedTuple):
    """Where everything of a form is."""

    row: RowPlaces
    work: WorkPlaces
    row_size: int
    work_size: int
    laws: tuple[PartAt, ...]
    estimator: PartAt
    surface: PartAt | None
    sensor: PartAt | None
    drive: PartAt | None
    frictions: tuple[PartAt, ...]
    rotor_frictions: tuple[PartAt, ...]
    compensated: tuple[PartAt, ...]
    references: tuple[SignalAt, ...]
    disturbances: tuple[SignalAt, ...]
    feedforward: SignalAt | None
    errors: tuple[SignalAt | None, ...]
    metrics: tuple[int, ...]  # places of their numbers in the state


class Places:
    """Places that are given one after another."""

    def __init__(self, size: int = 0) -> None:
        self.size = size

    def take(self, count: int = 1) -> int:
        """Return the first of the next `count` places."""
        first = self.size
        self.size += count
        return first


@functools.cache
def layout(form: Form) -> Layout:
    """Return where the numbers of a form's runs are."""
    row = Places(len(SETTING))
    work = Places()

    def of_part(part: ChannelFunction) -> PartAt:
        channels = form.n if part.channels else 1
        width = len(part.names) * channels
        return PartAt(part, row.take(), row.take(width), work.take(part.memory * form.n))

    def of_signal(kind: Any) -> SignalAt:
        width = PARAMETERS + len(parameters(kind)) + 2 * kind.series
        return SignalAt(kind, row.take(width), work.take(1 + kind.memory * form.n))

    return Layout(
        row=_row_places(form, row),
        work=_work_places(form, work),
        laws=tuple(map(of_part, form.laws)),
        estimator=of_part(form.estimator),
        surface=form.surface and of_part(form.surface),
        sensor=form.sensor and of_part(form.sensor),
        drive=form.drive and of_part(form.drive),
        frictions=tuple(map(of_part, form.frictions)),
        rotor_frictions=tuple(map(of_part, form.rotor_frictions)),
        compensated=tuple(map(of_part, form.compensated)),
        references=tuple(map(of_signal, form.references)),
        disturbances=tuple(map(of_signal, form.disturbances)),
        feedforward=form.feedforward and of_signal(form.feedforward),
        errors=tuple(kind and of_signal(kind) for kind in form.errors),
        metrics=tuple(work.take(metric_places(name, form.n)) for name in form.metrics),
        row_size=row.size,
        work_size=work.size,
    )


def _row_places(form: Form, row: Places) -> RowPlaces:
    n = form.n
    values = len(form.nominal.names)
    return RowPlaces(
        x0=row.take(n),
        v0=row.take(n),
        limits=row.take(n),
        bands=row.take(n),
        shares=row.take(n),
        nominal=row.take(values),
        before=row.take(values),
        after=row.take(values),
        damping=row.take(form.bodies if form.rubs else 0),
        levels=row.take(form.bodies if form.rubs else 0),
        counted=row.take(form.bodies if form.implicit else 0),
        beside=row.take(len(form.beside_names) * len(form.rotors)),
        hinges=row.take(n if form.sensor else 0),
        periods=row.take(n if form.past else 0),
        delays=row.take(n if form.past else 0),
        compensation=row.take(2 if form.compensated else 0),
        reach=row.take(4),
        draw=row.take(1 if form.noise else 0),
    )


def _work_places(form: Form, work: Places) -> WorkPlaces:
    n = form.n
    in_c = any(law.function is None for law in form.laws)
    return WorkPlaces(
        x=work.take(form.bodies),
        v=work.take(form.bodies),
        a=work.take(form.bodies),
        x0=work.take(form.bodies),
        v0=work.take(form.bodies),
        sum_v=work.take(form.bodies),
        sum_a=work.take(form.bodies),
        rest=work.take(n),
        unit=work.take(n if form.implicit else 0),
        dry=work.take(n if form.implicit else 0),
        motor=work.take(n),
        d=work.take(n),
        seen_x=work.take(n),
        seen_v=work.take(n),
        seen_a=work.take(n),
        now=work.take(WIDTH * n),
        before=work.take(WIDTH * n),
        states=work.take(STATES * n),
        ring=work.take(form.slots * n),
        past=work.take(form.past * 2 * form.bodies),
        measured=work.take(measured_places(form) if in_c else 0),
        commanded=work.take(2 * n if in_c else 0),
    )


def metric_places(name: str, n: int) -> int:
    """Return how many numbers a metric of n channels keeps."""
    return 11 + 6 * n if name == "outcome" else 4 * n


def measured_places(form: Form) -> int:
    """Return how many numbers a law in C reads."""
    if form.joint:
        return stored_dtype(form.n).itemsize // 8
    return len(Measurement._fields)


def parameters(kind: Any) -> Names:
    """Return the names of a signal's parameters."""
    if kind.series:  # its points say it all
        return ()
    return tuple(field.name for field in dataclasses.fields(kind))
