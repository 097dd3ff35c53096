"""Sensors: an encoder between the mechanism and the controller.

The controller reads a channel's position x as

    x_j = q round((x(t_j) + noise + bias) / q),    q = 2 pi / counts rad  or  1 / counts m,

every `period`, each `delay` later; j counts the readings. If one is lost, the one before it stays.
MuJoCo's sensors have the period and the delay; `read` rounds and drops readings. An encoder
measures no velocity: by default the controller differentiates the positions.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a function or a property here)
import dataclasses
import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Annotated, ClassVar

import mujoco
import numpy as np

from smc_mujoco.common.constraints import Finite, Natural, OneOf, Positive, Probability, Whole
from smc_mujoco.common.errors import ScenarioError, number
from smc_mujoco.mechanisms.hardware.moments import Run
from smc_mujoco.mechanisms.hardware.part import SIDES, OnJoints
from smc_mujoco.mechanisms.layout import ROTOR, joint_ids, moving_joints
from smc_mujoco.mechanisms.plant import Field, Plant

# Share of a physics step by which readings are taken early, because MuJoCo compares times, which
# have rounding errors.
EARLY_SHARE = 0.5
MAX_COUNT = 2.0**52  # a larger number is whole
MAX_READINGS = 100_000  # under way in a delay: chosen, 6 MB per channel
# readings in a history are a multiple of this, so that runs with other delays share a model; chosen
READINGS_STEP = 64
KINDS = mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL


@dataclasses.dataclass(frozen=True)
class Encoder(OnJoints):
    """A position encoder, on every channel that is measured or on some joints by name.

    Attributes:
      counts: per revolution of a hinge, or per metre of a slide; math.inf for no quantisation.
      bias: zero error, added to every reading, rad or m.
      dropout: probability that a reading is lost, 0 .. 1; the first is never lost.
      period: s between readings, greater than 0, a whole number of physics steps. None: one at
        every control sample.
      delay: s until a reading arrives, 0 or more, a whole number of physics steps. Until the first
        arrives, the controller reads x0.
      skew: s, 0 or more, a whole number of physics steps: a reading of each channel is older by it
        than that of the channel before, as on a bus on which the last channel is read first. Not
        with `period`.

      side: "link": it reads the joint; "motor": it reads the rotor beside it, of an ElasticJoint or
        a Backlash. Without one, both sides are the same. Angles are those at the joint: an encoder
        of c counts on a motor behind a gear g has g c counts.

    With the velocity estimator "measured" there is also a tachometer, with the same period, delay
    and losses.
    """

    counts: Annotated[float, Whole(low=2, high=2**32, infinite=True)] = 4096
    bias: Finite = 0.0
    dropout: Probability = 0.0
    period: Positive | None = None
    delay: Natural = 0.0
    skew: Natural = 0.0
    side: Annotated[str, OneOf(names=SIDES)] = dataclasses.field(default="link", kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.skew and self.period:
            raise ScenarioError(
                f"Encoder has period {self.period:g} and skew {self.skew:g} s: give one of them"
            )

    units: ClassVar[Mapping[str, str]] = {"bias": "{x}", "period": "s", "delay": "s", "skew": "s"}
    memory = 2  # the last reading that was not lost
    names = ("bias", "counts", "dropout")

    def numbers(self, run: Run) -> list[Sequence[float]]:
        return [[self.bias, 0.0 if self.counts == math.inf else self.counts, self.dropout]]

    @staticmethod
    def read(y, p, memory):
        """Return position and velocity as read: with bias, rounded, or those of the reading before.

        y is a Sight.
        """
        x = y.x
        if p.bias != 0.0:
            x += p.bias
        if p.counts != 0.0:
            quantum = (2.0 * math.pi if y.hinge != 0.0 else 1.0) / p.counts
            count = x / quantum + 0.5
            if abs(count) < MAX_COUNT:
                count = math.floor(count)
            x = quantum * count
        if p.dropout != 0.0 and y.j > 0.0 and y.chance < p.dropout:
            return memory[0], memory[1]
        memory[0], memory[1] = x, y.v
        return x, y.v

    def channels(self, plant: Plant) -> Sequence[int]:
        return super().channels(plant) if self.on else range(plant.n)

    def structure(self) -> tuple[Hashable, ...]:
        return *super().structure(), self.side

    def edit(self, spec: mujoco.MjSpec) -> None:
        for sensor in spec.sensors if self.side == "motor" else ():
            rotor = ROTOR + sensor.objname
            read = sensor.type in KINDS and (not self.on or sensor.objname in self.on)
            if read and spec.joint(rotor) is not None:
                sensor.objname = rotor

    def quantum(self, hinge: bool) -> float:
        """Return one count, rad of a hinge or m of a slide; 0 without quantisation."""
        if self.counts == math.inf:
            return 0.0
        return (2.0 * math.pi if hinge else 1.0) / self.counts

    def readings(self, step: float, channels: int = 1) -> int:
        """Return how many readings MuJoCo must keep at physics steps of `step` s; 0 without delay,
        skew and period.
        """
        longest = self.delay + (channels - 1) * self.skew
        if not longest and not self.period:
            return 0
        needed = math.ceil(longest / (self.period or step) - 1e-9) + 2
        return READINGS_STEP * math.ceil(needed / READINGS_STEP)

    def check(self, step: float) -> None:
        """Raise ScenarioError for a time that is not a whole number of physics steps, or too many
        delayed readings.
        """
        number("step", step, above=0.0)
        if self.delay / (self.period or step) > MAX_READINGS:
            long = f"{self.delay:g} s is more than {MAX_READINGS:,} readings long"
            raise ScenarioError(f"Encoder's delay {long}: give a shorter one")
        for name, time in (
            ("delay", self.delay),
            ("skew", self.skew),
            ("period", self.period or 0.0),
        ):
            count = time / step
            if math.isinf(count) or abs(count - round(count)) > 1e-6 or 0.0 < count < 0.5:
                steps = (
                    f"a whole number of physics steps of {step:g} s: "
                    "give a physics_step that divides it"
                )
                raise ScenarioError(f"Encoder's {name} {time:g} s is not {steps}")

    def fields(self, model):
        """Yield the fields of delay and period of its channels' two sensors."""
        if model.nhistory:
            sensors = sensor_ids(model)
            of_each = moving_joints(model)[:, None] == model.sensor_objid[sensors, None]
            channels = of_each.any(axis=0).argmax(axis=1)
            if self.on:
                named = np.isin(joint_ids(model), [model.joint(name).id for name in self.on])
                sensors, channels = sensors[named[channels]], channels[named[channels]]
            delays = self.delay + self.skew * channels
            yield Field(
                "sensor_delay", sensors, np.maximum(0.0, delays - EARLY_SHARE * model.opt.timestep)
            )
            yield Field("sensor_interval", (sensors, 0), self.period or 0.0)


def sensor_ids(model: mujoco.MjModel) -> np.ndarray:
    """Return the indices of the channels' position and velocity sensors, (2n,)."""
    kinds = np.isin(model.sensor_type, KINDS)
    return np.flatnonzero(kinds & np.isin(model.sensor_objid, moving_joints(model)))


def remember(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Fill the histories with the present readings, so that a delayed sensor starts with the
    initial state.
    """
    for sensor in sensor_ids(model):
        count = int(model.sensor_history[sensor, 0])
        interval = float(model.sensor_interval[sensor, 0]) or model.opt.timestep
        joint = model.sensor_objid[sensor]
        position = model.sensor_type[sensor] == mujoco.mjtSensor.mjSENS_JOINTPOS
        if position:
            value = data.qpos[model.jnt_qposadr[joint]]
        else:
            value = data.qvel[model.jnt_dofadr[joint]]
        times = interval * np.arange(-count, 0.0)
        values = np.full((count, 1), value)
        mujoco.mj_initSensorHistory(
            model, data, sensor, times, values, -interval - EARLY_SHARE * model.opt.timestep
        )
