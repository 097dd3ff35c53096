"""Preparation of a run: its functions and its model, compiled, and the record that the callback
reads.

    prepared = prepare(scenario)              # functions, mechanism, key
    record[i], arrays = pack(prepared, log)   # see state.py

What does not compile is called in Python; `prepared.why_not` says what.
"""

import contextlib
import dataclasses
import functools
import re
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common import mjcb
from smc_mujoco.common.errors import BrokenLawError, ScenarioError, shown, unknown
from smc_mujoco.common.jit import NotCompilable, Uncompiled
from smc_mujoco.control import joint_law
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import JointMeasurement
from smc_mujoco.control.law import Measurement
from smc_mujoco.control.properties import read_by
from smc_mujoco.mechanisms.hardware.feedforward import ON, Ahead, Feedforward
from smc_mujoco.mechanisms.hardware.moments import CHANNEL_STATE, DRIVE, PART, READER, Run
from smc_mujoco.mechanisms.hardware.part import Friction, Part
from smc_mujoco.mechanisms.plant import Native, Plant
from smc_mujoco.simulation import (
    agreement,
    cfunctions,
    exogenous,
    joint_controller,
    part_jump,
    philox,
    python_functions,
    state,
)
from smc_mujoco.simulation.model import (
    Mechanism,
    check_start,
    keeps_torques,
    mechanism,
    mixer,
    with_values,
)
from smc_mujoco.simulation.scenario import Resolved, Scenario
from smc_mujoco.simulation.signals import Constant, PerChannel, Push, Signal

DATA_BYTES = 176 * 2**10  # of an mjData without channels; measured
CHANNEL_BYTES = 2 * 2**10  # of an mjData per channel; measured
# of jit.attempting, and of numba
RETURNS_OTHERS = re.compile(r"it returns (None|\d+ numbers) instead of")
UNKNOWN_FIELD = re.compile(
    r"Unknown attribute '(\w+)' of type (Measurement|JointMeasurement|Reading|Parameters)\b"
)
FIELDS = {record.__name__: record._fields for record in (Measurement, JointMeasurement, Reading)}
# the records of arrays, where they are no FUNCTIONs
KINDS = {
    "disturbances": state.DISTURBANCE,
    "parts": PART,
    "compensations": PART,
    "drives": DRIVE,
    "readers": READER,
}
# of a delayed sensor's history, per channel and reading, in mjData and in the Batch; measured
READING_BYTES = 67


@dataclasses.dataclass(frozen=True, slots=True)
class Prepared:
    """A scenario that is ready to run."""

    scenario: Scenario  # not resolved
    why_not: str  # what does not compile, in one sentence; "" if all functions are compiled
    mechanism: Mechanism
    key: Hashable  # equal for scenarios that can share a Batch

    @property
    def bytes(self) -> int:
        """Memory of its simulation: log, mjData, record, and the history of a delayed sensor."""
        s = self.scenario.resolved
        surfaces = filter(None, (s.surface,))
        users = (s.law, s.velocity, *surfaces, *s.disturbance)
        memories = sum(user.memory for user in users)
        of_channel = memories + s.input_delay / s.control_period + 20
        numbers = 200 + s.plant.n * of_channel
        if s.law.joint:
            numbers += joint_law.stored_dtype(s.plant.n).itemsize / 8
        per_channel = (
            state.LOG.itemsize * (s.samples + 1) + CHANNEL_BYTES + READING_BYTES * s.readings
        )
        own = per_channel * s.plant.n + 8 * numbers
        return int(own + state.SIMULATION.itemsize + DATA_BYTES)


def prepare(scenario: object) -> Prepared:
    """Return a scenario with its functions and its mechanism compiled, after a check of its start
    and its code.
    """
    if isinstance(scenario, Prepared):
        return scenario
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"cannot run {shown(scenario)}: give a smc.Scenario")
    for part in (*scenario.law.parts, scenario.surface, scenario.resolved.velocity):
        if part is not None and part.function is None:
            raise ScenarioError(
                f"{part.kind} {part.name!r} came from a file without its code: give the {part.kind}"
            )
    shared = mechanism(scenario)
    check_start(shared, scenario)
    key = shared, scenario.control_period, scenario.samples
    reason = why_not_compiled(scenario)
    _refuse_mistakes(scenario.resolved, reason)
    part_jump.check_jump(scenario.resolved)
    return Prepared(scenario, reason, shared, key)


def why_not_compiled(scenario: Scenario) -> str:
    """Return what of a scenario does not compile, in one sentence; "" if all functions do."""
    try:
        _compile(scenario.resolved)
    except NotCompilable as error:
        return str(error)
    return ""


def _refuse_mistakes(s: Resolved, reason: str) -> None:
    """Raise BrokenLawError if a component does not compile for a reason that would end each run in
    Python, too.
    """
    about = reason.partition(" does not compile: ")[0]
    broken = None
    for part in (*s.law.parts, s.surface, s.velocity):
        if part is not None and about == f"{part.kind} {part.name!r}":
            broken = part
            break
    if broken is not None and (mistake := RETURNS_OTHERS.search(reason)):
        returned = re.sub("^1 numbers", "1 number", mistake[1])
        right = {"law": "u and s", "surface": "s and v_eq"}.get(broken.kind, "a velocity")
        raise BrokenLawError(f"{about} returns {returned}: return {right}")
    if broken is not None and (mistake := UNKNOWN_FIELD.search(reason)):
        record = FIELDS.get(mistake[2], ()) or broken.gains
        where = "y" if mistake[2] in FIELDS else "gains"
        sentence = unknown(where, mistake[1], record)
        hint = str(sentence).partition(": ")[2]
        raise BrokenLawError(f"{about} reads {where}.{mistake[1]}, which is not there: {hint}")


def _compile(s: Resolved) -> None:
    """Compile and check every function of a scenario, for `pack`; NotCompilable names the first
    that has to be called in Python.
    """
    signals = (
        *dict.fromkeys(s.references),
        *filter(None, (s.feedforward_signal, *s.noise.errors)),
        *s.disturbance,
    )
    for signal in signals:
        cfunctions.signal_values(signal)  # refuses data that compiled code would misread
    for component in filter(None, (*s.law.parts, s.surface, s.velocity)):
        agreement.check_component(component, s.plant.n, s.plant.driven)
    if not s.plant.by_mujoco:
        cfunctions.compile_nominal(s.plant)
    for signal in signals:
        agreement.check_signal(signal)
    beside = [(sensor, "read") for sensor in s.sensors]
    beside += [(part, "steady") for part in s.compensated]
    for part, kind in (*s.acting, *beside):
        agreement.check_part(part, kind, lambda part=part: part.numbers(run_of(s, part))[0])


def references(s: Resolved) -> tuple[Signal, ...]:
    """Return the reference of all channels, or those of the driven channels if they differ; also
    those of measured channels if the law may read them.
    """
    if reads_measured(s):
        goals = s.plant.goal or (0.0,) * s.plant.free
        rest = [Constant(goal) for goal in goals]
        return (*s.references, *rest)[: s.plant.n]
    if isinstance(s.reference, PerChannel):
        return s.references
    return (s.reference,)


def reads_measured(s: Resolved) -> bool:
    """Return whether channels without an actuator have a reference too."""
    return s.plant.measured > 0 or (s.law.joint and s.plant.free > 0)


@dataclasses.dataclass(frozen=True, slots=True)
class Packed:
    """The arrays whose addresses are in a simulation's record.

    They must exist as long as the simulation.
    """

    numbers: np.ndarray  # gains, memories and all else that is float64
    disturbances: np.ndarray  # (m,) DISTURBANCE
    laws: np.ndarray  # (driven,) FUNCTION; (0,) if all channels have the same
    references: np.ndarray  # (referenced,) FUNCTION; (0,) if all channels have the same
    parts: np.ndarray  # that act, on each of their joints, (p,) PART
    compensations: np.ndarray  # of friction, on each of its joints, (c,) PART
    drives: np.ndarray  # (n,) DRIVE
    readers: np.ndarray  # (n,) READER; (0,) without a sensor
    mixer: np.ndarray  # (actuators, 8) of a free body; (0, 8) for other plants
    python: list[Any]  # the PythonFunctions that are called
    nominal: Any  # a Native, if MuJoCo computes the nominal model and the law uses it; else None


def pack(prepared: Prepared, log: np.ndarray, python: bool = False) -> tuple[tuple, Packed]:
    """Return a simulation's record, as a tuple for an array of SIMULATION, and the arrays that it
    points to.

    The log, (K + 1, n) LOG, is written at samples. It and `prepared` must outlive the run. With
    `python`, no function is compiled but the models that MuJoCo computes.
    """
    s = prepared.scenario.resolved
    mechanism = prepared.mechanism
    buffer = Functions(s, python)
    nominal = _native_nominal(s)
    tables = _tables(prepared, buffer)
    values = _shared_functions(s, nominal, buffer)
    values |= settings(s) | compensation(s)
    values |= _moments(prepared, tables["parts"], buffer)
    values |= _arrays(s, buffer)
    if s.law.joint:
        values |= _joint_measurement(s, nominal, values, buffer)
    for name, shared in (("laws", "law"), ("references", "reference")):
        values[shared] = tables[name][0]
        if len(tables[name]) == 1:
            tables[name] = []
    numbers = buffer.array()
    arrays = {}
    for name, rows in tables.items():
        kind = KINDS.get(name, state.FUNCTION)
        arrays[name] = np.array([buffer.as_tuple(kind, row) for row in rows], kind)
    for name, array in arrays.items():
        if len(array):
            values[name] = state.address(array)
    values |= {
        "n": s.plant.n,
        "driven": s.plant.driven,
        "partners": s.plant.free - s.plant.measured,
        "referenced": len(references(s)) if reads_measured(s) else s.plant.driven,
        "nq": mechanism.model.nq,
        "nv": mechanism.model.nv,
    }
    rows = mixer(s.plant)
    if len(rows):
        values |= {"actuators": len(rows), "mixer": state.address(rows)}
    values["keeps_torques"] = keeps_torques(rows)
    values |= {"slots": state.address(mjcb.slots())}
    values |= {"samples": len(log), "disturbance_count": len(s.disturbance)}
    values |= _rare_moments(s, rows)
    values["part_count"] = len(arrays["parts"])
    values["compensated"] = len(arrays["compensations"])
    channels = state.address(mechanism.channels)
    values |= {"channels": channels, "log": state.address(log)}
    return buffer.as_tuple(state.SIMULATION, values), Packed(
        numbers,
        **arrays,
        python=buffer.python,
        nominal=nominal,
        mixer=rows,
    )


class Functions(state.Buffer):
    """The numbers of a run, and its functions: compiled, or called in Python if they do not compile
    or `called` is wanted.
    """

    def __init__(self, s: Resolved, called: bool):
        super().__init__()
        self.s = s
        self.called = called
        self.python: list[Any] = []

    def component(self, c: Component) -> Any:
        """Return a law, a surface or an estimator."""
        return self._compiled_or_called(cfunctions.compile_component, "of_component", c, self.s)

    def laws(self) -> list[Component]:
        """Return the laws of the driven channels, or one for all.

        It is one for each channel if they may keep state in Python.
        """
        law = self.s.law
        driven = self.s.plant.driven
        if isinstance(law.function, Uncompiled) and not law.joint:
            return [law.of_channel(i) for i in range(driven)]
        return law.of_channels(driven)

    def signal(self, signal: Signal) -> Any:
        """Return a reference, a disturbance or another signal."""
        return self._compiled_or_called(cfunctions.compile_signal, "of_signal", signal)

    def nominal(self, plant: Plant) -> Any:
        """Return a nominal model that is not MuJoCo's."""
        return self._compiled_or_called(cfunctions.compile_nominal, "of_nominal", plant)

    def part(self, part: Part, kind: str) -> Any:
        """Return a function of a part, see hardware/moments.py."""
        if kind not in cfunctions.OF_JOINTS:
            return cfunctions.compile_part(part, kind)
        compiler = functools.partial(cfunctions.compile_part, kind=kind)
        return self._compiled_or_called(compiler, "of_part", part, kind)

    def _compiled_or_called(
        self, compiler: Callable, caller: str, thing: Any, *arguments: Any
    ) -> Any:
        if not self.called:
            with contextlib.suppress(NotCompilable):
                return compiler(thing)
        self.python.append(getattr(python_functions, caller)(thing, *arguments))
        return self.python[-1]


def _function(
    compiled: Any, values: Any, buffer: Functions, memory: int = 0, channels: int = 1
) -> dict[str, int]:
    """Return the fields of a FUNCTION.

    Its parameters, and its memory in each channel, go into the buffer.
    """
    parameters = buffer.put(values)
    first = buffer.reserve(memory * channels)
    return {
        "address": compiled.address,
        "parameters": parameters,
        "memory": first,
        "stride": 8 * memory,
    }


def _tables(prepared: Prepared, buffer: Functions) -> dict[str, list[dict[str, Any]]]:
    """Return the laws and references of the channels, the disturbances, and the parts, as fields of
    records.
    """
    s = prepared.scenario.resolved
    n = s.plant.n
    reserved = buffer.reserve(s.law.memory * s.plant.n)
    memory = {"memory": reserved, "stride": 8 * s.law.memory}
    size = s.plant.driven if s.law.joint else 1  # numbers of a gain
    laws = []
    for law in buffer.laws():
        function = _function(buffer.component(law), law.numbers(size), buffer)
        laws.append(function | memory)
    disturbances = []
    for i, d in enumerate(s.disturbance):
        body = -1
        if isinstance(d, Push):
            body = 6 * prepared.mechanism.model.body(d.body).id
        disturbances.append(
            {
                "function": _signal(d, buffer, n),
                "stream": s.noise_stream(i),
                "cartesian": d.cartesian,
                "sees": d.sees,
                "air": d.air,
                "peak": d.along,
                "body": body,
            }
        )
    return {
        "laws": laws,
        "references": [_signal(signal, buffer) for signal in references(s)],
        "parts": _parts(prepared, buffer),
        "compensations": _compensations(prepared, buffer),
        "drives": _drives(s),
        "readers": _readers(prepared, buffer),
        "disturbances": disturbances,
    }


def _shared_functions(s: Resolved, nominal: Native | None, buffer: Functions) -> dict[str, Any]:
    """Return the functions of a record that all channels share, except law and reference."""
    fields = {}
    for c in filter(None, (s.velocity, s.surface)):
        compiled = buffer.component(c)
        gains = c.gains.values()
        fields[c.kind] = _function(compiled, gains, buffer, c.memory, s.plant.n)
    if nominal is not None:
        fields["dynamics" if s.law.joint else "nominal"] = _function(
            nominal, nominal.values, buffer
        )
    elif not s.plant.by_mujoco:
        function = buffer.nominal(s.plant)
        fields["nominal"] = _function(function, nominal_values(s), buffer)
    signals = {"feedforward": s.feedforward_signal}
    signals |= {"position_error": s.noise.position_error, "velocity_error": s.noise.velocity_error}
    for name, signal in signals.items():
        if signal:
            fields[name] = _signal(signal, buffer)
    return fields


def _signal(signal: Signal, buffer: Functions, channels: int = 1) -> dict[str, int]:
    """Return the fields of a signal's FUNCTION."""
    compiled = buffer.signal(signal)
    return _function(compiled, cfunctions.signal_values(signal), buffer, signal.memory, channels)


def compensation(s: Resolved) -> dict[str, Any]:
    """Return the numbers of a record that set the compensation of friction."""
    feedforward = s.feedforward
    if not isinstance(feedforward, Feedforward):
        return {}
    share = 1.0 + feedforward.error
    on = ON.index(feedforward.on)
    return {"share": share, "eps": feedforward.eps, "compensates_on": on}


def reference_leads(s: Resolved) -> list[float]:
    """Return by how much the reference that the law of each driven channel sees leads at full
    speed, rad (m): through a play.
    """
    feedforward = s.feedforward
    if not isinstance(feedforward, Feedforward):
        return [0.0] * s.plant.driven
    leads = []
    for i, lead in enumerate(feedforward.leads(s)):
        moves = lead and feedforward.moves_reference(s, i)
        leads.append((1.0 + feedforward.error) * lead if moves else 0.0)
    return leads


def settings(s: Resolved) -> dict[str, Any]:
    """Return the numbers of a record that set clock, delay and noise."""
    pause, samples = s.clock.pauses(s.control_period, s.physics_step)
    return {
        "steps": s.steps,
        "stages": s.stages,
        "step": s.physics_step,
        "period": s.control_period,
        "jitter": s.clock.jitter_steps(s.physics_step),
        "pause": pause,
        "pause_samples": samples,
        "pause_phase": pause_phase(s),
        "missed": s.clock.missed,
        "delay": s.delay_steps,
        "fault_step": s.fault_step,
        "fault_gain": s.fault.gain if s.fault else 1.0,
        "fault_bias": s.fault.bias if s.fault else 0.0,
        "stuck": s.fault is not None and s.fault.stuck,
        "failing": s.failing(),
        "seed": s.seed,
        "sigma_x": s.noise.position,
        "sigma_v": s.noise.velocity,
        "uses_model": s.model != "none",
    }


def _arrays(s: Resolved, buffer: Functions) -> dict[str, Any]:
    """Return the arrays of a record in which the callback keeps measurements, commands and
    states.
    """
    n = s.plant.n
    width = s.plant.n if s.law.joint else 1
    late = not s.clock.regular  # a late command may take effect after the next sample began
    slots = s.delay_steps // s.steps + 1 + late
    seen = {"n": n}
    for name in ("x", "v", "u"):
        seen[name] = buffer.reserve(n)
    return {
        "seen": seen,
        "a": buffer.reserve(n),
        "other_forces": buffer.reserve(n) if s.model == "true" else 0,
        "width": width,
        "commands": buffer.reserve(2 * width),
        "states": buffer.reserve(n * len(CHANNEL_STATE.names or ())),
        "delay_slots": slots,
        "delay_buffer": buffer.reserve(slots * n),
    }


def nominal_values(s: Resolved) -> list[float]:
    """Return the values of the plant's parameters as the law's model has them: true ones in the
    model "true".
    """
    values = s.plant.parameters
    if s.model == "true":
        values = vars(s.plant.values(s.factors(0)))
    return [values[name] for name in s.plant.parameters]


def pause_phase(s: Resolved) -> int:
    """Return by how many samples the first pause of the controller comes earlier than the
    others.
    """
    samples = s.clock.pauses(s.control_period, s.physics_step)[1]
    bits, _ = philox.random_words(s.seed, 0, philox.PAUSE, 0)
    return int(bits * 2.0**-53 * samples)


def _rare_moments(s: Resolved, mixer: np.ndarray) -> dict[str, int]:
    """Return the addresses of what only some runs do, compiled for them alone."""
    functions = {}
    if s.disturbance:
        functions["disturb"] = exogenous.disturb
    if s.law.joint:
        functions["ask_joints"] = joint_controller.ask
    if len(mixer):
        functions["mix"] = joint_controller.mix
    addresses = {}
    for name, function in functions.items():
        addresses[name] = cfunctions.compile_moment(function).address
    return addresses


def _joint_measurement(
    s: Resolved, nominal: Native | None, functions: Mapping[str, Any], buffer: Functions
) -> dict[str, Any]:
    """Return the fields of a record that only a law of many joints has."""
    size = joint_law.stored_dtype(s.plant.n).itemsize // 8
    fields: dict[str, Any] = {"joint": buffer.reserve(size)}
    if nominal is not None:
        fields["handle"] = {
            **s.plant.nominal.handles(),
            "parameters": functions["dynamics"]["parameters"],
            "units": buffer.put(drive.gain for drive in s.drive_train.nominal),
        }
    return fields


def _native_nominal(s: Resolved) -> Native | None:
    """Return the nominal model for one simulation if MuJoCo computes it and the law uses it, else
    None.
    """
    if not s.plant.by_mujoco:
        return None
    if not s.law.joint:
        values = dict(zip(s.plant.parameters, nominal_values(s), strict=True))
        return s.plant.nominal.native(values)
    if s.model == "none":
        return None
    at_rest = "g" in read_by(s.law.function)
    return s.plant.nominal.native_dynamics(s.plant.parameters, s.plant.tip, at_rest)


def run_of(scenario: Scenario, part: Part) -> Run:
    """Return what the numbers of a part may depend on."""
    s = scenario.resolved
    joints = [i for i in part.channels(s.plant) if i >= 0]

    def locate() -> list[int]:
        return mechanism(scenario).channels["qvel"][joints].tolist()

    def draw() -> list[float]:
        return [philox.random_words(s.seed, i, philox.REFILL, 0)[0] * 2.0**-53 for i in joints]

    return Run(
        n=len(joints),
        driven=s.plant.driven,
        step=s.physics_step,
        rk4=s.integrator == "RK4",
        x0=[s.x0[i] for i in joints],
        v0=[s.v0[i] for i in joints],
        locate=locate,
        load=lambda step: with_values(mechanism(scenario).model, scenario, step),
        jump_step=s.jump_step,
        draw=draw,
    )


def _parts(prepared: Prepared, buffer: Functions) -> list[dict[str, Any]]:
    """Return the PARTs of the parts that act, one for each of their joints. Their numbers go into
    the buffer.
    """
    s = prepared.scenario.resolved
    channels = prepared.mechanism.channels
    rows = []
    for part, kind in s.acting:
        run = run_of(prepared.scenario, part)
        numbers = list(map(buffer.put, part.numbers(run)))
        memories = list(map(buffer.put, part.start(run)))
        compiled = buffer.part(part, kind)
        frictions = part.friction_rows(run)
        for place, i in enumerate(part.channels(s.plant)):
            ctrl = -1
            if kind == "force" and part.is_drive:
                ctrl = channels["ctrl"][i]
            function = {"address": compiled.address, "memory": memories[place]}
            function["parameters"] = numbers[place if len(numbers) > 1 else 0]
            row = {
                "function": function,
                "channel": i,
                "ctrl": ctrl,
                "row": frictions.get(place, -1),
            }
            rows.append(row | {"acts": kind == "act", "staged": kind == "stage_force"})
    return rows


def compensations(scenario: Scenario) -> Iterator[tuple[Friction | Ahead, int, Sequence[float]]]:
    """Yield each part of u that compensates, each of its channels, and its numbers there."""
    s = scenario.resolved
    for part in s.compensated:
        numbers = part.numbers(run_of(scenario, part))
        for place, i in enumerate(part.channels(s.plant)):
            yield part, i, numbers[place if len(numbers) > 1 else 0]
    if isinstance(s.feedforward, Feedforward):
        for i, lead in enumerate(s.feedforward.leads(s)):
            if lead and not s.feedforward.moves_reference(s, i):
                yield Ahead(), i, (lead * s.drive_train.nominal[i].gain,)


def _compensations(prepared: Prepared, buffer: Functions) -> list[dict[str, Any]]:
    """Return the PARTs of the frictions that are compensated, one for each of their joints."""
    rows = []
    for part, i, numbers in compensations(prepared.scenario):
        compiled = buffer.part(part, "steady")
        function = _function(compiled, numbers, buffer, part.memory)
        rows.append({"function": function, "channel": i})
    return rows


def put_after_jump(prepared: Prepared, packed: Packed) -> None:
    """Write the numbers that parts have from a jump on into the arrays of a simulation."""
    _, *later = prepared.scenario.resolved.machines
    for after in later:
        parts = [*(part for part, _ in after.acting), *after.sensors]
        part_jump.put(after, packed, (run_of(after, part) for part in parts))


def _drives(s: Resolved) -> list[dict[str, Any]]:
    """Return the DRIVE of each channel; those without an actuator give no force."""
    summed = set()
    for part, _ in s.acting:
        if part.sums_force:
            summed |= {*part.channels(s.plant)}
    limits = [*s.limits, *[0.0] * s.plant.free]
    leads = reference_leads(s)
    train = s.drive_train
    torques, scales = train.torques, train.scales
    rows = []
    for i, nominal in enumerate(train.nominal):
        row = {"limit": limits[i], "scale": 1.0, "sums_force": i in summed}
        if i < s.plant.driven:
            row |= {"scale": scales[i], "torque": torques[i]._asdict()}
            row["accelerates"] = train.motors[i].accelerates
            row["lead"] = leads[i]
        rows.append(row | nominal._asdict())
    return rows


def _readers(prepared: Prepared, buffer: Functions) -> list[dict[str, Any]]:
    """Return the READER of each channel; none without a sensor."""
    s = prepared.scenario.resolved
    rows: list[dict[str, Any]] = [{}] * s.plant.n
    for sensor in s.sensors:
        numbers = sensor.numbers(run_of(prepared.scenario, sensor))[0]
        compiled = buffer.part(sensor, "read")
        for i in sensor.channels(s.plant):
            function = _function(compiled, numbers, buffer, sensor.memory)
            rows[i] = {"function": function, "period": sensor.period or 0.0, "delay": sensor.delay}
    return rows if s.sensors else []


def _moments(prepared: Prepared, rows: list[dict[str, Any]], buffer: Functions) -> dict[str, Any]:
    """Return the fields of a record that say what the parts of these PARTs do."""
    s = prepared.scenario.resolved
    fields: dict[str, Any] = {
        "exerts": any(not row["acts"] and row["ctrl"] < 0 for row in rows),
        "reaches": any(row["acts"] for row in rows) or bool(s.disturbance),
    }
    for part, _ in s.acting:
        if part.push is not None:
            address = buffer.part(part, "push").address
            fields["push"] = {"function": {"address": address}}
    return fields
