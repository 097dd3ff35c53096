"""A user's machine as a rig whose quantities are paths, see paths.py, and its logs' replays.

A log has columns t, and x and u of the joint, or x_JOINT and u_JOINT of each. A replay commands
what was recorded, to every motor. Each command is held until the next sample. A delay that is no
whole number of samples mixes two neighbours, at a rate at which that hardly errs, and which grows
with the steps that are extrapolated. So the replay depends on the delay smoothly, and no physics
step has to divide it.
"""

import dataclasses
import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common.aliases import Array, Data, Fields, Names, Numbers
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.data import frozen_data, keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, users_stacklevel
from smc_mujoco.identification import gauss_newton, records
from smc_mujoco.identification.hidden_starts import HiddenStart, begun, hidden_starts
from smc_mujoco.identification.paths import (
    DELAY,
    FIELDS,
    MAX_DELAY,
    PartNumber,
    parts_of,
)
from smc_mujoco.identification.records import Record
from smc_mujoco.identification.replays import Replays
from smc_mujoco.identification.rig import RecordPart, Rig, Source, Values
from smc_mujoco.mechanisms.custom.poles import constraint_rate
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.current_motor import CurrentMotor
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.layout import channel_names, driven_names
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import integration
from smc_mujoco.simulation.readings import as_recorded, rotors_read
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Fault
from smc_mujoco.simulation.time_series import TimeSeries
from smc_mujoco.simulation.trace import Trace

MAX_PERIOD = 1e-3  # s, of a replay's commands; chosen: a mixed command then errs by 0.5 us^2 u/J
LONG_STEP = 2e-3  # s, longest physics step of trials and of derivatives; chosen
SLOWEST = 40.0  # Hz: a log of fewer samples a second misses too much of the commands; chosen
STILL = 3.0  # deviations of the noise, or steps of the sensor: less is no motion; chosen
RUN_STEP = 2.5e-4  # s, longest physics step of runs with a delay, which it divides
RELATIVE = (
    "with a gain free, forces and inertias are relative to the model's mass: if the model is too "
    "light, gain, damping, friction and armature are too small by the same share"
)
SETTINGS = "control_period", "u_max", "mechanism", "velocity", "model"  # of a scenario, kept


@frozen_data
class LogPart(RecordPart):
    """A part of a log, with the commands of all motors from MAX_DELAY before its start on."""

    u: Array = dataclasses.field(default_factory=lambda: np.zeros((0, 0)))
    before: int = 0  # commands before the start
    period: float = 0.0  # s, between commands

    def held(self, longest: float) -> "LogPart":
        """Return the part with as few commands for each sample as periods up to `longest` take."""
        sample = self.period * self.stride
        times = math.ceil(sample / longest - 1e-9)
        return dataclasses.replace(
            self,
            u=np.repeat(self.u[:: self.stride], times, axis=0),
            before=self.before // self.stride * times,
            period=sample / times,
            stride=times,
        )


@keyword_dataclass
class LogRig(Rig):
    """A user's machine: its quantities are paths, and its records are logs.

    Attributes:
      base: the scenario of the machine.
      plant: its plant, with the numbers of joints that are asked for among the parameters.
      places: quantity -> where it is in a part of the scenario.
    """

    is_own = True

    base: Scenario
    plant: Plant
    places: Mapping[str, PartNumber]

    def drives(self, u_max: float | None = None) -> Scenario:
        """Return a scenario with the drives of the machine's joints, and their bounds."""
        actuator = self.base.actuator or None
        return Scenario.recorded(plant=self.plant, law="none", actuator=actuator, u_max=u_max)

    def values_of_plant(self, values: Numbers | None = None) -> dict[str, float]:
        """Return the parameters of the plant with some values, by default the rig's own."""
        numbers = self.values if values is None else values
        parameters = dict(self.plant.parameters)
        for name in parameters:
            if name in numbers:
                parameters[name] = numbers[name]
        return parameters

    def numbers_of(self, values: Values) -> Fields:
        """Return the fields of a Scenario whose parts and plant have some values."""
        numbers = self.in_order(vars(values))
        parameters = self.values_of_plant(numbers)
        fields: Fields = {"plant": dataclasses.replace(self.plant, parameters=parameters)}
        fields |= {field: parts_of(self.base, field) for field in FIELDS}
        for name, place in self.places.items():
            fields[place.field] = place.put(fields[place.field], numbers[name])
        return {name: value for name, value in fields.items() if value != ()}

    def checked(self, record: Data) -> Record:
        """Return the columns of a log. Raise ScenarioError for one that is too slow, or rests."""
        data = records.checked(record, self.columns, None, self.name)
        rate = 1.0 / records.step_of(data[self.columns.time])
        if rate < SLOWEST:
            raise ScenarioError(
                f"the record of {self.name} has {rate:.3g} samples a second, and what the motors "
                f"did between them is not in it: record {SLOWEST:g} or more a second, or find "
                "friction alone from pairs of speed and torque, by smc.identify_friction"
            )
        if not any(moves(data[name]) for name in self.columns.x):
            largest = max(float(np.std(data[name])) for name in self.columns.x)
            raise ScenarioError(
                f"no joint of {self.name} moves in the record: the largest deviation of a position "
                f"is {largest:.2g}, no more than noise or some steps of the sensor: record a motion"
            )
        return data

    def reading(self, many: Sequence[Source]) -> tuple["Rig", list[Data]]:
        """Return the rig and its logs as columns. A trace counts as what a log of it has."""
        data = []
        for log in many:
            if isinstance(log, Trace):
                columns = {self.columns.time: log.t}
                columns |= records.positions(log, self.columns, noisy=True)
                for i, name in enumerate(self.columns.inputs):
                    columns[name] = log.u[:, i]
                data.append(columns)
            else:
                data.append(self._unwrapped(self._named(log)))
        return self, data

    def _unwrapped(self, log: Data) -> Data:
        """Return a log whose hinges have no jumps by a turn; say of each that had."""
        if not isinstance(log, Mapping):
            return log
        columns = dict(log)
        for name, unit in zip(self.columns.x, self.plant.units, strict=True):
            x = np.asarray(log.get(name, ()))
            if unit != "rad" or x.ndim != 1 or x.dtype.kind not in "iuf" or len(x) < 2:
                continue
            if np.isfinite(x).all() and len(jumps := records.wraps(x)):
                columns[name] = np.unwrap(x)
                warnings.warn(
                    f"column {name} of {self.name} jumps by a turn at {len(jumps)} samples, first "
                    f"at row {int(jumps[0]) + 1}: its encoder wraps, and the jumps are taken out",
                    ScenarioWarning,
                    stacklevel=users_stacklevel(),
                )
        return columns

    def _named(self, log: Data) -> Data:
        """Return the log of one joint with columns x and u, which may be x_JOINT and u_JOINT."""
        if not isinstance(log, Mapping) or self.plant.n > 1:
            return log
        joint = channel_names(self.plant)[0]
        names = {f"{kind}_{joint}": kind for kind in "xu" if kind not in log}
        columns = {}
        for name, values in log.items():
            columns[names.get(name, name)] = values
        return columns

    def fit(self, record: Source) -> dict[str, float]:
        """As `Rig.fit`, from hidden numbers at the start, as a spring's bend, that fit the log."""
        if not self.hidden:
            return super().fit(record)
        repeats = Replays(self, [], self.reading([record])[1], False, whole=True)
        starts = [repeats.start, *(gauss_newton.flanks(repeats) if repeats.plays.any() else ())]
        return self.fits(repeats.data, gauss_newton.starting_states(repeats, starts))[0]

    def part(
        self,
        record: Data,
        start: float | None = None,
        duration: float | None = None,
        closed: bool = True,
    ) -> LogPart:
        """Return what a replay takes from a log."""
        del closed  # the controller of a log is not known
        data = self.checked(record)
        names = self.columns
        period = self.step(data)
        first, last = self.span(data, start, duration)
        hidden = []
        for unknown in self.hidden:
            guesses = unknown.guesses(*self._of_channel(data, unknown), period)
            hidden.append(guesses[first])
        stride = math.ceil(period / MAX_PERIOD - 1e-9)
        u = records.stacked(data, names.inputs)
        ahead = math.ceil(MAX_DELAY / period) + 2
        padded = np.concatenate([np.repeat(u[:1], ahead, axis=0), u])
        commands = np.repeat(padded[first : last + ahead + 1], stride, axis=0)
        state = np.concatenate(records.state(data, names, period, first))
        return LogPart(
            fields={},
            state=np.concatenate([hidden, state]),
            zero={},
            stride=stride,
            u=commands,
            before=ahead * stride,
            period=period / stride,
        )

    def command(self, part: LogPart) -> Array:
        """Return the commands that reach the motors, at each of a replay's, (K, driven)."""
        late = self.values.get(DELAY, self.base.input_delay) / part.period
        samples = math.floor(late)
        share = late - samples
        first = part.before - samples
        count = len(part.u) - part.before
        u = (1.0 - share) * part.u[first : first + count]
        u = u + share * part.u[first - 1 : first - 1 + count]
        return self.of_motors("gain", 1.0) * u + self.of_motors("offset", 0.0)

    def long_steps(self, part: RecordPart) -> Fields:
        """Return the physics step of trials, which each command lasts, too, if dry friction alone
        asks for shorter ones: it changes its direction a little late then.
        """
        assert isinstance(part, LogPart)
        plain = self.repeated(part)
        if plain.exact_friction or plain.actuator or plain.contact:
            return {}
        if plain.resolved.integrator != "RK4":
            return {}
        pole, rate = integration.fastest_pole(plain), constraint_rate(self.plant)
        for longest in (LONG_STEP, part.period):
            step = part.held(longest).period
            resolves_stops = step * rate <= integration.MAX_CONSTRAINT_RATE
            if step * pole <= integration.MAX_POLE and resolves_stops:
                return {"physics_step": step}
        return {}

    def finer(self, part: RecordPart, times: int) -> RecordPart:
        """Return a part with that many times as many commands, if a delay may be between them: it
        mixes two, and a joint that rests breaks away by their mean, the less so the finer they are.
        """
        assert isinstance(part, LogPart)
        late = self.base.input_delay / part.period
        if DELAY not in self.quantities and math.isclose(late, round(late), abs_tol=1e-6):
            return part
        return dataclasses.replace(
            part,
            u=np.repeat(part.u, times, axis=0),
            before=times * part.before,
            period=part.period / times,
            stride=times * part.stride,
        )

    def of_motors(self, kind: str, default: float) -> Array:
        """Return a quantity of each motor, (driven,)."""
        return self._of_joints(driven_names(self.plant), kind, default)

    def _of_joints(self, joints: Sequence[str], kind: str, default: float) -> Array:
        """Return a quantity of each of some joints, (joints,)."""
        values = self.values
        numbers = []
        for joint in joints:
            numbers.append(values.get(f"{joint}.{kind}", default))
        return np.array(numbers)

    @property
    def hidden(self) -> list[HiddenStart]:
        """What no log has at the start of a piece."""
        return hidden_starts(self.base)

    @property
    def half_plays(self) -> list[float]:
        """Half of the play in which each hidden number stands, rad or m; 0 for what is in none."""
        halves = []
        actuators = self.numbers_of(Values(**self.values)).get("actuator", ())
        for start in self.hidden:
            joint = driven_names(self.plant)[start.channel]
            gap = 0.0
            for part in actuators if start.field == "lead" else ():
                if isinstance(part, Backlash) and joint in part.joint_names(self.plant):
                    gap = part.gap
            halves.append(0.5 * gap)
        return halves

    def hidden_spreads(self, record: Record, period: float) -> list[float]:
        """Return how far each hidden number varies in a log."""
        return [start.spread(*self._of_channel(record, start), period) for start in self.hidden]

    def _of_channel(self, record: Record, start: HiddenStart) -> tuple[Array, Array]:
        """Return the command and the position of the channel of a hidden number, (K,) each."""
        i = start.channel
        return record[self.columns.inputs[i]], record[self.columns.x[i]] - self.zeros[i]

    @property
    def springs(self) -> list[str]:
        """The numbers that are the stiffness of a spring before a joint."""
        names = []
        for name, place in self.places.items():
            part = parts_of(self.base, place.field)[place.part]
            if isinstance(part, ElasticJoint) and place.name == "stiffness":
                names.append(name)
        return names

    def in_order(self, values: Numbers, apart: float = 1.0) -> dict[str, float]:
        """Return values in which the level at rest of a friction is at least that while sliding,
        times `apart`, where both are found: a search may pass from either side to the other.
        """
        ordered = dict(values)
        paths = {place: name for name, place in self.places.items()}
        for name, place in self.places.items():
            parts = parts_of(self.base, place.field)
            at_rest = place.partner(parts)
            if (
                at_rest is not None
                and at_rest in paths
                and place.name == parts[place.part].ordered[0]
            ):
                sliding, resting = sorted((values[name], values[paths[at_rest]]))
                ordered |= {name: sliding, paths[at_rest]: max(resting, apart * sliding)}
        return ordered

    @property
    def zeros(self) -> Array:
        """What the encoders read at 0, (n,)."""
        return self._of_joints(channel_names(self.plant), "zero", 0.0)

    def repeated(
        self, part: RecordPart, rounded: bool = False, state: Array | None = None, **changes: Any
    ) -> Scenario:
        """Return the scenario that repeats a part of a log; see `Rig.repeated`. A physics step that
        is longer than a command's period makes that as long.
        """
        assert isinstance(part, LogPart)
        if changes.get("physics_step", 0.0) > part.period:
            part = part.held(changes["physics_step"])
        fields = self.numbers_of(Values(**self.values))
        # the machine has had these commands, whatever its limits are
        fields["plant"] = dataclasses.replace(fields["plant"], limits=(), reach=None)
        start = np.array(part.state if state is None else state, float)
        hidden, motion = np.split(start, [len(self.hidden)])
        x, v = np.split(motion, 2)
        x = x - self.zeros
        if self.hidden:
            fields["actuator"] = begun(fields["actuator"], self.plant, self.hidden, hidden)
            for unknown, value in zip(self.hidden, hidden.tolist(), strict=True):
                if unknown.channel in self.rotors_read:  # the joint lags behind what is read
                    if unknown.field == "lead":
                        x[unknown.channel] -= value
                    elif unknown.field == "lead_rate":
                        v[unknown.channel] -= value
        if sensors := fields.get("sensor"):
            plant = fields["plant"]
            for sensor in sensors:
                x[list(sensor.channels(plant))] -= sensor.bias
            if not rounded:
                unrounded = []
                for sensor in sensors:
                    unrounded.append(dataclasses.replace(sensor, counts=math.inf))
                fields["sensor"] = tuple(unrounded)
        u = self.command(part)
        times = part.period * np.arange(len(u))
        # arrays are read faster than lists
        references = [TimeSeries(times, column) for column in u.T]  # pyright: ignore[reportArgumentType]
        replayed: Fields = {
            "law": as_recorded(),
            "reference": tuple(references),
            "duration": float(times[-1]),
            "control_period": part.period,
            "u_max": math.inf,
            "x0": tuple(x),
            "v0": tuple(v),
        }
        return Scenario.recorded(**fields | replayed | changes)

    def predicted(self, trace: Trace) -> Record:
        """Return the columns of a log that a replay gives, with the zeros of its encoders."""
        positions = records.positions(trace, self.columns)
        for name, zero in zip(self.columns.x, self.zeros, strict=True):
            positions[name] = positions[name] + zero
        return positions

    @cached_property
    def rotors_read(self) -> tuple[int, ...]:
        """The channels whose encoder reads the rotor."""
        return rotors_read(self.base)

    @property
    def plays_by_impacts(self) -> list[str]:
        """The plays that an encoder on the joint shows by their impacts alone, whose moments a
        delay moves too, where that is found beside them.
        """
        names = []
        for name, place in self.places.items() if DELAY in self.quantities else ():
            part = parts_of(self.base, place.field)[place.part]
            if not isinstance(part, Backlash) or place.name != "gap":
                continue
            if not {*part.channels(self.plant)} <= {*self.rotors_read}:
                names.append(name)
        return names

    @property
    def units(self) -> dict[str, str]:
        """The unit of each column of a log."""
        joints = dict(zip(self.columns.x, self.plant.units, strict=True))
        return joints | dict(zip(self.columns.inputs, self.base.efforts, strict=False))

    @property
    def cautions(self) -> list[str]:
        """Sentences on gains, and on what runs leave out."""
        cautions = []
        if any(name.endswith(".gain") for name in self.quantities):
            cautions.append(RELATIVE)
        for name in self.plays_by_impacts:
            cautions.append(
                f"{name} is seen from the joint alone, by the moments of its impacts, which "
                f"{DELAY} moves too: both may be off by more than their errors; give the delay, or "
                "an encoder on the motor's side"
            )
        if absent := self.not_in_runs:
            cautions.append(
                f"replays have {', '.join(absent)}, and runs of the machine leave it out: "
                "a scenario has one Fault, and zeros of encoders are of their log"
            )
        return cautions

    def condition_fields(self) -> Fields:
        """Return the fields of a condition under which the user's own machine has the rig's values:
        those of the model as a mismatch, which a law does not know. What the machine's file has is
        left out, so the condition suits the machine with ideal motors and with fewer joints, too.
        """
        fields = of_runs(self, Values(**self.values))
        before = self.plant.parameters
        mismatch = {}
        for name, value in fields.pop("plant").parameters.items():
            change = value if name in self.plant.added else value / before[name]
            if change != (0.0 if name in self.plant.added else 1.0):
                mismatch[name] = change
        bare = Scenario.recorded(plant=self.plant, law="none")  # has the drives of the plant's file
        changed = {}
        for name in (*FIELDS, "fault", DELAY, "physics_step"):
            if name in fields and fields[name] != getattr(bare, name):
                changed[name] = fields[name]
        return changed | ({"mismatch": mismatch} if mismatch else {})

    @property
    def not_in_runs(self) -> Names:
        """The quantities that replays have and runs of the machine leave out."""
        joints = driven_names(self.plant)
        motors = []
        zeros = []
        faulty = set()
        for name in self.quantities:
            joint, _, kind = name.rpartition(".")
            if kind == "zero" and joint:
                zeros.append(name)
            elif joint and (kind == "offset" or (kind == "gain" and not self.base.force_command)):
                motors.append(name)
                if joint in joints:
                    faulty.add(joint)
        return tuple(zeros + (motors if len(faulty) > 1 else []))


def moves(x: Array) -> bool:
    """Return whether a column of positions varies by more than noise and rounding."""
    return bool(np.std(x) > STILL * max(records.white_noise(x), records.sensor_step(x)))


def of_runs(rig: LogRig, values: Values) -> Fields:
    """Return the fields of a Scenario of the machine with some values: in runs a delay is a whole
    number of physics steps, a gain is that of a motor whose u is a current, and an offset is a
    Fault from the start.
    """
    base = rig.base
    fields = rig.numbers_of(values)
    for name in SETTINGS:
        if (value := getattr(base, name)) is not None:
            fields[name] = value
    if late := vars(values).get(DELAY, base.input_delay):
        step = base.control_period / math.ceil(base.control_period / RUN_STEP - 1e-9)
        fields |= {DELAY: round(late / step) * step, "physics_step": step}
    for i, joint in enumerate(driven_names(rig.plant)):
        gain = vars(values).get(f"{joint}.gain", 1.0)
        bias = vars(values).get(f"{joint}.offset", 0.0)
        if gain != 1.0 and base.force_command:  # u is in the unit of the log, a current
            largest = base.plant.limits[i] if base.plant.limits else math.inf
            motor = CurrentMotor(gain, largest, on=(joint,))
            parts = fields.get("actuator", ())
            drives = [part for part in parts if part.drives]
            beside = [part for part in parts if not part.drives]
            fields["actuator"] = (*drives, motor, *beside)
            gain, bias = 1.0, bias / gain
        alone = f"{joint}.offset" not in rig.not_in_runs and f"{joint}.gain" not in rig.not_in_runs
        if (gain, bias) != (1.0, 0.0) and alone:
            on = joint if rig.plant.driven > 1 else None
            fields["fault"] = Fault(at=0.0, gain=gain, bias=bias, on=on)
    return fields
